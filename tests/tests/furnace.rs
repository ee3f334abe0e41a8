//! Scenes whose answer is known, times the path tracer.

use fogbow::host::{Empty, Hit, MajorantSegment, Medium, Properties, Scene};
use fogbow::light::{Light, PointLight, QuadLight, SphereLight, SpotLight, Sun};
use fogbow::math::{Ray, Vec2, Vec3, float::PI};
use fogbow::medium::Homogeneous;
use fogbow::path::{self, Radiance, Settings};
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::{Generator, uniform2, warp};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::world::World;
use fogbow_tests::estimate::estimate;

/// A ball of fog around the origin whose density falls off towards its border, or not.
struct Ball {
    radius: f32,
    absorption: Spectrum,
    scattering: Spectrum,
    phase: Phase,
    is_constant: bool,
}

impl Ball {
    fn density(&self, point: Vec3) -> f32 {
        let r = point.length() / self.radius;
        if r >= 1.0 {
            0.0
        } else if self.is_constant {
            1.0
        } else {
            1.0 - r * r
        }
    }
}

impl Medium for Ball {
    fn properties(&self, point: Vec3) -> Properties {
        let density = self.density(point);
        Properties {
            absorption: self.absorption * density,
            scattering: self.scattering * density,
            emission: Spectrum::ZERO,
            phase: self.phase,
        }
    }
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        let closest = -ray.origin.dot(ray.direction);
        let height2 = ray.at(closest).length_squared();
        let half = (self.radius * self.radius - height2).max(0.0).sqrt();
        let (enter, leave) = (closest - half, closest + half);
        if half <= 0.0 || from >= leave * (1.0 - 1e-6) - 1e-6 {
            return MajorantSegment::vacuum(f32::INFINITY);
        }
        if from < enter {
            return MajorantSegment::vacuum(enter);
        }
        let majorant = self.absorption + self.scattering;
        MajorantSegment { until: leave, minorant: if self.is_constant { majorant } else { Spectrum::ZERO }, majorant }
    }
    fn is_grey(&self) -> bool {
        (self.absorption + self.scattering).is_grey()
    }
}

/// One sphere around the origin.
struct Sphere {
    radius: f32,
    surface: Surface,
    light: Option<u32>,
}

impl Scene for Sphere {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let b = ray.origin.dot(ray.direction);
        let height2 = (ray.origin - ray.direction * b).length_squared();
        let half2 = self.radius * self.radius - height2;
        if half2 < 0.0 {
            return None;
        }
        let half = half2.sqrt();
        let distance = [-b - half, -b + half].into_iter().find(|&t| t > 0.0 && t < ray.length)?;
        let normal = ray.at(distance).normalize();
        Some(Hit { distance, normal, shading: normal, surface: self.surface, light: self.light })
    }
}

const EYE: Vec3 = Vec3::new(0.2, -0.4, 3.0);

/// f32 rounding accumulated over a path.
const ROUNDING: f64 = 2e-5;

fn towards_ball(rng: &mut Generator) -> Ray {
    let target = warp::uniform_sphere(uniform2(rng)) * 0.9;
    Ray::new(EYE, (target - EYE).normalize())
}

#[test]
fn fog_that_only_scatters_vanishes_under_a_uniform_sky() {
    let phases = [
        Phase::ISOTROPIC,
        Lobe::HenyeyGreenstein { g: -0.7 }.into(),
        Phase::droplets(12.0).unwrap(),
        Lobe::Rayleigh.into(),
    ];
    for (i, phase) in phases.into_iter().enumerate() {
        for scattering in [Spectrum::splat(1.5), Spectrum::new(0.3, 1.0, 4.0)] {
            for is_constant in [true, false] {
                let fog = Ball { radius: 1.0, absorption: Spectrum::ZERO, scattering, phase, is_constant };
                let sky = [Light::Constant(Spectrum::new(1.0, 2.0, 3.0))];
                let world = World { medium: &fog, scene: &Empty, lights: (&sky).into() };
                let seen = estimate(40_000, |rng| {
                    path::radiance(&towards_ball(rng), &world, &Settings::default(), rng).total()
                });
                let what = format!("phase {i}, {scattering:?}, constant: {is_constant}");
                seen.assert_is([1.0, 2.0, 3.0], ROUNDING, &what);
            }
        }
    }
}

