//! Probes of baked light: grids filled by paths or from caches, looked up, saved.

use core::fmt;
use core::ops::Range;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use fogbow::bake::{
    Bake, BakeError, BakeMemory, BakeSettings, BakedProbes, FlightMemory, MOST_COEFFICIENTS, MOST_PROBES, Orders,
    ProbeBasis, ProbeGrid, Quantity, bytes,
};
use fogbow::cache::RadianceCaches;
use fogbow::spectrum::Spectrum;
use fogbow::work::Rounds;

use crate::arguments::{self, Versioned};
use crate::caches::{self, fogbow_caches, save};
use crate::handles::{self, Object};
use crate::host::fogbow_box;
use crate::status::{
    FOGBOW_ERROR_ARGUMENT, FOGBOW_ERROR_BUSY, FOGBOW_ERROR_DATA, Failure, Outcome, fogbow_status, guard, no_memory,
    refused, wrong,
};
use crate::work::{self, Kind, Made, Place, Steps, Work, fogbow_work};
use crate::world::{self, OwnedWorld, fogbow_world};

/// A grid of probes that hold light. Read by many threads at a time.
#[derive(Debug)]
pub struct fogbow_probes {
    _opaque: [u8; 0],
}

/// Spherical harmonics of degree 2, 9 coefficients.
pub const FOGBOW_BASIS_SH2: u32 = 0;
/// Spherical harmonics of degree 0, 1 coefficient.
pub const FOGBOW_BASIS_SH0: u32 = 1;
/// Spherical harmonics of degree 1, 4 coefficients.
pub const FOGBOW_BASIS_SH1: u32 = 2;
/// Spherical harmonics of degree 3, 16 coefficients.
pub const FOGBOW_BASIS_SH3: u32 = 3;
/// Values towards +x, -x, +y, -y, +z, -z.
pub const FOGBOW_BASIS_AMBIENT_CUBE: u32 = 4;
/// Fluence (W/m²) alone, 1 number.
pub const FOGBOW_BASIS_FLUENCE: u32 = 5;

/// In-scattered radiance (W/(m² sr), without the scattering coefficient) towards a direction: it lights fog.
pub const FOGBOW_QUANTITY_IN_SCATTERED: u32 = 0;
/// Irradiance (W/m²) of a surface with the direction as its normal: it lights surfaces.
pub const FOGBOW_QUANTITY_IRRADIANCE: u32 = 1;

/// All light.
pub const FOGBOW_ORDERS_ALL: u32 = 0;
/// All but light straight from the lights.
pub const FOGBOW_ORDERS_INDIRECT: u32 = 1;
/// Light that the medium has scattered last.
pub const FOGBOW_ORDERS_MULTIPLE: u32 = 2;

/// What is baked, and how well. Zeros are what suits most, but for `counts` or `spacing`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_bake_settings {
    /// sizeof(fogbow_bake_settings).
    pub size: u32,
    /// Probes along x, y and z; all 0 for as many as cells of `spacing` fill the box.
    pub counts: [u32; 3],
    /// Side of a cell (m), where `counts` are 0.
    pub spacing: f32,
    /// What a probe holds, `FOGBOW_BASIS_…`.
    pub basis: u32,
    /// Which light of a direction, `FOGBOW_QUANTITY_…`.
    pub quantity: u32,
    /// Which light is in it, `FOGBOW_ORDERS_…`.
    pub orders: u32,
    /// Relative standard error that is enough; 0 for 0.02.
    pub error: f32,
    /// Passes at most, at least 2; 0 for 1024.
    pub most_passes: u32,
    /// Directions of a pass; 0 for 16.
    pub directions: u32,
    /// 1: `bounds` is the box that cells fill; 0: that of the world is.
    pub has_bounds: u32,
    /// The box that cells fill.
    pub bounds: fogbow_box,
    /// Chooses other random numbers.
    pub seed: u64,
    /// 1: light that was scattered before comes by photons that all probes share, many times faster: means over cells, without what media emit. 0: by paths from each probe.
    pub photons: u32,
    /// 0.
    pub reserved: u32,
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl Versioned for fogbow_bake_settings {}

