//! How much of a connection is kept, and how much is lost.

use crate::math::float;
use crate::world::Outline;

/// The bound `b` (m⁻²) by which geometry terms are clamped.
///
/// ```text
/// Ĝ = D_x D_y/r²,   Ĝ′ = min(Ĝ, b),   B̂ = max(0, Ĝ − b)/Ĝ,   d = 1/√b
/// ```
///
/// `D` is the cosine at a surface and 1 in a medium. Engelhardt et al. 2012, § 3.4 and Eq. 3 (sheet § 3.3).
///
/// ```
/// # use fogbow::vpl::Bound;
/// let bound = Bound::within(0.5)?;
/// assert_eq!((bound.value(), bound.radius()), (4.0, 0.5));   // b = 1/d²
/// // What is left of a connection over 0.25 m and what is missing make all of it.
/// let (geometry, missing) = (1.0 / 0.0625, bound.missing(0.0625, 1.0));
/// assert_eq!(bound.clamped(geometry), 4.0);
/// assert_eq!(bound.clamped(geometry) + missing * geometry, geometry);
/// assert_eq!(bound.missing(0.25, 1.0), 0.0);   // nothing, farther away
/// # Ok::<(), fogbow::vpl::NoBound>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Bound(f32);

/// A bound must be positive; infinite means none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoBound;

impl core::fmt::Display for NoBound {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("a bound of geometry terms must be positive")
    }
}

impl core::error::Error for NoBound {}

impl Bound {
    /// Nothing is clamped, nothing is lost, and bright splotches surround virtual lights.
    pub const NONE: Self = Self(f32::INFINITY);

    /// Clamps to `b` (m⁻², positive; infinite for none).
    ///
    /// # Errors
    /// [`NoBound`] for 0, negative numbers and NaN.
    ///
    /// ```
    /// # use fogbow::vpl::Bound;
    /// let bound = Bound::new(4.0)?;
    /// assert_eq!((bound.radius(), bound.clamped(9.0), bound.missing(0.25, 1.0)), (0.5, 4.0, 0.0));
    /// # Ok::<(), fogbow::vpl::NoBound>(())
    /// ```
    pub fn new(b: f32) -> Result<Self, NoBound> {
        if b > 0.0 { Ok(Self(b)) } else { Err(NoBound) }
    }

    /// The bound that clamps within the distance `radius` (m, positive): `b = 1/d²`.
    ///
    /// # Errors
    /// [`NoBound`] where `1/d²` is no positive number.
    pub fn within(radius: f32) -> Result<Self, NoBound> {
        if radius > 0.0 { Self::new(1.0 / (radius * radius)) } else { Err(NoBound) }
    }

    /// `b` (m⁻²).
    #[inline]
    #[must_use]
    pub fn value(self) -> f32 {
        self.0
    }

    /// `d = 1/√b` (m): beyond it nothing is clamped, whatever the cosines.
    #[inline]
    #[must_use]
    pub fn radius(self) -> f32 {
        1.0 / float::sqrt(self.0)
    }

    /// `Ĝ′ = min(Ĝ, b)` (m⁻²).
    #[inline]
    #[must_use]
    pub fn clamped(self, geometry: f32) -> f32 {
        float::min(geometry, self.0)
    }

    /// `B̂`: the share of a connection that clamping takes away, where the squared distance is `distance2` (m²) and
    /// the product of the cosines `cosines`, `Ĝ = cosines/distance2`; 0 where `Ĝ` is.
    ///
    /// Between two points of a medium it is `1 − b r²`.
    #[inline]
    #[must_use]
    pub fn missing(self, distance2: f32, cosines: f32) -> f32 {
        if self.0 == f32::INFINITY || cosines <= 0.0 {
            return 0.0;
        }
        (1.0 - self.0 * (distance2 / cosines)).max(0.0)
    }
}

/// `Ĝ` (m⁻²) of two points `distance2` (m²) apart, with the product of their cosines; 0 where they turn away from each
/// other, infinite where they coincide.
///
/// ```
/// # use fogbow::vpl::geometry;
/// assert_eq!((geometry(4.0, 1.0), geometry(4.0, 0.5)), (0.25, 0.125));
/// assert_eq!((geometry(4.0, -1.0), geometry(0.0, 1.0)), (0.0, f32::INFINITY));
/// ```
#[inline]
#[must_use]
pub fn geometry(distance2: f32, cosines: f32) -> f32 {
    if cosines > 0.0 { cosines / distance2 } else { 0.0 }
}

