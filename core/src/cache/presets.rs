//! Every tuned number of radiance caching, from an outline of the world.

use super::eye::RaySettings;
use super::kind::Kind;
use super::lobe;
use super::photons::PhotonEffort;
use super::radius::Limits;
use super::resolved;
use super::settings::{Effort, LEAST_RAYS, MOST_RAYS, Settings};
use crate::math::float;
use crate::multiple_scatter::{self, Lengths};
use crate::phase::Phase;
use crate::sh;
use crate::transmittance::thickness::Steps;
use crate::world::Outline;

/// Random walks of each of the first two estimates of a record of multiple scattering. More: time where records are many, whose noise a picture averages; fewer: radii and
/// guides are noise. What noise they leave in a picture further estimates take away.
pub(super) const WALKS: u32 = 128;

/// Directions of the other kinds, as a share of [`WALKS`]. Light of surfaces varies least from direction to direction; of single
/// scattering only lights with extent need any.
const SHARES: [(Kind, f64); 4] =
    [(Kind::Single, 1.0 / 16.0), (Kind::Surface, 1.0), (Kind::Multiple, 1.0), (Kind::Irradiance, 3.0)];

/// Samples of any kind at least: of fewer, one decides how far a record reaches.
pub(super) const LEAST_SAMPLES: u32 = 16;

/// `ε` of Eq. 34 for single scattering, light of surfaces, multiple scattering, and irradiance. Larger: borders of shadows blur, corners turn too
/// bright, light that falls off like 1/r is carried too far. Smaller: records, and time, by the square.
const TOLERANCES: [f32; 4] = [0.2, 2.0, 0.8, 0.35];

/// Greatest radius as a share of the size of the bounds, for single scattering, multiple scattering and irradiance, and for light of surfaces. Larger: light is carried round
/// corners that no gradient knows; smaller: more records where nothing changes.
const REACHES: [f32; 2] = [0.1, 0.06];

/// Least radius as a share of the size of the bounds. Smaller: borders of shadows swallow records.
const LEAST_REACH: f32 = 1e-3;

/// Reach over the distance to the nearest other surface, of irradiance and of light of surfaces. Larger: dark
/// corners turn out too bright. Smaller: records cost more than they mend.
const CLEARANCES: [f32; 2] = [0.3, 1.0];

/// Greatest radius in free paths, of light of surfaces and of multiple scattering: see [`Effort::free_paths`]. Light of a wall falls off
/// within one free path, and so does the light of the outermost layer of fog. Larger: borders of fog blur; smaller: records, by the cube.
const FREE_PATHS: [f32; 2] = [0.7, 1.3];

/// Cells of light for each free path along the longest side of the bounds, and the least and the most of them: memory, and photons, go by the cube. More:
/// noise in each, and walks that pass many before one is known; fewer: light near lamps and in the outermost layer of fog is blurred.
const CELLS_PER_FREE_PATH: f32 = 1.0;

/// See [`CELLS_PER_FREE_PATH`].
const CELLS: [u32; 2] = [32, 40];

/// Photons, and their flights, at most; in fog that hardly absorbs, photons fly for long, and where a cloud is small beside its bounds, most of them meet nothing. More:
/// time; fewer: dark parts of a picture, or all of a cloud, are too bright or too dark as a whole, for their cells see the same few photons.
const PHOTONS: u32 = 1 << 22;

/// See [`PHOTONS`].
const FLIGHTS: f64 = 6e7;

/// Photons that are to light nearly every cell before their noise is told. Fewer: few cells are known, and walks, which then go on, take longer than the photons;
/// more: time for photons that are not needed.
const ENOUGH: u32 = 80;

/// The same at least, of rough pictures, whose walks are few. Fewer: cells where walks may not end, which make pictures too dark, for walks that then go on are few; more: time.
const FEWEST: f64 = 48.0;

/// Part of the error asked for that noise of photons may have in a picture. All records of a place share it: larger is clouds of noise, smaller is time.
const PHOTON_NOISE: f64 = 0.45;

