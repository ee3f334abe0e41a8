//! Noise of caches in a picture: measured along eye rays, and the estimates that it asks for.
//!
//! The same eye rays read all caches before their records are estimated anew and after, with the same random numbers, so that what differs is the
//! noise of records, mixed and carried as pictures have them, and nothing else. Where fog reaches far beyond its records, one sample of a pixel meets few of
//! them, and all samples together many: so each ray is read twice, by random numbers of its own each time, before as well as after. What counts is the part of
//! the difference that both readings share. The rest is averaged by the samples of a pixel, whose spread tells of it (decision 97). A kind whose noise
//! weighs much, for its light or for how hard it is to find, is estimated anew more often; one that the picture hardly shows is not. So it is region by region:
//! what is dark is seen by itself, and its records go on when those of what is bright are good enough.

use super::kind::{FIRST_COUNTS, Kind};
use super::presets;
use super::seen::CachedRadiance;
use super::settings::Settings;
use crate::sent::packed;
use crate::spectrum::Spectrum;

/// Eye rays that are read. Fewer: single dark pixels decide; more: time.
pub(super) const RAYS: u32 = 4096;

/// Readings of each ray, each with random numbers of its own: two, because the product of what they differ by is a square in the mean.
pub(super) const READINGS: usize = 2;

/// Regions along each side of a picture for which noise is told apart. Fewer: what is dark and noisy is lost in what is around it; more: few rays tell
/// of each.
const SIDE: usize = 8;

/// All regions.
pub(super) const REGIONS: usize = SIDE * SIDE;

/// Light (of the mean of a picture) that is added to that of each ray, in squares: relative errors of what is black mean nothing.
pub(super) const DARK: f64 = 0.05;

/// The kinds that a picture is read from.
const KINDS: usize = Kind::FINAL.len();

/// What an eye ray reads: light of each kind, in the order of [`Kind::FINAL`], and all light; means of the channels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Glance {
    kinds: [f32; KINDS],
    all: f32,
}

packed!(Glance { kinds: [f32; KINDS], all: f32 });

impl Glance {
    /// Of light that is no number nothing.
    pub(super) fn new(seen: &CachedRadiance) -> Self {
        let kinds = seen.by_kind().map(|light| light.mean());
        let all = seen.total().mean();
        if all.is_finite() { Self { kinds, all } } else { Self::default() }
    }

    /// Light of one kind, nothing of what is no number.
    pub(super) fn of(kind: Kind, light: Spectrum) -> Self {
        let light = if light.is_finite() { light.mean() } else { 0.0 };
        Self { kinds: Kind::FINAL.map(|other| if other == kind { light } else { 0.0 }), all: light }
    }

    /// As [`Glance::new`], without lights and what else glows.
    pub(super) fn scattered(seen: &CachedRadiance) -> Self {
        Self::new(&CachedRadiance { emitted: Spectrum::ZERO, ..*seen })
    }

    /// Light of each kind, and all light.
    pub(super) fn light(&self) -> ([f32; KINDS], f32) {
        (self.kinds, self.all)
    }
}

/// Readings of all rays, of which there are no more than of those that records are made for.
pub(super) fn readings(settings: &Settings) -> u32 {
    RAYS.min(settings.rays) * READINGS as u32
}

/// Light below which relative errors of a picture mean nothing.
pub(super) fn dark(glances: &[Glance]) -> f64 {
    let sum: f64 = glances.iter().map(|glance| f64::from(glance.all)).sum();
    if glances.is_empty() { 0.0 } else { DARK * sum / glances.len() as f64 }
}