fn basis_of(number: u32) -> Outcome<ProbeBasis> {
    Ok(match number {
        FOGBOW_BASIS_SH2 => ProbeBasis::SphericalHarmonics { degree: 2 },
        FOGBOW_BASIS_SH0 => ProbeBasis::SphericalHarmonics { degree: 0 },
        FOGBOW_BASIS_SH1 => ProbeBasis::SphericalHarmonics { degree: 1 },
        FOGBOW_BASIS_SH3 => ProbeBasis::SphericalHarmonics { degree: 3 },
        FOGBOW_BASIS_AMBIENT_CUBE => ProbeBasis::AmbientCube,
        FOGBOW_BASIS_FLUENCE => ProbeBasis::Fluence,
        _ => return wrong(format!("`settings->basis` is {number}, which none is")),
    })
}

fn number_of(basis: ProbeBasis) -> u32 {
    match basis {
        ProbeBasis::SphericalHarmonics { degree: 0 } => FOGBOW_BASIS_SH0,
        ProbeBasis::SphericalHarmonics { degree: 1 } => FOGBOW_BASIS_SH1,
        ProbeBasis::SphericalHarmonics { degree: 2 } => FOGBOW_BASIS_SH2,
        ProbeBasis::SphericalHarmonics { .. } => FOGBOW_BASIS_SH3,
        ProbeBasis::AmbientCube => FOGBOW_BASIS_AMBIENT_CUBE,
        ProbeBasis::Fluence => FOGBOW_BASIS_FLUENCE,
    }
}

impl fogbow_bake_settings {
    fn check(&self, world: &OwnedWorld) -> Outcome<BakeSettings> {
        let mut outline = world.outline();
        if self.has_bounds != 0 {
            outline.bounds = arguments::bounds(&self.bounds, "settings->bounds")?;
        }
        let usual = BakeSettings::for_outline(&outline, self.counts);
        let or = |given: u32, usual: u32| if given == 0 { usual } else { given };
        let settings = BakeSettings {
            basis: basis_of(self.basis)?,
            quantity: match self.quantity {
                FOGBOW_QUANTITY_IN_SCATTERED => Quantity::InScattered,
                FOGBOW_QUANTITY_IRRADIANCE => Quantity::Irradiance,
                other => return wrong(format!("`settings->quantity` is {other}, which none is")),
            },
            orders: match self.orders {
                FOGBOW_ORDERS_ALL => Orders::All,
                FOGBOW_ORDERS_INDIRECT => Orders::Indirect,
                FOGBOW_ORDERS_MULTIPLE => Orders::Multiple,
                other => return wrong(format!("`settings->orders` is {other}, which none are")),
            },
            error: if self.error == 0.0 {
                usual.error
            } else {
                arguments::within(self.error, 1e-5, 10.0, "settings->error")?
            },
            directions: or(self.directions, usual.directions).min(1 << 16),
            most_passes: or(self.most_passes, usual.most_passes),
            seed: self.seed,
            ..usual
        };
        if self.counts != [0; 3] {
            return Ok(settings);
        }
        let spacing = arguments::within(self.spacing, f32::MIN_POSITIVE, f32::MAX, "settings->spacing (or counts)")?;
        Ok(settings.with_spacing(spacing))
    }
}

/// A grid as probes are read.
pub(crate) struct Probes(RwLock<ProbeGrid<'static>>);

impl fmt::Debug for Probes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Probes").finish_non_exhaustive()
    }
}

impl Object for Probes {
    type Handle = fogbow_probes;
    const NAME: &'static str = "probes";
}

impl Probes {
    fn look(&self) -> RwLockReadGuard<'_, ProbeGrid<'static>> {
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A bake and the caches that it borrows. Fields are dropped in this order.
struct Borrowing {
    bake: Bake<'static, 'static>,
    _caches: Option<Arc<RadianceCaches<'static>>>,
}

/// A bake as work. `None` once its probes are taken.
pub(crate) struct BakeWork(RwLock<Option<Borrowing>>);

impl BakeWork {
    fn look(&self) -> RwLockReadGuard<'_, Option<Borrowing>> {
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }
}

fn taken() -> Failure {
    Failure(FOGBOW_ERROR_BUSY, "this bake is over: its probes were taken".to_owned())
}

impl Steps for BakeWork {
    fn jobs(&self) -> Outcome<Range<u32>> {
        Ok(self.look().as_ref().map_or(0..0, |of| Rounds::<Place<'_>>::jobs(&of.bake)))
    }

    fn stage(&self) -> Outcome<&'static str> {
        Ok("bake")
    }

    fn run(&self, job: u32, world: &OwnedWorld, made: Option<Made>) -> Outcome<Option<Made>> {
        let mut baked = if let Some(Made::Probes(baked)) = made { baked } else { BakedProbes::default() };
        let of = self.look();
        let Borrowing { bake, .. } = of.as_ref().ok_or_else(taken)?;
        if !Rounds::<Place<'_>>::jobs(bake).contains(&job) {
            return Ok(None);
        }
        bake.run(job, &world.get(), &mut baked);
        Ok(Some(Made::Probes(baked)))
    }

