//! Media: of this library, and of the host.

use core::fmt;
use core::slice;
use std::sync::Arc;

use fogbow::host::{Medium, Properties};
use fogbow::math::{Affine3, Mat3, Vec3};
use fogbow::medium::{Density, DensityGrid, FractalNoise, Homogeneous, MinMax, Noise, Overlap, Placed, Region};
use fogbow::phase::Phase;

use crate::arguments::{self, Versioned};
use crate::handles::{self, Object};
use crate::host::{HostMedium, fogbow_box, fogbow_host_medium, fogbow_properties};
use crate::status::{Outcome, fogbow_status, guard, refused, wrong};

/// A medium: what light travels through. Never changes; worlds and other media that use it keep it alive.
#[derive(Debug)]
pub struct fogbow_medium {
    _opaque: [u8; 0],
}

/// Any medium, to be shared.
pub(crate) type AnyMedium = dyn Medium + Send + Sync;

/// One of many owners of a medium.
#[derive(Clone)]
pub(crate) struct Shared {
    medium: Arc<AnyMedium>,
    /// The one phase function it scatters by; none for a medium of the host, which may have several.
    phase: Option<Phase>,
    /// Media within media within it.
    depth: u32,
}

/// Media within media at most: each asks the next, and the stack has an end.
const DEEPEST: u32 = 32;

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
}

impl Object for Shared {
    type Handle = fogbow_medium;
    const NAME: &'static str = "a medium";
}

impl Shared {
    fn new(medium: impl Medium + Send + Sync + 'static, phase: Option<Phase>) -> Self {
        Self { medium: Arc::new(medium), phase, depth: 0 }
    }

    /// Around media that have so many within each other.
    fn within(self, depth: u32) -> Outcome<Self> {
        if depth >= DEEPEST {
            return wrong(format!("more than {DEEPEST} media within each other"));
        }
        Ok(Self { depth: depth + 1, ..self })
    }

    pub(crate) fn get(&self) -> &AnyMedium {
        &*self.medium
    }
}

impl Medium for Shared {
    fogbow::host::delegate_medium!(self, (self.medium));
}

/// Memory that what is made of it may borrow for as long as both are kept together.
struct Lasting<T>(*mut [T]);

// SAFETY: it owns its elements as a box does.
unsafe impl<T: Send> Send for Lasting<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Lasting<T> {}

impl<T> Lasting<T> {
    fn new(values: Vec<T>) -> Self {
        Self(Box::into_raw(values.into_boxed_slice()))
    }

    /// # Safety
    /// Nobody may use it after `self` is dropped, nor while [`Lasting::get_mut`] is in use.
    unsafe fn get(&self) -> &'static [T] {
        // SAFETY: a box's memory, which does not move; how long it lasts is the caller's business.
        unsafe { slice::from_raw_parts(self.0.cast::<T>(), self.0.len()) }
    }

    /// # Safety
    /// As [`Lasting::get`]; once.
    unsafe fn get_mut(&self) -> &'static mut [T] {
        // SAFETY: as above.
        unsafe { slice::from_raw_parts_mut(self.0.cast::<T>(), self.0.len()) }
    }
}

impl<T> Drop for Lasting<T> {
    fn drop(&mut self) {
        // SAFETY: of `Box::into_raw`, and dropped once.
        drop(unsafe { Box::from_raw(self.0) });
    }
}

/// A grid with its densities. Fields are dropped in this order: what borrows first.
struct OwnedGrid {
    grid: DensityGrid<'static>,
    _densities: Lasting<f32>,
    _blocks: Lasting<MinMax>,
}

impl Medium for OwnedGrid {
    fogbow::host::delegate_medium!(self, (self.grid));
}

/// Media in the same space, as [`OwnedGrid`].
struct OwnedOverlap {
    overlap: Overlap<'static, Shared>,
    _media: Lasting<Shared>,
}

impl Medium for OwnedOverlap {
    fogbow::host::delegate_medium!(self, (self.overlap));
}

/// A medium that is the same everywhere. Put it into a box or a ball by `fogbow_medium_in_box` and `fogbow_medium_in_ball`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_homogeneous(
    properties: *const fogbow_properties,
    medium: *mut *mut fogbow_medium,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (properties, medium) =
            unsafe { (arguments::value(properties, "properties")?, arguments::place(medium, "medium")?) };
        let Properties { absorption, scattering, emission, phase } = properties.check("properties")?;
        let fog = Homogeneous::new(absorption, scattering, phase).and_then(|fog| fog.with_emission(emission));
        let fog = fog.map_err(|error| refused("properties")(&error))?;
        medium.set(handles::put(Shared::new(fog, Some(phase)))?);
        Ok(())
    })
}