/// Relative variance in a picture of what photons, or others that come in halves, tell: of [`READINGS`] along each ray by one half of them, each at a place of its own, and after all these as many by the other.
///
/// ```text
/// E[(A₁ − B₁)(A₂ − B₂) | photons] = (E[A − B | photons])² = 4 V((A + B)/2)   in the mean over photons
/// V = Σ_k max(0, ⟨(S_k/L_k)² (A₁ − B₁)(A₂ − B₂)/(4 (b² + dark²))⟩_k)
/// ```
///
/// `S_k` is the share of a kind, `L_k` its mean light, `b` how bright a region is, 1 in the mean, and `⟨⟩_k` the mean over the rays that read the kind. As in [`Noise::add`] readings are independent given the photons, so that noise of their walks has no part in it. `shares` are those of light of each kind in the picture, and `region` says in which
/// region of it a ray is. What differs is told over the light of that region, to which `dark`, over the light of a usual one, is added in squares: in a dark one all light is, and a place that is dark to an eye
/// may be seen with what is bright.
pub(super) fn of_halves(glances: &[Glance], region: &dyn Fn(usize) -> usize, shares: [f64; KINDS], dark: f64) -> f64 {
    let (first, second) = glances.split_at(glances.len() / 2);
    let rays = || {
        let pairs = first.as_chunks::<READINGS>().0.iter().zip(second.as_chunks::<READINGS>().0);
        pairs.enumerate().map(|(ray, (a, b))| (region(ray).min(REGIONS - 1), a, b))
    };
    // Light of each kind in each region, and after them in all, and of how many rays.
    let mut read = [[[0.0; 2]; KINDS]; REGIONS + 1];
    for (region, a, b) in rays() {
        (0..KINDS).for_each(|k| {
            let light = a.iter().chain(b).map(|glance| f64::from(glance.kinds[k])).sum::<f64>();
            if light > 0.0 {
                for place in [region, REGIONS] {
                    read[place][k][0] += light / (2 * READINGS) as f64;
                    read[place][k][1] += 1.0;
                }
            }
        });
    }
    let usual = read[REGIONS].map(|[light, rays]| light / rays);
    // How bright a region is, by the kinds that are read there.
    let bright = |region: usize| {
        let (mut light, mut share) = (0.0, 0.0);
        for (k, [of_kind, rays]) in read[region].into_iter().enumerate() {
            if rays > 0.0 {
                (light, share) = (light + shares[k] * of_kind / (rays * usual[k]), share + shares[k]);
            }
        }
        light / share
    };
    let mut sums = [0.0; KINDS];
    for (region, a, b) in rays() {
        let bright = bright(region);
        let over = bright * bright + dark * dark;
        for (k, sum) in sums.iter_mut().enumerate() {
            let product: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a.kinds[k] - b.kinds[k])).product();
            let share = shares[k] / usual[k];
            let relative = share * share * product / (4.0 * read[REGIONS][k][1] * over);
            // Written so that what is no number counts as nothing.
            if relative.is_finite() {
                *sum += relative;
            }
        }
    }
    // Neither no rays nor a sum that chance made negative tell of noise.
    sums.iter().map(|sum| f64::max(*sum, 0.0)).sum()
}

/// The noise of a kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Left {
    /// Relative variance that records leave in the picture as they are.
    variance: f64,
    /// In how many estimates, each as good as a second one.
    estimates: f64,
}

impl Left {
    /// Of records whose readings differ by so much in squares, before and after a second estimate of so many times the usual samples.
    ///
    /// ```text
    /// M = (f B + e X)/(f + e):   V(M)/V(M − B) = (f² v + e²)/(e² (v + 1)),  v = V(B)/V(X) = BLIND e
    /// ```
    ///
    /// where `f` is what first estimates count.
    fn between(squares: f64, effort: f64) -> Self {
        let first = f64::from(FIRST_COUNTS) / effort;
        let blind = presets::BLIND * effort;
        let share = (first * first * blind + 1.0) / (blind + 1.0);
        Self { variance: share * squares, estimates: 1.0 + first }
    }

    /// The variance after so many more estimates.
    fn after(&self, rounds: u32) -> f64 {
        self.variance * self.estimates / (self.estimates + f64::from(rounds))
    }
}

/// Squares of what pixels differ by, over those of the light of each ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Sums {
    squares: [f64; KINDS],
    rays: f64,
}

/// The number of the region of a picture in which a point of the film lies.
pub(super) fn region_of(at: [f32; 2]) -> usize {
    // Casts saturate, and take NaN to 0.
    let [x, y] = at.map(|x| ((x * SIDE as f32) as usize).min(SIDE - 1));
    y * SIDE + x
}

/// The numbers of the regions of a picture into which a rectangle of the film reaches, from two coordinates to two.
pub(super) fn regions_in([x0, y0, x1, y1]: [f32; 4]) -> impl Iterator<Item = usize> {
    let [first, last] = [[x0, y0], [x1, y1]].map(region_of);
    let columns = first % SIDE..=last % SIDE;
    // Rows follow each other.
    (first..=last).filter(move |region| columns.contains(&(region % SIDE)))
}

/// What rays have told, by region of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    regions: [Sums; REGIONS],
}

