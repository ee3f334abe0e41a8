//! Filling grids, as work in rounds.
//!
//! First rows of rays look for occluders, then walks of photons leave what they carry. Jobs list what they find, and the
//! work adds it up in the order of rays and walks: sums of floating-point numbers have the same bits however jobs are
//! dealt out. Walks are summed in [`PARTS`] parts that are then added in order, so that late photons are not lost in the
//! rounding of sums that are large already; one part is held at a time.

use core::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::grid::{CovarianceGrid, merge};
use super::lattice::{Lattice, LatticeError};
use super::metrics::Voxel;
use super::occluders::{OccluderCell, Occluders, row_count, scan};
use super::photon::FrequencyPhotons;
use crate::host::{Medium, Scene};
use crate::math::Bounds;
use crate::sampling::independent;
use crate::storage::{Full, List};
use crate::work::Rounds;
use crate::world::{Outline, World};
use crate::{path, photon};

/// Parts in which walks are summed. More: more passes over all cells; fewer: longer sums of single precision.
const PARTS: u64 = 16;

/// Sets the random numbers of grids apart from those of pixels.
const GRID_KEY: u64 = 0xc0fa_71a4_ce00_0000;

/// Walks of the first round, a job each: they tell how much a walk leaves.
const FIRST_WALKS: u64 = 256;

/// What a job leaves on average, at a fifth of a microsecond each. More: jobs take longer than some milliseconds, and
/// results wait in more memory; fewer: hosts are busy with handing out jobs.
const DEPOSITS_PER_JOB: u64 = 4096;

/// Walks of a job at most, where they leave little because most fly past the grid: these take their time, too.
const MOST_WALKS: u64 = 256;

/// Photons of a grid. Noise of covariances falls with the root, and time goes with it; with much fewer, there are cells in the
/// dark that no photon met, where steps and filters know nothing.
const PHOTONS: u64 = 100_000;

/// Photons of a grid for kernels of photon beams: about a tenth of the paths of a picture (Belcour et al. 2014, § 6.5). Radii are bounded by
/// their neighbours', which evens out the noise of single cells.
const KERNEL_PHOTONS: u64 = 10_000;

/// Cells along the longest side. More: borders of shadows are told more sharply, by fewer photons in every cell;
/// fewer: light at the border of a shaft is taken to vary over all of a wide cell.
const EDGE: u32 = 64;

/// Rays along each side of a cell that look for occluders. One misses surfaces that cover less than half of a cell; more find what
/// the mean of a cell's surface points forgets. Worlds without surfaces have them too: an
/// outline does not see every wire, and a wire has a shadow.
const OCCLUDER_RAYS: u32 = 2;

/// How a grid is filled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The box (m) in which light is gathered. It should hold all surfaces and media: by it, distant lights know where to shine.
    pub bounds: Bounds,
    /// Photons sent out, at least one.
    pub photons: u64,
    /// Cells along the longest side of the bounds, from 1 to [`MAX_EDGE`](super::MAX_EDGE).
    pub edge: u32,
    /// Rays along each side of a cell that look for occluders; 0: nothing occludes.
    pub occluder_rays: u32,
    /// Limits walks as it limits the paths of a path tracer.
    pub paths: path::Settings,
    /// Chooses other random numbers.
    pub seed: u64,
}

impl Settings {
    /// What suits a box (m); seed 0, walks without limit. See the constants of this module for what each number does.
    ///
    /// ```
    /// # use fogbow::{covariance::Settings, math::{Bounds, Vec3}};
    /// let settings = Settings::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE });
    /// assert_eq!((settings.photons, settings.edge), (100_000, 64));
    /// ```
    #[must_use]
    pub fn new(bounds: Bounds) -> Self {
        Self {
            bounds,
            photons: PHOTONS,
            edge: EDGE,
            occluder_rays: OCCLUDER_RAYS,
            paths: path::Settings::default(),
            seed: 0,
        }
    }

    /// What suits a world: cells and photons do not depend on what is in it, because covariances are asked for relative to its size.
    ///
    /// ```
    /// # use fogbow::{covariance::Settings, host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// assert_eq!(Settings::for_outline(&outline), Settings::new(bounds));
    /// ```
    #[must_use]
    pub fn for_outline(outline: &Outline) -> Self {
        Self::new(outline.bounds)
    }

