//! How far pictures made from caches are off, measured against path tracing.
//!
//! Along eye rays drawn all over the picture, with random numbers of their own, the light that caches tell is compared with
//! that of a path. The mean of the differences is the bias, whatever made it; their spread says how well it is known. To tell
//! which cache is to blame, the same rays ask each of them, and at the same points an estimate that knows no cache.
//!
//! ```text
//! b = Σ d_j / Σ t_j,   s² = J/(J − 1) Σ (d_j − b t_j)² / (Σ t_j)²
//! ```
//!
//! over `J` groups of rays, of which `d_j` is the sum of the differences and `t_j` that of the light of paths: a ratio
//! estimate with its standard error (Cochran 1977, *Sampling Techniques*, § 6.4).
//!
//! What is too bright here and too dark there has no mean and is an error all the same. The rays of a group lie next to each other, where caches
//! have one error, and estimates of different rays have nothing in common. So the mean of the products of their differences is, without bias,
//! the square of that error:
//!
//! ```text
//! u = ((Σ d)² − Σ d²)/(k (k − 1))
//! ```
//!
//! over the `k` rays of a group (a U-statistic, Hoeffding 1948). Noise of single estimates, whatever its size, has no part in its mean, and one
//! wild estimate little in its value. So that its spread is small, these estimates end where walks of records do.
//!
//! Gradients are held to the records around them, which takes no estimates: see `agreement`.

use core::ops::Range;

use super::Estimator;
use super::agreement;
use super::bias_map::{Apart, BiasMap, RegionSums, Sample};
use super::caches::RadianceCaches;
use super::kind::Kind;
use super::presets::{BLAMED, MENDED};
use super::seen::{Caches, radiance};
use super::slot::ByKind;
use crate::host::{Medium, Scene};
use crate::math::Ray;
use crate::multiple_scatter;
use crate::path;
use crate::sampling::uniform::mix;
use crate::sampling::{even2, independent, uniform2};
use crate::spectrum::Spectrum;
use crate::work::Rounds;
use crate::world::World;

/// Eye rays of a group, and of a job. More: fewer places; fewer: more noise in squares of errors, which falls with the root of it.
const GROUP: u32 = 32;

/// Groups fill one of so many parts of a picture along each side. Fewer: errors that change within a part go unseen; more: edges of shadows, of the
/// width of a pixel, count.
const PARTS: u32 = 64;

/// Walks and directions of a fill for each eye ray of an audit. An audited ray is compared at some eight points by whole walks and with a
/// whole path, which takes as long as some sixty of those that end at records, and a twentieth of the time is to be spent. In dense
/// fog whole walks take longer, and it is a tenth.
const WALKS_PER_RAY: u64 = 1200;

/// Eye rays at least and at most. Fewer cannot tell ten per cent from chance; more tell less than a tenth of a per cent.
const RAYS: [u32; 2] = [4096, 1 << 18];

/// Eye rays for a fill that took so many walks.
pub(super) fn rays_for(walks: u64) -> u32 {
    u32::try_from(walks / WALKS_PER_RAY).unwrap_or(u32::MAX).clamp(RAYS[0], RAYS[1])
}

/// Rays of a second look over those of the first, where that says that records are wrong. The estimates of rays have heavy tails, as those that come near a lamp, and of a dozen verdicts
/// one is chance: to make records anew by it takes longer than all else. More: time where the first was right; fewer: chance decides.
const AGAIN: u32 = 3;

/// Share of standard errors from which on a look that finds nothing wrong is in doubt: with twice as many rays two standard errors become
/// three. More: wild records stay that few rays meet; less: time for chance.
const DOUBT: f64 = 2.0 / 3.0;

/// Standard errors beyond which a difference is no chance.
pub(super) const SURE: f64 = 3.0;

/// Standard error of a deviation from which on it says nothing. Larger: pictures that are off by as much pass without a word; smaller: words about
/// pictures whose audit was short.
const UNKNOWN: f64 = 0.5;

/// A relative deviation and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Deviation {
    /// Of the mean light of the picture: −0.01 is one per cent too dark.
    pub bias: f64,
    /// Its standard error.
    pub error: f64,
}

impl Deviation {
    /// Whether it is certainly more than `most`: by three standard errors.
    ///
    /// ```
    /// # use fogbow::cache::Deviation;
    /// let dark = Deviation { bias: -0.05, error: 0.005 };
    /// assert!(dark.exceeds(0.02) && !dark.exceeds(0.04));
    /// ```
    #[must_use]
    pub fn exceeds(&self, most: f64) -> bool {
        self.bias.abs() - SURE * self.error > most
    }

