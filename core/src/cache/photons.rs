//! Light in cells of a grid, brought by photons: what random walks end at.
//!
//! Walks from a point to the lights are long where fog is dense, and rarely find light where it is dark. Photons bring the light of whole
//! paths, wherever it goes, at the cost of one walk for all the cells it passes. A cell's light is a mean over its volume, too
//! coarse for a picture, but what is gathered from many cells some scatterings away is neither blurred nor noisy.
//!
//! Where walks may end is decided by photons that are only counted (decision 56). What the light of one half of the photons differs by from that of the other tells
//! how noisy it is (decision 105).

mod known;
mod rounds;
#[cfg(all(test, feature = "alloc"))]
mod tests;

use super::resolved::MAX_DEGREE;
use crate::host::{Medium, Scene};
use crate::light::Light;
use crate::math::{Bounds, Ray, Vec3, float};
use crate::photon::{Event, for_each_piece, trace_split};
use crate::sampling::uniform::mix;
use crate::sampling::{Generator, uniform};
use crate::sent::packed;
use crate::sh;
use crate::spectrum::Spectrum;
use crate::storage::{Full, List};
use crate::world::World;

const MAX_COEFFICIENTS: usize = sh::coefficient_count(MAX_DEGREE);

/// Counted photons that must have passed a cell for walks to end there. Fewer: their noise is seen; more: walks go on where light is well known.
const LEAST_PATHS: u32 = 8;

/// Photons of one job.
pub(super) const PATHS_PER_JOB: u32 = 8;

/// What the photons of a job are expected to leave at most, where memory is lent: the parts of each pass some hundred cells.
pub(super) const DEPOSITS_OF_JOB: usize = 2048 * PATHS_PER_JOB as usize;

/// Ways of a photon, in sides of cells, between points at which it leaves light, in cells of degree 0; in those of degree `L` it is `√(1 + L/2)` times as much, as to leave light takes
/// longer there, and directions make more of its noise. More: what is told of cells is noise of points; fewer: time. Decision 114.
const CELLS_BETWEEN: f32 = 2.0;

/// The same of photons that are only counted. More: cells with little fog are not seen to scatter; fewer: time.
const COUNTED_IN: f32 = 0.5;

fn cells_between(degree: usize) -> f32 {
    CELLS_BETWEEN * float::sqrt(1.0 + 0.5 * degree as f32)
}

/// Cells across the narrowest side of the bounds, as far as there are enough. Fewer: walls on both sides cut most of them, and walks end nowhere; more: photons.
const ACROSS: f32 = 8.0;

/// Least side of a cell over that in a box which is not narrow. Smaller: lines of cells without end; larger: narrow places have none that walls do not cut.
const NARROWEST: f32 = 0.125;

/// How far, in sides of cells, from the bounds cells may begin. Farther: where it is dark none know light; less: walls just within the bounds cut the outermost.
const MOVED: f32 = 0.5;

/// Cells that one job looks at for surfaces.
pub(super) const CELLS_PER_JOB: u32 = 512;

/// How far from a cell's corners towards its middle surfaces are looked for: those that lie in its faces leave it whole.
const INSET: f32 = 1e-3;

/// How photons light the cells at which random walks end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotonEffort {
    /// The box (m) that is divided into cells; it should hold all surfaces and media.
    pub bounds: Bounds,
    /// Cells along its longest side. A box that is narrow has more, so that there are eight across it, if that makes no more of them
    /// in all than this number in a cube.
    pub cells: u32,
    /// Degree of a cell's expansion of radiance by direction, at most [`TURNING_DEGREE`](super::TURNING_DEGREE): memory goes by the square.
    pub degree: usize,
    /// Paths of photons at most.
    pub paths: u32,
    /// Flights of photons, at which no more paths begin.
    pub flights: u64,
    /// Photons that are to bring light to nearly every cell that walks may end in; a [`Filling`](super::Filling) for an [`error`](super::Settings::error)
    /// shoots as many more as their noise asks for, and this becomes that number.
    pub enough: u32,
}

impl PhotonEffort {
    /// How many cells there are along each axis, and about how long their sides are (m); `None` if the bounds are no box.
    fn division(&self) -> Option<([u32; 3], f32)> {
        let size = self.bounds.size();
        let is_box = size.is_finite() && size.cmpge(Vec3::ZERO).all() && size.max_element() > 0.0;
        if !is_box || self.cells == 0 {
            return None;
        }
        let longest = size.max_element() / self.cells as f32;
        let as_many = libm::cbrtf(size.element_product()) / self.cells as f32;
        let side = (size.min_element() / ACROSS).max(as_many).max(NARROWEST * longest).min(longest);
        Some(((size / side).to_array().map(|count| (libm::roundf(count) as u32).max(1)), side))
    }

