//! Worlds: a medium, surfaces and lights together; what methods find in them; the truth by path tracing.

use core::fmt;
use std::sync::Arc;

use fogbow::host::{Empty, Scene};
use fogbow::light::{Light, LightTree, Lights};
use fogbow::math::Bounds;
use fogbow::path;
use fogbow::sampling::independent;
use fogbow::world::{Outline, World};

use crate::arguments::{self, Versioned};
use crate::handles::{self, Object};
use crate::host::{HostScene, fogbow_box, fogbow_host_scene, fogbow_ray};
use crate::light::fogbow_light;
use crate::medium::{AnyMedium, Shared, fogbow_medium};
use crate::status::{FOGBOW_ERROR_MEMORY, Failure, fogbow_status, guard, wrong};

/// A world: a medium, surfaces and lights. Never changes; work in it keeps it alive. Callbacks and their contexts must live as long.
#[derive(Debug)]
pub struct fogbow_world {
    _opaque: [u8; 0],
}

/// What light travels through, and where it comes from.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_world_parts {
    /// sizeof(fogbow_world_parts).
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// The medium; null for vacuum. May be freed afterwards.
    pub medium: *const fogbow_medium,
    /// The surfaces; null for none. Copied; its callbacks and its context are used as long as the world is.
    pub scene: *const fogbow_host_scene,
    /// The lights, which are copied.
    pub lights: *const fogbow_light,
    /// How many.
    pub light_count: usize,
    /// What holds all surfaces and media, or what matters of them.
    pub bounds: fogbow_box,
}

// SAFETY: `repr(C)`, the size first, then numbers and pointers.
unsafe impl Versioned for fogbow_world_parts {}

/// More lights are chosen by a tree: decision 50.
const MANY_LIGHTS: usize = 16;

pub(crate) type AnyScene = dyn Scene + Send + Sync;

/// A world that owns its parts.
pub(crate) struct OwnedWorld {
    medium: Option<Shared>,
    scene: HostScene,
    lights: Vec<Light<'static>>,
    tree: Option<LightTree<'static>>,
    pub(crate) bounds: Bounds,
}

impl fmt::Debug for OwnedWorld {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OwnedWorld").field("bounds", &self.bounds).finish_non_exhaustive()
    }
}

impl Object for OwnedWorld {
    type Handle = fogbow_world;
    const NAME: &'static str = "a world";
}

impl OwnedWorld {
    pub(crate) fn get(&self) -> World<'_, AnyMedium, AnyScene> {
        let lights = match &self.tree {
            Some(tree) => Lights::with_tree(&self.lights, tree),
            None => (&self.lights).into(),
        };
        World { medium: self.medium.as_ref().map_or(&Empty, Shared::get), scene: &self.scene, lights }
    }

    pub(crate) fn outline(&self) -> Outline {
        Outline::of(&self.get(), self.bounds)
    }
}

/// A new world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_world_new(
    parts: *const fogbow_world_parts,
    world: *mut *mut fogbow_world,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (parts, world) = unsafe { (arguments::read(parts, "parts")?, arguments::place(world, "world")?) };
        let medium = if parts.medium.is_null() {
            None
        } else {
            Some((*handles::get::<Shared>(parts.medium, "parts->medium")?).clone())
        };
        // SAFETY: as above.
        let given = unsafe { arguments::many(parts.lights, parts.light_count, "parts->lights")? };
        let Ok(count) = u32::try_from(given.len()) else { return wrong("there are more than 2^32 lights") };
        let mut lights = Vec::new();
        let full = || Failure(FOGBOW_ERROR_MEMORY, "there is no memory for the lights".to_owned());
        lights.try_reserve_exact(given.len()).map_err(|_| full())?;
        for (i, light) in given.iter().enumerate() {
            lights.push(light.check(&format!("parts->lights[{i}]"))?);
        }
        let scene = if parts.scene.is_null() {
            HostScene::EMPTY
        } else {
            // SAFETY: as above.
            HostScene::new(&unsafe { arguments::read(parts.scene, "parts->scene")? }, count)?
        };
        let tree = match lights.len() {
            0..=MANY_LIGHTS => None,
            _ => Some(LightTree::new(&lights, Vec::new()).map_err(|_| full())?),
        };
        let bounds = arguments::bounds(&parts.bounds, "parts->bounds")?;
        world.set(handles::put(OwnedWorld { medium, scene, lights, tree, bounds })?);
        Ok(())
    })
}

