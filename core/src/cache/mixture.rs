//! In which directions a record's samples look.

use glam::{Vec2, Vec3};

use super::aim::Aims;
use super::guide::Guided;
use crate::phase::{Phase, deflection};
use crate::single_scatter;

/// The third coordinate beside a golden-ratio lattice, in [0, 1): multiples of a number that stay even when wrapped. It
/// draws lengths, and in thin media its smallest values decide: after some hundred multiples f32 has none between 0 and
/// 3·10⁻⁵.
pub(super) fn third(j: u32, shift: f32) -> f32 {
    let u = f64::from(j) * (core::f64::consts::SQRT_2 - 1.0) + f64::from(shift);
    ((u - libm::floor(u)) as f32).min(1.0 - 0.5 * f32::EPSILON)
}

/// A mixture of densities of directions, each with an equal part of the samples: a given one, one towards
/// lights, one by the phase function from where scattering leads to the eye, and one that was learnt.
pub(super) struct Mixture<'a> {
    pub(super) aims: Aims,
    pub(super) eye: Option<(Vec3, &'a Phase)>,
    pub(super) guide: Option<&'a Guided>,
    pub(super) count: u32,
    pub(super) shift: Vec2,
}

impl Mixture<'_> {
    fn parts(&self) -> u32 {
        1 + u32::from(!self.aims.is_empty()) + u32::from(self.eye.is_some()) + u32::from(self.guide.is_some())
    }

    /// Direction `j` with the density (sr⁻¹) of the mixture.
    pub(super) fn direction(&self, j: u32, sample: &dyn Fn(Vec2) -> Vec3, pdf: &dyn Fn(Vec3) -> f32) -> (Vec3, f32) {
        let (has_aims, parts) = (!self.aims.is_empty(), self.parts());
        let of_part = |part: u32| (self.count + parts - 1 - part) / parts;
        let (to_aims, to_eye) = (1, 1 + u32::from(has_aims));
        let aimed = if has_aims { self.aims.of(of_part(to_aims)) } else { 0 };
        let (mut k, mut n, mut part) = (j / parts, of_part(j % parts), j % parts);
        if has_aims && part == to_aims {
            // Those that are not aimed are drawn as the others.
            (k, n, part) = if k < aimed { (k, aimed, part) } else { (k - aimed, n - aimed, 0) };
        }
        let at = single_scatter::lattice(k, n, self.shift);
        let direction = match (part, self.eye, self.guide) {
            (0, ..) => sample(at),
            (part, ..) if has_aims && part == to_aims => self.aims.sample(at),
            (part, Some((eye, phase)), _) if part == to_eye => phase.sample(eye, at).to_light,
            (_, _, Some(guide)) => guide.sample(at),
            _ => sample(at),
        };
        let of_all = |samples: u32| samples as f32 / self.count as f32;
        let share = |part: u32| of_all(of_part(part));
        let as_others = if has_aims { of_part(to_aims) - aimed } else { 0 };
        let mut density = of_all(of_part(0) + as_others) * pdf(direction);
        if has_aims {
            density += of_all(aimed) * self.aims.pdf(direction);
        }
        if let Some((eye, phase)) = self.eye {
            density += share(to_eye) * phase.pdf(deflection(direction, eye));
        }
        if let Some(guide) = self.guide {
            density += share(parts - 1) * guide.pdf(direction);
        }
        (direction, density)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Light;
    use crate::sampling::{Generator, uniform, uniform2, warp};
    use crate::spectrum::Spectrum;

    /// A lamp that shines from above or past the point, and what rays collect that pass it: `1/sin θ`, which has a mean and no bound.
    #[test]
    fn directions_past_a_lamp_have_a_bound_and_no_bias_wherever_it_shines() {
        for (axis, bound, aimed) in [(Vec3::NEG_Z, 90.0, 25), (Vec3::Z, 60.0, 6)] {
            let spot = crate::light::SpotLight::new(Vec3::Z, axis, 0.4, 0.6, Spectrum::ONE).unwrap();
            let lights = [Light::Spot(spot)];
            let (mut most, mut sums, mut squares) = (0.0_f32, 0.0, 0.0);
            const ROUNDS: u32 = 4000;
            for round in 0..ROUNDS {
                let aims = Aims::new(Vec3::ZERO, &(&lights).into(), &crate::host::Empty, |_| true);
                assert_eq!(aims.of(25), aimed);
                let shift = uniform2(&mut Generator::new(u64::from(round)));
                let mixture = Mixture { aims, eye: None, guide: None, count: 51, shift };
                let mut mean = 0.0;
                for j in 0..mixture.count {
                    let (direction, pdf) = mixture.direction(j, &warp::uniform_sphere, &|_| warp::uniform_sphere_pdf());
                    // Rays that go the other way do not pass it.
                    if direction.z > 0.0 {
                        let across = Vec3::Z.cross(direction).length().max(f32::MIN_POSITIVE);
                        most = most.max(1.0 / (across * pdf));
                        mean += f64::from(1.0 / (across * pdf)) / f64::from(mixture.count);
                    }
                }
                sums += mean / f64::from(ROUNDS);
                squares += mean * mean / f64::from(ROUNDS);
            }
            // ∫ 1/sin θ dω = π² over half of all directions.
            let expected = core::f64::consts::PI * core::f64::consts::PI;
            let error = libm::sqrt((squares - sums * sums) / f64::from(ROUNDS));
            assert!(most < bound, "{axis}: {most}");
            assert!((sums - expected).abs() < 4.0 * error, "{axis}: {sums} of {expected} ± {error}");
        }
    }

    /// As many lengths within 10⁻⁵ mean free paths as there should be, and hardly any of none.
    #[test]
    fn small_values_of_the_third_coordinate_are_as_rare_as_small() {
        let (mut small, mut none) = (0, 0);
        let rng = &mut Generator::new(1);
        for _ in 0..4096 {
            let shift = uniform(rng);
            for u in (0..1024).map(|j| third(j, shift)) {
                assert!((0.0..1.0).contains(&u), "{u}");
                small += u32::from(u < 1e-5);
                none += u32::from(u == 0.0);
            }
        }
        // 42 expected, give or take 6.5.
        assert!((16..=68).contains(&small) && none <= 2, "{small}, {none}");
    }
}
