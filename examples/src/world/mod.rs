//! The host's world: surfaces, lights and media of a scene, ready for rays.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`World`]: the [`Scene`] of a scene file |
//! | `build` | from the description to primitives, materials and lights |
//! | `analytic` | flat pieces, spheres, boxes: tested four at a time |
//! | `many` | the same in a tree, where they are many |
//! | `triangles` | meshes in a tree |
//! | `lights`, `glow` | emitters and lent tables; pictures that lights show |
//! | `media` | media and where they are |
//! | `body`, `contained`, `coloured`, `glowing` | closed meshes, and media in them; media whose colour varies, or that glow by temperature |
//! | `places` | texture coordinates and interpolated normals |
//! | `rotated` | rotated grids, whose border reaches as far as Mitsuba's |

mod analytic;
mod body;
mod build;
mod coloured;
mod contained;
mod glow;
mod glowing;
mod lights;
mod many;
mod media;
mod places;
mod rotated;
#[cfg(test)]
mod tests;
mod triangles;

use fogbow::host::{Hit, Medium, Scene};
use fogbow::light::Light;
use fogbow::math::{Bounds, Ray, Symmetric3, Vec3};
use fogbow::phase::Phase;
use fogbow::sampling::uniform::mix;
use fogbow::surface::Surface;
use fogbow::world::{Outline, World as LitWorld, nearest_surface};

pub use body::{Body, as_box};
pub use build::bounds_of;
pub use contained::Contained;
pub use lights::{LightAids, Storage};
pub use media::{Media, WithMedium};

use crate::camera::Camera;
use crate::error::SceneError;
use crate::scene_file::{Geometry, Integrator, Material, SceneFile, Sensor};
use analytic::Few;
use many::Many;
use places::Spot;
use triangles::Triangles;

/// Analytic primitives up to this number are all tested, four at a time; above, a tree pays.
const FEW: usize = 64;

/// A primitive's place in the scene.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Index into the materials.
    material: u32,
    /// 1 where normals point outwards, −1 where they are flipped.
    side: f32,
    /// Index of the light it belongs to.
    light: Option<u32>,
    /// Whether a place of it differs from others in more than its normal.
    varies: bool,
}

/// The surfaces of a scene file, with its lights, media and camera.
///
/// It borrows big tables from a [`Storage`]:
///
/// ```no_run
/// use fogbow_examples::{scene_file::SceneFile, world::{Storage, World}};
/// let scene = SceneFile::read("box.xml".as_ref())?;
/// let mut storage = Storage::new(&scene);
/// let world = World::new(&scene, &mut storage)?;
/// let lights = world.lights();
/// # Ok::<(), fogbow_examples::error::SceneError>(())
/// ```
#[derive(Debug)]
pub struct World<'a> {
    scene: &'a SceneFile,
    materials: Vec<Material>,
    primitives: Vec<analytic::Primitive>,
    parts: Vec<Part>,
    few: Few,
    many: Option<Many>,
    corners: Vec<[Vec3; 3]>,
    triangle_parts: Vec<Part>,
    triangle_numbers: Vec<u32>,
    triangles: Option<Triangles>,
    /// Whether a part of some surface lets light pass as if it were not there.
    has_masks: bool,
    lights: lights::Lights<'a>,
    media: Media<'a>,
    bounds: Bounds,
}

impl<'a> World<'a> {
    /// Builds the world of a scene.
    ///
    /// # Errors
    /// Lights and media whose values are out of range, or that cannot be built.
    pub fn new(scene: &'a SceneFile, storage: &'a mut Storage) -> Result<Self, SceneError> {
        let (light_tables, medium_tables) = storage.split();
        let media = Media::new(scene, medium_tables)?;
        let lights = lights::Lights::new(scene, light_tables)?;
        let pieces = build::Pieces::new(scene);
        let is_few = pieces.primitives.len() <= FEW;
        let few = if is_few { Few::new(&pieces.primitives) } else { Few::default() };
        let many = (!is_few).then(|| Many::new(&pieces.primitives));
        let triangles = (!pieces.corners.is_empty()).then(|| Triangles::new(&pieces.corners));
        let bounds = build::scene_bounds(scene);
        let is_passed = |leaf: &Material| matches!(leaf.surface, Surface::Null | Surface::ThinDielectric { .. });
        let has_masks = pieces.materials.iter().flat_map(Material::leaves).any(is_passed);
        Ok(Self {
            scene,
            materials: pieces.materials,
            primitives: pieces.primitives,
            parts: pieces.parts,
            few,
            many,
            corners: pieces.corners,
            triangle_parts: pieces.triangle_parts,
            triangle_numbers: pieces.triangle_numbers,
            triangles,
            has_masks,
            lights,
            media,
            bounds,
        })
    }

