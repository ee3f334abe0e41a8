//! Light that photons leave in the cells they fly through: all probes share all photons.
//!
//! ```text
//! 1/V ∫_V ∫ L(x, ω) Y(ω) dω dx  =  E 1/(N V) Σ_flights power · length within the cell · Y(direction)
//! ```
//!
//! The estimator by track lengths of neutron transport (Spanier 1966), of radiance and not of collisions, so that thin fog is no noisier than thick. What a probe gets is
//! the mean over its cell, or over that part of it that no surface hides from the probe; a flight crosses some thirty cells of a grid and asks for no shadow ray.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::basis::{Parts, ProbeBasis, Projection, Quantity};
use super::grid::{BRICK, PROBES, ProbeGrid};
use super::places::PLANES;
use super::probe::Probe;
use super::settings::BakeSettings;
use crate::covariance::Lattice;
use crate::host::{Medium, Scene};
use crate::math::{Bounds, Ray};
use crate::phase::Phase;
use crate::photon::{self, Event};
use crate::sampling::{even2, even3, independent, warp};
use crate::sh;
use crate::spectrum::Spectrum;
use crate::storage::{Full, List};
use crate::world::{World, nearest_surface};

/// Photons of a job. More: longer jobs; fewer: more results to be taken in order.
const JOB: u32 = 1024;

/// Photons of a pass for each probe: in a closed room some two hundred flights cross its cell. More: bakes of little error asked for do more than they need, since
/// there are several passes in any case; fewer: more is done for each pass beside.
const PER_PROBE: usize = 4;

/// Fewest photons of a pass.
const LEAST: usize = 1 << 14;

/// Most photons of a pass: their flights take some hundred megabytes.
const MOST: usize = 1 << 18;

/// Sets the random numbers of photons apart from those of probes and pixels.
const PHOTON_KEY: u64 = 0xf119_0000_0000_0000;

/// How far (in cells) the part of a cell reaches at least on the side of a probe that is away from a surface. What is before a surface alone is not around the
/// probe; a part that is as thin on both sides of it as there is room before the surface has few photons.
const LEAST_ROOM: f32 = 0.25;

/// Points that tell how large a part of a cell is: to a few parts in a thousand.
const VOLUME_POINTS: u32 = 1024;

/// Points of a part, and directions, in which it is compared with what its probe sees. More: rays to no end; fewer: ledges are missed.
const SEEN_FROM: usize = 8;

/// See [`SEEN_FROM`].
const SEEN_ALONG: u32 = 24;

/// Share of what is seen that may differ. Smaller: more probes are given paths of their own than photons have wrong.
const MOST_UNLIKE: f32 = 0.1;

/// A photon's flight within the box.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct PhotonFlight {
    /// Where it begins (m).
    pub origin: Vec3,
    /// Where it goes (unit).
    pub direction: Vec3,
    /// How far (m).
    pub length: f32,
    /// Power (W), not yet divided by the number of photons.
    pub power: Spectrum,
}

impl PhotonFlight {
    fn ray(&self) -> Ray {
        Ray::new(self.origin, self.direction).with_length(self.length)
    }
}

/// Memory for the photons of a pass.
///
/// ```
/// # #[cfg(feature = "alloc")]
/// # {
/// let memory = fogbow::bake::FlightMemory::default(); // grows
/// assert_eq!(memory.flights.len(), 0);
/// # }
/// ```
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct FlightMemory<'s> {
    /// Flights within the box: of each photon about as many as it is scattered.
    pub flights: List<'s, PhotonFlight>,
    /// For each flight as many as it crosses bricks of 4 × 4 × 4 probes.
    pub crossings: List<'s, u32>,
    /// One more than bricks.
    pub starts: List<'s, u32>,
}

/// The photons of a bake.
#[derive(Debug)]
pub(super) struct Photons<'s> {
    memory: FlightMemory<'s>,
    /// All surfaces and media.
    world: Bounds,
    /// The pass that they are for.
    pub(super) pass: u32,
    jobs: u32,
    /// The job whose result is due; as many as there are when all are there.
    pub(super) next: u32,
}

impl<'s> Photons<'s> {
    pub(super) fn new(memory: FlightMemory<'s>, world: Bounds, probes: usize) -> Self {
        let count = probes.saturating_mul(PER_PROBE).clamp(LEAST, MOST) as u32;
        let jobs = count.div_ceil(JOB);
        Self { memory, world, pass: 0, jobs, next: jobs }
    }

    pub(super) fn jobs(&self) -> core::ops::Range<u32> {
        self.next..self.jobs
    }

    /// Begins the photons of a pass.
    pub(super) fn begin(&mut self, pass: u32) {
        (self.pass, self.next) = (pass, 0);
        self.memory.flights.clear();
    }