    /// How many cells there are, and coefficients of all together, of light and of what halves differ by.
    pub(super) fn room(&self) -> (usize, usize) {
        let cells = self.division().map_or(0, |(counts, _)| counts.iter().map(|&count| count as usize).product());
        (cells, 2 * cells * sh::coefficient_count(self.degree.min(MAX_DEGREE)))
    }
}

/// What one photon leaves in one cell.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PhotonDeposit {
    cell: u32,
    path: u32,
    /// Where (m), and the direction of travel; none, while photons are only counted, where nothing scatters.
    at: Vec3,
    direction: Vec3,
    /// Power times the length of the way that it stands for (W·m).
    light: Spectrum,
}

packed!(PhotonDeposit { cell: u32, path: u32, at: Vec3, direction: Vec3, light: Spectrum });

/// Who came by one cell.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PhotonCell {
    /// How many counted photons came by, and the last of them.
    paths: u32,
    last: u32,
    /// What they brought (W·m).
    light: f32,
    /// What power photons should have here, as far as was known before this round, over what they left a light with; 0 where it is not.
    wanted: f32,
    /// Where the first did (m).
    met: Vec3,
    /// How many photons had brought light before it was asked for here.
    missed: u32,
    /// Whether something scatters in it, as far as counted photons have seen.
    scatters: bool,
    /// Whether it or one beside it scatters: only there light is asked for.
    is_lit: bool,
    /// Whether no surface cuts it.
    is_whole: bool,
}

/// Cells of light: see [`PhotonEffort`].
#[derive(Debug)]
pub struct PhotonGrid<'s> {
    /// The least corner of the first cell, and the sides of each (m).
    first: Vec3,
    side: Vec3,
    counts: [u32; 3],
    /// Where something scatters, as far as the first photons have seen, until cells fill that.
    scouted: Option<Bounds>,
    cells: List<'s, PhotonCell>,
    degree: usize,
    /// `Σ power · length · Y(direction of travel)` (W·m), cell after cell, and as many of the even photons less the odd ones.
    moments: List<'s, Spectrum>,
    paths: u32,
    flights: u64,
    /// How many paths were only counted.
    counted: u32,
    /// Up to how many paths light is brought; `None` while they are only counted.
    lit: Option<u32>,
    /// What all this was done for, and with which random numbers, once it is done.
    made_for: Option<(PhotonEffort, u64)>,
    /// The noise that they leave in a picture, and of how many photons that is known.
    noise: (f32, u32),
}

#[cfg(feature = "alloc")]
impl Default for PhotonGrid<'_> {
    fn default() -> Self {
        Self::new(List::default(), List::default())
    }
}

#[cfg(feature = "alloc")]
impl PhotonGrid<'static> {
    /// Cells lit by photons, all at once; a [`Filling`](super::Filling) does it in rounds. `walk` says how long photons fly.
    ///
    /// ```
    /// # use fogbow::{cache::{PhotonEffort, PhotonGrid}, host::{Empty, Medium}, light::Light, math::{Bounds, Vec3}};
    /// # use fogbow::{medium::{Homogeneous, Placed, Region}, path, phase::Phase, spectrum::Spectrum, world::World};
    /// // A ball of white fog under an even sky of radiance 1: as much is scattered anywhere in any direction.
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
    /// let sky = [Light::Constant(Spectrum::ONE)];
    /// let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
    /// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// let effort = PhotonEffort { bounds, cells: 4, degree: 2, paths: 200_000, flights: u64::MAX, enough: u32::MAX };
    /// let cells = PhotonGrid::lit(&world, &effort, &path::Settings::default(), 1);
    /// let properties = ball.properties(Vec3::ZERO);
    /// let (light, _) = cells.scattered(Vec3::splat(0.2), Vec3::Z, &properties).unwrap();
    /// assert!((light.radiance[0] - 1.0).abs() < 0.05, "{light:?}");
    /// assert!(cells.scattered(Vec3::splat(9.0), Vec3::Z, &properties).is_none());
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn lit<M: Medium + ?Sized, S: Scene + ?Sized>(
        world: &World<'_, M, S>,
        effort: &PhotonEffort,
        walk: &crate::path::Settings,
        seed: u64,
    ) -> Self {
        let mut cells = Self::default();
        // Growing memory is never full.
        let _ = cells.reset(effort);
        cells.light(world, (effort, walk, seed));
        cells
    }

    /// Shoots what is due.
    fn light<M: Medium + ?Sized, S: Scene + ?Sized>(
        &mut self,
        world: &World<'_, M, S>,
        (effort, walk, seed): (&PhotonEffort, &crate::path::Settings, u64),
    ) {
        let mut deposits = List::default();
        while let Some(more) = self.next_round(effort) {
            for _ in 0..more {
                deposits.clear();
                let flights = self.shoot(self.paths, world, (effort, walk, seed), &mut deposits).unwrap_or(0);
                self.accept(deposits.as_slice(), 1, u64::from(flights));
            }
        }
        for number in 0..self.len() as u32 {
            if self.is_whole(number, world.scene) {
                self.mark(&[number]);
            }
        }
    }
}

