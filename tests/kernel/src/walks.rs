//! Light that is scattered again and again.

use fogbow::host::{Hit, Scene};
use fogbow::light::{Light, PointLight, QuadLight, SphereLight};
use fogbow::math::{Ray, Vec3, float};
use fogbow::medium::MediumError;
use fogbow::path::{self, Settings};
use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::world::World;

use crate::sections::point;
use crate::{Digest, media};

/// Paths through each medium.
const PATHS: usize = 64;

/// A shining ball over a floor, beside a mirror ball and a glass ball.
pub(crate) struct Balls;

impl Scene for Balls {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let glass = Surface::Dielectric { eta: 1.5, reflectance: Spectrum::ONE, transmittance: Spectrum::splat(0.9) };
        let mirror = Surface::Mirror { reflectance: Spectrum::splat(0.8) };
        let balls = [
            (SHINING, Surface::BLACK, Some(0)),
            ((Vec3::new(-1.5, -1.0, 0.0), 0.8), mirror, None),
            ((Vec3::new(1.5, -1.0, 0.0), 0.8), glass, None),
        ];
        let floor = (-2.0 - ray.origin.y) / ray.direction.y;
        let grey = Surface::Phong { diffuse: Spectrum::splat(0.4), specular: Spectrum::splat(0.3), exponent: 20.0 };
        let mut hit = Hit { distance: ray.length, normal: Vec3::Y, shading: Vec3::Y, surface: grey, light: None };
        let mut is_hit = false;
        if floor > 1e-4 && floor < hit.distance && ray.direction.y < 0.0 {
            hit.distance = floor;
            is_hit = true;
        }
        for ((centre, radius), surface, light) in balls {
            if let Some(distance) = meets(ray, centre, radius)
                && distance < hit.distance
            {
                hit = Hit {
                    distance,
                    normal: (ray.at(distance) - centre).normalize(),
                    shading: (ray.at(distance) - centre).normalize(),
                    surface,
                    light,
                };
                is_hit = true;
            }
        }
        is_hit.then_some(hit)
    }
}

/// Centre and radius of the light.
pub(crate) const SHINING: (Vec3, f32) = (Vec3::new(0.0, 1.5, 0.5), 0.4);

/// The first distance at which a ray meets a ball, from outside or inside.
fn meets(ray: &Ray, centre: Vec3, radius: f32) -> Option<f32> {
    let offset = ray.origin - centre;
    let half = offset.dot(ray.direction);
    let inside = half * half - (offset.length_squared() - radius * radius);
    if inside <= 0.0 {
        return None;
    }
    let root = float::sqrt(inside);
    [-half - root, -half + root].into_iter().find(|&distance| distance > 1e-3)
}

pub(crate) fn path(out: &mut Digest) {
    let traced = paths(|seen| {
        [seen.emitted, seen.surface_direct, seen.surface_indirect, seen.medium_single, seen.medium_multiple]
            .into_iter()
            .for_each(|part| out.spectrum(part));
    });
    out.int(u64::from(traced));
}

/// Calls `f` with lights of several kinds, the ball's first; whether they and all media could be made.
pub(crate) fn with_lights(f: impl FnOnce(&[Light<'_>]) -> Result<(), MediumError>) -> bool {
    let white = Spectrum::new(3.0, 2.0, 1.0);
    let lights = [
        SphereLight::new(SHINING.0, SHINING.1, white).map(Light::Sphere),
        PointLight::new(Vec3::new(1.0, 1.0, -1.0), white).map(Light::Point),
        QuadLight::new(Vec3::new(-3.0, 3.0, -1.0), Vec3::X, Vec3::Z, white).map(Light::Quad),
        Ok(Light::Constant(Spectrum::splat(0.1))),
    ];
    let [Ok(a), Ok(b), Ok(c), Ok(d)] = lights else { return false };
    f(&[a, b, c, d]).is_ok()
}

/// Traces paths through every medium; whether all could be made.
fn paths(mut each: impl FnMut(path::Radiance)) -> bool {
    let mut rng = Generator::new(11);
    let settings = Settings { max_scatterings: 12, ..Settings::default() };
    with_lights(|lights| {
        media::each(|medium| {
            let world = World { medium, scene: &Balls, lights: lights.into() };
            for _ in 0..PATHS {
                let eye = Vec3::new(0.0, 0.5, -5.0);
                let ray = Ray::new(eye, (point(&mut rng) * 0.5 - eye).normalize());
                each(path::radiance(&ray, &world, &settings, &mut rng));
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_see_light_of_every_component() {
        let mut sum = path::Radiance::default();
        assert!(paths(|seen| {
            assert!(seen.total().is_valid(), "{seen:?}");
            sum.emitted += seen.emitted;
            sum.surface_direct += seen.surface_direct;
            sum.surface_indirect += seen.surface_indirect;
            sum.medium_single += seen.medium_single;
            sum.medium_multiple += seen.medium_multiple;
        }));
        for part in [sum.emitted, sum.surface_direct, sum.surface_indirect, sum.medium_single, sum.medium_multiple] {
            assert!(part.min_element() > 0.0, "{sum:?}");
        }
    }
}
