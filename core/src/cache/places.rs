//! Where eye rays ask the caches: where records are needed.

use glam::Vec3;

use super::eye::{RaySettings, Sight, known_base, look};
use crate::host::{Hit, Medium, Properties, Rng, Scene};
use crate::math::{Frame, Ray};
use crate::sampling::{Generator, uniform2, warp};
use crate::spectrum::Spectrum;
use crate::world::{World, leave, nearest_surface};

/// A place where an eye ray asks a cache.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Where (m).
    pub point: Vec3,
    /// The surface's normal; `None` in the medium.
    pub normal: Option<Vec3>,
    /// Whether the eye ray itself comes here; if not, a ray from one of its points.
    pub is_seen: bool,
    /// How much of the light that leaves a surface here reaches the eye, in [0, 1]: fog, mirrors and panes take the rest. 1 in the medium, and
    /// where the eye ray does not come.
    pub share: f32,
    /// Where the eye is, seen from here (unit); `None` where light is asked for in any direction.
    pub to_eye: Option<Vec3>,
}

/// Calls `visit` for every place where the light along `ray` would be looked up: where records are
/// needed. From every one of them it also follows a random direction to a surface, which lights it.
///
/// ```
/// # use fogbow::{cache::{RaySettings, places}, host::Empty, math::{Ray, Vec3}, medium::Homogeneous, phase::Phase};
/// # use fogbow::{sampling::Generator, spectrum::Spectrum};
/// # use fogbow::world::World;
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let settings = RaySettings { density: 8.0, connections: 1, lamp_parts: 1, lights_visible: true, indirect: true };
/// let (ray, mut found) = (Ray::between(Vec3::ZERO, core::f32::consts::LN_2 * Vec3::X), Vec::new());
/// places(&ray, &world, &settings, &mut Generator::new(1), |place| found.push(place));
/// assert_eq!(found.len(), 4);   // half of what is seen is fog
/// assert!(found.iter().all(|place| place.is_seen && place.normal.is_none()));
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn places<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    world: &World<'_, M, S>,
    settings: &RaySettings,
    rng: &mut (impl Rng + ?Sized),
    visit: impl FnMut(Place),
) {
    let mut wanted = Wanted { world, rng: Generator::child(rng), visit };
    look(ray, world, settings, rng, &mut wanted);
}

/// As [`places`], for one point of the medium, lit from `direction` among others.
pub(super) fn places_around<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    direction: Vec3,
    world: &World<'_, M, S>,
    visit: &mut dyn FnMut(Place),
) {
    if world.medium.properties(point).scattering.is_black() {
        return;
    }
    visit(Place { point, is_seen: true, share: 1.0, ..Place::default() });
    // One direction is given: no random numbers are drawn.
    Wanted { world, rng: Generator::new(0), visit }.beyond(&Ray::new(point, direction));
}

struct Wanted<'a, M: ?Sized, S: ?Sized, F> {
    world: &'a World<'a, M, S>,
    rng: Generator,
    visit: F,
}

impl<M: Medium + ?Sized, S: Scene + ?Sized, F: FnMut(Place)> Wanted<'_, M, S, F> {
    fn beyond(&mut self, ray: &Ray) {
        if let Some(hit) = nearest_surface(ray, self.world.scene) {
            self.on_surface(ray, &hit, false, 1.0);
        }
    }

    fn on_surface(&mut self, ray: &Ray, hit: &Hit, is_seen: bool, share: f32) {
        if !known_base(hit, -ray.direction).is_black() {
            let (point, normal, to_eye) = (ray.at(hit.distance), Some(hit.shading), Some(-ray.direction));
            (self.visit)(Place { point, normal, is_seen, share, to_eye });
        }
    }
}

impl<M: Medium + ?Sized, S: Scene + ?Sized, F: FnMut(Place)> Sight for Wanted<'_, M, S, F> {
    fn scatter(&mut self, point: Vec3, to_eye: Vec3, _: &Properties, _: Spectrum) {
        (self.visit)(Place { point, normal: None, is_seen: true, share: 1.0, to_eye: Some(to_eye) });
        let direction = warp::uniform_sphere(uniform2(&mut self.rng));
        self.beyond(&Ray::new(point, direction));
    }

    fn surface(&mut self, ray: &Ray, hit: &Hit, weight: Spectrum) {
        self.on_surface(ray, hit, true, weight.map(f32::abs).mean().min(1.0));
        let point = ray.at(hit.distance);
        let direction = Frame::around(hit.shading).to_world(warp::cosine_hemisphere(uniform2(&mut self.rng)));
        let origin = leave(point, hit.normal, direction, hit.distance);
        self.beyond(&Ray::new(origin, direction));
    }
}
