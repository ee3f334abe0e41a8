//! Adaptive sampling of images: where light is smooth few pixels are computed, and the others filled in from them.
//!
//! Belcour et al. 2014, § 6.3: Gaussians of the shape that the image's covariance gives spread computed pixels, whose density
//! is the inverse of the Gaussians' area: `√det P`, as in B, where no border of depth cuts them. Pixel `i` is the mean of computed pixels `j`,
//!
//! ```text
//! Lᵢ = Σⱼ wᵢⱼ Lⱼ / Σⱼ wᵢⱼ,    wᵢⱼ = √(gᵢ(j) gⱼ(i)) / ρⱼ
//! ```
//!
//! with `g` the Gaussian of a pixel and `ρ` the density of computed pixels. Three things keep means of a picture what they are:
//! without `1/ρⱼ`, crowds of pixels around bright shafts outvote the dark pixels beside them; with `gᵢ` alone, wide filters
//! in the dark take light from narrow ones that give none back; and `ρ` follows the filters as they are used, bounded by
//! their neighbours' and by depth, for a narrow filter over few computed pixels finds one side of a border only.
//!
//! Both the plan ([`Planning`]) and filling in ([`FillingIn`]) are work in rounds, whose jobs are rows of pixels.

use core::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec2;

use super::grid::GridView;
use super::image::image_covariance;
use super::metrics::filter_precision;
use crate::host::{Medium, Scene};
use crate::math::float::{self, PI};
use crate::math::{Frame, Ray, Symmetric2};
use crate::spectrum::Spectrum;
use crate::storage::{Full, List};
use crate::work::Rounds;
use crate::world::World;

/// Share of pixels that a plan computes if nothing else is asked for. More: less noise and blur; fewer: less time, until
/// samples that each pixel needs anyway (its surfaces) take most of it.
pub const USUAL_SHARE: f32 = 0.4;

/// Least share of pixels that a plan computes. With it there are five computed pixels under the widest filter; with fewer, some filters
/// would find none in reach.
pub const LEAST_PLAN: f32 = 0.05;

/// By how much filters are narrower than the light itself varies, in variance. 1, as in B, blurs light by as much as it
/// varies; much more leaves noise.
const SHARPER: f32 = 4.0;

/// Standard deviation (pixels) of the widest filter: where light does not vary at all. Wider: time, by the square.
const WIDEST: f32 = 4.0;

/// How much wider (pixels of standard deviation) a filter may be from pixel to pixel: as filters end at four deviations, one
/// of these stops short of the pixel that bounds it.
const WIDENING: f32 = 0.25;

/// Pixels a filter reaches on either side: three deviations of the widest.
const REACH: i64 = 12;

/// Relative difference of depth, beyond what the slopes of surfaces explain, from which pixels see different things. Larger: light
/// leaks between things that stand close behind each other. Smaller: surfaces whose slope changes within the reach of a filter,
/// as that of a ball does towards its rim, fall apart into pixels that nothing fills in but themselves.
const SAME_DEPTH: f32 = 0.02;

/// Least share of computed pixels, where light does not vary. The widest filter weighs `2π WIDEST²`, a hundred pixels: of them eight
/// are computed, so that one which a border cuts in half still finds some. More: fewer are left for where light varies.
const LEAST_SHARE: f32 = 1.0 / 12.0;

/// Halvings that find the density of a plan: as many as a range of 10⁹ needs for the last bit, and more than there are bits.
const HALVINGS: u32 = 96;

/// What is known of a pixel beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outlook {
    /// Covariance of the image (cycles² per pixel²); `None` where nothing is known.
    pub covariance: Option<Symmetric2>,
    /// Distance (m) to the surface behind the medium; infinite where there is none.
    pub depth: f32,
}

/// Who knows something of every pixel beforehand: a [`Sight`], or a slice with an [`Outlook`] for each.
///
/// ```
/// # use fogbow::covariance::image_sampling::{Outlook, Outlooks};
/// let known = [3.0, 5.0, 7.0].map(|depth| Outlook { covariance: None, depth });
/// let depth = |pixel| known.outlook(pixel, [2, 2]).depth;
/// // Row by row; of the last pixel nothing is known.
/// assert_eq!([depth([1, 0]), depth([0, 1]), depth([1, 1])], [5.0, 7.0, 0.0]);
/// ```
pub trait Outlooks {
    /// What is known of the pixel in this column and row of a picture of `size`, width and height.
    fn outlook(&self, pixel: [u32; 2], size: [u32; 2]) -> Outlook;
}