    /// Whether it is more than `most`, or, in the mean of a picture, certainly no chance and more than half of that: what is certain is mended before it is all of the error.
    pub(super) fn is_to_be_mended(&self, most: f64) -> bool {
        self.exceeds(most) || self.exceeds(0.0) && self.bias.abs() > MENDED * most
    }

    /// Whether so little is known that nothing can be said: the standard error is more than half of the light. Not where there is no light, and
    /// nothing to know.
    ///
    /// ```
    /// # use fogbow::cache::Deviation;
    /// let wild = Deviation { bias: 40.0, error: 27.0 };
    /// assert!(wild.is_unknown() && !wild.exceeds(0.02));
    /// ```
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        self.error > UNKNOWN && self.error < f64::INFINITY
    }
}

/// The square of a relative error and how well it is known: without bias, so that it may be a bit less than 0 where there is hardly any error.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Squared {
    /// Mean of squares: 0.0004 is an error of two per cent.
    pub mean: f64,
    /// Its standard error.
    pub error: f64,
}

impl Squared {
    /// The relative error, the root of the mean; 0 where that is negative.
    ///
    /// ```
    /// # use fogbow::cache::Squared;
    /// assert_eq!(Squared { mean: 0.0004, error: 0.0 }.root(), 0.02);
    /// assert_eq!(Squared { mean: -1e-6, error: 1e-5 }.root(), 0.0);
    /// ```
    #[must_use]
    pub fn root(&self) -> f64 {
        libm::sqrt(self.mean.max(0.0))
    }

    /// Roots of what lies one standard error below the mean and above it.
    ///
    /// ```
    /// # use fogbow::cache::Squared;
    /// let [least, most] = Squared { mean: 0.0005, error: 0.0004 }.range();
    /// assert!((least - 0.01).abs() < 1e-9 && (most - 0.03).abs() < 1e-9);
    /// ```
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        [self.mean - self.error, self.mean + self.error].map(|square| libm::sqrt(square.max(0.0)))
    }

    /// Whether the error is certainly more than `most`: by three standard errors of its square.
    ///
    /// ```
    /// # use fogbow::cache::Squared;
    /// let blotched = Squared { mean: 0.0016, error: 0.0003 };
    /// assert!(blotched.exceeds(0.02) && !blotched.exceeds(0.03));
    /// ```
    #[must_use]
    pub fn exceeds(&self, most: f64) -> bool {
        self.mean - SURE * self.error > most * most
    }
}

/// What an [`Audit`] has found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Findings {
    /// Eye rays compared.
    pub rays: u32,
    /// Of all light together, against path tracing: whatever made it.
    pub all: Deviation,
    /// Of the light that is cached, as a part of all light, against estimates without caches at the same points: better known.
    pub cached: Deviation,
    /// The same in each channel, as a part of the mean of all channels: colours may be wrong where all light together is right.
    pub channels: [Deviation; 3],
    /// The error of the picture that comes from records, blotches that have no mean included, as a part of its light (root of the mean of squares):
    /// against estimates as records are made of, which end in cells that photons have lit ([`Settings::photons`](super::Settings::photons)), if these are there.
    pub squared: Squared,
    /// Parts of kinds in that, in the order of [`Kind::FINAL`]; what they have together is in none.
    pub(super) squared_parts: [f64; 4],
    /// See [`Findings::gradients`].
    gradients: ByKind<Option<Deviation>>,
    /// Of the light that one cache holds, as a part of all light; `None` for a kind that is not cached.
    parts: ByKind<Option<Deviation>>,
}

impl Findings {
    /// Of the light of one kind ([`Kind::FINAL`]), as a part of all light; `None` if it is not cached.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{cache::{Audit, Kind, RadianceCaches, Settings}, math::{Ray, Vec3}};
    /// let caches = RadianceCaches::new(Settings::default()); // none at all
    /// let audit = Audit::new(&caches, |_| Ray::new(Vec3::ZERO, Vec3::Z), 64);
    /// assert!(audit.findings().of(Kind::Multiple).is_none());
    /// # }
    /// ```
    #[must_use]
    pub fn of(&self, kind: Kind) -> Option<Deviation> {
        self.parts[kind]
    }

