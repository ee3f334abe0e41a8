//! Work in jobs: the one protocol by which caches are filled, probes baked and pictures audited.

use core::ffi::c_char;
use core::fmt;
use core::ops::Range;
use core::ptr;
use core::sync::atomic::{AtomicU64, Ordering};
use std::collections::BTreeMap;
use std::ffi::CString;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockWriteGuard, TryLockError};

use fogbow::bake::BakedProbes;
use fogbow::cache::{Compared, FilledRecords};
use fogbow::world::World;

use crate::arguments;
use crate::audit::AuditWork;
use crate::caches::FillWork;
use crate::handles::{self, Object};
use crate::medium::AnyMedium;
use crate::probes::BakeWork;
use crate::status::{FOGBOW_ERROR_JOB, FOGBOW_ERROR_PANIC, Failure, Outcome, fogbow_status, guard};
use crate::world::{AnyScene, OwnedWorld};

/// Work under way: a fill, a bake or an audit, in rounds of pure jobs.
///
/// `fogbow_work_jobs` tells the numbers of the jobs whose results are due. `fogbow_work_run` runs one of them, on any thread, many at a
/// time, in any order. `fogbow_work_accept` takes results back, from any thread, in any order: those that come early are kept
/// until it is their turn. When all of a round are in, the next begins. Whatever the order and the number of threads, the result has
/// the same bits.
/// To cancel is to stop calling; a job whose result never came back is asked for again.
#[derive(Debug)]
pub struct fogbow_work {
    _opaque: [u8; 0],
}

/// The result of one job, until it is accepted.
#[derive(Debug)]
pub struct fogbow_result {
    _opaque: [u8; 0],
}

/// What a job leaves.
#[derive(Debug)]
pub(crate) enum Made {
    Records(Box<FilledRecords<'static>>),
    Probes(BakedProbes<'static>),
    Compared(Box<Compared>),
}

/// What is done in jobs. All of it takes `&self`: jobs run on many threads.
pub(crate) trait Steps: Send + Sync {
    fn jobs(&self) -> Outcome<Range<u32>>;
    fn stage(&self) -> Outcome<&'static str>;
    /// Runs a job into `made`, or into new memory if that is of other work. `None` if it is not due.
    fn run(&self, job: u32, world: &OwnedWorld, made: Option<Made>) -> Outcome<Option<Made>>;
    /// Takes the result of the first job that is due. While others run, waits for them to end if it `may_wait`; if not, returns `false`.
    fn accept(&self, made: &Made, may_wait: bool) -> Outcome<bool>;
    /// About what share of the work is done, if that can be told.
    fn share(&self) -> Outcome<Option<f32>> {
        Ok(None)
    }
}

/// What kind of work it is.
pub(crate) enum Kind {
    Fill(FillWork),
    Bake(Box<BakeWork>),
    Audit(Box<AuditWork>),
}

impl Kind {
    fn steps(&self) -> &dyn Steps {
        match self {
            Self::Fill(work) => work,
            Self::Bake(work) => &**work,
            Self::Audit(work) => &**work,
        }
    }
}

/// Work, its world, and the results that came early.
pub(crate) struct Work {
    pub(crate) kind: Kind,
    pub(crate) world: Arc<OwnedWorld>,
    number: u64,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// How many rounds have ended.
    round: u64,
    /// No job ever had this number, or a greater one.
    most: u32,
    early: BTreeMap<u32, Made>,
    /// Memory to be used again.
    spare: Vec<Made>,
    /// Whether a panic has left the work half changed.
    is_broken: bool,
}

/// Results that are kept, without waiting for jobs that run to end: then the work changes, which it cannot while jobs look at it.
/// Fewer: threads wait
/// for each other; more: memory.
const MOST_EARLY: usize = 256;

/// Results whose memory is kept, at most: as many as there may be threads.
const SPARE: usize = 64;

impl fmt::Debug for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Work").field("number", &self.number).finish_non_exhaustive()
    }
}

impl Object for Work {
    type Handle = fogbow_work;
    const NAME: &'static str = "work";
}

/// A result, and where it belongs.
struct Answer {
    work: u64,
    round: u64,
    job: u32,
    made: Mutex<Option<Made>>,
}

