//! Collisions drawn from a marched ray.
//!
//! Delta tracking asks for a bound of the medium and throws most tentative collisions away; where thickness and
//! gradients are marched anyway, the same samples say where to collide. One number decides, so that stratified numbers
//! keep their strata whatever the medium.

use super::thickness::{Marching, Part, Thickness, endless, face_term, for_each_part, is_opaque};
use crate::host::Medium;
use crate::math::{Ray, float};
use crate::spectrum::{Gradient, Spectrum};

/// A ray marched once.
#[derive(Debug, Clone, Copy)]
pub struct Marched {
    /// Where light collides; `None` if it gets through.
    pub collision: Option<MarchedCollision>,
    /// Thickness of the whole ray, as [`optical_thickness_with_gradients`](super::thickness::optical_thickness_with_gradients)
    /// has it; `None` unless asked for.
    pub whole: Option<Thickness>,
}

/// A collision on a marched ray.
#[derive(Debug, Clone, Copy)]
pub struct MarchedCollision {
    /// Distance along the ray (m).
    pub distance: f32,
    /// Transmittance up to it over the density of its distance (m): one over the extinction that was marched.
    pub factor: f32,
    /// Thickness up to it, with gradients.
    pub thickness: Thickness,
}

/// Draws a collision in a grey medium from `u` in [0, 1): extinction is that of the samples of `marching`, linear between
/// them and even before the first and after the last. Where steps are thick and ends are sampled as well, the even pieces are such
/// that `τ` of a whole part is that of its samples (decision 120).
///
/// ```text
/// τ(t) = −ln(1 − u),   T/p = 1/σ(t)
/// ```
///
/// What extinction really is at the point of collision is for the caller to weigh: `σₛ(t)/σ(t)` has, as the marched `τ` has,
/// no bias but that of the steps; it has no bound where extinction between two samples is far above both (walks set one), and
/// what lies between two samples in vacuum is missed: steps must resolve the medium. In coloured media the first channel counts.
/// `to_end` also measures what lies beyond. Inversion of Jarosz et al. 2008, Eq. 16; not in the paper, which draws by Eq. 29.
///
/// ```
/// # use fogbow::{math::*, medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
/// # use fogbow::transmittance::{marched::march, thickness::Marching};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(2.0), Lobe::Isotropic)?;
/// let ray = Ray::new(Vec3::ZERO, Vec3::X);
/// let collision = march(&ray, &fog, Marching::midpoints(8), 0.5, false).collision.unwrap();
/// assert!((collision.distance - 0.5 * core::f32::consts::LN_2).abs() < 1e-6);   // the median
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
#[must_use]
pub fn march(ray: &Ray, medium: &(impl Medium + ?Sized), marching: Marching, u: f32, to_end: bool) -> Marched {
    // NaN fails, too.
    if !(ray.length > 0.0) {
        return Marched { collision: None, whole: to_end.then(Thickness::default) };
    }
    let (mut draw, mut whole) = (Draw::new(u), Thickness::default());
    let mut moment = Gradient::ZERO;
    for_each_part(ray, medium, |part, is_endless| {
        match part {
            Part::Constant { extinction, from, until } => {
                let here = (extinction[0], Gradient::ZERO);
                draw.advance(from, until - from, here, here);
                whole.value += extinction * (until - from);
            }
            Part::Changing { from, until, densest } => {
                // Linear between samples. From an end that is sampled, too, to the next sample it is even, and such that sums are those of the samples.
                let (mut at, mut end, mut last) = (from, None, None);
                marching.samples((from, until, densest), |t, weight, is_end| {
                    let (extinction, gradient) = medium.extinction_with_gradient(ray.at(t));
                    whole.value += extinction * weight;
                    whole.gradient_joint += gradient * weight;
                    moment += gradient * (weight * t);
                    let here = (extinction[0], gradient);
                    match last {
                        None if is_end => {
                            end = Some((weight, here));
                            return false;
                        }
                        None => {
                            let piece = even((weight, here), end, t - at);
                            draw.advance(at, t - at, piece, piece);
                        }
                        Some((step, last)) if is_end => {
                            let piece = even((step, last), Some((weight, here)), until - at);
                            draw.advance(at, until - at, piece, piece);
                            at = until;
                            return true;
                        }
                        Some((_, last)) => draw.advance(at, t - at, last, here),
                    }
                    (at, last) = (t, Some((weight, here)));
                    !to_end && draw.found.is_some()
                });
                if let Some((_, last)) = last {
                    draw.advance(at, until - at, last, last);
                }
            }
            Part::Endless { extinction, from } => {
                let here = (extinction[0], Gradient::ZERO);
                draw.advance(from, f32::MAX, here, here);
                whole.value += endless(extinction);
            }
        }
        !to_end && draw.found.is_some() || is_endless && is_opaque(whole.value)
    });
    whole.value = whole.value.max(Spectrum::ZERO);
    // With the far end held, what lies near it moves less.
    let held = |joint: &Gradient, moment: &Gradient, value: Spectrum, length: f32| {
        if !(length > 0.0) {
            return Gradient::ZERO;
        }
        let inverse = 1.0 / length;
        // 0 for an infinite ray: then the far end moves along, as it were.
        let end = if inverse > 0.0 { Gradient::outer(value * inverse, -ray.direction) } else { Gradient::ZERO };
        *joint - *moment * inverse + end
    };
    let mut collision = draw.found.map(|(distance, density)| {
        let value = Spectrum::splat(-float::ln_1p(-u));
        let gradient_fixed = held(&draw.joint, &draw.moment, value, distance);
        let thickness = Thickness { value, gradient_fixed, gradient_joint: draw.joint };
        MarchedCollision { distance, factor: 1.0 / density, thickness }
    });
    whole.gradient_fixed = held(&whole.gradient_joint, &moment, whole.value, ray.length);
    medium.faces(ray, &mut |face| {
        let term = face_term(ray.direction, face.normal, face.jump);
        let add = |thickness: &mut Thickness, length: f32| {
            thickness.gradient_joint += term;
            thickness.gradient_fixed += term * (1.0 - (face.distance / length).clamp(0.0, 1.0));
        };
        add(&mut whole, ray.length);
        if let Some(collision) = collision.as_mut().filter(|collision| face.distance <= collision.distance) {
            add(&mut collision.thickness, collision.distance);
        }
    });
    Marched { collision, whole: to_end.then_some(whole) }
}