#[test]
fn white_surfaces_vanish_under_a_uniform_sky_with_and_without_fog() {
    let surfaces = [
        Surface::Lambert { reflectance: Spectrum::ONE },
        Surface::Mirror { reflectance: Spectrum::ONE },
        Surface::Dielectric { eta: 1.5, reflectance: Spectrum::ONE, transmittance: Spectrum::ONE },
        Surface::Null,
    ];
    for surface in surfaces {
        for density in [0.0, 2.0] {
            let fog = Ball {
                radius: 1.4,
                absorption: Spectrum::ZERO,
                scattering: Spectrum::splat(density),
                phase: Lobe::HenyeyGreenstein { g: 0.6 }.into(),
                is_constant: true,
            };
            let scene = Sphere { radius: 1.0, surface, light: None };
            let sky = [Light::Constant(Spectrum::ONE)];
            let world = World { medium: &fog, scene: &scene, lights: (&sky).into() };
            let seen =
                estimate(40_000, |rng| path::radiance(&towards_ball(rng), &world, &Settings::default(), rng).total());
            seen.assert_is([1.0; 3], ROUNDING, &format!("{surface:?}, density {density}"));
        }
    }
}

#[test]
fn an_isothermal_medium_looks_like_emission_over_absorption_whatever_it_scatters() {
    for scattering in [Spectrum::ZERO, Spectrum::splat(2.0), Spectrum::new(0.5, 1.0, 3.0)] {
        let fog = Homogeneous::new(Spectrum::splat(0.8), scattering, Lobe::HenyeyGreenstein { g: 0.5 })
            .and_then(|fog| fog.with_emission(Spectrum::new(0.8, 1.6, 2.4)))
            .unwrap();
        let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        let seen = estimate(60_000, |rng| path::radiance(&ray, &world, &Settings::default(), rng).total());
        seen.assert_is([1.0, 2.0, 3.0], ROUNDING, &format!("{scattering:?}"));
    }
}

/// Sheet § 3.3: fluence of light scattered at least once, 1.5 m from a point light of 1 W in an
/// infinite isotropic medium with σₜ = 1, ϖ = 0.8: `4π/σₛ · 2.33649·10⁻³` (Fourier solution).
#[test]
fn fluence_around_a_point_light_in_an_infinite_medium() {
    let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::splat(0.8), Lobe::Isotropic).unwrap();
    let lamp = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &Empty, lights: (&lamp).into() };
    let seen = estimate(5_000_000, |rng| {
        let ray = Ray::new(Vec3::new(0.0, 1.5, 0.0), warp::uniform_sphere(uniform2(rng)));
        path::radiance(&ray, &world, &Settings::default(), rng).total() * 0.8
    });
    // Infinite variance: the error bar is an estimate, so the tolerance is 1 %, about four of its widths.
    assert!((seen.mean[0] / 2.33649e-3 - 1.0).abs() < 0.01, "{} ± {}", seen.mean[0], seen.error[0]);
    assert!(seen.error[0] / seen.mean[0] < 0.003, "{} ± {}", seen.mean[0], seen.error[0]);
}

/// `∫ σₛ p T(eye, y) T(y, light) f(y) dt` along a ray in `f64`.
fn single_scattering(
    ray: &Ray,
    length: f64,
    extinction: f64,
    scattering: f64,
    g: f64,
    irradiance: impl Fn(Vec3) -> Vec<(Vec3, f64, f64)>,
) -> f64 {
    let steps = 4000;
    (0..steps)
        .map(|i| {
            let t = length * (f64::from(i) + 0.5) / f64::from(steps);
            let point = ray.at(t as f32);
            let arriving: f64 = irradiance(point)
                .into_iter()
                .map(|(to_light, distance, value)| {
                    let cosine = f64::from(ray.direction.dot(to_light));
                    let d = 1.0 + g * g - 2.0 * g * cosine;
                    let phase = (1.0 - g * g) / (4.0 * std::f64::consts::PI * d.powf(1.5));
                    value * phase * (-extinction * distance).exp()
                })
                .sum();
            arriving * scattering * (-extinction * t).exp() * length / f64::from(steps)
        })
        .sum()
}

