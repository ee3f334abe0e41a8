//! Lights with extent. Radiance is in W·m⁻²·sr⁻¹, the same in all directions of the front side.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

use super::geometry::{Falloff, Incident, Source};
use super::{LightError, LightSample};
use crate::math::float::{self, PI};
use crate::math::{Bounds, Frame};
use crate::sampling::{discrete, warp};
use crate::spectrum::Spectrum;

/// A sample of a surface point, given its density over area (m⁻²). `None` seen from behind.
#[inline]
pub(super) fn surface_sample(
    from: Vec3,
    position: Vec3,
    normal: Vec3,
    radiance: Spectrum,
    pdf_area: f32,
) -> Option<LightSample> {
    let offset = position - from;
    let distance_squared = offset.length_squared();
    let distance = float::sqrt(distance_squared);
    if !(distance > super::geometry::MIN_DISTANCE) {
        return None;
    }
    let to_light = offset / distance;
    let cosine = -normal.dot(to_light);
    if cosine <= 0.0 {
        return None;
    }
    let source = Source { position, normal, weight: radiance / pdf_area, falloff: Falloff::Area };
    let pdf = pdf_area * distance_squared / cosine;
    Some(LightSample { source, incident: Incident { to_light, distance, irradiance: radiance / pdf }, pdf })
}

/// A density over area (m⁻²) as one over solid angle (sr⁻¹); 0 from behind.
#[inline]
pub(super) fn to_solid_angle(pdf_area: f32, to_light: Vec3, distance: f32, normal: Vec3) -> f32 {
    let cosine = -normal.dot(to_light);
    if cosine <= 0.0 { 0.0 } else { pdf_area * distance * distance / cosine }
}

pub(super) fn importance(radiance: Spectrum, area: f32, centre: Vec3, from: Vec3) -> f32 {
    // Near the light the inverse square overshoots; a hemisphere full of light is the most there is.
    radiance.mean() * (area / centre.distance_squared(from).max(1e-30)).min(2.0 * PI)
}

/// A parallelogram that shines to the side of its normal `edge_u × edge_v`.
///
/// ```
/// # use fogbow::{light::QuadLight, math::Vec3, spectrum::Spectrum};
/// let panel = QuadLight::new(Vec3::ZERO, 2.0 * Vec3::X, Vec3::Y, Spectrum::ONE).unwrap();
/// assert_eq!((panel.area(), panel.normal()), (2.0, Vec3::Z));
/// assert_eq!((panel.centre(), panel.edges()), (Vec3::new(1.0, 0.5, 0.0), [2.0 * Vec3::X, Vec3::Y]));
/// assert!(QuadLight::new(Vec3::ZERO, Vec3::X, Vec3::X, Spectrum::ONE).is_err());   // no area
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadLight {
    corner: Vec3,
    edge_u: Vec3,
    edge_v: Vec3,
    normal: Vec3,
    area: f32,
    /// Squared distance from the centre within which the solid angle is sampled; 0 for shapes that
    /// are no rectangles.
    solid_within: f32,
    /// Radiance (W·m⁻²·sr⁻¹).
    pub radiance: Spectrum,
}

impl QuadLight {
    /// From a corner and two edges (m).
    ///
    /// # Errors
    /// Values that are not finite, a negative radiance, edges that span no area.
    pub fn new(corner: Vec3, edge_u: Vec3, edge_v: Vec3, radiance: Spectrum) -> Result<Self, LightError> {
        if !radiance.is_valid() {
            return Err(LightError::Emission);
        }
        if !(corner.is_finite() && edge_u.is_finite() && edge_v.is_finite()) {
            return Err(LightError::Geometry);
        }
        let cross = edge_u.cross(edge_v);
        let area = cross.length();
        let normal = cross.try_normalize().filter(|_| area.is_finite()).ok_or(LightError::NoArea)?;
        let is_rectangle = edge_u.dot(edge_v).abs() <= 1e-5 * edge_u.length() * edge_v.length();
        let solid_within = if is_rectangle { NEAR * (edge_u.length_squared() + edge_v.length_squared()) } else { 0.0 };
        Ok(Self { corner, edge_u, edge_v, normal, area, solid_within, radiance })
    }

