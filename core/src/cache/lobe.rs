//! Light towards the eye, beside an expansion of low degree.
//!
//! What fog scatters sharply changes with the direction faster than an expansion of low degree can follow, and one of high degree is most of the
//! work of a record. But an eye looks at a record from one side. So the record holds, besides a short expansion, what that leaves out of
//! the light towards the eye, with its gradients as the point moves and as the direction turns (decision 81).

use glam::Vec3;

use crate::math::float;
use crate::phase::Phase;
use crate::sh::{self, Coefficient};
use crate::spectrum::{Gradient, Spectrum};

/// Attachments that a lobe takes, behind those of the expansion.
pub(super) const ATTACHED: usize = 2;

/// Degree of the expansions of records that have a lobe, and pictures are made from. Larger: time; smaller: views that no record was made for see less.
pub(super) const DEGREE: usize = 2;

/// Part of the energy of an expansion beyond its degree below which there is no lobe.
const LITTLE: f32 = 2.5e-4;

/// How much directions that differ count beside a distance over a radius. Larger: records where the eye is near; smaller: light from the wrong side.
const TURN: f32 = 1.0;

/// How many of so many attachments are coefficients of an expansion; the others are a lobe.
pub(super) fn coefficients_of(stride: usize) -> usize {
    let whole = sh::degree_of(stride + 1).map_or(0, |degree| sh::coefficient_count(degree) - 1);
    if whole > 0 && stride == whole + ATTACHED { whole } else { stride }
}

/// The light of a record towards one eye that its expansion leaves out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lobe {
    /// Where the eye is (unit).
    pub(super) to_eye: Vec3,
    /// How fast it falls off as the direction turns: as `exp(−sharpness (1 − cos))`.
    pub(super) sharpness: f32,
    /// Towards the eye (W·m⁻²·sr⁻¹).
    pub(super) value: Spectrum,
    /// As the point moves (W·m⁻³·sr⁻¹).
    pub(super) gradient: Gradient,
    /// As the direction turns: tangential (W·m⁻²·sr⁻¹ per radian).
    pub(super) turn: Gradient,
}

impl Lobe {
    /// As attached to a record; `None` of a record that no eye has asked for.
    #[inline]
    pub(super) fn read(attached: &[Coefficient]) -> Option<Self> {
        let [light, turn] = attached else { return None };
        let scaled = Vec3::from(turn.value.0);
        let sharpness = scaled.length();
        let (value, gradient, turn) = (light.value, light.gradient, turn.gradient);
        (sharpness > 0.0).then(|| Self { to_eye: scaled / sharpness, sharpness, value, gradient, turn })
    }

    /// To be attached.
    pub(super) fn attached(&self) -> [Coefficient; ATTACHED] {
        let to_eye = Spectrum((self.to_eye * self.sharpness).to_array());
        [Coefficient { value: self.value, gradient: self.gradient }, Coefficient { value: to_eye, gradient: self.turn }]
    }

    /// How far a direction (unit) is from that of the eye, to be added to a distance over a radius: `sharpness (1 − cos)`.
    #[inline]
    pub(super) fn apart(&self, to_eye: Vec3) -> f32 {
        0.5 * TURN * self.sharpness * self.to_eye.distance_squared(to_eye)
    }

    /// Light in a direction, with its gradient as the point moves.
    #[inline]
    pub(super) fn seen(&self, to_eye: Vec3) -> (Spectrum, Gradient) {
        let (share, value) = self.carried(to_eye);
        (value * share, self.gradient * share)
    }

    /// How that changes as the direction turns: tangential.
    pub(super) fn turned(&self, to_eye: Vec3) -> Gradient {
        let (share, value) = self.carried(to_eye);
        let slope = self.turn + Gradient::outer(value * self.sharpness, self.to_eye);
        (slope - Gradient::outer(slope.along(to_eye), to_eye)) * share
    }

    #[inline]
    fn carried(&self, to_eye: Vec3) -> (f32, Spectrum) {
        let offset = to_eye - self.to_eye;
        let share = float::exp(-0.5 * self.sharpness * offset.length_squared());
        (share, self.value + self.turn.along(offset))
    }
}