impl<'s> PhotonGrid<'s> {
    pub(super) fn new(cells: List<'s, PhotonCell>, moments: List<'s, Spectrum>) -> Self {
        Self {
            first: Vec3::ZERO,
            side: Vec3::ZERO,
            counts: [0; 3],
            scouted: None,
            cells,
            degree: 0,
            moments,
            paths: 0,
            flights: 0,
            counted: 0,
            lit: None,
            made_for: None,
            noise: (0.0, 0),
        }
    }

    /// Without cells.
    pub(super) fn none() -> Self {
        Self::new((&mut [][..]).into(), (&mut [][..]).into())
    }

    /// Whether it is what photons of such an effort and such random numbers leave, to the end.
    pub(super) fn is_made_for(&self, effort: &PhotonEffort, seed: u64) -> bool {
        self.made_for == Some((*effort, seed))
    }

    /// Whether it is done.
    pub(super) fn is_made(&self) -> bool {
        self.made_for.is_some()
    }

    /// It is done.
    pub(super) fn finish(&mut self, effort: &PhotonEffort, seed: u64) {
        self.made_for = Some((*effort, seed));
    }

    /// Whether it is done, and how noisy it is has not been told.
    pub(super) fn is_untold(&self) -> bool {
        self.is_made() && self.noise.1 != self.paths
    }

    /// The noise that it leaves in a picture.
    pub(super) fn tell(&mut self, noise: f32) {
        self.noise = (noise, self.paths);
    }

    /// What was told counts no longer: less noise is asked for.
    pub(super) fn ask_again(&mut self) {
        self.noise.1 = 0;
    }

    /// What was told of its noise, 0 if nothing was.
    pub(super) fn noise(&self) -> f32 {
        self.noise.0
    }

    /// Goes over from the light of all photons to twice that of even ones (1), from there to that of odd ones (−2), and back (1). In between it is not done.
    pub(super) fn turn(&mut self, by: f32) {
        self.made_for = None;
        let (moments, differences) = halves(self.moments.as_mut_slice());
        for (moment, difference) in moments.iter_mut().zip(differences) {
            *moment += *difference * by;
        }
    }