    /// Photons of a job: their flights within the box to `flights`, but for those straight from lamps. Whether there was room for all.
    pub(super) fn shoot<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        settings: &BakeSettings,
        flights: &mut List<'_, PhotonFlight>,
    ) -> Result<(), Full> {
        let parts = Parts::from(settings.orders);
        let mut result = Ok(());
        for photon in job * JOB..(job + 1) * JOB {
            let mut rng = independent(settings.seed, PHOTON_KEY | u64::from(photon), self.pass);
            let mut is_due = false;
            photon::trace(world, &self.world, &settings.paths, &mut rng, &mut |event: &Event<'_>| match event {
                // Light of an even sky counts as that of surfaces.
                Event::Emitted { light, .. } => is_due = parts.surfaces && world.lights[*light].is_sky(),
                Event::Collided { .. } => is_due = parts.medium,
                Event::Met { .. } => is_due = parts.surfaces,
                Event::Flew { reach, distance, power } if is_due => {
                    let Some((near, far)) = settings.bounds.intersect(reach) else { return };
                    photon::for_each_piece(world.medium, reach, far.min(*distance), *power, &mut |from, to, power| {
                        let (begin, end) = (near.max(from), to);
                        if begin < end {
                            let (origin, length) = (reach.at(begin), end - begin);
                            let flight = PhotonFlight { origin, direction: reach.direction, length, power };
                            result = result.and(flights.push(flight));
                        }
                    });
                }
                Event::Flew { .. } => {}
            });
        }
        result
    }

    /// Takes the flights of the next job; after the last, sorts them by the bricks that they cross.
    pub(super) fn accept(&mut self, flights: &[PhotonFlight], grid: &ProbeGrid<'_>) -> Result<(), Full> {
        self.next += 1;
        self.memory.flights.extend_from_slice(flights)?;
        if self.next == self.jobs { self.sort(grid) } else { Ok(()) }
    }

    fn sort(&mut self, grid: &ProbeGrid<'_>) -> Result<(), Full> {
        let FlightMemory { flights, crossings, starts } = &mut self.memory;
        let counts = grid.brick_counts();
        let (low, cell) = (grid.lattice().bounds().min, grid.lattice().cell() * BRICK as f32);
        let high = low + cell * Vec3::from_array(counts.map(|n| n as f32));
        let Ok(bricks) = Lattice::new(Bounds { min: low, max: high }, counts) else { return Ok(()) };
        starts.reset(bricks.cell_count() + 1, 0)?;
        crossings.clear();
        let starts = starts.as_mut_slice();
        let for_each = |visit: &mut dyn FnMut(u32, usize)| {
            for (number, flight) in (0..).zip(flights.as_slice()) {
                let crossed = bricks.cells(&flight.ray()).filter(|crossing| grid.brick_at(crossing.cell).is_some());
                crossed.for_each(|crossing| visit(number, crossing.cell));
            }
        };
        for_each(&mut |_, brick| starts[brick] += 1);
        let mut sum = 0;
        for start in &mut *starts {
            sum += core::mem::replace(start, sum);
        }
        crossings.reset(sum as usize, 0)?;
        let crossings = crossings.as_mut_slice();
        for_each(&mut |number, brick| {
            crossings[starts[brick] as usize] = number;
            starts[brick] += 1;
        });
        // Every start has become its end.
        starts.copy_within(..starts.len() - 1, 1);
        starts[0] = 0;
        Ok(())
    }

    /// The flights that cross a brick.
    fn across(&self, brick: usize) -> impl Iterator<Item = &PhotonFlight> {
        let range = match self.memory.starts.as_slice().get(brick..brick + 2) {
            Some(&[begin, end]) => begin as usize..end as usize,
            _ => 0..0,
        };
        let flights = self.memory.flights.as_slice();
        self.memory.crossings.as_slice().get(range).unwrap_or_default().iter().filter_map(|&i| flights.get(i as usize))
    }

    /// Adds to the numbers of a brick's probes what this pass's photons leave in their cells. `probes` and `held` are in the order of
    /// [`ProbeGrid::in_brick`], with a phase function for each.
    pub(super) fn add(
        &self,
        grid: &ProbeGrid<'_>,
        brick: usize,
        probes: &[Probe],
        phases: &[Phase],
        held: &mut [[Spectrum; super::MOST_COEFFICIENTS]],
    ) {
        let Some(cells) = grid.brick_lattice(brick) else { return };
        let (basis, quantity) = (grid.basis(), grid.quantity());
        let each = 1.0 / (self.jobs * JOB) as f32 / cells.cell().element_product();
        let parts: heapless::Vec<Part, PROBES> = probes.iter().map(|probe| Part::of(probe, each)).collect();
        let projections: heapless::Vec<Projection<'_>, PROBES> =
            phases.iter().map(|phase| Projection::new(basis, quantity, phase)).collect();
        let mut y = [0.0; super::MOST_COEFFICIENTS];
        for flight in self.across(grid.place(brick)) {
            let ray = flight.ray();
            // The same for all cells; what the phase function does to it comes last.
            let mut light = [Spectrum::ZERO; super::MOST_COEFFICIENTS];
            let count = match basis {
                ProbeBasis::SphericalHarmonics { degree } => {
                    let axis = if quantity == Quantity::InScattered { flight.direction } else { -flight.direction };
                    sh::evaluate(axis, degree as usize, &mut y);
                    light.iter_mut().zip(y).for_each(|(light, y)| *light = flight.power * y);
                    basis.count()
                }
                ProbeBasis::Fluence => {
                    light[0] = flight.power;
                    1
                }
                ProbeBasis::AmbientCube => 0,
            };
            for crossing in cells.cells(&ray) {
                let Some(part) = parts.get(crossing.cell).filter(|part| part.weight > 0.0) else { continue };
                let length = part.length(&ray, &cells, crossing.cell, crossing.enter, crossing.leave);
                let weight = part.weight * length;
                if !(weight > 0.0) {
                    continue;
                }
                let held = &mut held[crossing.cell];
                if count > 0 {
                    held[..count].iter_mut().zip(&light[..count]).for_each(|(sum, light)| *sum += *light * weight);
                } else {
                    projections[crossing.cell].add(-flight.direction, flight.power * weight, held);
                }
            }
        }
        if matches!(basis, ProbeBasis::SphericalHarmonics { .. }) {
            for (held, projection) in held.iter_mut().zip(&projections) {
                projection.scale(held);
            }
        }
    }
}

