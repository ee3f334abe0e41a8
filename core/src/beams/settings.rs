//! Every tuned number of photon beams, from an outline of the world.

use super::kernel;
use crate::math::Bounds;
use crate::path;
use crate::world::Outline;

/// Radius of the blur in the first pass over the diagonal of the bounds. Larger: the first passes are smoother and blurrier;
/// smaller: more passes until a picture looks smooth. The blur of the mean goes with its square.
const RADIUS: f32 = 0.005;

/// How fast the blur narrows: noise and blur of the mean of all passes shrink alike ([`kernel::radius`]). Larger: less noise is
/// left, and more blur.
const ALPHA: f32 = 0.6;

/// Longest piece over the diagonal of the bounds. Longer: boxes of the tree are large and mostly empty; shorter: more pieces.
const LONGEST: f32 = 0.1;

/// Samples of every pixel in a pass, of which the first gathers: gathers cost some ten times as much as the rest of a sample and are less
/// noisy. More: surfaces get more than they need; fewer: the medium does.
const SAMPLES: u32 = 8;

/// Pieces of a pass for every pixel. More: shooting and building take longer than gathering gains; fewer: the cost of the rest of a
/// sample is paid for noise.
const PIECES_PER_PIXEL: u64 = 4;

/// Pieces of a pass, for small and for large pictures: below, a pass is hardly more than its tree; above, 256 MB.
const PIECES: [u32; 2] = [1 << 14, 1 << 22];

/// Bias that a kernel by covariances may have in the first pass, as a part of the light itself. Kernels that are best for the noise have less
/// unless there is much of it: this is a guard for where noise is not what [`Settings::noise`] foretells. Larger: no guard; smaller: more
/// noise after few passes.
const BIAS: f32 = 0.1;

/// Length of an eye ray within a world over the diagonal of its bounds, about: the mean chord of a cube is 0.38 of its diagonal. It goes
/// into radii by its fifth root.
const CHORD: f32 = 0.38;

/// Its greatest radius over the diagonal of the bounds. Larger: a beam in smooth fog is met by every eye ray.
const WIDEST: f32 = 0.05;

/// Paths of a pilot. Fewer: the count of pieces that it foretells is off by more than some percent; more: time.
const PILOT: u32 = 2048;

/// Paths of a pass at least and at most: few beams are streaks, and where next to no light meets fog more paths do not help.
const PATHS: [u32; 2] = [256, 1 << 22];

/// How to shoot beams and gather them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// A box (m) around surfaces and media: see [`Light::emit`](crate::light::Light::emit).
    pub bounds: Bounds,
    /// How long paths may grow, from the eye and from the lights.
    pub walk: path::Settings,
    /// Paths sent from the lights in each pass: see [`Settings::for_pieces`].
    pub paths: u32,
    /// Pieces of beams wanted in each pass.
    pub pieces: u32,
    /// Samples of every pixel in each pass. The first gathers beams for all of them: [`Settings::share`].
    pub samples: u32,
    /// Radius of the blur in the first pass (m). Pieces that are wider are thinned out
    /// ([`Piece::thinned`](super::Piece::thinned)).
    pub radius: f32,
    /// By which it narrows, in (0, 1]: see [`kernel::radius`].
    pub alpha: f32,
    /// Length (m) above which pieces of beams are cut. Shorter: more pieces, tighter boxes. Changes nothing in the mean.
    pub longest: f32,
    /// Bias that a kernel by covariances may have in the first pass, as a part of the light itself. Nothing in this module reads it.
    pub bias: f32,
    /// Greatest radius (m) of such a kernel in the first pass.
    pub widest: f32,
    /// Length (m) along which an eye ray sees light, about: see [`Settings::noise`].
    pub depth: f32,
    /// Changes all random numbers.
    pub seed: u64,
}