    /// All lights; [`Hit::light`] is an index into them.
    #[must_use]
    pub fn lights(&self) -> Vec<Light<'_>> {
        self.lights.all()
    }

    /// The camera for a film of the size the scene asks for.
    #[must_use]
    pub fn camera(&self) -> Camera {
        Camera::new(&self.scene.sensor, self.scene.sensor.width, self.scene.sensor.height)
    }

    /// The camera for a film of another size.
    #[must_use]
    pub fn camera_for(&self, width: u32, height: u32) -> Camera {
        Camera::new(&self.scene.sensor, width, height)
    }

    /// What the scene says of its camera and film.
    #[must_use]
    pub fn sensor(&self) -> &Sensor {
        &self.scene.sensor
    }

    /// What the scene says of its paths.
    #[must_use]
    pub fn integrator(&self) -> Integrator {
        self.scene.integrator
    }

    /// Media, with tables they lend.
    #[must_use]
    pub fn media(&self) -> &Media<'a> {
        &self.media
    }

    /// The smallest box around surfaces and media (m).
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The smallest box around all media (m); `None` if there are none.
    #[must_use]
    pub fn medium_bounds(&self) -> Option<Bounds> {
        build::medium_bounds(self.scene)
    }

    /// All materials that hits may have.
    fn leaves(&self) -> impl Iterator<Item = &Material> {
        self.materials.iter().flat_map(Material::leaves)
    }

    /// Whether any surface is a mirror or glass, or has lobes.
    #[must_use]
    pub fn has_mirrors(&self) -> bool {
        self.leaves().any(|leaf| leaf.surface.is_followed() && leaf.surface != Surface::Null)
    }

    /// Whether there is light that caches can hold: scattered by a medium, or by a surface that is no mirror and no glass.
    #[must_use]
    pub fn has_cacheable(&self) -> bool {
        let scatters = |surface: Surface| !surface.is_discrete() && !surface.albedo().is_black();
        !self.media().phases().is_empty() || self.leaves().any(|leaf| scatters(leaf.surface))
    }

    /// What methods must know beforehand of this world with one of its media: seen, but for what the scene says outright.
    #[must_use]
    pub fn outline<M: Medium + ?Sized>(&self, world: &LitWorld<'_, M, Self>) -> Outline {
        let sharpness = |phase: &Phase| phase.moment(1).max_element().abs();
        let sharpest = self.media().phases().iter().copied().max_by(|a, b| sharpness(a).total_cmp(&sharpness(b)));
        let seen = Outline::of(world, self.bounds);
        Outline { phase: sharpest.unwrap_or(seen.phase), has_mirrors: self.has_mirrors(), ..seen }
    }

    /// How many flat pieces, spheres and boxes there are, and how many triangles.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        (self.primitives.len(), self.corners.len())
    }

    /// Bytes held for tracing rays, without tables lent.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let triangles = self.corners.len() * (2 * size_of::<[Vec3; 3]>() + size_of::<Part>());
        let primitives = self.primitives.len() * (size_of::<analytic::Primitive>() + size_of::<Part>());
        let trees = self.triangles.as_ref().map_or(0, Triangles::bytes);
        triangles + primitives + trees
    }

    fn hit(
        &self,
        ray: &Ray,
        distance: f32,
        normal: Vec3,
        part: &Part,
        place: impl FnOnce(&'a Geometry, bool) -> Option<Spot<'a>>,
    ) -> Option<Hit> {
        let material = self.materials.get(part.material as usize)?;
        // Before it is turned to a side.
        let outward = normal;
        let normal = normal * part.side;
        let is_front = normal.dot(ray.direction) < 0.0;
        // Seen from behind, a light is dark, whatever its bsdf does there.
        let light = if is_front { part.light } else { None };
        if !part.varies {
            let normal = if material.is_two_sided && !is_front { -normal } else { normal };
            return Some(Hit { distance, normal, shading: normal, surface: material.surface, light });
        }
        let has_tangent = material.has_tangent();
        let spot = place(&self.scene.shapes.get(part.material as usize)?.geometry, has_tangent)?;
        let chosen = material.chosen(&spot.place, is_front, share_of(ray, distance));
        let normal = if chosen.is_two_sided && !is_front { -normal } else { normal };
        let mut shading = spot.normal;
        if let Some(relief) = &chosen.material.relief {
            shading = spot.bent(relief, outward, part.side, ray.direction);
        }
        let shading = if normal.dot(outward) < 0.0 { -shading } else { shading };
        if let Some(surface) = chosen.pane(shading, -ray.direction) {
            let side = if normal.dot(ray.direction) > 0.0 { -1.0 } else { 1.0 };
            return Some(Hit { distance, normal: normal * side, shading: shading * side, surface, light });
        }
        let surface = if has_tangent { spot.aligned(chosen.surface) } else { chosen.surface };
        Some(Hit { distance, normal, shading, surface, light })
    }
}

