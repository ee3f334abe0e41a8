//! Connections of points to lights.

use glam::{Vec2, Vec3};

use super::estimate::Estimator;
use crate::host::{Medium, Scene};
use crate::light::{LightSample, Question, Source};
use crate::math::Ray;
use crate::phase::{Phase, deflection};
use crate::sampling::discrete::Choice;
use crate::sampling::{Generator, mis, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::transmittance::thickness::{Marching, transmittance};
use crate::world::{World, nearest_surface, shadow_ray};

/// Absolute mean cosine of the phase function from which on it looks for lights itself. Smaller: another ray from every point, and no less noise (at 0.6 as much, at
/// 0.8 a fifth of the variance); larger: grain before wide lamps.
const PEAKED: f32 = 0.7;

/// A connection of a point with a light that was chosen, of which is not yet known whether anything lies in between.
#[derive(Clone, Copy)]
pub(super) struct Connection {
    /// Where it begins (m).
    pub from: Vec3,
    /// The point of the light.
    pub source: Source,
    /// What it would bring, times `share`: irradiance (W·m⁻²) times the value of what it was offered for.
    pub light: Spectrum,
    /// The probability with which the light was chosen; at points of a segment times the density (m⁻¹) of the distance and the number that are tried.
    pub share: f32,
}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Estimator<'_, M, S> {
    /// Light of a light that was chosen, from a point in the unit square for that on it, times `value(to_light, pdf)` with the density
    /// (sr⁻¹) of that choice, 0 for lights without extent, as if nothing lay in between.
    pub(super) fn offered(
        &self,
        (chosen, on_light): (Choice, Vec2),
        point: Vec3,
        origin: &dyn Fn(Vec3) -> Vec3,
        value: &dyn Fn(Vec3, f32) -> Spectrum,
    ) -> Option<Connection> {
        let LightSample { source, incident, pdf } = self.world.lights[chosen.index].sample(point, on_light)?;
        let value = value(incident.to_light, pdf * chosen.probability);
        if value.is_black() {
            return None;
        }
        let (light, share) = (value * incident.irradiance, chosen.probability);
        Some(Connection { from: origin(incident.to_light), source, light, share })
    }

    /// What of a connection arrives, marched with an `offset` in [0, 1): what ratio tracking adds in noise would rule pictures whose other parts have none.
    pub(super) fn arrived(&self, connection: &Connection, offset: f32) -> Spectrum {
        let Connection { from, source, light, share } = *connection;
        let shadow = shadow_ray(from, &source);
        if self.world.scene.is_blocked(&shadow) {
            return Spectrum::ZERO;
        }
        light * self.passed(&shadow, offset) / share
    }

    /// Light of one of the lights, chosen by `weight`, scattered once at `point` towards `to_eye`: radiance for each unit of scattering (W·m⁻²·sr⁻¹), unbiased but for
    /// marching.
    ///
    /// What a peaked phase function makes bright of a wide light may be a small part of it, which hardly any connection meets. So that looks for the light as well; what
    /// both find is weighed by the power heuristic (Veach 1997, § 9.2.4).
    pub(super) fn scattered(
        &self,
        (weight, point): (&dyn Question, Vec3),
        to_eye: Vec3,
        phase: &Phase,
        random: (f32, Vec2),
        rng: &mut Generator,
    ) -> Spectrum {
        let Some(chosen) = self.world.lights.pick(weight, random.0) else { return Spectrum::ZERO };
        let offered = self.offered_by_medium((chosen, random.1), point, to_eye, phase);
        let joined = offered.map_or(Spectrum::ZERO, |connection| self.arrived(&connection, uniform(rng)));
        joined + self.met(chosen, point, to_eye, phase, rng)
    }

    /// The connection of [`Estimator::scattered`], of a light that was chosen.
    pub(super) fn offered_by_medium(
        &self,
        (chosen, on_light): (Choice, Vec2),
        point: Vec3,
        to_eye: Vec3,
        phase: &Phase,
    ) -> Option<Connection> {
        let is_peaked = self.looks_for(chosen, phase);
        let value = |to_light: Vec3, pdf: f32| {
            let deflection = deflection(to_light, to_eye);
            let value = phase.value(deflection);
            if !is_peaked || pdf <= 0.0 {
                return value;
            }
            value * mis::power(pdf, chosen.probability * phase.pdf(deflection))
        };
        self.offered((chosen, on_light), point, &|_| point, &value)
    }

    /// Whether the phase function looks for a light itself.
    fn looks_for(&self, chosen: Choice, phase: &Phase) -> bool {
        !self.world.lights[chosen.index].is_delta() && phase.mean_cosine().map(f32::abs).max_element() > PEAKED
    }

    /// What the phase function finds of the light that was chosen, where it looks for it.
    pub(super) fn met(
        &self,
        chosen: Choice,
        point: Vec3,
        to_eye: Vec3,
        phase: &Phase,
        rng: &mut Generator,
    ) -> Spectrum {
        if !self.looks_for(chosen, phase) {
            return Spectrum::ZERO;
        }
        let World { scene, lights, .. } = self.world;
        let (light, sample) = (&lights[chosen.index], phase.sample(to_eye, uniform2(rng)));
        let ray = Ray::new(point, sample.to_light);
        let (radiance, distance, normal) = match nearest_surface(&ray, scene) {
            None => (light.background(ray.direction), f32::INFINITY, Vec3::ZERO),
            Some(hit) if hit.light == Some(chosen.index as u32) => {
                (light.radiance(ray.at(hit.distance), hit.normal, -ray.direction), hit.distance, hit.normal)
            }
            Some(_) => return Spectrum::ZERO,
        };
        if radiance.is_black() {
            return Spectrum::ZERO;
        }
        let share = mis::power(sample.pdf, light.pdf(point, ray.direction, distance, normal));
        sample.weight * radiance * self.passed(&ray.with_length(distance), uniform(rng)) * (share / chosen.probability)
    }

    /// What a ray lets pass.
    fn passed(&self, ray: &Ray, offset: f32) -> Spectrum {
        transmittance(ray, self.world.medium, Marching { steps: self.walk.steps, offset })
    }
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use rand_core::TryRng;

    use super::*;
    use crate::cache::{Caches, RaySettings, radiance};
    use crate::host::{Empty, Hit};
    use crate::light::{EnvironmentMap, FromPoint, Light, QuadLight};
    use crate::math::Mat3;
    use crate::phase::Lobe;
    use crate::sampling::warp;
    use crate::surface::Surface;
    use crate::transmittance::thickness::Steps;
    use crate::{multiple_scatter, path};

    /// A lamp of two by two metres at height 1, facing down.
    struct Lamp;

    impl Scene for Lamp {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let distance = (1.0 - ray.origin.z) / ray.direction.z;
            let at = ray.at(distance);
            let is_met = distance > 0.0 && distance < ray.length && at.x.abs() < 1.0 && at.y.abs() < 1.0;
            let normal = Vec3::NEG_Z;
            is_met.then_some(Hit { distance, normal, shading: normal, surface: Surface::BLACK, light: Some(0) })
        }
    }

    /// The lamp, and a floor at height 0.
    struct Lit;

    impl Scene for Lit {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let distance = -ray.origin.z / ray.direction.z;
            let surface = Surface::Lambert { reflectance: Spectrum::ONE };
            let floor = Hit { distance, normal: Vec3::Z, shading: Vec3::Z, surface, light: None };
            Lamp.closest_hit(ray).or((distance > 0.0 && distance < ray.length).then_some(floor))
        }
    }

    /// Numbers that are ½, but for one.
    struct Halves {
        other: usize,
        drawn: usize,
    }

    impl TryRng for Halves {
        type Error = Infallible;

        fn try_next_u32(&mut self) -> Result<u32, Infallible> {
            self.drawn += 1;
            Ok(if self.drawn - 1 == self.other { 1 << 29 } else { 1 << 31 })
        }

        fn try_next_u64(&mut self) -> Result<u64, Infallible> {
            let (Ok(low), Ok(high)) = (self.try_next_u32(), self.try_next_u32());
            Ok(u64::from(high) << 32 | u64::from(low))
        }

        fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
            bytes.fill(0x80);
            Ok(())
        }
    }

    /// Of a sequence they are spread best: decision 5.
    #[test]
    fn the_first_two_numbers_say_where_on_a_lamp_a_surface_looks() {
        let quad = QuadLight::new(Vec3::new(-1.0, -1.0, 1.0), 2.0 * Vec3::Y, 2.0 * Vec3::X, Spectrum::ONE).unwrap();
        let lights = [Light::Quad(quad)];
        let world = World { medium: &Empty, scene: &Lit, lights: (&lights).into() };
        let walk = multiple_scatter::Settings::new(Steps::Length(0.1));
        let (paths, light_samples) = (path::Settings::default(), 1);
        let estimator = Estimator { world, surfaces: None, photons: None, walk, paths, light_samples, finest: 0.0 };
        let settings = RaySettings { indirect: false, ..RaySettings::default() };
        let ray = Ray::new(Vec3::new(0.4, -0.3, 0.5), Vec3::new(0.2, 0.1, -1.0).normalize());
        let seen = |other| {
            let mut rng = Halves { other, drawn: 0 };
            let seen = radiance(&ray, &estimator, &Caches::default(), &settings, &mut rng).surface_direct;
            (seen, rng.drawn)
        };
        let (usual, drawn) = seen(usize::MAX);
        assert!(usual[0] > 0.0 && drawn > 10);
        for other in 0..drawn {
            assert_eq!(seen(other).0 != usual, other < 2, "number {other}");
        }
    }

    /// Mean, and relative standard deviation, of what a point below the lamp scatters to an eye that looks past it, against `∫ p L dω` by quadrature; and how far
    /// connections alone would vary.
    fn seen(g: f32) -> ([f64; 2], [f64; 2]) {
        let quad = QuadLight::new(Vec3::new(-1.0, -1.0, 1.0), 2.0 * Vec3::Y, 2.0 * Vec3::X, Spectrum::ONE).unwrap();
        let lights = [Light::Quad(quad)];
        let world = World { medium: &Empty, scene: &Lamp, lights: (&lights).into() };
        let walk = multiple_scatter::Settings::new(Steps::Length(0.1));
        let (paths, light_samples) = (path::Settings::default(), 1);
        let estimator = Estimator { world, surfaces: None, photons: None, walk, paths, light_samples, finest: 0.0 };
        let phase = Phase::from(Lobe::HenyeyGreenstein { g });
        let to_eye = Vec3::new(0.3, -0.2, -1.0).normalize();
        const SIDE: u32 = 400;
        let (mut sums, mut whole) = ([0.0; 2], 0.0);
        for i in 0..SIDE * SIDE {
            let across = |k: u32| (k as f32 + 0.5) * 2.0 / SIDE as f32 - 1.0;
            let at = Vec3::new(across(i % SIDE), across(i / SIDE), 1.0);
            let solid_angle = f64::from(at.length().powi(-3)) * 4.0 / f64::from(SIDE * SIDE);
            let value = f64::from(phase.value(deflection(at.normalize(), to_eye))[0]);
            whole += solid_angle;
            sums[0] += value * solid_angle;
            sums[1] += value * value * solid_angle;
        }
        let alone = (sums[1] * whole - sums[0] * sums[0]).sqrt() / sums[0];
        const COUNT: u32 = 40_000;
        let (mut found, question) = ([0.0; 2], FromPoint::all(Vec3::ZERO));
        for i in 0..COUNT {
            let mut rng = Generator::new(u64::from(i));
            let random = (uniform(&mut rng), uniform2(&mut rng));
            let light = estimator.scattered((&question, Vec3::ZERO), to_eye, &phase, random, &mut rng);
            let light = f64::from(light[0]) / f64::from(COUNT);
            found[0] += light;
            found[1] += light * light * f64::from(COUNT);
        }
        let deviation = (found[1] - found[0] * found[0]).sqrt() / found[0];
        ([found[0], deviation], [sums[0], alone])
    }

    /// A sky with a bright corner, which is no sky that caches keep.
    #[test]
    fn a_bright_corner_of_the_sky_is_found_with_all_its_light() {
        const SIZE: [usize; 2] = [16, 8];
        let mut texels = [Spectrum::splat(0.2); SIZE[0] * SIZE[1]];
        texels[2 * SIZE[0] + 5] = Spectrum::splat(40.0);
        let (mut weights, mut column) = ([0.0; SIZE[0] * SIZE[1]], [0.0; SIZE[1]]);
        let map = EnvironmentMap::new(SIZE[0], SIZE[1], &texels, &mut weights, &mut column, Mat3::IDENTITY).unwrap();
        let lights = [Light::Environment(&map)];
        assert!(!lights[0].is_sky());
        let world = World { medium: &Empty, scene: &Empty, lights: (&lights).into() };
        let walk = multiple_scatter::Settings::new(Steps::Length(0.1));
        let (paths, light_samples) = (path::Settings::default(), 1);
        let estimator = Estimator { world, surfaces: None, photons: None, walk, paths, light_samples, finest: 0.0 };
        let (phase, question) = (Phase::from(Lobe::HenyeyGreenstein { g: 0.85 }), FromPoint::all(Vec3::ZERO));
        const COUNT: u32 = 40_000;
        for to_eye in [Vec3::X, Vec3::NEG_Y, Vec3::new(-0.3, -0.6, 0.7).normalize()] {
            let mut sums = [[0.0; 2]; 2];
            for i in 0..COUNT {
                let mut rng = Generator::new(u64::from(i));
                let random = (uniform(&mut rng), uniform2(&mut rng));
                let found = estimator.scattered((&question, Vec3::ZERO), to_eye, &phase, random, &mut rng);
                // Directions that know of neither.
                let direction = warp::uniform_sphere(uniform2(&mut rng));
                let blind = lights[0].background(direction) * phase.value(deflection(direction, to_eye))
                    / warp::uniform_sphere_pdf();
                for (sum, light) in sums.iter_mut().zip([found, blind]) {
                    let light = f64::from(light[0]) / f64::from(COUNT);
                    (sum[0], sum[1]) = (sum[0] + light, sum[1] + light * light * f64::from(COUNT));
                }
            }
            let [[found, squares], [blind, blind_squares]] = sums;
            let error = ((squares + blind_squares - found * found - blind * blind) / f64::from(COUNT)).sqrt();
            assert!(error < 0.05 * blind, "{error} of {blind}");
            assert!((found - blind).abs() < 4.0 * error, "{to_eye}: {found} instead of {blind}, ± {error}");
        }
    }

    #[test]
    fn peaked_phase_functions_find_their_part_of_a_wide_lamp() {
        for (g, gain) in [(0.5, 1.0), (0.93, 4.0), (0.99, 10.0)] {
            let ([mean, deviation], [expected, alone]) = seen(g);
            let error = deviation / 200.0;
            assert!((mean / expected - 1.0).abs() < 4.0 * error, "{g}: {mean} instead of {expected}, ± {error}");
            assert!(deviation < 1.05 * alone / gain, "{g}: {deviation}, connections alone {alone}");
        }
    }
}