    /// The two edges (m).
    #[inline]
    #[must_use]
    pub fn edges(&self) -> [Vec3; 2] {
        [self.edge_u, self.edge_v]
    }

    /// Area (m²).
    #[must_use]
    pub fn area(&self) -> f32 {
        self.area
    }

    /// The side it shines to (unit).
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Centre (m).
    #[must_use]
    pub fn centre(&self) -> Vec3 {
        self.corner + (self.edge_u + self.edge_v) * 0.5
    }

    #[inline]
    pub(super) fn anchor(&self, u: Vec2) -> Source {
        let position = self.corner + self.edge_u * u.x + self.edge_v * u.y;
        Source { position, normal: self.normal, weight: self.radiance * self.area, falloff: Falloff::Area }
    }

    /// Near a rectangle the solid angle is sampled, farther away the area: there both agree, and
    /// the area costs a tenth.
    #[inline]
    fn seen_from(&self, from: Vec3) -> Option<SolidRectangle> {
        if self.centre().distance_squared(from) < self.solid_within { SolidRectangle::new(self, from) } else { None }
    }

    #[inline]
    pub(super) fn sample(&self, from: Vec3, u: Vec2) -> Option<LightSample> {
        if self.normal.dot(from - self.corner) <= 0.0 {
            return None;
        }
        if let Some(seen) = self.seen_from(from) {
            let position = seen.sample(u);
            let offset = position - from;
            let distance = offset.length();
            let to_light = offset / distance;
            let cosine = (-self.normal.dot(to_light)).max(1e-6);
            let pdf = 1.0 / seen.solid_angle;
            let weight = self.radiance * (distance * distance / (pdf * cosine));
            let source = Source { position, normal: self.normal, weight, falloff: Falloff::Area };
            return Some(LightSample {
                source,
                incident: Incident { to_light, distance, irradiance: self.radiance * seen.solid_angle },
                pdf,
            });
        }
        surface_sample(from, self.anchor(u).position, self.normal, self.radiance, 1.0 / self.area)
    }

    #[inline]
    pub(super) fn pdf(&self, from: Vec3, to_light: Vec3, distance: f32) -> f32 {
        if self.normal.dot(from - self.corner) <= 0.0 {
            return 0.0;
        }
        match self.seen_from(from) {
            Some(seen) => 1.0 / seen.solid_angle,
            None => to_solid_angle(1.0 / self.area, to_light, distance, self.normal),
        }
    }

    pub(super) fn importance(&self, from: Vec3) -> f32 {
        if self.normal.dot(from - self.corner) <= 0.0 {
            return 0.0;
        }
        importance(self.radiance, self.area, self.centre(), from)
    }
}

/// Squared distance, in squared diagonals, within which the solid angle of a rectangle is sampled.
const NEAR: f32 = 1.5;

/// A rectangle seen from a point: uniform sampling of its solid angle (Ureña et al. 2013, "An
/// Area-Preserving Parametrization for Spherical Rectangles").
#[derive(Debug, Clone, Copy)]
struct SolidRectangle {
    from: Vec3,
    axes: [Vec3; 3],
    x: [f32; 2],
    y: [f32; 2],
    z: f32,
    b: [f32; 2],
    k: f32,
    solid_angle: f32,
}

