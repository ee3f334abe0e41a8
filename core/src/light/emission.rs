//! Light as it leaves: rays with the power they stand for.

use glam::{Vec2, Vec3, Vec3Swizzles};

use super::Light;
use super::geometry::spot;
use crate::math::{Bounds, Frame, Ray, float::PI};
use crate::sampling::warp;
use crate::spectrum::Spectrum;

/// A ray that leaves a light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emission {
    /// Where it starts and where light flies (unit direction), without end. It starts on the light's very
    /// surface: whoever traces it has to leave that first.
    pub ray: Ray,
    /// Normal of the light's surface there; `None` for lights without a surface.
    pub normal: Option<Vec3>,
    /// Power (W) it stands for: flux over density. Its mean over rays is [`Light::power`]; of an environment map that is not even, about.
    pub power: Spectrum,
}

impl Emission {
    #[inline]
    fn from_surface(position: Vec3, normal: Vec3, power: Spectrum, u: Vec2) -> Self {
        let direction = around(normal, warp::cosine_hemisphere(u));
        Self { ray: Ray::new(position, direction), normal: Some(normal), power }
    }

    #[inline]
    fn from_point(position: Vec3, direction: Vec3, power: Spectrum) -> Self {
        Self { ray: Ray::new(position, direction), normal: None, power }
    }

    /// Through the faces of `bounds` that the light comes to, each as often as it is seen from there.
    fn from_afar(to_light: Vec3, irradiance: Spectrum, bounds: &Bounds, u: Vec2) -> Option<Self> {
        let size = bounds.size();
        let seen = faces(size) * to_light.abs();
        let area = seen.element_sum();
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let on_face = |at: f32, area: f32| Vec3::new(0.5, (at / area).min(1.0) - 0.5, u.y - 0.5);
        let at = u.x * area;
        let place = if at < seen.x {
            on_face(at, seen.x)
        } else if at < seen.x + seen.y {
            on_face(at - seen.x, seen.y).zxy()
        } else {
            on_face(at - seen.x - seen.y, seen.z).yzx()
        };
        // From beyond the face, in which a surface may lie.
        let origin = bounds.centre() + place * size.copysign(to_light) + to_light * size.max_element();
        Some(Self { ray: Ray::new(origin, -to_light), normal: None, power: irradiance * area })
    }
}

/// Areas (m²) of the faces of a box across each axis.
pub(super) fn faces(size: Vec3) -> Vec3 {
    Vec3::new(size.y * size.z, size.z * size.x, size.x * size.y)
}

#[inline]
fn around(axis: Vec3, local: Vec3) -> Vec3 {
    Frame::around(axis).to_world(local).normalize()
}

impl Light<'_> {
    /// Draws a ray of light that leaves the light: `position` decides where, `direction` whither. `None`
    /// where nothing leaves, which counts as a ray without power.
    ///
    /// | light | density |
    /// |---|---|
    /// | point | uniform directions |
    /// | Phong | directions as `cosˢ` |
    /// | spot | uniform within the cut-off; the border's fall-off is in the power |
    /// | projector | directions by the picture |
    /// | picture | points by the picture, directions as the cosine |
    /// | quad, sphere, mesh | uniform over the area, directions as the cosine |
    /// | sun | uniform over `bounds`, as they are seen from the sun |
    /// | constant, environment | directions as [`Light::sample`], then as the sun |
    ///
    /// Lights at infinity shine through `bounds` only: these should hold all surfaces and media, as in [`Light::power`].
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::*, spectrum::Spectrum};
    /// let lamp = Light::Point(PointLight::from_flux(Vec3::Y, Spectrum::splat(60.0))?);
    /// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// let leaving = lamp.emit(&bounds, Vec2::splat(0.5), Vec2::new(0.0, 0.25)).unwrap();
    /// assert_eq!((leaving.ray.origin, leaving.ray.direction), (Vec3::Y, Vec3::Z));
    /// assert!((leaving.power[0] - 60.0).abs() < 1e-4);
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[must_use]
    pub fn emit(&self, bounds: &Bounds, position: Vec2, direction: Vec2) -> Option<Emission> {
        match self {
            Self::Point(light) => {
                let direction = warp::uniform_sphere(direction);
                Some(Emission::from_point(light.position, direction, light.intensity * (4.0 * PI)))
            }
            Self::Phong(light) => {
                let local = warp::cosine_power(direction, light.exponent);
                Some(Emission::from_point(light.position, around(light.axis, local), light.power()))
            }
            Self::Spot(light) => {
                let below = 1.0 - libm::cosf(light.cutoff());
                let local = warp::uniform_cone(direction, below);
                let power = light.intensity * (spot(local.z, light.beam(), light.cutoff()) * 2.0 * PI * below);
                Some(Emission::from_point(light.position, around(light.axis, local), power))
            }
            Self::Quad(light) => {
                let source = light.anchor(position);
                Some(Emission::from_surface(source.position, source.normal, source.weight * PI, direction))
            }
            Self::Mesh(light) => {
                let source = light.anchor(position)?;
                Some(Emission::from_surface(source.position, source.normal, source.weight * PI, direction))
            }
            Self::Projector(light) => {
                let (towards, power) = light.emit(direction)?;
                Some(Emission::from_point(light.position, towards, power))
            }
            Self::Picture(light) => {
                let source = light.anchor(position)?;
                Some(Emission::from_surface(source.position, source.normal, source.weight * PI, direction))
            }
            Self::Sphere(light) => {
                let normal = warp::uniform_sphere(position);
                let at = light.centre + normal * light.radius;
                Some(Emission::from_surface(at, normal, light.radiance * (PI * light.area()), direction))
            }
            Self::Sun(light) => Emission::from_afar(light.to_light, light.irradiance, bounds, position),
            Self::Constant(_) | Self::Environment(_) => {
                let arriving = self.sample(bounds.centre(), direction)?.incident;
                Emission::from_afar(arriving.to_light, arriving.irradiance, bounds, position)
            }
        }
    }
}
