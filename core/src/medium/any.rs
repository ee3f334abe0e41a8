//! The closed set of this module's media, for scenes that hold several kinds.

use glam::Vec3;

use super::{DensityGrid, Homogeneous, Noise, SparseGrid};
use crate::host::{Face, Gradients, MajorantSegment, Medium, Properties};
use crate::math::Ray;
use crate::phase::Phase;
use crate::spectrum::{Gradient, Hessian, Spectrum};

/// A medium of any of the kinds made here.
///
/// ```
/// # use fogbow::{host::Medium, math::Vec3, phase::Phase, spectrum::Spectrum};
/// # use fogbow::medium::{AnyMedium, Homogeneous};
/// let fog = AnyMedium::from(Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap());
/// assert_eq!(fog.extinction(Vec3::ZERO), Spectrum::ONE);
/// assert_eq!(fog.phase(), Phase::ISOTROPIC);
/// ```
#[derive(Debug, Clone, Copy)]
pub enum AnyMedium<'a> {
    /// The same everywhere.
    Homogeneous(Homogeneous),
    /// A voxel grid.
    Grid(DensityGrid<'a>),
    /// A sparse voxel grid.
    Sparse(SparseGrid<'a>),
    /// Fractal noise.
    Noise(Noise),
}

macro_rules! each {
    ($self:ident, $medium:ident => $answer:expr) => {
        match $self {
            Self::Homogeneous($medium) => $answer,
            Self::Grid($medium) => $answer,
            Self::Sparse($medium) => $answer,
            Self::Noise($medium) => $answer,
        }
    };
}

impl AnyMedium<'_> {
    /// Angular law of scattering; the same everywhere in each of these media.
    #[inline]
    #[must_use]
    pub fn phase(&self) -> Phase {
        each!(self, medium => medium.phase())
    }
}

impl Medium for AnyMedium<'_> {
    #[inline]
    fn properties(&self, point: Vec3) -> Properties {
        each!(self, medium => medium.properties(point))
    }
    #[inline]
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        each!(self, medium => medium.majorant_segment(ray, from))
    }
    #[inline]
    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        each!(self, medium => medium.marching_segment(ray, from))
    }
    #[inline]
    fn extinction(&self, point: Vec3) -> Spectrum {
        each!(self, medium => medium.extinction(point))
    }
    #[inline]
    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        each!(self, medium => medium.extinction_with_gradient(point))
    }
    fn resolution(&self) -> f32 {
        each!(self, medium => medium.resolution())
    }
    fn gradients(&self, point: Vec3) -> Gradients {
        each!(self, medium => medium.gradients(point))
    }
    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        each!(self, medium => medium.extinction_hessian(point))
    }
    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        each!(self, medium => medium.mean_extinction(centre, radius))
    }
    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        each!(self, medium => medium.faces(ray, visit));
    }
    fn is_grey(&self) -> bool {
        each!(self, medium => medium.is_grey())
    }
    fn is_emissive(&self) -> bool {
        each!(self, medium => medium.is_emissive())
    }
}

impl From<Homogeneous> for AnyMedium<'_> {
    fn from(medium: Homogeneous) -> Self {
        Self::Homogeneous(medium)
    }
}

impl<'a> From<DensityGrid<'a>> for AnyMedium<'a> {
    fn from(medium: DensityGrid<'a>) -> Self {
        Self::Grid(medium)
    }
}

impl<'a> From<SparseGrid<'a>> for AnyMedium<'a> {
    fn from(medium: SparseGrid<'a>) -> Self {
        Self::Sparse(medium)
    }
}

impl From<Noise> for AnyMedium<'_> {
    fn from(medium: Noise) -> Self {
        Self::Noise(medium)
    }
}
