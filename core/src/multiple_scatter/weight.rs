//! The weight of a path and its gradient.

use glam::Vec3;

use crate::math::Ray;
use crate::single_scatter::Contribution;
use crate::spectrum::{Gradient, Spectrum};
use crate::transmittance::thickness::Thickness;

/// Least cosine at a surface in the change of volume before it: `1/c` has no bound where a ray grazes a curved one.
const MIN_COSINE: f32 = 0.02;

/// How a vertex moves when the start of its segment does.
///
/// ```text
/// y ↦ y + φ δ,   φ = max(0, 1 − t/s),
/// ∇ ln(dV/r²) = (n + 2 c ω)/(c s) before a surface or face at s with normal n, c = −n·ω
///             = ω/s before a sphere of radius s,   2 ω/t beyond it and beyond faces
/// ```
///
/// for a vertex at `t` in direction `ω`. Near the start vertices go along, or `1/t²` would make the gradient
/// noise; on surfaces, on faces of the medium and around lights they stay. So none crosses a wall or leaves the fog, the volume that fills with light
/// as the start leaves a face is part of the gradient, and the steep light around a lamp adds no noise.
/// With nothing in reach this is J's translation. Neither J nor the sheet (§ 1.7) has it; exact but for visibility.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// `φ`.
    pub share: f32,
    /// Relative change of the volume element over the squared distance (m⁻¹).
    pub spread: Vec3,
    /// How the direction turns: one over the distance of the point that, at rest, would turn it so (m⁻¹).
    pub turn: f32,
}

impl Shift {
    /// The vertex goes all the way with the start.
    pub const TRANSLATION: Self = Self { share: 1.0, spread: Vec3::ZERO, turn: 0.0 };

    /// Of a vertex at `distance` (m) on a ray. `wall` is the first surface that it comes to, or face at which the medium
    /// changes abruptly ([`Medium::faces`](crate::host::Medium::faces)): distance (m) and unit normal, of either sign. `reach` (m) is the radius
    /// of the sphere around the start beyond which vertices stay.
    ///
    /// ```
    /// # use fogbow::{math::{Ray, Vec3}, multiple_scatter::Shift};
    /// let shift = Shift::new(&Ray::new(Vec3::ZERO, Vec3::X), Some((2.0, Vec3::NEG_X)), f32::INFINITY, 0.5);
    /// assert_eq!((shift.share, shift.spread), (0.75, Vec3::new(0.5, 0.0, 0.0)));
    /// ```
    #[inline]
    #[must_use]
    pub fn new(ray: &Ray, wall: Option<(f32, Vec3)>, reach: f32, distance: f32) -> Self {
        let wall = wall.filter(|&(at, _)| at > 0.0 && at < reach);
        let s = wall.map_or(reach, |(at, _)| at);
        if distance >= s {
            return Self { share: 0.0, spread: ray.direction * (2.0 / distance), turn: 1.0 / distance };
        }
        let Some((_, normal)) = wall else {
            return Self { share: 1.0 - distance / s, spread: ray.direction / s, turn: 1.0 / s };
        };
        let signed = -normal.dot(ray.direction);
        // The side that is seen.
        let normal = if signed < 0.0 { -normal } else { normal };
        let spread = (normal / signed.abs().max(MIN_COSINE) + ray.direction * 2.0) / s;
        Self { share: 1.0 - distance / s, spread, turn: 1.0 / s }
    }
}

/// `(W, ∇W)`: weight of the path so far, and how it changes when its start is moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weight {
    /// `W_k = Π a_i`.
    pub value: Spectrum,
    /// `∇W_k` (m⁻¹).
    pub gradient: Gradient,
    /// How far the last vertex moves with the start: `Π φ_i`, 1 where the path is translated.
    pub moved: f32,
    /// How the first direction turns (m⁻¹), see [`Shift::turn`]; `None` before the first vertex.
    pub turn: Option<f32>,
    /// How the last direction turns (m⁻¹).
    pub last_turn: f32,
}

impl Default for Weight {
    fn default() -> Self {
        Self::ONE
    }
}

impl Weight {
    /// Of a path without vertices.
    pub const ONE: Self =
        Self { value: Spectrum::ONE, gradient: Gradient::ZERO, moved: 1.0, turn: None, last_turn: 0.0 };

    /// One vertex on.
    ///
    /// ```text
    /// a = κ T σₛ,   ∇a = κ T (∇σₛ − σₛ ∇τ),   (W, ∇W) ← (W a, a ∇W + W ∇a)
    /// ```
    ///
    /// `kappa` holds what is frozen: phase function over the densities of direction and length and
    /// the probability of survival. `transmittance` and `thickness_gradient` (joint translation) are
    /// those of the segment, the rest belongs to the new vertex. No division by `σₛ`: where it is 0
    /// the weight is 0, and only its gradient may remain. Source: sheet § 1.7 (J, Eq. 30).
    ///
    /// ```
    /// # use fogbow::{math::Vec3, multiple_scatter::Weight, spectrum::{Gradient, Spectrum}};
    /// let half = Spectrum::splat(0.5);
    /// let thicker = Gradient::outer(Spectrum::ONE, Vec3::X);
    /// let w = Weight::ONE.advance(Spectrum::ONE, half, &thicker, Spectrum::ONE, &Gradient::ZERO);
    /// assert_eq!((w.value, w.gradient.x), (half, -half));
    /// ```
    #[inline]
    #[must_use]
    pub fn advance(
        &self,
        kappa: Spectrum,
        transmittance: Spectrum,
        thickness_gradient: &Gradient,
        scattering: Spectrum,
        scattering_gradient: &Gradient,
    ) -> Self {
        let thickness = Thickness { gradient_joint: *thickness_gradient, ..Thickness::default() };
        self.advance_by(&Shift::TRANSLATION, kappa, transmittance, &thickness, scattering, scattering_gradient)
    }