impl Outlooks for [Outlook] {
    /// Row by row. Pixels beyond the end are not known.
    fn outlook(&self, [x, y]: [u32; 2], [width, _]: [u32; 2]) -> Outlook {
        self.get(y as usize * width as usize + x as usize).copied().unwrap_or_default()
    }
}

/// A world with a filled grid, seen by an eye.
#[derive(Debug)]
pub struct Sight<'a, M: ?Sized, S: ?Sized, F> {
    /// The world.
    pub world: World<'a, M, S>,
    /// Covariances of its light.
    pub grid: GridView<'a>,
    /// The eye ray of a point of the film, both coordinates in [0, 1].
    pub ray: F,
}

impl<M: Medium + ?Sized, S: Scene + ?Sized, F: Fn([f32; 2]) -> Ray> Outlooks for Sight<'_, M, S, F> {
    fn outlook(&self, pixel: [u32; 2], [width, height]: [u32; 2]) -> Outlook {
        let ray = |x: f32, y: f32| (self.ray)([x / width as f32, y / height as f32]);
        let [x, y] = pixel.map(|n| n as f32 + 0.5);
        let centre = ray(x, y);
        let hit = self.world.scene.closest_hit(&centre);
        let depth = hit.map_or(f32::INFINITY, |hit| hit.distance);
        // One pixel to the right and one down, as angles.
        let w = centre.direction;
        let (right, down) = (ray(x + 1.0, y).direction - w, ray(x, y + 1.0).direction - w);
        let frame = Frame::around(w);
        let columns = [right, down].map(|d| Vec2::new(d.dot(frame.u), d.dot(frame.v)));
        let seen = image_covariance(&Ray { length: depth, ..centre }, &frame, &self.grid, self.world.medium);
        Outlook { covariance: seen.map(|p| in_pixels(&p, columns)), depth }
    }
}

/// `Jᵀ P J`: from cycles per radian to cycles per pixel.
fn in_pixels(p: &Symmetric2, [a, b]: [Vec2; 2]) -> Symmetric2 {
    let between = |a: Vec2, b: Vec2| p.xx * a.x * b.x + p.xy * (a.x * b.y + a.y * b.x) + p.yy * a.y * b.y;
    Symmetric2::new(between(a, a), between(a, b), between(b, b))
}

/// What a plan knows of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Pixel {
    /// Covariance of its Gaussian.
    shape: Symmetric2,
    /// How depth changes (m) from a pixel to the next in the row, and to the one below.
    slope: [f32; 2],
    depth: f32,
    /// The share of neighbours that should be computed. While a plan is made: first the longer standard deviation (pixels) of its own Gaussian,
    /// then one over the area of its filter.
    density: f32,
    /// 1 if it is computed.
    computed: u32,
}

/// What a job of [`Planning`] leaves.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct PlanOutput<'o> {
    pixels: List<'o, Pixel>,
    numbers: List<'o, f32>,
    is_cut: bool,
}

impl<'o> PlanOutput<'o> {
    /// In lent memory: as many elements of both as a picture is wide.
    ///
    /// ```
    /// use fogbow::covariance::image_sampling::{Outlook, Pixel, PlanOutput, Planning};
    /// use fogbow::work;
    /// # #[cfg(feature = "alloc")] {
    /// let is_cut = |width: usize| {
    ///     let (mut row, mut numbers) = (vec![Pixel::default(); width], vec![0.0; width]);
    ///     let mut planning = Planning::new([8, 8], 0.5)?;
    ///     work::finish(&mut planning, &[Outlook::default(); 64][..], &mut PlanOutput::lent(&mut row, &mut numbers));
    ///     Ok(planning.is_cut())
    /// };
    /// assert_eq!((is_cut(8)?, is_cut(7)?), (false, true));
    /// # }
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    #[must_use]
    pub fn lent(pixels: &'o mut [Pixel], numbers: &'o mut [f32]) -> Self {
        Self { pixels: List::from(pixels), numbers: List::from(numbers), is_cut: false }
    }
}

/// What the jobs of a round do.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Round {
    /// What is known of pixels, row by row.
    Look,
    /// Areas of filters, row by row.
    Weigh,
    /// The mean density for a factor between these, so many times.
    Halve {
        low: f32,
        high: f32,
        left: u32,
    },
    Done,
}

