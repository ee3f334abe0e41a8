//! Rounds that tell how noisy what surfaces are known to send is in the light of all records, and how often it is estimated once more.

use super::{Filling, Round};
use crate::cache::kind::Kind;
use crate::cache::noise::REGIONS;
use crate::cache::presets;

/// Light (over that of a usual region of the picture) that is added in squares: where surfaces send little, other light is most of what is seen. Larger: noise in the dark; smaller: time for what nobody sees.
const DARK: f64 = 0.5;

impl<F> Filling<'_, F> {
    /// Begins a round that tells it.
    pub(super) fn begin_ground(&mut self, is_second: bool) -> bool {
        let kind = Kind::CoarseIrradiance;
        let (jobs, is_new) = (self.jobs_of_places(), self.caches.slots[kind].len() > self.before[kind]);
        if jobs == 0 || !is_new || (is_second && self.memory.glances.is_empty()) {
            return false;
        }
        if !is_second {
            self.memory.glances.clear();
        }
        self.enter(Round::Ground { is_second }, jobs);
        true
    }

    /// Takes what a round has read. A second estimate comes in halves, `X` and `Y`, so that its variance is that of what light by the first and by both differs by, however much each varies.
    ///
    /// ```text
    /// M = (X + Y)/2:   V(M) = V(M − X)
    /// ```
    pub(super) fn take_ground(&mut self, is_second: bool) {
        if is_second {
            // Of halves that stand for a whole it is a quarter of the square.
            let variance = 4.0 * self.variance_of_places(DARK);
            let rounds = presets::rounds_of_ground(variance, self.settings().error);
            self.more[Kind::CoarseIrradiance] = [rounds; REGIONS];
            let left = libm::sqrt(variance / f64::from(1 + rounds)) as f32;
            // Of few records that are new, what others have is not told again.
            self.caches.ground =
                if self.before[Kind::CoarseIrradiance] > 0 { left.max(self.caches.ground) } else { left };
            self.memory.glances.clear();
        }
        self.begin(self.step + 1);
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::super::estimates::doubted::Shell;
    use super::*;
    use crate::cache::{Asked, FilledRecords, RadianceCaches, Settings};
    use crate::light::Light;
    use crate::math::{Bounds, Ray, Vec3};
    use crate::medium::{Homogeneous, Placed, Region};
    use crate::phase::{Lobe, Phase};
    use crate::sampling::Generator;
    use crate::spectrum::Spectrum;
    use crate::work;
    use crate::world::{Outline, World};

    /// Rays, at two places of each of which is read what surfaces send.
    const READ: usize = 48;

    type Read = [[f64; 2]; READ];

    /// By random numbers of a seed: variance as it is told before more estimates, how many of these there are to be, and what surfaces send to some places through fog.
    fn told(g: f32, seed: u64) -> (f64, f64, Read) {
        let phase = Phase::from(Lobe::HenyeyGreenstein { g });
        let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.4), phase).unwrap();
        let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
        let sky = [Light::Constant(Spectrum::ONE)];
        let world = World { medium: &ball, scene: &Shell, lights: (&sky).into() };
        let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
        let settings = Settings::for_outline(&outline, 0.02).with_walks(64);
        let settings = Settings { seed, rays: 2048, photons: None, ..settings };
        let ray = |[x, y]: [f32; 2]| Ray::new(1.5 * Vec3::Z, Vec3::new(x - 0.5, y - 0.5, -1.0).normalize());
        let mut filling = RadianceCaches::new(settings).fill(Asked::View { ray, pixel: 0.02 });
        let mut output = FilledRecords::default();
        let last = Round::Ground { is_second: true };
        while filling.round != last {
            assert!(work::step(&mut filling, &world, &mut output));
        }
        // Of light in the medium alone.
        filling.caches.shares.picture = [0.0, 1.0, 0.0, 0.0];
        let estimator = filling.estimator(&world);
        let read = core::array::from_fn(|i| {
            let ray = ray([i % 8, i / 8].map(|i| (i as f32 + 0.5) / 8.0));
            let rng = &mut Generator::new(i as u64);
            [1.2, 1.6].map(|distance| {
                let mut seen = || estimator.surface_towards(ray.at(distance), -ray.direction, &phase, rng).mean();
                f64::from((0..64).map(|_| seen()).sum::<f32>()) / 64.0
            })
        });
        while filling.round == last {
            assert!(work::step(&mut filling, &world, &mut output));
        }
        let rounds = f64::from(filling.more[Kind::CoarseIrradiance][0]);
        (f64::from(filling.caches.ground).powi(2) * (1.0 + rounds), rounds, read)
    }

    /// How far what surfaces send to a ray differs from seed to seed is what halves of each tell. Sharp fog sees single spots of them, and asks for more.
    #[test]
    fn noise_of_what_surfaces_send_is_told_as_fog_shows_it() {
        const SEEDS: usize = 16;
        let of = |g: f32| {
            let all: [_; SEEDS] = core::array::from_fn(|seed| told(g, seed as u64));
            let mean = |of: &dyn Fn(&(f64, f64, Read)) -> f64| all.iter().map(of).sum::<f64>() / SEEDS as f64;
            let means: Read =
                core::array::from_fn(|i| core::array::from_fn(|place| mean(&|(.., read)| read[i][place])));
            let dark = DARK * means.iter().map(|[a, _]| a).sum::<f64>() / READ as f64;
            let differ = |i: usize| {
                let [a, b] = means[i];
                mean(&|(.., read)| (read[i][0] - a) * (read[i][1] - b)) / (a * b + dark * dark)
            };
            let differ = (0..READ).map(differ).sum::<f64>() / READ as f64 * SEEDS as f64 / (SEEDS - 1) as f64;
            (mean(&|(variance, ..)| *variance), differ, mean(&|(_, rounds, _)| *rounds))
        };
        let (even, sharp) = (of(0.0), of(0.9));
        for (told, differ, _) in [even, sharp] {
            assert!((0.4..1.6).contains(&(told / differ)), "{told} {differ}");
        }
        assert!(even.2 < 1.0 && sharp.2 > 2.0, "{} {}", even.2, sharp.2);
    }
}
