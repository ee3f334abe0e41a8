//! Radiance caches: settings by one number, filling, reading in batches, bytes.

use core::fmt;
use core::mem;
use core::ops::Range;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use fogbow::cache::{Asked, Filling, Kind as Part, RadianceCaches, Settings, USUAL_ERROR};
use fogbow::work::Rounds;

use crate::arguments::{self, Versioned};
use crate::handles::{self, Object};
use crate::host::fogbow_box;
use crate::status::{
    FOGBOW_ERROR_BUSY, FOGBOW_ERROR_DATA, FOGBOW_ERROR_PANIC, Failure, Outcome, fogbow_status, guard, no_memory, wrong,
};
use crate::view::{Eye, EyeRays, fogbow_view};
use crate::work::{self, Kind, Made, Place, Steps, Work, fogbow_work};
use crate::world::{self, OwnedWorld, fogbow_world};

/// Light in a world, cached. Read by many threads at a time; while it is filled, too.
#[derive(Debug)]
pub struct fogbow_caches {
    _opaque: [u8; 0],
}

/// How caches are filled and read. Zeros are what suits most.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_settings {
    /// sizeof(fogbow_settings).
    pub size: u32,
    /// Relative error that pictures may have, noise and bias together: 0.001 to 0.5; 0 for 0.02.
    pub error: f32,
    /// Pixels of the picture that they are for, which says how many eye rays look for places; 0 for a small picture or a box.
    pub pixels: u32,
    /// Eye rays that look for places, or points in a box; 0 for what `pixels` says. Fewer: quick, and small things have no records.
    pub rays: u32,
    /// Random walks for each record; 0 for what `error` says. Fewer: quick and noisy.
    pub walks: u32,
    /// 1: light straight from the lights is cached, too, and not connected to.
    pub is_single_cached: u32,
    /// Changes all random numbers.
    pub seed: u64,
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl Versioned for fogbow_settings {}

/// What caches are at the moment.
enum State {
    /// To be read, saved, or filled.
    Still(Arc<RadianceCaches<'static>>),
    Filling(Box<Filling<'static, EyeRays>>),
    /// A mistake here has lost them.
    Lost,
}

/// Caches that a fill may have.
pub(crate) struct OwnedCaches {
    state: RwLock<State>,
}

impl fmt::Debug for OwnedCaches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OwnedCaches").finish_non_exhaustive()
    }
}

impl Object for OwnedCaches {
    type Handle = fogbow_caches;
    const NAME: &'static str = "caches";
}

fn lost() -> Failure {
    Failure(FOGBOW_ERROR_PANIC, "these caches were lost by a mistake in fogbow".to_owned())
}

fn busy(what: &str) -> Failure {
    Failure(FOGBOW_ERROR_BUSY, what.to_owned())
}

impl OwnedCaches {
    fn look(&self) -> RwLockReadGuard<'_, State> {
        self.state.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self) -> RwLockWriteGuard<'_, State> {
        self.state.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads them, also while they are filled.
    pub(crate) fn read<T>(&self, what: impl FnOnce(&RadianceCaches<'static>) -> T) -> Outcome<T> {
        match &*self.look() {
            State::Still(caches) => Ok(what(caches)),
            State::Filling(filling) => Ok(what(filling.caches())),
            State::Lost => Err(lost()),
        }
    }

    /// A share of caches that nobody fills; as long as it is there, nobody can.
    pub(crate) fn share(&self) -> Outcome<Arc<RadianceCaches<'static>>> {
        match &*self.look() {
            State::Still(caches) => Ok(Arc::clone(caches)),
            State::Filling(_) => Err(busy("the caches are being filled: free that work first")),
            State::Lost => Err(lost()),
        }
    }

    /// Changes caches that nobody else uses.
    pub(crate) fn mend<T>(&self, change: impl FnOnce(&mut RadianceCaches<'static>) -> T) -> Outcome<T> {
        match &mut *self.change() {
            State::Still(caches) => {
                let caches = Arc::get_mut(caches)
                    .ok_or_else(|| busy("the caches are used by a bake or an audit: free that first"))?;
                Ok(change(caches))
            }
            State::Filling(_) => Err(busy("the caches are being filled: free that work first")),
            State::Lost => Err(lost()),
        }
    }

    fn begin(&self, asked: Asked<EyeRays>) -> Outcome {
        let mut state = self.change();
        match mem::replace(&mut *state, State::Lost) {
            State::Still(caches) => match Arc::try_unwrap(caches) {
                Ok(caches) => {
                    *state = State::Filling(Box::new(caches.fill(asked)));
                    Ok(())
                }
                Err(caches) => {
                    *state = State::Still(caches);
                    Err(busy("the caches are used by a bake or an audit: free that first"))
                }
            },
            other @ State::Filling(_) => {
                *state = other;
                Err(busy("the caches are being filled already"))
            }
            State::Lost => Err(lost()),
        }
    }
}