/// The making of a [`Plan`], as [`Rounds`] of jobs.
///
/// ```
/// use fogbow::covariance::image_sampling::{Outlook, PlanOutput, Planning};
/// use fogbow::work;
/// # #[cfg(feature = "alloc")] {
/// let mut planning = Planning::new([10, 10], 1.0)?;
/// work::finish(&mut planning, &[Outlook::default(); 100][..], &mut PlanOutput::default());
/// assert!(!planning.is_cut());
/// let plan = planning.finish();
/// assert!((0..100).all(|pixel| plan.is_computed(pixel)));   // all of them were asked for
/// # }
/// # Ok::<(), fogbow::storage::Full>(())
/// ```
#[derive(Debug)]
pub struct Planning<'s> {
    plan: Plan<'s>,
    /// A number per pixel, or two lines.
    scratch: List<'s, f32>,
    share: f32,
    round: Round,
    jobs: u32,
    taken: u32,
    is_cut: bool,
}

impl<'s> Planning<'s> {
    /// Computes at most `share` of all pixels (from [`LEAST_PLAN`] on) of a picture of `size`, width and height, densest where the image
    /// varies.
    ///
    /// # Errors
    /// [`Full`] if there is no memory.
    ///
    /// ```
    /// use fogbow::covariance::image_sampling::{Outlook, PlanOutput, Planning};
    /// use fogbow::{math::Symmetric2, work};
    /// # #[cfg(feature = "alloc")] {
    /// let smooth = Outlook { covariance: Some(Symmetric2::diagonal(1e-4, 1e-4)), depth: 1.0 };
    /// let sharp = Outlook { covariance: Some(Symmetric2::diagonal(0.1, 0.1)), depth: 1.0 };
    /// let outlooks: Vec<Outlook> = (0..1024).map(|i| if i % 32 < 16 { smooth } else { sharp }).collect();
    /// let mut planning = Planning::new([32, 32], 0.4)?;
    /// work::finish(&mut planning, &outlooks[..], &mut PlanOutput::default());
    /// let plan = planning.finish();
    /// let count = |left: bool| (0..1024).filter(|i| plan.is_computed(*i) && (i % 32 < 16) == left).count();
    /// assert!(count(true) + count(false) <= 410 && count(false) > 2 * count(true));
    /// # }
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    #[cfg(feature = "alloc")]
    pub fn new(size: [u32; 2], share: f32) -> Result<Planning<'static>, Full> {
        Planning::new_in(List::default(), List::default(), size, share)
    }

    /// As [`Planning::new`], in lent memory: a [`Pixel`] and a number for every pixel, and of numbers at least two for every column and four more.
    ///
    /// # Errors
    /// [`Full`] if that is too little.
    ///
    /// ```
    /// use fogbow::covariance::image_sampling::{Outlook, Pixel, PlanOutput, Planning};
    /// use fogbow::work;
    /// let (mut pixels, mut numbers) = ([Pixel::default(); 64], [0.0; 64]);
    /// let (mut row, mut row_numbers) = ([Pixel::default(); 8], [0.0; 8]);
    /// let mut planning = Planning::new_in((&mut pixels[..]).into(), (&mut numbers[..]).into(), [8, 8], 0.5)?;
    /// work::finish(&mut planning, &[Outlook::default(); 64][..], &mut PlanOutput::lent(&mut row, &mut row_numbers));
    /// assert!(!planning.is_cut() && planning.finish().share() > 0.4);
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    pub fn new_in(
        mut pixels: List<'s, Pixel>,
        mut scratch: List<'s, f32>,
        size: [u32; 2],
        share: f32,
    ) -> Result<Self, Full> {
        let [width, height] = size.map(|n| n as usize);
        pixels.reset(width * height, Pixel::default())?;
        scratch.reset((width * height).max(2 * (width + 2)), 0.0)?;
        let share = share.clamp(LEAST_PLAN, 1.0);
        let plan = Plan { size, pixels };
        let jobs = if width == 0 { 0 } else { size[1] };
        Ok(Self { plan, scratch, share, round: Round::Look, jobs, taken: 0, is_cut: false })
    }

    /// Whether the memory of a job was too small, so that pixels are missing.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// The plan: to be asked for when there are no more jobs, for until then nothing is computed.
    #[must_use]
    pub fn finish(self) -> Plan<'s> {
        self.plan
    }

    /// Prepares the next round.
    fn advance(&mut self) {
        self.taken = 0;
        let height = self.plan.size[1];
        (self.round, self.jobs) = match self.round {
            Round::Look => {
                self.plan.bound_shapes(self.scratch.as_mut_slice());
                self.plan.find_slopes();
                (Round::Weigh, height)
            }
            Round::Weigh => (Round::Halve { low: 0.0, high: 1e9, left: HALVINGS }, 1),
            Round::Halve { low, left: 0 | 1, .. } => {
                let density = self.density(low);
                self.plan.pixels.as_mut_slice().iter_mut().for_each(|p| p.density = density(p.density));
                self.plan.dither(self.share, self.scratch.as_mut_slice());
                (Round::Done, 0)
            }
            Round::Halve { low, high, left } => (Round::Halve { low, high, left: left - 1 }, 1),
            Round::Done => (Round::Done, 0),
        };
    }

    /// The density that a factor makes of one over a filter's area.
    fn density(&self, factor: f32) -> impl Fn(f32) -> f32 + use<> {
        let least = LEAST_SHARE.min(self.share);
        move |wanted| (wanted * factor).clamp(least, 1.0)
    }
}