/// A number in [0, 1) for the hit of a ray, as good as random: what is blended is chosen by it (decision 61).
fn share_of(ray: &Ray, distance: f32) -> f32 {
    let words = |a: f32, b: f32| u64::from(a.to_bits()) | u64::from(b.to_bits()) << 32;
    let (o, d) = (ray.origin, ray.direction);
    let number = [words(o.y, o.z), words(d.x, d.y), words(d.z, distance)]
        .into_iter()
        .fold(mix(words(o.x, 0.0)), |number, word| mix(number ^ word));
    (number >> 40) as f32 * (1.0 / (1_u64 << 24) as f32)
}

impl<'a> Scene for World<'a> {
    #[inline]
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let analytic = match &self.many {
            Some(many) => many.closest(ray, ray.length),
            None => self.few.closest(ray, ray.length),
        };
        let length = analytic.map_or(ray.length, |(t, _)| t);
        if let Some(triangles) = &self.triangles
            && let Some((t, index)) = triangles.closest(ray, length)
        {
            let [a, b, c] = self.corners.get(index as usize)?;
            let normal = (*b - *a).cross(*c - *a).normalize_or(-ray.direction);
            let number = *self.triangle_numbers.get(index as usize)? as usize;
            let place = |geometry: &'a Geometry, has_relief: bool| {
                let Geometry::Mesh(mesh) = geometry else { return None };
                Some(Spot::of_triangle(mesh, number, ([*a, *b, *c], normal), ray.at(t), has_relief))
            };
            return self.hit(ray, t, normal, self.triangle_parts.get(index as usize)?, place);
        }
        let (t, index) = analytic?;
        let primitive = self.primitives.get(index as usize)?;
        let normal = primitive.normal(ray.at(t));
        let place = |geometry: &'a Geometry, _: bool| Some(Spot::of_form(geometry, primitive, ray.at(t), normal));
        self.hit(ray, t, normal, self.parts.get(index as usize)?, place)
    }

    #[inline]
    fn is_blocked(&self, ray: &Ray) -> bool {
        // Whether a masked surface is there is told by the hit.
        if self.has_masks {
            return nearest_surface(ray, self).is_some();
        }
        let is_hit = match &self.many {
            Some(many) => many.is_hit(ray, ray.length),
            None => self.few.is_hit(ray, ray.length),
        };
        is_hit || self.triangles.as_ref().is_some_and(|t| t.is_hit(ray, ray.length))
    }

    fn curvature(&self, ray: &Ray, hit: &Hit) -> Symmetric3 {
        let point = ray.at(hit.distance);
        let curvature = self.primitives.iter().find_map(|primitive| primitive.curvature(point, hit.normal));
        curvature.unwrap_or_default()
    }
}