    fn accept(&self, made: &Made, may_wait: bool) -> Outcome<bool> {
        let Some(mut of) = work::change(&self.0, may_wait) else { return Ok(false) };
        if let (Some(of), Made::Probes(baked)) = (&mut *of, made) {
            Rounds::<Place<'_>>::accept(&mut of.bake, baked);
        }
        Ok(true)
    }

    fn share(&self) -> Outcome<Option<f32>> {
        Ok(Some(self.look().as_ref().map_or(1.0, |of| of.bake.share())))
    }
}

/// Bytes of a probe, for each of its numbers and beside them, and as much again for what a job leaves.
const PROBE_BYTES: usize = 64;

/// Whether there is memory for a grid: it could not be told later.
fn check_memory(settings: &BakeSettings) -> Outcome {
    let probes = settings.counts.iter().try_fold(1_usize, |product, n| product.checked_mul(*n as usize));
    // Too many are refused by the bake, in its own words.
    let Some(probes) = probes.filter(|probes| *probes <= MOST_PROBES) else { return Ok(()) };
    let bytes = probes.checked_mul(16 * settings.basis.count() + PROBE_BYTES);
    let mut trial: Vec<u8> = Vec::new();
    bytes.and_then(|bytes| trial.try_reserve_exact(bytes).ok()).ok_or_else(|| no_memory("the probes"))
}

/// Work that bakes light into a grid of probes; see `fogbow_work`. `caches` may be null: then all light is sampled, without bias.
/// Else what the caches tell is read from
/// them, which is quick, and as far off as they are; they should be filled for all of the box, and cannot be filled meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_bake(
    world: *const fogbow_world,
    caches: *const fogbow_caches,
    settings: *const fogbow_bake_settings,
    work: *mut *mut fogbow_work,
) -> fogbow_status {
    guard(|| {
        let world = world::get(world)?;
        // SAFETY: what the head of the header asks of pointers.
        let (settings, work) = unsafe { (arguments::read(settings, "settings")?, arguments::place(work, "work")?) };
        let caches = if caches.is_null() { None } else { Some(caches::get(caches)?.share()?) };
        if settings.photons > 1 {
            return wrong(format!("`settings->photons` is {}, neither 0 nor 1", settings.photons));
        }
        let has_photons = settings.photons == 1;
        let settings = settings.check(&world)?;
        check_memory(&settings)?;
        let mut bake = Bake::new(settings).map_err(|error| match error {
            BakeError::Memory => no_memory("the probes"),
            error => refused("settings")(&error),
        })?;
        if let Some(caches) = &caches {
            // SAFETY: the caches are kept beside the bake, do not move, are changed by nobody who does not own them alone, and are
            // dropped after it.
            bake = bake.with_caches(unsafe { &*Arc::as_ptr(caches) });
        }
        if has_photons {
            bake = bake.with_photons(FlightMemory::default(), world.outline().bounds);
        }
        let of = Borrowing { bake, _caches: caches };
        work.set(Work::put(Kind::Bake(Box::new(BakeWork(RwLock::new(Some(of))))), world)?);
        Ok(())
    })
}

/// Takes the probes of a bake, as far as they are baked. The bake is over then, and its work is to be freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_bake_take(work: *mut fogbow_work, probes: *mut *mut fogbow_probes) -> fogbow_status {
    guard(|| {
        let work = work::get(work)?;
        let Kind::Bake(bake) = &work.kind else {
            return Err(Failure(FOGBOW_ERROR_ARGUMENT, "`work` is no bake".to_owned()));
        };
        // SAFETY: what the head of the header asks of pointers.
        let probes = unsafe { arguments::place(probes, "probes")? };
        let of = bake.0.write().unwrap_or_else(PoisonError::into_inner).take().ok_or_else(taken)?;
        probes.set(handles::put(Probes(RwLock::new(of.bake.finish())))?);
        Ok(())
    })
}