/// The same of coarse irradiance, which lights all records. Larger: spots of walls that shine on all sharply scattering fog before them; smaller: time.
const GROUND_NOISE: f64 = 0.25;

/// How often it is estimated once more at most for that, as a few spots may make noise that is told by chance. More: time, where light is hard to find; fewer: noise of spots.
const MOST_OF_GROUND: u32 = 3;

/// How many times as much noise must be told for more photons to be shot. Less: time for little; more: clouds of noise.
const TOO_NOISY: f64 = 1.2;

/// How many times as many photons are shot at once at most, as noise told of few is uncertain. Less: noise is told more often; more: photons that are not needed.
const MOST_MORE: f64 = 16.0;

/// Most vertices of a walk. More: nothing, as roulette ends walks long before; fewer: dense fog that hardly absorbs turns out too dark.
const VERTICES: u32 = 4096;

/// Parts of a picture's light (`shares`) for which the efforts of the kinds that pictures are read from are made. Larger: noise and blur in pictures to which a
/// kind brings much; smaller: time for what nobody sees.
pub(super) const USUAL_SHARES: [f64; 4] = [0.4, 0.15, 0.4, 0.2];

/// How many times the error asked for a kind may have of its own light at most. More: hardly less time; less: time for what nobody sees.
pub(super) const MOST_COARSER: f64 = 8.0;

/// Changes of light over less than this share of the size of the bounds are noise of single samples. Larger: light near walls and lamps
/// is flattened; smaller: their noise makes radii tiny.
const FINEST: f32 = 0.01;

/// Samples of all lights with extent together, for a record of single scattering, and the most of one.
const LIGHT_SAMPLES: [u32; 2] = [128, 16];

/// Parts of a lamp that surfaces look at where the medium varies: see [`RaySettings::lamp_parts`]. More: time; fewer: grain where smoke dims a part of the lamp.
const LAMP_PARTS: u32 = 4;

/// Steps of marching over the resolution of the medium. Longer: rays see less of what varies, and transmittance is slightly too bright; shorter: time.
const STEP: f32 = 3.0;

/// From this error on steps are longer by the root of it, up to twice as long. Larger: first pictures are late; smaller: dense smoke lets too much light in where that shows.
const LONG_STEPS: f32 = 0.04;

/// Greatest [`roughness`]. Larger: what a corner reflects comes from beyond the wall that makes it.
const ROUGHEST: f32 = 3.0;

/// Share of the energy of an expansion that may be left out. Larger: scattering looks more even than it is; smaller: degrees that no eye sees.
const LEFT_OUT: f32 = 2.5e-4;

/// Light of surfaces has an expansion of its own that falls off like this power of the degree: directions to walls are no points.
const SURFACE_FALL_OFF: f32 = 1.5;

/// The relative error that pictures may have unless told otherwise, noise and bias together. All numbers of this file are for it.
pub const USUAL_ERROR: f32 = 0.02;

/// Bounds of the error asked for: below, records take hours; above, a picture tells nothing.
pub const ERROR_BOUNDS: [f32; 2] = [1e-3, 0.5];

/// Greatest factor of tolerances, however large an error is asked for. Larger: gradients say nothing of what light does there; smaller: time
/// that rough pictures do not repay.
const COARSEST: f32 = 1.5;

/// How often records are made anew because an audit has found them wrong. More: time for what finer records do not mend; fewer: what one finer step leaves stays.
pub const MOST_REPAIRS: u32 = 2;

/// Variance of a blind estimate over that of one that knows where light comes from, of as many samples. Larger: noise is taken for less than it is;
/// smaller: for more, and estimates are made that nobody sees.
pub(super) const BLIND: f64 = 2.0;

/// What is left of the variance of records on surfaces once they are averaged with their neighbours. As [`BLIND`].
pub(super) const SMOOTHED: f64 = 0.7;

/// How often records are estimated once more at most. More: time; fewer: noise where light is hard to find.
pub(super) const MOST_ROUNDS: u32 = 32;