    /// With as many photons as kernels of photon beams need ([`Radii`](super::Radii)).
    ///
    /// ```
    /// # use fogbow::{covariance::Settings, math::{Bounds, Vec3}};
    /// let settings = Settings::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE });
    /// assert!(settings.for_kernels().photons < settings.photons);
    /// ```
    #[must_use]
    pub fn for_kernels(self) -> Self {
        Self { photons: KERNEL_PHOTONS, ..self }
    }
}

/// Why a grid cannot be filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FillError {
    /// The bounds or the number of cells.
    Lattice(LatticeError),
    /// No photons asked for.
    NoPhotons,
    /// The memory does not have one element per cell.
    Memory,
}

impl core::fmt::Display for FillError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Lattice(error) => error.fmt(f),
            Self::NoPhotons => f.write_str("a covariance grid needs at least one photon"),
            Self::Memory => f.write_str("there is no memory for the covariance grid"),
        }
    }
}

impl core::error::Error for FillError {}

impl From<LatticeError> for FillError {
    fn from(error: LatticeError) -> Self {
        if error == LatticeError::Storage { Self::Memory } else { Self::Lattice(error) }
    }
}

/// What a photon leaves in a cell.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Deposit {
    voxel: Voxel,
    cell: u32,
}

/// A point of a surface that stops light.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct SurfacePoint {
    point: Vec3,
    normal: Vec3,
}

/// What a job of a [`Fill`] leaves.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct GridOutput<'o> {
    surface: List<'o, SurfacePoint>,
    deposits: List<'o, Deposit>,
    is_cut: bool,
}

impl<'o> GridOutput<'o> {
    /// In lent memory: for as many surface points as a row of rays meets, and for as many cells as some walks cross. What finds no
    /// room is left out: [`Fill::is_cut`].
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, spectrum::Spectrum, work, world::World};
    /// use fogbow::covariance::{Deposit, Fill, GridOutput, Settings};
    /// let lamps = [Light::Point(PointLight::new(Vec3::splat(0.5), Spectrum::ONE)?)];
    /// let world = World { medium: &Empty, scene: &Empty, lights: (&lamps).into() };
    /// let settings = Settings { photons: 100, edge: 8, ..Settings::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }) };
    /// let is_cut = |deposits: &mut [Deposit]| -> Result<bool, Box<dyn core::error::Error>> {
    ///     let mut fill = Fill::new(settings)?;
    ///     work::finish(&mut fill, &world, &mut GridOutput::lent(&mut [], deposits));
    ///     Ok(fill.is_cut())
    /// };
    /// // Every flight from the middle to the walls crosses several cells. No surface stops any.
    /// assert!(!is_cut(&mut [Deposit::default(); 8192])? && is_cut(&mut [Deposit::default(); 3])?);
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn lent(surface: &'o mut [SurfacePoint], deposits: &'o mut [Deposit]) -> Self {
        Self { surface: List::from(surface), deposits: List::from(deposits), is_cut: false }
    }
}

/// Memory of a [`Fill`].
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct GridMemory<'s> {
    /// One element per cell: what the grid will be.
    pub voxels: List<'s, Voxel>,
    /// One element per cell: the part that is being summed.
    pub part: List<'s, Voxel>,
    /// One element per cell, or none without rays that look for occluders.
    pub occluders: List<'s, OccluderCell>,
}

/// What the jobs of a round do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Round {
    /// Look for occluders.
    Look,
    /// Send photons: walks `from..to`, so many in each job.
    Walk {
        from: u64,
        to: u64,
        each: u64,
    },
    Done,
}

/// The fill of a grid, as [`Rounds`] of jobs in a [`World`]: Belcour et al. 2014, Algorithm 2.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PhongLight}, math::{Bounds, Vec3}, medium::Homogeneous};
/// # use fogbow::{phase::Lobe, spectrum::Spectrum, work, world::World};
/// # #[cfg(feature = "alloc")] {
/// use fogbow::covariance::{Fill, GridOutput, Settings};
/// let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.1), Lobe::Isotropic)?;
/// let spot = [Light::Phong(PhongLight::new(Vec3::ZERO, Vec3::Z, 200.0, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&spot).into() };
/// let bounds = Bounds { min: Vec3::new(-0.5, -0.5, 0.0), max: Vec3::new(0.5, 0.5, 2.0) };
/// let mut fill = Fill::new(Settings { photons: 2000, edge: 16, ..Settings::new(bounds) })?;
/// assert_eq!((fill.sent(), fill.share()), (0, 0.0));
/// work::finish(&mut fill, &world, &mut GridOutput::default());
/// assert_eq!((fill.sent(), fill.share(), fill.is_cut()), (2000, 1.0, false));
/// let grid = fill.finish();
/// // Across the beam light varies, along it hardly.
/// let gamma = grid.view().covariance(Vec3::new(0.0, 0.0, 1.0)).unwrap();
/// assert!(gamma.xx > 10.0 * gamma.zz);
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Fill<'s> {
    settings: Settings,
    lattice: Lattice,
    voxels: List<'s, Voxel>,
    /// The part that is being summed, and its number.
    part: List<'s, Voxel>,
    number: u64,
    occluders: Option<Occluders<'s>>,
    round: Round,
    jobs: u32,
    taken: u32,
    /// What walks of completed rounds have left.
    deposits: u64,
    is_cut: bool,
}

