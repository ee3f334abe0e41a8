//! Progressive photon beams in parallel, the same bits for any number of threads.
//!
//! A pass shoots photons, makes a tree over their beams and takes some samples of every pixel, with a blur
//! narrower than that of the pass before. Photons are dealt into jobs of fixed size, each with random numbers
//! of its own, and their beams are put together in the order of jobs.

use core::fmt;
use core::num::NonZero;

use fogbow::beams::{self, Beams, Piece, kernel};
use fogbow::host::{Medium, Scene};
use fogbow::math::{Bounds, Ray, Vec3};
use fogbow::path::{self, InScattered, Radiance};
use fogbow::sampling::uniform::mix;
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::storage::Full;
use fogbow::world::World;
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

use crate::film::Film;
use crate::progress::Control;
use crate::seed::{SampleRng, independent};
use crate::stats::{CountingMedium, CountingScene};
use crate::tiles::{self, Outcome, Passes, RenderError, Sample, render_prepared};

/// How to shoot and gather.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Paths sent from the lights in each pass.
    pub paths: u32,
    /// Samples per pixel in each pass. The first gathers beams for all of them, because these cost
    /// more than the rest of a sample and are less noisy.
    pub samples: NonZero<u32>,
    /// Radius of the blur in the first pass (m).
    pub radius: f32,
    /// By which it narrows: see [`kernel::radius`].
    pub alpha: f32,
    /// Length (m) above which pieces of beams are cut. Shorter: more pieces, tighter boxes. Changes nothing
    /// in the mean.
    pub longest: f32,
}

impl Settings {
    /// Paths for a scene of some 10 000 pixels; lengths in proportion to the diagonal of `bounds`.
    #[must_use]
    pub fn new(bounds: &Bounds) -> Self {
        let size = bounds.size().length();
        let size = if size.is_finite() { size } else { 1.0 };
        Self {
            paths: 2048,
            samples: NonZero::<u32>::MIN.saturating_add(7),
            radius: 0.005 * size,
            alpha: 0.6,
            longest: 0.1 * size,
        }
    }
}

/// What there is to see.
#[derive(Debug)]
pub struct View<'a, M: ?Sized, S: ?Sized> {
    /// Medium, surfaces, lights.
    pub world: World<'a, M, S>,
    /// A box around surfaces and media: see [`fogbow::light::Light::emit`].
    pub bounds: Bounds,
    /// How long paths may grow, from the eye and from the lights.
    pub paths: path::Settings,
}

/// Why rendering ended without a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BeamsError {
    /// The medium glows; photons leave lights only, so light of the medium that it scatters itself
    /// would be missing.
    Glowing,
    /// No paths, or a radius, length or `alpha` out of range.
    Settings,
    /// More pieces of beams than 32 bits count.
    TooMany,
    /// What [`tiles::render`] fails with.
    Render(RenderError),
}

impl fmt::Display for BeamsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Glowing => f.write_str("photon beams do not know light of glowing media: take another method"),
            Self::Settings => f.write_str("photon beams need paths, positive lengths, and alpha in (0, 1]"),
            Self::TooMany => f.write_str("too many photon beams"),
            Self::Render(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for BeamsError {}

impl From<RenderError> for BeamsError {
    fn from(error: RenderError) -> Self {
        Self::Render(error)
    }
}

impl From<Full> for BeamsError {
    fn from(_: Full) -> Self {
        Self::TooMany
    }
}

/// Paths of one job: part of the result. More: threads wait for each other. Fewer: more lists to put together.
const JOB: u32 = 64;

/// The beams of pass number `pass`, blurred as `radius` says: see [`render`]; what is wider than [`Settings::radius`] is thinned
/// out ([`Piece::thinned`]). Uses the threads of the rayon pool it is called in.
///
/// # Errors
/// [`BeamsError::TooMany`].
///
/// ```
/// use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase, spectrum::Spectrum, world::World};
/// use fogbow_std::photon_beams::{Settings, View, shoot};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let world = World { medium: &fog, scene: &Empty, lights: &lamps };
/// let view = View { world, bounds, paths: fogbow::path::Settings::default() };
/// let settings = Settings { paths: 100, ..Settings::new(&bounds) };
/// let beams = shoot(&view, &settings, |_, pass| pass, 0, 7)?;
/// assert_eq!(beams.pieces(), shoot(&view, &settings, |_, pass| pass, 0, 7)?.pieces());
/// assert_ne!(beams.pieces(), shoot(&view, &settings, |_, pass| pass, 1, 7)?.pieces());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn shoot<M, S>(
    view: &View<'_, M, S>,
    settings: &Settings,
    radius: impl Fn(Vec3, f32) -> f32 + Sync,
    pass: u32,
    seed: u64,
) -> Result<Beams<'static>, BeamsError>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
{
    // Photons must have nothing to do with the pixels' numbers.
    let seed = mix(seed ^ 0x9e3d_11b6_0f7c_52a4) ^ u64::from(pass);
    let of_pass = kernel::radius(settings.radius, settings.alpha, pass);
    let width = |point: Vec3| radius(point, of_pass);
    let jobs = settings.paths.div_ceil(JOB);
    let shot: Vec<Vec<Piece>> = (0..jobs)
        .into_par_iter()
        .with_max_len(1)
        .map(|job| {
            let mut pieces = Vec::new();
            for path in job * JOB..(job * JOB).saturating_add(JOB).min(settings.paths) {
                let mut rng = independent(seed, u64::from(pass) << 32 | u64::from(job), path);
                let mut thin = independent(mix(seed), u64::from(pass) << 32 | u64::from(job), path);
                beams::shoot(&view.world, &view.bounds, &view.paths, settings.longest, &mut rng, &mut |piece| {
                    piece.widened(&width, &mut |part| pieces.extend(part.thinned(settings.radius, uniform(&mut thin))));
                });
            }
            pieces
        })
        .collect();
    let count = shot.iter().map(Vec::len).sum();
    let mut beams = Beams::new(Vec::with_capacity(count), Vec::with_capacity(count / 2 + 1));
    for piece in shot.into_iter().flatten() {
        beams.push(piece)?;
    }
    beams.build(settings.paths)?;
    Ok(beams)
}