/// Frees the handle of a world; work in it keeps it alive until that is freed, too. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_world_free(world: *mut fogbow_world) -> fogbow_status {
    guard(|| handles::take::<OwnedWorld>(world, "world").map(drop))
}

pub(crate) fn get(world: *const fogbow_world) -> Result<Arc<OwnedWorld>, Failure> {
    handles::get(world, "world")
}

/// What methods find in a world: the numbers that settings follow from.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_outline {
    /// sizeof(fogbow_outline).
    pub size: u32,
    /// Mean free path (m) over all of the bounds, holes included; infinite in vacuum.
    pub mean_free_path: f32,
    /// Free path (m) where the medium is thickest.
    pub least_free_path: f32,
    /// Mean extinction (1/m) of the medium, by itself.
    pub extinction: f32,
    /// Mean albedo of the medium, by extinction.
    pub albedo: f32,
    /// Length (m) over which the medium varies.
    pub resolution: f32,
    /// 1: the medium is constant wherever it was looked at.
    pub is_constant: u32,
    /// 1: its extinction is the same in all channels.
    pub is_grey: u32,
    /// 1: it may emit light.
    pub is_emissive: u32,
    /// 1: there are surfaces.
    pub has_surfaces: u32,
    /// 1: there are mirrors or glass.
    pub has_mirrors: u32,
    /// How many lights there are.
    pub light_count: u32,
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl Versioned for fogbow_outline {}

/// Looks at a world: at 24³ points of its medium and along 1024 rays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_world_outline(
    world: *const fogbow_world,
    outline: *mut fogbow_outline,
) -> fogbow_status {
    guard(|| {
        let found = get(world)?.outline();
        let answer = fogbow_outline {
            size: 0,
            mean_free_path: found.mean_free_path,
            least_free_path: found.least_free_path,
            extinction: found.extinction,
            albedo: found.albedo,
            resolution: found.resolution,
            is_constant: found.is_constant.into(),
            is_grey: found.is_grey.into(),
            is_emissive: found.is_emissive.into(),
            has_surfaces: found.has_surfaces.into(),
            has_mirrors: found.has_mirrors.into(),
            light_count: found.lights.all as u32,
        };
        // SAFETY: what the head of the header asks of pointers.
        unsafe { arguments::write_sized(outline, "outline", answer) }
    })
}

/// Radiance (W/(m² sr), three channels a ray) that arrives at the origins of rays, by one unbiased path each: the truth, with noise.
///
/// Ray i has the random numbers of sample `sample` of the key `first_key + i` and of `seed`, whatever else is in the batch: in a
/// picture of row after row let the key be `(uint64_t)y << 32 | x`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_path_trace(
    world: *const fogbow_world,
    rays: *const fogbow_ray,
    count: usize,
    chance: fogbow_chance,
    radiance: *mut f32,
) -> fogbow_status {
    guard(|| {
        let world = get(world)?;
        // SAFETY: what the head of the header asks of pointers.
        let (rays, answers) =
            unsafe { (arguments::many(rays, count, "rays")?, arguments::room(radiance.cast(), count, "radiance")?) };
        let settings = path::Settings::default();
        for (i, (ray, answer)) in rays.iter().zip(answers).enumerate() {
            let mut rng = independent(chance.seed, chance.first_key.wrapping_add(i as u64), chance.sample);
            let found = path::radiance(&ray.check("rays[i]")?, &world.get(), &settings, &mut rng);
            *answer = found.total().0;
        }
        Ok(())
    })
}

/// Which random numbers a batch uses: element i those of sample `sample` of key `first_key + i`, whatever else is in the batch. In
/// pictures, let the key of a pixel be `(uint64_t)y << 32 | x`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_chance {
    /// Changes all of them. Readers of caches take that of the caches' settings, too.
    pub seed: u64,
    /// Key of the first element.
    pub first_key: u64,
    /// Number of the sample.
    pub sample: u32,
    /// 0.
    pub reserved: u32,
}