/// Variance over what is asked for beyond which a part of a picture gets fewer rounds, in inverse proportion: somewhat more than the most rounds take away. More:
/// minutes for what stays grain; fewer: grain where patience would have helped.
pub(super) const HOPELESS: f64 = 32.0;

/// Part of the most rounds that there is at least. As [`HOPELESS`].
pub(super) const LEAST_HOPE: f32 = 0.125;

/// Part of the noise of a picture by which it falls at least, over the part by which work grows. Less: long fills for little; more: noise.
pub(super) const PAYS: f64 = 0.5;

/// How many times as far the light of corners may be carried as in a picture of the usual error, where only other records see it.
pub(super) fn roughness(error: f32) -> f32 {
    float::sqrt(error / USUAL_ERROR).clamp(1.0, ROUGHEST)
}

/// Part of the error asked for that noise of records may have in a picture.
const NOISE: f64 = 0.8;

/// The noise that records may have in a picture, for an error that is asked for.
pub(super) fn record_noise(error: f32) -> f64 {
    NOISE * f64::from(error)
}

/// How many times as many photons a picture needs in which their noise is so much, where an error is asked for; `None` if they are enough.
pub(super) fn more_photons(noise: f32, error: f32) -> Option<f64> {
    let over = f64::from(noise) / (PHOTON_NOISE * f64::from(error));
    (over > TOO_NOISY).then(|| (over * over).min(MOST_MORE))
}

/// How often coarse irradiance is estimated once more, whose noise in a picture has so much variance after its second estimate, where an error is asked for.
pub(super) fn rounds_of_ground(variance: f64, error: f32) -> u32 {
    let most = GROUND_NOISE * f64::from(error);
    // Casts saturate, and take NaN to 0.
    (libm::ceil(variance / (most * most) - 1.0) as u32).min(MOST_OF_GROUND)
}

/// Part of what is off in regions from which on a kind is to blame. Larger: what several kinds have wrong stays; smaller: records are made anew that are right.
pub(super) const BLAMED: f64 = 0.25;

/// Part of the error asked for from which on a bias of the picture is mended, if there certainly is one. Larger: it stays, and noise is added to it; smaller: time.
pub(super) const MENDED: f64 = 0.5;

/// Samples of records, and photons, that take the place of wrong ones, as a multiple. More: time; fewer: noise that made them wrong stays.
const REPAIR_SAMPLES: u32 = 4;

/// Bounds of the factor of radii and tolerances of such records. Less than the lower: time by its cube; more than the upper: nothing changes.
const REPAIR_BOUNDS: [f64; 2] = [0.3, 0.7];

/// How much finer records must be that are off by `bias` where `most` is allowed: what extrapolation gets wrong goes with the square of radii.
pub(super) fn finer_by(most: f64, bias: f64) -> f32 {
    libm::sqrt(most / bias.abs()).clamp(REPAIR_BOUNDS[0], REPAIR_BOUNDS[1]) as f32
}

impl Effort {
    /// For records that take the place of wrong ones.
    pub(super) fn finer(self, factor: f32) -> Self {
        Self { samples: self.samples.saturating_mul(REPAIR_SAMPLES), ..self.nearer(factor) }
    }

    /// For records that reach less far.
    pub(super) fn nearer(self, factor: f32) -> Self {
        Self {
            tolerance: self.tolerance * factor,
            limits: Limits { max: (self.limits.max * factor).max(self.limits.min), ..self.limits },
            clearance: self.clearance * factor,
            free_paths: self.free_paths * factor,
            ..self
        }
    }
}

impl PhotonEffort {
    /// With as many photons as were found to be needed `before`.
    pub(super) fn no_fewer_than(self, before: Option<Self>) -> Self {
        Self { enough: before.map_or(0, |before| before.enough).max(self.enough), ..self }
    }

    /// For so many times as many photons.
    pub(super) fn more(self, times: f64) -> Self {
        // Casts saturate.
        Self { enough: (f64::from(self.enough) * times) as u32, ..self }
    }

