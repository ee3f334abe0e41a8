//! Where the light of a record comes from: learnt by a first look, used by the next.

use glam::{Vec2, Vec3};

use super::kind::FIRST_COUNTS;
use crate::math::float::{self, PI};
use crate::sent::packed;

const ROWS: usize = 8;
const COLUMNS: usize = 16;

/// Cells of equal solid angle that the sphere is divided into.
const CELLS: usize = ROWS * COLUMNS;

/// What samples have found by direction: `∫ f² dω` per cell, from which the best density follows; and by how much they
/// differ.
///
/// A record's own samples must not be drawn by what they found themselves, or records that happened to see
/// something bright would keep it: learn from some, draw others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guide {
    /// `∫ f² dω` per cell, summed over estimates.
    squares: [f32; CELLS],
    /// Sum of estimates: of the means of their samples.
    sum: f32,
    /// Sum of the mean squares of their samples.
    sum_of_squares: f32,
    /// How many estimates have been summed, weighted.
    weight: f32,
    /// [`Place::share`](super::Place::share) of the record.
    pub(super) seen: f32,
    /// [`Place::to_eye`](super::Place::to_eye) of the record.
    pub(super) to_eye: Option<Vec3>,
    /// What the record covers of the film: from, and to.
    pub(super) film: [f32; 4],
    /// What the estimates in the record count, in usual ones.
    pub(super) held: f32,
}

packed!(Guide {
    squares: [f32; CELLS],
    sum: f32,
    sum_of_squares: f32,
    weight: f32,
    seen: f32,
    to_eye: Option<Vec3>,
    film: [f32; 4],
    held: f32,
});

/// Of a record of which it is not known where it is seen.
const WHOLE_FILM: [f32; 4] = [0.0, 0.0, 1.0, 1.0];

impl Default for Guide {
    fn default() -> Self {
        Self {
            squares: [0.0; CELLS],
            sum: 0.0,
            sum_of_squares: 0.0,
            weight: 0.0,
            seen: 1.0,
            to_eye: None,
            film: WHOLE_FILM,
            held: FIRST_COUNTS,
        }
    }
}

fn cell(direction: Vec3) -> usize {
    // Casts saturate, and take NaN to 0.
    let row = ((direction.z * 0.5 + 0.5) * ROWS as f32) as usize;
    let column = ((libm::atan2f(direction.y, direction.x) / (2.0 * PI) + 0.5) * COLUMNS as f32) as usize;
    row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)
}

impl Guide {
    /// Adds one of `count` samples: `value` is what it found over its density `pdf` (sr⁻¹).
    ///
    /// ```
    /// # use fogbow::{cache::{Guide, Guided}, math::Vec3};
    /// let mut guide = Guide::default();
    /// guide.add(Vec3::Z, 4.0, 0.08, 2);
    /// guide.add(Vec3::NEG_Z, 2.0, 0.08, 2);
    /// let guided = Guided::new(&guide).unwrap();
    /// assert!((guided.pdf(Vec3::Z) / guided.pdf(Vec3::NEG_Z) - 2.0).abs() < 1e-5);   // twice as bright, twice as likely
    /// ```
    #[inline]
    pub fn add(&mut self, direction: Vec3, value: f32, pdf: f32, count: u32) {
        let share = 1.0 / count.max(1) as f32;
        self.weight += share;
        let square = value * value * pdf * share;
        if square > 0.0 && square.is_finite() {
            self.squares[cell(direction)] += square;
            self.sum += value * share;
            self.sum_of_squares += value * value * share;
        }
    }

    /// Relative variance of the samples as they were drawn, `⟨v²⟩/⟨v⟩² − 1` of the values `v` given to [`Guide::add`]:
    /// what `n` of them say varies by the `n`-th part of it, or by less if they are evenly spread. At least 0, and 0 where
    /// nothing was found.
    ///
    /// ```
    /// # use fogbow::{cache::Guide, math::Vec3};
    /// let mut guide = Guide::default();
    /// guide.add(Vec3::Z, 1.0, 0.08, 2);
    /// guide.add(Vec3::X, 3.0, 0.08, 2);
    /// assert_eq!(guide.relative_variance(), 0.25);
    /// let twice = guide;
    /// guide.merge(&twice, 1.0);
    /// assert_eq!(guide.relative_variance(), 0.25);
    /// ```
    #[must_use]
    pub fn relative_variance(&self) -> f32 {
        let ratio = (self.sum_of_squares / self.sum) * (self.weight / self.sum);
        if ratio > 1.0 && ratio.is_finite() { ratio - 1.0 } else { 0.0 }
    }

