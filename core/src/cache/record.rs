//! What is stored at a point.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::bytes::RecordKind;
use super::index;
use super::lobe;
use super::radius::{self, Limits};
use crate::sh::{self, Coefficient};
use crate::single_scatter::Sums;
use crate::spectrum::{Gradient, Spectrum};

/// A cached value with its gradient, and how far it may be carried: 16 floats, 64 bytes.
///
/// In isotropic media `value` is in-scattered radiance (W·m⁻²·sr⁻¹); in others its mean over
/// directions, the expansion's `L₀₀ Y₀₀`, with the higher degrees in the cache's pool; on surfaces
/// irradiance (W·m⁻²). Source: sheet § 1.8 (Jarosz et al. 2008 print 48 bytes; 16 floats are 64).
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Record {
    /// Where (m).
    pub position: Vec3,
    /// How far it may be used (m).
    pub radius: f32,
    /// The value.
    pub value: Spectrum,
    /// Its gradient (per metre).
    pub gradient: Gradient,
}

impl Record {
    /// Of an estimate at `position`: the radius of J's Eq. 34 for `tolerance` within `limits`, the
    /// gradient no steeper than the radius lets it be used. `None` where the estimate is no number.
    ///
    /// ```
    /// # use fogbow::{cache::{Limits, Record}, math::Vec3, single_scatter::{Contribution, Sums}};
    /// # use fogbow::spectrum::{Gradient, Spectrum};
    /// let mut sums = Sums::default();
    /// let slope = Gradient::outer(Spectrum::splat(2.0), Vec3::X);
    /// sums.add(&Contribution { radiance: Spectrum::ONE, gradient: slope }, true);
    /// let record = Record::new(Vec3::ZERO, &sums, 0.1, Limits { min: 0.0, max: 1.0 }).unwrap();
    /// assert_eq!(record.radius, 0.05);
    /// ```
    #[must_use]
    pub fn new(position: Vec3, sums: &Sums, tolerance: f32, limits: Limits) -> Option<Self> {
        let raw = radius::valid_radius(sums, tolerance);
        let gradient = match raw {
            Some(raw) if raw < limits.min => radius::clamp_gradient(&sums.gradient, sums.value, limits.min),
            _ => sums.gradient,
        };
        let record = Self { position, radius: limits.clamp(raw), value: sums.value, gradient };
        record.is_valid().then_some(record)
    }

    /// Whether all numbers are finite, the radius positive (10⁻³⁸ m or more), the value not negative, and nothing farther
    /// than 10³⁸ m from the origin: beyond, distances are no numbers.
    ///
    /// ```
    /// # use fogbow::{cache::Record, math::Vec3, spectrum::{Gradient, Spectrum}};
    /// let record = Record { position: Vec3::ZERO, radius: 1.0, value: Spectrum::ONE, gradient: Gradient::ZERO };
    /// assert!(record.is_valid());
    /// assert!(!Record { radius: 0.0, ..record }.is_valid());
    /// ```
    #[must_use]
    pub fn is_valid(&self) -> bool {
        index::holds(self.position, self.radius) && self.value.is_valid() && self.gradient.is_finite()
    }

    /// `∇L · (point − position)`.
    ///
    /// ```
    /// # use fogbow::{cache::Record, math::Vec3, spectrum::{Gradient, Spectrum}};
    /// let gradient = Gradient::outer(Spectrum::splat(3.0), Vec3::X);
    /// let record = Record { position: Vec3::X, radius: 1.0, value: Spectrum::ONE, gradient };
    /// assert_eq!(record.change(1.5 * Vec3::X), Spectrum::splat(1.5));   // half a metre on
    /// ```
    #[inline]
    #[must_use]
    pub fn change(&self, point: Vec3) -> Spectrum {
        self.gradient.along(point - self.position)
    }
}

/// What a record on a surface has besides: 12 floats, 48 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Facing {
    /// The surface's normal (unit).
    pub normal: Vec3,
    /// Vector irradiance `∫ L ω dω` (W·m⁻²): how irradiance changes as the normal turns.
    pub turn: Gradient,
}

/// Most attachments a record may have: those of an expansion of [`sh::MAX_DEGREE`] and a lobe.
pub(super) const MAX_STRIDE: usize = sh::MAX_COEFFICIENTS - 1 + lobe::ATTACHED;

mod sealed {
    /// The formats of caches know what is attached, and how large it is.
    pub trait Sealed {}
    impl Sealed for crate::sh::Coefficient {}
    impl Sealed for super::Facing {}
}

/// What may be attached to records: a [`Coefficient`] in the medium, a [`Facing`] on surfaces. 12 floats either way.
pub trait Attachment: Pod + sealed::Sealed {
    /// The kind of cache it makes.
    const KIND: RecordKind;
    /// Whether it can belong to a record that was computed: what is not valid is neither kept nor read.
    ///
    /// ```
    /// # use fogbow::{cache::Attachment, sh::Coefficient, spectrum::Spectrum};
    /// assert!(Coefficient::ZERO.is_valid());
    /// assert!(!Coefficient { value: Spectrum::splat(f32::NAN), ..Coefficient::ZERO }.is_valid());
    /// ```
    fn is_valid(&self) -> bool;
}

impl Attachment for Coefficient {
    const KIND: RecordKind = RecordKind::Volume;
    fn is_valid(&self) -> bool {
        self.value.is_finite() && self.gradient.is_finite()
    }
}

impl Attachment for Facing {
    const KIND: RecordKind = RecordKind::Surface;
    fn is_valid(&self) -> bool {
        // Normals of hosts are unit vectors up to rounding; what is far from it is damage.
        (self.normal.length_squared() - 1.0).abs() < 1e-2 && self.turn.is_finite()
    }
}
