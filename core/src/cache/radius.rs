//! How far a record may be used: Jarosz et al. 2008, Eq. 31–34; sheet § 1.9.

use glam::{Vec2, Vec3};

use crate::host::Scene;
use crate::math::Ray;
use crate::sampling::warp;
use crate::single_scatter::{Sums, lattice};
use crate::spectrum::{Gradient, Spectrum};
use crate::world::{leave, nearest_surface};

/// Bounds of radii (m), in the world.
///
/// Bounds on the screen become bounds in the world at the record's distance from the eye:
///
/// ```
/// # use fogbow::cache::Limits;
/// // 0.01 m to 2 m; 1 to 100 pixels, pixels being 0.001 rad wide, at 50 m.
/// let limits = Limits { min: 0.01, max: 2.0 }.on_screen(1.0, 100.0, 0.001, 50.0);
/// assert_eq!((limits.min, limits.max), (0.05, 2.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Least radius: smaller, and borders of shadows swallow all records.
    pub min: f32,
    /// Greatest radius: larger, and a record may reach behind what it knows nothing of.
    pub max: f32,
}

impl Limits {
    /// Narrowed to between `least` and `most` pixels of angular width `pixel` (rad), seen from
    /// `distance` (m). The world's bounds win.
    #[must_use]
    pub fn on_screen(self, least: f32, most: f32, pixel: f32, distance: f32) -> Self {
        let footprint = pixel * distance;
        let max = (most * footprint).clamp(self.min, self.max);
        Self { min: (least * footprint).clamp(self.min, max), max }
    }

    /// Narrowed to at most `reach` (m). The least radius wins.
    ///
    /// ```
    /// # use fogbow::cache::Limits;
    /// let limits = Limits { min: 0.1, max: 2.0 };
    /// assert_eq!(limits.within(0.5), Limits { min: 0.1, max: 0.5 });
    /// assert_eq!(limits.within(0.01), Limits { min: 0.1, max: 0.1 });
    /// ```
    #[must_use]
    pub fn within(self, reach: f32) -> Self {
        Self { max: self.max.min(reach).max(self.min), ..self }
    }

    /// A radius within the bounds; the greatest where none is defined.
    ///
    /// ```
    /// # use fogbow::cache::Limits;
    /// let limits = Limits { min: 0.1, max: 2.0 };
    /// let radii = [Some(0.01), Some(0.5), Some(9.0), None].map(|raw| limits.clamp(raw));
    /// assert_eq!(radii, [0.1, 0.5, 2.0, 2.0]);
    /// ```
    #[must_use]
    pub fn clamp(&self, raw: Option<f32>) -> f32 {
        raw.map_or(self.max, |r| r.max(self.min).min(self.max))
    }
}

/// `R = ε Σ L_j / Σ ‖∇L_j‖` (m), least over channels and over the sums with and without shadows.
///
/// `None` where no channel has a gradient: nothing bounds the radius then. 0 where a channel is
/// black but could change. Source: Jarosz et al. 2008, Eq. 34 (its Eq. 31 is a relative L1 error,
/// not L2); undefined cases: sheet § 1.9.
///
/// ```
/// # use fogbow::{cache::valid_radius, math::Vec3, single_scatter::{Contribution, Sums}};
/// # use fogbow::spectrum::{Gradient, Spectrum};
/// let slope = |axis| Contribution { radiance: Spectrum::ONE, gradient: Gradient::outer(Spectrum::ONE, axis) };
/// let mut sums = Sums::default();
/// assert_eq!(valid_radius(&sums, 0.5), None);
/// sums.add(&slope(Vec3::X), true);
/// sums.add(&slope(Vec3::NEG_X), true);   // a saddle: the log-gradient vanishes, the radius does not diverge
/// assert_eq!(valid_radius(&sums, 0.5), Some(0.5));
/// ```
#[must_use]
pub fn valid_radius(sums: &Sums, tolerance: f32) -> Option<f32> {
    let mut least: Option<f32> = None;
    let variants = [(sums.value, sums.gradient_norms), (sums.unshadowed, sums.unshadowed_gradient_norms)];
    for (value, norms) in variants {
        for channel in 0..3 {
            if norms[channel] > 0.0 {
                let radius = tolerance * (value[channel].max(0.0) / norms[channel]);
                least = Some(least.map_or(radius, |l| l.min(radius)));
            }
        }
    }
    least
}

/// Directions that look for surfaces.
const DIRECTIONS: u32 = 96;

/// Less than this above a surface's plane, directions meet the surface itself where it is curved.
const GRAZING: f32 = 0.1;