/// A grid of densities, trilinear between the centres of its cells; vacuum outside.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_grid {
    /// sizeof(fogbow_grid).
    pub size: u32,
    /// Cells along x, y and z; each at least 1.
    pub counts: [u32; 3],
    /// One density for each cell, x fastest: cell (x, y, z) is number (z * counts[1] + y) * counts[0] + x. Finite, not negative.
    /// They are copied.
    pub densities: *const f32,
    /// How many there are: the product of `counts`.
    pub density_count: usize,
    /// What the medium is where the density is 1; coefficients and emission are in proportion to it.
    pub properties: fogbow_properties,
    /// Where the unit cube of the grid lies in the world: three rows of four numbers, the last of each a translation (m).
    pub world_from_grid_rows: [f32; 12],
}

// SAFETY: `repr(C)`, the size first, then numbers and a pointer.
unsafe impl Versioned for fogbow_grid {}

/// A medium from a grid of densities.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_grid(
    grid: *const fogbow_grid,
    medium: *mut *mut fogbow_medium,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (grid, medium) = unsafe { (arguments::read(grid, "grid")?, arguments::place(medium, "medium")?) };
        let product = grid.counts.iter().try_fold(1_usize, |product, n| product.checked_mul(*n as usize));
        if product != Some(grid.density_count) || product == Some(0) {
            return wrong(format!(
                "`grid->density_count` is {}, and `counts` are {:?}",
                grid.density_count, grid.counts
            ));
        }
        // SAFETY: what the head of the header asks of pointers.
        let densities = unsafe { arguments::many(grid.densities, grid.density_count, "grid->densities")? };
        let properties = grid.properties.check("grid->properties")?;
        let densities = Lasting::new(arguments::copied(densities, "densities")?);
        let count = DensityGrid::block_count(grid.counts);
        let blocks = Lasting::new(arguments::filled(count, MinMax::default(), "bounds of densities")?);
        // SAFETY: both are kept beside what borrows them, and dropped after it.
        let (borrowed, bounds) = unsafe { (densities.get(), blocks.get_mut()) };
        let place = affine(&grid.world_from_grid_rows);
        let made = DensityGrid::new(grid.counts, Density::F32(borrowed), &properties, place, bounds);
        let made = made.map_err(|error| refused("grid")(&error))?;
        let owned = OwnedGrid { grid: made, _densities: densities, _blocks: blocks };
        medium.set(handles::put(Shared::new(owned, Some(properties.phase)))?);
        Ok(())
    })
}

/// From three rows of four numbers.
fn affine(rows: &[f32; 12]) -> Affine3 {
    let column = |c: usize| Vec3::new(rows[c], rows[4 + c], rows[8 + c]);
    Affine3 { matrix3: Mat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

/// Fractal noise: density = clamp(offset + amplitude * sum of gain^i * noise(frequency * lacunarity^i * x), 0, max_density).
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_noise {
    /// sizeof(fogbow_noise).
    pub size: u32,
    /// Octaves, at least 1.
    pub octaves: u32,
    /// Other seeds are other clouds.
    pub seed: u32,
    /// Cells per metre of the first octave.
    pub frequency: f32,
    /// From octave to octave, the factor of frequencies, at least 1; 0 for 2.
    pub lacunarity: f32,
    /// From octave to octave, the factor of amplitudes, at most 1; 0 for a half.
    pub gain: f32,
    /// Mean density before clamping; a negative one leaves islands in vacuum.
    pub offset: f32,
    /// Amplitude of the first octave, whose values lie in about ±1.
    pub amplitude: f32,
    /// Largest density; 0 for 1.
    pub max_density: f32,
    /// What the medium is where the density is 1.
    pub properties: fogbow_properties,
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl Versioned for fogbow_noise {}

/// A medium of fractal noise without end.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_noise(
    noise: *const fogbow_noise,
    medium: *mut *mut fogbow_medium,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (noise, medium) = unsafe { (arguments::read(noise, "noise")?, arguments::place(medium, "medium")?) };
        let Properties { absorption, scattering, emission, phase } = noise.properties.check("noise->properties")?;
        let shape = shape_of(&noise);
        let cloud = Noise::new(shape, absorption, scattering, phase).and_then(|cloud| cloud.with_emission(emission));
        let cloud = cloud.map_err(|error| refused("noise")(&error))?;
        medium.set(handles::put(Shared::new(cloud, Some(phase)))?);
        Ok(())
    })
}