impl SolidRectangle {
    #[inline]
    fn new(quad: &QuadLight, from: Vec3) -> Option<Self> {
        let (width, height) = (quad.edge_u.length(), quad.edge_v.length());
        let (ax, ay) = (quad.edge_u / width, quad.edge_v / height);
        let d = quad.corner - from;
        // The side of the light that shines has its normal towards `from`: z < 0.
        let (x0, y0, z) = (d.dot(ax), d.dot(ay), d.dot(quad.normal));
        if z > -1e-6 * (width + height) {
            return None;
        }
        let (x1, y1) = (x0 + width, y0 + height);
        // Normals of the four side planes; each has one zero component.
        let side = |edge: f32| 1.0 / float::sqrt(z * z + edge * edge);
        let (n0z, n1z, n2z, n3z) = (-y0 * side(y0), x1 * side(x1), y1 * side(y1), -x0 * side(x0));
        let angle = |a: f32, b: f32| float::acos(-a * b);
        let (g0, g1) = (angle(n0z, n1z), angle(n1z, n2z));
        let (g2, g3) = (angle(n2z, n3z), angle(n3z, n0z));
        let k = 2.0 * PI - g2 - g3;
        let solid_angle = g0 + g1 - k;
        // Below, cancellation in the sum of angles would show; area sampling is as good there.
        (solid_angle > 0.02).then_some(Self {
            from,
            axes: [ax, ay, quad.normal],
            x: [x0, x1],
            y: [y0, y1],
            z,
            b: [n0z, n2z],
            k,
            solid_angle,
        })
    }

    #[inline]
    fn sample(&self, u: Vec2) -> Vec3 {
        let (sin, cos) = float::sin_cos(u.x * self.solid_angle + self.k);
        let f = (cos * self.b[0] - self.b[1]) / sin;
        let c = (1.0 / float::sqrt(f * f + self.b[0] * self.b[0])).copysign(f).clamp(-1.0, 1.0);
        let x = (-c * self.z / float::safe_sqrt(1.0 - c * c).max(1e-6)).clamp(self.x[0], self.x[1]);
        let d = float::sqrt(x * x + self.z * self.z);
        let h = |y: f32| y / float::sqrt(d * d + y * y);
        let (h0, h1) = (h(self.y[0]), h(self.y[1]));
        let v = h0 + u.y * (h1 - h0);
        let y = if v * v < 1.0 - 1e-6 { v * d / float::sqrt(1.0 - v * v) } else { self.y[1] };
        let y = y.clamp(self.y[0], self.y[1]);
        self.from + self.axes[0] * x + self.axes[1] * y + self.axes[2] * self.z
    }
}

/// A sphere that shines outwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereLight {
    /// Centre (m).
    pub centre: Vec3,
    /// Radius (m).
    pub radius: f32,
    /// Radiance (W·m⁻²·sr⁻¹).
    pub radiance: Spectrum,
}

impl SphereLight {
    /// From centre and radius (m) and radiance (W·m⁻²·sr⁻¹).
    ///
    /// # Errors
    /// Values that are not finite, a negative radiance, a radius that is not positive.
    ///
    /// ```
    /// # use fogbow::{light::{LightError, SphereLight}, math::Vec3, spectrum::Spectrum};
    /// assert!(SphereLight::new(Vec3::ZERO, 0.1, Spectrum::ONE).is_ok());
    /// assert_eq!(SphereLight::new(Vec3::ZERO, 0.0, Spectrum::ONE), Err(LightError::NoArea));
    /// ```
    pub fn new(centre: Vec3, radius: f32, radiance: Spectrum) -> Result<Self, LightError> {
        if !radiance.is_valid() {
            return Err(LightError::Emission);
        }
        if !(centre.is_finite() && radius.is_finite()) {
            return Err(LightError::Geometry);
        }
        if radius <= 0.0 {
            return Err(LightError::NoArea);
        }
        Ok(Self { centre, radius, radiance })
    }

    /// Area (m²).
    ///
    /// ```
    /// # use fogbow::{light::SphereLight, math::{Vec3, float::PI}, spectrum::Spectrum};
    /// let ball = SphereLight::new(Vec3::ZERO, 0.5, Spectrum::ONE).unwrap();
    /// assert!((ball.area() - PI).abs() < 1e-6);   // 4π r²
    /// ```
    #[must_use]
    pub fn area(&self) -> f32 {
        4.0 * PI * self.radius * self.radius
    }