    /// One vertex on, where vertices are moved by `shift`.
    ///
    /// ```text
    /// ∇a = a ∇ ln(dV/r²) + κ T (φ ∇σₛ − σₛ ∇τ_φ),   ∇τ_φ = φ ∇τ_joint + (1 − φ) ∇τ_fixed
    /// ```
    ///
    /// `thickness` gives the gradients; its value is not used. Source: J's Eq. 30 by the
    /// change of variables that [`Shift`] describes, exact but for visibility.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, multiple_scatter::{Shift, Weight}, spectrum::{Gradient, Spectrum}};
    /// # use fogbow::transmittance::thickness::Thickness;
    /// // Half-way to a wall a vertex moves half as far as the start; it scatters more towards +x.
    /// let shift = Shift { share: 0.5, ..Shift::TRANSLATION };
    /// let (one, even) = (Spectrum::ONE, Thickness::default());
    /// let denser = Gradient::outer(one, Vec3::X);
    /// let weight = Weight::ONE.advance_by(&shift, one, one, &even, one, &denser);
    /// assert_eq!((weight.value, weight.gradient.x, weight.moved), (one, one * 0.5, 0.5));
    /// ```
    #[inline]
    #[must_use]
    pub fn advance_by(
        &self,
        shift: &Shift,
        kappa: Spectrum,
        transmittance: Spectrum,
        thickness: &Thickness,
        scattering: Spectrum,
        scattering_gradient: &Gradient,
    ) -> Self {
        let frozen = kappa * transmittance;
        let step = frozen * scattering;
        let through = thickness.gradient_joint * shift.share + thickness.gradient_fixed * (1.0 - shift.share);
        let slope =
            *scattering_gradient * shift.share - through * scattering + Gradient::outer(scattering, shift.spread);
        Self {
            value: self.value * step,
            gradient: self.gradient * step + slope * (frozen * self.value * self.moved),
            moved: self.moved * shift.share,
            turn: self.turn.or(Some(shift.turn)),
            last_turn: self.moved * shift.turn,
        }
    }

    /// Light at the last vertex, carried to the first: `(W L, L ∇W + W Πφ ∇L)`.
    ///
    /// ```
    /// # use fogbow::{multiple_scatter::Weight, single_scatter::Contribution, spectrum::{Gradient, Spectrum}};
    /// let light = Contribution { radiance: Spectrum::ONE, gradient: Gradient::ZERO };
    /// assert_eq!(Weight::ONE.scaled(0.5).carry(&light).radiance, Spectrum::splat(0.5));
    /// ```
    #[inline]
    #[must_use]
    pub fn carry(&self, light: &Contribution) -> Contribution {
        Contribution {
            radiance: self.value * light.radiance,
            gradient: self.gradient * light.radiance + light.gradient * (self.value * self.moved),
        }
    }

    /// [`Weight::carry`] of light that changes with the direction in which it leaves the last vertex, too:
    /// `turned` is its tangential gradient (W·m⁻²·sr⁻¹ per radian).
    ///
    /// ```
    /// # use fogbow::{math::Vec3, multiple_scatter::Weight, single_scatter::Contribution, spectrum::{Gradient, Spectrum}};
    /// // As the start moves by a metre, the last direction turns by half a radian.
    /// let weight = Weight { last_turn: 0.5, ..Weight::ONE };
    /// let turned = Gradient::outer(Spectrum::ONE, Vec3::X);
    /// let carried = weight.carry_turned(&Contribution::ZERO, &turned);
    /// assert_eq!(carried.gradient, turned * 0.5);
    /// ```
    #[inline]
    #[must_use]
    pub fn carry_turned(&self, light: &Contribution, turned: &Gradient) -> Contribution {
        let carried = self.carry(light);
        let gradient = carried.gradient + *turned * (self.value * self.last_turn);
        Contribution { gradient, ..carried }
    }

    /// Both parts times a factor: one over a probability of survival.
    ///
    /// ```
    /// # use fogbow::{multiple_scatter::Weight, spectrum::Spectrum};
    /// // Two out of three survive, and stand for the third.
    /// assert_eq!(Weight::ONE.scaled(1.5).value, Spectrum::splat(1.5));
    /// ```
    #[inline]
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        Self { value: self.value * factor, gradient: self.gradient * factor, ..*self }
    }
}
