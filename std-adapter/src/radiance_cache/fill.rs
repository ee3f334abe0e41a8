//! In which order the caches are made, and what each is made of.
//!
//! Eye rays say where light is asked for. Where no record reaches, one is computed against the
//! frozen caches, many at a time; then they are inserted in order, and those dropped that an earlier
//! one of the same round now covers. In this order:
//!
//! 1. coarse irradiance on all surfaces, light of surfaces in the medium, coarse multiple scattering: from
//!    whole walks, which end where a record is already;
//! 2. the same records again, twice, from all that they know of each other;
//! 3. final multiple scattering and final irradiance where eye rays come: places and radii from some
//!    samples, then values for the most part from as many others, so that noise in one does not steer the other. Fewer for
//!    the first are no saving: radii that noise has made too large stay, and what they cover stays wrong.

use core::fmt;

use fogbow::bytes::Crc;
use fogbow::cache::{Estimator, EyeSettings, Facing, Guide, Looks, Place, Reading, SurfaceCache, VolumeCache};
use fogbow::host::{Medium, Scene};
use fogbow::math::{Ray, Vec3};
use fogbow::sampling::Generator;
use fogbow::sh::Coefficient;
use fogbow::single_scatter::Sums;

use super::rounds::{COARSE, Fill, Filler, blend};
use super::{Effort, RadianceCaches, Settings};
use crate::progress::Control;
use crate::stats::{Seconds, Stopwatch};

/// What filling took.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// Records computed, by cache: those dropped because another of their round covered them included.
    pub computed: [u64; 4],
    /// Time by cache.
    pub seconds: [Seconds; 4],
    /// Time to find the places that eye rays ask for, and which of them no record covers.
    pub search: Seconds,
    /// Whether the host asked to stop.
    pub cancelled: bool,
}

/// Why nothing was filled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FillError {
    /// The system gave no threads; what it said.
    Threads(String),
}

impl fmt::Display for FillError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Threads(why) => write!(f, "cannot start threads: {why}"),
        }
    }
}

impl core::error::Error for FillError {}

/// Adds records to `caches` until every place that the eye rays ask for is covered.
///
/// `eye_ray([u, v])` is the camera's ray for a point of the film; `pixel` the angular width of a
/// pixel (rad). `estimator` brings the world; its surface cache is replaced by the one being filled.
///
/// # Errors
/// No threads.
pub fn fill<M: Medium + Sync + ?Sized, S: Scene + Sync + ?Sized>(
    caches: &mut RadianceCaches,
    estimator: &Estimator<'_, M, S>,
    eye: &EyeSettings,
    pixel: f32,
    control: &Control<'_>,
    eye_ray: impl Fn([f32; 2]) -> Ray + Sync,
) -> Result<Outcome, FillError> {
    let settings = caches.settings;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| FillError::Threads(error.to_string()))?;
    let filler = Filler { settings: &settings, estimator, eye, pixel, control, eye_ray: &eye_ray };
    pool.install(|| Ok(filler.fill(caches)))
}

/// What lights all final records.
fn lighting<'a>(
    cache: &'a Option<SurfaceCache<'static>>,
    settings: &Settings,
) -> Option<(&'a SurfaceCache<'a>, Reading)> {
    Some((cache.as_ref()?, settings.reading(&settings.coarse_irradiance()?)))
}

/// How often the first records are estimated anew from each other: every time most of their noise goes. Once is not
/// enough: 3.6 instead of 2.6 % of error where scattering is forward.
const REVISIONS: u64 = 2;

/// Share of the second estimate in a final record. The first, blind one is noisier, and the radius comes from it; to keep
/// a third of it takes the error of `cornell-homog-iso` from 2.04 to 1.87 %, and leaves its bias within 0.1 %.
const SECOND: f32 = 0.67;

/// Relative variance of samples ([`Guide::relative_variance`]) up to which the usual number of them will do: of light of
/// surfaces, light scattered more than once, and irradiance. In smoke boxes the means are 0.7 to 1.5, 4 to 6 and 2; where
/// shafts of light fall through windows, 18, 45 and 15.
const SPREADS: [f32; 3] = [3.0, 12.0, 6.0];

