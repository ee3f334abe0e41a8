//! Records of light, and what several say about a point: Jarosz et al. 2008, Eq. 34 and 35.

use fogbow::cache::{Blend, Extrapolation, exponent_limit, log_gradient_radius, weight};
use fogbow::math::Vec3;
use fogbow::spectrum::{Gradient, Spectrum};

use crate::arguments;
use crate::status::{Outcome, fogbow_status, guard, wrong};
use crate::transmittance::fogbow_gradient;

/// A cached value with its gradient. Fixed for ever: arrays of it cross the interface.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_record {
    /// Where (m).
    pub position: [f32; 3],
    /// How far it may be used (m), above 0.
    pub radius: f32,
    /// The value: radiance (W/(m² sr)) or irradiance (W/m²).
    pub value: [f32; 3],
    /// Its gradient (per metre).
    pub gradient: fogbow_gradient,
}

/// L + (grad L + mean grad L)/2 · d, mixed by weights: exact for light that changes quadratically.
pub const FOGBOW_EXTRAPOLATION_CURVED: u32 = 0;
/// L exp(grad L · d / L), mixed by a weighted geometric mean: Eq. 35.
pub const FOGBOW_EXTRAPOLATION_EXPONENTIAL: u32 = 1;
/// L + grad L · d, mixed by weights.
pub const FOGBOW_EXTRAPOLATION_LINEAR: u32 = 2;
/// L, mixed by weights.
pub const FOGBOW_EXTRAPOLATION_CONSTANT: u32 = 3;

fn gradient_of(of: &fogbow_gradient, name: &str) -> Outcome<Gradient> {
    let gradient = Gradient { x: Spectrum(of.x), y: Spectrum(of.y), z: Spectrum(of.z) };
    if gradient.is_finite() { Ok(gradient) } else { wrong(format!("`{name}` is not finite")) }
}

/// What records say about the light at a point (x, y, z; m), three channels: those whose balls hold it, each with a weight that falls
/// to 0 at its
/// radius. `tolerance` bounds exponents; 0 for 1. `reached` (may be null): how many there were; the light is 0 if none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_extrapolate(
    records: *const fogbow_record,
    count: usize,
    extrapolation: u32,
    tolerance: f32,
    point: *const f32,
    light: *mut f32,
    reached: *mut usize,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (records, point, light, reached) = unsafe {
            let point = arguments::value(point.cast(), "point")?;
            let light = arguments::room::<f32>(light, 3, "light")?;
            (arguments::many(records, count, "records")?, point, light, arguments::place_if_any(reached, "reached")?)
        };
        let kind = match extrapolation {
            FOGBOW_EXTRAPOLATION_CURVED => Extrapolation::Curved,
            FOGBOW_EXTRAPOLATION_EXPONENTIAL => Extrapolation::Exponential,
            FOGBOW_EXTRAPOLATION_LINEAR => Extrapolation::Linear,
            FOGBOW_EXTRAPOLATION_CONSTANT => Extrapolation::Constant,
            other => return wrong(format!("`extrapolation` is {other}, which none is")),
        };
        let point = arguments::vector(point, "point")?;
        let tolerance = if tolerance == 0.0 { 1.0 } else { arguments::within(tolerance, 0.0, 1e6, "tolerance")? };
        let mut blend = Blend::new(kind, exponent_limit(tolerance));
        let mut found = 0;
        for record in records {
            let position = arguments::vector(record.position, "records[i].position")?;
            let radius = arguments::within(record.radius, f32::MIN_POSITIVE, f32::MAX, "records[i].radius")?;
            let value = arguments::light(record.value, "records[i].value")?;
            let gradient = gradient_of(&record.gradient, "records[i].gradient")?;
            let way: Vec3 = point - position;
            let d = 1.0 - way.length() / radius;
            if d > 0.0 {
                blend.add(weight(d), value, &gradient, way);
                found += 1;
            }
        }
        light.copy_from_slice(&blend.value().unwrap_or_default().0);
        reached.iter().for_each(|place| place.set(found));
        Ok(())
    })
}

/// How far (m) a value may be carried where its logarithm may change by `tolerance`: the least of tolerance · L/|grad L| over
/// channels (Eq. 34 for one sample); infinite where nothing changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_record_radius(
    value: *const f32,
    gradient: *const fogbow_gradient,
    tolerance: f32,
    radius: *mut f32,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (value, gradient, radius) = unsafe {
            (
                arguments::value(value.cast(), "value")?,
                arguments::value(gradient, "gradient")?,
                arguments::place(radius, "radius")?,
            )
        };
        let value = arguments::light(value, "value")?;
        let tolerance = arguments::within(tolerance, 0.0, 1e6, "tolerance")?;
        radius.set(log_gradient_radius(value, &gradient_of(&gradient, "gradient")?, tolerance));
        Ok(())
    })
}
