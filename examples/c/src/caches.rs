//! Radiance caches: settings by one number, filling, reading in batches, bytes.

use core::ffi::c_void;
use core::fmt;
use core::mem;
use core::ops::Range;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use fogbow::cache::{Asked, CachedRadiance, Filling, Kind as Part, RadianceCaches, Settings, USUAL_ERROR};
use fogbow::math::{Ray, Vec3};
use fogbow::sampling::independent;
use fogbow::spectrum::Spectrum;
use fogbow::work::Rounds;

use crate::arguments::{self, Versioned};
use crate::handles::{self, Object};
use crate::host::{fogbow_box, fogbow_ray};
use crate::status::{
    FOGBOW_ERROR_BUSY, FOGBOW_ERROR_DATA, FOGBOW_ERROR_PANIC, Failure, Outcome, complain, fogbow_status, guard,
    no_memory, wrong,
};
use crate::work::{self, Kind, Made, Place, Steps, Work, fogbow_work};
use crate::world::{self, OwnedWorld, fogbow_chance, fogbow_world};

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

/// The eye rays of a picture.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_view {
    /// sizeof(fogbow_view).
    pub size: u32,
    /// Angular width of a pixel (rad), above 0.
    pub pixel: f32,
    /// Passed to `ray`.
    pub context: *const c_void,
    /// Writes the ray through the point `at` of the picture: (0, 0) is the upper left corner, (1, 1) the lower right one. Pure, and called by every
    /// thread that runs jobs. `fogbow_camera_ray` is one.
    pub ray: Option<unsafe extern "C" fn(context: *const c_void, at: *const f32, ray: *mut fogbow_ray)>,
}

// SAFETY: `repr(C)`, the size first, then a number, a pointer and an optional function.
unsafe impl Versioned for fogbow_view {}

/// A perspective camera, for `fogbow_camera_ray`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_camera {
    /// Where the eye is (m).
    pub eye: [f32; 3],
    /// What it looks at (m).
    pub target: [f32; 3],
    /// What is up; not along the way to `target`.
    pub up: [f32; 3],
    /// Angle (rad) between the lower and the upper border of the picture, below pi.
    pub field_of_view: f32,
    /// Width of the picture over its height.
    pub aspect: f32,
}

/// The ray of a camera through a point `at` (x, y; [0, 1]; the first from the left, the second from above): fits `fogbow_view.ray`, with a
/// `fogbow_camera` as the context. A camera that cannot be, or a null pointer, gives a ray of length 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_camera_ray(camera: *const c_void, at: *const f32, ray: *mut fogbow_ray) {
    let nothing = Ray { origin: Vec3::ZERO, direction: Vec3::Z, length: 0.0 };
    // SAFETY: what the head of the header asks of pointers.
    let parts = unsafe {
        (
            arguments::value(camera.cast::<fogbow_camera>(), ""),
            arguments::value(at.cast(), ""),
            arguments::place(ray, ""),
        )
    };
    let (camera, at, place) = match parts {
        (Ok(camera), Ok(at), Ok(place)) => (camera, at, place),
        (.., Ok(place)) => return place.set(fogbow_ray::of(&nothing)),
        _ => return,
    };
    place.set(fogbow_ray::of(&through(&camera, at).unwrap_or(nothing)));
}

fn through(camera: &fogbow_camera, [x, y]: [f32; 2]) -> Option<Ray> {
    let eye = Vec3::from_array(camera.eye);
    let forward = (Vec3::from_array(camera.target) - eye).try_normalize()?;
    let right = forward.cross(Vec3::from_array(camera.up)).try_normalize()?;
    let half = fogbow::math::float::tan(0.5 * camera.field_of_view);
    let (across, upwards) = ((2.0 * x - 1.0) * half * camera.aspect, (1.0 - 2.0 * y) * half);
    let direction = (forward + right * across + right.cross(forward) * upwards).try_normalize()?;
    eye.is_finite().then_some(Ray { origin: eye, direction, length: f32::INFINITY })
}