impl Default for Noise {
    fn default() -> Self {
        Self { regions: [Sums::default(); REGIONS] }
    }
}

impl Noise {
    /// Adds a ray at a point of the film, read `before` and after, of a picture as dark as [`dark`] says.
    ///
    /// ```text
    /// E[(M₁ − B₁)(M₂ − B₂) | records] = (E[M − B | records])²
    /// ```
    ///
    /// `B` and `M` are what a reading finds before and after. Given the records, readings are independent: so this is the square of what the mean of many
    /// samples differs by. It is divided by the light that both find, which makes it too large by a part of second order in their own noise.
    pub(super) fn add(&mut self, at: [f32; 2], before: &[Glance; READINGS], after: &[Glance; READINGS], dark: f64) {
        let sums = &mut self.regions[region_of(at)];
        let all = after.iter().map(|glance| f64::from(glance.all)).sum::<f64>() / READINGS as f64;
        let light = all * all + dark * dark;
        sums.rays += 1.0;
        for (k, sum) in sums.squares.iter_mut().enumerate() {
            let product: f64 = before.iter().zip(after).map(|(b, a)| f64::from(b.kinds[k] - a.kinds[k])).product();
            // Written so that what is no number counts as nothing.
            if light > 0.0 && product.is_finite() {
                *sum += product / light;
            }
        }
    }

    /// What each kind leaves in the regions of the picture, in the order of [`Kind::FINAL`], whose second estimates had so many times the usual samples.
    pub(super) fn left(&self, efforts: [f64; KINDS]) -> [[Left; KINDS]; REGIONS] {
        self.regions.map(|sums| {
            core::array::from_fn(|k| {
                // Neither no rays nor a sum that chance made negative tell of noise.
                let between = if sums.squares[k] > 0.0 { sums.squares[k] / sums.rays } else { 0.0 };
                let left = Left::between(between, efforts[k].max(1.0));
                let smoothed = if Kind::FINAL[k].is_on_surfaces() { presets::SMOOTHED } else { 1.0 };
                Left { variance: smoothed * left.variance, ..left }
            })
        })
    }
}

/// The variance of all kinds together, after so many more estimates of each.
pub(super) fn variance_after(left: &[Left; KINDS], rounds: [u32; KINDS]) -> f64 {
    left.iter().zip(rounds).map(|(left, rounds)| left.after(rounds)).sum()
}

