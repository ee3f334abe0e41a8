//! Covariance grids: filled in parallel, the same bits for any number of threads; their files.

use core::fmt;
use std::io;
use std::path::{Path, PathBuf};

use fogbow::covariance::bytes::{self, BytesError};
use fogbow::covariance::{FrequencyPhotons, Grid, Lattice, LatticeError, OccluderCell, Occluders, Voxel, merge};
use fogbow::host::{Medium, Scene};
use fogbow::math::Bounds;
use fogbow::path;
use fogbow::photon;
use fogbow::world::World;
use rayon::prelude::*;

use crate::files;
use crate::progress::Control;
use crate::seed::independent;

/// Walks are dealt out in this many parts, whatever the number of threads; parts are added in order.
const PARTS: u64 = 16;

/// Sets the random numbers of grids apart from those of pixels.
const GRID_KEY: u64 = 0xc0fa_71a4_ce00_0000;

/// Walks between looks at whether to stop.
const WALKS_PER_LOOK: u64 = 256;

/// How a grid is filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Photons sent out.
    pub paths: u64,
    /// Cells along the longest side of the bounds.
    pub edge: u32,
    /// Rays along each side of a cell that look for occluders; 0: nothing occludes.
    pub occluder_rays: u32,
    /// Threads; 0 is one per processor.
    pub threads: usize,
    /// Chooses other random numbers.
    pub seed: u64,
}

impl Default for Settings {
    /// 100 000 photons into 64 cells along the longest side.
    fn default() -> Self {
        Self { paths: 100_000, edge: 64, occluder_rays: 2, threads: 0, seed: 0 }
    }
}

/// A filled grid that owns its voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct CovarianceGrid {
    lattice: Lattice,
    voxels: Vec<Voxel>,
    /// Photons that filled it.
    pub paths: u64,
}

/// Why a grid cannot be filled.
#[derive(Debug)]
pub enum FillError {
    /// The bounds or the number of cells.
    Lattice(LatticeError),
    /// No photons asked for.
    NoPaths,
    /// There is no memory for it.
    Memory,
    /// Threads cannot be started.
    Threads(String),
    /// The host stopped it.
    Cancelled,
}

impl fmt::Display for FillError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lattice(error) => error.fmt(f),
            Self::NoPaths => f.write_str("a covariance grid needs at least one path"),
            Self::Memory => f.write_str("there is no memory for the covariance grid"),
            Self::Threads(reason) => write!(f, "threads cannot be started: {reason}"),
            Self::Cancelled => f.write_str("stopped while the covariance grid was filled"),
        }
    }
}

impl core::error::Error for FillError {}

impl From<LatticeError> for FillError {
    fn from(error: LatticeError) -> Self {
        Self::Lattice(error)
    }
}

fn cells<T: Copy>(count: usize, empty: T) -> Result<Vec<T>, FillError> {
    let mut cells = Vec::new();
    cells.try_reserve_exact(count).map_err(|_| FillError::Memory)?;
    cells.resize(count, empty);
    Ok(cells)
}

