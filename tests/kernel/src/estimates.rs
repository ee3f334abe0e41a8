//! Light scattered once and more than once, with gradients; expansions over directions; eye rays.

use fogbow::host::Hit;
use fogbow::march::eye_ray;
use fogbow::math::{Ray, Vec3};
use fogbow::multiple_scatter::{self, Walk};
use fogbow::phase::{Deflection, Lobe, Phase};
use fogbow::sampling::{Generator, uniform};
use fogbow::sh::{self, Coefficient, MAX_COEFFICIENTS, MAX_DEGREE, coefficient_count};
use fogbow::single_scatter::{self, Directional, Sums, Towards, moments};
use fogbow::spectrum::{Gradient, Spectrum};
use fogbow::transmittance::thickness::{Marching, Steps, optical_thickness_with_gradients};
use fogbow::world::World;

use crate::sections::{ROUNDS, direction, point};
use crate::walks::{Balls, with_lights};
use crate::{Digest, media};

/// Estimates in each medium: each takes many rays.
const ESTIMATES: usize = 16;
/// Degree of the expansions estimated.
const DEGREE: usize = 4;
const STEPS: Steps = Steps::Length(0.3);

pub(crate) fn spherical_harmonics(out: &mut Digest) {
    let mut rng = Generator::new(12);
    let mut values = [0.0; MAX_COEFFICIENTS];
    let mut gradients = [Vec3::ZERO; MAX_COEFFICIENTS];
    let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.6 });
    let mut zonal = [Spectrum::ZERO; coefficient_count(6)];
    for degree in 0..=MAX_DEGREE {
        let count = coefficient_count(degree);
        for _ in 0..8 {
            let at = direction(&mut rng);
            sh::evaluate(at, degree, &mut values);
            values[..count].iter().for_each(|&v| out.float(v));
            sh::evaluate_with_gradients(at, degree, &mut values, &mut gradients);
            gradients[..count].iter().for_each(|&v| out.vec3(v));
            sh::zonal::coefficients(&moments(&phase, 6)[..7], at, &mut zonal);
            out.spectrum(sh::expansion::value(&zonal, direction(&mut rng)));
        }
    }
    let mut projected = [Spectrum::ZERO; coefficient_count(DEGREE)];
    sh::project(12, |at| phase.value(Deflection::from_cos(at.x)), &mut projected);
    projected.into_iter().for_each(|v| out.spectrum(v));
}

fn fold_sums(out: &mut Digest, sums: &Sums) {
    [sums.value, sums.gradient_norms, sums.unshadowed, sums.unshadowed_gradient_norms]
        .into_iter()
        .for_each(|v| out.spectrum(v));
    out.gradient(&sums.gradient);
}

fn fold_expansion(out: &mut Digest, expansion: &[Coefficient]) {
    for coefficient in expansion {
        out.spectrum(coefficient.value);
        out.gradient(&coefficient.gradient);
    }
}

/// What surfaces send: enough to tell them apart.
fn outgoing(ray: &Ray, hit: &Hit) -> Spectrum {
    Spectrum::splat(0.2) * -hit.normal.dot(ray.direction).min(0.0)
}

pub(crate) fn thickness(out: &mut Digest) {
    let mut rng = Generator::new(13);
    let asked = media::each(|medium| {
        for _ in 0..ROUNDS {
            let ray = Ray::between(point(&mut rng), point(&mut rng));
            let thickness = optical_thickness_with_gradients(&ray, medium, Marching::new(0.2, uniform(&mut rng)));
            let through = thickness.transmittance();
            for (value, fixed, joint) in [
                (thickness.value, thickness.gradient_fixed, thickness.gradient_joint),
                (through.value, through.gradient_fixed, through.gradient_joint),
            ] {
                out.spectrum(value);
                out.gradient(&fixed);
                out.gradient(&joint);
            }
        }
    });
    out.int(u64::from(asked.is_ok()));
}

pub(crate) fn single_scatter(out: &mut Digest) {
    let mut rng = Generator::new(14);
    let samples = |samples| single_scatter::Settings { samples, steps: STEPS };
    let done = with_lights(|lights| {
        media::each(|medium| {
            let world = World { medium, scene: &Balls, lights: lights.into() };
            for _ in 0..ESTIMATES {
                let (at, to_eye) = (point(&mut rng) * 0.4, direction(&mut rng));
                let phase = medium.properties(at).phase;
                let towards = Towards { to_eye, phase: &phase };
                fold_sums(out, &single_scatter::sample(at, &towards, &world, &samples(2), &mut rng));
                let surfaces = single_scatter::sample_surfaces(at, &towards, &world, outgoing, &samples(4), &mut rng);
                fold_sums(out, &surfaces);

                let mut coefficients = [Coefficient::ZERO; coefficient_count(DEGREE)];
                let known = moments(&phase, DEGREE);
                let mut into = Directional { moments: &known[..=DEGREE], coefficients: &mut coefficients };
                let all = single_scatter::sample_directional(at, &mut into, &world, &samples(2), &mut rng);
                fold_sums(out, &all);
                fold_expansion(out, &coefficients);
            }
        })
    });
    out.int(u64::from(done));
}

pub(crate) fn multiple_scatter(out: &mut Digest) {
    let mut rng = Generator::new(15);
    let done = with_lights(|lights| {
        media::each(|medium| {
            let settings = multiple_scatter::Settings::new(STEPS);
            let walk = Walk { world: World { medium, scene: &Balls, lights: lights.into() }, settings };
            for _ in 0..ESTIMATES {
                let (at, to_eye) = (point(&mut rng) * 0.4, direction(&mut rng));
                let phase = medium.properties(at).phase;
                fold_sums(
                    out,
                    &multiple_scatter::sample(at, &Towards { to_eye, phase: &phase }, &walk, outgoing, 4, &mut rng),
                );
            }
        })
    });
    out.int(u64::from(done));
}

pub(crate) fn march(out: &mut Digest) {
    let mut rng = Generator::new(16);
    let asked = media::each(|medium| {
        for _ in 0..ROUNDS {
            let ray = Ray::between(point(&mut rng), point(&mut rng));
            let glow = Gradient::outer(Spectrum::ONE, Vec3::splat(0.1));
            let in_scattering = |at: Vec3, _: Vec3, _: &_| Spectrum::ONE + glow.along(at);
            let seen = eye_ray(&ray, medium, |t| 0.2 + 0.1 * t, in_scattering, uniform(&mut rng));
            out.spectrum(seen.radiance);
            out.spectrum(seen.transmittance);
        }
    });
    out.int(u64::from(asked.is_ok()));
}