    /// Adds what another has learnt nearby.
    ///
    /// ```
    /// # use fogbow::{cache::{Guide, Guided}, math::Vec3};
    /// let (mut here, mut beside) = (Guide::default(), Guide::default());
    /// here.add(Vec3::Z, 2.0, 0.08, 1);
    /// beside.add(Vec3::X, 2.0, 0.08, 1);
    /// here.merge(&beside, 0.25);
    /// let guided = Guided::new(&here).unwrap();
    /// assert!((guided.pdf(Vec3::X) / guided.pdf(Vec3::Z) - 0.5).abs() < 1e-5);   // by the root of its weight
    /// ```
    pub fn merge(&mut self, other: &Self, weight: f32) {
        self.squares.iter_mut().zip(&other.squares).for_each(|(a, b)| *a += weight * b);
        self.sum += weight * other.sum;
        self.sum_of_squares += weight * other.sum_of_squares;
        self.weight += weight * other.weight;
    }
}

/// A density of directions made from a [`Guide`]: in every cell in proportion to the root of the mean square,
/// which gives the least variance.
///
/// ```
/// # use fogbow::{cache::{Guide, Guided}, math::{Vec2, Vec3}};
/// let mut guide = Guide::default();
/// guide.add(Vec3::Z, 1.0, 0.08, 1);
/// let guided = Guided::new(&guide).unwrap();
/// assert!(guided.sample(Vec2::splat(0.5)).z > 0.7);
/// assert!(guided.pdf(Vec3::NEG_Z) == 0.0);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Guided {
    /// Sums of the cells' probabilities, up to and with each.
    until: [f32; CELLS],
}

impl Guided {
    /// `None` if nothing was found anywhere.
    #[must_use]
    pub fn new(guide: &Guide) -> Option<Self> {
        let mut total = 0.0;
        let mut until = guide.squares.map(|square| {
            total += float::sqrt(square);
            total
        });
        if !(total > 0.0 && total < f32::INFINITY) {
            return None;
        }
        until.iter_mut().for_each(|u| *u /= total);
        Some(Self { until })
    }

    /// A direction (unit) for `u` in the unit square.
    #[must_use]
    pub fn sample(&self, u: Vec2) -> Vec3 {
        let last = CELLS - 1;
        let mut cell = self.until.partition_point(|until| *until <= u.x).min(last);
        // Rounding may lead past the last cell that has a probability.
        while cell > 0 && self.probability(cell) <= 0.0 {
            cell -= 1;
        }
        let below = if cell > 0 { self.until[cell - 1] } else { 0.0 };
        let rest = ((u.x - below) / self.probability(cell)).clamp(0.0, 1.0);
        let z = ((cell / COLUMNS) as f32 + rest) * (2.0 / ROWS as f32) - 1.0;
        let azimuth = ((cell % COLUMNS) as f32 + u.y) * (2.0 * PI / COLUMNS as f32) - PI;
        let radius = float::safe_sqrt(1.0 - z * z);
        Vec3::new(radius * libm::cosf(azimuth), radius * libm::sinf(azimuth), z)
    }

    /// Its density (sr⁻¹).
    #[must_use]
    pub fn pdf(&self, direction: Vec3) -> f32 {
        self.probability(cell(direction)) * (CELLS as f32 / (4.0 * PI))
    }

    fn probability(&self, cell: usize) -> f32 {
        let below = if cell > 0 { self.until[cell - 1] } else { 0.0 };
        self.until[cell] - below
    }
}

/// How a record's samples are drawn.
#[derive(Debug, Default)]
pub struct Looks<'g> {
    /// Their number.
    pub count: u32,
    /// What is known of where light comes from.
    pub guide: Option<&'g Guided>,
    /// Takes down what they find.
    pub learnt: Option<&'g mut Guide>,
    /// Where most will look at the record from (unit): what is scattered there counts most.
    pub to_eye: Option<Vec3>,
}

impl From<u32> for Looks<'_> {
    /// Nothing known, nothing learnt.
    fn from(count: u32) -> Self {
        Self { count, guide: None, learnt: None, to_eye: None }
    }
}
