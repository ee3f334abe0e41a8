//! Levels: a fill that is done goes on for a smaller error, with the records that are there.

use super::estimates::{usual_value, where_bright};
use super::{Filling, RAYS_PER_JOB, Round};
use crate::cache::asked::Asked;
use crate::cache::guide::Guide;
use crate::cache::kind::{Kind, Step};
use crate::cache::noise::{Noise, REGIONS};
use crate::cache::radius::Limits;
use crate::cache::settings::{Effort, Settings};
use crate::cache::slot::ByKind;
use crate::math::{Ray, Vec3, float};

/// Samples of a coarser level over as many of a finer one, by what they count. Their walks have ended in cells that fewer photons lit, and at surfaces
/// that were known less well. More: what those had wrong stays for longer; less: samples are thrown away.
const COARSER: f32 = 0.5;

/// Smaller radii.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tighter {
    factor: f32,
    /// Bounds of radii in the world, and least and greatest ones in pixels, before.
    limits: Limits,
    pixels: [f32; 2],
    /// Where eye rays come from, and the angular width of a pixel (rad).
    eye: Option<(Vec3, f32)>,
}

impl<'s, F: Fn([f32; 2]) -> Ray> Filling<'s, F> {
    /// Begins another level: the same caches for a smaller error, from the records and the photons that are there. Radii shrink to what `settings` allow,
    /// places that then have no record get one, and every record is estimated anew and keeps its part of what it knew. Of `settings` counts what is finer than
    /// before; what is cached, and the degree of expansions, stay. A fill that was left goes on at the new level.
    ///
    /// While a level is at work the caches can be read at any time. Levels that are given beforehand make the same bits whoever runs their jobs.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::cache::{Asked, FilledRecords, Kind, RadianceCaches, Settings};
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Ray, Vec3}, medium::{Homogeneous, Placed, Region}};
    /// # use fogbow::{phase::Phase, spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
    /// # let sky = [Light::Constant(Spectrum::ONE)];
    /// # let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
    /// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// let outline = Outline::of(&world, bounds);
    /// let settings = |error| Settings { rays: 64, ..Settings::for_outline(&outline, error) };
    /// let mut filling = RadianceCaches::new(settings(0.16)).fill(Asked::anywhere_in(bounds));
    /// work::finish(&mut filling, &world, &mut FilledRecords::default());
    /// let coarse = filling.caches().records(Kind::Surface).len();
    /// filling.refine(settings(0.08));
    /// work::finish(&mut filling, &world, &mut FilledRecords::default());
    /// assert!(filling.caches().settings().error == 0.08 && filling.caches().records(Kind::Surface).len() >= coarse);
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn refine(&mut self, settings: Settings) {
        let before = self.caches.settings;
        let finer = |old: Option<Effort>, new: Option<Effort>| old.map(|old| new.map_or(old, |new| old.or_finer(&new)));
        self.caches.settings = Settings {
            error: before.error.min(settings.error),
            single: finer(before.single, settings.single),
            surface: finer(before.surface, settings.surface),
            multiple: finer(before.multiple, settings.multiple),
            irradiance: finer(before.irradiance, settings.irradiance),
            photons: settings.photons.or(before.photons).map(|photons| photons.no_fewer_than(before.photons)),
            coarser: before.coarser,
            seed: before.seed,
            ..settings
        };
        let eye = match &self.asked {
            Asked::View { ray, pixel } => Some((ray([0.5, 0.5]).origin, *pixel)),
            Asked::Box(_) => None,
        };
        for kind in Kind::ALL {
            let efforts = before.effort(kind).zip(self.caches.settings.effort(kind));
            let Some((old, new)) = efforts.filter(|(old, new)| old != new) else { continue };
            // They are estimated once, and that is when they are made.
            if kind == Kind::Single {
                self.caches.slots[kind].clear();
                self.memory.guides[kind].clear();
                self.before[kind] = 0;
                continue;
            }
            self.take_over(kind);
            let fewer = COARSER * old.samples as f32 / new.samples.max(1) as f32;
            self.memory.guides[kind].as_mut_slice().iter_mut().for_each(|guide| guide.held *= fewer);
            let ratio = |before: f32, after: f32| if before < f32::INFINITY { after / before } else { 1.0 };
            let factor = ratio(old.tolerance, new.tolerance)
                .min(ratio(old.free_paths, new.free_paths))
                .min(ratio(old.clearance, new.clearance));
            self.tighter[kind] = Some(Tighter { factor, limits: old.limits, pixels: before.pixels, eye });
        }
        self.caches.views.clear();
        self.caches.settled = self.before;
        self.begin_level();
    }

    /// Records that earlier fills have settled count as the others do.
    fn take_over(&mut self, kind: Kind) {
        if self.before[kind] == 0 {
            return;
        }
        let (guides, count) = (&mut self.memory.guides[kind], self.caches.slots[kind].len());
        guides.clear();
        let mut guide = Guide::default();
        guide.held = 1.0;
        self.is_cut |= (0..count).any(|_| guides.push(guide).is_err());
        self.before[kind] = 0;
    }

    fn begin_level(&mut self) {
        let memory = &mut self.memory;
        memory.wanted.clear();
        memory.glances.clear();
        memory.photons.ask_again();
        self.level += 1;
        self.are_more = false;
        self.view = self.asked.mark(&self.caches.settings);
        (self.noise, self.dark, self.left, self.again) = (Noise::default(), 0.0, None, 0);
        self.more = ByKind([[0; REGIONS]; Kind::COUNT]);
        self.efforts = ByKind([[0.0; 2]; Kind::COUNT]);
        self.all_computed = ByKind([0; Kind::COUNT]);
        self.enter(Round::Search, self.settings().rays.div_ceil(RAYS_PER_JOB));
    }
}

impl<F> Filling<'_, F> {
    /// Whether radii of records are still those of a coarser level.
    pub(super) fn is_loose(&self) -> bool {
        self.tighter.0.iter().any(Option::is_some)
    }

    /// Shrinks the radii of a kind to what this level allows, just before what then is missing is made: caches can be read at any time.
    pub(super) fn tighten(&mut self, (Step { kind, .. }, effort): (Step, Effort)) {
        let Some(Tighter { factor, limits, pixels, eye }) = self.tighter[kind].take() else { return };
        let (now, coarser) = (self.settings().pixels, float::sqrt(self.settings().coarser[kind as usize]));
        let bright = usual_value(self.caches.slots[kind].records());
        let is_room = self.caches.slots[kind].shrink(|record| {
            let brightness = record.value.mean() / bright;
            let on_screen = |limits: Limits, pixels: [f32; 2]| match eye {
                Some((eye, pixel)) => {
                    let distance = eye.distance(record.position);
                    let seen = limits.on_screen(pixels[0] * coarser, pixels[1] * coarser, pixel, distance);
                    where_bright(seen, limits.min, brightness)
                }
                None => limits,
            };
            let (before, after) = (on_screen(limits, pixels), on_screen(effort.limits, now));
            // What was widened to the least radius has none of its own.
            let radius = if record.radius <= before.min { after.min } else { record.radius * factor };
            after.clamp(Some(radius))
        });
        self.is_cut |= !is_room;
    }
}
