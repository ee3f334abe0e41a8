//! Collisions drawn from marched rays against the law they follow and against marching itself.

use fogbow::host::{Hit, MajorantSegment, Medium, Properties};
use fogbow::math::{Ray, Vec3};
use fogbow::multiple_scatter::{Lengths, Settings, Walk};
use fogbow::phase::Phase;
use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::transmittance::marched::march;
use fogbow::transmittance::thickness::{Marching, Steps, Thickness, optical_thickness_with_gradients};
use fogbow::world::World;
use fogbow_tests::hosts::{Analytic, Body, Field, Filled};

const FINE: Marching = Marching { steps: Steps::Length(2e-3), offset: 0.5 };

/// A cloud in a ball with faces, and a ray through it.
fn cloud() -> (Filled<Analytic>, Ray) {
    let field = Field::Gaussian { a: 0.3, k: 3.0, c: Vec3::new(0.3, 0.1, 0.0), s: 0.4 };
    let medium = Analytic { phase: Phase::ISOTROPIC, ..Analytic::grey(field, 0.9) };
    let body = Body::Sphere { centre: Vec3::ZERO, radius: 1.0 };
    let direction = Vec3::new(0.9, 0.1, 0.2).normalize();
    (Filled { medium, body }, Ray { origin: Vec3::new(-2.0, 0.0, -0.1), direction, length: 3.5 })
}

fn assert_same(name: &str, drawn: &Thickness, expected: &Thickness, tolerance: f32) {
    assert!((drawn.value - expected.value).map(f32::abs).max_element() < tolerance, "{name}: {drawn:?}, {expected:?}");
    for (a, b) in [(drawn.gradient_fixed, expected.gradient_fixed), (drawn.gradient_joint, expected.gradient_joint)] {
        let off = (a - b).norm().max_element();
        assert!(off < tolerance * b.norm().max_element().max(1.0), "{name}: {a:?}, {b:?}");
    }
}

/// `τ(t) = −ln(1 − u)`, and over even numbers `u` the share of `1 − T` collides.
#[test]
fn collisions_lie_where_thickness_says() {
    let (medium, ray) = cloud();
    let through = optical_thickness_with_gradients(&ray, &medium, FINE).value.transmitted()[0];
    let count = 1000;
    let mut collided = 0;
    for i in 0..count {
        let u = (i as f32 + 0.5) / count as f32;
        let Some(collision) = march(&ray, &medium, FINE, u, false).collision else { continue };
        collided += 1;
        let up_to = optical_thickness_with_gradients(&ray.with_length(collision.distance), &medium, FINE);
        assert!((up_to.value[0] + (1.0 - u).ln()).abs() < 2e-3, "{u}: {collision:?}, {up_to:?}");
        let extinction = medium.extinction(ray.at(collision.distance))[0];
        assert!((collision.factor * extinction - 1.0).abs() < 1e-2, "{u}: {collision:?}, {extinction}");
    }
    let expected = (1.0 - through) * count as f32;
    assert!((collided as f32 - expected).abs() <= 1.5, "{collided} of {count}, expected {expected}");
}

#[test]
fn thickness_up_to_a_collision_and_beyond_is_that_of_marching() {
    let (medium, ray) = cloud();
    for u in [0.01, 0.2, 0.5, 0.8] {
        let marched = march(&ray, &medium, FINE, u, true);
        let collision = marched.collision.unwrap();
        let up_to = optical_thickness_with_gradients(&ray.with_length(collision.distance), &medium, FINE);
        assert_same("up to", &collision.thickness, &up_to, 5e-3);
        let whole = optical_thickness_with_gradients(&ray, &medium, FINE);
        assert_same("whole", &marched.whole.unwrap(), &whole, 1e-4);
    }
    let first = march(&ray, &medium, FINE, 0.0, true);
    assert!(first.collision.is_none_or(|c| c.thickness.gradient_fixed.is_finite()), "{first:?}");
    let nowhere = march(&ray.with_length(0.0), &medium, FINE, 0.5, true);
    assert!(nowhere.collision.is_none() && nowhere.whole == Some(Thickness::default()));
}

/// However coarse the steps: what is weighed by `σₜ/σ` sums up to the light that does not get through.
#[test]
fn coarse_steps_leave_no_bias_beyond_that_of_marching() {
    let (medium, ray) = cloud();
    let (steps, count) = (Steps::Length(0.25), 64);
    let (mut stopped, mut lost) = (0.0, 0.0);
    for i in 0..count {
        let marching = Marching { steps, offset: (i as f32 + 0.5) / count as f32 };
        let through = optical_thickness_with_gradients(&ray, &medium, marching).value.transmitted()[0];
        lost += f64::from(1.0 - through) / f64::from(count);
        for j in 0..count {
            let u = (j as f32 + 0.5) / count as f32;
            if let Some(collision) = march(&ray, &medium, marching, u, false).collision {
                let weight = collision.factor * medium.extinction(ray.at(collision.distance))[0];
                stopped += f64::from(weight) / f64::from(count * count);
            }
        }
    }
    assert!((stopped - lost).abs() < 0.01 * lost, "{stopped}, {lost}");
}

/// A sheet of cloud at the start of a ray, thinner than the steps, in next to vacuum.
struct Sheet;

impl Medium for Sheet {
    fn properties(&self, point: Vec3) -> Properties {
        let scattering = Spectrum::splat(if point.x < 1e-4 { 40.0 } else { 1e-5 });
        Properties { absorption: Spectrum::ZERO, scattering, emission: Spectrum::ZERO, phase: Phase::ISOTROPIC }
    }
    fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
        MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ZERO, majorant: Spectrum::splat(40.0) }
    }
    fn is_grey(&self) -> bool {
        true
    }
}

/// A collision in what marching took for next to vacuum must not weigh as much as all other walks together.
#[test]
fn what_marching_missed_has_no_weight_without_bound() {
    let mut settings = Settings::new(Steps::Length(0.1));
    settings.lengths = Lengths::Marched;
    let walk = Walk { world: World { medium: &Sheet, scene: &fogbow::host::Empty, lights: (&[]).into() }, settings };
    let wall = Hit { distance: 2.0, normal: Vec3::NEG_X, shading: Vec3::NEG_X, surface: Surface::BLACK, light: None };
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    let rng = &mut Generator::new(3);
    for u in [0.0, 1e-10] {
        let collision = walk.first(&ray, Some(&wall), u, false, rng).collision.unwrap();
        let weight = (collision.factor * collision.properties.scattering)[0];
        assert!(weight > 0.0 && weight < 33.0, "{u}: {weight}");
    }
}

/// In a medium without end every number collides somewhere, in vacuum none.
#[test]
fn rays_without_end_collide_for_sure_in_fog_and_never_in_vacuum() {
    let fog = Analytic::grey(Field::Homogeneous { a: 2.0 }, 0.5);
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    for u in [0.0, 0.5, 0.999_999] {
        let collision = march(&ray, &fog, FINE, u, false).collision.unwrap();
        assert!((collision.distance + (1.0 - u).ln() / 2.0).abs() < 1e-4, "{u}: {collision:?}");
    }
    assert!(march(&ray, &fogbow::host::Empty, FINE, 0.5, false).collision.is_none());
}