impl Object for Answer {
    type Handle = fogbow_result;
    const NAME: &'static str = "a result";
}

pub(crate) fn failure<T>(message: String) -> Outcome<T> {
    Err(Failure(FOGBOW_ERROR_JOB, message))
}

/// Where jobs are done.
pub(crate) type Place<'w> = World<'w, AnyMedium, AnyScene>;

/// The right to change what jobs look at: `None` if some do, unless it may wait for them.
pub(crate) fn change<T>(lock: &RwLock<T>, may_wait: bool) -> Option<RwLockWriteGuard<'_, T>> {
    if may_wait {
        return Some(lock.write().unwrap_or_else(PoisonError::into_inner));
    }
    match lock.try_write() {
        Ok(right) => Some(right),
        Err(TryLockError::Poisoned(right)) => Some(right.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    }
}

impl Work {
    pub(crate) fn put(kind: Kind, world: Arc<OwnedWorld>) -> Outcome<*mut fogbow_work> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        handles::put(Self { kind, world, number, state: Mutex::default() })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn whole(state: &State) -> Outcome {
        if state.is_broken {
            return Err(Failure(FOGBOW_ERROR_PANIC, "this work was left half done by a mistake in fogbow".to_owned()));
        }
        Ok(())
    }

    /// Runs a job; the round it belongs to, and what it made. `None` if its result is there already.
    fn run(&self, job: u32) -> Outcome<Option<(u64, Made)>> {
        let (round, spare) = {
            let mut state = self.state();
            Self::whole(&state)?;
            let due = self.kind.steps().jobs()?;
            state.most = state.most.max(due.end);
            if job >= state.most {
                return failure(format!(
                    "there was never a job {job}; those from {} to below {} are due",
                    due.start, due.end
                ));
            }
            if !due.contains(&job) || state.early.contains_key(&job) {
                return Ok(None);
            }
            (state.round, state.spare.pop())
        };
        // The round may end meanwhile, if somebody else has run the same job.
        Ok(self.kind.steps().run(job, &self.world, spare)?.map(|made| (round, made)))
    }

    fn accept(&self, round: u64, job: u32, made: Made) -> Outcome {
        let mut state = self.state();
        Self::whole(&state)?;
        let due = self.kind.steps().jobs()?;
        // Jobs are pure: what is there already says the same.
        if round != state.round || !due.contains(&job) || state.early.contains_key(&job) {
            return Ok(());
        }
        state.early.insert(job, made);
        self.advance(&mut state)
    }

    /// Takes the results whose turn it is, if no job runs, if all of the round are there, or if there are many.
    fn advance(&self, state: &mut State) -> Outcome {
        let steps = self.kind.steps();
        loop {
            let due = steps.jobs()?;
            let Some(made) = state.early.remove(&due.start) else { return Ok(()) };
            let left = (due.end - due.start) as usize;
            let may_wait = state.early.len() + 1 >= left.min(MOST_EARLY);
            // Where this is left by a panic or an error, it stays.
            state.is_broken = true;
            let is_taken = steps.accept(&made, may_wait)?;
            state.is_broken = false;
            if !is_taken {
                state.early.insert(due.start, made);
                return Ok(());
            }
            if state.spare.len() < SPARE {
                state.spare.push(made);
            }
            let next = steps.jobs()?;
            if next.is_empty() || next.start != due.start + 1 {
                state.round += 1;
            }
        }
    }

    fn step(&self) -> Outcome<bool> {
        self.advance(&mut self.state())?;
        let Some(job) = self.kind.steps().jobs()?.next() else { return Ok(false) };
        if let Some((round, made)) = self.run(job)? {
            self.accept(round, job, made)?;
        }
        Ok(true)
    }
}

pub(crate) fn get(work: *const fogbow_work) -> Outcome<Arc<Work>> {
    handles::get(work, "work")
}

/// Numbers of the jobs that are due: from `first` to below `end`; equal ones if all is done.
///
/// They stay due until it is their turn: hand each number out once, or work is done twice. Those of results that never came back are
/// due again. Safe on any
/// thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_work_jobs(work: *const fogbow_work, first: *mut u32, end: *mut u32) -> fogbow_status {
    guard(|| {
        let work = get(work)?;
        // SAFETY: what the head of the header asks of pointers.
        let (first, end) = unsafe { (arguments::place(first, "first")?, arguments::place(end, "end")?) };
        work.advance(&mut work.state())?;
        let due = work.kind.steps().jobs()?;
        first.set(due.start.min(due.end));
        end.set(due.end);
        Ok(())
    })
}

