//! Layer 0b: colours and their derivatives.
//!
//! Channels never mix except by min, max or mean, so a host may carry three wavelengths instead
//! of red, green and blue.

use core::ops::{Add, AddAssign, Div, DivAssign, Index, Mul, MulAssign, Neg, Sub};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::math::{Symmetric3, float};

/// One value per colour channel. A type of its own, so that a colour cannot be dotted with a
/// direction.
///
/// ```
/// # use fogbow::spectrum::Spectrum;
/// let lamp = Spectrum::new(3.0, 2.0, 1.0);
/// assert_eq!((lamp.max_element(), lamp.min_element(), lamp.mean()), (3.0, 1.0, 2.0));
/// let filter = Spectrum::new(0.5, 0.5, 0.0);
/// assert_eq!(lamp * filter, Spectrum::new(1.5, 1.0, 0.0));   // channel by channel
/// assert_eq!(lamp.min(Spectrum::splat(2.0)) + lamp.max(Spectrum::splat(2.0)), lamp + Spectrum::splat(2.0));
/// assert_eq!(lamp.zip(filter, f32::max), lamp.map(|channel| channel.max(0.5)));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(transparent)]
pub struct Spectrum(pub [f32; 3]);

impl Spectrum {
    /// Black.
    pub const ZERO: Self = Self([0.0; 3]);
    /// One in every channel.
    pub const ONE: Self = Self([1.0; 3]);

    /// From three channels.
    #[inline]
    #[must_use]
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Self([r, g, b])
    }

    /// The same value in every channel.
    #[inline]
    #[must_use]
    pub const fn splat(value: f32) -> Self {
        Self([value; 3])
    }

    /// `f` of every channel.
    #[inline(always)]
    #[must_use]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        // Written out: without link-time optimisation an array's own `map` stays a call.
        let Self([r, g, b]) = self;
        Self([f(r), f(g), f(b)])
    }

    /// `f` of every pair of channels.
    #[inline(always)]
    #[must_use]
    pub fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self([f(self[0], other[0]), f(self[1], other[1]), f(self[2], other[2])])
    }

    /// The largest channel.
    #[inline]
    #[must_use]
    pub fn max_element(self) -> f32 {
        float::max(float::max(self[0], self[1]), self[2])
    }

    /// The smallest channel.
    #[inline]
    #[must_use]
    pub fn min_element(self) -> f32 {
        float::min(float::min(self[0], self[1]), self[2])
    }

    /// The mean of the channels.
    #[inline]
    #[must_use]
    pub fn mean(self) -> f32 {
        (self[0] + self[1] + self[2]) * (1.0 / 3.0)
    }

    /// Channel by channel minimum.
    #[inline]
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        self.zip(other, float::min)
    }

    /// Channel by channel maximum.
    #[inline]
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        self.zip(other, float::max)
    }

    /// `e^{−x}` per channel: transmittance of an optical thickness. Beyond [`float::OPAQUE`]: 0.
    ///
    /// ```
    /// # use fogbow::spectrum::Spectrum;
    /// let thickness = Spectrum::new(0.0, 1.0, 100.0);
    /// let transmittance = thickness.transmitted();
    /// assert_eq!((transmittance[0], transmittance[2]), (1.0, 0.0));
    /// assert!((transmittance[1] - 0.36787944).abs() < 1e-7);   // 1/e after one mean free path
    /// ```
    #[inline]
    #[must_use]
    pub fn transmitted(self) -> Self {
        if self.is_grey() {
            return Self::splat(transmitted(self[0]));
        }
        self.map(transmitted)
    }

    /// `self / other`, 0 where `other` is 0.
    ///
    /// ```
    /// # use fogbow::spectrum::Spectrum;
    /// let (scattering, extinction) = (Spectrum::new(1.0, 3.0, 0.0), Spectrum::new(2.0, 4.0, 0.0));
    /// assert_eq!(scattering.ratio(extinction), Spectrum::new(0.5, 0.75, 0.0));   // an albedo, also where nothing is
    /// ```
    #[inline]
    #[must_use]
    pub fn ratio(self, other: Self) -> Self {
        self.zip(other, |a, b| if b == 0.0 { 0.0 } else { a / b })
    }

    /// Whether all channels are equal.
    ///
    /// ```
    /// # use fogbow::spectrum::Spectrum;
    /// assert!(Spectrum::splat(0.3).is_grey() && !Spectrum::new(0.3, 0.3, 0.4).is_grey());
    /// ```
    #[inline]
    #[must_use]
    pub fn is_grey(self) -> bool {
        self[0] == self[1] && self[1] == self[2]
    }

    /// Whether no channel carries anything.
    ///
    /// ```
    /// # use fogbow::spectrum::Spectrum;
    /// assert!(Spectrum::ZERO.is_black() && !Spectrum::new(0.0, 1e-30, 0.0).is_black());
    /// ```
    #[inline]
    #[must_use]
    pub fn is_black(self) -> bool {
        self[0] == 0.0 && self[1] == 0.0 && self[2] == 0.0
    }

    /// Whether every channel is a number and not infinite.
    ///
    /// ```
    /// # use fogbow::spectrum::Spectrum;
    /// assert!(Spectrum::splat(-1.0).is_finite());
    /// assert!(!(Spectrum::ONE / 0.0).is_finite() && !Spectrum::splat(f32::NAN).is_finite());
    /// ```
    #[inline]
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.0.iter().all(|c| c.is_finite())
    }

    /// Whether every channel is finite and not negative.
    ///
    /// ```
    /// # use fogbow::spectrum::Spectrum;
    /// assert!(Spectrum::ZERO.is_valid());
    /// assert!(!Spectrum::splat(-1.0).is_valid() && !Spectrum::splat(f32::NAN).is_valid());   // no radiance
    /// ```
    #[inline]
    #[must_use]
    pub fn is_valid(self) -> bool {
        self.0.iter().all(|c| c.is_finite() && *c >= 0.0)
    }
}

