//! Hosts that are wrong about how far their bounds reach: whoever walks along their rays comes to an end, and to the
//! right answer where the bounds themselves are right.

use std::cell::Cell;

use fogbow::beams::{BeamNode, Beams, Piece, pieces};
use fogbow::host::{MajorantSegment, Medium, Properties};
use fogbow::march::{eye_ray, scattering_points};
use fogbow::math::{Ray, Vec3};
use fogbow::phase::Phase;
use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;
use fogbow::transmittance::marched::march;
use fogbow::transmittance::thickness::{Marching, optical_thickness, optical_thickness_with_gradients};
use fogbow::transmittance::{flight, transmittance};

/// Questions after which a walk along one ray counts as endless.
const ENDLESS: u32 = 20_000;

/// Extinction 1 m⁻¹, all of it scattering, everywhere.
struct Mistaken {
    /// Where bounds asked for at a distance end.
    until: fn(f32) -> f32,
    minorant: f32,
    majorant: f32,
    is_grey: bool,
    resolution: f32,
    asked: Cell<u32>,
    reached: Cell<f32>,
}

impl Medium for Mistaken {
    fn properties(&self, _: Vec3) -> Properties {
        Properties { scattering: Spectrum::ONE, ..Properties::VACUUM }
    }
    fn majorant_segment(&self, _: &Ray, from: f32) -> MajorantSegment {
        self.asked.set(self.asked.get() + 1);
        assert!(self.asked.get() < ENDLESS, "the walk does not end");
        assert!(from >= self.reached.get(), "the walk turns back from {} to {from}", self.reached.get());
        self.reached.set(from);
        let (minorant, majorant) = (Spectrum::splat(self.minorant), Spectrum::splat(self.majorant));
        MajorantSegment { until: (self.until)(from), minorant, majorant }
    }
    fn resolution(&self) -> f32 {
        self.resolution
    }
    fn is_grey(&self) -> bool {
        self.is_grey
    }
}

impl Mistaken {
    /// Before the next walk.
    fn fresh(&self) -> &Self {
        self.asked.set(0);
        self.reached.set(0.0);
        self
    }
}