    /// As [`Effort::finer`].
    pub(super) fn finer(self) -> Self {
        Self {
            paths: self.paths.saturating_mul(REPAIR_SAMPLES),
            flights: self.flights.saturating_mul(u64::from(REPAIR_SAMPLES)),
            enough: self.enough.saturating_mul(REPAIR_SAMPLES),
            ..self
        }
    }
}

/// Samples of a pixel at which most pictures have [`USUAL_ERROR`] of noise, each of which takes as long as so many walks of records.
const PIXEL: [f64; 2] = [16.0, 4.0];

/// Noise of pixels over the error asked for where the records take hardly any work, and how fast it falls with `√w`. Larger first, or smaller second: grain; the
/// other way: time for samples.
const PICTURE: [f64; 2] = [1.5, 3.0];

/// See [`Filling::noise_goal`](super::Filling::noise_goal): noise `n` of pixels for an `error` (both relative), by the work `w` of `walks` over that of the samples.
///
/// ```text
/// n = error min(1, 1.5 √max(1, error/0.02)/√(1 + 3 √w))
/// ```
///
/// Noise `n` and the error `r` of records have the least time `w/r² + 1/n²` for their `r² + n²` where `(r/n)² = √w`: `n` is `1/√(1 + √w)` of the whole. The numbers are by
/// trial (decision 22). Rough pictures are better than asked for anyway.
pub(super) fn noise_goal(error: f32, pixels: u32, walks: u64) -> f32 {
    let scale = f64::from(error / USUAL_ERROR);
    let work = f64::from(pixels) * PIXEL[0] / (scale * scale) * PIXEL[1];
    // Without pixels NaN or infinite: written so that these mean all.
    let share =
        PICTURE[0] * libm::sqrt(scale.max(1.0)) / libm::sqrt(1.0 + PICTURE[1] * libm::sqrt(walks as f64 / work));
    if share > 0.0 { error * share.min(1.0) as f32 } else { error }
}

/// The most samples per pixel for that. More: time at edges between black and a lamp, where noise falls no faster; fewer: jagged edges.
pub const MOST_SAMPLES: u32 = 256;

/// Regions along each side of a picture for which an audit tells bias apart, at most. More: memory, and each is known less well; fewer: what
/// is wrong in a corner is lost in the light of its neighbours.
pub(super) const SIDE: u32 = 8;

/// Eye rays of an audit for every region at least. Fewer: standard errors are chance themselves; more: regions are larger.
pub(super) const REGION_RAYS: u32 = 256;