impl<W: Outlooks + ?Sized> Rounds<W> for Planning<'_> {
    type Output<'o> = PlanOutput<'o>;

    fn jobs(&self) -> Range<u32> {
        self.taken..self.jobs
    }

    fn run(&self, job: u32, outlooks: &W, output: &mut PlanOutput<'_>) {
        let PlanOutput { pixels, numbers, is_cut } = output;
        pixels.clear();
        numbers.clear();
        *is_cut = false;
        let plan = &self.plan;
        match self.round {
            Round::Look => {
                for x in 0..plan.size[0] {
                    let Outlook { covariance, depth } = outlooks.outlook([x, job], plan.size);
                    let shape = floored(&covariance.unwrap_or_default()).times(SHARPER);
                    let density = longer_deviation(&shape);
                    *is_cut |= pixels.push(Pixel { shape, depth, density, ..Pixel::default() }).is_err();
                }
            }
            Round::Weigh => {
                for index in plan.row(job) {
                    // As many computed pixels under every filter.
                    *is_cut |= numbers.push(1.0 / plan.area(index)).is_err();
                }
            }
            Round::Halve { low, high, .. } => {
                // The factor at which the mean of the clamped densities is the share.
                let density = self.density(0.5 * (low + high));
                let sum: f32 = plan.pixels.as_slice().iter().map(|p| density(p.density)).sum();
                *is_cut |= numbers.push(sum).is_err();
            }
            Round::Done => {}
        }
    }

    fn accept(&mut self, output: &PlanOutput<'_>) {
        if self.taken >= self.jobs {
            return;
        }
        self.is_cut |= output.is_cut;
        let row = self.plan.row(self.taken);
        let count = self.plan.pixels.len() as f32;
        match &mut self.round {
            Round::Look => {
                let row = &mut self.plan.pixels.as_mut_slice()[row];
                row.iter_mut().zip(output.pixels.as_slice()).for_each(|(pixel, found)| *pixel = *found);
            }
            Round::Weigh => {
                let row = &mut self.plan.pixels.as_mut_slice()[row];
                row.iter_mut().zip(output.numbers.as_slice()).for_each(|(pixel, found)| pixel.density = *found);
            }
            Round::Halve { low, high, .. } => {
                let sum = output.numbers.as_slice().first().copied().unwrap_or_default();
                let middle = 0.5 * (*low + *high);
                if sum / count > self.share { *high = middle } else { *low = middle }
            }
            Round::Done => {}
        }
        self.taken += 1;
        if self.taken == self.jobs {
            self.advance();
        }
    }

    fn stage(&self) -> &'static str {
        "plan"
    }
}