    /// `1 − cos` of the half angle under which the sphere is seen; `None` from inside and from
    /// where it is a point.
    #[inline]
    fn cone(&self, from: Vec3) -> Option<f32> {
        let sine2 = self.radius * self.radius / self.centre.distance_squared(from);
        // So far away that a cone is no number any more, nothing arrives.
        (sine2 < 1.0 && sine2 > 1e-36).then(|| sine2 / (1.0 + float::sqrt(1.0 - sine2)))
    }

    /// Samples the visible cap uniformly in solid angle.
    #[inline]
    pub(super) fn sample(&self, from: Vec3, u: Vec2) -> Option<LightSample> {
        let one_minus_cos = self.cone(from)?;
        let pdf = warp::uniform_cone_pdf(one_minus_cos);
        let axis = self.centre - from;
        let reach = axis.length();
        let local = warp::uniform_cone(u, one_minus_cos);
        let to_light = Frame::around(axis / reach).to_world(local).normalize();
        // Distance to the nearer of the two points where the direction meets the sphere.
        let sine2 = local.x * local.x + local.y * local.y;
        let distance = reach * local.z - float::safe_sqrt(self.radius * self.radius - reach * reach * sine2);
        let position = from + to_light * distance;
        let normal = (position - self.centre).normalize_or(-to_light);
        let cosine = (-normal.dot(to_light)).max(1e-4);
        let weight = self.radiance * (distance * distance / (cosine * pdf));
        let source = Source { position, normal, weight, falloff: Falloff::Area };
        Some(LightSample { source, incident: Incident { to_light, distance, irradiance: self.radiance / pdf }, pdf })
    }

    #[inline]
    pub(super) fn pdf(&self, from: Vec3) -> f32 {
        self.cone(from).map_or(0.0, warp::uniform_cone_pdf)
    }

    pub(super) fn importance(&self, from: Vec3) -> f32 {
        importance(self.radiance, PI * self.radius * self.radius, self.centre, from)
    }
}

/// A triangle of a light.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Triangle {
    /// Corners (m); the normal is `(b − a) × (c − a)`.
    pub corners: [Vec3; 3],
}

impl Triangle {
    /// The normal, as long as twice the area.
    ///
    /// ```
    /// # use fogbow::{light::Triangle, math::Vec3};
    /// let half = Triangle { corners: [Vec3::ZERO, Vec3::X, Vec3::Y] };
    /// assert_eq!(half.cross(), Vec3::Z);   // area ½
    /// ```
    #[must_use]
    pub fn cross(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }
}

/// Triangles that shine to the side of their normals. Samples for a place come, evenly over area, from those that face it, if they are 16 in all at most; else from all.
///
/// ```
/// # use fogbow::{light::{MeshLight, Triangle}, math::Vec3, spectrum::Spectrum};
/// let corner = Vec3::new(1.0, 1.0, 0.0);
/// let square = [[Vec3::ZERO, Vec3::X, corner], [Vec3::ZERO, corner, Vec3::Y]].map(|corners| Triangle { corners });
/// let mut table = [0.0; 2];
/// let lamp = MeshLight::new(&square, &mut table, Spectrum::ONE).unwrap();
/// assert_eq!((lamp.area(), lamp.centre()), (1.0, corner * 0.5));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshLight<'a> {
    triangles: &'a [Triangle],
    areas: &'a [f32],
    area: f32,
    centre: Vec3,
    /// Radiance (W·m⁻²·sr⁻¹).
    pub radiance: Spectrum,
}

/// Triangles up to which it is known which face a point. More: time of each sample; fewer: samples of what nobody sees.
const FACED: usize = 16;

