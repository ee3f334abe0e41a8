//! One step of bias compensation in even fog: the mean weight of the next vertex is the contraction `κ_B`.
use fogbow::vpl::{Bound, Compensation, Receiver, contraction, next_vertex};
use fogbow::{host::Empty, host::Medium, math::Vec3, medium::Homogeneous, phase::Phase};
use fogbow::{sampling::Generator, spectrum::Spectrum, world::World};
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::splat(0.8), Phase::ISOTROPIC)?;
    let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    let receiver = Receiver::in_medium(Vec3::ZERO, Vec3::Z, &fog.properties(Vec3::ZERO)).ok_or("black fog")?;
    let (bound, mut rng, count) = (Bound::within(1.2)?, Generator::new(1), 100_000);
    let mut next = || next_vertex(&world, &receiver, bound, &Compensation::FULL, &mut rng);
    let mean = (0..count).filter_map(|_| next()).map(|(_, weight)| weight[0]).sum::<f32>() / count as f32;
    let a = 1.2_f32; // extinction times radius
    let exact = 0.8 * (1.0 - 2.0 * (1.0 - (-a).exp() * (1.0 + a)) / (a * a));
    println!("mean weight {mean}; κ_B = ϖ (1 − 2 (1 − e⁻ᵃ (1 + a))/a²) = {exact}");
    assert!((mean - exact).abs() < 0.005 && (contraction(1.0, 0.8, a) - exact).abs() < 1e-5);
    Ok(())
}
