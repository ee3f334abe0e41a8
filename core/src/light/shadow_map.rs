//! How far the rays of a lamp come: where smoke lies in its light, and where in the shadow of surfaces.

use glam::{Mat3, Vec3};

use super::Light;
use crate::host::Scene;
use crate::host::passing::nearest_surface;
use crate::math::{Frame, Ray, float};
use crate::storage::List;

/// The map of a cone is widened until its rim has this tangent, so that the cone fills most of the octahedron; wider cones have the map of all directions. Larger: texels are
/// wider in the middle of a cone than at its rim; smaller: more of the map lies outside the cone.
const SPREAD: f32 = 3.0;

/// Distances from a lamp to what stops its light, by direction: a shadow map (Williams 1978).
///
/// Estimators draw points of a ray by it (`world::near`): most of a ray through a shaft of light lies in shadow. What it says need not be right
/// everywhere; whether a point is lit is always asked of the scene.
///
/// ```
/// # use fogbow::{host::{Hit, Scene}, light::{Light, PointLight, ShadowMap}, math::{Ray, Vec3}, spectrum::Spectrum, surface::Surface};
/// /// A floor at height 0.
/// struct Floor;
/// impl Scene for Floor {
///     fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
///         let distance = -ray.origin.z / ray.direction.z;
///         let hit = Hit { distance, normal: Vec3::Z, shading: Vec3::Z, surface: Surface::BLACK, light: None };
///         (distance > 0.0 && distance < ray.length).then_some(hit)
///     }
/// }
/// let lamp = Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?);
/// let mut memory = [0.0; 32 * 32];
/// let map = ShadowMap::new(&lamp, &Floor, 32, &mut memory[..]).unwrap();
/// assert!(map.is_lit(Vec3::new(0.5, 0.0, 0.4)) && !map.is_lit(Vec3::new(0.5, 0.0, -0.4)));
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[derive(Debug)]
pub struct ShadowMap<'s> {
    centre: Vec3,
    /// To the map's axes, in which a narrow cone is wide.
    to_map: Mat3,
    side: u16,
    /// Squared distances (m²), row by row.
    reach2: List<'s, f32>,
}

/// Each texel becomes the farthest of itself and its neighbours: what is lit must not be missed, what is in shadow may be.
fn widen(texels: &mut [f32], side: usize) {
    let line = |texels: &mut [f32], first: usize, step: usize| {
        let mut before = 0.0;
        for k in 0..side {
            let at = first + k * step;
            let own = texels[at];
            let after = if k + 1 < side { texels[at + step] } else { 0.0 };
            texels[at] = own.max(before).max(after);
            before = own;
        }
    };
    for k in 0..side {
        line(texels, k * side, 1);
    }
    for k in 0..side {
        line(texels, k, side);
    }
}

impl<'s> ShadowMap<'s> {
    /// Of more lights than these, maps are of no use: rays are then joined to one after the other that is chosen without them.
    pub const MOST_LIGHTS: usize = 8;

    /// Of `light` among the surfaces of `scene`, with `side`² texels: as many rays and floats of `memory`. Directions are folded onto a square as an
    /// octahedron (Meyer et al. 2010). `None` for lights that shine from more than a point, and where memory is lent and too small.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, ShadowMap}, spectrum::Spectrum};
    /// assert!(ShadowMap::new(&Light::Constant(Spectrum::ONE), &Empty, 4, &mut [0.0; 16][..]).is_none());
    /// ```
    #[must_use]
    pub fn new<S: Scene + ?Sized>(
        light: &Light<'_>,
        scene: &S,
        side: u16,
        memory: impl Into<List<'s, f32>>,
    ) -> Option<Self> {
        let (axis, tangent) = match light {
            Light::Point(_) | Light::Phong(_) => (Vec3::Z, f32::INFINITY),
            Light::Spot(spot) => {
                (spot.axis, if spot.cutoff() < 1.5 { float::tan(spot.cutoff()) } else { f32::INFINITY })
            }
            Light::Projector(projector) => projector.cone(),
            _ => return None,
        };
        let centre = light.near_field()?.centre();
        let frame = Frame::around(axis);
        let across = (tangent / SPREAD).min(1.0);
        let to_world = Mat3::from_cols(frame.u * across, frame.v * across, frame.w);
        let to_map = Mat3::from_cols(frame.u / across, frame.v / across, frame.w).transpose();
        let mut reach2 = memory.into();
        reach2.reset(side as usize * side as usize, 0.0).ok()?;
        let width = u32::from(side);
        for (i, texel) in (0_u32..).zip(reach2.as_mut_slice()) {
            let at = |k: u32| (k as f32 + 0.5) * 2.0 / f32::from(side) - 1.0;
            let (mut x, mut y) = (at(i % width), at(i / width));
            let z = 1.0 - x.abs() - y.abs();
            if z < 0.0 {
                (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
            }
            let Some(direction) = (to_world * Vec3::new(x, y, z)).try_normalize() else { continue };
            let hit = nearest_surface(&Ray::new(centre, direction), scene);
            let reach = hit.map_or(f32::INFINITY, |hit| hit.distance);
            *texel = reach * reach;
        }
        widen(reach2.as_mut_slice(), side as usize);
        Some(Self { centre, to_map, side, reach2 })
    }

    /// Whether the lamp may be seen from `point` (m): a texel errs towards light, by up to its own width; of what is smaller than a texel nothing is known.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight, ShadowMap}, math::Vec3, spectrum::Spectrum};
    /// let lamp = Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?);
    /// let mut memory = [0.0; 16];
    /// let map = ShadowMap::new(&lamp, &Empty, 4, &mut memory[..]).unwrap();
    /// assert!(map.is_lit(Vec3::NEG_X));   // no surface is anywhere
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn is_lit(&self, point: Vec3) -> bool {
        let offset = point - self.centre;
        let p = self.to_map * offset;
        // Octahedral: the sphere folded onto a square.
        let scale = 1.0 / (p.x.abs() + p.y.abs() + p.z.abs());
        let (mut x, mut y) = (p.x * scale, p.y * scale);
        if p.z < 0.0 {
            (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
        }
        let side = u32::from(self.side);
        let at = |x: f32| ((0.5 * (x + 1.0) * side as f32) as u32).min(side.saturating_sub(1));
        let texel = self.reach2.as_slice().get((at(y) * side + at(x)) as usize);
        texel.is_some_and(|&reach2| offset.length_squared() < reach2)
    }
}
