//! Layer 4: lights.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`Light`]: the closed set; sampling, density, radiance behind one `match` |
//! | [`geometry`] | [`Source`]: a point of light with its fall-off, its gradient (Jarosz et al. 2008, Eq. 9, 36–40) |
//! | [`point`] | point, Phong and spot lights |
//! | [`area`] | quad, sphere and triangle-mesh lights |
//! | [`distant`] | sun, constant and image environments |
//!
//! Point lights take radiant **intensity** (W/sr); the constructors from flux say so.

pub mod area;
pub mod distant;
pub mod geometry;
pub mod point;

use glam::{Vec2, Vec3};

pub use area::{MeshLight, QuadLight, SphereLight, Triangle};
pub use distant::{EnvironmentMap, Sun};
pub use geometry::{Falloff, Incident, Source};
pub use point::{PhongLight, PointLight, SpotLight};

use crate::math::{Bounds, Ray};
use crate::spectrum::Spectrum;

/// A light.
#[derive(Debug, Clone, Copy)]
pub enum Light<'a> {
    /// Uniform in all directions.
    Point(PointLight),
    /// `cosˢ` around an axis.
    Phong(PhongLight),
    /// A cone with a soft border.
    Spot(SpotLight),
    /// A one-sided parallelogram.
    Quad(QuadLight),
    /// A sphere that shines outwards.
    Sphere(SphereLight),
    /// One-sided triangles.
    Mesh(MeshLight<'a>),
    /// Parallel light from infinity.
    Sun(Sun),
    /// The same radiance (W·m⁻²·sr⁻¹) from every direction.
    Constant(Spectrum),
    /// An image around the world.
    Environment(&'a EnvironmentMap<'a>),
}

/// A value of a light outside its range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightError {
    /// Radiance, intensity or irradiance must be finite and not negative.
    Emission,
    /// Positions and edges must be finite, axes must have a length.
    Geometry,
    /// The light has no area.
    NoArea,
    /// A Phong exponent must be 0 or at least 1: between, the gradient has no bound.
    Exponent,
    /// A spot needs `0 ≤ beam ≤ cutoff ≤ π`, and a cutoff above 0.
    Cone,
    /// Lent tables do not fit the image or mesh.
    Size,
}

impl core::fmt::Display for LightError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Emission => "emission must be finite and not negative",
            Self::Geometry => "positions must be finite and axes must have a length",
            Self::NoArea => "the light has no area",
            Self::Exponent => "a Phong exponent must be 0 or at least 1",
            Self::Cone => "a spot needs 0 <= beam width <= cutoff angle <= pi and a cutoff above 0",
            Self::Size => "the lent tables do not fit",
        })
    }
}

impl core::error::Error for LightError {}

/// A light sampled from a point.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// The sampled point of light, weighted by one over its density: [`Source::incident`] gives
    /// what it sends to any point, with the gradient.
    pub source: Source,
    /// What it sends to the point it was sampled for.
    pub incident: Incident,
    /// Density over solid angle (sr⁻¹) at the point it was sampled for; 0 for point lights and
    /// suns, which no ray hits by chance.
    pub pdf: f32,
}

impl LightSample {
    #[inline]
    fn certain(source: Source, from: Vec3) -> Option<Self> {
        Some(Self { source, incident: source.incident(from)?, pdf: 0.0 })
    }
}

