//! How far pictures from caches are off, against path tracing.

use core::ops::Range;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use fogbow::cache::{Audit, Compared, Deviation, Kind as Part, RadianceCaches};
use fogbow::work::Rounds;

use crate::arguments::{self, Versioned};
use crate::caches::{self, OwnedCaches, fogbow_caches};
use crate::status::{FOGBOW_ERROR_ARGUMENT, FOGBOW_ERROR_BUSY, Failure, Outcome, fogbow_status, guard};
use crate::view::{Eye, EyeRays, fogbow_view};
use crate::work::{self, Kind, Made, Place, Steps, Work, fogbow_work};
use crate::world::{self, OwnedWorld, fogbow_world};

/// An audit and the caches that it borrows. Fields are dropped in this order.
struct Borrowing {
    audit: Audit<'static, 'static, EyeRays>,
    _caches: Arc<RadianceCaches<'static>>,
}

/// An audit as work. `None` once what it found wrong is dropped.
pub(crate) struct AuditWork {
    of: RwLock<Option<Borrowing>>,
    caches: Arc<OwnedCaches>,
    eye: Eye,
}

impl AuditWork {
    fn look(&self) -> RwLockReadGuard<'_, Option<Borrowing>> {
        self.of.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn with<T>(&self, what: impl FnOnce(&Audit<'static, 'static, EyeRays>) -> T) -> Outcome<T> {
        let over = || Failure(FOGBOW_ERROR_BUSY, "this audit is over: its records were dropped".to_owned());
        self.look().as_ref().map(|of| what(&of.audit)).ok_or_else(over)
    }
}

impl Steps for AuditWork {
    fn jobs(&self) -> Outcome<Range<u32>> {
        Ok(self.look().as_ref().map_or(0..0, |of| Rounds::<Place<'_>>::jobs(&of.audit)))
    }

    fn stage(&self) -> Outcome<&'static str> {
        Ok("audit")
    }

    fn run(&self, job: u32, world: &OwnedWorld, made: Option<Made>) -> Outcome<Option<Made>> {
        let mut compared =
            if let Some(Made::Compared(compared)) = made { compared } else { Box::<Compared>::default() };
        self.with(|audit| {
            let is_due = Rounds::<Place<'_>>::jobs(audit).contains(&job);
            is_due.then(|| {
                audit.run(job, &world.get(), &mut compared);
                Made::Compared(compared)
            })
        })
    }

    fn accept(&self, made: &Made, may_wait: bool) -> Outcome<bool> {
        let Some(mut of) = work::change(&self.of, may_wait) else { return Ok(false) };
        if let (Some(of), Made::Compared(compared)) = (&mut *of, made) {
            Rounds::<Place<'_>>::accept(&mut of.audit, compared);
        }
        Ok(true)
    }
}

/// Eye rays of an audit that nobody asked for more of: it tells a per cent or so from chance.
const USUAL_RAYS: u32 = 16384;

/// More are a mistake.
const MOST_RAYS: u32 = 1 << 24;

/// Work that compares the caches with path tracing along about `rays` eye rays of a view (0 for 16384; four times as many halve the
/// error of what is found; where they say that records are wrong, it looks again along three times as many others, which alone count then).
/// Meanwhile the caches can be read, but not filled.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_audit(
    caches: *const fogbow_caches,
    world: *const fogbow_world,
    view: *const fogbow_view,
    rays: u32,
    work: *mut *mut fogbow_work,
) -> fogbow_status {
    guard(|| {
        let (caches, world) = (caches::get(caches)?, world::get(world)?);
        // SAFETY: what the head of the header asks of pointers.
        let (eye, work) = unsafe { (Eye::read(view)?, arguments::place(work, "work")?) };
        let shared = caches.share()?;
        // SAFETY: the caches are kept beside the audit, do not move, are changed by nobody who does not own them alone, and are
        // dropped after it.
        let borrowed: &'static RadianceCaches<'static> = unsafe { &*Arc::as_ptr(&shared) };
        let rays = if rays == 0 { USUAL_RAYS } else { rays.min(MOST_RAYS) };
        let audit = Audit::new(borrowed, eye.rays(), rays).held_to(borrowed.settings().error);
        let of = Borrowing { audit, _caches: shared };
        let audit = AuditWork { of: RwLock::new(Some(of)), caches, eye };
        work.set(Work::put(Kind::Audit(Box::new(audit)), world)?);
        Ok(())
    })
}