/// What light a record in the medium holds.
#[derive(Clone, Copy)]
enum Part {
    Single,
    Surface,
    Multiple,
}

/// An estimate for a record in the medium.
fn scattered<M: Medium + ?Sized, S: Scene + ?Sized>(
    cache: &VolumeCache<'_>,
    estimator: &Estimator<'_, M, S>,
    looks: Looks<'_>,
    place: &Place,
    rng: &mut Generator,
    part: Part,
) -> (Sums, Vec<Coefficient>) {
    let mut higher = vec![Coefficient::ZERO; cache.stride()];
    let phase = estimator.phase(place.point);
    let sums = match part {
        Part::Single => estimator.single(place.point, &phase, &mut higher, rng),
        Part::Surface => estimator.surface(place.point, &phase, looks, &mut higher, rng),
        Part::Multiple => estimator.multiple(place.point, &phase, looks, &mut higher, rng),
    };
    (sums, higher)
}

/// An estimate for a record on a surface.
fn irradiance<M: Medium + ?Sized, S: Scene + ?Sized>(
    estimator: &Estimator<'_, M, S>,
    looks: Looks<'_>,
    place: &Place,
    rng: &mut Generator,
) -> (Sums, Facing) {
    estimator.irradiance(place.point, place.normal.unwrap_or(Vec3::Z), looks, rng)
}

