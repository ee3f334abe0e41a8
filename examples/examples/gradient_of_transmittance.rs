//! The gradient of transmittance in fog given as a closure: extinction `1 + x`, from x = 0 to x = 2, so `τ = 4`.
use fogbow::host::{MajorantSegment, Medium, Properties};
use fogbow::math::{Ray, Vec3};
use fogbow::{spectrum::Spectrum, transmittance::thickness};
struct Field<F>(F);
impl<F: Fn(Vec3) -> f32> Medium for Field<F> {
    fn properties(&self, point: Vec3) -> Properties {
        Properties { absorption: Spectrum::splat((self.0)(point)), ..Properties::VACUUM }
    }
    fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
        MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ZERO, majorant: Spectrum::splat(3.0) }
    }
}
fn main() {
    let (ray, fog) = (Ray::between(Vec3::ZERO, 2.0 * Vec3::X), Field(|point: Vec3| 1.0 + point.x));
    let found = thickness::transmittance_with_gradients(&ray, &fog, thickness::Marching::midpoints(64));
    let (slope, exact) = (found.gradient_fixed.x[0], (-4.0_f32).exp());
    println!("∂T/∂x = {slope}, the far end held; in closed form σ(0) e⁻⁴ = {exact}");
    assert!((slope / exact - 1.0).abs() < 1e-3);
}