/// `κ_B`: what one step of compensation within `radius` (m) makes of the light it is given, in an even isotropic medium
/// with `extinction` (m⁻¹) and `albedo`.
///
/// ```text
/// κ_B = σₛ ∫₀ᵈ e^{−σₜr} (1 − r²/d²) dr = ϖ (1 − 2 (1 − e^{−a}(1 + a))/a²),   a = σₜd;   → ⅔ σₛ d for a → 0
/// ```
///
/// After n steps `κ_Bⁿ` of the energy that clamping took is still missing (sheet § 3.3).
///
/// ```
/// # use fogbow::vpl::contraction;
/// assert!((contraction(1.0, 0.8, 1.2) - 0.425).abs() < 1e-3);
/// ```
#[must_use]
pub fn contraction(extinction: f32, albedo: f32, radius: f32) -> f32 {
    let a = extinction * radius;
    if a < 1.0 {
        // Σ (−1)^{m+1} 2(m+1)/(m+2)! aᵐ: the closed form cancels.
        let mut sum = 0.0;
        let (mut power, mut factorial) = (1.0_f32, 2.0_f32);
        for m in 1..=9_u8 {
            let m = f32::from(m);
            power *= -a;
            factorial *= m + 2.0;
            sum -= power * 2.0 * (m + 1.0) / factorial;
        }
        return albedo * sum;
    }
    if a.is_nan() {
        // No extinction, and no end.
        return 0.0;
    }
    let left = if a < float::OPAQUE { float::exp(-a) * (1.0 + a) } else { 0.0 };
    albedo * (1.0 - 2.0 * (1.0 - left) / (a * a))
}

/// The radius (m, at most `most`) at which [`contraction`] is `wanted`: what clamps no more than a few steps of
/// compensation bring back. `most` where the medium never loses as much.
///
/// ```
/// # use fogbow::vpl::{contraction, radius_for};
/// let radius = radius_for(0.25, 2.0, 0.9, 10.0);
/// assert!((contraction(2.0, 0.9, radius) - 0.25).abs() < 1e-4);
/// assert_eq!(radius_for(0.25, 0.0, 0.9, 10.0), 10.0);
/// ```
#[must_use]
pub fn radius_for(wanted: f32, extinction: f32, albedo: f32, most: f32) -> f32 {
    if !(contraction(extinction, albedo, most) > wanted) {
        return most;
    }
    // It grows with the radius: halving finds it, down to the last bit of a float.
    let (mut low, mut high) = (0.0, most);
    for _ in 0..48 {
        let middle = 0.5 * (low + high);
        if contraction(extinction, albedo, middle) > wanted {
            high = middle;
        } else {
            low = middle;
        }
    }
    low
}

/// Share of its energy that a step of compensation may leave, by [`usual_bound`]: two steps then leave a sixteenth.
const LEFT: f32 = 0.25;

/// The radius of [`usual_bound`] in thin media, as a part of the diagonal of what there is: surfaces lose light, too.
const THIN: f32 = 0.09;

/// The radius of [`usual_bound`] where bounds say nothing, at most, in mean free paths: beyond, a step of compensation sees
/// hardly anything.
const MOST_FREE_PATHS: f32 = 8.0;

/// A bound that works: within a radius at which a step of compensation leaves a quarter, `κ_B(σ̄, d) = 0.25`, so that two
/// bring back nearly all; never beyond 0.09 of the diagonal of the bounds. Where these have no size, or no end, and there is
/// no fog either, a metre.
///
/// Larger radii clamp more, and leave smoother light to the virtual lights; but more has to be brought back. `σ̄` is the
/// extinction where light collides ([`Outline::extinction`]). Engelhardt et al. 2012 leave the bound to the user.
///
/// ```
/// # use fogbow::{host::Empty, math::{Bounds, Vec3}, vpl::usual_bound, world::{Outline, World}};
/// let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
/// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(3.0, 4.0, 0.0) };
/// assert!((usual_bound(&Outline::of(&world, bounds)).radius() - 0.45).abs() < 1e-6);
/// ```
#[must_use]
pub fn usual_bound(outline: &Outline) -> Bound {
    let diagonal = outline.bounds.size().length();
    // Where nothing says how large the world is, its fog does.
    let most =
        if diagonal > 0.0 && diagonal.is_finite() { THIN * diagonal } else { MOST_FREE_PATHS / outline.extinction };
    if !(most > 0.0 && most.is_finite()) {
        return Bound(1.0);
    }
    let radius =
        if outline.extinction > 0.0 { radius_for(LEFT, outline.extinction, outline.albedo, most) } else { most };
    Bound::within(radius).unwrap_or(Bound(1.0))
}
