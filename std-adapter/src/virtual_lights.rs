//! Many virtual lights in parallel, the same bits for any number of threads.
//!
//! A pass has virtual lights of its own, in an order left to chance, and as many samples of every pixel, each of which
//! sees an equal part of them: so the picture forms light by light, and a part of a pass is a picture, too. Paths are
//! dealt into jobs of fixed size, each with random numbers of its own, and their lights are put together in the order of
//! jobs.

use core::fmt;
use core::num::NonZero;

use fogbow::host::{Medium, Scene};
use fogbow::math::{Bounds, Ray, Vec3};
use fogbow::medium::{MediumError, Pyramid};
use fogbow::path;
use fogbow::sampling::uniform;
use fogbow::sampling::uniform::mix;
use fogbow::spectrum::Spectrum;
use fogbow::vpl::{self, Bound, Compensation, EyeSettings, Gatherer, Receiver, Seen, VirtualLight};
use fogbow::world::World;
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

use crate::film::Film;
use crate::progress::Control;
use crate::seed::{SampleRng, Sequence, independent};
use crate::stats::{CountingMedium, CountingScene, Tally};
use crate::tiles::{self, Outcome, Passes, RenderError, Sample, render_prepared};

/// How virtual lights are made and seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Virtual lights of each pass, about.
    pub lights: u32,
    /// How many times as many are made, of which those are kept that matter most for the picture; 1 keeps all. No more
    /// than 131 072, or as many as lights.
    pub candidates: u32,
    /// Samples of every pixel in a pass; each sees an equal part of the lights.
    pub samples: NonZero<u32>,
    /// By which connections are clamped.
    pub bound: Bound,
    /// How what is lost is found again.
    pub compensation: Option<Compensation>,
    /// Points on a segment of an eye ray that each light is gathered at.
    pub points: u32,
    /// Whether the world has mirrors or glass. If not, no rays look for them.
    pub has_mirrors: bool,
}