/// How often each kind should be estimated once more, so that variances sum to `most`: always the one whose noise falls by most for its
/// cost, as long as noise falls faster than the work that was `spent` grows. Of kinds that are made coarsely (`coarser`) a round is as much cheaper, and
/// there may be as many more. Where the most rounds would not do by far, there are fewer.
pub(super) fn rounds_for(
    left: &[Left; KINDS],
    (costs, coarser): ([f64; KINDS], [f32; KINDS]),
    most: f64,
    spent: f64,
) -> [u32; KINDS] {
    // Rounds that would do go like the square of noise.
    let hope = presets::HOPELESS * most / variance_after(left, [0; KINDS]);
    let limit = presets::MOST_ROUNDS as f32 * (hope as f32).clamp(presets::LEAST_HOPE, 1.0);
    let limits = coarser.map(|factor| (limit * factor * factor) as u32);
    let (mut rounds, mut work) = ([0; KINDS], spent);
    loop {
        let sum = variance_after(left, rounds);
        let gain = |k: usize| (left[k].after(rounds[k]) - left[k].after(rounds[k] + 1)) / costs[k];
        let is_open = |&k: &usize| rounds[k] < limits[k] && costs[k] > 0.0;
        let best = (0..KINDS).filter(is_open).max_by(|&a, &b| gain(a).total_cmp(&gain(b)));
        match best {
            Some(k) if sum > most && gain(k) / (sum + most) > presets::PAYS / work => {
                work += costs[k];
                rounds[k] += 1;
            }
            _ => return rounds,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Generator, uniform};

    fn glance(multiple: f32, indirect: f32) -> Glance {
        let light = |value| Spectrum::splat(value);
        let seen = CachedRadiance {
            medium_multiple: light(multiple),
            surface_indirect: light(indirect),
            ..Default::default()
        };
        Glance::new(&seen)
    }

    #[test]
    fn noise_is_relative_to_the_light_of_each_ray() {
        let mut noise = Noise::default();
        let before = [glance(1.0, 0.0), glance(8.0, 2.0)];
        assert!((dark(&before) - 0.275).abs() < 1e-6);
        let after = [glance(1.1, 0.0), glance(8.0, 3.0)];
        for (before, after) in before.iter().zip(after) {
            noise.add([0.0; 2], &[*before; READINGS], &[after; READINGS], 0.0);
        }
        let left = noise.left([1.0; KINDS]);
        let [single, surface, multiple, irradiance] = left[0].map(|left| left.variance);
        assert_eq!((single, surface), (0.0, 0.0));
        let expected = |difference: f64, light: f64| Left::between((difference / light).powi(2) / 2.0, 1.0).variance;
        assert!((multiple / expected(0.1, 1.1) - 1.0).abs() < 1e-5, "{multiple}");
        let irradiance = irradiance / presets::SMOOTHED;
        assert!((irradiance / expected(1.0, 11.0) - 1.0).abs() < 1e-5, "{irradiance}");
        // Rays in the dark, and light that is no number, say nothing.
        let before = noise;
        noise.add([0.0; 2], &[glance(0.0, 0.0); READINGS], &[glance(f32::NAN, 0.0); READINGS], 0.0);
        assert_eq!(noise.regions[0].squares, before.regions[0].squares);
        // Nor do other regions.
        assert!(left[1..].iter().flatten().all(|left| left.variance == 0.0));
    }

    /// Records of a pixel that are too bright or too dark by 3 %, of which single readings find that and 20 % more that they share with no other.
    #[test]
    fn what_samples_of_a_pixel_average_is_no_noise_of_records() {
        const RAYS: u32 = 400_000;
        let (mut noise, mut rng) = (Noise::default(), Generator::new(7));
        let mut sign = || if uniform(&mut rng) < 0.5 { -1.0 } else { 1.0 };
        for _ in 0..RAYS {
            let of_pixel = 0.03 * sign();
            let after = [(); READINGS].map(|()| glance(1.0 + of_pixel + 0.2 * sign(), 9.0));
            noise.add([0.0; 2], &[glance(1.0, 9.0); READINGS], &after, 0.0);
        }
        let found = noise.regions[0].squares[2] / f64::from(RAYS);
        // The products vary by 0.02² / √RAYS, 7 % of what is expected.
        assert!((found / 0.003_f64.powi(2) - 1.0).abs() < 0.25, "{found}");
        // Where chance makes the sum negative the variance is not.
        let mut noise = Noise::default();
        noise.add([0.0; 2], &[glance(1.0, 0.0); READINGS], &[glance(0.9, 0.0), glance(1.1, 0.0)], 0.0);
        assert!(noise.left([1.0; KINDS]).iter().flatten().all(|left| left.variance == 0.0));
    }

    /// Halves of the photons that are too bright or too dark by 6 %, at places where single readings vary by as much again.
    #[test]
    fn what_halves_differ_by_is_noise_of_all_photons() {
        const PLACES: usize = 4096;
        let mut rng = Generator::new(7);
        let mut sign = || if uniform(&mut rng) < 0.5 { -1.0 } else { 1.0 };
        let of = |kind: Kind, light: f32| Glance::of(kind, Spectrum::splat(light));
        let mut glances = [[[Glance::default(); READINGS]; PLACES]; 2];
        for place in 0..PLACES {
            let (kind, off) = if place % 4 == 0 { (Kind::Irradiance, 0.0) } else { (Kind::Multiple, 0.06) };
            for half in &mut glances {
                let of_half = off * sign();
                half[place] = [(); READINGS].map(|()| of(kind, 3.0 * (1.0 + of_half + 0.05 * sign())));
            }
        }
        let glances = glances.as_flattened().as_flattened();
        let [multiple, irradiance] =
            [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]].map(|shares| of_halves(glances, &|_| 0, shares, DARK));
        // A quarter of twice the variance of one half.
        let expected = 0.5 * 0.06_f64.powi(2) / (1.0 + DARK * DARK);
        assert!((multiple / expected - 1.0).abs() < 0.05, "{multiple} in place of {expected}");
        assert!(irradiance < 0.05 * expected, "{irradiance}");
        // Of what is a half of the picture's light, a quarter.
        let half = of_halves(glances, &|_| 0, [0.0, 0.0, 0.5, 0.5], DARK);
        assert!((half / expected - 0.25).abs() < 0.02, "{half}");
        // Neither nothing nor what is no number tells of noise.
        let shares = [0.25; KINDS];
        assert_eq!(of_halves(&[], &|_| 0, shares, DARK), 0.0);
        let [none, some] = [f32::NAN, 1.0].map(|light| of(Kind::Multiple, light));
        assert_eq!(of_halves(&[none, some, none, some], &|_| 0, shares, DARK), 0.0);
        assert_eq!(of_halves(&[some, some, none, none], &|_| REGIONS, [0.0; KINDS], DARK), 0.0);
    }

    /// Every other ray has a tenth of the light, and as much noise in proportion.
    #[test]
    fn what_halves_differ_by_counts_over_the_light_of_its_region() {
        const RAYS: usize = 4096;
        let mut glances = [[[Glance::default(); READINGS]; RAYS]; 2];
        for ray in 0..RAYS {
            let light = if ray % 2 == 0 { 1.0 } else { 0.1 };
            for (half, off) in glances.iter_mut().zip([0.06, -0.06]) {
                half[ray] = [Glance::of(Kind::Multiple, Spectrum::splat(light * (1.0 + off))); READINGS];
            }
        }
        let told = |region: fn(usize) -> usize| {
            of_halves(glances.as_flattened().as_flattened(), &region, [0.0, 0.0, 1.0, 0.0], DARK) / 0.06_f64.powi(2)
        };
        // A dark part of the picture has its noise like a bright one, but for the light that is added.
        let apart = |light: f64| light * light / (light * light + DARK * DARK);
        let expected = 0.5 * (apart(1.0 / 0.55) + apart(0.1 / 0.55));
        assert!((told(|ray| ray % 2) - expected).abs() < 1e-3, "{} {expected}", told(|ray| ray % 2));
        // Dark places among bright ones do not.
        let expected = 0.5 * (1.0 + 0.01) / (0.55 * 0.55) / (1.0 + DARK * DARK);
        assert!((told(|_| 0) - expected).abs() < 1e-3, "{} {expected}", told(|_| 0));
    }

    #[test]
    fn records_are_seen_in_the_regions_that_they_reach_into() {
        assert!(regions_in([0.0, 0.0, 1.0, 1.0]).eq(0..REGIONS));
        assert!(regions_in([0.3, 0.3, 0.3, 0.3]).eq([2 * SIDE + 2]));
        assert!(regions_in([0.2, -3.0, 0.3, 0.1]).eq([1, 2]));
        assert!(regions_in([0.95, 0.8, 9.0, 9.0]).eq([6 * SIDE + 7, 7 * SIDE + 7]));
        assert!(regions_in([f32::NAN; 4]).eq([0]));
    }

    #[test]
    fn a_mixed_estimate_has_the_variance_of_its_parts() {
        for effort in [1.0, 4.0] {
            // A second estimate with a variance of 1, a blind one with twice that for as many samples.
            let (s, blind) = (effort / (effort + f64::from(FIRST_COUNTS)), 2.0 * effort);
            let (mixed, between) = ((1.0 - s) * (1.0 - s) * blind + s * s, s * s * (1.0 + blind));
            let left = Left::between(between, effort);
            assert!((left.variance - mixed).abs() < 1e-9, "{left:?}");
        }
    }

    #[test]
    fn what_is_noisy_and_cheap_is_estimated_more_often() {
        let of = |variances: [f64; KINDS]| variances.map(|variance| Left { variance, estimates: 1.5 });
        let rounds = |variances, costs| rounds_for(&of(variances), (costs, [1.0; KINDS]), 1.0, 10.0);
        assert_eq!(rounds([0.0, 0.3, 0.3, 0.3], [1.0; 4]), [0; 4], "little noise");
        assert_eq!(rounds([0.0, 0.1, 0.1, 2.0], [1.0; 4]), [0, 0, 0, 3], "as much as it takes");
        let shared = rounds([0.0, 2.0, 2.0, 2.0], [1.0, 1.0, 4.0, 1.0]);
        assert!(shared[1] == shared[3] && shared[2] < shared[1] && shared[0] == 0, "{shared:?}");
        assert!(variance_after(&of([0.0, 2.0, 2.0, 2.0]), shared) < 3.5);
        assert_eq!(rounds([0.0, 32.0, 0.0, 0.0], [1.0; 4]), [0, presets::MOST_ROUNDS, 0, 0], "but not for ever");
        assert_eq!(
            rounds([0.0, 1e9, 0.0, 0.0], [1.0; 4]),
            [0, presets::MOST_ROUNDS / 8, 0, 0],
            "the less, the less it helps"
        );
        assert_eq!(rounds([0.0, 1.2, 0.0, 0.0], [1e6; 4]), [0; 4], "nor where it does not pay");
        assert_eq!(rounds([0.0, 5.0, 0.0, 0.0], [0.0; 4]), [0; 4], "nor what has no records");
    }
}