#[test]
fn single_scattering_of_every_kind_of_light_matches_quadrature() {
    let (extinction, scattering, g) = (0.7, 0.5, 0.4);
    let fog = Homogeneous::new(
        Spectrum::splat(extinction - scattering),
        Spectrum::splat(scattering),
        Lobe::HenyeyGreenstein { g },
    )
    .unwrap();
    let corner = Vec3::new(-0.5, 1.0, 1.5);
    let (edge_u, edge_v) = (Vec3::new(0.0, 0.0, 0.8), Vec3::new(-0.6, 0.3, 0.0));
    let position = Vec3::new(0.3, 0.8, 2.0);
    let axis = Vec3::new(-0.2, -1.0, 0.1).normalize();
    let lights = [
        Light::Point(PointLight::new(position, Spectrum::splat(2.0)).unwrap()),
        Light::Spot(SpotLight::new(position, axis, 0.4, 0.8, Spectrum::splat(5.0)).unwrap()),
        Light::Quad(QuadLight::new(corner, edge_u, edge_v, Spectrum::splat(3.0)).unwrap()),
        Light::Sphere(SphereLight::new(position, 0.3, Spectrum::splat(4.0)).unwrap()),
        Light::Constant(Spectrum::ONE),
        Light::Sun(Sun::new(Vec3::new(0.0, 1.0, 1.0), Spectrum::ONE).unwrap()),
    ];
    let ray = Ray::new(Vec3::new(0.1, 0.1, -1.0), Vec3::new(0.05, 0.02, 1.0).normalize());
    // Without surfaces an infinite medium hides the sky and the sun; the light must be visible.
    for light in lights.iter().take(4) {
        let quadrature =
            single_scattering(&ray, 40.0, f64::from(extinction), f64::from(scattering), f64::from(g), |y| {
                let n = 24;
                let mut parts = Vec::new();
                for i in 0..n {
                    for j in 0..n {
                        let u = Vec2::new((i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32);
                        let source = light.sample(y, u);
                        if let Some(incident) = source.map(|s| s.incident) {
                            let share = 1.0 / f64::from(n * n);
                            parts.push((
                                incident.to_light,
                                f64::from(incident.distance),
                                f64::from(incident.irradiance[0]) * share,
                            ));
                        }
                        if matches!(light, Light::Point(_) | Light::Spot(_)) {
                            // One sample says it all.
                            parts.truncate(1);
                            if let Some(part) = parts.first_mut() {
                                part.2 = f64::from(source.unwrap().incident.irradiance[0]);
                            }
                            return parts;
                        }
                    }
                }
                parts
            });
        let lights = [*light];
        let world = World { medium: &fog, scene: &Empty, lights: (&lights).into() };
        let settings = Settings { max_scatterings: 1, ..Settings::default() };
        let seen = estimate(400_000, |rng| path::radiance(&ray, &world, &settings, rng).total());
        // The quadrature's own error: 24² strata on the light.
        seen.assert_is([quadrature; 3], 2e-3, &format!("{light:?}"));
    }
}

#[test]
fn a_light_seen_through_absorbing_fog_follows_beer_and_lambert() {
    let fog = Ball {
        radius: 1.0,
        absorption: Spectrum::new(0.1, 0.5, 2.0),
        scattering: Spectrum::ZERO,
        phase: Phase::ISOTROPIC,
        is_constant: true,
    };
    let lights = [Light::Sphere(SphereLight::new(Vec3::ZERO, 0.5, Spectrum::ONE).unwrap())];
    let scene = Sphere { radius: 0.5, surface: Surface::BLACK, light: Some(0) };
    let world = World { medium: &fog, scene: &scene, lights: (&lights).into() };
    let ray = Ray::new(Vec3::new(0.0, 0.0, 3.0), Vec3::NEG_Z);
    let seen = estimate(200_000, |rng| path::radiance(&ray, &world, &Settings::default(), rng).total());
    seen.assert_is([0.1f64, 0.5, 2.0].map(|s| (-0.5 * s).exp()), ROUNDING, "half a metre of fog");
}

/// Seen from afar, points are far less exact than a lamp is close: a shadow ray that starts above
/// the surface must not run into the lamp it goes to.
#[test]
fn a_surface_close_to_a_small_lamp_and_far_from_the_eye_gets_all_its_light() {
    struct Shell;
    impl Scene for Shell {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let wall = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
            let lamp = Sphere { radius: 0.04, surface: Surface::BLACK, light: Some(0) };
            // A wall at z = −0.4, seen through nothing from z = 4.
            let t = (-0.4 - ray.origin.z) / ray.direction.z;
            let is_wall = t > 0.0 && t < ray.length;
            let wall =
                is_wall.then_some(Hit { distance: t, normal: Vec3::Z, shading: Vec3::Z, surface: wall, light: None });
            let lamp = lamp.closest_hit(ray);
            if lamp.is_some_and(|l| wall.is_none_or(|w| l.distance < w.distance)) { lamp } else { wall }
        }
    }
    let lights = [Light::Sphere(SphereLight::new(Vec3::ZERO, 0.04, Spectrum::splat(400.0)).unwrap())];
    let world = World { medium: &Empty, scene: &Shell, lights: (&lights).into() };
    let target = Vec3::new(0.1, 0.05, -0.4);
    let eye = Vec3::new(0.3, 0.2, 4.0);
    let ray = Ray::new(eye, (target - eye).normalize());
    let once = Settings { max_scatterings: 1, ..Settings::default() };
    let seen = estimate(20_000, |rng| path::radiance(&ray, &world, &once, rng).total());
    // Irradiance of a sphere wholly above the horizon: π L sin² cos.
    let distance2 = f64::from(target.length_squared());
    let truth = 0.5 * 400.0 * 0.0016 / distance2 * 0.4 / distance2.sqrt();
    seen.assert_is([truth; 3], 1e-4, "wall behind a lamp");
}