/// Frees the handle of probes. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_probes_free(probes: *mut fogbow_probes) -> fogbow_status {
    guard(|| handles::take::<Probes>(probes, "probes").map(drop))
}

/// What a grid of probes is.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_probes_state {
    /// sizeof(fogbow_probes_state).
    pub size: u32,
    /// Probes along x, y and z. Probe (x, y, z) is number (z * counts[1] + y) * counts[0] + x, and stands in the centre of its cell.
    pub counts: [u32; 3],
    /// The box that cells fill (m).
    pub bounds: fogbow_box,
    /// What a probe holds, `FOGBOW_BASIS_…`.
    pub basis: u32,
    /// Numbers in colour that a probe holds.
    pub numbers: u32,
    /// `FOGBOW_QUANTITY_…`.
    pub quantity: u32,
    /// `FOGBOW_ORDERS_…`.
    pub orders: u32,
    /// Pairs of neighbours with a surface between them: where light leaks.
    pub leaks: u32,
    /// Standard error of the whole grid in proportion to its mean light; infinite before two passes.
    pub relative_error: f32,
    /// How far look-ups between probes are off because the grid is too coarse, in proportion to the mean light: a root mean square.
    pub relative_coarseness: f32,
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl Versioned for fogbow_probes_state {}

/// Tells what a grid of probes is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_probes_look(
    probes: *const fogbow_probes,
    state: *mut fogbow_probes_state,
) -> fogbow_status {
    guard(|| {
        let probes = handles::get::<Probes>(probes, "probes")?;
        let grid = probes.look();
        let bounds = grid.lattice().bounds();
        let answer = fogbow_probes_state {
            size: 0,
            counts: grid.lattice().size(),
            bounds: fogbow_box { lower: bounds.min.to_array(), upper: bounds.max.to_array() },
            basis: number_of(grid.basis()),
            numbers: grid.basis().count() as u32,
            quantity: grid.quantity() as u32,
            orders: grid.orders() as u32,
            leaks: grid.leaks() as u32,
            relative_error: grid.relative_error(),
            relative_coarseness: grid.relative_coarseness()[0],
        };
        // SAFETY: what the head of the header asks of pointers.
        unsafe { arguments::write_sized(state, "state", answer) }
    })
}

/// Nothing is known of it yet.
pub const FOGBOW_PROBE_UNKNOWN: u8 = 0;
/// It holds light.
pub const FOGBOW_PROBE_VALID: u8 = 1;
/// It stands in a wall.
pub const FOGBOW_PROBE_IN_WALL: u8 = 2;
/// No medium is near.
pub const FOGBOW_PROBE_EMPTY: u8 = 3;

/// Copies all probes: `held` has room for `held_count` floats, three for each number of each probe, probe after probe; `states` for
/// `probe_count` bytes,
/// `FOGBOW_PROBE_…`. Either may be null, with a count of 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_probes_copy(
    probes: *const fogbow_probes,
    held: *mut f32,
    held_count: usize,
    states: *mut u8,
    probe_count: usize,
) -> fogbow_status {
    guard(|| {
        let probes = handles::get::<Probes>(probes, "probes")?;
        let grid = probes.look();
        let (cells, each) = (grid.probes().len(), grid.basis().count());
        for (given, due, name) in [(held_count, 3 * cells * each, "held_count"), (probe_count, cells, "probe_count")] {
            if given != 0 && given != due {
                return wrong(format!("`{name}` is {given}, not {due} or 0"));
            }
        }
        // SAFETY: what the head of the header asks of pointers.
        let (held, states) = unsafe {
            let held = arguments::room::<[f32; 3]>(held.cast(), held_count / 3, "held")?;
            (held, arguments::room(states, probe_count, "states")?)
        };
        for (index, slots) in held.chunks_exact_mut(each).enumerate() {
            slots.iter_mut().zip(grid.held(index)).for_each(|(slot, value)| *slot = value.0);
        }
        states.iter_mut().zip(grid.probes()).for_each(|(state, probe)| *state = probe.state() as u8);
        Ok(())
    })
}