/// How sharply light falls off from a direction that is left out of an expansion of such a degree, when it was scattered `power` times: 0 where hardly anything is.
///
/// ```text
/// K(cos) = Σ e_l P_l(cos) / Σ e_l,   e_l = (2l + 1) p_l^(2 power),  l > degree:   K'(1) = Σ e_l l(l + 1)/2 / Σ e_l
/// ```
///
/// which is what is best guessed of light in one direction when it is known in another, and comes evenly from everywhere.
pub(super) fn sharpness(phase: &Phase, degree: usize, power: u32) -> f32 {
    let (mut all, mut rest, mut slope) = (0.0, 0.0, 0.0);
    for l in 0..=sh::MAX_DEGREE {
        let moment = phase.moment(l).max_element().abs();
        let order = l as f32;
        let energy = (2.0 * order + 1.0) * (0..power).fold(1.0, |product: f32, _| product * moment * moment);
        all += energy;
        if l > degree {
            rest += energy;
            slope += energy * 0.5 * order * (order + 1.0);
        }
    }
    if rest > LITTLE * all { slope / rest } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase::Lobe as PhaseLobe;

    fn lobe() -> Lobe {
        let gradient = Gradient::outer(Spectrum::new(1.0, 2.0, 3.0), Vec3::new(0.3, -0.2, 0.5));
        let to_eye = Vec3::new(0.48, 0.6, 0.64);
        let across = Vec3::Z - to_eye * to_eye.z;
        let turn = Gradient::outer(Spectrum::splat(4.0), across);
        Lobe { to_eye, sharpness: 9.0, value: Spectrum::new(2.0, 1.0, 0.5), gradient, turn }
    }

    #[test]
    fn what_is_attached_is_read_again() {
        let (lobe, read) = (lobe(), Lobe::read(&lobe().attached()).unwrap());
        assert!((read.to_eye - lobe.to_eye).length() < 1e-6 && (read.sharpness - 9.0).abs() < 1e-5);
        assert_eq!((read.value, read.gradient, read.turn), (lobe.value, lobe.gradient, lobe.turn));
        assert_eq!(Lobe::read(&[Coefficient::ZERO; ATTACHED]), None);
        assert_eq!(Lobe::read(&[]), None);
        // Expansions of whole degrees, and with a lobe.
        assert_eq!([0, 1, 3, 5, 8, 10, 288, 290].map(coefficients_of), [0, 1, 3, 3, 8, 8, 288, 288]);
    }

    #[test]
    fn turning_it_does_what_it_says() {
        let lobe = lobe();
        assert_eq!(lobe.seen(lobe.to_eye), (lobe.value, lobe.gradient));
        assert_eq!(lobe.apart(lobe.to_eye), 0.0);
        for direction in [lobe.to_eye, Vec3::new(0.6, 0.48, 0.64), Vec3::new(0.36, 0.48, 0.8)] {
            let turned = lobe.turned(direction);
            assert!(turned.along(direction).0[0].abs() < 1e-5, "tangential");
            for side in [Vec3::X, Vec3::Y, Vec3::Z] {
                let at = |step: f32| lobe.seen((direction + side * step).normalize()).0[0];
                let difference = (at(1e-3) - at(-1e-3)) / 2e-3;
                assert!(
                    (turned.along(side)[0] - difference).abs() < 5e-3,
                    "{direction} {side}: {difference} {turned:?}"
                );
            }
        }
    }

    /// By sums of a geometric series for Henyey–Greenstein, `p_l = g^l`: the sharper, and the longer the expansion, the sharper what is left.
    #[test]
    fn what_is_left_out_is_the_sharper_the_sharper_light_is_scattered() {
        let of = |g: f32, degree| sharpness(&PhaseLobe::HenyeyGreenstein { g }.into(), degree, 2);
        assert_eq!((of(0.0, 2), of(0.2, 2)), (0.0, 0.0), "hardly anything");
        assert!(of(0.5, 2) > 6.0 && of(0.9, 2) > of(0.5, 2) && of(0.9, 4) > of(0.9, 2));
        assert_eq!(of(-0.9, 2), of(0.9, 2));
        // Degrees 3, 4, 5 with (2l + 1) 0.5^(4l) and l(l + 1)/2; what follows is nothing.
        let terms = [(7.0, 12, 6.0), (9.0, 16, 10.0), (11.0, 20, 15.0)];
        let sum = |weigh: fn(f32) -> f32| {
            terms.map(|(n, power, slope)| n * 0.5_f32.powi(power) * weigh(slope)).iter().sum::<f32>()
        };
        let expected = sum(|slope| slope) / sum(|_| 1.0);
        assert!((of(0.5, 2) / expected - 1.0).abs() < 0.01, "{} {expected}", of(0.5, 2));
    }
}
