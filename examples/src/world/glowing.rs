//! Media that glow by their temperature.

use fogbow::host::{Face, Gradients, MajorantSegment, Medium, Properties};
use fogbow::math::{Ray, Vec3};
use fogbow::medium::{AnyMedium, MediumError, NodeBounds, SparseGrid};
use fogbow::phase::Phase;
use fogbow::spectrum::{Gradient, Hessian, Spectrum};

use crate::scene_file::Heat;

/// A medium whose absorption glows like a black body: `ε = σₐ L(T)`, with temperatures on a grid of their own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Glowing<'a> {
    medium: AnyMedium<'a>,
    /// Temperatures, as if they were extinction.
    temperature: SparseGrid<'a>,
    heat: &'a Heat,
}

impl<'a> Glowing<'a> {
    pub(super) fn new(medium: AnyMedium<'a>, heat: &'a Heat, nodes: &'a mut [NodeBounds]) -> Result<Self, MediumError> {
        let one = Properties { absorption: Spectrum::ONE, ..Properties::VACUUM };
        let temperature = SparseGrid::new(heat.bricks.bricks(), &one, heat.to_world.to_affine(), nodes)?;
        Ok(Self { medium, temperature, heat })
    }

    pub(super) fn phase(&self) -> Phase {
        self.medium.phase()
    }

    /// Bounds that do not promise that all is the same: temperatures vary where densities may not.
    fn uneven(segment: MajorantSegment) -> MajorantSegment {
        if segment.is_constant() { MajorantSegment { minorant: Spectrum::ZERO, ..segment } } else { segment }
    }
}

impl Medium for Glowing<'_> {
    fn properties(&self, point: Vec3) -> Properties {
        let properties = self.medium.properties(point);
        let emission =
            properties.emission + properties.absorption * self.heat.radiance(self.temperature.extinction(point)[0]);
        Properties { emission, ..properties }
    }

    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        Self::uneven(self.medium.majorant_segment(ray, from))
    }

    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        Self::uneven(self.medium.marching_segment(ray, from))
    }

    fn extinction(&self, point: Vec3) -> Spectrum {
        self.medium.extinction(point)
    }

    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        self.medium.extinction_with_gradient(point)
    }

    fn resolution(&self) -> f32 {
        self.medium.resolution().min(self.temperature.resolution())
    }

    fn gradients(&self, point: Vec3) -> Gradients {
        self.medium.gradients(point)
    }

    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        self.medium.extinction_hessian(point)
    }

    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        self.medium.mean_extinction(centre, radius)
    }

    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        self.medium.faces(ray, visit);
    }

    fn is_grey(&self) -> bool {
        self.medium.is_grey()
    }

    fn is_emissive(&self) -> bool {
        true
    }
}