/// Which pixels are computed, and how the others are filled in. Made by [`Planning`].
///
/// ```
/// # use fogbow::covariance::image_sampling::{Outlook, PlanOutput, Planning};
/// # use fogbow::{math::float::PI, spectrum::Spectrum, work};
/// # #[cfg(feature = "alloc")] {
/// let mut planning = Planning::new([16, 16], 0.25)?;
/// work::finish(&mut planning, &[Outlook::default(); 256][..], &mut PlanOutput::default());
/// let plan = planning.finish();
/// let computed = (0..256).filter(|pixel| plan.is_computed(*pixel)).count();
/// assert_eq!((plan.size(), plan.share()), ([16, 16], computed as f32 / 256.0));
/// // The mean density is the share that was asked for. In a corner fewer pixels lend each other their light: it is higher.
/// let mean = (0..256).map(|pixel| plan.density(pixel)).sum::<f32>() / 256.0;
/// assert!((mean - 0.25).abs() < 1e-3 && (plan.share() - mean).abs() < 0.02);
/// assert!(plan.density(0) > 2.0 * plan.density(8 * 16 + 8));
/// // What varies nowhere is filtered as wide as can be: with a standard deviation of 4 pixels.
/// assert!((plan.shape(100).xx.sqrt() - 1.0 / (2.0 * PI * 4.0)).abs() < 1e-4);
/// // Filling in keeps what is even, and does not look at pixels that were not computed.
/// let image: Vec<Spectrum> = (0..256).map(|pixel| Spectrum::splat(if plan.is_computed(pixel) { 0.5 } else { 9.0 })).collect();
/// assert!((0..256).all(|pixel| (plan.filled(pixel, &image)[0] - 0.5).abs() < 1e-6));
/// # }
/// # Ok::<(), fogbow::storage::Full>(())
/// ```
#[derive(Debug)]
pub struct Plan<'s> {
    size: [u32; 2],
    pixels: List<'s, Pixel>,
}