#[inline]
fn transmitted(thickness: f32) -> f32 {
    if thickness > float::OPAQUE { 0.0 } else { float::exp(-thickness) }
}

/// Red, green and blue.
impl From<[f32; 3]> for Spectrum {
    #[inline]
    fn from(channels: [f32; 3]) -> Self {
        Self(channels)
    }
}

impl From<Spectrum> for [f32; 3] {
    #[inline]
    fn from(spectrum: Spectrum) -> Self {
        spectrum.0
    }
}

impl core::ops::IndexMut<usize> for Spectrum {
    #[inline]
    fn index_mut(&mut self, channel: usize) -> &mut f32 {
        &mut self.0[channel]
    }
}

impl Index<usize> for Spectrum {
    type Output = f32;
    #[inline]
    fn index(&self, channel: usize) -> &f32 {
        &self.0[channel]
    }
}

macro_rules! componentwise {
    ($($trait:ident $method:ident $assign:ident $assign_method:ident),*) => {$(
        impl $trait for Spectrum {
            type Output = Self;
            #[inline]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a.$method(b))
            }
        }
        impl $assign for Spectrum {
            #[inline]
            fn $assign_method(&mut self, other: Self) {
                *self = self.$method(other);
            }
        }
    )*};
}
use core::ops::SubAssign;
componentwise!(Add add AddAssign add_assign, Sub sub SubAssign sub_assign, Mul mul MulAssign mul_assign, Div div DivAssign div_assign);

impl Mul<f32> for Spectrum {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f32) -> Self {
        self.map(|c| c * factor)
    }
}

impl Mul<Spectrum> for f32 {
    type Output = Spectrum;
    #[inline]
    fn mul(self, spectrum: Spectrum) -> Spectrum {
        spectrum * self
    }
}

impl Div<f32> for Spectrum {
    type Output = Self;
    #[inline]
    fn div(self, divisor: f32) -> Self {
        self * (1.0 / divisor)
    }
}

impl MulAssign<f32> for Spectrum {
    #[inline]
    fn mul_assign(&mut self, factor: f32) {
        *self = *self * factor;
    }
}

impl Neg for Spectrum {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.map(|c| -c)
    }
}

impl core::iter::Sum for Spectrum {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self::ZERO, Self::add)
    }
}

/// The spatial gradient of a [`Spectrum`]: its derivative along x, y and z (per metre).
///
/// ```
/// # use fogbow::{math::Vec3, spectrum::{Gradient, Spectrum}};
/// let warmer = Gradient::outer(Spectrum::new(2.0, 1.0, 0.0), Vec3::X);   // W·m⁻³·sr⁻¹, along x only
/// assert_eq!(warmer.along(Vec3::new(0.5, 7.0, 0.0)), Spectrum::new(1.0, 0.5, 0.0));   // after half a metre
/// assert_eq!(warmer.channel(0), Vec3::new(2.0, 0.0, 0.0));
/// assert!(warmer.is_finite());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Gradient {
    /// Derivative along x.
    pub x: Spectrum,
    /// Derivative along y.
    pub y: Spectrum,
    /// Derivative along z.
    pub z: Spectrum,
}

impl Gradient {
    /// No change in any direction.
    pub const ZERO: Self = Self { x: Spectrum::ZERO, y: Spectrum::ZERO, z: Spectrum::ZERO };

    /// `colour ⊗ direction`: a colour that changes along one direction only.
    #[inline]
    #[must_use]
    pub fn outer(colour: Spectrum, direction: Vec3) -> Self {
        Self { x: colour * direction.x, y: colour * direction.y, z: colour * direction.z }
    }

    /// From one gradient vector per channel.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::Gradient};
    /// let gradient = Gradient::from_channels(Vec3::X, 2.0 * Vec3::Y, 3.0 * Vec3::Z);
    /// assert_eq!(gradient.channel(2), 3.0 * Vec3::Z);
    /// assert_eq!(gradient.y[1], 2.0);   // the second channel's derivative along y
    /// ```
    #[inline]
    #[must_use]
    pub fn from_channels(r: Vec3, g: Vec3, b: Vec3) -> Self {
        Self { x: Spectrum::new(r.x, g.x, b.x), y: Spectrum::new(r.y, g.y, b.y), z: Spectrum::new(r.z, g.z, b.z) }
    }

