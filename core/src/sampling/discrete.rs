//! Choices by weight.

use glam::Vec2;

use super::uniform::ONE_MINUS_EPSILON;

/// A choice among weighted entries, with the uniform number that is left over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Which entry.
    pub index: usize,
    /// Its probability.
    pub probability: f32,
    /// A uniform number in [0, 1), independent of the choice.
    pub remainder: f32,
}

/// Chooses among entries in proportion to their weights (≥ 0), each computed once, along with
/// whatever else was computed with it. `None` if no weight is positive.
///
/// Weighted reservoir of size 1 (Chao 1982) that stretches one uniform number over all its
/// decisions: meant for up to some hundreds of entries, after which its bits run out.
///
/// ```
/// # use fogbow::sampling::discrete::choose;
/// let (name, choice) = choose([(1.0, "a"), (0.0, "b"), (3.0, "c")], 0.5).unwrap();
/// assert_eq!((name, choice.index, choice.probability), ("c", 2, 0.75));
/// ```
#[inline]
pub fn choose<T>(entries: impl IntoIterator<Item = (f32, T)>, u: f32) -> Option<(T, Choice)> {
    let mut total = 0.0;
    let mut remainder = u;
    let mut chosen = None;
    for (index, (weight, entry)) in entries.into_iter().enumerate() {
        if !(weight > 0.0 && weight < f32::INFINITY) {
            continue;
        }
        total += weight;
        // The newcomer takes the upper end of the unit interval, so that one entry keeps `u` as it is.
        let keep = 1.0 - weight / total;
        if remainder >= keep {
            remainder = if keep > 0.0 { (remainder - keep) / (1.0 - keep) } else { remainder };
            chosen = Some((entry, index, weight));
        } else {
            remainder /= keep;
        }
    }
    let (entry, index, weight) = chosen?;
    let remainder = remainder.clamp(0.0, ONE_MINUS_EPSILON);
    Some((entry, Choice { index, probability: weight / total, remainder }))
}

/// Writes the running sums of `weights`, scaled to end at 1, over the weights themselves.
/// Returns their sum; where it is 0 or not finite the table stays as it was.
///
/// ```
/// # use fogbow::sampling::discrete::cumulate;
/// let mut table = [1.0, 0.0, 3.0];
/// assert_eq!(cumulate(&mut table), 4.0);
/// assert_eq!(table, [0.25, 0.25, 1.0]);
/// ```
pub fn cumulate(weights: &mut [f32]) -> f32 {
    let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
    if !(total > 0.0 && total.is_finite()) {
        return 0.0;
    }
    let mut sum = 0.0_f64;
    for w in weights.iter_mut() {
        sum += f64::from(*w);
        *w = (sum / total) as f32;
    }
    if let Some(end) = weights.last_mut() {
        *end = 1.0;
    }
    total as f32
}

/// Chooses from a table made by [`cumulate`], in logarithmic time.
///
/// `u` lies in [0, 1).
///
/// ```
/// # use fogbow::sampling::discrete::choose_cumulated;
/// let table = [0.25, 0.25, 1.0];   // of the weights 1, 0 and 3
/// let choice = choose_cumulated(&table, 0.625);
/// assert_eq!((choice.index, choice.probability, choice.remainder), (2, 0.75, 0.5));
/// ```
#[inline]
#[must_use]
pub fn choose_cumulated(table: &[f32], u: f32) -> Choice {
    let index = table.partition_point(|&c| c <= u).min(table.len().saturating_sub(1));
    let below = if index == 0 { 0.0 } else { table[index - 1] };
    let probability = table.get(index).map_or(0.0, |&c| c - below);
    let remainder = if probability > 0.0 { ((u - below) / probability).clamp(0.0, ONE_MINUS_EPSILON) } else { u };
    Choice { index, probability, remainder }
}

