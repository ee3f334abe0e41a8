//! What caches say, in batches.

use fogbow::cache::CachedRadiance;
use fogbow::sampling::independent;
use fogbow::spectrum::Spectrum;

use crate::arguments;
use crate::caches::{self, fogbow_caches};
use crate::host::fogbow_ray;
use crate::status::{Failure, Outcome, fogbow_status, guard, wrong};
use crate::world::{self, fogbow_chance, fogbow_world};

/// Radiance along a ray, by part (W/(m² sr)). Fixed for ever: arrays of it cross the interface.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_light_parts {
    /// Of lights seen, and of media that glow.
    pub emitted: [f32; 3],
    /// Straight from the lights to a surface.
    pub surface_direct: [f32; 3],
    /// From elsewhere to a surface.
    pub surface_indirect: [f32; 3],
    /// Straight from the lights to the medium.
    pub medium_single: [f32; 3],
    /// From surfaces to the medium.
    pub medium_surface: [f32; 3],
    /// Scattered in the medium more than once.
    pub medium_multiple: [f32; 3],
    /// Look-ups in caches.
    pub lookups: u32,
    /// Look-ups that found nothing, so that a sample was taken.
    pub misses: u32,
}

/// Radiance (W/(m² sr), three channels a ray) that arrives at the origins of rays: one sample each of what caches say, with light
/// straight from the lights
/// and what is not cached sampled. `parts` may be null; else it has room for `count` elements. On any thread, also while the caches
/// are filled.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_radiance(
    caches: *const fogbow_caches,
    world: *const fogbow_world,
    rays: *const fogbow_ray,
    count: usize,
    chance: fogbow_chance,
    radiance: *mut f32,
    parts: *mut fogbow_light_parts,
) -> fogbow_status {
    guard(|| {
        let (caches, world) = (caches::get(caches)?, world::get(world)?);
        // SAFETY: what the head of the header asks of pointers.
        let (rays, answers, parts) = unsafe {
            let parts = if parts.is_null() { &mut [] } else { arguments::room(parts, count, "parts")? };
            (arguments::many(rays, count, "rays")?, arguments::room(radiance.cast(), count, "radiance")?, parts)
        };
        caches.read(|caches| {
            let seed = caches.settings().seed ^ chance.seed;
            for (i, (ray, answer)) in rays.iter().zip(answers).enumerate() {
                let mut rng = independent(seed, chance.first_key.wrapping_add(i as u64), chance.sample);
                let seen = caches.radiance(&ray.check("rays[i]")?, &world.get(), &mut rng);
                *answer = seen.total().0;
                if let Some(part) = parts.get_mut(i) {
                    *part = parts_of(&seen);
                }
            }
            Ok(())
        })?
    })
}

fn parts_of(seen: &CachedRadiance) -> fogbow_light_parts {
    fogbow_light_parts {
        emitted: seen.emitted.0,
        surface_direct: seen.surface_direct.0,
        surface_indirect: seen.surface_indirect.0,
        medium_single: seen.medium_single.0,
        medium_surface: seen.medium_surface.0,
        medium_multiple: seen.medium_multiple.0,
        lookups: seen.lookups,
        misses: seen.misses,
    }
}

/// In-scattered radiance (W/(m² sr), three channels a point, without the scattering coefficient) at points (x, y, z; m) towards eyes
/// (unit vectors
/// from the points), all light together; what no record tells is sampled.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_in_scattered(
    caches: *const fogbow_caches,
    world: *const fogbow_world,
    points: *const f32,
    to_eyes: *const f32,
    count: usize,
    chance: fogbow_chance,
    radiance: *mut f32,
) -> fogbow_status {
    guard(|| {
        let (caches, world) = (caches::get(caches)?, world::get(world)?);
        // SAFETY: what the head of the header asks of pointers.
        let (points, to_eyes, answers) = unsafe {
            let points = arguments::many::<[f32; 3]>(points.cast(), count, "points")?;
            let to_eyes = arguments::many::<[f32; 3]>(to_eyes.cast(), count, "to_eyes")?;
            (points, to_eyes, arguments::room(radiance.cast(), count, "radiance")?)
        };
        caches.read(|caches| {
            let seed = caches.settings().seed ^ chance.seed;
            for (i, ((point, to_eye), answer)) in points.iter().zip(to_eyes).zip(answers).enumerate() {
                let (point, to_eye) =
                    (arguments::vector(*point, "points[i]")?, arguments::unit(*to_eye, "to_eyes[i]")?);
                let mut rng = independent(seed, chance.first_key.wrapping_add(i as u64), chance.sample);
                *answer = caches.in_scattered(point, to_eye, &world.get(), &mut rng).total().0;
            }
            Ok(())
        })?
    })
}