/// How many paths leave about `pieces` pieces of beams: by the count that a first few leave. At least 256, at
/// most 2²².
///
/// Where most light ends on walls outside the medium many paths are needed, in dense fog few; the cost of
/// gathering goes with the pieces.
///
/// # Errors
/// [`BeamsError::TooMany`].
///
/// ```
/// use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase, spectrum::Spectrum, world::World};
/// use fogbow_std::photon_beams::{Settings, View, paths_for, shoot};
/// let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let world = World { medium: &fog, scene: &Empty, lights: &lamps };
/// let view = View { world, bounds, paths: fogbow::path::Settings::default() };
/// let settings = Settings::new(&bounds);
/// let paths = paths_for(&view, &settings, 20_000, 7)?;
/// let beams = shoot(&view, &Settings { paths, ..settings }, |_, pass| pass, 0, 7)?;
/// assert!((18_000..22_000).contains(&beams.pieces().len()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn paths_for<M, S>(view: &View<'_, M, S>, settings: &Settings, pieces: u32, seed: u64) -> Result<u32, BeamsError>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
{
    const FIRST: u32 = 2048;
    // A pass that is never rendered.
    let found = shoot(view, &Settings { paths: FIRST, ..*settings }, |_, pass| pass, u32::MAX, seed)?.pieces().len();
    let paths = f64::from(FIRST) * f64::from(pieces) / (found.max(1) as f64);
    Ok((paths as u32).clamp(256, 1 << 22))
}

/// Adds samples to `film` as [`tiles::render`] does, in passes of [`Settings::samples`] with photons of their own.
///
/// [`tiles::Settings::samples`] is rounded up to whole passes, so that light of the medium and of surfaces count alike.
///
/// `ray` is the eye ray of a sample; `is_gathered` says whether light of the medium is wanted at its pixel (`|_| true`
/// everywhere; see [`crate::image_sampling`]); `radius` is told a point (m) and the pass's radius (m) and says how wide
/// the kernel is there: `|_, pass| pass` for progressive photon beams, `|point, pass| pass.max(…)` where
/// something is known of how fast light changes. Pieces wider than [`Settings::radius`] are thinned out
/// ([`Piece::thinned`]). `write` puts what was seen into the film's layers.
///
/// # Errors
/// See [`BeamsError`].
#[expect(clippy::too_many_arguments, reason = "the host's film, world, camera and settings")]
pub fn render<M, S>(
    film: &mut Film,
    tiles: &tiles::Settings,
    settings: &Settings,
    control: &Control<'_>,
    view: &View<'_, M, S>,
    ray: impl Fn(&Sample<'_>, &mut SampleRng) -> Ray + Sync,
    is_gathered: impl Fn(&Sample<'_>) -> bool + Sync,
    radius: impl Fn(Vec3, f32) -> f32 + Sync,
    write: impl Fn(&Radiance, &mut [Spectrum]) + Sync,
) -> Result<Outcome, BeamsError>
where
    M: Medium + Sync,
    S: Scene + Sync,
{
    let positive = |x: f32| x > 0.0 && x.is_finite();
    let lengths = [settings.radius, settings.longest, settings.alpha];
    if settings.paths == 0 || !lengths.into_iter().all(positive) || settings.alpha > 1.0 {
        return Err(BeamsError::Settings);
    }
    if view.world.medium.is_emissive() {
        return Err(BeamsError::Glowing);
    }
    let prepare = |pass: u32| shoot(view, settings, &radius, pass, tiles.seed);
    let length = settings.samples;
    // A multiple of the length, `u32::MAX` included.
    let samples = tiles.samples.checked_next_multiple_of(length.get()).unwrap_or(u32::MAX / length * length.get());
    let tiles = &tiles::Settings { samples, ..*tiles };
    render_prepared(film, tiles, control, Passes { length, may_break: false }, prepare, |beams, sample, rng, layers| {
        let world = World {
            medium: &CountingMedium { medium: view.world.medium, tally: sample.tally },
            scene: &CountingScene { scene: view.world.scene, tally: sample.tally },
            lights: view.world.lights,
        };
        let ray = ray(sample, rng);
        let seen = path::radiance_beyond(&ray, &world, &view.paths, rng, |segment: &Ray, most, rng: &mut Generator| {
            if sample.index % length != 0 || !is_gathered(sample) {
                return InScattered::default();
            }
            let light = beams.gather(segment, world.medium, most, rng).light;
            let share = length.get() as f32;
            InScattered { single: light.single * share, multiple: light.multiple * share }
        });
        sample.tally.collide(seen.collisions);
        write(&seen, layers);
    })
}