    /// The gradient vector of one channel.
    #[inline]
    #[must_use]
    pub fn channel(&self, channel: usize) -> Vec3 {
        Vec3::new(self.x[channel], self.y[channel], self.z[channel])
    }

    /// Change per metre along `direction`; or, for an offset (m), the change over it.
    #[inline]
    #[must_use]
    pub fn along(&self, direction: Vec3) -> Spectrum {
        self.x * direction.x + self.y * direction.y + self.z * direction.z
    }

    /// Euclidean norm per channel. Scaled by the largest component where squares leave the range of `f32`:
    /// energies around 1e−30 keep their norm.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::{Gradient, Spectrum}};
    /// let gradient = Gradient::outer(Spectrum::new(1.0, 1e-30, 0.0), Vec3::new(3.0, 0.0, 4.0));
    /// let norm = gradient.norm();
    /// assert!((norm[0] - 5.0).abs() < 1e-6 && (norm[1] / 5e-30 - 1.0).abs() < 1e-6 && norm[2] == 0.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn norm(&self) -> Spectrum {
        let squares = self.x * self.x + self.y * self.y + self.z * self.z;
        if squares.min_element() > 1e-30 && squares.max_element() < f32::INFINITY {
            return squares.map(float::sqrt);
        }
        self.scaled_norm()
    }

    #[cold]
    fn scaled_norm(&self) -> Spectrum {
        let largest = self.x.map(f32::abs).max(self.y.map(f32::abs)).max(self.z.map(f32::abs));
        let (x, y, z) = (self.x.ratio(largest), self.y.ratio(largest), self.z.ratio(largest));
        largest * (x * x + y * y + z * z).map(float::sqrt)
    }

    /// Whether every component is a number and not infinite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }
}

impl Add for Gradient {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl AddAssign for Gradient {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Gradient {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl Mul<Spectrum> for Gradient {
    type Output = Self;
    #[inline]
    fn mul(self, factor: Spectrum) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

impl Mul<f32> for Gradient {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f32) -> Self {
        self * Spectrum::splat(factor)
    }
}

impl Neg for Gradient {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self * -1.0
    }
}

/// The symmetric matrix of second derivatives of a [`Spectrum`] (per square metre), upper
/// triangle row by row.
///
/// ```
/// # use fogbow::{math::Vec3, spectrum::{Hessian, Spectrum}};
/// // Of the field x² + 3xy.
/// let hessian = Hessian { xx: Spectrum::splat(2.0), xy: Spectrum::splat(3.0), ..Hessian::ZERO };
/// assert_eq!(hessian.between(Vec3::X, Vec3::X), Spectrum::splat(2.0));
/// assert_eq!(hessian.between(Vec3::X, Vec3::Y), hessian.between(Vec3::Y, Vec3::X));
/// assert_eq!(hessian.mean().to_upper(), [2.0, 3.0, 0.0, 0.0, 0.0, 0.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Hessian {
    /// `∂²/∂x²`.
    pub xx: Spectrum,
    /// `∂²/∂x∂y`.
    pub xy: Spectrum,
    /// `∂²/∂x∂z`.
    pub xz: Spectrum,
    /// `∂²/∂y²`.
    pub yy: Spectrum,
    /// `∂²/∂y∂z`.
    pub yz: Spectrum,
    /// `∂²/∂z²`.
    pub zz: Spectrum,
}

impl Hessian {
    /// No curvature.
    pub const ZERO: Self = Self {
        xx: Spectrum::ZERO,
        xy: Spectrum::ZERO,
        xz: Spectrum::ZERO,
        yy: Spectrum::ZERO,
        yz: Spectrum::ZERO,
        zz: Spectrum::ZERO,
    };

    /// `aᵀ H b`: the mixed second derivative along two directions.
    #[inline]
    #[must_use]
    pub fn between(&self, a: Vec3, b: Vec3) -> Spectrum {
        self.xx * (a.x * b.x)
            + self.yy * (a.y * b.y)
            + self.zz * (a.z * b.z)
            + self.xy * (a.x * b.y + a.y * b.x)
            + self.xz * (a.x * b.z + a.z * b.x)
            + self.yz * (a.y * b.z + a.z * b.y)
    }
}

impl Hessian {
    /// The mean of the channels.
    #[inline]
    #[must_use]
    pub fn mean(&self) -> Symmetric3 {
        Symmetric3::from_upper([self.xx, self.xy, self.xz, self.yy, self.yz, self.zz].map(Spectrum::mean))
    }
}

impl Add for Hessian {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            xx: self.xx + o.xx,
            xy: self.xy + o.xy,
            xz: self.xz + o.xz,
            yy: self.yy + o.yy,
            yz: self.yz + o.yz,
            zz: self.zz + o.zz,
        }
    }
}

impl Mul<Spectrum> for Hessian {
    type Output = Self;
    fn mul(self, f: Spectrum) -> Self {
        Self { xx: self.xx * f, xy: self.xy * f, xz: self.xz * f, yy: self.yy * f, yz: self.yz * f, zz: self.zz * f }
    }
}