/// The eye rays of a host.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Eye {
    context: *const c_void,
    ray: unsafe extern "C" fn(*const c_void, *const f32, *mut fogbow_ray),
    pub(crate) pixel: f32,
}

// SAFETY: the host promises that its callbacks may be called from every thread that calls fogbow.
unsafe impl Send for Eye {}
// SAFETY: as above.
unsafe impl Sync for Eye {}

/// A function of eye rays, of a type that has a name.
pub(crate) type EyeRays = Box<dyn Fn([f32; 2]) -> Ray + Send + Sync>;

impl Eye {
    /// # Safety
    /// As [`arguments::read`].
    pub(crate) unsafe fn read(view: *const fogbow_view) -> Outcome<Self> {
        // SAFETY: by contract.
        let view = unsafe { arguments::read(view, "view")? };
        let ray = view.ray.ok_or_else(|| arguments::null("view->ray"))?;
        let pixel = arguments::within(view.pixel, f32::MIN_POSITIVE, 3.2, "view->pixel")?;
        Ok(Self { context: view.context, ray, pixel })
    }

    pub(crate) fn ray(&self, at: [f32; 2]) -> Ray {
        let mut ray = fogbow_ray { origin: [0.0; 3], direction: [0.0; 3], length: f32::INFINITY };
        // SAFETY: the host's function, with pointers that are good during the call.
        unsafe { (self.ray)(self.context, at.as_ptr(), &raw mut ray) };
        ray.check("").unwrap_or_else(|_| {
            complain("the callback `ray` gave an origin that is not finite, or a direction that is not of length 1");
            Ray { origin: Vec3::ZERO, direction: Vec3::Z, length: 0.0 }
        })
    }

    pub(crate) fn rays(self) -> EyeRays {
        Box::new(move |at| self.ray(at))
    }
}

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
    fn read<T>(&self, what: impl FnOnce(&RadianceCaches<'static>) -> T) -> Outcome<T> {
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
        self.look(|filling| Rounds::<Place<'_>>::jobs(filling))
    }

    fn stage(&self) -> Outcome<&'static str> {
        self.look(|filling| Rounds::<Place<'_>>::stage(filling))
    }

    fn run(&self, job: u32, world: &OwnedWorld, made: Option<Made>) -> Outcome<Made> {
        let mut records = if let Some(Made::Records(records)) = made { records } else { Default::default() };
        self.look(|filling| {
            work::check(job, &Rounds::<Place<'_>>::jobs(filling))?;
            filling.run(job, &world.get(), &mut records);
            Ok(())
        })??;
        Ok(Made::Records(records))
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

/// Radiance (W/(m² sr), three channels a ray) that arrives at the origins of rays: one sample each of what caches say, with light straight from the lights
/// and what is not cached sampled. `parts` may be null; else it has room for `count` elements. On any thread, also while the caches are filled.
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
        let (caches, world) = (get(caches)?, world::get(world)?);
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

/// In-scattered radiance (W/(m² sr), three channels a point, without the scattering coefficient) at points (x, y, z; m) towards eyes (unit vectors
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
        let (caches, world) = (get(caches)?, world::get(world)?);
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

/// What caches say at points of the light that is scattered there, in spherical harmonics up to `degree` (0 to 8): (degree + 1)² coefficients of three
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
        let caches = get(caches)?;
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

/// Fluence (W/m², three channels a point), the integral of radiance over all directions, of the light whose scattering is cached; zeros where no record reaches.
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
        let caches = get(caches)?;
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

/// Irradiance (W/m², three channels a point), without light straight from the lights, at points of surfaces with unit normals; zeros where no record reaches.
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
        let caches = get(caches)?;
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

/// Reads caches that were saved with the same tag, in place of what is there. The settings must be those they were made with, or ask for less. Where it fails,
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