impl Settings {
    /// A thousand lights out of sixteen thousand, 64 samples, approximate compensation.
    #[must_use]
    pub fn new(bound: Bound) -> Self {
        Self {
            lights: 1000,
            candidates: 16,
            samples: NonZero::<u32>::MIN.saturating_add(63),
            bound,
            compensation: Some(Compensation::APPROXIMATE),
            points: 1,
            has_mirrors: true,
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
#[derive(Debug, Clone, PartialEq)]
pub enum LightsError {
    /// The medium glows; paths leave lights only, so light of the medium that it scatters itself would be missing.
    Glowing,
    /// No lights, no candidates or no points.
    Settings,
    /// The bounds are not finite, or the medium's extinction is negative or not finite somewhere.
    Medium(MediumError),
    /// What [`tiles::render`] fails with.
    Render(RenderError),
}

impl fmt::Display for LightsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Glowing => f.write_str("virtual lights do not know light of glowing media: take another method"),
            Self::Settings => f.write_str("there must be at least one virtual light, candidate and point"),
            Self::Medium(error) => write!(f, "virtual lights cannot average the medium's extinction: {error}"),
            Self::Render(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for LightsError {}

impl From<RenderError> for LightsError {
    fn from(error: RenderError) -> Self {
        Self::Render(error)
    }
}

impl From<MediumError> for LightsError {
    fn from(error: MediumError) -> Self {
        Self::Medium(error)
    }
}

/// Paths of one job: part of the result. More: threads wait for each other. Fewer: more lists to put together.
const JOB: u32 = 64;

/// Paths that tell how many lights a path leaves.
const PILOTS: u32 = 2048;

/// Paths of a pass at most: where next to none meets anything.
const MOST_PATHS: u32 = 1 << 22;

/// Eye rays by whose points the lights that matter are found.
const SCOUTS: u32 = 64;

/// Candidates of a pass at most, or as many as lights: so that they take no more memory than a picture.
const MOST_CANDIDATES: u32 = 1 << 17;

/// Cells of the pyramid of mean extinctions along the longest side of the world, at most.
const MOST_CELLS: u32 = 128;

/// Weight of a light's flux in its importance: what the few points do not see may still matter.
const DEFENSIVE: f32 = 0.3;

/// `paths` paths' virtual lights, each for the flux of one path; in the order of paths.
fn trace<M, S>(view: &View<'_, M, S>, paths: u32, seed: u64, pass: u32) -> Vec<VirtualLight>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
{
    let seed = mix(seed ^ 0x51f2_90ad_c13b_7e66) ^ u64::from(pass);
    let shot: Vec<Vec<VirtualLight>> = (0..paths.div_ceil(JOB))
        .into_par_iter()
        .with_max_len(1)
        .map(|job| {
            let mut lights = Vec::new();
            for path in job * JOB..(job * JOB).saturating_add(JOB).min(paths) {
                let mut rng = Sequence::LowDiscrepancy.start(seed, u64::from(pass), path);
                vpl::shoot(&view.world, &view.bounds, &view.paths, &mut rng, &mut |light| lights.push(light));
            }
            lights
        })
        .collect();
    shot.concat()
}

/// How many paths leave about `lights` virtual lights, by the count that a first few leave: at least 1. Uses the threads
/// of the rayon pool it is called in.
#[must_use]
pub fn paths_for<M, S>(view: &View<'_, M, S>, lights: u32, seed: u64) -> u32
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
{
    // A pass that is never rendered.
    let found = trace(view, PILOTS, seed, u32::MAX).len();
    let paths = f64::from(PILOTS) * f64::from(lights) / (found.max(1) as f64);
    (paths as u32).clamp(1, MOST_PATHS)
}

/// The virtual lights of pass number `pass`, in an order left to chance: all of `paths` paths', or, where `witnesses`
/// tell what matters, about [`Settings::lights`] of them. Uses the threads of the rayon pool it is called in.
///
/// ```
/// use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase, spectrum::Spectrum, world::World};
/// use fogbow::vpl::Bound;
/// use fogbow_std::virtual_lights::{Settings, View, lights, paths_for};
/// let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let world = World { medium: &fog, scene: &Empty, lights: &lamps };
/// let view = View { world, bounds, paths: fogbow::path::Settings::default() };
/// let settings = Settings::new(Bound::new(1.0)?);
/// let paths = paths_for(&view, 1000, 7);
/// let found = lights(&view, &settings, paths, &[], 0, 7);
/// assert!((900..1100).contains(&found.len()));
/// assert_eq!(found, lights(&view, &settings, paths, &[], 0, 7));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn lights<M, S>(
    view: &View<'_, M, S>,
    settings: &Settings,
    paths: u32,
    witnesses: &[Receiver],
    pass: u32,
    seed: u64,
) -> Vec<VirtualLight>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
{
    let share = 1.0 / paths as f32;
    let mut lights: Vec<_> = trace(view, paths, seed, pass).into_iter().map(|light| light.scaled(share)).collect();
    let mut rng = independent(mix(seed ^ 0x0d1b_7a5e_66c2_93f4), u64::from(pass), 0);
    if !witnesses.is_empty() && lights.len() > settings.lights as usize {
        // Systematic sampling keeps as many of every stretch of the list as it should: near lights belong together.
        let bounds = Bounds::of(lights.iter().map(|light| light.position));
        lights.sort_by_cached_key(|light| (light.is_on_surface(), curve(light.position, &bounds)));
        let mut importance = importance(view, settings, &lights, witnesses, seed ^ u64::from(pass));
        let kept = vpl::select(&mut lights, &mut importance, settings.lights as f32, uniform(&mut rng));
        lights.truncate(kept);
    }
    // Fisher and Yates.
    for i in (1..lights.len()).rev() {
        lights.swap(i, (uniform(&mut rng) * (i + 1) as f32) as usize);
    }
    lights
}

/// Place of a point along a curve that fills the box: 16 bits of each coordinate, interleaved (Morton 1966).
fn curve(point: Vec3, bounds: &Bounds) -> u64 {
    let unit = (point - bounds.min) / bounds.size().max(Vec3::splat(f32::MIN_POSITIVE));
    let [x, y, z] = unit.to_array().map(|x| (x.clamp(0.0, 1.0) * 65_535.0) as u64);
    let bit = |i: u32| (x >> i & 1) << (3 * i) | (y >> i & 1) << (3 * i + 1) | (z >> i & 1) << (3 * i + 2);
    (0..16).map(bit).sum()
}

/// How much of what a witness sees each light, clamped, is: the root of the mean square over the witnesses, mixed with the
/// light's share of all flux. Lights kept with such probabilities make errors small everywhere, dark corners included.
fn importance<M, S>(
    view: &View<'_, M, S>,
    settings: &Settings,
    lights: &[VirtualLight],
    witnesses: &[Receiver],
    seed: u64,
) -> Vec<f32>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
{
    let gatherer =
        Gatherer { world: view.world, bound: settings.bound, compensation: None, has_mirrors: settings.has_mirrors };
    // For all lights one witness after the other: a table of all would be larger than the lights themselves.
    let mut squares = vec![0.0_f32; lights.len()];
    let mut seen = vec![0.0_f32; lights.len()];
    for (w, witness) in witnesses.iter().enumerate() {
        (lights, seen.as_mut_slice()).into_par_iter().with_min_len(64).enumerate().for_each(|(i, (light, seen))| {
            let mut rng = independent(seed, i as u64, w as u32);
            *seen = gatherer.connected(witness, light, &mut rng).mean();
        });
        let total: f64 = seen.iter().copied().map(f64::from).sum();
        if total > 0.0 {
            for (square, seen) in squares.iter_mut().zip(&seen) {
                *square += ((f64::from(*seen) / total) as f32).powi(2);
            }
        }
    }
    let flux: f64 = lights.iter().map(|light| f64::from(light.flux.mean())).sum();
    let of_flux = |light: &VirtualLight| if flux > 0.0 { (f64::from(light.flux.mean()) / flux) as f32 } else { 1.0 };
    let count = witnesses.len().max(1) as f32;
    squares.iter().zip(lights).map(|(square, light)| (square / count).sqrt() + DEFENSIVE * of_flux(light)).collect()
}

/// Points of a few eye rays, spread over the picture.
fn witnesses<M, S>(
    view: &View<'_, M, S>,
    size: (u32, u32),
    seed: u64,
    ray: impl Fn(&Sample<'_>, &mut SampleRng) -> Ray,
) -> Vec<Receiver>
where
    M: Medium + ?Sized,
    S: Scene + ?Sized,
{
    // Steps of the plastic number fill a square evenly.
    const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    let tally = Tally::default();
    let mut found = Vec::new();
    for i in 0..SCOUTS {
        let [x, y] = STEPS.map(|step| (0.5 + step * f64::from(i)).fract());
        let pixel = ((x * f64::from(size.0)) as u32, (y * f64::from(size.1)) as u32);
        let sample = Sample { x: pixel.0, y: pixel.1, index: 0, tally: &tally };
        let mut rng = Sequence::Independent.start(mix(seed ^ 0x2f6b_11d0_99ac_4e57), u64::from(i), 0);
        let ray = ray(&sample, &mut rng);
        vpl::receivers(&ray, &view.world, &view.paths, &mut rng, |receiver, _| found.push(*receiver));
    }
    found
}

/// Adds samples to `film` as [`tiles::render`] does, in passes of [`Settings::samples`] with lights of their own.
///
/// [`tiles::Settings::samples`] is rounded up to whole passes, so that all lights count alike. `ray` is the eye ray of a
/// sample; where `sees_medium` says no, the medium's light is left out; `write` puts what was seen into the film's layers.
///
/// # Errors
/// See [`LightsError`].
#[expect(clippy::too_many_arguments, reason = "the host's film, world, camera and settings")]
pub fn render<M, S>(
    film: &mut Film,
    tiles: &tiles::Settings,
    settings: &Settings,
    control: &Control<'_>,
    view: &View<'_, M, S>,
    ray: impl Fn(&Sample<'_>, &mut SampleRng) -> Ray + Sync,
    sees_medium: impl Fn(&Sample<'_>) -> bool + Sync,
    write: impl Fn(&Seen, &mut [Spectrum]) + Sync,
) -> Result<Outcome, LightsError>
where
    M: Medium + Sync,
    S: Scene + Sync,
{
    if settings.lights == 0 || settings.candidates == 0 || settings.points == 0 {
        return Err(LightsError::Settings);
    }
    if view.world.medium.is_emissive() {
        return Err(LightsError::Glowing);
    }
    let bounds = solid(&view.bounds);
    let size = cells(&bounds, settings.bound.radius());
    let mut means = vec![Spectrum::ZERO; Pyramid::<()>::cell_count(size)];
    let medium = Pyramid::new(view.world.medium, bounds, size, &mut means)?;
    let world = World { medium: &medium, scene: view.world.scene, lights: view.world.lights };
    let view = &View { world, bounds: view.bounds, paths: view.paths };
    let witnesses = if settings.candidates > 1 {
        witnesses(view, (film.width(), film.height()), tiles.seed, &ray)
    } else {
        Vec::new()
    };
    let eye = EyeSettings { points: settings.points, ..EyeSettings::new(view.paths) };
    let mut paths = None;
    let prepare = |pass: u32| {
        let wanted = settings.lights.saturating_mul(settings.candidates).min(MOST_CANDIDATES.max(settings.lights));
        let paths = *paths.get_or_insert_with(|| paths_for(view, wanted, tiles.seed));
        Ok::<_, LightsError>(lights(view, settings, paths, &witnesses, pass, tiles.seed))
    };
    let length = settings.samples;
    let samples = tiles.samples.checked_next_multiple_of(length.get()).unwrap_or(u32::MAX / length * length.get());
    let tiles = &tiles::Settings { samples, ..*tiles };
    let passes = Passes { length, may_break: true };
    render_prepared(film, tiles, control, passes, prepare, |lights, sample, rng, layers| {
        let gatherer = Gatherer {
            world: World {
                medium: &CountingMedium { medium: view.world.medium, tally: sample.tally },
                scene: &CountingScene { scene: view.world.scene, tally: sample.tally },
                lights: view.world.lights,
            },
            bound: settings.bound,
            compensation: settings.compensation,
            has_mirrors: settings.has_mirrors,
        };
        let part = part(lights, sample.index % length, length);
        let ray = ray(sample, rng);
        let eye = EyeSettings { sees_medium: sees_medium(sample), ..eye };
        let seen = vpl::radiance(&ray, &gatherer, part, length.get() as f32, &eye, rng);
        sample.tally.collide(seen.radiance.collisions);
        write(&seen, layers);
    })
}

/// A box with a volume: where there is nothing, or something flat, a pyramid needs one all the same.
fn solid(bounds: &Bounds) -> Bounds {
    let size = bounds.size();
    if size.min_element() < 0.0 {
        return Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    }
    let margin = Vec3::splat((1e-3 * size.max_element()).max(1e-3));
    Bounds { min: bounds.min - margin, max: bounds.max + margin }
}

/// Cells of a pyramid asked for the mean extinction in balls of `radius` (m): about cubes, half as long.
fn cells(bounds: &Bounds, radius: f32) -> [u32; 3] {
    let size = bounds.size();
    let longest = size.max_element();
    let edge = (0.5 * radius).max(longest / MOST_CELLS as f32).min(longest);
    size.to_array().map(|side| ((side / edge).ceil() as u32).clamp(1, MOST_CELLS))
}

/// One of `count` equal parts.
fn part(lights: &[VirtualLight], index: u32, count: NonZero<u32>) -> &[VirtualLight] {
    let at = |i: u32| (lights.len() as u64 * u64::from(i) / u64::from(count.get())) as usize;
    &lights[at(index)..at(index + 1)]
}