/// Distance (m) from `point` to the nearest surface, as far as evenly spread directions tell: all around
/// in the medium, above the plane for a point on a surface with `normal` (unit). Infinite where none is met.
///
/// Never too small; for a plane wall too large by 5 % at most, as no direction is more than 17° from one that is
/// looked in, and by 14 % for a wall upright on the surface. What is smaller than such a gap may be missed.
///
/// Light falls off towards a wall or into a corner in ways that gradients farther away do not foretell,
/// and whose sphere reaches there leaves no room for a record that would know: so radii are limited by it.
/// Source: as the harmonic mean distance of Ward et al. 1988, *A Ray Tracing Solution for Diffuse
/// Interreflection*, but the least one.
///
/// ```
/// # use fogbow::{cache::clearance, host::{Empty, Hit, Scene}, math::{Ray, Vec3}, surface::Surface};
/// struct Floor;   // at z = 0
/// impl Scene for Floor {
///     fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
///         let distance = -ray.origin.z / ray.direction.z;
///         let hit = Hit { distance, normal: Vec3::Z, shading: Vec3::Z, surface: Surface::BLACK, light: None };
///         (distance > 0.0 && distance < ray.length).then_some(hit)
///     }
/// }
/// let height = clearance(2.0 * Vec3::Z, None, &Floor);
/// assert!((2.0..2.0 * 1.05).contains(&height));
/// assert_eq!(clearance(Vec3::ZERO, None, &Empty), f32::INFINITY);
/// ```
#[must_use]
pub fn clearance(point: Vec3, normal: Option<Vec3>, scene: &(impl Scene + ?Sized)) -> f32 {
    let distance = |j| {
        let direction = warp::uniform_sphere(lattice(j, DIRECTIONS, Vec2::ZERO));
        let origin = match normal {
            Some(normal) if normal.dot(direction) < GRAZING => return f32::INFINITY,
            Some(normal) => leave(point, normal, direction, 0.0),
            None => point,
        };
        nearest_surface(&Ray::new(origin, direction), scene).map_or(f32::INFINITY, |hit| hit.distance)
    };
    (0..DIRECTIONS).map(distance).fold(f32::INFINITY, f32::min)
}

/// The radius that the plain logarithmic gradient would give, `ε L/‖∇L‖` (m): infinite at saddle
/// points, which is why Eq. 34 adds norms. For comparison only (Jarosz et al. 2008, Fig. 4).
///
/// ```
/// # use fogbow::{cache::log_gradient_radius, math::Vec3, spectrum::{Gradient, Spectrum}};
/// let slope = Gradient::outer(Spectrum::new(1.0, 2.0, 4.0), Vec3::X);
/// assert_eq!(log_gradient_radius(Spectrum::ONE, &slope, 0.5), 0.125);   // of the channel that changes most
/// assert_eq!(log_gradient_radius(Spectrum::ONE, &Gradient::ZERO, 0.5), f32::INFINITY);
/// ```
#[must_use]
pub fn log_gradient_radius(value: Spectrum, gradient: &Gradient, tolerance: f32) -> f32 {
    value.zip(gradient.norm(), |l, g| if g > 0.0 { tolerance * (l / g) } else { f32::INFINITY }).min_element()
}

/// A gradient no steeper than `L/radius` in every channel: what was widened to the least radius
/// must not explode within it (Křivánek et al. 2006).
///
/// ```
/// # use fogbow::{cache::clamp_gradient, math::Vec3, spectrum::{Gradient, Spectrum}};
/// let steep = Gradient::outer(Spectrum::splat(8.0), Vec3::X);
/// let clamped = clamp_gradient(&steep, Spectrum::ONE, 0.25);
/// assert_eq!(clamped.x, Spectrum::splat(4.0));   // not below 0 within 0.25 m
/// ```
#[must_use]
pub fn clamp_gradient(gradient: &Gradient, value: Spectrum, radius: f32) -> Gradient {
    let norm = gradient.norm();
    let scale = value.zip(norm, |l, g| if g * radius > l { l / (g * radius) } else { 1.0 });
    *gradient * scale
}

/// The radius that neighbours allow: `R ≤ R_j + ‖x − x_j‖` for each of them (Křivánek et al. 2006,
/// neighbour clamping). A small radius beside a large one tells of something the large one missed.
///
/// ```
/// # use fogbow::{cache::neighbour_clamped, math::Vec3};
/// // Half a metre away light changes within 0.1 m.
/// assert_eq!(neighbour_clamped(2.0, Vec3::ZERO, (0.5 * Vec3::X, 0.1)), 0.6);
/// ```
#[inline]
#[must_use]
pub fn neighbour_clamped(radius: f32, position: Vec3, other: (Vec3, f32)) -> f32 {
    radius.min(other.1 + position.distance(other.0))
}