impl Light<'_> {
    /// Draws a point of the light, as seen from `from`. `None` where the light cannot reach.
    #[inline]
    #[must_use]
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<LightSample> {
        match self {
            Self::Point(light) => LightSample::certain(light.source(), from),
            Self::Phong(light) => LightSample::certain(light.source(), from),
            Self::Spot(light) => LightSample::certain(light.source(), from),
            Self::Quad(light) => light.sample(from, u),
            Self::Sphere(light) => light.sample(from, u),
            Self::Mesh(light) => light.sample(from, u),
            Self::Sun(light) => Some(distant::sample_sun(light)),
            Self::Constant(radiance) => Some(distant::sample_constant(*radiance, u)),
            Self::Environment(map) => map.sample(u),
        }
    }

    /// Density (sr⁻¹) with which [`Light::sample`] at `from` draws the direction `to_light`, where
    /// a ray meets the light after `distance` (m) at a surface with `normal`. 0 for point lights.
    #[inline]
    #[must_use]
    pub fn pdf(&self, from: Vec3, to_light: Vec3, distance: f32, normal: Vec3) -> f32 {
        match self {
            Self::Point(_) | Self::Phong(_) | Self::Spot(_) | Self::Sun(_) => 0.0,
            Self::Quad(light) => light.pdf(from, to_light, distance),
            Self::Sphere(light) => light.pdf(from),
            Self::Mesh(light) => light.pdf(to_light, distance, normal),
            Self::Constant(_) => crate::math::float::INV_FOUR_PI,
            Self::Environment(map) => map.pdf(to_light),
        }
    }

    /// Radiance (W·m⁻²·sr⁻¹) that an area light's surface with `normal` sends towards `to_eye`;
    /// 0 from behind and for lights without a surface.
    #[inline]
    #[must_use]
    pub fn radiance(&self, normal: Vec3, to_eye: Vec3) -> Spectrum {
        let emitted = match self {
            Self::Quad(light) => light.radiance,
            Self::Sphere(light) => light.radiance,
            Self::Mesh(light) => light.radiance,
            _ => return Spectrum::ZERO,
        };
        if normal.dot(to_eye) > 0.0 { emitted } else { Spectrum::ZERO }
    }

    /// Radiance (W·m⁻²·sr⁻¹) that arrives from infinity along −`to_light`; 0 for lights within the
    /// world and for suns, whose disc has no size.
    #[inline]
    #[must_use]
    pub fn background(&self, to_light: Vec3) -> Spectrum {
        match self {
            Self::Constant(radiance) => *radiance,
            Self::Environment(map) => map.radiance(to_light),
            _ => Spectrum::ZERO,
        }
    }

    /// The position of a light without extent, to which equiangular connections go.
    #[inline]
    #[must_use]
    pub fn position(&self) -> Option<Vec3> {
        match self {
            Self::Point(light) => Some(light.position),
            Self::Phong(light) => Some(light.position),
            Self::Spot(light) => Some(light.position),
            _ => None,
        }
    }

    /// Radiant intensity (W/sr) on the axis of a light without extent; 0 for others.
    #[inline]
    #[must_use]
    pub fn intensity(&self) -> Spectrum {
        match self {
            Self::Point(light) => light.intensity,
            Self::Phong(light) => light.intensity,
            Self::Spot(light) => light.intensity,
            _ => Spectrum::ZERO,
        }
    }

    /// The part of `ray` between `near` and `far` (m) that a light without extent can reach; `None`
    /// if it reaches nothing. Never too small: a spot's cone is a little widened.
    #[inline]
    #[must_use]
    pub fn lit_interval(&self, ray: &Ray, near: f32, far: f32) -> Option<(f32, f32)> {
        match self {
            Self::Spot(light) => light.lit_interval(ray, near, far),
            _ => Some((near, far)),
        }
    }

    /// A rough irradiance (mean of the channels) at `from` without fog or shadows: by it, lights
    /// are chosen. Positive wherever the light may contribute.
    #[inline]
    #[must_use]
    pub fn importance(&self, from: Vec3) -> f32 {
        match self {
            Self::Point(light) => light.importance(from),
            Self::Phong(light) => light.importance(from),
            Self::Spot(light) => light.importance(from),
            Self::Quad(light) => light.importance(from),
            Self::Sphere(light) => light.importance(from),
            Self::Mesh(light) => light.importance(from),
            Self::Sun(light) => light.irradiance.mean(),
            Self::Constant(radiance) => radiance.mean() * 4.0 * crate::math::float::PI,
            Self::Environment(map) => map.mean_radiance().mean() * 4.0 * crate::math::float::PI,
        }
    }

    /// Radiant power (W) emitted into a scene within `bounds`; distant lights shine through its
    /// bounding sphere.
    #[must_use]
    pub fn power(&self, bounds: &Bounds) -> Spectrum {
        use crate::math::float::PI;
        let disc = PI * 0.25 * bounds.size().length_squared();
        match self {
            Self::Point(light) => light.intensity * (4.0 * PI),
            Self::Phong(light) => light.power(),
            Self::Spot(light) => light.power(),
            Self::Quad(light) => light.radiance * (PI * light.area()),
            Self::Sphere(light) => light.radiance * (4.0 * PI * PI * light.radius * light.radius),
            Self::Mesh(light) => light.radiance * (PI * light.area()),
            Self::Sun(light) => light.irradiance * disc,
            Self::Constant(radiance) => *radiance * (4.0 * PI * disc),
            Self::Environment(map) => map.mean_radiance() * (4.0 * PI * disc),
        }
    }
}