impl Plan<'_> {
    /// Width and height (pixels).
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Whether a pixel (row by row) is computed.
    #[inline]
    #[must_use]
    pub fn is_computed(&self, index: usize) -> bool {
        self.pixels.as_slice()[index].computed != 0
    }

    /// The share of a pixel's neighbours that should be computed.
    #[must_use]
    pub fn density(&self, index: usize) -> f32 {
        self.pixels.as_slice()[index].density
    }

    /// Covariance (cycles² per pixel²) whose Gaussian fills in a pixel.
    #[must_use]
    pub fn shape(&self, index: usize) -> Symmetric2 {
        self.pixels.as_slice()[index].shape
    }

    /// The share of computed pixels.
    #[must_use]
    pub fn share(&self) -> f32 {
        let pixels = self.pixels.as_slice();
        pixels.iter().filter(|p| p.computed != 0).count() as f32 / pixels.len().max(1) as f32
    }

    /// What the computed pixels of `image` make of a pixel; the others' values are not read.
    #[must_use]
    pub fn filled(&self, index: usize, image: &[Spectrum]) -> Spectrum {
        let (mut sum, mut total) = (Spectrum::ZERO, 0.0_f32);
        // Where no filter reaches: whether it sees another surface, its distance, its colour.
        let mut nearest: Option<((bool, i64), Spectrum)> = None;
        for (other, at) in self.around(index).filter(|&(other, _)| self.is_computed(other)) {
            let colour = image[other];
            let weight = self.weight(index, other, at);
            if let Some(weight) = weight.filter(|&w| w > 0.0) {
                let weight = weight / self.density(other);
                sum += colour * weight;
                total += weight;
            }
            let key = (weight.is_none(), at[0] * at[0] + at[1] * at[1]);
            if nearest.is_none_or(|(best, _)| key < best) {
                nearest = Some((key, colour));
            }
        }
        if total > 0.0 { sum / total } else { nearest.map_or(Spectrum::ZERO, |(_, colour)| colour) }
    }

    /// The pixels of a row.
    fn row(&self, row: u32) -> Range<usize> {
        let width = self.size[0] as usize;
        row as usize * width..(row as usize + 1) * width
    }

    /// Pixels in reach of one, itself included, and how far to the right and down they are.
    fn around(&self, index: usize) -> impl Iterator<Item = (usize, [i64; 2])> + use<> {
        let [width, height] = self.size.map(i64::from);
        let (x, y) = (index as i64 % width, index as i64 / width);
        let rows = (y - REACH).max(0)..=(y + REACH).min(height - 1);
        rows.flat_map(move |up| {
            let columns = (x - REACH).max(0)..=(x + REACH).min(width - 1);
            columns.map(move |at| ((up * width + at) as usize, [at - x, up - y]))
        })
    }

    /// By how much two pixels fill each other in, the second `at` from the first; `None` where they see different things.
    fn weight(&self, a: usize, b: usize, at: [i64; 2]) -> Option<f32> {
        let [dx, dy] = at.map(|n| n as f32);
        let [a, b] = [a, b].map(|i| &self.pixels.as_slice()[i]);
        let (near, far) = (a.depth, b.depth);
        let [rise, other] = [a, b].map(|p| (p.slope[0] * dx + p.slope[1] * dy).abs());
        let is_same = near == far || (near - far).abs() < SAME_DEPTH * near.min(far) + rise.max(other);
        // Of the geometric mean of both Gaussians.
        let exponent = 0.25 * filter_precision(&a.shape.plus(&b.shape)).along(dx, dy);
        is_same.then(|| if exponent < 8.0 { float::exp(-exponent) } else { 0.0 })
    }

    /// Pixels under a pixel's filter, those counted in part that it weighs less than itself.
    fn area(&self, index: usize) -> f32 {
        self.around(index).filter_map(|(other, at)| self.weight(index, other, at)).sum::<f32>().max(1.0)
    }

    /// Makes Gaussians no wider than those of pixels around let them be: a filter in darkness must not reach into the
    /// light beside it. `bound` has a number per pixel.
    fn bound_shapes(&mut self, bound: &mut [f32]) {
        let [width, height] = self.size.map(|n| n as usize);
        let pixels = self.pixels.as_mut_slice();
        bound.iter_mut().zip(&*pixels).for_each(|(bound, pixel)| *bound = pixel.density);
        // The longer standard deviation (pixels) of each, bounded by its neighbours' in two sweeps.
        let mut relax = |x: usize, y: usize, sign: i64| {
            let mut best = bound[y * width + x];
            for (dx, dy, distance) in [(-1, 0, 1.0), (0, -1, 1.0), (-1, -1, 1.414), (1, -1, 1.414_f32)] {
                let (at, up) = (x as i64 + sign * dx, y as i64 + sign * dy);
                if at >= 0 && up >= 0 && at < width as i64 && up < height as i64 {
                    best = best.min(bound[up as usize * width + at as usize] + WIDENING * distance);
                }
            }
            bound[y * width + x] = best;
        };
        for y in 0..height {
            for x in 0..width {
                relax(x, y, 1);
            }
        }
        for y in (0..height).rev() {
            for x in (0..width).rev() {
                relax(x, y, -1);
            }
        }
        for (pixel, &mut bound) in pixels.iter_mut().zip(bound) {
            let own = pixel.density;
            if bound < own {
                let variance = |s: f32| {
                    let length = 2.0 * PI * s;
                    1.0 / (length * length)
                };
                let more = variance(bound) - variance(own);
                pixel.shape = pixel.shape.plus(&Symmetric2::diagonal(more, more));
            }
        }
    }

    /// By how much depth changes from a pixel to the next along rows and columns, as far as it does so on both sides: at a
    /// border where depth jumps, not at all.
    fn find_slopes(&mut self) {
        let [width, height] = self.size.map(|n| n as usize);
        let pixels = self.pixels.as_mut_slice();
        for index in 0..pixels.len() {
            let along = |step: usize, place: usize, count: usize| {
                if place == 0 || place + 1 >= count {
                    return 0.0;
                }
                let depth = |i: usize| pixels[i].depth;
                let (before, after) = (depth(index) - depth(index - step), depth(index + step) - depth(index));
                let least = before.abs().min(after.abs());
                if before * after > 0.0 && least.is_finite() { least.copysign(after) } else { 0.0 }
            };
            pixels[index].slope = [along(1, index % width, width), along(width, index / width, height)];
        }
    }

    /// Error diffusion (Floyd and Steinberg 1976) in snake lines: chosen pixels keep their distance from each other.
    /// `lines` has two numbers for every column and four more.
    fn dither(&mut self, share: f32, lines: &mut [f32]) {
        let [width, height] = self.size.map(|n| n as usize);
        let pixels = self.pixels.as_mut_slice();
        let mut left = (share * pixels.len() as f32) as usize;
        lines.fill(0.0);
        let (mut line, mut next) = lines[..2 * (width + 2)].split_at_mut(width + 2);
        for y in 0..height {
            let forward = y % 2 == 0;
            for i in 0..width {
                let x = if forward { i } else { width - 1 - i };
                let want = pixels[y * width + x].density + line[x + 1];
                let take = want > 0.5 && left > 0;
                pixels[y * width + x].computed = u32::from(take);
                left -= usize::from(take);
                let error = want - f32::from(u8::from(take));
                let (ahead, behind) = if forward { (x + 2, x) } else { (x, x + 2) };
                line[ahead] += error * (7.0 / 16.0);
                next[behind] += error * (3.0 / 16.0);
                next[x + 1] += error * (5.0 / 16.0);
                next[ahead] += error * (1.0 / 16.0);
            }
            core::mem::swap(&mut line, &mut next);
            next.fill(0.0);
        }
    }
}