/// A density over the unit square, constant in each cell of a `width × height` table.
///
/// `rows` holds one running sum per row of the table (`width` entries each, every row ending at 1),
/// `column` one over the rows. Both are lent by the host: see [`Table2::build`].
#[derive(Debug, Clone, Copy)]
pub struct Table2<'a> {
    width: usize,
    rows: &'a [f32],
    column: &'a [f32],
}

impl<'a> Table2<'a> {
    /// Turns `weights` (row by row, `width × height`) into running sums in place and `column`
    /// (`height` entries) into theirs. `None` if sizes disagree or no weight is positive.
    ///
    /// ```
    /// # use fogbow::{math::Vec2, sampling::discrete::Table2};
    /// let (mut weights, mut column) = ([0.0, 1.0, 0.0, 3.0], [0.0; 2]);
    /// let sky = Table2::build(2, &mut weights, &mut column).unwrap();
    /// // Three quarters of the light come from a quarter of the square.
    /// assert_eq!(sky.pdf(Vec2::new(0.7, 0.7)), 0.75 / 0.25);
    /// assert!(Table2::build(2, &mut [0.0; 4], &mut [0.0; 2]).is_none());
    /// ```
    pub fn build(width: usize, weights: &'a mut [f32], column: &'a mut [f32]) -> Option<Self> {
        if width == 0 || weights.len() != width * column.len() {
            return None;
        }
        for (row, sum) in weights.chunks_mut(width).zip(column.iter_mut()) {
            *sum = cumulate(row);
            if *sum <= 0.0 {
                // An all-dark row is never chosen; any table will do.
                for (i, w) in row.iter_mut().enumerate() {
                    *w = (i + 1) as f32 / width as f32;
                }
            }
        }
        (cumulate(column) > 0.0).then_some(Self { width, rows: weights, column })
    }

    /// A point of the unit square and its density.
    ///
    /// ```
    /// # use fogbow::{math::Vec2, sampling::discrete::Table2};
    /// let (mut weights, mut column) = ([0.0, 1.0, 0.0, 3.0], [0.0; 2]);
    /// let sky = Table2::build(2, &mut weights, &mut column).unwrap();
    /// let (point, pdf) = sky.sample(Vec2::splat(0.5));
    /// assert!(point.x >= 0.5);   // the left half is dark
    /// assert_eq!(pdf, sky.pdf(point));
    /// ```
    #[inline]
    #[must_use]
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let row = choose_cumulated(self.column, u.y);
        let cell = choose_cumulated(&self.rows[row.index * self.width..][..self.width], u.x);
        let (w, h) = (self.width as f32, self.column.len() as f32);
        let point = Vec2::new((cell.index as f32 + cell.remainder) / w, (row.index as f32 + row.remainder) / h);
        (point.min(Vec2::splat(ONE_MINUS_EPSILON)), cell.probability * w * row.probability * h)
    }

    /// Density of [`Table2::sample`] at a point of the unit square.
    ///
    /// ```
    /// # use fogbow::{math::Vec2, sampling::discrete::Table2};
    /// let (mut weights, mut column) = ([0.0, 1.0, 0.0, 3.0], [0.0; 2]);
    /// let sky = Table2::build(2, &mut weights, &mut column).unwrap();
    /// let cells = [0.25, 0.75].map(|y| [0.25, 0.75].map(|x| sky.pdf(Vec2::new(x, y))));
    /// assert_eq!(cells, [[0.0, 1.0], [0.0, 3.0]]);   // the mean over the square is 1
    /// ```
    #[inline]
    #[must_use]
    pub fn pdf(&self, point: Vec2) -> f32 {
        let height = self.column.len();
        let x = ((point.x * self.width as f32) as usize).min(self.width - 1);
        let y = ((point.y * height as f32) as usize).min(height - 1);
        let step = |table: &[f32], i: usize| table[i] - if i == 0 { 0.0 } else { table[i - 1] };
        step(&self.rows[y * self.width..][..self.width], x) * self.width as f32 * step(self.column, y) * height as f32
    }
}