/// Runs a job. Safe on any thread, many at a time. The result is to be accepted, or freed; it is null for a job whose result is there
/// already or whose
/// round is over, which is not run again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_work_run(
    work: *const fogbow_work,
    job: u32,
    result: *mut *mut fogbow_result,
) -> fogbow_status {
    guard(|| {
        let work = get(work)?;
        // SAFETY: what the head of the header asks of pointers.
        let result = unsafe { arguments::place(result, "result")? };
        result.set(match work.run(job)? {
            None => ptr::null_mut(),
            Some((round, made)) => {
                handles::put(Answer { work: work.number, round, job, made: Mutex::new(Some(made)) })?
            }
        });
        Ok(())
    })
}

/// Takes a result back and frees its handle, whatever comes of it. Safe on any thread, in any order. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_work_accept(work: *mut fogbow_work, result: *mut fogbow_result) -> fogbow_status {
    guard(|| {
        let answer = handles::take::<Answer>(result, "result")?;
        let work = get(work)?;
        let Some(answer) = answer else { return Ok(()) };
        if answer.work != work.number {
            return failure(format!("the result of job {} is of other work", answer.job));
        }
        let made = answer.made.lock().unwrap_or_else(PoisonError::into_inner).take();
        match made {
            Some(made) => work.accept(answer.round, answer.job, made),
            None => failure("the result is being accepted by another thread".to_owned()),
        }
    })
}

/// Frees a result that is not accepted. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_result_free(result: *mut fogbow_result) -> fogbow_status {
    guard(|| handles::take::<Answer>(result, "result").map(drop))
}

/// Runs one job after the other on this thread, at most `jobs` of them (0: all there are). `left` (may be null): 1 if more are due, else 0.
///
/// For hosts with one thread, and for a few jobs in every frame. Nobody else should run jobs of the same work meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_work_step(work: *mut fogbow_work, jobs: u32, left: *mut i32) -> fogbow_status {
    guard(|| {
        let work = get(work)?;
        // SAFETY: what the head of the header asks of pointers.
        let left = unsafe { arguments::place_if_any(left, "left")? };
        let mut done = 0;
        while (jobs == 0 || done < jobs) && work.step()? {
            done += 1;
        }
        if let Some(left) = left {
            left.set(i32::from(!work.kind.steps().jobs()?.is_empty()));
        }
        Ok(())
    })
}

/// What is being done, in a word or two ("search", "bake"); valid for ever.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_work_stage(work: *const fogbow_work, stage: *mut *const c_char) -> fogbow_status {
    guard(|| {
        /// Every name once, with the zero at its end that C asks for.
        static NAMES: Mutex<BTreeMap<&'static str, CString>> = Mutex::new(BTreeMap::new());
        let work = get(work)?;
        // SAFETY: what the head of the header asks of pointers.
        let stage = unsafe { arguments::place(stage, "stage")? };
        let name = work.kind.steps().stage()?;
        let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
        let text = names.entry(name).or_insert_with(|| CString::new(name).unwrap_or_default());
        stage.set(text.as_ptr());
        Ok(())
    })
}

/// About what share of a bake is done, in [0, 1]; of other work 1 when it is done, and 0 before: how many rounds there will be,
/// nobody knows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_work_share(work: *const fogbow_work, share: *mut f32) -> fogbow_status {
    guard(|| {
        let work = get(work)?;
        // SAFETY: what the head of the header asks of pointers.
        let place = unsafe { arguments::place(share, "share")? };
        let steps = work.kind.steps();
        let done = if steps.jobs()?.is_empty() { 1.0 } else { 0.0 };
        place.set(steps.share()?.unwrap_or(done));
        Ok(())
    })
}

/// Frees work, done or not. The caches of a fill keep what they have, and can be saved and filled again. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_work_free(work: *mut fogbow_work) -> fogbow_status {
    guard(|| handles::take::<Work>(work, "work").map(drop))
}
