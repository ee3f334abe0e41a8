//! Lights, as one plain structure.

use fogbow::light::{Light, LightError, PhongLight, PointLight, QuadLight, SphereLight, SpotLight, Sun};

use crate::arguments;
use crate::status::{Outcome, refused, wrong};

/// A point; `emission` is intensity (W/sr).
pub const FOGBOW_LIGHT_POINT: u32 = 0;
/// A cone of `position`, `direction`, `beam` and `cutoff`; `emission` is intensity (W/sr) along the axis.
pub const FOGBOW_LIGHT_SPOT: u32 = 1;
/// cos^exponent around `direction`; `emission` is intensity (W/sr) along it.
pub const FOGBOW_LIGHT_PHONG: u32 = 2;
/// A parallelogram of the corner `position` and the edges `edge_u` and `edge_v` that shines towards edge_u × edge_v; `emission` is
/// radiance (W/(m² sr)).
/// Its surface is one of the scene: `closest_hit` must find it.
pub const FOGBOW_LIGHT_QUAD: u32 = 3;
/// A ball of `position` and `radius`; `emission` is radiance (W/(m² sr)). Its surface is one of the scene: `closest_hit` must find it.
pub const FOGBOW_LIGHT_SPHERE: u32 = 4;
/// Parallel light that goes along `direction`; `emission` is irradiance (W/m²) of a plane across it.
pub const FOGBOW_LIGHT_SUN: u32 = 5;
/// The same radiance `emission` (W/(m² sr)) from all around.
pub const FOGBOW_LIGHT_SKY: u32 = 6;

/// A light. Fields that its kind does not use may hold anything.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_light {
    /// `FOGBOW_LIGHT_…`.
    pub kind: u32,
    /// Where (m).
    pub position: [f32; 3],
    /// Where it shines to; of any length above 0.
    pub direction: [f32; 3],
    /// An edge (m).
    pub edge_u: [f32; 3],
    /// The other one (m).
    pub edge_v: [f32; 3],
    /// Of a ball (m).
    pub radius: f32,
    /// Of a cone: half the angle (rad) within which it is as bright as along the axis; at most `cutoff`.
    pub beam: f32,
    /// Of a cone: half the angle (rad) beyond which it is dark.
    pub cutoff: f32,
    /// Of cos^exponent: 0, or at least 1.
    pub exponent: f32,
    /// How bright, in the unit of the kind.
    pub emission: [f32; 3],
}

impl fogbow_light {
    pub(crate) fn check(&self, name: &str) -> Outcome<Light<'static>> {
        let emission = arguments::light(self.emission, &format!("{name}.emission"))?;
        let of = |vector: [f32; 3], field: &str| arguments::vector(vector, &format!("{name}.{field}"));
        let said = |error: LightError| refused(name)(&error);
        let position = || of(self.position, "position");
        let direction = || of(self.direction, "direction");
        Ok(match self.kind {
            FOGBOW_LIGHT_POINT => Light::Point(PointLight::new(position()?, emission).map_err(said)?),
            FOGBOW_LIGHT_SPOT => {
                let light = SpotLight::new(position()?, direction()?, self.beam, self.cutoff, emission);
                Light::Spot(light.map_err(said)?)
            }
            FOGBOW_LIGHT_PHONG => {
                Light::Phong(PhongLight::new(position()?, direction()?, self.exponent, emission).map_err(said)?)
            }
            FOGBOW_LIGHT_QUAD => {
                let edges = [of(self.edge_u, "edge_u")?, of(self.edge_v, "edge_v")?];
                Light::Quad(QuadLight::new(position()?, edges[0], edges[1], emission).map_err(said)?)
            }
            FOGBOW_LIGHT_SPHERE => Light::Sphere(SphereLight::new(position()?, self.radius, emission).map_err(said)?),
            FOGBOW_LIGHT_SUN => Light::Sun(Sun::new(-direction()?, emission).map_err(said)?),
            FOGBOW_LIGHT_SKY => Light::Constant(emission),
            kind => return wrong(format!("`{name}.kind` is {kind}, which no light is")),
        })
    }
}