    /// Bytes of memory that cells hold.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.cells.as_slice()) + size_of_val(self.moments.as_slice())
    }

    /// Cells for such an effort: those that there are, if more photons are all that they lack, or dark ones.
    pub(super) fn prepare(&mut self, effort: &PhotonEffort, seed: u64) -> Result<(), Full> {
        let PhotonEffort { paths, flights, enough, .. } = *effort;
        let is_less = |(before, of): (PhotonEffort, u64)| {
            let is_more = before.paths <= paths && before.flights <= flights && before.enough <= enough;
            of == seed && is_more && PhotonEffort { paths, flights, enough, ..before } == *effort
        };
        if !self.made_for.is_some_and(is_less) {
            return self.reset(effort);
        }
        (self.lit, self.made_for) = (None, None);
        Ok(())
    }

    /// Dark cells that fill the bounds.
    pub(super) fn reset(&mut self, effort: &PhotonEffort) -> Result<(), Full> {
        (self.paths, self.flights, self.counted, self.counts) = (0, 0, 0, [0; 3]);
        (self.lit, self.made_for, self.noise, self.scouted) = (None, None, (0.0, 0), None);
        self.cells.clear();
        self.moments.clear();
        let Some((counts, side)) = effort.division() else { return Ok(()) };
        self.lay(&effort.bounds, counts, side);
        self.scouted = Some(Bounds { min: effort.bounds.max, max: effort.bounds.min });
        self.degree = effort.degree.min(MAX_DEGREE);
        let (count, coefficients) = effort.room();
        self.cells.reset(count, PhotonCell::default())?;
        self.moments.reset(coefficients, Spectrum::ZERO)?;
        self.counts = counts;
        Ok(())
    }

    /// Divides a box into cells; one that is flat is about as thick as a cell's `side` (m).
    fn lay(&mut self, bounds: &Bounds, counts: [u32; 3], side: f32) {
        let size = bounds.size();
        let counts = Vec3::from(counts.map(|count| count as f32));
        let is_flat = size.cmplt(Vec3::splat(INSET * side));
        let size = Vec3::select(is_flat, Vec3::splat(side), size);
        (self.side, self.first) = (size / counts, bounds.centre() - 0.5 * size);
    }

    /// Lays cells anew, up to where the first photons have met what scatters: walls that lie a little within the bounds would cut all the outermost cells. Faces near
    /// which they met none stay where they are, for there it is only dark, or clear.
    fn fit(&mut self, bounds: &Bounds) {
        let Some(scouted) = self.scouted.take() else { return };
        let (margin, side) = (MOVED * self.side, self.side.max_element());
        let min = Vec3::select((scouted.min - bounds.min).cmplt(margin), scouted.min, bounds.min);
        let max = Vec3::select((bounds.max - scouted.max).cmplt(margin), scouted.max, bounds.max);
        // What is flat has been met nowhere else, and has no room to be moved in.
        let is_flat = bounds.size().cmplt(2.0 * margin);
        let (min, max) = (Vec3::select(is_flat, bounds.min, min), Vec3::select(is_flat, bounds.max, max));
        self.lay(&Bounds { min, max }, self.counts, side);
        (self.paths, self.flights, self.counted) = (0, 0, 0);
        self.cells.as_mut_slice().fill(PhotonCell::default());
    }

    pub(super) fn paths(&self) -> u32 {
        self.paths
    }

    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    fn bounds(&self) -> Bounds {
        let size = Vec3::from(self.counts.map(|count| count as f32)) * self.side;
        Bounds { min: self.first, max: self.first + size }
    }

    #[inline]
    fn cell_of(&self, point: Vec3) -> Option<[u32; 3]> {
        let at = (point - self.first) / self.side;
        // Written so that NaN fails, too.
        let inside = (0..3).all(|axis| at[axis] >= 0.0 && at[axis] < self.counts[axis] as f32);
        inside.then(|| at.to_array().map(|a| a as u32))
    }

    fn number(&self, [x, y, z]: [u32; 3]) -> u32 {
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    /// What power photons should have at a point, over what they left a light with; `None` where that is not known.
    fn window(&self, at: Vec3) -> Option<f32> {
        let cell = self.cells.as_slice().get(self.number(self.cell_of(at)?) as usize)?;
        (cell.wanted > 0.0).then_some(cell.wanted)
    }

    /// Lets one photon fly; its flights are counted, what it leaves goes to `deposits`.
    pub(super) fn shoot<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        path: u32,
        world: &World<'_, M, S>,
        (effort, settings, seed): (&PhotonEffort, &crate::path::Settings, u64),
        deposits: &mut List<'_, PhotonDeposit>,
    ) -> Result<u32, Full> {
        let mut rng = Generator::new(mix(seed ^ 0x9407) ^ u64::from(path));
        let mut along = Generator::child(&mut rng);
        let (mut flights, mut kept, bounds) = (0, Ok(()), self.bounds());
        let is_counted = self.lit.is_none();
        let side = self.side.min_element();
        let spacing = side * if is_counted { COUNTED_IN } else { cells_between(self.degree) };
        // How far it flies until it next leaves something: begun anywhere, every point of its way is as likely.
        let mut left = spacing * uniform(&mut along);
        // What walks connect to is no business of cells.
        let mut is_straight = false;
        let window = |at: Vec3| self.window(at);
        trace_split(world, &effort.bounds, settings, &window, &mut rng, &mut |event: &Event<'_>| match *event {
            Event::Emitted { light, .. } => is_straight = !world.lights.get(light).is_some_and(Light::is_sky),
            Event::Flew { reach, distance, power } => {
                flights += 1;
                let straight = core::mem::replace(&mut is_straight, false);
                let Some((near, far)) = bounds.intersect(reach).filter(|_| !straight) else { return };
                for_each_piece(world.medium, reach, far.min(distance), power, &mut |from, to, power| {
                    let (near, far) = (near.max(from), to);
                    let length = far - near;
                    if !(length > 0.0) {
                        return;
                    }
                    let mut flown = left;
                    while flown < length {
                        let at = reach.at(near + flown);
                        flown += spacing;
                        let Some(cell) = self.cell_of(at).map(|cell| self.number(cell)) else { continue };
                        let is_lit = || self.cells.as_slice().get(cell as usize).is_some_and(|cell| cell.is_lit);
                        let direction = match is_counted {
                            true if world.medium.properties(at).scattering == Spectrum::ZERO => Vec3::ZERO,
                            false if !is_lit() => continue,
                            _ => reach.direction,
                        };
                        let deposit = PhotonDeposit { cell, path, at, direction, light: power * spacing };
                        kept = kept.and(deposits.push(deposit));
                    }
                    left = flown - length;
                });
            }
            Event::Collided { .. } | Event::Met { .. } => {}
        });
        kept.map(|()| flights)
    }

    pub(super) fn accept(&mut self, deposits: &[PhotonDeposit], paths: u32, flights: u64) {
        self.paths += paths;
        self.flights += flights;
        let stride = self.stride();
        let cells = self.cells.as_mut_slice();
        if self.lit.is_none() {
            self.counted += paths;
            for deposit in deposits {
                let Some(cell) = cells.get_mut(deposit.cell as usize) else { continue };
                if let Some(scouted) = self.scouted.as_mut().filter(|_| deposit.direction != Vec3::ZERO) {
                    (scouted.min, scouted.max) = (scouted.min.min(deposit.at), scouted.max.max(deposit.at));
                }
                if cell.paths == 0 {
                    cell.met = deposit.at;
                }
                if cell.paths == 0 || cell.last != deposit.path {
                    (cell.paths, cell.last) = (cell.paths + 1, deposit.path);
                }
                cell.scatters |= deposit.direction != Vec3::ZERO;
                cell.light += deposit.light.mean();
            }
            return;
        }
        let mut basis = [0.0; MAX_COEFFICIENTS];
        let (moments, differences) = halves(self.moments.as_mut_slice());
        for deposit in deposits {
            let first = deposit.cell as usize * stride;
            let of_cell = first..first + stride;
            let (Some(sums), Some(of_halves)) = (moments.get_mut(of_cell.clone()), differences.get_mut(of_cell)) else {
                continue;
            };
            sh::evaluate(deposit.direction, self.degree, &mut basis[..stride]);
            let sign = 1.0 - 2.0 * (deposit.path & 1) as f32;
            for ((sum, difference), y) in sums.iter_mut().zip(of_halves).zip(basis) {
                let light = deposit.light * y;
                *sum += light;
                *difference += light * sign;
            }
        }
    }

    /// Whether no surface cuts a cell, seen from where a photon came by; of cells that none did, and of those of which it is known, `false`.
    pub(super) fn is_whole<S: Scene + ?Sized>(&self, number: u32, scene: &S) -> bool {
        let is_open = |cell: &&PhotonCell| cell.is_lit && cell.paths >= LEAST_PATHS && !cell.is_whole;
        let Some(cell) = self.cells.as_slice().get(number as usize).filter(is_open) else {
            return false;
        };
        let [nx, ny, _] = self.counts;
        let index = Vec3::new((number % nx) as f32, (number / nx % ny) as f32, (number / (nx * ny)) as f32);
        let half = 0.5 * self.side;
        let middle = self.first + index * self.side + half;
        let is_free = |to: Vec3| {
            let ray = Ray::between(cell.met, middle + to * (half * (1.0 - INSET)));
            !scene.is_blocked(&ray)
        };
        let corners = (0..8).map(|i| Vec3::new(sign(i & 1), sign(i >> 1 & 1), sign(i >> 2)));
        let faces = (0..6).map(|i| Vec3::AXES[i >> 1] * sign(i & 1));
        corners.chain(faces).all(is_free)
    }

    pub(super) fn mark(&mut self, whole: &[u32]) {
        let cells = self.cells.as_mut_slice();
        for &number in whole {
            if let Some(cell) = cells.get_mut(number as usize) {
                cell.is_whole = true;
            }
        }
    }

    fn stride(&self) -> usize {
        sh::coefficient_count(self.degree)
    }

    fn brought(&self) -> u32 {
        self.paths - self.counted
    }
}

/// Coefficients of light, and of what halves of it differ by.
fn halves(moments: &mut [Spectrum]) -> (&mut [Spectrum], &mut [Spectrum]) {
    moments.split_at_mut(moments.len() / 2)
}

fn sign(bit: usize) -> f32 {
    if bit == 0 { -1.0 } else { 1.0 }
}