#[cfg(all(test, feature = "alloc"))]
mod measured {
    use super::*;
    use crate::cache::{Asked, RadianceCaches, Settings};
    use crate::host::{Hit, Scene};
    use crate::light::Light;
    use crate::math::{Bounds, Ray, Vec3};
    use crate::medium::{Homogeneous, Placed, Region};
    use crate::phase::Phase;
    use crate::sampling::Generator;
    use crate::spectrum::Spectrum;
    use crate::surface::Surface;
    use crate::work::finish;
    use crate::world::{Outline, World};

    /// A black ball around the world, with a window to the sky.
    struct Shutter;

    impl Scene for Shutter {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let along = ray.origin.dot(ray.direction);
            let distance = (along * along + 25.0 - ray.origin.length_squared()).sqrt() - along;
            let normal = -ray.at(distance).normalize();
            let is_closed = normal.y > -0.9 && distance < ray.length;
            is_closed.then_some(Hit { distance, normal, shading: normal, surface: Surface::BLACK, light: None })
        }
    }

    const SEEDS: u64 = 4;
    const READ: u32 = 200;

    fn eye(at: [f32; 2]) -> Ray {
        Ray::new(3.0 * Vec3::Z, Vec3::new(at[0] - 0.5, at[1] - 0.5, -2.0).normalize())
    }

    /// Relative noise of light from a window to the sky in a ball of fog, of pictures asked for with such an error: as fills say, and between seeds.
    fn told_and_seen(error: f32) -> [f64; 2] {
        let fog = Homogeneous::new(Spectrum::splat(1.8), Spectrum::splat(0.2), Phase::ISOTROPIC).unwrap();
        let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
        let lights = [Light::Constant(Spectrum::ONE)];
        let world = World { medium: &ball, scene: &Shutter, lights: (&lights).into() };
        let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
        let settings = Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(128);
        let (mut told, mut seen) = (0.0, alloc::vec![[0.0; 5]; READ as usize]);
        for seed in 0..SEEDS {
            let settings = Settings { seed, rays: 1024, error, ..settings };
            let mut filling = RadianceCaches::new(settings).fill(Asked::View { ray: eye, pixel: 0.02 });
            finish(&mut filling, &world, &mut Default::default());
            told += f64::from(filling.record_noise().unwrap()).powi(2) / SEEDS as f64;
            let caches = filling.finish();
            for (number, sums) in seen.iter_mut().enumerate() {
                let ray = eye(Asked::at(9000 + number as u32));
                let reading = |stream: u64| {
                    let mut rng = Generator::new(stream << 32 | number as u64);
                    let glance = Glance::new(&caches.radiance(&ray, &world, &mut rng));
                    [glance.kinds[1], glance.all].map(f64::from)
                };
                let [[a, all], [b, _]] = [0, 1].map(reading);
                [1.0, a, b, a * b, all].into_iter().zip(sums).for_each(|(x, sum)| *sum += x);
            }
        }
        let seeds = SEEDS as f64;
        let dark = DARK * seen.iter().map(|[.., all]| all / seeds).sum::<f64>() / f64::from(READ);
        let relative = |&[n, a, b, products, all]: &[f64; 5]| {
            let variance = (products - a * b / n) / (n - 1.0);
            variance / ((all / n).powi(2) + dark * dark)
        };
        let seen = seen.iter().map(relative).sum::<f64>() / f64::from(READ);
        [told.sqrt(), seen.sqrt()]
    }

    #[test]
    #[ignore = "long: tests/acceptance/long.sh"]
    fn what_glances_tell_is_the_noise_between_seeds() {
        let [told, seen] = told_and_seen(0.5);
        assert!((0.6..1.7).contains(&(told / seen)), "{told} {seen}");
        // With a smaller error records are estimated more often, and it is told how much that helps.
        let [less_told, less_seen] = told_and_seen(0.01);
        assert!(less_told < 0.75 * told && (0.6..1.7).contains(&(less_told / less_seen)), "{less_told} {less_seen}");
    }
}