/// Sends photons through `world` and gathers the covariance of the fluence within `bounds`.
///
/// `paths` limits the walks as it limits a path tracer's paths.
///
/// # Errors
/// Bounds without extent, too many cells for the memory, no photons; when the host stops it.
///
/// ```
/// use fogbow::{host::Empty, light::{Light, PhongLight}, math::{Bounds, Vec3}, medium::Homogeneous};
/// use fogbow::{path, phase::Lobe, spectrum::Spectrum, world::World};
/// use fogbow_std::{covariance::{Settings, fill}, progress::Control};
/// let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.1), Lobe::Isotropic)?;
/// let spot = [Light::Phong(PhongLight::new(Vec3::ZERO, Vec3::Z, 200.0, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: &spot };
/// let bounds = Bounds { min: Vec3::new(-0.5, -0.5, 0.0), max: Vec3::new(0.5, 0.5, 2.0) };
/// let settings = Settings { paths: 2000, edge: 16, ..Settings::default() };
/// let grid = fill(&world, &bounds, &path::Settings::default(), &settings, &Control::default())?;
/// // Across the beam light varies, along it hardly.
/// let gamma = grid.view().covariance(Vec3::new(0.0, 0.0, 1.0)).unwrap();
/// assert!(gamma.xx > 10.0 * gamma.zz);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fill<M: Medium + Sync + ?Sized, S: Scene + Sync + ?Sized>(
    world: &World<'_, M, S>,
    bounds: &Bounds,
    paths: &path::Settings,
    settings: &Settings,
    control: &Control<'_>,
) -> Result<CovarianceGrid, FillError> {
    if settings.paths == 0 {
        return Err(FillError::NoPaths);
    }
    let lattice = Lattice::cubic(*bounds, settings.edge)?;
    let mut voxels = cells(lattice.cell_count(), Voxel::EMPTY)?;
    let rays = settings.occluder_rays;
    let mut near = cells(if rays > 0 { lattice.cell_count() } else { 0 }, OccluderCell::default())?;
    let occluders = if rays > 0 {
        let mut occluders = Occluders::new(lattice, &mut near)?;
        occluders.add_scene(world.scene, rays);
        Some(occluders)
    } else {
        None
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| FillError::Threads(error.to_string()))?;
    let part = |part: u64| -> Result<Vec<Voxel>, FillError> {
        let mut voxels = cells(lattice.cell_count(), Voxel::EMPTY)?;
        let mut photons = FrequencyPhotons::new(*world, occluders.as_ref(), lattice);
        let (from, to) = (settings.paths * part / PARTS, settings.paths * (part + 1) / PARTS);
        for walk in from..to {
            if walk % WALKS_PER_LOOK == 0 && control.is_cancelled() {
                return Err(FillError::Cancelled);
            }
            let mut rng = independent(settings.seed, GRID_KEY | walk >> 32, walk as u32);
            photon::trace(world, bounds, paths, &mut rng, &mut |event| photons.visit(event, &mut voxels));
        }
        Ok(voxels)
    };
    pool.install(|| {
        let together = rayon::current_num_threads().max(1) as u64;
        let mut next = 0;
        while next < PARTS {
            let end = (next + together).min(PARTS);
            let these: Vec<u64> = (next..end).collect();
            let parts: Vec<_> = these.into_par_iter().with_max_len(1).map(part).collect::<Result<_, _>>()?;
            parts.iter().for_each(|part| merge(&mut voxels, part));
            next = end;
        }
        Ok(CovarianceGrid { lattice, voxels, paths: settings.paths })
    })
}

impl CovarianceGrid {
    /// The grid, to be asked.
    ///
    /// # Panics
    /// Never: there is one voxel per cell.
    #[must_use]
    pub fn view(&self) -> Grid<'_> {
        Grid::new(self.lattice, &self.voxels, self.paths).expect("one voxel per cell")
    }

    /// Bytes of memory held by voxels.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.voxels.as_slice())
    }
}

/// What is wrong with a file of a covariance grid.
#[derive(Debug)]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: Problem,
}

/// Why a file of a grid is not used.
#[derive(Debug)]
#[non_exhaustive]
pub enum Problem {
    /// The system cannot read or write it.
    Io(io::Error),
    /// It is a directory or a device.
    NoFile,
    /// Its content.
    Content(BytesError),
    /// There is no memory for it.
    Memory,
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.path.display())?;
        match &self.problem {
            Problem::Io(error) => error.fmt(f),
            Problem::NoFile => f.write_str("not a file"),
            Problem::Content(error) => error.fmt(f),
            Problem::Memory => f.write_str("there is no memory for the covariance grid"),
        }
    }
}

impl core::error::Error for FileError {}

/// Writes a grid to a file; the file that was there is lost only when the new one is complete.
///
/// # Errors
/// What the system says.
pub fn save(file: impl AsRef<Path>, grid: &CovarianceGrid, tag: u64) -> Result<(), FileError> {
    let path = file.as_ref();
    let mut all = Vec::with_capacity(bytes::byte_count(&grid.lattice));
    let Ok(()) = bytes::write(&grid.view(), tag, |part| {
        all.extend_from_slice(part);
        Ok::<(), core::convert::Infallible>(())
    });
    files::replace(path, &all).map_err(|error| FileError { path: path.to_owned(), problem: Problem::Io(error) })
}

/// Reads a grid that [`save`] wrote for the same `tag`.
///
/// # Errors
/// What the system says, or what is wrong with the file.
pub fn load(file: impl AsRef<Path>, tag: u64) -> Result<CovarianceGrid, FileError> {
    let path = file.as_ref();
    let read = || -> Result<CovarianceGrid, Problem> {
        let all = files::read(path).map_err(Problem::Io)?.ok_or(Problem::NoFile)?;
        let header = bytes::header(&all, tag).map_err(Problem::Content)?;
        let mut voxels = cells(header.lattice.cell_count(), Voxel::EMPTY).map_err(|_| Problem::Memory)?;
        bytes::read_into(&all, tag, &mut voxels).map_err(Problem::Content)?;
        Ok(CovarianceGrid { lattice: header.lattice, voxels, paths: header.paths })
    };
    read().map_err(|problem| FileError { path: path.to_owned(), problem })
}
