//! What clamping takes away, found again: the next vertex of a compensation path.

use super::bound::Bound;
use super::scatterer::{Receiver, Scatterer};
use crate::host::{Medium, Scene};
use crate::math::{Ray, float};
use crate::sampling::distance::truncated_exponential;
use crate::sampling::{Generator, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::transmittance::{flight, transmittance};
use crate::world::{World, nearest_surface};

/// Probability, at least, that a vertex drawn within the ball is looked at. Larger: more vertices that hardly count. Smaller:
/// surfaces make outliers.
const LEAST_SURVIVAL: f32 = 0.25;

/// How far the next vertex lies, and what light loses on the way there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flights {
    /// Woodcock tracking: unbiased; many flights leave the ball in which anything is missing.
    Woodcock,
    /// The truncated exponential of the mean extinction around the receiver (Engelhardt et al. 2012, Eq. 4–5), taken within
    /// half of the ball's radius, with the transmittance that is really there: unbiased, and all flights end within the ball.
    Truncated,
    /// The same, and the transmittance is that of the mean extinction, too: cheaper, and biased where extinction
    /// varies within the ball.
    LocallyHomogeneous,
}

/// How what clamping takes away is brought back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Compensation {
    /// Lights that share a point on an eye ray, at least 1. More lights on more points of their own: less noise of where
    /// points lie.
    pub lights_per_point: u32,
    /// Lights that share a compensation path, at least 1: its vertices see all of them.
    pub lights_per_path: u32,
    /// How vertices are found.
    pub flights: Flights,
    /// Vertices of a compensation path at most: of what clamping takes, a share of `κ_B` to this power is left (see
    /// [`contraction`](super::contraction)). `u32::MAX` for no limit.
    pub steps: u32,
    /// Whether a vertex that lies behind a surface is none. If not, light leaks through thin walls, by little
    /// (Engelhardt et al. 2012, § 4.4), and surfaces beside a medium send it nothing back. Receivers on surfaces
    /// always look.
    pub local_visibility: bool,
}

impl Compensation {
    /// All of it, without bias (Raab et al. 2008): the reference. 1-to-N: a point has one path, whose vertices see all
    /// lights.
    pub const FULL: Self = Self {
        lights_per_point: u32::MAX,
        lights_per_path: u32::MAX,
        flights: Flights::Woodcock,
        steps: u32::MAX,
        local_visibility: true,
    };
    /// Engelhardt's N-to-1: a point has a path for each light.
    pub const N_TO_ONE: Self = Self { lights_per_path: 1, steps: 2, ..Self::FULL };
    /// Engelhardt's 1-to-1: each light has a point and a path of its own.
    pub const ONE_TO_ONE: Self = Self { lights_per_point: 1, ..Self::N_TO_ONE };
    /// Approximate bias compensation: as 1-to-1, locally homogeneous; by fours, which is noisier by an eighth and costs
    /// little more than half.
    pub const APPROXIMATE: Self =
        Self { lights_per_point: 4, lights_per_path: 4, flights: Flights::LocallyHomogeneous, ..Self::ONE_TO_ONE };
}

/// Radius, in that of the clamped ball, within which extinction is averaged for the way to the next vertex.
///
/// Engelhardt et al. 2012, § 4.2, take the whole ball. But vertices lie near its centre, and what lies before them
/// is nearer still: where smoke is densest, the whole ball's mean is too thin.
const MEAN_WITHIN: f32 = 0.5;