    /// By how much the slope of light between records of one kind ([`Kind::FINAL`]) deviates from what their gradients foretell: 0 where gradients are right; −1 where
    /// they are nothing but noise; −2 where they are turned round. `None` if it is not cached, or has too few records.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{cache::{Audit, Kind, RadianceCaches, Settings}, math::{Ray, Vec3}};
    /// let caches = RadianceCaches::new(Settings::default()); // none at all
    /// let audit = Audit::new(&caches, |_| Ray::new(Vec3::ZERO, Vec3::Z), 64);
    /// assert!(audit.findings().gradients(Kind::Multiple).is_none());
    /// # }
    /// ```
    #[must_use]
    pub fn gradients(&self, kind: Kind) -> Option<Deviation> {
        self.gradients[kind]
    }

    /// Whether the gradients of records of a kind certainly lead the wrong way: by three standard errors of [`Findings::gradients`].
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{cache::{Audit, Kind, RadianceCaches, Settings}, math::{Ray, Vec3}};
    /// let caches = RadianceCaches::new(Settings::default()); // none at all
    /// let audit = Audit::new(&caches, |_| Ray::new(Vec3::ZERO, Vec3::Z), 64);
    /// assert!(!audit.findings().is_misled(Kind::Multiple));
    /// # }
    /// ```
    #[must_use]
    pub fn is_misled(&self, kind: Kind) -> bool {
        self.gradients[kind].is_some_and(|slope| agreement::is_misled(&slope))
    }

    /// Whether the picture, or what its error comes from, may be found wrong by twice as many rays. Regions are not asked: of so many one is always in doubt.
    fn is_in_doubt(&self, most: f64) -> bool {
        let Squared { mean, error } = self.squared;
        let nearly = |found: Deviation| Deviation { error: DOUBT * found.error, ..found }.is_to_be_mended(most);
        let of_kinds = || Kind::FINAL.into_iter().filter_map(|kind| self.of(kind)).any(nearly);
        nearly(self.cached) || of_kinds() || Squared { mean, error: DOUBT * error }.exceeds(most)
    }

    /// Regions that are off by certainly more than `most`, where the others together are not.
    pub(super) fn places(&self, map: &BiasMap, most: f64) -> Option<Apart> {
        map.apart(most).filter(|apart| !apart.rest.is_to_be_mended(most))
    }

    /// What rays say is certainly wrong with each of the kinds that are cached ([`Kind::FINAL`]), in those places or everywhere.
    pub(super) fn wrong(&self, map: &BiasMap, most: f64) -> [Option<Deviation>; 4] {
        let is_off = |found: &Deviation| found.is_to_be_mended(most);
        let to_blame = |kind: Kind| self.of(kind).filter(is_off);
        let none_alone = Kind::FINAL.into_iter().all(|kind| to_blame(kind).is_none());
        let (together, places) = (Some(self.cached).filter(is_off), self.places(map, most));
        // Blotches without a mean are off by the root of their mean square.
        let blotched = self.squared.exceeds(most).then(|| Deviation { bias: self.squared.root(), error: 0.0 });
        let is_blotched = |number: usize| self.squared_parts[number] > BLAMED * self.squared.mean;
        core::array::from_fn(|number| {
            let found = match places {
                Some(Apart { worst, parts, .. }) => Some(worst).filter(|_| parts[number].abs() > BLAMED),
                None if none_alone => together.or(blotched.filter(|_| is_blotched(number))),
                None => to_blame(Kind::FINAL[number]),
            };
            found.filter(|_| self.parts[Kind::FINAL[number]].is_some())
        })
    }
}

/// Sums over groups of rays.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Moments {
    d: f64,
    dd: f64,
    dt: f64,
}

impl Moments {
    fn add(&mut self, difference: f64, truth: f64) {
        self.d += difference;
        self.dd += difference * difference;
        self.dt += difference * truth;
    }

    /// As a part of the sum `t` of `truth`, whose squares sum to `tt`, over `groups` groups.
    fn deviation(&self, t: f64, tt: f64, groups: f64) -> Deviation {
        if !(t > 0.0 && groups > 1.0) {
            return Deviation { bias: 0.0, error: f64::INFINITY };
        }
        let bias = self.d / t;
        let squares = (self.dd - 2.0 * bias * self.dt + bias * bias * tt).max(0.0);
        Deviation { bias, error: libm::sqrt(squares * groups / (groups - 1.0)) / t }
    }
}

/// What a job leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compared {
    /// Rays, and the sum of the light of their paths.
    rays: u32,
    truth: f64,
    all: f64,
    parts: [f64; 4],
    channels: [f64; 3],
    /// The rays one by one, of which `rays` are set.
    samples: [Sample; GROUP as usize],
}

