//! Every tuned number of virtual lights, from an outline of the world.

use glam::Vec3;

use super::bound::{Bound, usual_bound};
use super::compensate::Compensation;
use super::eye::EyeSettings;
use super::gather::Gatherer;
use super::light::VirtualLight;
use crate::math::{Bounds, float};
use crate::path;
use crate::world::{Outline, World};

/// Virtual lights of a pass. More: a pass takes longer and is smoother; fewer: lights are seen one by one until there
/// were many passes.
const LIGHTS: u32 = 1000;

/// Lights made for each that is kept. More: what is kept matters more, and a pass begins later; 1 keeps what comes. In a foggy box
/// sixteen halve the mean error of blocks for the same number of lights.
const CANDIDATES: u32 = 16;

/// Candidates of a pass at most, or as many as lights: so that they take no more memory than a picture. Fewer: passes of many lights choose
/// among fewer; more: memory.
pub const MOST_CANDIDATES: u32 = 1 << 17;

/// Samples of every pixel in a pass, among which its lights are dealt out. More: smoother surfaces and fewer lights for each sample, whose
/// other costs stay; fewer: the other way round.
pub const SAMPLES: u32 = 64;

/// Points on a segment of an eye ray that each light is gathered at. More cost as much as more lights, which serve better.
const POINTS: u32 = 1;

/// Paths that tell how many lights a path leaves. Fewer: the number of lights is off by more than some percent.
const PILOT: u32 = 2048;

/// Paths of a pass at most: where next to none meets anything.
const MOST_PATHS: u32 = 1 << 22;

/// Cells of the pyramid of mean extinctions along the longest side of the world, at most: 40 MB. Fewer: small smoke is averaged away.
const MOST_CELLS: u32 = 128;

/// How virtual lights are made and seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// A box (m) around surfaces and media: see [`Light::emit`](crate::light::Light::emit).
    pub bounds: Bounds,
    /// How long paths may grow, from the eye and from the lights.
    pub walk: path::Settings,
    /// Paths sent from the lights in each pass: see [`VplPass::settings_for_lights`](super::VplPass::settings_for_lights).
    pub paths: u32,
    /// Virtual lights of each pass, about.
    pub lights: u32,
    /// How many times as many are made, of which those are kept that matter most for the picture; 1 keeps all. No more
    /// than 131 072 are made, or as many as lights.
    pub candidates: u32,
    /// Samples of every pixel in a pass; each sees an equal part of the lights: [`Settings::part`].
    pub samples: u32,
    /// By which connections are clamped.
    pub bound: Bound,
    /// How what is lost is found again.
    pub compensation: Option<Compensation>,
    /// Points on a segment of an eye ray that each light is gathered at.
    pub points: u32,
    /// Whether the world has mirrors or glass. If not, no rays look for them.
    pub has_mirrors: bool,
    /// Changes all random numbers.
    pub seed: u64,
}