/// Extinction in the first channel (m⁻¹), and its gradient.
type Local = (f32, Gradient);

/// What is even along a piece of some length between an end and the sample next to it, each with its weight (m): half of a step counts there, and what takes
/// its offset away; without an end that of the sample.
#[inline]
fn even((step, (extinction, gradient)): (f32, Local), end: Option<(f32, Local)>, length: f32) -> Local {
    let Some((weight, (end, end_gradient))) = end.filter(|_| length > 0.0) else {
        return (extinction, gradient);
    };
    let (near, far) = (0.5 * step / length, weight / length);
    ((extinction * near + end * far).max(0.0), gradient * near + end_gradient * far)
}

/// A collision being looked for.
struct Draw {
    /// Thickness up to it.
    left: f32,
    /// `∫ ∇σ ds` and `∫ s ∇σ ds` so far.
    joint: Gradient,
    moment: Gradient,
    /// Its distance, and extinction there.
    found: Option<(f32, f32)>,
}

impl Draw {
    fn new(u: f32) -> Self {
        Self { left: -float::ln_1p(-u), joint: Gradient::ZERO, moment: Gradient::ZERO, found: None }
    }

    /// A piece of a ray on which extinction and its gradient are linear.
    #[inline]
    fn advance(&mut self, from: f32, length: f32, (a, slope_a): Local, (b, slope_b): Local) {
        if self.found.is_some() || !(length > 0.0) {
            return;
        }
        let (mut reach, mut rise) = (length, 0.5);
        let thickness = 0.5 * (a + b) * length;
        if self.left < thickness {
            let root = float::safe_sqrt(a * a + 2.0 * (b - a) * (self.left / length));
            reach = if a + root > 0.0 { (2.0 * self.left / (a + root)).min(length) } else { 0.0 };
            let share = reach / length;
            rise = 0.5 * share;
            let density = a + (b - a) * share;
            // Vacuum at the very start of the piece, and a number of 0.
            if density > 0.0 {
                self.found = Some((from + reach, density));
            }
        }
        self.left = (self.left - thickness).max(0.0);
        let slope = (slope_a + (slope_b - slope_a) * rise) * reach;
        self.joint += slope;
        self.moment += slope * (from + 0.5 * reach);
    }
}