impl Default for Compared {
    fn default() -> Self {
        let samples = [Sample::default(); GROUP as usize];
        Self { rays: 0, truth: 0.0, all: 0.0, parts: [0.0; 4], channels: [0.0; 3], samples }
    }
}

/// Compares [`RadianceCaches`] with path tracing, as [`Rounds`] of jobs of 32 eye rays that lie next to each other: any number of them can be run, and what was
/// found so far read at any time.
///
/// ```
/// # #[cfg(feature = "alloc")] {
/// # use fogbow::{cache::{Asked, Audit, Kind, RadianceCaches, Settings}, host::Empty, light::Light};
/// # use fogbow::{math::{Bounds, Ray, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase, spectrum::Spectrum};
/// # use fogbow::{work::finish, world::{Outline, World}};
/// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
/// # let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
/// # let sky = [Light::Constant(Spectrum::ONE)];
/// # let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
/// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let settings = Settings { rays: 64, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(64) };
/// let camera = |at: [f32; 2]| Ray::new(3.0 * Vec3::Z, Vec3::new(at[0] - 0.5, at[1] - 0.5, -2.0).normalize());
/// let caches = RadianceCaches::new(settings);
/// let mut filling = caches.fill(Asked::View { ray: camera, pixel: 0.02 });
/// finish(&mut filling, &world, &mut Default::default());
/// let caches = filling.finish();
/// let mut audit = Audit::new(&caches, camera, 4096);
/// finish(&mut audit, &world, &mut Default::default());
/// let found = audit.findings();
/// assert!(found.cached.error < 0.02 && !found.cached.exceeds(0.05), "{found:?}");
/// assert!(found.of(Kind::Multiple).is_some() && found.of(Kind::Single).is_none());
/// // Where: in 16 regions of 256 rays each, about.
/// let map = audit.map();
/// assert!(map.side() == 4 && map.regions().iter().all(|region| region.rays > 100));
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Audit<'c, 's, F> {
    caches: &'c RadianceCaches<'s>,
    ray: F,
    /// The first job that counts, and where they end.
    first: u32,
    jobs: u32,
    taken: u32,
    /// What a second look would be for.
    most: Option<f64>,
    /// Whether this look has been prolonged.
    is_doubled: bool,
    sums: Sums,
    regions: RegionSums,
    gradients: ByKind<Option<Deviation>>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    rays: u32,
    truth: [f64; 2],
    all: Moments,
    cached: Moments,
    parts: [Moments; 4],
    channels: [Moments; 3],
}

impl<'c, 's, F: Fn([f32; 2]) -> Ray> Audit<'c, 's, F> {
    /// Of pictures whose pixels see along `ray(at)`, `at` in the unit square, by about `rays` of them. The more, the better the bias is known:
    /// four times as many halve its error.
    #[must_use]
    pub fn new(caches: &'c RadianceCaches<'s>, ray: F, rays: u32) -> Self {
        let jobs = rays.div_ceil(GROUP).max(2);
        let mut gradients = ByKind([None; Kind::COUNT]);
        Kind::FINAL.into_iter().for_each(|kind| gradients[kind] = agreement::of_gradients(&caches.slots[kind]));
        Self {
            caches,
            ray,
            first: 0,
            jobs,
            taken: 0,
            most: None,
            is_doubled: false,
            sums: Sums::default(),
            regions: RegionSums::new(jobs * GROUP),
            gradients,
        }
    }

    /// Where the rays say that records are wrong by so much that [`RadianceCaches::drop_wrong`] would drop them for `error`, looks again, along three times as many others; what
    /// they find is all that counts then. Either look takes twice as many rays where it is in doubt. For who drops records by an audit: a verdict by chance costs more than the second look.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{cache::{Audit, Compared, RadianceCaches, Settings}, host::Empty, math::{Ray, Vec3}, work::finish, world::World};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let caches = RadianceCaches::new(Settings::default());
    /// let mut audit = Audit::new(&caches, |_| Ray::new(Vec3::ZERO, Vec3::Z), 64).held_to(0.02);
    /// finish(&mut audit, &world, &mut Compared::default());
    /// assert_eq!(audit.findings().rays, 64); // nothing is wrong
    /// # }
    /// ```
    #[must_use]
    pub fn held_to(self, error: f32) -> Self {
        Self { most: Some(f64::from(error)), ..self }
    }