impl<'a> MeshLight<'a> {
    /// From triangles and a lent table of as many entries.
    ///
    /// # Errors
    /// Values that are not finite, a negative radiance, no area, a table of another size.
    pub fn new(triangles: &'a [Triangle], table: &'a mut [f32], radiance: Spectrum) -> Result<Self, LightError> {
        if !radiance.is_valid() {
            return Err(LightError::Emission);
        }
        if table.len() != triangles.len() {
            return Err(LightError::Size);
        }
        let mut centre = Vec3::ZERO;
        for (slot, triangle) in table.iter_mut().zip(triangles) {
            *slot = 0.5 * triangle.cross().length();
            if !slot.is_finite() {
                return Err(LightError::Geometry);
            }
            centre += triangle.corners.iter().sum::<Vec3>() * (*slot / 3.0);
        }
        let area = discrete::cumulate(table);
        if area <= 0.0 {
            return Err(LightError::NoArea);
        }
        Ok(Self { triangles, areas: table, area, centre: centre / area, radiance })
    }

    /// Area (m²).
    #[must_use]
    pub fn area(&self) -> f32 {
        self.area
    }

    /// Centre of gravity (m).
    #[must_use]
    pub fn centre(&self) -> Vec3 {
        self.centre
    }

    pub(super) fn bounds(&self) -> Bounds {
        Bounds::of(self.triangles.iter().flat_map(|triangle| triangle.corners))
    }

    #[inline]
    pub(super) fn anchor(&self, u: Vec2) -> Option<Source> {
        let choice = discrete::choose_cumulated(self.areas, u.x);
        let (position, normal) = self.point(choice.index, Vec2::new(choice.remainder, u.y))?;
        Some(Source { position, normal, weight: self.radiance * self.area, falloff: Falloff::Area })
    }

    /// A point of a triangle, and the normal.
    fn point(&self, index: usize, u: Vec2) -> Option<(Vec3, Vec3)> {
        let triangle = &self.triangles[index];
        let [a, b, c] = triangle.corners;
        let at = warp::uniform_triangle(u);
        Some((a + (b - a) * at.x + (c - a) * at.y, triangle.cross().try_normalize()?))
    }

    /// Areas (m²) of triangles, of those that are seen from behind 0; of none where they are too many to be looked at.
    fn seen(&self, from: Vec3) -> heapless::Vec<f32, FACED> {
        let (mut seen, mut below) = (heapless::Vec::new(), 0.0);
        if self.triangles.len() > FACED {
            return seen;
        }
        for (triangle, sum) in self.triangles.iter().zip(self.areas) {
            let faces = triangle.cross().dot(from - triangle.corners[0]) > 0.0;
            let _ = seen.push(if faces { (sum - below) * self.area } else { 0.0 });
            below = *sum;
        }
        seen
    }

    #[inline]
    pub(super) fn sample(&self, from: Vec3, u: Vec2) -> Option<LightSample> {
        let seen = self.seen(from);
        if seen.is_empty() {
            let Source { position, normal, .. } = self.anchor(u)?;
            return surface_sample(from, position, normal, self.radiance, 1.0 / self.area);
        }
        let ((), choice) = discrete::choose(seen.iter().map(|area| (*area, ())), u.x)?;
        let (position, normal) = self.point(choice.index, Vec2::new(choice.remainder, u.y))?;
        surface_sample(from, position, normal, self.radiance, 1.0 / seen.iter().sum::<f32>())
    }

    #[inline]
    pub(super) fn pdf(&self, from: Vec3, to_light: Vec3, distance: f32, normal: Vec3) -> f32 {
        let seen = self.seen(from);
        let area = if seen.is_empty() { self.area } else { seen.iter().sum() };
        if area > 0.0 { to_solid_angle(1.0 / area, to_light, distance, normal) } else { 0.0 }
    }

    pub(super) fn importance(&self, from: Vec3) -> f32 {
        // Nothing is known of the normals: half the area faces any point.
        importance(self.radiance, 0.5 * self.area, self.centre, from)
    }
}