impl Settings {
    /// What suits a world: a thousand lights out of sixteen thousand, 64 samples, approximate compensation, [`usual_bound`]; seed 0. See
    /// the constants of this module for what each number does, and change fields at will.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, vpl::Settings};
    /// # use fogbow::{spectrum::Spectrum, world::{Outline, World}};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(10.0), Phase::ISOTROPIC)?;
    /// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// let settings = Settings::for_outline(&outline);
    /// // Clamped within some part of a mean free path.
    /// assert!(settings.bound.radius() < outline.mean_free_path && !settings.has_mirrors);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn for_outline(outline: &Outline) -> Self {
        Self {
            bounds: outline.bounds,
            walk: path::Settings::default(),
            paths: PILOT,
            lights: LIGHTS,
            candidates: CANDIDATES,
            samples: SAMPLES,
            bound: usual_bound(outline),
            compensation: Some(Compensation::APPROXIMATE),
            points: POINTS,
            has_mirrors: outline.has_mirrors,
            seed: 0,
        }
    }

    /// With as many paths as leave about the lights and candidates wanted, after `paths` paths left `found`; at least 1, at most
    /// 2²².
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::Bounds, vpl::Settings, world::{Outline, World}};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let settings = Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING));
    /// let settings = Settings { lights: 100, candidates: 4, ..settings }.for_lights(200, 1000);
    /// assert_eq!(settings.paths, 2000);
    /// ```
    #[must_use]
    pub fn for_lights(self, found: usize, paths: u32) -> Self {
        let wanted = self.lights.saturating_mul(self.candidates).min(MOST_CANDIDATES.max(self.lights));
        let paths = f64::from(paths) * f64::from(wanted) / (found.max(1) as f64);
        Self { paths: (paths as u32).clamp(1, MOST_PATHS), ..self }
    }

    /// Box (m) and number of cells along each axis of a [`Pyramid`](crate::medium::Pyramid) that tells the mean extinction around
    /// points, which compensation asks for: about cubes, half as long as the bound's radius.
    ///
    /// ```
    /// # use fogbow::{host::{Empty, Medium}, math::{Bounds, Vec3}, medium::{Homogeneous, Pyramid}, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, vpl::Settings, world::{Outline, World}};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// let (bounds, size) = Settings::for_outline(&outline).pyramid();
    /// let mut cells = vec![Spectrum::ZERO; Pyramid::<()>::cell_count(size)];
    /// let averaged = Pyramid::new(&fog, bounds, size, &mut cells)?;
    /// // The mean of what is the same everywhere.
    /// assert!((averaged.mean_extinction(Vec3::ZERO, 0.5)[0] - 1.0).abs() < 1e-5);
    /// let world = World { medium: &averaged, scene: &Empty, lights: (&[]).into() };
    /// # let _ = world;
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn pyramid(&self) -> (Bounds, [u32; 3]) {
        let bounds = solid(&self.bounds);
        let size = bounds.size();
        let longest = size.max_element();
        let edge = (0.5 * self.bound.radius()).max(longest / MOST_CELLS as f32).min(longest);
        (bounds, size.to_array().map(|side| (-float::floor(-(side / edge)) as u32).clamp(1, MOST_CELLS)))
    }

    /// What gathers at points in `world`, whose medium should know means ([`Settings::pyramid`]).
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::Bounds, vpl::Settings, world::{Outline, World}};
    /// let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let settings = Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING));
    /// assert_eq!(settings.gatherer(&world).bound, settings.bound);
    /// ```
    #[must_use]
    pub fn gatherer<'a, M: ?Sized, S: ?Sized>(&self, world: &World<'a, M, S>) -> Gatherer<'a, M, S> {
        Gatherer { world: *world, bound: self.bound, compensation: self.compensation, has_mirrors: self.has_mirrors }
    }

    /// How eye rays see the lights.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::Bounds, vpl::Settings, world::{Outline, World}};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let settings = Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING));
    /// assert_eq!(settings.eye().points, 1);
    /// ```
    #[must_use]
    pub fn eye(&self) -> EyeSettings {
        EyeSettings { points: self.points, ..EyeSettings::new(self.walk) }
    }

    /// The part of a pass's lights that sample number `sample` of a pixel sees, and how many times that part counts: of as many equal
    /// ones as a pass has samples.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, phase::Phase, spectrum::Spectrum, world::{Outline, World}};
    /// # use fogbow::vpl::{Settings, VirtualLight};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// # let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
    /// let settings = Settings { samples: 4, ..Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING)) };
    /// let lights = [light; 8];
    /// let (part, share) = settings.part(&lights, 5);
    /// assert_eq!((part.len(), share), (2, 4.0));
    /// ```
    #[must_use]
    pub fn part<'l>(&self, lights: &'l [VirtualLight], sample: u32) -> (&'l [VirtualLight], f32) {
        let samples = self.samples.max(1);
        let index = sample % samples;
        let at = |i: u32| (lights.len() as u64 * u64::from(i) / u64::from(samples)) as usize;
        (&lights[at(index)..at(index + 1)], samples as f32)
    }

    /// Those of a pilot.
    pub(super) fn of_pilot(self) -> Self {
        Self { paths: PILOT, ..self }
    }

    /// Whether there are lights, candidates, points, paths and samples.
    pub(super) fn is_valid(&self) -> bool {
        ![self.lights, self.candidates, self.points, self.paths, self.samples].contains(&0)
    }
}

/// A box with a volume: where there is nothing, or something flat, a pyramid needs one all the same.
fn solid(bounds: &Bounds) -> Bounds {
    let size = bounds.size();
    if size.min_element() < 0.0 {
        return Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    }
    // A thousandth of its size, or of its place if it has none, so that neither is lost in rounding.
    let lengths = [size.max_element(), bounds.max.abs().max(bounds.min.abs()).max_element(), 1.0];
    let length = lengths.into_iter().find(|length| *length > 0.0).unwrap_or(1.0);
    let margin = Vec3::splat(1e-3 * length);
    Bounds { min: bounds.min - margin, max: bounds.max + margin }
}
