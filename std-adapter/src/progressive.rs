//! Pictures in passes, by methods whose samples share something: the beams of a pass, or its virtual lights.
//!
//! What a pass needs is made as work in rounds, on as many threads as the picture; then every pixel gets its samples of
//! the pass. The same bits for any number of threads.

use core::fmt;

use fogbow::picture::whole_passes;
use fogbow::spectrum::Spectrum;
use fogbow::work::Rounds;

use crate::film::Film;
use crate::progress::Control;
use crate::seed::SampleRng;
use crate::threads::{Threads, run};
use crate::tiles::{Outcome, Passes, Render, RenderError, Sample, Settings};

/// Why rendering ended without a result: the method, or [`crate::tiles::render`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProgressiveError<E> {
    /// What the method fails with.
    Method(E),
    /// What [`crate::tiles::render`] fails with.
    Render(RenderError),
}

impl<E: fmt::Display> fmt::Display for ProgressiveError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Method(error) => error.fmt(f),
            Self::Render(error) => error.fmt(f),
        }
    }
}

impl<E: fmt::Debug + fmt::Display> core::error::Error for ProgressiveError<E> {}

impl<E> From<RenderError> for ProgressiveError<E> {
    fn from(error: RenderError) -> Self {
        Self::Render(error)
    }
}

/// Runs work for a pass, on as many threads as its picture.
#[derive(Debug)]
pub struct Runner<'a> {
    threads: &'a Threads,
    control: &'a Control<'a>,
}

impl Runner<'_> {
    /// Runs `work` in `world` until it is done, or the host wants to stop: see [`crate::threads::run`].
    pub fn run<W, R>(&self, work: &mut R, world: &W)
    where
        W: Sync + ?Sized,
        R: Rounds<W> + Sync,
        R::Output<'static>: Default + Send,
    {
        run(work, world, self.threads, self.control, None, |_| {});
    }
}

/// Adds samples to `film` as [`crate::tiles::render`] does, in `passes`.
///
/// `make(pass, runner)` makes what the samples of a pass share; it may run work in rounds by [`Runner::run`], which a host that wants to
/// stop cuts short. `integrand` gets what was made. [`Settings::samples`] is rounded up to whole passes, so that light
/// counts alike that is dealt out over the samples of a pass.
///
/// # Errors
/// As [`crate::tiles::render`], and what `make` fails with; the film then holds the passes up to there.
///
/// ```
/// use core::num::NonZero;
/// use fogbow::{beams, host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase};
/// use fogbow::{sampling::uniform, spectrum::Spectrum, world::{Outline, World}};
/// use fogbow_std::{film::Film, progress::Control, progressive, tiles};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let settings = beams::Settings { samples: 2, paths: 256, ..beams::Settings::for_outline(&Outline::of(&world, bounds)) };
/// let mut film = Film::new(4, 1, &["total"])?;
/// let tiles = tiles::Settings { samples: 3, ..tiles::Settings::default() };
/// let passes = tiles::Passes { length: NonZero::new(settings.samples).unwrap(), may_break: false };
/// let outcome = progressive::render(&mut film, &tiles, &Control::default(), passes,
///     |pass, runner| {
///         let mut beams = beams::BeamPass::new(&settings, pass, |_, pass| pass);
///         runner.run(&mut beams, &world);
///         beams.finish()
///     },
///     |beams, sample, rng, layers| {
///         let x = (sample.x as f32 + uniform(rng)) / 4.0;
///         let ray = Ray::between(Vec3::NEG_Z, Vec3::X * x);
///         layers[0] = beams.radiance(&ray, &world, &settings.walk, settings.share(sample.index), rng).total();
///     },
/// )?;
/// assert_eq!(outcome.samples, 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn render<T, E, P, F>(
    film: &mut Film,
    settings: &Settings,
    control: &Control<'_>,
    passes: Passes,
    mut make: P,
    integrand: F,
) -> Result<Outcome, ProgressiveError<E>>
where
    T: Sync,
    P: FnMut(u32, &Runner<'_>) -> Result<T, E>,
    F: Fn(&T, &Sample<'_>, &mut SampleRng, &mut [Spectrum]) + Sync,
{
    let samples = whole_passes(settings.samples, passes.length);
    let settings = &Settings { samples, goal: None, ..*settings };
    let mut render = Render::new(film, settings, control, passes.length.get())?;
    let prepare = |pass: u32, threads: &Threads| make(pass, &Runner { threads, control });
    let reason = render.prepared_passes(passes, prepare, &integrand).map_err(ProgressiveError::Method)?;
    Ok(render.outcome(reason))
}
