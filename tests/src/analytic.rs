//! Known answers: finite differences, and scenes with closed forms.

use fogbow::math::Vec3;
use fogbow::spectrum::{Gradient, Spectrum};

use crate::tolerance;

/// Gradient of `f` at `x` by central differences over `h`, `h/2` and `h/4`, extrapolated (Richardson)
/// to an error of order `h⁴`. `None` where the extrapolations from the first and the last two
/// disagree by more than half of [`tolerance::GRADIENT`], in units of `‖∇f‖ + |f|/size`: within reach
/// of an edge, where there is no gradient.
pub fn differences(f: impl Fn(Vec3) -> Spectrum, x: Vec3, size: f32) -> Option<Gradient> {
    let central = |h: f32| {
        let along = |axis: Vec3| {
            // The steps that rounding leaves of ±h.
            let (a, b) = (x + axis * h, x - axis * h);
            (f(a) - f(b)) / (a - b).dot(axis)
        };
        Gradient { x: along(Vec3::X), y: along(Vec3::Y), z: along(Vec3::Z) }
    };
    let h = 0.02 * size;
    let [coarse, middle, fine] = [h, 0.5 * h, 0.25 * h].map(central);
    let extrapolated = |a: Gradient, b: Gradient| (b * 4.0 - a) * (1.0 / 3.0);
    let (far, near) = (extrapolated(coarse, middle), extrapolated(middle, fine));
    let scale = f(x).map(f32::abs) / size + far.norm();
    let apart = (far - near).norm();
    (0..3).all(|c| apart[c] <= 0.5 * tolerance::GRADIENT * scale[c]).then_some(far)
}

/// What is wrong with an analytic gradient, measured against [`differences`] in units of
/// `‖∇f‖ + |f|/size`; `None` if all is well.
#[must_use]
pub fn disagreement(analytic: &Gradient, numeric: &Gradient, value: Spectrum, size: f32) -> Option<String> {
    let error = (*analytic - *numeric).norm();
    let scale = numeric.norm() + value.map(f32::abs) / size;
    let bad = (0..3).find(|&c| !(error[c] <= tolerance::GRADIENT * scale[c] + f32::MIN_POSITIVE))?;
    Some(format!(
        "channel {bad}: analytic {}, differences {}, {:.2e} of the scale apart",
        analytic.channel(bad),
        numeric.channel(bad),
        error[bad] / scale[bad]
    ))
}

/// Mean and standard error of the samples.
#[must_use]
pub fn mean_and_error(samples: &[f64]) -> (f64, f64) {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|s| (s - mean) * (s - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Infinite isotropic medium (σₜ = 1 m⁻¹, albedo 0.8) around a point light of 1 W, at 1.5 m: radiance
/// (W·m⁻²·sr⁻¹) scattered in after at least one other scattering, without the factor σₛ. From the
/// Fourier solution of the transport equation.
pub const INFINITE_MEDIUM_MULTIPLE: f64 = 2.33649e-3 / 0.8;
