//! Layer 0a: work in rounds, the one protocol of everything that may run in parallel.
//!
//! A method that takes many steps says which pure *jobs* may run now; the host runs them wherever it likes, in any order,
//! and hands the results back in the order of their numbers. When all results of a round are in, the next round
//! begins. Nothing here knows threads, clocks or files:
//!
//! ```text
//!            jobs() = 0..n        run(job, world) anywhere          accept(result), in order
//! Rounds ───────────────────▶ host ─────────────────────▶ results ─────────────────────────▶ Rounds, next round
//! ```
//!
//! * A job depends on its number, on the world and on what was accepted in *earlier* rounds, on nothing else: the same bits for
//!   any number of threads, any order and any number of jobs at a time.
//! * Results that are never handed back are asked for again, with the same random numbers: work that was left and taken up
//!   again has the bits of work that was not. To cancel is to stop calling.
//! * A job takes some milliseconds: so many per frame of a game, or between two looks at a clock.
//! * What a job leaves lies in memory that the host reuses: growing with feature `alloc`, or lent.

use core::ops::Range;

/// Work in rounds, in a world `W` (most often a [`World`](crate::world::World)).
///
/// ```
/// use fogbow::work::{Rounds, finish};
/// use core::ops::Range;
///
/// /// The sum of squares of the first numbers, a job each; in a second round its root.
/// #[derive(Default)]
/// struct Norm { round: u32, taken: u32, sum: f32 }
///
/// impl Rounds<[f32]> for Norm {
///     type Output<'o> = f32;
///     fn jobs(&self) -> Range<u32> {
///         match self.round { 0 => self.taken..3, 1 => 0..1, _ => 0..0 }
///     }
///     fn run(&self, job: u32, numbers: &[f32], output: &mut f32) {
///         *output = if self.round == 0 { numbers[job as usize].powi(2) } else { self.sum.sqrt() };
///     }
///     fn accept(&mut self, output: &f32) {
///         if self.round == 0 { self.sum += output } else { self.sum = *output }
///         self.taken += 1;
///         if self.taken >= 3 { self.round += 1 }
///     }
///     fn stage(&self) -> &'static str {
///         if self.round == 0 { "square" } else { "root" }
///     }
/// }
///
/// let mut norm = Norm::default();
/// assert_eq!(norm.stage(), "square");
/// finish(&mut norm, &[2.0, 3.0, 6.0][..], &mut 0.0);
/// assert_eq!((norm.sum, norm.stage()), (7.0, "root"));
/// ```
pub trait Rounds<W: ?Sized> {
    /// What a job leaves, in memory of its own, which may be used again for other jobs.
    type Output<'o>;

    /// Numbers of the jobs of this round whose results are due. Empty when everything is done.
    fn jobs(&self) -> Range<u32>;

    /// Runs a job of this round; what was in `output` is lost.
    fn run(&self, job: u32, world: &W, output: &mut Self::Output<'_>);

    /// Takes the result of the first of [`Rounds::jobs`]. The last of a round prepares the next.
    fn accept(&mut self, output: &Self::Output<'_>);

    /// What is being done, in a word or two: for progress and for times by stage.
    fn stage(&self) -> &'static str {
        ""
    }
}

/// Runs the next job and takes its result; whether there was one.
///
/// ```
/// # use fogbow::work::{Rounds, step};
/// # struct Count(u32);
/// # impl Rounds<()> for Count {
/// #     type Output<'o> = ();
/// #     fn jobs(&self) -> core::ops::Range<u32> { self.0..3 }
/// #     fn run(&self, _: u32, _: &(), _: &mut ()) {}
/// #     fn accept(&mut self, _: &()) { self.0 += 1 }
/// # }
/// let mut work = Count(0);
/// let mut steps = 0;
/// while step(&mut work, &(), &mut ()) {
///     steps += 1; // A page yields to its event loop here, a game to its frame.
/// }
/// assert_eq!(steps, 3);
/// ```
pub fn step<W: ?Sized, R: Rounds<W> + ?Sized>(work: &mut R, world: &W, output: &mut R::Output<'_>) -> bool {
    let Some(job) = work.jobs().next() else { return false };
    work.run(job, world, output);
    work.accept(output);
    true
}

/// Runs all jobs of all rounds, one by one.
///
/// ```
/// # use fogbow::work::{Rounds, finish};
/// # struct Count(u32);
/// # impl Rounds<()> for Count {
/// #     type Output<'o> = ();
/// #     fn jobs(&self) -> core::ops::Range<u32> { self.0..3 }
/// #     fn run(&self, _: u32, _: &(), _: &mut ()) {}
/// #     fn accept(&mut self, _: &()) { self.0 += 1 }
/// # }
/// let mut work = Count(0);
/// finish(&mut work, &(), &mut ());
/// assert!(work.jobs().is_empty());
/// ```
pub fn finish<W: ?Sized, R: Rounds<W> + ?Sized>(work: &mut R, world: &W, output: &mut R::Output<'_>) {
    while step(work, world, output) {}
}