impl Settings {
    /// What suits a world for pictures whose relative error is about `error` ([`USUAL_ERROR`]; within [`ERROR_BOUNDS`]), noise and bias together;
    /// seed 0. What each number does, and what happens when it is larger and smaller, stands in `cache/presets.rs`; change fields at will.
    ///
    /// Noise falls with the root of the number of samples, and what extrapolation gets wrong goes with the square of radii: so for `s`
    /// times the error, samples are divided by `s²` and tolerances multiplied by `√s`. [`Audit`](super::Audit) tells what came of it.
    ///
    /// ```
    /// # use fogbow::{cache::Settings, host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}};
    /// # use fogbow::{medium::Homogeneous, phase::Lobe, spectrum::Spectrum, world::{Outline, World}};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Lobe::HenyeyGreenstein { g: 0.6 })?;
    /// let lamps = [Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?)];
    /// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// let settings = Settings::for_outline(&Outline::of(&world, bounds), 0.02);
    /// // One lamp is connected to; light scattered often is cached.
    /// assert!(settings.single.is_none());
    /// assert_eq!(settings.multiple.unwrap().tolerance, 0.8);
    /// // Half the error: four times the walks.
    /// let finer = Settings::for_outline(&Outline::of(&world, bounds), 0.01);
    /// assert_eq!(finer.multiple.unwrap().samples, 4 * settings.multiple.unwrap().samples);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn for_outline(outline: &Outline, error: f32) -> Self {
        let error = if error.is_nan() { USUAL_ERROR } else { error };
        let error = error.clamp(ERROR_BOUNDS[0], ERROR_BOUNDS[1]);
        let scale = error / USUAL_ERROR;
        let coarser = float::sqrt(scale).min(COARSEST);
        // Noise of rough pictures hides small things: the least radius and what counts as noise of samples grow without a bound.
        let rougher = float::sqrt(scale).max(1.0);
        let walks = (f64::from(WALKS) / f64::from(scale * scale)) as u32;
        let step = STEP * float::sqrt(error / LONG_STEPS).clamp(1.0, 2.0);
        let size = outline.bounds.size().max_element();
        let phase = &outline.phase;
        let free_paths = |kind| match kind {
            Kind::Surface => FREE_PATHS[0] * coarser.min(1.0),
            Kind::Multiple => FREE_PATHS[1] * coarser.min(1.0),
            _ => f32::INFINITY,
        };
        let effort = |kind: Kind, tolerance: f32, degree: usize, most: f32, clearance: f32| Effort {
            tolerance: tolerance * coarser,
            samples: samples(kind, walks).max(LEAST_SAMPLES),
            degree,
            limits: Limits { min: LEAST_REACH * size, max: most * size },
            clearance,
            free_paths: free_paths(kind),
        };
        let degree = |power: u32, fall_off: f32| degree_for(phase, power, fall_off, LEFT_OUT * scale * scale);
        Self {
            error,
            surface: Some(effort(Kind::Surface, TOLERANCES[1], degree(1, SURFACE_FALL_OFF), REACHES[1], CLEARANCES[1])),
            multiple: Some(effort(Kind::Multiple, TOLERANCES[2], degree(2, 0.0), REACHES[0], f32::INFINITY)),
            irradiance: Some(effort(Kind::Irradiance, TOLERANCES[3], 0, REACHES[0], CLEARANCES[0])),
            photons: Some(photons(outline, scale)),
            walk: multiple_scatter::Settings {
                one_light: outline.lights.all > 1,
                lengths: Lengths::Marched,
                max_vertices: VERTICES,
                ..multiple_scatter::Settings::new(Steps::Length(step * outline.resolution))
            },
            pixels: Self::default().pixels.map(|pixels| pixels * rougher),
            eye: RaySettings { lamp_parts: if outline.is_constant { 1 } else { LAMP_PARTS }, ..RaySettings::default() },
            light_samples: (LIGHT_SAMPLES[0] / outline.lights.all.max(1) as u32).clamp(1, LIGHT_SAMPLES[1]),
            finest: FINEST * size * rougher,
            ..Self::default()
        }
    }

    /// With single scattering cached rather than connected to: for media where most points see no light, and far from lamps, around
    /// which light rises like `1/r²` and records must be as small as it changes there.
    ///
    /// ```
    /// # use fogbow::{cache::Settings, host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// let settings = Settings::for_outline(&outline, 0.02);
    /// assert!(settings.single.is_none() && settings.with_single_cached(&outline).single.is_some());
    /// ```
    #[must_use]
    pub fn with_single_cached(self, outline: &Outline) -> Self {
        let size = outline.bounds.size().max_element();
        let single = Effort {
            tolerance: TOLERANCES[0],
            samples: samples(Kind::Single, WALKS),
            degree: degree_for(&outline.phase, 1, 0.0, LEFT_OUT),
            limits: Limits { min: LEAST_REACH * size, max: REACHES[0] * size },
            clearance: f32::INFINITY,
            free_paths: f32::INFINITY,
        };
        Self { single: Some(single), ..self }
    }

    /// With so many walks for each of the first two estimates of a record of multiple scattering, and samples of the others in proportion; a record has 16 at least.
    #[must_use]
    pub fn with_walks(mut self, walks: u32) -> Self {
        for (kind, _) in SHARES {
            if let Some(effort) = self.effort_mut(kind) {
                effort.samples = samples(kind, walks);
            }
        }
        self
    }

    /// For a picture of so many pixels: with as many eye rays that look for places as it needs, a quarter, because small things are seen in large pictures; and with
    /// short expansions in the medium, as records hold what an eye sees of them besides. Leave expansions as long as they are where caches light probes.
    ///
    /// ```
    /// # use fogbow::cache::Settings;
    /// assert_eq!(Settings::default().for_pixels(640 * 480).rays, 76_800);
    /// ```
    #[must_use]
    pub fn for_pixels(self, pixels: u32) -> Self {
        let short = |effort: Effort| Effort { degree: effort.degree.min(lobe::DEGREE), ..effort };
        Self {
            rays: (pixels / 4).clamp(LEAST_RAYS, MOST_RAYS),
            surface: self.surface.map(short),
            multiple: self.multiple.map(short),
            ..self
        }
    }

    /// The effort of a final kind, to be changed.
    pub fn effort_mut(&mut self, kind: Kind) -> Option<&mut Effort> {
        match kind {
            Kind::Single => self.single.as_mut(),
            Kind::Surface => self.surface.as_mut(),
            Kind::Multiple => self.multiple.as_mut(),
            Kind::Irradiance => self.irradiance.as_mut(),
            Kind::CoarseIrradiance => None,
        }
    }
}