/// The next vertex of a compensation path from `receiver`, and the weight of what is scattered there towards it.
///
/// ```text
/// C(y,ω) = ∫∫ f̂ D V̂ B̂ L_o(y′,ω′) dt dω′ (+ a surface within d)  =  E w L_o(y′)
/// w = (f̂ D/p(ω′)) T B̂/p(t),   at a surface at s:  (f̂ D/p(ω′)) T B̂/Prob(t ≥ s)
/// ```
///
/// The weight's unit: 1 from a medium to a medium and from a surface to a surface, m from a surface to a medium (whose light
/// is per metre), m⁻¹ the other way. Unbiased, but for [`Flights::LocallyHomogeneous`] where extinction varies.
/// `None` where the path ends. Engelhardt et al. 2012, Eq. 3–5 with the sheet's § 3.3 and 3.4: the paper leaves out the
/// integral over distance and, in its pseudo-code, `σₛ(y)`.
///
/// ```
/// # use fogbow::{host::{Empty, Medium}, math::Vec3, medium::Homogeneous, phase::Phase, sampling::Generator};
/// # use fogbow::{spectrum::Spectrum, vpl::{Bound, Compensation, Receiver, contraction, next_vertex}};
/// # use fogbow::world::World;
/// let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::splat(0.8), Phase::ISOTROPIC)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let receiver = Receiver::in_medium(Vec3::ZERO, Vec3::Z, &fog.properties(Vec3::ZERO)).unwrap();
/// let (bound, mut rng) = (Bound::within(1.2)?, Generator::new(1));
/// let mut next = || next_vertex(&world, &receiver, bound, &Compensation::APPROXIMATE, &mut rng);
/// // The mean weight is what a step makes of the light it is given.
/// let mean = (0..4000).filter_map(|_| Some(next()?.1[0] / 4000.0)).sum::<f32>();
/// assert!((mean - contraction(1.0, 0.8, 1.2)).abs() < 0.02);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[must_use]
pub fn next_vertex<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    receiver: &Receiver,
    bound: Bound,
    compensation: &Compensation,
    rng: &mut Generator,
) -> Option<(Receiver, Spectrum)> {
    let (choice, u_direction, u_distance) = (uniform(rng), uniform2(rng), uniform(rng));
    let radius = bound.radius();
    if !(radius > 0.0) {
        return None;
    }
    let (direction, scattered) = receiver.scatterer.sample(receiver.to_eye, choice, u_direction)?;
    let cosine = receiver.scatterer.cosine(direction);
    // Farther along this direction nothing is clamped.
    let limit = radius * float::sqrt(cosine);
    let way = Ray { origin: receiver.origin(direction), direction, length: limit };
    if scattered.is_black() || !(limit > 0.0) {
        return None;
    }
    let looks = compensation.local_visibility || matches!(receiver.scatterer, Scatterer::Surface { .. });
    let surface = |length: f32| if looks { nearest_surface(&way.with_length(length), world.scene) } else { None };

    // Distance to a vertex in the medium, or none; what light loses on the way over the density of arriving there.
    let (vertex, hit, arriving) = if compensation.flights == Flights::Woodcock {
        let hit = surface(limit);
        let clear = hit.as_ref().map_or(limit, |hit| hit.distance);
        let flown = flight(world.medium, &way.with_length(clear), scattered, u_distance, rng);
        match flown.collision {
            Some(properties) => (Some((flown.distance, properties)), None, flown.weight.ratio(properties.extinction())),
            None => (None, hit, flown.weight),
        }
    } else {
        let mean = world.medium.mean_extinction(receiver.point, MEAN_WITHIN * radius);
        let rate = mean.mean();
        let sample = truncated_exponential(u_distance, rate, limit);
        let is_exact = compensation.flights == Flights::Truncated;
        let lost = |distance: f32, rng: &mut Generator| {
            if is_exact {
                transmittance(world.medium, &way.with_length(distance), rng)
            } else {
                (mean * distance).transmitted()
            }
        };
        // Roulette by what is missing at that distance, before anything costly is asked; with a floor, for surfaces
        // before it weigh by theirs.
        let survives = bound.missing(sample.distance * sample.distance, cosine).max(LEAST_SURVIVAL);
        if uniform(rng) >= survives {
            return None;
        }
        if let Some(hit) = surface(sample.distance) {
            let reached = truncated_exponential_tail(hit.distance, rate, limit);
            let arriving = lost(hit.distance, rng) * (1.0 / (reached * survives));
            (None, Some(hit), arriving)
        } else {
            let properties = world.medium.properties(way.at(sample.distance));
            let arriving = if is_exact || !mean.is_grey() {
                lost(sample.distance, rng) * (1.0 / sample.pdf)
            } else {
                Spectrum::splat(sample.weight)
            };
            (Some((sample.distance, properties)), None, arriving * (1.0 / survives))
        }
    };
    let to_eye = -direction;
    let (next, distance, cosines) = match (vertex, hit) {
        (Some((distance, properties)), _) => {
            (Receiver::in_medium(way.at(distance), to_eye, &properties)?, distance, cosine)
        }
        (None, Some(hit)) => {
            let next = Receiver::on_surface(way.at(hit.distance), to_eye, &hit)?;
            (next, hit.distance, cosine * next.scatterer.cosine(to_eye))
        }
        (None, None) => return None,
    };
    let missing = bound.missing(distance * distance, cosines);
    // At the very border of the ball nothing is missing, and nothing arrives there either: 0/0.
    if missing <= 0.0 {
        return None;
    }
    let weight = scattered * arriving * missing;
    (!weight.is_black()).then_some((next, weight))
}

/// Probability that a truncated exponential distance is `distance` (m) or more.
///
/// ```text
/// (e^{−σs} − e^{−σd})/(1 − e^{−σd}) = (1 − e^{−σ(d−s)}) e^{−σs}/(1 − e^{−σd})
/// ```
fn truncated_exponential_tail(distance: f32, extinction: f32, limit: f32) -> f32 {
    let rest = limit - distance;
    let a = extinction * limit;
    if a < 1e-4 {
        return (rest / limit) * (1.0 - 0.5 * extinction * distance);
    }
    float::exp_m1(-extinction * rest) / float::exp_m1(-a) * float::exp(-extinction * distance)
}