    /// After a first look that says that records are wrong, a second; after that none. Either is doubled once where it is in doubt.
    fn look_again(&mut self) {
        let Some(most) = self.most else { return };
        let findings = self.findings();
        let is_wrong = findings.wrong(&self.map(), most).iter().any(Option::is_some);
        if is_wrong && self.first == 0 {
            let jobs = self.jobs.saturating_mul(AGAIN);
            (self.first, self.jobs) = (self.jobs, self.jobs.saturating_add(jobs));
            (self.sums, self.regions) = (Sums::default(), RegionSums::new(jobs.saturating_mul(GROUP)));
            self.is_doubled = false;
        } else if !is_wrong && !self.is_doubled && findings.is_in_doubt(most) {
            self.jobs = self.jobs.saturating_add(self.jobs - self.first);
            self.is_doubled = true;
        } else {
            self.most = None;
        }
    }

    /// What was found so far, by region of the picture.
    #[must_use]
    pub fn map(&self) -> BiasMap {
        self.regions.map()
    }

    /// What was found so far.
    #[must_use]
    pub fn findings(&self) -> Findings {
        let Sums { rays, truth: [t, tt], all, cached, parts: of_kinds, channels } = self.sums;
        let groups = f64::from(self.taken - self.first);
        let mut parts = ByKind([None; Kind::COUNT]);
        for (kind, moments) in Kind::FINAL.into_iter().zip(&of_kinds) {
            let is_cached = self.caches.settings.effort(kind).is_some();
            parts[kind] = is_cached.then(|| moments.deviation(t, tt, groups));
        }
        let [all, cached] = [all, cached].map(|moments| moments.deviation(t, tt, groups));
        let channels = channels.map(|moments| moments.deviation(t, tt, groups));
        let (squared, squared_parts) = self.regions.squared();
        Findings { rays, all, cached, channels, squared, squared_parts, gradients: self.gradients, parts }
    }
}