/// With a least variation in every direction, so that filters end.
fn floored(p: &Symmetric2) -> Symmetric2 {
    let least = 1.0 / (2.0 * PI * WIDEST);
    let least = least * least / SHARPER;
    p.plus(&Symmetric2::diagonal(least, least))
}

/// The longer standard deviation (pixels) of the Gaussian of a covariance.
fn longer_deviation(p: &Symmetric2) -> f32 {
    1.0 / (2.0 * PI * float::sqrt(p.eigen().values[1].max(1e-12)))
}

/// A picture whose planned pixels are computed: what [`FillingIn`] works on.
#[derive(Debug, Clone, Copy)]
pub struct Computed<'a> {
    /// Which they are.
    pub plan: &'a Plan<'a>,
    /// The picture, row by row; other pixels are not read.
    pub pixels: &'a [Spectrum],
}

/// A picture filled in, as [`Rounds`] of jobs, one for each row.
///
/// ```
/// # use fogbow::covariance::image_sampling::{Computed, FillingIn, Outlook, PlanOutput, Planning};
/// # use fogbow::{spectrum::Spectrum, storage::List, work};
/// # #[cfg(feature = "alloc")] {
/// let mut planning = Planning::new([16, 16], 0.3)?;
/// work::finish(&mut planning, &[Outlook::default(); 256][..], &mut PlanOutput::default());
/// let plan = planning.finish();
/// let grey = |i| if plan.is_computed(i) { Spectrum::splat(0.5) } else { Spectrum::ZERO };
/// let image: Vec<Spectrum> = (0..256).map(grey).collect();
/// let mut filled = [Spectrum::ZERO; 256];
/// let mut work = FillingIn::new(&plan, &mut filled[..])?;
/// work::finish(&mut work, &Computed { plan: &plan, pixels: &image }, &mut List::default());
/// assert!(work.pixels().iter().all(|colour| (colour[0] - 0.5).abs() < 1e-6));
/// # }
/// # Ok::<(), fogbow::storage::Full>(())
/// ```
#[derive(Debug)]
pub struct FillingIn<'s> {
    pixels: List<'s, Spectrum>,
    width: usize,
    rows: u32,
    taken: u32,
}

impl<'s> FillingIn<'s> {
    /// Into one colour for every pixel of a plan.
    ///
    /// # Errors
    /// [`Full`] if there are fewer.
    pub fn new(plan: &Plan<'_>, pixels: impl Into<List<'s, Spectrum>>) -> Result<Self, Full> {
        let mut pixels = pixels.into();
        pixels.reset(plan.pixels.len(), Spectrum::ZERO)?;
        let [width, height] = plan.size;
        Ok(Self { pixels, width: width as usize, rows: if width == 0 { 0 } else { height }, taken: 0 })
    }

    /// The picture, filled in so far.
    #[must_use]
    pub fn pixels(&self) -> &[Spectrum] {
        self.pixels.as_slice()
    }
}

impl Rounds<Computed<'_>> for FillingIn<'_> {
    /// A row; lent memory has room for one.
    type Output<'o> = List<'o, Spectrum>;

    fn jobs(&self) -> Range<u32> {
        self.taken..self.rows
    }

    fn run(&self, job: u32, image: &Computed<'_>, output: &mut List<'_, Spectrum>) {
        output.clear();
        for index in image.plan.row(job) {
            if output.push(image.plan.filled(index, image.pixels)).is_err() {
                break;
            }
        }
    }

    fn accept(&mut self, output: &List<'_, Spectrum>) {
        if self.taken >= self.rows {
            return;
        }
        let row = self.taken as usize * self.width..(self.taken as usize + 1) * self.width;
        let row = &mut self.pixels.as_mut_slice()[row];
        row.iter_mut().zip(output.as_slice()).for_each(|(pixel, colour)| *pixel = *colour);
        self.taken += 1;
    }

    fn stage(&self) -> &'static str {
        "fill in"
    }
}