impl<'s> Fill<'s> {
    /// In memory that grows.
    ///
    /// # Errors
    /// Bounds without extent, no cells or too many, also for the memory; no photons.
    #[cfg(feature = "alloc")]
    pub fn new(settings: Settings) -> Result<Fill<'static>, FillError> {
        Fill::new_in(GridMemory::default(), settings)
    }

    /// In lent memory.
    ///
    /// # Errors
    /// As [`Fill::new`].
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, work, world::World};
    /// use fogbow::covariance::{Deposit, Fill, GridMemory, GridOutput, OccluderCell, Settings, SurfacePoint, Voxel};
    /// let (mut all, mut part) = ([Voxel::EMPTY; 64], [Voxel::EMPTY; 64]);
    /// let mut cells = [OccluderCell::default(); 64];
    /// let memory = GridMemory { voxels: (&mut all[..]).into(), part: (&mut part[..]).into(), occluders: (&mut cells[..]).into() };
    /// let lamps = [Light::Point(PointLight::new(Vec3::splat(0.6), fogbow::spectrum::Spectrum::ONE)?)];
    /// let world = World { medium: &Empty, scene: &Empty, lights: (&lamps).into() };
    /// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// let mut fill = Fill::new_in(memory, Settings { photons: 100, edge: 4, ..Settings::new(bounds) })?;
    /// let (mut surface, mut deposits) = ([SurfacePoint::default(); 64], [Deposit::default(); 8192]);
    /// work::finish(&mut fill, &world, &mut GridOutput::lent(&mut surface, &mut deposits));
    /// assert!(!fill.is_cut() && fill.sent() == 100);
    /// assert!(fill.finish().view().fluence(Vec3::splat(0.6)).unwrap() > 0.0);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn new_in(memory: GridMemory<'s>, settings: Settings) -> Result<Self, FillError> {
        if settings.photons == 0 {
            return Err(FillError::NoPhotons);
        }
        let lattice = Lattice::cubic(settings.bounds, settings.edge)?;
        let GridMemory { mut voxels, mut part, occluders } = memory;
        for list in [&mut voxels, &mut part] {
            list.reset(lattice.cell_count(), Voxel::EMPTY).map_err(|Full| FillError::Memory)?;
        }
        let rays = settings.occluder_rays;
        let occluders = if rays > 0 { Some(Occluders::new(lattice, occluders)?) } else { None };
        let mut fill = Self {
            settings,
            lattice,
            voxels,
            part,
            number: 0,
            occluders,
            round: Round::Look,
            jobs: row_count(&lattice, rays),
            taken: 0,
            deposits: 0,
            is_cut: false,
        };
        if fill.jobs == 0 {
            fill.walk_from(0);
        }
        Ok(fill)
    }

    /// Photons whose walks are summed.
    #[must_use]
    pub fn sent(&self) -> u64 {
        match self.round {
            Round::Look => 0,
            Round::Walk { from, to, each } => to.min(from + u64::from(self.taken) * each),
            Round::Done => self.settings.photons,
        }
    }

    /// The share of photons whose walks are summed, in [0, 1].
    #[must_use]
    pub fn share(&self) -> f32 {
        self.sent() as f32 / self.settings.photons as f32
    }

    /// Whether lent memory was too small for what a job found, and the rest was left out.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// The grid, filled so far.
    #[must_use]
    pub fn finish(mut self) -> CovarianceGrid<'s> {
        let sent = self.sent();
        if self.round != Round::Done {
            merge(self.voxels.as_mut_slice(), self.part.as_slice());
        }
        CovarianceGrid::new(self.lattice, self.voxels, sent)
    }

    /// The first walk of a part.
    fn start(&self, part: u64) -> u64 {
        (u128::from(self.settings.photons) * u128::from(part) / u128::from(PARTS)) as u64
    }

    /// The next round of walks, from number `from` on; after those of a part it is added to the others.
    fn walk_from(&mut self, from: u64) {
        while self.number < PARTS && self.start(self.number + 1) <= from {
            merge(self.voxels.as_mut_slice(), self.part.as_slice());
            self.part.as_mut_slice().fill(Voxel::EMPTY);
            self.number += 1;
        }
        self.taken = 0;
        if self.number == PARTS {
            (self.round, self.jobs) = (Round::Done, 0);
            return;
        }
        let end = self.start(self.number + 1);
        let (to, each) = if from == 0 {
            (end.min(FIRST_WALKS), 1)
        } else {
            (end, (DEPOSITS_PER_JOB * from / self.deposits.max(1)).clamp(1, MOST_WALKS))
        };
        let to = to.min(from.saturating_add(each * u64::from(u32::MAX)));
        self.round = Round::Walk { from, to, each };
        self.jobs = (to - from).div_ceil(each) as u32;
    }
}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Rounds<World<'_, M, S>> for Fill<'_> {
    type Output<'o> = GridOutput<'o>;

    fn jobs(&self) -> Range<u32> {
        self.taken..self.jobs
    }

    fn run(&self, job: u32, world: &World<'_, M, S>, output: &mut GridOutput<'_>) {
        let GridOutput { surface, deposits, is_cut } = output;
        surface.clear();
        deposits.clear();
        *is_cut = false;
        match self.round {
            Round::Look => scan(&self.lattice, world.scene, self.settings.occluder_rays, job, |point, normal| {
                *is_cut |= surface.push(SurfacePoint { point, normal }).is_err();
            }),
            Round::Walk { from, to, each } => {
                let Settings { ref bounds, ref paths, seed, .. } = self.settings;
                let mut photons = FrequencyPhotons::new(*world, self.occluders.as_ref(), self.lattice);
                let first = from + u64::from(job) * each;
                for walk in first..to.min(first + each) {
                    let mut rng = independent(seed, GRID_KEY | walk >> 32, walk as u32);
                    photon::trace(world, bounds, paths, &mut rng, &mut |event| {
                        photons.visit_each(event, &mut |cell, covariance, energy| {
                            let mut voxel = Voxel::EMPTY;
                            voxel.add_covariance(covariance, energy);
                            *is_cut |= deposits.push(Deposit { voxel, cell: cell as u32 }).is_err();
                        });
                    });
                }
            }
            Round::Done => {}
        }
    }

    fn accept(&mut self, output: &GridOutput<'_>) {
        if self.taken >= self.jobs {
            return;
        }
        self.is_cut |= output.is_cut;
        if let Some(occluders) = &mut self.occluders {
            output.surface.as_slice().iter().for_each(|at| occluders.add(at.point, at.normal));
        }
        let voxels = self.part.as_mut_slice();
        for deposit in output.deposits.as_slice() {
            if let Some(voxel) = voxels.get_mut(deposit.cell as usize) {
                voxel.merge(&deposit.voxel);
            }
        }
        self.deposits += output.deposits.len() as u64;
        self.taken += 1;
        if self.taken == self.jobs {
            let next = self.sent();
            self.walk_from(next);
        }
    }

    fn stage(&self) -> &'static str {
        "fill grid"
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::host::Hit;
    use crate::light::{Light, PhongLight, PointLight};
    use crate::math::Ray;
    use crate::medium::Homogeneous;
    use crate::phase::Lobe;
    use crate::spectrum::Spectrum;
    use crate::surface::Surface;
    use crate::work::{finish, step};

    const BOUNDS: Bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };

    /// A black plate across x with a slit along z.
    struct Slit;

    impl Scene for Slit {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let distance = -ray.origin.x / ray.direction.x;
            if !(distance > 0.0 && distance < ray.length) || ray.at(distance).y.abs() < 0.3 {
                return None;
            }
            let normal = Vec3::X * -ray.direction.x.signum();
            Some(Hit { distance, normal, shading: normal, surface: Surface::BLACK, light: None })
        }
    }

    fn with_world(test: impl FnOnce(&World<'_, Homogeneous, Slit>)) {
        let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.8), Lobe::Isotropic).unwrap();
        let point = PointLight::new(Vec3::new(-0.7, 0.1, 0.2), Spectrum::ONE).unwrap();
        let spot = PhongLight::new(Vec3::NEG_ONE, Vec3::ONE, 30.0, Spectrum::new(1.0, 0.5, 0.2)).unwrap();
        test(&World { medium: &fog, scene: &Slit, lights: (&[Light::Point(point), Light::Phong(spot)]).into() });
    }

    /// Walks of all parts in a plain loop, into voxels of each part.
    fn plainly(world: &World<'_, Homogeneous, Slit>, settings: &Settings) -> Vec<Voxel> {
        let lattice = Lattice::cubic(settings.bounds, settings.edge).unwrap();
        let mut occluders = Occluders::new(lattice, List::default()).unwrap();
        occluders.add_scene(world.scene, settings.occluder_rays);
        let mut all = vec![Voxel::EMPTY; lattice.cell_count()];
        for part in 0..PARTS {
            let mut voxels = vec![Voxel::EMPTY; lattice.cell_count()];
            let mut photons = FrequencyPhotons::new(*world, Some(&occluders), lattice);
            for walk in settings.photons * part / PARTS..settings.photons * (part + 1) / PARTS {
                let mut rng = independent(settings.seed, GRID_KEY | walk >> 32, walk as u32);
                photon::trace(world, &settings.bounds, &settings.paths, &mut rng, &mut |event| {
                    photons.visit(event, &mut voxels);
                });
            }
            merge(&mut all, &voxels);
        }
        all
    }

    fn bits(voxels: &[Voxel]) -> Vec<u8> {
        bytemuck::cast_slice(voxels).to_vec()
    }

    #[test]
    fn jobs_sum_the_bits_of_a_plain_loop() {
        with_world(|world| {
            for photons in [1, 5, 9001] {
                let settings = Settings { photons, edge: 9, seed: 3, ..Settings::new(BOUNDS) };
                let mut fill = Fill::new(settings).unwrap();
                finish(&mut fill, world, &mut GridOutput::default());
                assert!(!fill.is_cut() && fill.sent() == photons);
                let grid = fill.finish();
                assert!(grid.view().voxels().iter().any(|voxel| voxel.weight > 0.0));
                assert!(bits(grid.view().voxels()) == bits(&plainly(world, &settings)), "{photons} photons");
            }
        });
    }

    #[test]
    fn a_fill_that_was_left_is_a_grid_of_the_photons_so_far() {
        with_world(|world| {
            let settings = Settings { photons: 4000, edge: 5, ..Settings::new(BOUNDS) };
            let mut fill = Fill::new(settings).unwrap();
            let mut output = GridOutput::default();
            while fill.sent() < 700 {
                assert!(step(&mut fill, world, &mut output));
            }
            let sent = fill.sent();
            let grid = fill.finish();
            assert_eq!(grid.view().paths(), sent);
            let energy = |voxels: &[Voxel]| voxels.iter().map(|voxel| voxel.weight).sum::<f32>();
            let all = energy(&plainly(world, &settings)) / 4000.0;
            let some = energy(grid.view().voxels()) / sent as f32;
            // A photon's length in the box varies by about its half.
            assert!((some / all - 1.0).abs() < 0.1, "{some} instead of {all}");
        });
    }

    #[test]
    fn memory_that_is_too_small_is_told() {
        let settings = Settings { edge: 4, ..Settings::new(BOUNDS) };
        let memory = |voxels, part, occluders| GridMemory { voxels, part, occluders };
        let mut few = [Voxel::EMPTY; 63];
        let lent = memory(List::from(&mut few[..]), List::default(), List::default());
        assert_eq!(Fill::new_in(lent, settings).err(), Some(FillError::Memory));
        let mut few = [OccluderCell::default(); 63];
        let lent = memory(List::default(), List::default(), List::from(&mut few[..]));
        assert_eq!(Fill::new_in(lent, settings).err(), Some(FillError::Memory));
        assert_eq!(Fill::new(Settings { photons: 0, ..settings }).err(), Some(FillError::NoPhotons));
        assert!(matches!(Fill::new(Settings { edge: 0, ..settings }).err(), Some(FillError::Lattice(_))));
        with_world(|world| {
            let mut fill = Fill::new(settings).unwrap();
            let (mut surface, mut deposits) = ([SurfacePoint::default(); 64], [Deposit::default(); 3]);
            finish(&mut fill, world, &mut GridOutput::lent(&mut surface, &mut deposits));
            assert!(fill.is_cut());
        });
    }
}