impl<M, S, F> Rounds<World<'_, M, S>> for Audit<'_, '_, F>
where
    M: Medium + ?Sized,
    S: Scene + ?Sized,
    F: Fn([f32; 2]) -> Ray,
{
    type Output<'o> = Compared;

    fn jobs(&self) -> Range<u32> {
        self.taken..self.jobs
    }

    fn run(&self, job: u32, world: &World<'_, M, S>, output: &mut Compared) {
        *output = Compared::default();
        let settings = &self.caches.settings;
        let cached = self.caches.estimator(world);
        // Whole walks, whatever caches were made of.
        let walk = multiple_scatter::Settings { max_vertices: u32::MAX, ..cached.walk };
        let alone = Estimator { surfaces: None, photons: None, walk, ..cached };
        // As records were made: little noise, and what cells have wrong is nothing that records could be blamed for.
        let ended = Estimator { walk, ..self.caches.making(world) };
        let seed = mix(settings.seed ^ 0x6175_6469_7421_0b5e);
        let shift = uniform2(&mut independent(seed, 0, 2)).to_array();
        // Shifted: the sequence begins in the very middle, where symmetric worlds have their lamps.
        let wrapped = |at: [f32; 2]| {
            [0, 1].map(|axis| {
                let moved = f64::from(at[axis]) + f64::from(shift[axis]);
                moved - libm::floor(moved)
            })
        };
        let part = wrapped(even2(job)).map(|at| libm::floor(at * f64::from(PARTS)));
        for i in 0..GROUP {
            let number = job * GROUP + i;
            let within = wrapped(even2(number));
            let at =
                [0, 1].map(|axis| (((part[axis] + within[axis]) / f64::from(PARTS)) as f32).min(1.0 - f32::EPSILON));
            let ray = (self.ray)(at);
            // Both meet the same points, as they draw the same numbers.
            let rng = |stream| independent(seed, u64::from(number), stream);
            let told = radiance(&ray, &cached, &self.caches.reader(), &settings.eye, &mut rng(0));
            let known = radiance(&ray, &alone, &Caches::default(), &settings.eye, &mut rng(0));
            let near = radiance(&ray, &ended, &Caches::default(), &settings.eye, &mut rng(0));
            let truth = path::radiance(&ray, world, &settings.paths, &mut rng(1)).total();
            // A sample that is no number says nothing.
            if ![told.total(), known.total(), near.total(), truth].iter().all(|light| light.is_finite()) {
                continue;
            }
            let [all, truth] = [told.total(), truth].map(|light| f64::from(light.mean()));
            output.truth += truth;
            output.all += all - truth;
            // All estimate what is not cached, each with noise of its own.
            let is_cached = Kind::FINAL.map(|kind| settings.effort(kind).is_some());
            let told = told.by_kind();
            let beyond = |other: [Spectrum; 4]| -> [Spectrum; 4] {
                core::array::from_fn(|k| if is_cached[k] { told[k] - other[k] } else { Spectrum::ZERO })
            };
            let means = |of: [Spectrum; 4]| of.map(|difference| f64::from(difference.mean()));
            let (known, near) = (beyond(known.by_kind()), means(beyond(near.by_kind())));
            let (parts, channels) = (means(known), known.into_iter().sum::<Spectrum>());
            output.channels.iter_mut().zip(channels.0).for_each(|(sum, channel)| *sum += f64::from(channel));
            output.parts.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
            let cached = parts.iter().sum();
            output.samples[output.rays as usize] = Sample { at, told: all, traced: truth, cached, parts, near };
            output.rays += 1;
        }
    }

    fn accept(&mut self, output: &Compared) {
        if self.taken >= self.jobs {
            return;
        }
        self.taken += 1;
        let sums = &mut self.sums;
        sums.rays += output.rays;
        sums.truth[0] += output.truth;
        sums.truth[1] += output.truth * output.truth;
        sums.all.add(output.all, output.truth);
        sums.cached.add(output.parts.iter().sum(), output.truth);
        let moments = sums.parts.iter_mut().chain(&mut sums.channels);
        for (moments, part) in moments.zip(output.parts.into_iter().chain(output.channels)) {
            moments.add(part, output.truth);
        }
        self.regions.add_group(&output.samples[..output.rays as usize]);
        if self.taken == self.jobs {
            self.look_again();
        }
    }

    fn stage(&self) -> &'static str {
        "audit"
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::cache::Settings;
    use crate::host::Empty;
    use crate::light::Light;
    use crate::math::{Bounds, Vec3};
    use crate::medium::{Homogeneous, Placed, Region};
    use crate::phase::Phase;
    use crate::work::step;
    use crate::world::Outline;

    /// Only what a second look finds counts: a fifth too bright in the first by chance, and right in all that follows. Where a look finds as much, but is not
    /// sure of it, it takes twice as many rays.
    #[test]
    fn a_verdict_by_chance_is_not_upheld() {
        let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.5), Phase::ISOTROPIC).unwrap();
        let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
        let sky = [Light::Constant(Spectrum::ONE)];
        let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
        let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
        // Without records every point has an estimate of its own.
        let caches = RadianceCaches::new(Settings::for_outline(&outline, 0.02).with_walks(16));
        let ray = |at: [f32; 2]| Ray::new(3.0 * Vec3::Z, Vec3::new(at[0] - 0.5, at[1] - 0.5, -2.0).normalize());
        // A fifth too bright, by so many standard errors.
        let biased = |t: f64, groups: f64, sure: f64| {
            let d = 0.2 * t;
            Moments { d, dd: d * d * (1.0 / groups + 1.0 / (sure * sure)), dt: d * t / groups }
        };
        const CERTAIN: f64 = 100.0;
        for (held, looks, jobs) in [
            (true, [Some(CERTAIN), None], 64),
            (true, [Some(CERTAIN), Some(2.5)], 112),
            (true, [Some(2.5), None], 32),
            (false, [Some(CERTAIN), None], 16),
            (true, [None, None], 16),
        ] {
            let audit = Audit::new(&caches, ray, 16 * GROUP);
            let mut audit = if held { audit.held_to(0.02) } else { audit };
            let mut output = Compared::default();
            // Before the last job of each look.
            for (sure, last) in looks.into_iter().zip([15, 63]) {
                let Some(sure) = sure else { continue };
                while audit.taken < last {
                    step(&mut audit, &world, &mut output);
                }
                audit.sums.cached = biased(audit.sums.truth[0], f64::from(audit.taken - audit.first), sure);
            }
            while step(&mut audit, &world, &mut output) {}
            let found = audit.findings();
            assert_eq!(audit.taken, jobs);
            assert_eq!(found.rays, (if jobs > 32 { jobs - 16 } else { jobs }) * GROUP);
            assert_eq!(found.cached.exceeds(0.02), !held, "{found:?}");
            let in_regions: u32 = audit.map().regions().iter().map(|region| region.rays).sum();
            assert_eq!(in_regions, found.rays);
        }
    }
}