/// A fill of caches. Its end gives them back.
pub(crate) struct FillWork {
    caches: Arc<OwnedCaches>,
}

impl Drop for FillWork {
    fn drop(&mut self) {
        let mut state = self.caches.change();
        match mem::replace(&mut *state, State::Lost) {
            State::Filling(filling) => *state = State::Still(Arc::new(filling.finish())),
            other => *state = other,
        }
    }
}

impl FillWork {
    fn look<T>(&self, what: impl FnOnce(&Filling<'static, EyeRays>) -> T) -> Outcome<T> {
        match &*self.caches.look() {
            State::Filling(filling) => Ok(what(filling)),
            _ => Err(lost()),
        }
    }
}

impl Steps for FillWork {
    fn jobs(&self) -> Outcome<Range<u32>> {
        self.look(Rounds::<Place<'_>>::jobs)
    }

    fn stage(&self) -> Outcome<&'static str> {
        self.look(Rounds::<Place<'_>>::stage)
    }

    fn run(&self, job: u32, world: &OwnedWorld, made: Option<Made>) -> Outcome<Option<Made>> {
        let mut records = if let Some(Made::Records(records)) = made { records } else { Box::default() };
        self.look(|filling| {
            let is_due = Rounds::<Place<'_>>::jobs(filling).contains(&job);
            is_due.then(|| {
                filling.run(job, &world.get(), &mut records);
                Made::Records(records)
            })
        })
    }

    fn accept(&self, made: &Made, may_wait: bool) -> Outcome<bool> {
        let Some(mut state) = work::change(&self.caches.state, may_wait) else { return Ok(false) };
        match (&mut *state, made) {
            (State::Filling(filling), Made::Records(records)) => {
                Rounds::<Place<'_>>::accept(&mut **filling, records);
                Ok(true)
            }
            _ => Err(lost()),
        }
    }
}

/// New, empty caches for a world. Fill them by `fogbow_fill_view` or `fogbow_fill_box`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_caches_new(
    world: *const fogbow_world,
    settings: *const fogbow_settings,
    caches: *mut *mut fogbow_caches,
) -> fogbow_status {
    guard(|| {
        let world = world::get(world)?;
        // SAFETY: what the head of the header asks of pointers.
        let (given, caches) = unsafe { (arguments::read(settings, "settings")?, arguments::place(caches, "caches")?) };
        let error = if given.error == 0.0 { USUAL_ERROR } else { given.error };
        let error = arguments::within(error, 1e-3, 0.5, "settings->error")?;
        let outline = world.outline();
        let mut settings = Settings { seed: given.seed, ..Settings::for_outline(&outline, error) };
        if given.pixels > 0 {
            settings = settings.for_pixels(given.pixels);
        }
        if given.is_single_cached != 0 {
            settings = settings.with_single_cached(&outline);
        }
        if given.walks > 0 {
            settings = settings.with_walks(given.walks.min(MOST_WALKS));
        }
        if given.rays > 0 {
            settings.rays = given.rays.min(MOST_RAYS);
        }
        let state = RwLock::new(State::Still(Arc::new(RadianceCaches::new(settings))));
        caches.set(handles::put(OwnedCaches { state })?);
        Ok(())
    })
}

/// More walks of a record, or more eye rays, than this are a mistake: their numbers would overflow.
const MOST_WALKS: u32 = 1 << 22;
const MOST_RAYS: u32 = 1 << 24;

/// Frees the handle of caches; work that uses them keeps them alive. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_caches_free(caches: *mut fogbow_caches) -> fogbow_status {
    guard(|| handles::take::<OwnedCaches>(caches, "caches").map(drop))
}

pub(crate) fn get(caches: *const fogbow_caches) -> Outcome<Arc<OwnedCaches>> {
    handles::get(caches, "caches")
}

fn fill(
    caches: *const fogbow_caches,
    world: *const fogbow_world,
    asked: Asked<EyeRays>,
    work: *mut *mut fogbow_work,
) -> Outcome {
    let (caches, world) = (get(caches)?, world::get(world)?);
    // SAFETY: what the head of the header asks of pointers.
    let work = unsafe { arguments::place(work, "work")? };
    caches.begin(asked)?;
    // From here on its end gives the caches back, whatever happens.
    let filling = FillWork { caches };
    work.set(Work::put(Kind::Fill(filling), world)?);
    Ok(())
}

/// Work that fills caches until every place has records that the eye rays of a picture ask for. Nothing is done yet: see `fogbow_work`.
///
/// `world` is the one that the caches were made for. Fills of caches that have something add what is missing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_fill_view(
    caches: *mut fogbow_caches,
    world: *const fogbow_world,
    view: *const fogbow_view,
    work: *mut *mut fogbow_work,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let eye = unsafe { Eye::read(view)? };
        fill(caches, world, Asked::View { ray: eye.rays(), pixel: eye.pixel }, work)
    })
}