/// Coefficients of an expansion up to a degree from 0 to 8.
fn coefficients(degree: u32) -> Outcome<usize> {
    if degree > 8 {
        return wrong(format!("`degree` is {degree}; there are degrees from 0 to 8"));
    }
    Ok((degree as usize + 1) * (degree as usize + 1))
}

/// What caches say at points of the light that is scattered there, in spherical harmonics up to `degree` (0 to 8): (degree + 1)²
/// coefficients of three
/// channels each, point after point; zeros where no record reaches. `missing` (may be null): how many points those are.
///
/// Without light straight from the lights, unless the settings cache it. See `fogbow_sh_evaluate` for the functions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_in_scattered_sh(
    caches: *const fogbow_caches,
    points: *const f32,
    count: usize,
    degree: u32,
    answers: *mut f32,
    missing: *mut usize,
) -> fogbow_status {
    guard(|| {
        let caches = caches::get(caches)?;
        let each = coefficients(degree)?;
        let Some(numbers) = count.checked_mul(each) else { return wrong("there are too many points") };
        // SAFETY: what the head of the header asks of pointers.
        let (points, answers, missing) = unsafe {
            let points = arguments::many::<[f32; 3]>(points.cast(), count, "points")?;
            let answers = arguments::room::<[f32; 3]>(answers.cast(), numbers, "answers")?;
            (points, answers, arguments::place_if_any(missing, "missing")?)
        };
        let absent = caches.read(|caches| {
            let (mut absent, mut held) = (0, [Spectrum::ZERO; 81]);
            for (point, slots) in points.iter().zip(answers.chunks_exact_mut(each)) {
                let point = arguments::vector(*point, "points[i]")?;
                absent += usize::from(!caches.in_scattered_sh(point, &mut held[..each]));
                slots.iter_mut().zip(&held).for_each(|(slot, value)| *slot = value.0);
            }
            Ok::<_, Failure>(absent)
        })??;
        missing.iter().for_each(|place| place.set(absent));
        Ok(())
    })
}

/// Fluence (W/m², three channels a point), the integral of radiance over all directions, of the light whose scattering is cached;
/// zeros where no record reaches.
/// `missing` (may be null): how many points those are.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_fluence(
    caches: *const fogbow_caches,
    points: *const f32,
    count: usize,
    fluences: *mut f32,
    missing: *mut usize,
) -> fogbow_status {
    guard(|| {
        let caches = caches::get(caches)?;
        // SAFETY: what the head of the header asks of pointers.
        let (points, answers, missing) = unsafe {
            let points = arguments::many::<[f32; 3]>(points.cast(), count, "points")?;
            let answers = arguments::room::<[f32; 3]>(fluences.cast(), count, "fluences")?;
            (points, answers, arguments::place_if_any(missing, "missing")?)
        };
        let absent = caches.read(|caches| {
            let mut absent = 0;
            for (point, answer) in points.iter().zip(answers) {
                let found = caches.fluence(arguments::vector(*point, "points[i]")?);
                absent += usize::from(found.is_none());
                *answer = found.unwrap_or_default().0;
            }
            Ok::<_, Failure>(absent)
        })??;
        missing.iter().for_each(|place| place.set(absent));
        Ok(())
    })
}

/// Irradiance (W/m², three channels a point), without light straight from the lights, at points of surfaces with unit normals; zeros
/// where no record reaches.
/// `missing` (may be null): how many points those are.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_irradiance(
    caches: *const fogbow_caches,
    points: *const f32,
    normals: *const f32,
    count: usize,
    irradiances: *mut f32,
    missing: *mut usize,
) -> fogbow_status {
    guard(|| {
        let caches = caches::get(caches)?;
        // SAFETY: what the head of the header asks of pointers.
        let (points, normals, answers, missing) = unsafe {
            let points = arguments::many::<[f32; 3]>(points.cast(), count, "points")?;
            let normals = arguments::many::<[f32; 3]>(normals.cast(), count, "normals")?;
            let answers = arguments::room::<[f32; 3]>(irradiances.cast(), count, "irradiances")?;
            (points, normals, answers, arguments::place_if_any(missing, "missing")?)
        };
        let absent = caches.read(|caches| {
            let mut absent = 0;
            for ((point, normal), answer) in points.iter().zip(normals).zip(answers) {
                let (point, normal) =
                    (arguments::vector(*point, "points[i]")?, arguments::unit(*normal, "normals[i]")?);
                let found = caches.irradiance(point, normal);
                absent += usize::from(found.is_none());
                *answer = found.unwrap_or_default().0;
            }
            Ok::<_, Failure>(absent)
        })??;
        missing.iter().for_each(|place| place.set(absent));
        Ok(())
    })
}