/// A half space `o · normal ≤ most`, `o` in cells from the probe.
type HalfSpace = (Vec3, f32);

/// The part of a cell whose mean a probe gets: before the planes of surfaces, and about as far on the other side of the probe.
struct Part {
    bounds: heapless::Vec<HalfSpace, { 2 * PLANES }>,
    /// What a length in the part weighs: 1/(N V).
    weight: f32,
}

fn half_spaces(planes: [Vec3; PLANES]) -> heapless::Vec<HalfSpace, { 2 * PLANES }> {
    // Planes that do not cut the cell are of no concern.
    let cutting = planes.into_iter().filter(|plane| plane.abs().element_sum() > 2.0);
    cutting.flat_map(|plane| [(plane, 1.0), (-plane, (LEAST_ROOM * plane.length()).max(1.0))]).collect()
}

/// What share of a cell the part is that photons count in.
pub(super) fn open_share(planes: [Vec3; PLANES]) -> f32 {
    let bounds = half_spaces(planes);
    let holds = |offset: Vec3| bounds.iter().all(|(normal, most)| normal.dot(offset) <= *most);
    if bounds.is_empty() {
        return 1.0;
    }
    let inside = (0..VOLUME_POINTS).filter(|i| holds(Vec3::from(even3(*i)) - 0.5)).count();
    inside as f32 / VOLUME_POINTS as f32
}

/// Whether surfaces near a probe hide other directions from it than from the part of the cell that photons count in: as a narrow ledge right below it, which is
/// half of what it sees, and little of what the part sees. Such a probe has a light of its own.
pub(super) fn is_unlike_part(point: Vec3, cell: Vec3, planes: [Vec3; PLANES], scene: &(impl Scene + ?Sized)) -> bool {
    let bounds = half_spaces(planes);
    if bounds.is_empty() {
        return false;
    }
    let holds = |offset: &Vec3| bounds.iter().all(|(normal, most)| normal.dot(*offset) <= *most);
    let offsets = (0..VOLUME_POINTS).map(|i| Vec3::from(even3(i)) - 0.5).filter(holds);
    let points: heapless::Vec<Vec3, SEEN_FROM> = offsets.take(SEEN_FROM).map(|offset| point + offset * cell).collect();
    let reach = cell.length();
    let hides =
        |from: Vec3, direction: Vec3| nearest_surface(&Ray::new(from, direction).with_length(reach), scene).is_some();
    let unlike = (0..SEEN_ALONG).map(|i| {
        let direction = warp::uniform_sphere(even2(i + 1).into());
        let others = points.iter().filter(|from| hides(**from, direction)).count();
        if hides(point, direction) { points.len() - others } else { others }
    });
    unlike.sum::<usize>() as f32 > MOST_UNLIKE * (SEEN_ALONG as usize * points.len()) as f32
}

impl Part {
    fn of(probe: &Probe, weight: f32) -> Self {
        let is_open = probe.is_valid() && probe.open > 0.0 && !probe.is_by_paths();
        let bounds = half_spaces(probe.all_planes());
        Self { bounds, weight: if is_open { weight / probe.open } else { 0.0 } }
    }

    /// How long a ray is in the part (m), between two distances at which it is in the cell.
    #[inline]
    fn length(&self, ray: &Ray, cells: &Lattice, cell: usize, enter: f32, leave: f32) -> f32 {
        if self.bounds.is_empty() {
            return leave - enter;
        }
        let (size, centre) = (cells.cell(), cells.centre(cell));
        let (from, direction) = ((ray.origin - centre) / size, ray.direction / size);
        let (mut enter, mut leave) = (enter, leave);
        for (normal, most) in &self.bounds {
            let (speed, room) = (normal.dot(direction), most - normal.dot(from));
            if speed > 0.0 {
                leave = leave.min(room / speed);
            } else if speed < 0.0 {
                enter = enter.max(room / speed);
            } else if room < 0.0 {
                return 0.0;
            }
        }
        (leave - enter).max(0.0)
    }
}