fn shape_of(noise: &fogbow_noise) -> FractalNoise {
    let usual = |given: f32, usual: f32| if given == 0.0 { usual } else { given };
    FractalNoise {
        frequency: noise.frequency,
        octaves: noise.octaves,
        lacunarity: usual(noise.lacunarity, 2.0),
        gain: usual(noise.gain, 0.5),
        offset: noise.offset,
        amplitude: noise.amplitude,
        max_density: usual(noise.max_density, 1.0),
        seed: noise.seed,
    }
}

/// A medium by callbacks of the host, without end. Put it into a box or a ball where it has sharp borders.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_host(
    host: *const fogbow_host_medium,
    medium: *mut *mut fogbow_medium,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (host, medium) = unsafe { (arguments::read(host, "host")?, arguments::place(medium, "medium")?) };
        medium.set(handles::put(Shared::new(HostMedium::new(host)?, None))?);
        Ok(())
    })
}

fn placed(inner: *const fogbow_medium, region: Region) -> Outcome<*mut fogbow_medium> {
    let inner = handles::get::<Shared>(inner, "inner")?;
    let (phase, depth) = (inner.phase, inner.depth);
    handles::put(Shared::new(Placed::new((*inner).clone(), region), phase).within(depth)?)
}

/// The medium `inner` inside a box, vacuum outside. `inner` may be freed afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_in_box(
    inner: *const fogbow_medium,
    bounds: *const fogbow_box,
    medium: *mut *mut fogbow_medium,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (bounds, medium) = unsafe { (arguments::value(bounds, "bounds")?, arguments::place(medium, "medium")?) };
        let bounds = arguments::bounds(&bounds, "bounds")?;
        let region = Region::bounds(bounds).map_err(|error| refused("bounds")(&error))?;
        medium.set(placed(inner, region)?);
        Ok(())
    })
}

/// The medium `inner` inside a ball with a centre (x, y, z; m) and a radius (m), vacuum outside. `inner` may be freed afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_in_ball(
    inner: *const fogbow_medium,
    centre: *const f32,
    radius: f32,
    medium: *mut *mut fogbow_medium,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (centre, medium) =
            unsafe { (arguments::value(centre.cast(), "centre")?, arguments::place(medium, "medium")?) };
        let centre = arguments::vector(centre, "centre")?;
        let region = Region::sphere(centre, radius).map_err(|error| refused("centre and radius")(&error))?;
        medium.set(placed(inner, region)?);
        Ok(())
    })
}

/// Several media in the same space: coefficients and emission add up, phase functions mix by scattering. There should be no more than
/// four different
/// phase functions; where more meet, that of the medium which scatters most stands for all. No media are vacuum. `media` may be freed
/// afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_overlap(
    media: *const *const fogbow_medium,
    count: usize,
    medium: *mut *mut fogbow_medium,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (media, medium) = unsafe { (arguments::many(media, count, "media")?, arguments::place(medium, "medium")?) };
        let one = |handle: &*const fogbow_medium| Ok((*handles::get::<Shared>(*handle, "media[i]")?).clone());
        let media: Vec<Shared> = media.iter().map(one).collect::<Outcome<_>>()?;
        let depth = media.iter().map(|one| one.depth).max().unwrap_or(0);
        let media = Lasting::new(media);
        let phase_of = |one: &Shared| one.phase.unwrap_or(Phase::ISOTROPIC);
        // SAFETY: kept beside what borrows it, and dropped after it.
        let overlap = Overlap::new(unsafe { media.get() }, phase_of).map_err(|error| refused("media")(&error))?;
        let owned = OwnedOverlap { overlap, _media: media };
        medium.set(handles::put(Shared::new(owned, None).within(depth)?)?);
        Ok(())
    })
}

/// Coefficients and emission of a medium at a point (x, y, z; m); the phase function is left isotropic.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_properties(
    medium: *const fogbow_medium,
    point: *const f32,
    properties: *mut fogbow_properties,
) -> fogbow_status {
    guard(|| {
        let medium = handles::get::<Shared>(medium, "medium")?;
        // SAFETY: what the head of the header asks of pointers.
        let (point, answer) =
            unsafe { (arguments::value(point.cast(), "point")?, arguments::place(properties, "properties")?) };
        let found = medium.properties(arguments::vector(point, "point")?);
        answer.set(fogbow_properties {
            absorption: found.absorption.0,
            scattering: found.scattering.0,
            emission: found.emission.0,
            ..fogbow_properties::default()
        });
        Ok(())
    })
}

/// Frees the handle of a medium; worlds that use the medium keep it. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_medium_free(medium: *mut fogbow_medium) -> fogbow_status {
    guard(|| handles::take::<Shared>(medium, "medium").map(drop))
}
