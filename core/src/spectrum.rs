//! Layer 0: colours and their derivatives.
//!
//! Channels never mix except by min, max or mean, so a host may carry three wavelengths instead
//! of red, green and blue.

use core::ops::{Add, AddAssign, Div, DivAssign, Index, Mul, MulAssign, Neg, Sub};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::math::{Symmetric3, float};

/// One value per colour channel. A type of its own, so that a colour cannot be dotted with a
/// direction.
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
    #[inline]
    #[must_use]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        // Written out: without link-time optimisation an array's own `map` stays a call.
        let Self([r, g, b]) = self;
        Self([f(r), f(g), f(b)])
    }

    /// `f` of every pair of channels.
    #[inline]
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
    #[inline]
    #[must_use]
    pub fn transmitted(self) -> Self {
        if self.is_grey() {
            return Self::splat(transmitted(self[0]));
        }
        self.map(transmitted)
    }

    /// `self / other`, 0 where `other` is 0.
    #[inline]
    #[must_use]
    pub fn ratio(self, other: Self) -> Self {
        self.zip(other, |a, b| if b == 0.0 { 0.0 } else { a / b })
    }

    /// Whether all channels are equal.
    #[inline]
    #[must_use]
    pub fn is_grey(self) -> bool {
        self[0] == self[1] && self[1] == self[2]
    }

    /// Whether no channel carries anything.
    #[inline]
    #[must_use]
    pub fn is_black(self) -> bool {
        self[0] == 0.0 && self[1] == 0.0 && self[2] == 0.0
    }

    /// Whether every channel is a number and not infinite.
    #[inline]
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.0.iter().all(|c| c.is_finite())
    }

    /// Whether every channel is finite and not negative.
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