/// The light (three channels a point) at points (x, y, z; m) in directions (unit): towards an eye, or along a normal, as was baked.
/// From the eight probes around,
/// those that hold no light left out; beyond the outermost probes that of the nearest of them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_probes_value(
    probes: *const fogbow_probes,
    points: *const f32,
    directions: *const f32,
    count: usize,
    light: *mut f32,
) -> fogbow_status {
    guard(|| {
        let probes = handles::get::<Probes>(probes, "probes")?;
        // SAFETY: what the head of the header asks of pointers.
        let (points, directions, answers) = unsafe {
            let points = arguments::many::<[f32; 3]>(points.cast(), count, "points")?;
            let directions = arguments::many::<[f32; 3]>(directions.cast(), count, "directions")?;
            (points, directions, arguments::room::<[f32; 3]>(light.cast(), count, "light")?)
        };
        let grid = probes.look();
        for ((point, direction), answer) in points.iter().zip(directions).zip(answers) {
            let point = arguments::vector(*point, "points[i]")?;
            *answer = grid.value(point, arguments::unit(*direction, "directions[i]")?).0;
        }
        Ok(())
    })
}

/// All numbers of the light at points: three floats for each number that a probe holds, point after point. `shares` (may be null):
/// what share of
/// the probes around each point holds light.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_probes_look_up(
    probes: *const fogbow_probes,
    points: *const f32,
    count: usize,
    held: *mut f32,
    shares: *mut f32,
) -> fogbow_status {
    guard(|| {
        let probes = handles::get::<Probes>(probes, "probes")?;
        let grid = probes.look();
        let each = grid.basis().count();
        let Some(numbers) = count.checked_mul(each) else { return wrong("there are too many points") };
        // SAFETY: what the head of the header asks of pointers.
        let (points, answers, shares) = unsafe {
            let points = arguments::many::<[f32; 3]>(points.cast(), count, "points")?;
            let shares = if shares.is_null() { &mut [] } else { arguments::room(shares, count, "shares")? };
            (points, arguments::room::<[f32; 3]>(held.cast(), numbers, "held")?, shares)
        };
        let mut found = [Spectrum::ZERO; MOST_COEFFICIENTS];
        for (i, (point, slots)) in points.iter().zip(answers.chunks_exact_mut(each)).enumerate() {
            let share = grid.look_up(arguments::vector(*point, "points[i]")?, &mut found[..each]);
            slots.iter_mut().zip(&found).for_each(|(slot, value)| *slot = value.0);
            if let Some(slot) = shares.get_mut(i) {
                *slot = share;
            }
        }
        Ok(())
    })
}

/// Lets light spread into probes that hold none, for engines that mix all eight probes whatever they are. `reached` (may be null):
/// how many it reached.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_probes_dilate(probes: *mut fogbow_probes, reached: *mut usize) -> fogbow_status {
    guard(|| {
        let probes = handles::get::<Probes>(probes, "probes")?;
        // SAFETY: what the head of the header asks of pointers.
        let place = unsafe { arguments::place_if_any(reached, "reached")? };
        let count = probes.0.write().unwrap_or_else(PoisonError::into_inner).dilate();
        place.iter().for_each(|place| place.set(count));
        Ok(())
    })
}

/// Saves probes as bytes; see `fogbow_caches_save`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_probes_save(
    probes: *const fogbow_probes,
    tag: u64,
    buffer: *mut u8,
    capacity: usize,
    needed: *mut usize,
) -> fogbow_status {
    guard(|| {
        let probes = handles::get::<Probes>(probes, "probes")?;
        let grid = probes.look();
        // SAFETY: what the head of the header asks of pointers.
        unsafe {
            save(bytes::byte_count(&grid), buffer, capacity, needed, |sink| {
                let Ok(()) = bytes::write(&grid, tag, |part| {
                    sink(part);
                    Ok::<(), core::convert::Infallible>(())
                });
            })
        }
    })
}

/// Probes that were saved with the same tag.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_probes_load(
    tag: u64,
    bytes: *const u8,
    count: usize,
    probes: *mut *mut fogbow_probes,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (bytes, probes) = unsafe { (arguments::many(bytes, count, "bytes")?, arguments::place(probes, "probes")?) };
        let read = bytes::read(bytes, tag, BakeMemory::default());
        let grid = read.map_err(|error| Failure(FOGBOW_ERROR_DATA, format!("`bytes` {error}")))?;
        probes.set(handles::put(Probes(RwLock::new(grid)))?);
        Ok(())
    })
}
