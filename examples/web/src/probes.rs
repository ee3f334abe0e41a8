//! Probe grids: baked job by job, looked up, handed out as textures.

use alloc::vec::Vec;

use fogbow::bake::{
    Bake, BakeMemory, BakeSettings, BakedProbes, Orders, ProbeBasis, ProbeGrid, ProbeState, Quantity, bytes,
};
use fogbow::math::Bounds;
use fogbow::spectrum::Spectrum;
use fogbow::work::{self, Rounds};

use super::caches::WebCaches;
use super::words::{Fault, Words};
use super::world::{CoreWorld, WebWorld};

/// A grid of probes of a world, while it is baked and after.
#[derive(Debug)]
pub struct WebProbes {
    settings: BakeSettings,
    /// None only while a step of it runs.
    bake: Option<Bake<'static, 'static>>,
    output: BakedProbes<'static>,
    jobs: [u32; 2],
    share: f32,
    tag: u64,
}

impl WebProbes {
    /// From words: box, counts, degree of spherical harmonics, orders (0: all, 1: all but light straight from lamps, 2: only what was scattered
    /// more than once), quantity (0: in-scattered radiance, 1: irradiance), relative error, directions of a pass (0: as usual), passes at most (0: as usual), seed.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn new(world: &WebWorld, words: &[u32]) -> Result<Self, Fault> {
        let mut words = Words::new(words);
        let bounds = Bounds { min: words.vector()?, max: words.vector()? };
        let counts = [words.integer()?, words.integer()?, words.integer()?];
        let (degree, orders, quantity) = (words.integer()?, words.integer()?, words.integer()?);
        let error = words.float()?;
        let (directions, passes, seed) = (words.integer()?, words.integer()?, words.integer()?);
        let orders = match orders {
            0 => Orders::All,
            1 => Orders::Indirect,
            2 => Orders::Multiple,
            _ => return Err(Fault::new("no such orders of light")),
        };
        let quantity = match quantity {
            0 => Quantity::InScattered,
            1 => Quantity::Irradiance,
            _ => return Err(Fault::new("no such quantity of light")),
        };
        let usual = BakeSettings::for_outline(&world.outline(), counts);
        let settings = BakeSettings {
            bounds: if bounds.min.x.is_nan() { usual.bounds } else { bounds },
            basis: ProbeBasis::SphericalHarmonics { degree },
            orders,
            quantity,
            error,
            directions: if directions == 0 { usual.directions } else { directions },
            most_passes: if passes == 0 { usual.most_passes } else { passes },
            seed: u64::from(seed),
            ..usual
        };
        let bake = Bake::new(settings)?;
        let jobs = jobs_of(&bake);
        Ok(Self { settings, bake: Some(bake), output: BakedProbes::default(), jobs, share: 0.0, tag: world.tag() })
    }

    /// Does something with the bake, by these caches.
    fn with_bake<T>(
        &mut self,
        caches: Option<&WebCaches>,
        work: impl FnOnce(&mut Bake<'static, '_>, &mut BakedProbes<'static>) -> T,
    ) -> Result<T, Fault> {
        let mut bake: Bake<'static, '_> = self.bake.take().ok_or_else(no_probes)?;
        if let Some(caches) = caches.and_then(WebCaches::caches) {
            bake = bake.with_caches(caches);
        }
        let done = work(&mut bake, &mut self.output);
        self.jobs = jobs_of(&bake);
        if self.jobs[0] == 0 || self.jobs[0] == self.jobs[1] {
            // Known only when a round has just been planned.
            self.share = bake.share();
        }
        self.bake = Some(bake.without_caches());
        Ok(done)
    }

    /// Numbers of the jobs that may run now; none once all is done.
    #[must_use]
    pub fn jobs(&self) -> [u32; 2] {
        self.jobs
    }

    /// About what share of the work is done, in [0, 1].
    #[must_use]
    pub fn share(&self) -> f32 {
        if self.jobs[0] == self.jobs[1] { 1.0 } else { self.share }
    }

    /// Runs a job of this round; what it leaves, as bytes.
    ///
    /// # Errors
    /// None but of memory.
    pub fn run(&mut self, world: &WebWorld, caches: Option<&WebCaches>, job: u32) -> Result<Vec<u8>, Fault> {
        self.with_bake(caches, |bake, output| world.with(|world| bake.run(job, world, output)))?;
        Ok(self.output.to_bytes())
    }

    /// Takes what the next job has left, here or elsewhere.
    ///
    /// # Errors
    /// Bytes that are not what a job leaves.
    pub fn accept(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        self.output.read(bytes)?;
        self.with_bake(None, |bake, output| Rounds::<CoreWorld<'static>>::accept(bake, output))
    }

    /// Runs so many jobs, one by one; whether more are due.
    ///
    /// # Errors
    /// None but of memory.
    pub fn bake(&mut self, world: &WebWorld, caches: Option<&WebCaches>, jobs: u32) -> Result<bool, Fault> {
        self.with_bake(caches, |bake, output| world.with(|world| (0..jobs).all(|_| work::step(bake, world, output))))?;
        Ok(self.jobs[0] < self.jobs[1])
    }

    /// Bakes anew the bricks that have a part in a box, where the world has changed.
    ///
    /// # Errors
    /// None but of memory.
    pub fn bake_anew(&mut self, bounds: Bounds) -> Result<(), Fault> {
        self.with_bake(None, |bake, _| bake.bake_anew(bounds))
    }

    fn grid(&self) -> Result<&ProbeGrid<'static>, Fault> {
        self.bake.as_ref().map(Bake::grid).ok_or_else(no_probes)
    }

    /// Relative standard error; infinite before there are two passes.
    ///
    /// # Errors
    /// None but of memory.
    pub fn error(&self) -> Result<f32, Fault> {
        Ok(self.grid()?.relative_error())
    }

    /// Light at points in directions (unit), as was baked. The words of each: a point and a direction.
    ///
    /// # Errors
    /// No whole number of points.
    pub fn values(&self, words: &[u32]) -> Result<Vec<Spectrum>, Fault> {
        let grid = self.grid()?;
        let of = |words: &[u32]| {
            let mut words = Words::new(words);
            Ok(grid.value(words.vector()?, words.vector()?))
        };
        words.chunks(6).map(of).collect()
    }

    /// The numbers of all probes, number after number, each four floats: red, green, blue, and 1 where the probe is valid, else 0. Then the
    /// medium: albedo, and extinction (m⁻¹; mean of the channels). Then planes of two surfaces around probes, and 0. As 3D textures have them. If `is_dilated`, light
    /// has spread into invalid probes.
    ///
    /// # Errors
    /// No memory.
    pub fn textures(&self, is_dilated: bool) -> Result<Vec<f32>, Fault> {
        let grid = self.grid()?;
        // The bake goes on with what it has found itself.
        let mut copy = bytes::read(&self.save()?, self.tag, BakeMemory::default())?;
        if is_dilated {
            copy.dilate();
        }
        let (cells, numbers) = (grid.lattice().cell_count(), grid.basis().count());
        let mut all = Vec::with_capacity(4 * cells * (numbers + 3));
        for number in 0..numbers {
            for (cell, probe) in grid.probes().iter().enumerate() {
                let is_valid = probe.state() == ProbeState::Valid;
                all.extend_from_slice(&copy.held(cell)[number].0);
                all.push(f32::from(u8::from(is_valid)));
            }
        }
        for probe in grid.probes() {
            all.extend_from_slice(&probe.albedo.0);
            all.push(probe.extinction.mean());
        }
        for number in 0..2 {
            for probe in grid.probes() {
                all.extend_from_slice(&probe.planes()[number].extend(0.0).to_array());
            }
        }
        Ok(all)
    }

    /// As bytes, whether done or not.
    ///
    /// # Errors
    /// None but of memory.
    pub fn save(&self) -> Result<Vec<u8>, Fault> {
        let grid = self.grid()?;
        let mut all = Vec::with_capacity(bytes::byte_count(grid));
        let Ok(()) = bytes::write(grid, self.tag, |part| {
            all.extend_from_slice(part);
            Ok::<(), core::convert::Infallible>(())
        });
        Ok(all)
    }

    /// From bytes; a bake goes on from there.
    ///
    /// # Errors
    /// Damage, another grid, another world.
    pub fn load(&mut self, saved: &[u8]) -> Result<(), Fault> {
        let grid = bytes::read(saved, self.tag, BakeMemory::default())?;
        let bake = Bake::resume(grid, self.settings)?;
        self.jobs = jobs_of(&bake);
        self.bake = Some(bake);
        Ok(())
    }
}

fn no_probes() -> Fault {
    Fault::new("there are no probes")
}

fn jobs_of(bake: &Bake<'static, '_>) -> [u32; 2] {
    let jobs = Rounds::<CoreWorld<'static>>::jobs(bake);
    [jobs.start, jobs.end]
}