/// Does `check` with all mistakes there are: each with a name, constant bounds or not, grey or not.
fn with_mistakes(mut check: impl FnMut(&str, &Mistaken)) {
    type Mistake = (&'static str, fn(f32) -> f32);
    let mistakes: [Mistake; 6] = [
        ("stands", |from| from),
        ("turns back", |from| from - 0.25),
        ("starts again", |_| 0.0),
        ("no number", |_| f32::NAN),
        ("infinitely far back", |_| f32::NEG_INFINITY),
        ("stands now and then", |from| if (8.0 * from).fract() < 0.5 { from + 0.01 } else { from }),
    ];
    for (name, until) in mistakes {
        for (minorant, majorant) in [(1.0, 1.0), (0.0, 2.0)] {
            for is_grey in [true, false] {
                for resolution in [0.02, 0.0, f32::NAN] {
                    let (asked, reached) = (Cell::new(0), Cell::new(0.0));
                    let medium = Mistaken { until, minorant, majorant, is_grey, resolution, asked, reached };
                    let name = format!("{name}, {minorant} to {majorant}, grey: {is_grey}, resolution {resolution}");
                    check(&name, &medium);
                }
            }
        }
    }
}

fn ray() -> Ray {
    Ray::new(Vec3::ZERO, Vec3::X).with_length(1.0)
}

fn assert_mean(values: impl Iterator<Item = f32>, expected: f32, what: &str) {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in values.map(f64::from) {
        n += 1.0;
        sum += value;
        squares += value * value;
    }
    let mean = sum / n;
    let error = ((squares / n - mean * mean).max(0.0) / n).sqrt();
    assert!((mean - f64::from(expected)).abs() <= 4.5 * error + 1e-5, "{what}: {mean} ± {error}, {expected}");
}

#[test]
fn transmittance_past_mistaken_bounds_is_right() {
    with_mistakes(|name, medium| {
        let mut rng = Generator::new(1);
        let found = (0..400).map(|_| transmittance(medium.fresh(), &ray(), &mut rng)[0]);
        assert_mean(found, (-1.0_f32).exp(), name);
    });
}

#[test]
fn flights_past_mistaken_bounds_end_where_they_should() {
    with_mistakes(|name, medium| {
        let mut rng = Generator::new(2);
        let passed = (0..400).map(|i| {
            let u = (i as f32 + 0.5) / 400.0;
            let flown = flight(medium.fresh(), &ray(), Spectrum::ONE, u, &mut rng);
            f32::from(u8::from(flown.collision.is_none()))
        });
        assert_mean(passed, (-1.0_f32).exp(), name);
    });
}

#[test]
fn thickness_past_mistaken_bounds_is_right() {
    with_mistakes(|name, medium| {
        let marching = Marching::midpoints(4);
        let value = optical_thickness(&ray(), medium.fresh(), marching);
        let thickness = optical_thickness_with_gradients(&ray(), medium.fresh(), marching);
        let marched = march(&ray(), medium.fresh(), marching, 0.5, true);
        for (value, what) in [(value, "value"), (thickness.value, "thickness"), (marched.whole.unwrap().value, "march")]
        {
            assert!((value[0] - 1.0).abs() < 1e-5, "{name}, {what}: {value:?}");
        }
        let collision = marched.collision.expect("half of the light collides");
        // Thousands of lengths add up, each rounded.
        assert!((collision.distance - core::f32::consts::LN_2).abs() < 1e-4, "{name}: {collision:?}");
    });
}

#[test]
fn eye_rays_past_mistaken_bounds_end() {
    with_mistakes(|name, medium| {
        let seen = eye_ray(&ray(), medium.fresh(), |_| 0.1, |_, _, _| Spectrum::ONE, 0.5);
        let expected = 1.0 - (-1.0_f32).exp();
        assert!((seen.radiance[0] - expected).abs() < 2e-3, "{name}: {seen:?}");
        let mut sum = 0.0;
        let points = scattering_points(&ray(), medium.fresh(), 1000.0, 0.5, 0.5, |_, properties, weight| {
            sum += (weight * properties.scattering)[0];
        });
        assert!((sum - expected).abs() < 2e-3, "{name}: {sum}, {points:?}");
        for transmittance in [seen.transmittance, points.transmittance] {
            assert!((transmittance[0] - (-1.0_f32).exp()).abs() < 1e-4, "{name}: {transmittance:?}");
        }
    });
}

#[test]
fn beams_past_mistaken_bounds_are_whole() {
    with_mistakes(|name, medium| {
        let mut rng = Generator::new(3);
        let carried = (0..200).map(|_| {
            let mut sum = 0.0;
            pieces(medium.fresh(), &ray(), Spectrum::ONE, 10.0, &mut rng, &mut |piece| {
                let rate = piece.rate[0];
                sum += piece.power[0] * if rate > 0.0 { -(-rate * piece.length).exp_m1() / rate } else { piece.length };
            });
            sum
        });
        assert_mean(carried, 1.0 - (-1.0_f32).exp(), name);
    });
}

/// A beam seen through a metre of medium.
#[test]
fn beams_are_gathered_through_mistaken_bounds() {
    let (mut all, mut nodes) = ([Piece::default(); 1], [BeamNode::default(); 2]);
    let mut beams = Beams::new(&mut all[..], &mut nodes[..]);
    let (origin, power, radius) = (Vec3::new(1.0, 0.0, -1.0), Spectrum::ONE, 0.01);
    beams.push(Piece { origin, length: 2.0, direction: Vec3::Z, power, radius, ..Piece::default() }).unwrap();
    beams.build(1).unwrap();
    with_mistakes(|name, medium| {
        let mut rng = Generator::new(4);
        let seen = beams.gather(&ray().with_length(2.0), medium.fresh(), u32::MAX, &mut rng).light.single[0];
        let pi = core::f32::consts::PI;
        let expected = (-1.0_f32).exp() / (4.0 * pi) * 3.2 / (pi * radius);
        assert!((seen / expected - 1.0).abs() < 0.02, "{name}: {seen} {expected}");
    });
}

/// Media that never say where they end, on rays without end.
#[test]
fn rays_without_end_come_to_one() {
    with_mistakes(|_, medium| {
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        let mut rng = Generator::new(5);
        for _ in 0..10 {
            assert_eq!(transmittance(medium.fresh(), &ray, &mut rng), Spectrum::ZERO);
            let flown = flight(medium.fresh(), &ray, Spectrum::ONE, 0.5, &mut rng);
            assert!(flown.collision.is_some_and(|there| there.phase == Phase::ISOTROPIC));
        }
        let thickness = optical_thickness(&ray, medium.fresh(), Marching::midpoints(4));
        assert_eq!(thickness.transmitted(), Spectrum::ZERO);
        let seen = eye_ray(&ray, medium.fresh(), |_| 0.1, |_, _, _| Spectrum::ONE, 0.5);
        assert!((seen.radiance[0] - 1.0).abs() < 2e-3, "{seen:?}");
        pieces(medium.fresh(), &ray, Spectrum::ONE, 10.0, &mut rng, &mut |_| ());
    });
}
