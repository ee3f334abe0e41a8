//! Media whose extinction or albedo varies in colour from point to point.

use fogbow::host::{MajorantSegment, Medium, Properties};
use fogbow::math::{Affine3, Ray, Vec3};
use fogbow::medium::AnyMedium;
use fogbow::phase::Phase;
use fogbow::spectrum::Spectrum;

use super::glowing::Glowing;
use crate::scene_file::Field;
use crate::transform::Transform;

/// Extinction and albedo, each the same everywhere or on a grid.
///
/// Tracking knows one bound for all of space: grids of one channel, which have bounds for every block, are quicker.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coloured<'a> {
    extinction: Part<'a>,
    albedo: Part<'a>,
    /// Factor on extinction.
    scale: f32,
    majorant: Spectrum,
    phase: Phase,
    resolution: f32,
}

#[derive(Debug, Clone, Copy)]
struct Part<'a> {
    field: &'a Field,
    to_local: Affine3,
}

impl<'a> Part<'a> {
    fn new(field: &'a Field) -> Self {
        let to_local = match field {
            Field::Constant(_) => Transform::IDENTITY,
            Field::Grid { to_world, .. } => to_world.inverse().unwrap_or(Transform::IDENTITY),
        };
        Self { field, to_local: to_local.to_affine() }
    }

    fn at(&self, point: Vec3) -> Spectrum {
        match self.field {
            Field::Constant(value) => *value,
            Field::Grid { colours, wrap, is_smooth, .. } => {
                Spectrum(colours.at(self.to_local.transform_point3(point), *wrap, *is_smooth))
            }
        }
    }

    /// Length of the shortest cell (m).
    fn resolution(&self) -> f32 {
        match self.field {
            Field::Constant(_) => f32::INFINITY,
            Field::Grid { colours, to_world, .. } => {
                let cell = |axis: usize| {
                    let edge = to_world.column(axis);
                    crate::transform::dot(edge, edge).sqrt() as f32 / colours.size[axis] as f32
                };
                cell(0).min(cell(1)).min(cell(2))
            }
        }
    }
}

impl<'a> Coloured<'a> {
    /// Extinction (m⁻¹), to be multiplied by `scale`, and albedo. `None` where that is not finite.
    pub(super) fn new(extinction: &'a Field, albedo: &'a Field, scale: f32, phase: Phase) -> Option<Self> {
        let most = match extinction {
            Field::Constant(value) => *value,
            Field::Grid { colours, .. } => Spectrum(colours.most()),
        };
        let majorant = most * scale;
        let (extinction, albedo) = (Part::new(extinction), Part::new(albedo));
        let resolution = extinction.resolution().min(albedo.resolution());
        let resolution = if resolution.is_finite() { resolution } else { 1e-2 };
        majorant.is_finite().then_some(Self { extinction, albedo, scale, majorant, phase, resolution })
    }

    pub(super) fn phase(&self) -> Phase {
        self.phase
    }
}

impl Medium for Coloured<'_> {
    fn properties(&self, point: Vec3) -> Properties {
        let extinction = self.extinction(point);
        let scattering = extinction * self.albedo.at(point).max(Spectrum::ZERO).min(Spectrum::ONE);
        let absorption = (extinction - scattering).max(Spectrum::ZERO);
        Properties { absorption, scattering, phase: self.phase, ..Properties::VACUUM }
    }

    fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
        // Never said to be constant: the albedo varies.
        MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ZERO, majorant: self.majorant }
    }

    fn extinction(&self, point: Vec3) -> Spectrum {
        (self.extinction.at(point) * self.scale).min(self.majorant)
    }

    fn resolution(&self) -> f32 {
        self.resolution
    }

    fn is_grey(&self) -> bool {
        let [r, g, b] = self.majorant.0;
        match self.extinction.field {
            Field::Constant(_) => r == g && g == b,
            Field::Grid { colours, .. } => colours.is_grey,
        }
    }
}

/// What a place of a scene is made of.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "a few per scene")]
pub(super) enum Stuff<'a> {
    /// A medium of the core.
    Core(AnyMedium<'a>),
    /// One that varies in colour.
    Coloured(Coloured<'a>),
    /// One that is hot.
    Glowing(Glowing<'a>),
}

impl Stuff<'_> {
    pub(super) fn phase(&self) -> Phase {
        match self {
            Self::Core(medium) => medium.phase(),
            Self::Coloured(medium) => medium.phase(),
            Self::Glowing(medium) => medium.phase(),
        }
    }
}

impl Medium for Stuff<'_> {
    fogbow::host::delegate_medium!(self, [Core Coloured Glowing]);
}