impl<M, S, F> Filler<'_, M, S, F>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
    F: Fn([f32; 2]) -> Ray + Sync,
{
    fn fill(&self, caches: &mut RadianceCaches) -> Outcome {
        let mut outcome = Outcome::default();
        let view = self.view();
        if caches.views.contains(&view) {
            return outcome;
        }
        let clock = Stopwatch::start();
        let all = self.all_places(caches);
        let settings = self.settings;
        let everywhere = |place: &Place| place.normal.is_some();
        let in_medium = |place: &Place| place.normal.is_none();
        let in_sight = |place: &Place| place.normal.is_some() && place.is_seen;
        outcome.search = clock.elapsed();
        if all.iter().all(Vec::is_empty) && caches.settled == caches.all_counts() {
            caches.views.push(view);
            return outcome;
        }

        // From these records on nothing is final: what a cancelled fill has left is estimated again, too.
        let before = caches.settled;
        // What the records from there on have learnt.
        let counts = caches.all_counts();
        let mut guides: [Vec<Guide>; 5] =
            core::array::from_fn(|i| vec![Guide::default(); counts[i].saturating_sub(before[i])]);
        // What lights everything else: coarse, because whoever asks sees many records at once.
        if let (Some(cache), Some(effort)) = (&mut caches.coarse_irradiance, settings.coarse_irradiance()) {
            let clock = Stopwatch::start();
            outcome.computed[3] +=
                self.rounds(cache, &effort, COARSE[0], &all, everywhere, &mut guides[0], |cache, looks, place, rng| {
                    let surfaces = Some((cache, settings.reading(&effort)));
                    irradiance(&Estimator { surfaces, ..*self.estimator }, looks, place, rng)
                });
            outcome.seconds[3] = clock.elapsed();
        }
        let estimator = Estimator { surfaces: lighting(&caches.coarse_irradiance, settings), ..*self.estimator };
        if let (Some(cache), Some(effort)) = (&mut caches.surface, settings.surface) {
            let clock = Stopwatch::start();
            outcome.computed[1] +=
                self.rounds(cache, &effort, 1, &all, in_medium, &mut guides[1], |cache, looks, place, rng| {
                    scattered(cache, &estimator, looks, place, rng, Part::Surface)
                });
            outcome.seconds[1] = clock.elapsed();
        }
        if let (Some(cache), Some(effort)) = (&mut caches.coarse_multiple, settings.coarse_multiple()) {
            let clock = Stopwatch::start();
            let surface = caches.surface.as_ref().zip(settings.surface).map(|(c, e)| (c, settings.reading(&e)));
            outcome.computed[2] +=
                self.rounds(cache, &effort, COARSE[1], &all, in_medium, &mut guides[2], |cache, looks, place, rng| {
                    let scattered_light = surface.map(|surface| [surface, (cache, settings.reading(&effort))]);
                    let estimator = Estimator { scattered: scattered_light, ..estimator };
                    scattered(cache, &estimator, looks, place, rng, Part::Multiple)
                });
            outcome.seconds[2] = clock.elapsed();
        }
        for pass in 0..REVISIONS {
            self.revise(caches, before, pass, &mut guides, &mut outcome);
        }

        let estimator = Estimator { surfaces: lighting(&caches.coarse_irradiance, settings), ..*self.estimator };
        if let (Some(cache), Some(effort)) = (&mut caches.single, settings.single) {
            let clock = Stopwatch::start();
            outcome.computed[0] =
                self.rounds(cache, &effort, 0, &all, in_medium, &mut Vec::new(), |cache, looks, place, rng| {
                    scattered(cache, &estimator, looks, place, rng, Part::Single)
                });
            outcome.seconds[0] = clock.elapsed();
        }
        let surface = caches.surface.as_ref().zip(settings.surface).map(|(c, e)| (c, settings.reading(&e)));
        if let (Some(cache), Some(effort)) = (&mut caches.multiple, settings.multiple) {
            let clock = Stopwatch::start();
            let coarse = caches.coarse_multiple.as_ref().zip(settings.coarse_multiple());
            let known = surface.zip(coarse).map(|(s, (c, e))| [s, (c, settings.reading(&e))]);
            let estimator = Estimator { scattered: known, ..estimator };
            outcome.computed[2] +=
                self.rounds(cache, &effort, 2, &all, in_medium, &mut guides[3], |cache, looks, place, rng| {
                    scattered(cache, &estimator, looks, place, rng, Part::Multiple)
                });
            outcome.seconds[2] = outcome.seconds[2] + clock.elapsed();
        }
        let clock = Stopwatch::start();
        let known = surface.zip(caches.multiple.as_ref().zip(settings.multiple));
        let known = known.map(|(s, (c, e))| [s, (c, settings.reading(&e))]);
        let again = Estimator { scattered: known, ..estimator };
        let estimates = self.estimates(
            &caches.multiple,
            settings.multiple,
            before[3],
            100,
            SPREADS[1],
            &guides[3],
            |cache, looks, place, rng| scattered(cache, &again, looks, place, rng, Part::Multiple),
        );
        outcome.computed[2] +=
            blend(&mut caches.multiple, settings.multiple, before[3], estimates, &mut guides[3], SECOND);
        outcome.seconds[2] = outcome.seconds[2] + clock.elapsed();
        if let Some(effort) = settings.irradiance {
            let clock = Stopwatch::start();
            let multiple = caches.multiple.as_ref().zip(settings.multiple).map(|(c, e)| (c, settings.reading(&e)));
            let known = surface.zip(multiple).map(|(surface, multiple)| [surface, multiple]);
            let estimator = Estimator { scattered: known, ..estimator };
            let compute = |_: &SurfaceCache<'_>, looks: Looks<'_>, place: &Place, rng: &mut Generator| {
                irradiance(&estimator, looks, place, rng)
            };
            if let Some(cache) = &mut caches.irradiance {
                outcome.computed[3] += self.rounds(cache, &effort, 3, &all, in_sight, &mut guides[4], compute);
            }
            let estimates = self.estimates(
                &caches.irradiance,
                settings.irradiance,
                before[4],
                101,
                SPREADS[2],
                &guides[4],
                compute,
            );
            outcome.computed[3] +=
                blend(&mut caches.irradiance, settings.irradiance, before[4], estimates, &mut guides[4], SECOND);
            outcome.seconds[3] = outcome.seconds[3] + clock.elapsed();
        }
        outcome.cancelled = self.control.is_cancelled();
        if !outcome.cancelled {
            caches.views.push(view);
            caches.settled = caches.all_counts();
        }
        outcome
    }

    /// A mark of where the eye rays go and how densely places are asked for.
    fn view(&self) -> u64 {
        let Settings { rays, margin, pixels, round, seed, .. } = *self.settings;
        let EyeSettings { density, lights_visible, indirect, .. } = *self.eye;
        let mut crc = Crc::new();
        let mut add = |numbers: &[f32]| numbers.iter().for_each(|n| crc.add(&n.to_bits().to_le_bytes()));
        add(&[margin, pixels.0, pixels.1, self.pixel, density, f32::from(lights_visible), f32::from(indirect)]);
        for at in [[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.3, 0.6]] {
            let ray = (self.eye_ray)(at);
            add(&ray.origin.to_array());
            add(&ray.direction.to_array());
        }
        for number in [u64::from(rays), u64::from(round), seed] {
            crc.add(&number.to_le_bytes());
        }
        crc.value()
    }

    /// Whether the final caches have all that is asked for at a place.
    pub(super) fn is_covered(&self, caches: &RadianceCaches, place: &Place) -> bool {
        fn check<C: Fill>(cache: &Option<C>, effort: Option<Effort>, margin: f32, place: &Place) -> bool {
            let (Some(cache), Some(effort)) = (cache, effort) else { return true };
            cache.is_covered(place, &Reading { margin, ..Reading::new(effort.tolerance) })
        }
        let Settings { single, surface, multiple, irradiance, margin, .. } = *self.settings;
        match place.normal {
            None => {
                check(&caches.single, single, margin, place)
                    && check(&caches.surface, surface, margin, place)
                    && check(&caches.multiple, multiple, margin, place)
            }
            Some(_) => check(&caches.irradiance, irradiance, margin, place),
        }
    }

    /// Estimates the first records once more, with everything they know of each other; from those numbers on.
    fn revise(
        &self,
        caches: &mut RadianceCaches,
        from: [usize; 5],
        pass: u64,
        guides: &mut [Vec<Guide>; 5],
        outcome: &mut Outcome,
    ) {
        let settings = self.settings;
        let (on_surfaces, light, coarse) = (settings.coarse_irradiance(), settings.surface, settings.coarse_multiple());
        let [guides_of_irradiance, guides_of_surface, guides_of_multiple, ..] = guides;
        // Each from those before it, already revised: what a first record had far too bright must not stay in others.
        let clock = Stopwatch::start();
        let estimator = self.all_known(caches);
        let new = self.estimates(
            &caches.coarse_irradiance,
            on_surfaces,
            from[0],
            3 * pass,
            SPREADS[2],
            guides_of_irradiance,
            |_, looks, place, rng| irradiance(&estimator, looks, place, rng),
        );
        outcome.computed[3] +=
            blend(&mut caches.coarse_irradiance, on_surfaces, from[0], new, guides_of_irradiance, 1.0);
        outcome.seconds[3] = outcome.seconds[3] + clock.elapsed();

        let clock = Stopwatch::start();
        let estimator = self.all_known(caches);
        let new = self.estimates(
            &caches.surface,
            light,
            from[1],
            3 * pass + 1,
            SPREADS[0],
            guides_of_surface,
            |cache, looks, place, rng| scattered(cache, &estimator, looks, place, rng, Part::Surface),
        );
        outcome.computed[1] += blend(&mut caches.surface, light, from[1], new, guides_of_surface, 1.0);
        outcome.seconds[1] = outcome.seconds[1] + clock.elapsed();

        let clock = Stopwatch::start();
        let estimator = self.all_known(caches);
        let new = self.estimates(
            &caches.coarse_multiple,
            coarse,
            from[2],
            3 * pass + 2,
            SPREADS[1],
            guides_of_multiple,
            |cache, looks, place, rng| scattered(cache, &estimator, looks, place, rng, Part::Multiple),
        );
        outcome.computed[2] += blend(&mut caches.coarse_multiple, coarse, from[2], new, guides_of_multiple, 1.0);
        outcome.seconds[2] = outcome.seconds[2] + clock.elapsed();
    }

    /// The world lit by all first records.
    fn all_known<'c>(&'c self, caches: &'c RadianceCaches) -> Estimator<'c, M, S> {
        let settings = self.settings;
        let surface = caches.surface.as_ref().zip(settings.surface).map(|(c, e)| (c, settings.reading(&e)));
        let coarse = caches.coarse_multiple.as_ref().zip(settings.coarse_multiple());
        let multiple = coarse.map(|(c, e)| (c, settings.reading(&e)));
        let scattered = surface.zip(multiple).map(|(surface, multiple)| [surface, multiple]);
        Estimator { surfaces: lighting(&caches.coarse_irradiance, settings), scattered, ..*self.estimator }
    }
}