/// As `fogbow_fill_view`, for light anywhere in a box of the medium: for probes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_fill_box(
    caches: *mut fogbow_caches,
    world: *const fogbow_world,
    bounds: *const fogbow_box,
    work: *mut *mut fogbow_work,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let bounds = arguments::bounds(&unsafe { arguments::value(bounds, "bounds")? }, "bounds")?;
        fill(caches, world, Asked::Box(bounds), work)
    })
}

/// What caches hold.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_caches_state {
    /// sizeof(fogbow_caches_state).
    pub size: u32,
    /// 1: a fill was left before its end.
    pub is_open: u32,
    /// 1: a fill is under way.
    pub is_filling: u32,
    /// Records of light scattered once from the lights, if that is cached.
    pub single_records: u32,
    /// Records of light scattered once from surfaces.
    pub surface_records: u32,
    /// Records of light scattered more than once.
    pub multiple_records: u32,
    /// Records of irradiance.
    pub irradiance_records: u32,
    /// The relative error asked for.
    pub error: f32,
    /// Bytes of memory that records take.
    pub bytes: u64,
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl Versioned for fogbow_caches_state {}

/// Tells what caches hold.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_caches_look(
    caches: *const fogbow_caches,
    state: *mut fogbow_caches_state,
) -> fogbow_status {
    guard(|| {
        let caches = get(caches)?;
        let is_filling = matches!(&*caches.look(), State::Filling(_)).into();
        let answer = caches.read(|caches| {
            let records = |part| caches.records(part).len() as u32;
            fogbow_caches_state {
                size: 0,
                is_open: caches.is_open().into(),
                is_filling,
                single_records: records(Part::Single),
                surface_records: records(Part::Surface),
                multiple_records: records(Part::Multiple),
                irradiance_records: records(Part::Irradiance),
                error: caches.settings().error,
                bytes: Part::ALL.into_iter().map(|part| caches.bytes(part) as u64).sum(),
            }
        })?;
        // SAFETY: what the head of the header asks of pointers.
        unsafe { arguments::write_sized(state, "state", answer) }
    })
}

/// Copies bytes into a buffer of the host, or tells how many there are where `buffer` is null.
///
/// # Safety
/// `buffer` must be null or good to write `capacity` bytes, `needed` null or good to write.
pub(crate) unsafe fn save(
    count: usize,
    buffer: *mut u8,
    capacity: usize,
    needed: *mut usize,
    write: impl FnOnce(&mut dyn FnMut(&[u8])),
) -> Outcome {
    // SAFETY: by contract.
    let needed = unsafe { arguments::place_if_any(needed, "needed")? };
    needed.iter().for_each(|place| place.set(count));
    if buffer.is_null() {
        return if needed.is_some() { Ok(()) } else { Err(arguments::null("buffer")) };
    }
    if capacity < count {
        return wrong(format!("`capacity` is {capacity}; {count} bytes are needed"));
    }
    // SAFETY: by contract, with room for at least `count` bytes.
    let room = unsafe { arguments::room(buffer, count, "buffer")? };
    let mut at = 0;
    write(&mut |part| {
        room[at..at + part.len()].copy_from_slice(part);
        at += part.len();
    });
    Ok(())
}

/// Saves caches as bytes: the same on every machine, with a version and checksums. `tag` says what they were made for: whatever changes the
/// light in the world. With a null `buffer`, `needed` alone is written; else it may be null. Not while they are filled.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_caches_save(
    caches: *const fogbow_caches,
    tag: u64,
    buffer: *mut u8,
    capacity: usize,
    needed: *mut usize,
) -> fogbow_status {
    guard(|| {
        let caches = get(caches)?.share()?;
        // SAFETY: what the head of the header asks of pointers.
        unsafe {
            save(caches.byte_count(), buffer, capacity, needed, |sink| {
                let Ok(()) = caches.write(tag, |part| {
                    sink(part);
                    Ok::<(), core::convert::Infallible>(())
                });
            })
        }
    })
}

/// Reads caches that were saved with the same tag, in place of what is there. The settings must be those they were made with, or ask
/// for less. Where it fails,
/// some of what was there may be lost.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_caches_load(
    caches: *mut fogbow_caches,
    tag: u64,
    bytes: *const u8,
    count: usize,
) -> fogbow_status {
    guard(|| {
        let caches = get(caches)?;
        // SAFETY: what the head of the header asks of pointers.
        let bytes = unsafe { arguments::many(bytes, count, "bytes")? };
        let read = caches.mend(|caches| caches.read(bytes, tag))?;
        read.map_err(|error| match error {
            fogbow::cache::CachesError::Full => no_memory("the caches"),
            error => Failure(FOGBOW_ERROR_DATA, format!("`bytes` {error}")),
        })
    })
}
