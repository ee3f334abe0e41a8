//! Worlds with one of their lights.

use crate::host::{Hit, Scene};
use crate::math::{Ray, Symmetric3};

/// The surfaces of a world with one of its lights: those of the other lamps are there and dark. With that light alone in
/// [`World::lights`](crate::world::World::lights), bakes are layers of light that hosts may colour, dim and add up.
///
/// ```
/// # use fogbow::{host::{Hit, Scene}, math::{Ray, Vec3}, surface::Surface};
/// use fogbow::bake::OneLight;
/// /// A black sheet at x = 1 that belongs to light number 3.
/// struct Lamp;
/// impl Scene for Lamp {
///     fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
///         Some(Hit { distance: 1.0 - ray.origin.x, normal: Vec3::NEG_X, shading: Vec3::NEG_X, surface: Surface::BLACK, light: Some(3) })
///     }
/// }
/// let light = |number| OneLight { scene: &Lamp, number }.closest_hit(&Ray::new(Vec3::ZERO, Vec3::X)).unwrap().light;
/// assert_eq!((light(3), light(0)), (Some(0), None));
/// ```
#[derive(Debug)]
pub struct OneLight<'a, S: ?Sized> {
    /// All surfaces.
    pub scene: &'a S,
    /// The light's number among all lights.
    pub number: u32,
}

impl<S: Scene + ?Sized> Scene for OneLight<'_, S> {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.scene.closest_hit(ray)?;
        // It is the first, and only, one now.
        let light = hit.light.filter(|light| *light == self.number).map(|_| 0);
        Some(Hit { light, ..hit })
    }

    fn curvature(&self, ray: &Ray, hit: &Hit) -> Symmetric3 {
        self.scene.curvature(ray, hit)
    }

    fn is_blocked(&self, ray: &Ray) -> bool {
        self.scene.is_blocked(ray)
    }
}
