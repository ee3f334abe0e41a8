//! Layer 4a: lights.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`Light`]: the closed set; sampling, density, radiance behind one `match` |
//! | [`geometry`] | [`Source`]: a point of light with its fall-off, its gradient (Jarosz et al. 2008, Eq. 9, 36–40) |
//! | [`point`] | point, Phong and spot lights |
//! | [`area`] | quad, sphere and triangle-mesh lights |
//! | `picture` | [`Projector`], [`PictureLight`]: lights that show a [`LightImage`] |
//! | [`distant`] | sun, constant and image environments |
//! | `lights` | [`Lights`]: all of a world, and choices among them |
//! | `tree` | [`LightTree`]: boxes around many lights |
//! | `shadow_map` | [`ShadowMap`]: how far the rays of a lamp come |
//! | `question`, `cut` | what lights send to a place; nodes small enough to choose by it |
//! | [`emission`] | [`Emission`]: rays that leave a light, with their power |
//!
//! Point lights take radiant **intensity** (W/sr); the constructors from flux say so.

pub mod area;
mod cut;
pub mod distant;
pub mod emission;
pub mod geometry;
mod lights;
mod picture;
pub mod point;
mod question;
mod shadow_map;
mod tree;

use glam::{Vec2, Vec3};

pub use area::{MeshLight, QuadLight, SphereLight, Triangle};
pub use distant::{EnvironmentMap, Sun};
pub use emission::Emission;
pub use geometry::{Falloff, Incident, Source};
pub use lights::Lights;
pub(crate) use lights::Strong;
pub use picture::{LightImage, PictureLight, Projector, Throw};
pub use point::{PhongLight, PointLight, SpotLight};
pub(crate) use question::{Except, FromPoint, FromRay, Guess, Question, scattered};
pub use shadow_map::ShadowMap;
pub(crate) use tree::Kind;
pub use tree::{LightNode, LightTree};

use crate::math::{Bounds, Ray};
use crate::sampling::distance::Equiangular;
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
    /// A point that throws a picture.
    Projector(&'a Projector<'a>),
    /// A one-sided parallelogram or triangle that shows a picture.
    Picture(&'a PictureLight<'a>),
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
    /// A spot needs `0 ≤ beam ≤ cutoff ≤ π`, and a cutoff above 0; half angles of a projector are above 0° and below 90°.
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
            Self::Cone => "a spot needs 0 <= beam width <= cutoff angle <= pi and a cutoff above 0, a projector angles between 0 and 90 degrees",
            Self::Size => "the lent tables do not fit",
        })
    }
}

impl core::error::Error for LightError {}

/// Squared radius of a flat light's near field over its area.
///
/// Larger: more of the medium is reached by connections that know nothing of its density.
/// Smaller: collisions close to the light make outliers.
const NEAR_FLAT: f32 = 0.25;

/// The same for a sphere, which shines to all sides and is small where it matters: a lamp in fog.
const NEAR_SPHERE: f32 = 16.0;

/// The ball around a light in which its `1/r²` rules: see [`Light::near_field`].
///
/// ```
/// # use fogbow::{light::{Light, SphereLight}, math::{Ray, Vec3}, spectrum::Spectrum};
/// let lamp = Light::Sphere(SphereLight::new(Vec3::ZERO, 0.1, Spectrum::ONE).unwrap());
/// let field = lamp.near_field().unwrap();
/// let radius = field.radius().unwrap();
/// assert!(field.contains(0.99 * radius * Vec3::X) && !field.contains(1.01 * radius * Vec3::X));
/// let across = Ray::new(field.centre() - 5.0 * Vec3::X, Vec3::X);
/// let (near, far) = field.interval(&across, 0.0, f32::INFINITY).unwrap();
/// assert!((far - near - 2.0 * radius).abs() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearField {
    centre: Vec3,
    radius2: f32,
}

impl NearField {
    /// Its radius (m); `None` where it is all of space.
    #[inline]
    #[must_use]
    pub fn radius(&self) -> Option<f32> {
        self.radius2.is_finite().then(|| crate::math::float::sqrt(self.radius2))
    }

