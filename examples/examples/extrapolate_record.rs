//! One record of light that falls off as `L(x) = 3 e^{−2x}`, carried from x = 0 to x = 0.4.
use fogbow::cache::{Blend, Extrapolation, exponent_limit, weight};
use fogbow::math::Vec3;
use fogbow::spectrum::{Gradient, Spectrum};
fn main() {
    let (value, slope, radius) = (Spectrum::splat(3.0), Gradient::outer(Spectrum::splat(-6.0), Vec3::X), 1.0);
    let way = 0.4 * Vec3::X;
    let carried = |by: Extrapolation| {
        let mut blend = Blend::new(by, exponent_limit(1.0));
        blend.add(weight(1.0 - way.length() / radius), value, &slope, way);
        blend.value().expect("the record reaches this point")[0]
    };
    let (exponential, linear) = (carried(Extrapolation::Exponential), carried(Extrapolation::Linear));
    let exact = 3.0 * (-0.8_f32).exp();
    println!("L(0.4) = {exponential} exponentially (Eq. 35), {linear} linearly; in truth {exact}");
    assert!((exponential / exact - 1.0).abs() < 1e-5 && (linear - 0.6).abs() < 1e-5);
}