impl Settings {
    /// What suits a world, for a picture of some thousand pixels; seed 0. See the constants of this module for what each number does, and
    /// change fields at will.
    ///
    /// ```
    /// # use fogbow::{beams::Settings, host::Empty, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, world::{Outline, World}};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(3.0, 4.0, 0.0) };
    /// let settings = Settings::for_outline(&Outline::of(&world, bounds));
    /// assert!((settings.radius - 0.025).abs() < 1e-6 && (settings.longest - 0.5).abs() < 1e-6);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn for_outline(outline: &Outline) -> Self {
        let size = outline.bounds.size().length();
        // Of an endless world some free paths are seen; of one without fog nothing that beams could show.
        let size = [size, outline.mean_free_path].into_iter().find(|size| size.is_finite()).unwrap_or(1.0);
        Self {
            bounds: outline.bounds,
            walk: path::Settings::default(),
            paths: PILOT,
            pieces: PIECES[0],
            samples: SAMPLES,
            radius: RADIUS * size,
            alpha: ALPHA,
            longest: LONGEST * size,
            bias: BIAS,
            widest: WIDEST * size,
            // Beyond a free path little comes to the eye.
            depth: 1.0 / (1.0 / (CHORD * size) + 1.0 / outline.mean_free_path),
            seed: 0,
        }
    }

    /// With as many pieces as a picture of so many pixels is worth: four for each.
    ///
    /// ```
    /// # use fogbow::{beams::Settings, host::Empty, math::Bounds, world::{Outline, World}};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let settings = Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING));
    /// assert_eq!(settings.for_pixels(640 * 480).pieces, 4 * 640 * 480);
    /// ```
    #[must_use]
    pub fn for_pixels(self, pixels: u64) -> Self {
        let pieces = pixels.saturating_mul(PIECES_PER_PIXEL).clamp(PIECES[0].into(), PIECES[1].into());
        Self { pieces: pieces as u32, ..self }
    }

    /// Those of a pilot ([`BeamPass::pilot`](super::BeamPass::pilot)): 2048 paths.
    #[must_use]
    pub(super) fn of_pilot(self) -> Self {
        Self { paths: PILOT, ..self }
    }

    /// With as many paths as leave about [`Settings::pieces`], after `paths` paths left `found`. At least 256, at most 2²².
    ///
    /// Where most light ends on walls outside the medium many paths are needed, in dense fog few; the cost of
    /// gathering goes with the pieces.
    ///
    /// ```
    /// # use fogbow::{beams::Settings, host::Empty, math::Bounds, world::{Outline, World}};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let settings = Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING));
    /// let settings = Settings { pieces: 20_000, ..settings }.for_pieces(10_000, 2048);
    /// assert_eq!(settings.paths, 4096);
    /// ```
    #[must_use]
    pub fn for_pieces(self, found: usize, paths: u32) -> Self {
        let paths = f64::from(paths) * f64::from(self.pieces) / (found.max(1) as f64);
        Self { paths: (paths as u32).clamp(PATHS[0], PATHS[1]), ..self }
    }

    /// How many samples' worth of the medium's light sample number `sample` of a pixel gathers: that of all samples of its
    /// pass, if it is the first of them, else 0.
    ///
    /// ```
    /// # use fogbow::{beams::Settings, host::Empty, math::Bounds, world::{Outline, World}};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let settings = Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING));
    /// assert_eq!([settings.share(0), settings.share(1), settings.share(8)], [8.0, 0.0, 8.0]);
    /// ```
    #[inline]
    #[must_use]
    pub fn share(&self, sample: u32) -> f32 {
        let samples = self.samples.max(1);
        if sample.is_multiple_of(samples) { samples as f32 } else { 0.0 }
    }

    /// Relative variance of a pass, of light with a fluence of 1 W·m⁻², by kernels of 1 m (W·m⁻¹), where `power` (W) is what all lights send
    /// out: over fluence and radius, that of other light and kernels. What radii by covariances are balanced against.
    ///
    /// ```text
    /// Var L/L² = k Φ/(N d F r)        k of kernel::NOISE, N paths, an eye ray of length d in light of fluence F
    /// ```
    ///
    /// Of beams that are as bright as they start, cross the eye ray at right angles and know nothing of each other.
    ///
    /// ```
    /// # use fogbow::{beams::Settings, host::Empty, math::Bounds, world::{Outline, World}};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let settings = Settings { paths: 1000, depth: 2.0, ..Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING)) };
    /// assert!((settings.noise(100.0) - 0.0383).abs() < 1e-4);
    /// ```
    #[must_use]
    pub fn noise(&self, power: f32) -> f32 {
        kernel::NOISE * power / (self.paths.max(1) as f32 * self.depth)
    }

    /// Radius (m) of a kernel by covariances in a pass whose own radius is `of_pass` (m), after `first` (m) in the first: both shrink alike, and
    /// none is narrower than the pass's own.
    ///
    /// ```
    /// # use fogbow::{beams::{Settings, kernel}, host::Empty, math::Bounds, world::{Outline, World}};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let settings = Settings { radius: 0.01, ..Settings::for_outline(&Outline::of(&world, Bounds::EVERYTHING)) };
    /// let of_pass = kernel::radius(settings.radius, settings.alpha, 31);
    /// let (wide, narrow) = (settings.widened(0.1, of_pass), settings.widened(0.001, of_pass));
    /// assert!((wide / of_pass - 10.0).abs() < 1e-4 && narrow == of_pass);
    /// ```
    #[inline]
    #[must_use]
    pub fn widened(&self, first: f32, of_pass: f32) -> f32 {
        (first / self.radius).max(1.0) * of_pass
    }

    /// Radius (m) of pass number `pass`.
    #[must_use]
    pub(super) fn radius_of(&self, pass: u32) -> f32 {
        kernel::radius(self.radius, self.alpha, pass)
    }

    /// Whether there are paths, and lengths are positive and finite, and alpha is in (0, 1].
    pub(super) fn is_valid(&self) -> bool {
        let positive = |x: f32| x > 0.0 && x.is_finite();
        let lengths = [self.radius, self.longest, self.alpha];
        self.paths > 0 && self.samples > 0 && lengths.into_iter().all(positive) && self.alpha <= 1.0
    }
}