    /// Whether the point lies inside.
    #[inline]
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        // Written so that an infinite radius takes in everything.
        !(self.centre.distance_squared(point) >= self.radius2)
    }

    /// The part of `ray` between `near` and `far` (m) that lies inside; `None` if none does.
    #[inline]
    #[must_use]
    pub fn interval(&self, ray: &Ray, near: f32, far: f32) -> Option<(f32, f32)> {
        if self.radius2.is_infinite() {
            return Some((near, far));
        }
        let closest = ray.direction.dot(self.centre - ray.origin);
        let half2 = self.radius2 - ray.at(closest).distance_squared(self.centre);
        if half2 <= 0.0 {
            return None;
        }
        let half = crate::math::float::sqrt(half2);
        let (low, high) = ((closest - half).max(near), (closest + half).min(far));
        (high > low).then_some((low, high))
    }

    /// Centre (m).
    #[inline]
    #[must_use]
    pub fn centre(&self) -> Vec3 {
        self.centre
    }
}

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

/// Radiance (W·m⁻²·sr⁻¹) of all lights together that are a sky: see [`Light::is_sky`].
///
/// ```
/// # use fogbow::{light::{Light, Sun, sky}, math::Vec3, spectrum::Spectrum};
/// let lights = [Light::Constant(Spectrum::ONE), Light::Sun(Sun::new(Vec3::Y, Spectrum::ONE).unwrap())];
/// assert_eq!(sky(&lights, Vec3::Y), Spectrum::ONE);   // the sun's disc has no size
/// ```
#[inline]
#[must_use]
pub fn sky(lights: &[Light<'_>], to_light: Vec3) -> Spectrum {
    lights.iter().filter(|light| light.is_sky()).map(|light| light.background(to_light)).sum()
}

impl Light<'_> {
    /// Draws a point of the light, as seen from `from`. `None` where the light cannot reach.
    ///
    /// For lights with extent, what arrives is weighted by one over the density: its mean over `u` is the irradiance
    /// of the whole light.
    ///
    /// ```
    /// # use fogbow::{light::{Light, SphereLight}, math::{Vec2, Vec3}, spectrum::Spectrum};
    /// let lamp = Light::Sphere(SphereLight::new(5.0 * Vec3::Z, 1.0, Spectrum::splat(3.0)).unwrap());
    /// let sample = lamp.sample(Vec3::ZERO, Vec2::splat(0.5)).unwrap();
    /// assert!((sample.incident.irradiance[0] * sample.pdf - 3.0).abs() < 1e-5);   // radiance over density
    /// assert!(sample.incident.distance < 5.0);   // its near side
    /// assert!(lamp.sample(5.0 * Vec3::Z, Vec2::splat(0.5)).is_none());   // it does not shine inwards
    /// ```
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
            Self::Projector(light) => light.sample(from),
            Self::Picture(light) => light.sample(from, u),
            Self::Sun(light) => Some(distant::sample_sun(light)),
            Self::Constant(radiance) => Some(distant::sample_constant(*radiance, u)),
            Self::Environment(map) => map.sample(u),
        }
    }

    /// Density (sr⁻¹) with which [`Light::sample`] at `from` draws the direction `to_light`, where
    /// a ray meets the light after `distance` (m) at a surface with `normal`. 0 for point lights.
    ///
    /// ```
    /// # use fogbow::{light::{Light, QuadLight}, math::Vec3, spectrum::Spectrum};
    /// // A square metre ten metres above, which shines down.
    /// let lamp = Light::Quad(QuadLight::new(Vec3::new(-0.5, -0.5, 10.0), Vec3::Y, Vec3::X, Spectrum::ONE).unwrap());
    /// let pdf = lamp.pdf(Vec3::ZERO, Vec3::Z, 10.0, Vec3::NEG_Z);
    /// assert!((pdf - 100.0).abs() < 1e-3);   // one over the solid angle, A cos/r² = 1/100
    /// ```
    #[inline]
    #[must_use]
    pub fn pdf(&self, from: Vec3, to_light: Vec3, distance: f32, normal: Vec3) -> f32 {
        match self {
            Self::Point(_) | Self::Phong(_) | Self::Spot(_) | Self::Projector(_) | Self::Sun(_) => 0.0,
            Self::Quad(light) => light.pdf(from, to_light, distance),
            Self::Sphere(light) => light.pdf(from),
            Self::Mesh(light) => light.pdf(from, to_light, distance, normal),
            Self::Picture(light) => light.pdf(from, to_light, distance),
            Self::Constant(_) => crate::math::float::INV_FOUR_PI,
            Self::Environment(map) => map.pdf(to_light),
        }
    }

    /// Radiance (W·m⁻²·sr⁻¹) that an area light's surface with `normal` at `point` (m) sends towards `to_eye`;
    /// 0 from behind and for lights without a surface.
    ///
    /// ```
    /// # use fogbow::{light::{Light, QuadLight}, math::Vec3, spectrum::Spectrum};
    /// let lamp = Light::Quad(QuadLight::new(Vec3::ZERO, Vec3::X, Vec3::Y, Spectrum::ONE).unwrap());
    /// assert_eq!(lamp.radiance(Vec3::ZERO, Vec3::Z, Vec3::new(0.6, 0.0, 0.8)), Spectrum::ONE);   // the same in all directions
    /// assert_eq!(lamp.radiance(Vec3::ZERO, Vec3::Z, Vec3::NEG_Z), Spectrum::ZERO);   // from behind
    /// ```
    #[inline]
    #[must_use]
    pub fn radiance(&self, point: Vec3, normal: Vec3, to_eye: Vec3) -> Spectrum {
        let emitted = match self {
            Self::Quad(light) => light.radiance,
            Self::Sphere(light) => light.radiance,
            Self::Mesh(light) => light.radiance,
            Self::Picture(light) => light.radiance_at(point),
            _ => return Spectrum::ZERO,
        };
        if normal.dot(to_eye) > 0.0 { emitted } else { Spectrum::ZERO }
    }

    /// Radiance (W·m⁻²·sr⁻¹) that arrives from infinity along −`to_light`; 0 for lights within the
    /// world and for suns, whose disc has no size.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::Vec3, spectrum::Spectrum};
    /// let lamp = PointLight::new(Vec3::ZERO, Spectrum::ONE).unwrap();
    /// assert_eq!(Light::Constant(Spectrum::splat(0.5)).background(Vec3::X), Spectrum::splat(0.5));
    /// assert_eq!(Light::Point(lamp).background(Vec3::X), Spectrum::ZERO);
    /// ```
    #[inline]
    #[must_use]
    pub fn background(&self, to_light: Vec3) -> Spectrum {
        match self {
            Self::Constant(radiance) => *radiance,
            Self::Environment(map) => map.radiance(to_light),
            _ => Spectrum::ZERO,
        }
    }

    /// Whether it comes to a point from one direction: no direction that is drawn meets it, and one connection is as good as many.
    pub(crate) fn is_delta(&self) -> bool {
        match self {
            Self::Point(_) | Self::Phong(_) | Self::Spot(_) | Self::Projector(_) | Self::Sun(_) => true,
            Self::Quad(_) | Self::Sphere(_) | Self::Mesh(_) | Self::Picture(_) => false,
            Self::Constant(_) | Self::Environment(_) => false,
        }
    }

    /// Whether it shines evenly from everywhere around the world, so that directions which know nothing of it
    /// meet it well. Caches keep the light of such a sky, as that of surfaces infinitely far: a
    /// connection to it from every place would be noise wherever walls hide most of it.
    ///
    /// ```
    /// # use fogbow::{light::{Light, Sun}, math::Vec3, spectrum::Spectrum};
    /// assert!(Light::Constant(Spectrum::ONE).is_sky());
    /// assert!(!Light::Sun(Sun::new(Vec3::Y, Spectrum::ONE).unwrap()).is_sky());
    /// ```
    #[inline]
    #[must_use]
    pub fn is_sky(&self) -> bool {
        match self {
            Self::Constant(_) => true,
            Self::Environment(map) => map.is_even(),
            _ => false,
        }
    }

    /// The ball around a light of finite size within which connections from a medium should be
    /// spread along the ray instead of leaving from collisions: there `1/r²` rules the variance.
    /// Everything, for lights without extent; `None` for lights at infinity.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::Vec3, spectrum::Spectrum};
    /// let lamp = Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE).unwrap());
    /// let field = lamp.near_field().unwrap();
    /// assert_eq!((field.centre(), field.radius()), (Vec3::Z, None));   // all of space
    /// assert!(Light::Constant(Spectrum::ONE).near_field().is_none());
    /// ```
    #[inline]
    #[must_use]
    pub fn near_field(&self) -> Option<NearField> {
        let (centre, radius2) = match self {
            Self::Point(light) => (light.position, f32::INFINITY),
            Self::Phong(light) => (light.position, f32::INFINITY),
            Self::Spot(light) => (light.position, f32::INFINITY),
            Self::Quad(light) => (light.centre(), NEAR_FLAT * light.area()),
            Self::Sphere(light) => (light.centre, NEAR_SPHERE * light.area()),
            Self::Mesh(light) => (light.centre(), NEAR_FLAT * light.area()),
            Self::Projector(light) => (light.position, f32::INFINITY),
            Self::Picture(light) => (light.centre(), NEAR_FLAT * light.area()),
            Self::Sun(_) | Self::Constant(_) | Self::Environment(_) => return None,
        };
        Some(NearField { centre, radius2 })
    }

    /// The near field of a light whose sampled irradiance at a point has no bound, or hardly one: what
    /// cannot do without connections spread along rays. `None` for rectangles, which are sampled
    /// by the solid angle they are seen under; around their own points, spread connections
    /// have the heavier tail.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight, QuadLight}, math::Vec3, spectrum::Spectrum};
    /// let lamp = Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE).unwrap());
    /// let panel = Light::Quad(QuadLight::new(Vec3::ZERO, Vec3::X, Vec3::Y, Spectrum::ONE).unwrap());
    /// assert!(lamp.steep_field().is_some());
    /// assert!(panel.near_field().is_some() && panel.steep_field().is_none());
    /// ```
    #[inline]
    #[must_use]
    pub fn steep_field(&self) -> Option<NearField> {
        if matches!(self, Self::Quad(_)) { None } else { self.near_field() }
    }

    /// A point of the light to spread a connection around, before it is known where on a ray the
    /// connection starts. The source is `None` for a sphere, whose visible cap has to be sampled
    /// from there, and for a projector, whose picture decides what it sends there.
    ///
    /// ```
    /// # use fogbow::{light::{Light, QuadLight, SphereLight}, math::{Vec2, Vec3}, spectrum::Spectrum};
    /// let panel = Light::Quad(QuadLight::new(Vec3::ZERO, Vec3::X, Vec3::Y, Spectrum::ONE).unwrap());
    /// let (point, source) = panel.anchor(Vec2::splat(0.5)).unwrap();
    /// assert_eq!((point, source.unwrap().position), (Vec3::new(0.5, 0.5, 0.0), point));
    /// let ball = Light::Sphere(SphereLight::new(Vec3::Z, 0.1, Spectrum::ONE).unwrap());
    /// assert!(matches!(ball.anchor(Vec2::splat(0.5)), Some((Vec3::Z, None))));
    /// ```
    #[inline]
    #[must_use]
    pub fn anchor(&self, u: Vec2) -> Option<(Vec3, Option<Source>)> {
        let source = match self {
            Self::Point(light) => light.source(),
            Self::Phong(light) => light.source(),
            Self::Spot(light) => light.source(),
            Self::Quad(light) => light.anchor(u),
            Self::Mesh(light) => light.anchor(u)?,
            Self::Picture(light) => light.anchor(u)?,
            // What it sends depends on the direction.
            Self::Projector(light) => return Some((light.position, None)),
            Self::Sphere(light) => return Some((light.centre, None)),
            Self::Sun(_) | Self::Constant(_) | Self::Environment(_) => return None,
        };
        Some((source.position, Some(source)))
    }

    /// Density (sr⁻¹) at `from` of a point drawn by [`Light::anchor`]; arguments as [`Light::pdf`].
    ///
    /// ```
    /// # use fogbow::{light::{Light, QuadLight}, math::{Vec3, float::PI}, spectrum::Spectrum};
    /// // A square metre half a metre above: a face of the cube around the point, a sixth of all directions.
    /// let panel = Light::Quad(QuadLight::new(Vec3::new(-0.5, -0.5, 0.5), Vec3::Y, Vec3::X, Spectrum::ONE).unwrap());
    /// let anchored = panel.anchor_pdf(Vec3::ZERO, Vec3::Z, 0.5, Vec3::NEG_Z);
    /// let sampled = panel.pdf(Vec3::ZERO, Vec3::Z, 0.5, Vec3::NEG_Z);
    /// assert!((anchored - 0.25).abs() < 1e-6);   // uniform over the area: r²/(A cos)
    /// assert!((sampled - 6.0 / (4.0 * PI)).abs() < 1e-5);   // uniform over the solid angle
    /// ```
    #[inline]
    #[must_use]
    pub fn anchor_pdf(&self, from: Vec3, to_light: Vec3, distance: f32, normal: Vec3) -> f32 {
        match self {
            Self::Quad(light) => area::to_solid_angle(1.0 / light.area(), to_light, distance, normal),
            _ => self.pdf(from, to_light, distance, normal),
        }
    }

    /// The most radiant intensity (W/sr, mean of the channels) a light of finite size sends to a far
    /// point; 0 for lights at infinity.
    ///
    /// ```
    /// # use fogbow::{light::{Light, SphereLight}, math::{Vec3, float::PI}, spectrum::Spectrum};
    /// let ball = Light::Sphere(SphereLight::new(Vec3::ZERO, 0.5, Spectrum::splat(2.0)).unwrap());
    /// assert!((ball.intensity() - 2.0 * PI * 0.25).abs() < 1e-6);   // radiance times its disc, π r²
    /// assert_eq!(Light::Constant(Spectrum::ONE).intensity(), 0.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn intensity(&self) -> f32 {
        match self {
            Self::Point(light) => light.intensity.mean(),
            Self::Phong(light) => light.intensity.mean(),
            Self::Spot(light) => light.intensity.mean(),
            Self::Quad(light) => light.radiance.mean() * light.area(),
            Self::Sphere(light) => light.radiance.mean() * 0.25 * light.area(),
            Self::Mesh(light) => light.radiance.mean() * 0.5 * light.area(),
            Self::Projector(light) => light.most(),
            Self::Picture(light) => light.mean_radiance().mean() * light.area(),
            Self::Sun(_) | Self::Constant(_) | Self::Environment(_) => 0.0,
        }
    }

    /// The part of `ray` between `near` and `far` (m) that lies in the light's near field and that it
    /// can reach; `None` if there is none. Never too small: a spot's cone is a little widened.
    ///
    /// ```
    /// # use fogbow::{light::{Light, SpotLight}, math::{Ray, Vec3, float::PI}, spectrum::Spectrum};
    /// // A cone of 45° around +z, crossed one metre from its tip, where it is two metres wide.
    /// let spot = Light::Spot(SpotLight::new(Vec3::ZERO, Vec3::Z, 0.1, PI / 4.0, Spectrum::ONE).unwrap());
    /// let ray = Ray::new(Vec3::new(-5.0, 0.0, 1.0), Vec3::X);
    /// let (near, far) = spot.near_interval(&ray, 0.0, 10.0).unwrap();
    /// assert!(near <= 4.0 && far >= 6.0 && far - near < 2.01);
    /// ```
    #[inline]
    #[must_use]
    pub fn near_interval(&self, ray: &Ray, near: f32, far: f32) -> Option<(f32, f32)> {
        match self {
            Self::Spot(light) => light.lit_interval(ray, near, far),
            Self::Projector(light) => light.lit_interval(ray, near, far),
            _ => self.near_field()?.interval(ray, near, far),
        }
    }

    /// A box around all points (m) it shines from; at the origin for lights at infinity.
    fn bounds(&self) -> Bounds {
        match self {
            Self::Point(light) => Bounds::of([light.position]),
            Self::Phong(light) => Bounds::of([light.position]),
            Self::Spot(light) => Bounds::of([light.position]),
            Self::Projector(light) => Bounds::of([light.position]),
            Self::Quad(light) => {
                let (half, centre) = (light.edges().map(|edge| edge.abs() * 0.5), light.centre());
                Bounds { min: centre - half[0] - half[1], max: centre + half[0] + half[1] }
            }
            Self::Sphere(light) => Bounds { min: light.centre - light.radius, max: light.centre + light.radius },
            Self::Mesh(light) => light.bounds(),
            Self::Picture(light) => light.bounds(),
            Self::Sun(_) | Self::Constant(_) | Self::Environment(_) => Bounds::of([Vec3::ZERO]),
        }
    }

    /// What the light sends to the part of `ray` between `near` and `far` (m), one of [`Light::near_interval`], without
    /// fog or shadows: about `∫ I/r² dt` (W·m⁻¹·sr⁻¹, mean of the channels), as if all of it came from its middle; 0 for
    /// lights at infinity. By it, lights are chosen for connections along rays: one whose share is far too small makes
    /// outliers.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::{Ray, Vec3}, spectrum::Spectrum};
    /// let lamp = Light::Point(PointLight::new(Vec3::new(10.0, 0.0, 0.0), Spectrum::ONE).unwrap());
    /// // Straight towards the lamp, but only up to half the way: 1/5 − 1/10.
    /// let sent = lamp.sent_along(&Ray::new(Vec3::ZERO, Vec3::X), (0.0, 5.0));
    /// assert!((sent - 0.1).abs() < 1e-5);
    /// ```
    #[inline]
    #[must_use]
    pub fn sent_along(&self, ray: &Ray, (near, far): (f32, f32)) -> f32 {
        let Some(field) = self.near_field() else { return 0.0 };
        let Some(law) = Equiangular::new(ray.origin, ray.direction, field.centre(), near, far) else { return 0.0 };
        // A ray through the middle of a flat light is on the mean a quarter of its width away from where it shines.
        let most = match (self, field.radius()) {
            (Self::Quad(_) | Self::Mesh(_) | Self::Picture(_), Some(radius)) => 2.0 * crate::math::float::PI / radius,
            _ => f32::INFINITY,
        };
        // Capped, so that a sum over all lights stays a number.
        (self.intensity() * law.weight().min(most)).min(1e30)
    }

    /// A rough irradiance (mean of the channels) at `from` without fog or shadows: by it, lights
    /// are chosen. Positive wherever the light may contribute.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::Vec3, spectrum::Spectrum};
    /// let lamp = Light::Point(PointLight::new(Vec3::ZERO, Spectrum::new(1.0, 2.0, 3.0)).unwrap());
    /// assert_eq!(lamp.importance(2.0 * Vec3::X), 0.5);   // mean intensity over r²
    /// ```
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
            Self::Projector(light) => light.importance(from),
            Self::Picture(light) => light.importance(from),
            Self::Sun(light) => light.irradiance.mean(),
            Self::Constant(radiance) => radiance.mean() * 4.0 * crate::math::float::PI,
            Self::Environment(map) => map.mean_radiance().mean() * 4.0 * crate::math::float::PI,
        }
    }

    /// Radiant power (W) emitted into a scene within `bounds`, which is all that lights at infinity shine through. Environment maps count as if they were even.
    ///
    /// ```
    /// # use fogbow::{light::{Light, Sun}, math::{Bounds, Vec3, float::PI}, spectrum::Spectrum};
    /// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(2.0, 1.0, 1.0) };
    /// let sun = Light::Sun(Sun::new(Vec3::Y, Spectrum::splat(1000.0)).unwrap());
    /// assert_eq!(sun.power(&bounds)[0], 2000.0);
    /// let sky = Light::Constant(Spectrum::ONE);
    /// assert!((sky.power(&bounds)[0] - 10.0 * PI).abs() < 1e-5);   // π of each square metre outside
    /// ```
    #[must_use]
    pub fn power(&self, bounds: &Bounds) -> Spectrum {
        use crate::math::float::PI;
        let faces = emission::faces(bounds.size());
        match self {
            Self::Point(light) => light.intensity * (4.0 * PI),
            Self::Phong(light) => light.power(),
            Self::Spot(light) => light.power(),
            Self::Quad(light) => light.radiance * (PI * light.area()),
            Self::Sphere(light) => light.radiance * (PI * light.area()),
            Self::Mesh(light) => light.radiance * (PI * light.area()),
            Self::Projector(light) => light.power(),
            Self::Picture(light) => light.mean_radiance() * (PI * light.area()),
            Self::Sun(light) => light.irradiance * faces.dot(light.to_light.abs()),
            Self::Constant(radiance) => *radiance * (2.0 * PI * faces.element_sum()),
            Self::Environment(map) => map.mean_radiance() * (2.0 * PI * faces.element_sum()),
        }
    }
}
