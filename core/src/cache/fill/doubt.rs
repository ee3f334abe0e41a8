//! Rounds in which light at some places is estimated twice, with the same random numbers, by what may be noisy: by one half of the photons, and by the other; how many more it takes.

use super::{Filling, RAYS_PER_JOB, Round};
use crate::cache::asked::{Asked, Wanted};
use crate::cache::guide::Looks;
use crate::cache::kind::{Kind, Pass, Step};
use crate::cache::lookup::Basis;
use crate::cache::memory::{Estimate, FilledRecords};
use crate::cache::noise::{self, Glance, READINGS, region_of};
use crate::cache::presets;
use crate::host::{Medium, Scene};
use crate::math::Vec3;
use crate::sampling::uniform::mix;
use crate::sampling::{Generator, uniform};
use crate::world::World;

/// Walks or directions of a reading at least. Fewer: noise is told by chance, by the square; more: time.
const LEAST: u32 = 8;

/// Walks of an estimate of a record over those of a reading. More: noise is told by chance; fewer: time.
pub(super) const OF_WALKS: u32 = 2;

/// The same of directions, of which a picture's light from surfaces needs fewer.
pub(super) const OF_DIRECTIONS: u32 = 16;

impl<F> Filling<'_, F> {
    /// Begins to tell the noise of photons, if it is not known.
    pub(super) fn begin_doubt(&mut self) -> bool {
        let jobs = self.jobs_of_places();
        if jobs == 0 || !self.memory.photons.is_untold() {
            return false;
        }
        self.memory.glances.clear();
        self.memory.photons.turn(1.0);
        self.enter(Round::Doubt { is_second: false }, jobs);
        true
    }

    /// Jobs of readings by [`Filling::read_places`], none where nothing hangs on what they tell. By each half there are half as many as of a picture: a few spots of it make most of its noise, and few rays see
    /// them.
    pub(super) fn jobs_of_places(&self) -> u32 {
        let is_asked = self.settings().error > 0.0 && !self.memory.wanted.is_empty();
        if is_asked { noise::readings(self.settings()) / 2 / RAYS_PER_JOB } else { 0 }
    }

    /// Light that falls on surfaces, or is scattered in the medium, of a kind, at two places of each of some eye rays. Each has that part of the samples of a record of this kind,
    /// or where it is not cached of its own.
    pub(super) fn read_places<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        (in_medium, part): (Kind, u32),
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) {
        let wanted = self.memory.wanted.as_slice();
        output.glances = Default::default();
        for i in 0..RAYS_PER_JOB {
            let reading = job * RAYS_PER_JOB + i;
            let Some(first) = self.first_of(reading) else { return };
            // The same both times, so that what differs is what light is estimated by.
            let mut rng = Generator::new(mix(self.seed() ^ 0x_d0_0b_75) ^ u64::from(reading));
            // What two places of a ray share its pixel shows; the rest it averages.
            let [start, end] = [first.ray, first.ray + 1].map(|ray| wanted.partition_point(|wanted| wanted.ray < ray));
            let of_ray = &wanted[start..end];
            let other = (uniform(&mut rng) * of_ray.len() as f32) as usize;
            let is_alike =
                |other: &&Wanted| other.place.is_seen && other.place.normal.is_some() == first.place.normal.is_some();
            let found = of_ray
                .iter()
                .skip(other)
                .chain(of_ray)
                .find(is_alike)
                .filter(|_| !reading.is_multiple_of(READINGS as u32));
            let place = found.unwrap_or(first).place;
            let kind = if place.normal.is_some() { Kind::Irradiance } else { in_medium };
            let Some(effort) = self.settings().effort(kind) else { continue };
            let count = (self.settings().effort(in_medium).unwrap_or(effort).samples / part).max(LEAST);
            let looks = Looks { count, guide: None, learnt: None, to_eye: place.to_eye };
            let mut estimate = Estimate { place, ..Estimate::default() };
            if self.estimate(Step { kind, pass: Pass::Make }, world, looks, &mut estimate, &mut rng, output) {
                // Of what is scattered sharply most is seen by an eye, and it is noisier than the mean over directions.
                let to_eye = place.to_eye.filter(|_| !kind.is_on_surfaces());
                let degree = if to_eye.is_some() { self.caches.slots[kind].degree() } else { 0 };
                let basis = Basis::new(to_eye.unwrap_or(Vec3::Z), degree);
                let seen = basis.expanded(estimate.sums.value, output.higher.as_slice());
                output.glances[i as usize] = Glance::of(kind, seen);
            }
            output.higher.clear();
        }
    }

    /// What the reading of a number, and all of its ray, begin with.
    fn first_of(&self, reading: u32) -> Option<&Wanted> {
        let wanted = self.memory.wanted.as_slice();
        let rays = self.jobs * RAYS_PER_JOB / READINGS as u32;
        let from = u64::from(reading / READINGS as u32) * wanted.len() as u64 / u64::from(rays);
        wanted.iter().skip(from as usize).chain(wanted).find(|wanted| wanted.place.is_seen)
    }

    /// Variance of what halves tell, in the picture, as [`noise::of_halves`] has it.
    pub(super) fn variance_of_places(&self, dark: f64) -> f64 {
        let region =
            |ray: usize| self.first_of((ray * READINGS) as u32).map_or(0, |first| region_of(Asked::at(first.ray)));
        noise::of_halves(self.memory.glances.as_slice(), &region, self.caches.shares.picture, dark)
    }

    /// Goes on with the other half, or to more photons where both are too noisy.
    pub(super) fn take_doubt(&mut self, is_second: bool) {
        let photons = &mut self.memory.photons;
        if !is_second {
            photons.turn(-2.0);
            self.enter(Round::Doubt { is_second: true }, self.jobs);
            return;
        }
        photons.turn(1.0);
        if let Some((effort, seed)) = self.caches.photon_effort() {
            photons.finish(&effort, seed);
        }
        let noise = libm::sqrt(self.variance_of_places(noise::DARK)) as f32;
        self.memory.photons.tell(noise);
        self.memory.glances.clear();
        let settings = &mut self.caches.settings;
        let more = presets::more_photons(noise, settings.error);
        let Some((more, effort)) = more.zip(settings.photons.as_mut()) else { return self.begin(self.step + 1) };
        *effort = effort.more(more);
        self.are_more = true;
        if let Some((effort, seed)) = self.caches.photon_effort() {
            self.is_cut |= self.memory.photons.prepare(&effort, seed).is_err();
        }
        self.shoot_more();
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::cache::{Asked, PhotonEffort, RadianceCaches, Settings};
    use crate::host::Empty;
    use crate::light::{Light, PointLight};
    use crate::math::{Bounds, Ray};
    use crate::medium::{Homogeneous, Placed, Region};
    use crate::phase::Phase;
    use crate::spectrum::Spectrum;
    use crate::work::finish;
    use crate::world::Outline;

    #[test]
    #[ignore = "long: tests/acceptance/long.sh"]
    fn as_many_photons_are_shot_as_their_noise_asks_for() {
        let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(3.9), Phase::ISOTROPIC).unwrap();
        let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
        let lamps = [Light::Point(PointLight::from_flux(Vec3::Y * 0.5, Spectrum::ONE).unwrap())];
        let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
        let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
        let eye = |at: [f32; 2]| Ray::new(3.0 * Vec3::Z, Vec3::new(at[0] - 0.5, at[1] - 0.5, -2.0).normalize());
        let settings = |error: f32, seed: u64| {
            let settings = Settings { rays: 2048, ..Settings::for_outline(&outline, 0.08).with_walks(128) };
            // As many at first, and as many as it takes, whatever the error.
            let photons =
                PhotonEffort { cells: 6, enough: 400, paths: 1 << 23, flights: u64::MAX, ..settings.photons.unwrap() };
            Settings { photons: Some(photons), error, seed, ..settings }
        };
        let filled = |error: f32, seed: u64| {
            let mut filling = RadianceCaches::new(settings(error, seed)).fill(Asked::View { ray: eye, pixel: 0.02 });
            finish(&mut filling, &world, &mut FilledRecords::default());
            let told = filling.record_noise().unwrap();
            let photons = &filling.memory.photons;
            assert!(photons.noise() > 0.0 && told > photons.noise(), "{told}");
            (photons.noise(), photons.paths())
        };
        // What is told of noise varies from seed to seed, and so does what is asked for by its square.
        let mut logarithm = 0.0;
        for seed in 0..3 {
            let ((rough, few), (fine, many)) = (filled(0.16, seed), filled(0.01, seed));
            let is_enough = |noise: f32| presets::more_photons(noise, 0.01).is_none();
            assert!(is_enough(fine) && !is_enough(rough) && many > 2 * few, "{few} {many} {rough} {fine}");
            // Noise falls with the root of what they bring.
            let expected = (rough / fine).powi(2) * few as f32;
            logarithm += (many as f32 / expected).ln() / 3.0;
        }
        assert!((0.5..2.0).contains(&logarithm.exp()), "{}", logarithm.exp());
    }

    /// Another view finds photons that are good enough, and a finer level looks at them again.
    #[test]
    fn noise_that_is_known_is_not_told_again() {
        let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
        let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
        let lamps = [Light::Point(PointLight::from_flux(Vec3::Y * 0.5, Spectrum::ONE).unwrap())];
        let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
        let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
        let eye = |from: f32| {
            move |at: [f32; 2]| Ray::new(from * Vec3::Z, Vec3::new(at[0] - 0.5, at[1] - 0.5, -0.5 * from).normalize())
        };
        let settings = |error: f32| Settings { rays: 512, ..Settings::for_outline(&outline, error).with_walks(16) };
        let view = |from: f32| Asked::View { ray: eye(from), pixel: 0.02 };
        let mut filling = RadianceCaches::new(settings(0.16)).fill(view(3.0));
        let doubts = |filling: &mut Filling<'_, _>| {
            let (mut output, mut count) = (FilledRecords::default(), 0);
            loop {
                let is_doubt = matches!(filling.round, Round::Doubt { is_second: true }) && filling.taken == 0;
                count += u32::from(is_doubt);
                if !crate::work::step(filling, &world, &mut output) {
                    return count;
                }
            }
        };
        assert!(doubts(&mut filling) > 0);
        let mut filling = filling.finish().fill(view(2.5));
        assert_eq!(doubts(&mut filling), 0);
        filling.refine(settings(0.08));
        assert!(doubts(&mut filling) > 0);
    }
}