#[test]
fn the_components_of_radiance_hold_what_their_names_say() {
    let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.4), Lobe::Isotropic).unwrap();
    let lamp = [Light::Point(PointLight::new(Vec3::new(0.0, 3.0, 0.0), Spectrum::splat(9.0)).unwrap())];
    let scene = Sphere { radius: 1.0, surface: Surface::Lambert { reflectance: Spectrum::splat(0.5) }, light: None };
    let world = World { medium: &fog, scene: &scene, lights: (&lamp).into() };
    let ray = Ray::new(Vec3::new(0.0, 2.0, 2.0), Vec3::new(0.0, -1.0, -1.0).normalize());
    let once = Settings { max_scatterings: 1, ..Settings::default() };
    let mut sum = Radiance::default();
    for i in 0..2000 {
        let seen = path::radiance(&ray, &world, &once, &mut Generator::new(i));
        assert!(seen.surface_indirect.is_black() && seen.medium_multiple.is_black() && seen.emitted.is_black());
        sum.surface_direct += seen.surface_direct;
        sum.medium_single += seen.medium_single;
    }
    // Direct light at the hit point, both ways through the fog.
    let hit = scene.closest_hit(&ray).unwrap();
    let point = ray.at(hit.distance);
    let to_light = Vec3::new(0.0, 3.0, 0.0) - point;
    let cosine = hit.normal.dot(to_light.normalize());
    let through = (-0.5 * (hit.distance + to_light.length())).exp();
    let direct = 9.0 * cosine / to_light.length_squared() * 0.5 / PI * through;
    let seen = sum.surface_direct[0] / 2000.0;
    // The flight reaches the surface with probability e^(-0.5·distance): binomial noise of 3 %.
    assert!((seen / direct - 1.0).abs() < 0.12, "{seen} instead of {direct}");
    assert!(sum.medium_single[0] > 0.0);
}
