//! The light field with which light leaves a light: sheet § 2.9.

use glam::Vec3;

use super::light_field::LightField;
use super::matrix::{LIMIT, Symmetric4};
use super::operators::PER_HESSIAN;
use crate::light::{EnvironmentMap, Light};
use crate::math::float::{self, PI};
use crate::math::{Frame, Ray, Symmetric2};

/// Angular radius (rad) that stands for the sun's, which [`Light::Sun`] has none of: finer than any grid.
const SUN_RADIUS: f32 = 1e-3;

/// Covariance of the spectrum of a Gaussian with this covariance: `M⁻¹/(4π²)`.
///
/// Seen edge-on a light is a line, sharp across it: its width counts as `√least` at least, and as a thousandth of
/// its length, so that the inverse is one.
fn spectrum_of(m: &Symmetric2, least: f32) -> Symmetric2 {
    let least = least + 1e-6 * m.trace();
    Symmetric2 { xx: m.xx + least, xy: m.xy, yy: m.yy + least }.pseudo_inverse().times(PER_HESSIAN)
}

/// The light field of a photon that leaves `light` along `ray`; `normal` is that of the light's surface there.
///
/// Lights with an area vary in space as Gaussians of the same variance and, being Lambertian, not over
/// directions: `3/(π²a²)` for a square of side `a`, `1/(π²ρ²)` for a disc of radius `ρ`, more where seen
/// obliquely. Lights without extent count as discs of `point_radius` (m), which should be small beside what
/// is to be seen, and not below a thousandth of it: `f32` cancels there. Lobes, spots, suns and environments add
/// what varies over directions.
///
/// ```
/// # use fogbow::{covariance::emitted, light::{Light, PointLight}, math::{Ray, Vec3}, spectrum::Spectrum};
/// let lamp = Light::Point(PointLight::new(Vec3::ZERO, Spectrum::ONE)?);
/// let light = emitted(&lamp, &Ray::new(Vec3::ZERO, Vec3::X), None, 0.01);
/// assert!((light.covariance.spatial.xx - 1.0 / (core::f32::consts::PI * 0.01).powi(2)).abs() < 0.1);
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[must_use]
pub fn emitted(light: &Light<'_>, ray: &Ray, normal: Option<Vec3>, point_radius: f32) -> LightField {
    let frame = Frame::around(ray.direction);
    let disc = |radius: f32| {
        let variance = float::min(1.0 / (PI * PI * radius * radius), LIMIT);
        Symmetric2::diagonal(variance, variance)
    };
    let point = disc(point_radius.max(1e-6));
    let covariance = match light {
        Light::Point(_) => Symmetric4::separable(point, Symmetric2::ZERO),
        Light::Phong(light) => {
            let variance = light.exponent * PER_HESSIAN;
            Symmetric4::separable(point, Symmetric2::diagonal(variance, variance))
        }
        Light::Spot(light) => {
            let angle = float::acos(light.axis.dot(ray.direction));
            // The light varies across its border over the distance to it, but not faster than it fades.
            let scale = (light.cutoff() - angle).abs().max(0.5 * (light.cutoff() - light.beam())).max(1e-3);
            let radial = -light.axis;
            let (a, b) = (radial.dot(frame.u), radial.dot(frame.v));
            let length2 = a * a + b * b;
            let angular = if length2 > 1e-12 {
                let variance = PER_HESSIAN / (scale * scale * length2);
                Symmetric2::new(variance * a * a, variance * a * b, variance * b * b)
            } else {
                let variance = PER_HESSIAN / (light.cutoff() * light.cutoff());
                Symmetric2::diagonal(variance, variance)
            };
            Symmetric4::separable(point, angular)
        }
        Light::Projector(light) => {
            let sent = |direction: Vec3| light.intensity(direction).mean();
            let least = 1e-3 * light.intensity(light.axis()).mean();
            Symmetric4::separable(point, detail(sent, light.resolution(), least, &frame))
        }
        Light::Quad(light) => parallelogram(light.edges(), light.area(), &frame),
        // The light as a whole, as if it were even.
        Light::Picture(light) => parallelogram(light.edges(), light.area(), &frame),
        Light::Sphere(light) => Symmetric4::separable(disc(light.radius.max(1e-6)), Symmetric2::ZERO),
        Light::Mesh(light) => {
            // The disc of the same area, foreshortened.
            let variance = light.area() / (4.0 * PI);
            let cos = normal.map_or(1.0, |n| n.dot(ray.direction).abs());
            let u = normal.map_or(frame.u, |n| n - ray.direction * n.dot(ray.direction));
            let squeezed = (1.0 - cos * cos) * variance;
            let direction = u.normalize_or_zero();
            let (a, b) = (direction.dot(frame.u), direction.dot(frame.v));
            let m = Symmetric2::new(variance - squeezed * a * a, -squeezed * a * b, variance - squeezed * b * b);
            Symmetric4::separable(spectrum_of(&m, 1e-4 * variance), Symmetric2::ZERO)
        }
        Light::Sun(_) => Symmetric4::separable(Symmetric2::ZERO, disc(SUN_RADIUS)),
        Light::Constant(_) => Symmetric4::ZERO,
        Light::Environment(map) => Symmetric4::separable(Symmetric2::ZERO, sky(map, &frame)),
    };
    LightField { covariance: covariance.mended(), frame }
}

/// Of a light with these edges (m), seen along the frame's axis.
fn parallelogram(edges: [Vec3; 2], area: f32, frame: &Frame) -> Symmetric4 {
    let mut m = Symmetric2::ZERO;
    for edge in edges {
        let (a, b) = (edge.dot(frame.u), edge.dot(frame.v));
        m = m.plus(&Symmetric2::new(a * a, a * b, b * b).times(1.0 / 12.0));
    }
    Symmetric4::separable(spectrum_of(&m, 1e-4 * area / 12.0), Symmetric2::ZERO)
}

/// Angular covariance of an image around the world: its relative Hessian over a texel.
fn sky(map: &EnvironmentMap<'_>, frame: &Frame) -> Symmetric2 {
    let sent = |direction: Vec3| map.radiance(-direction).mean();
    detail(sent, map.resolution().max(1e-4), 1e-6 * map.mean_radiance().mean(), frame)
}

/// Angular covariance of what is sent in directions (unit) around a frame's axis, by differences over `step` (rad): its relative Hessian, where
/// no less than `least` counts as sent.
fn detail(sent: impl Fn(Vec3) -> f32, step: f32, least: f32, frame: &Frame) -> Symmetric2 {
    let at = |a: f32, b: f32| {
        let direction = frame.w + frame.u * (a * step) + frame.v * (b * step);
        sent(direction.normalize())
    };
    let centre = at(0.0, 0.0);
    let scale = 1.0 / (step * step * centre.max(least).max(1e-30));
    let hessian = Symmetric2 {
        xx: (at(1.0, 0.0) + at(-1.0, 0.0) - 2.0 * centre) * scale,
        xy: 0.25 * (at(1.0, 1.0) + at(-1.0, -1.0) - at(1.0, -1.0) - at(-1.0, 1.0)) * scale,
        yy: (at(0.0, 1.0) + at(0.0, -1.0) - 2.0 * centre) * scale,
    };
    hessian.absolute().times(PER_HESSIAN)
}