/// A relative deviation of the mean light of a picture, and how well it is known.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_deviation {
    /// -0.01 is one per cent too dark.
    pub bias: f64,
    /// Its standard error; infinite if nothing is known.
    pub error: f64,
}

/// What an audit has found so far.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_findings {
    /// sizeof(fogbow_findings).
    pub size: u32,
    /// Eye rays compared.
    pub rays: u32,
    /// Of all light.
    pub all: fogbow_deviation,
    /// Of the light that is cached, as a part of all light: better known.
    pub cached: fogbow_deviation,
    /// Of the light straight from the lights that the medium scatters once; 0 if that is not cached. Parts are of all light.
    pub single: fogbow_deviation,
    /// Of the light of surfaces that the medium scatters.
    pub surface: fogbow_deviation,
    /// Of the light that the medium scatters more than once.
    pub multiple: fogbow_deviation,
    /// Of the light from elsewhere to surfaces.
    pub irradiance: fogbow_deviation,
    /// Of the cached light in each channel, as a part of the mean of all channels.
    pub channels: [fogbow_deviation; 3],
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl Versioned for fogbow_findings {}

fn audit_of(work: &Work) -> Outcome<&AuditWork> {
    match &work.kind {
        Kind::Audit(audit) => Ok(audit),
        _ => Err(Failure(FOGBOW_ERROR_ARGUMENT, "`work` is no audit".to_owned())),
    }
}

/// What an audit has found so far.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_audit_findings(
    work: *const fogbow_work,
    findings: *mut fogbow_findings,
) -> fogbow_status {
    guard(|| {
        let work = work::get(work)?;
        let found = audit_of(&work)?.with(|audit| audit.findings())?;
        let plain = |of: Deviation| fogbow_deviation { bias: of.bias, error: of.error };
        let part = |part| found.of(part).map_or(fogbow_deviation { bias: 0.0, error: 0.0 }, plain);
        let answer = fogbow_findings {
            size: 0,
            rays: found.rays,
            all: plain(found.all),
            cached: plain(found.cached),
            single: part(Part::Single),
            surface: part(Part::Surface),
            multiple: part(Part::Multiple),
            irradiance: part(Part::Irradiance),
            channels: found.channels.map(plain),
        };
        // SAFETY: what the head of the header asks of pointers.
        unsafe { arguments::write_sized(findings, "findings", answer) }
    })
}

/// Drops the records that an audit has found off by certainly more than `error` (0.001 to 0.5); the next fill makes finer ones.
/// `is_dropped`: 1 if any
/// were, else 0. The audit is over then, and its work is to be freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_audit_drop_wrong(
    work: *mut fogbow_work,
    error: f32,
    is_dropped: *mut i32,
) -> fogbow_status {
    guard(|| {
        let work = work::get(work)?;
        let audit = audit_of(&work)?;
        let error = arguments::within(error, 1e-3, 0.5, "error")?;
        // SAFETY: what the head of the header asks of pointers.
        let is_dropped = unsafe { arguments::place(is_dropped, "is_dropped")? };
        let (findings, map) = audit.with(|audit| (audit.findings(), audit.map()))?;
        *audit.of.write().unwrap_or_else(PoisonError::into_inner) = None;
        let eye = audit.eye;
        let any = audit
            .caches
            .mend(|caches| caches.drop_wrong((&findings, &map), error, |at| eye.ray(at), &work.world.get()))?;
        is_dropped.set(any.into());
        Ok(())
    })
}