/// The photons of a world, for so many times the usual error.
fn photons(outline: &Outline, scale: f32) -> PhotonEffort {
    let thickness = outline.bounds.size().max_element() * outline.extinction;
    // Casts saturate, and take NaN to 0.
    let cells = ((CELLS_PER_FREE_PATH * thickness) as u32).clamp(CELLS[0], CELLS[1]);
    // Noise of cells is the same for all that looks at them, and photons are cheap: of rough pictures they are spared less than walks.
    let finer = f64::from(1.0 / (scale * scale.min(1.0)));
    let degree = resolved::degree_for(&outline.phase);
    PhotonEffort {
        bounds: outline.bounds,
        cells,
        degree,
        paths: (f64::from(PHOTONS) * finer) as u32,
        flights: (FLIGHTS * finer) as u64,
        enough: (f64::from(ENOUGH) * finer.min(1.0)).max(FEWEST) as u32,
    }
}

/// Samples of a kind, for so many walks of multiple scattering.
fn samples(kind: Kind, walks: u32) -> u32 {
    let share = SHARES.iter().find(|(k, _)| *k == kind).map_or(1.0, |(_, share)| *share);
    ((f64::from(walks) * share) as u32).max(1)
}

/// The least degree beyond which an expansion holds less than `left_out` of the energy of the phase function, applied
/// `power` times, to light whose own expansion falls off like `1/(l + 1)^fall_off`.
fn degree_for(phase: &Phase, power: u32, fall_off: f32, left_out: f32) -> usize {
    let energy = |l: usize| {
        let once = phase.moment(l).max_element().abs();
        let moment = (1..power).fold(once, |m, _| m * once) / libm::powf(l as f32 + 1.0, fall_off);
        (2 * l + 1) as f32 * moment * moment
    };
    let total: f32 = (0..=sh::MAX_DEGREE).map(energy).sum();
    let mut rest = total;
    for l in 0..=sh::MAX_DEGREE {
        rest -= energy(l);
        if rest <= left_out * total {
            return l;
        }
    }
    sh::MAX_DEGREE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_take_longer_than_records_may_have_all_noise_and_others_less() {
        let goal = |pixels, walks| noise_goal(0.02, pixels, walks);
        assert_eq!([goal(1 << 20, 0), goal(0, 0), goal(0, 1 << 40), goal(1 << 20, 1 << 20)], [0.02; 4]);
        // The work of walks over that of 2¹⁴ pixels: 1, 16, 64.
        let [even, more, most] = [1 << 20, 16 << 20, 64 << 20].map(|walks| goal(1 << 14, walks) / 0.02);
        for (share, expected) in [(even, 1.5 / 2.0), (more, 1.5 / libm::sqrt(13.0)), (most, 1.5 / 5.0)] {
            assert!((f64::from(share) - expected).abs() < 1e-6, "{share} in place of {expected}");
        }
        // A rougher picture needs fewer samples, its records take less in proportion, and it may have more noise of both.
        assert!((noise_goal(0.08, 1 << 14, 1 << 20) / 0.08 - 2.0 * more).abs() < 1e-6);
    }
}
