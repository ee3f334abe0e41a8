//! Known answers: finite differences, and scenes with closed forms.

use fogbow::math::Vec3;
use fogbow::spectrum::{Gradient, Spectrum};

use crate::tolerance;

/// Gradient of `f` at `x` by central differences over `h`, `h/2` and `h/4`, extrapolated (Richardson)
/// to an error of order `h⁴`.
///
/// `None` within reach of an edge, where there is no gradient. An edge shows in two ways, measured
/// in units of `‖∇f‖ + |f|/size` against half of [`tolerance::GRADIENT`]: the extrapolations from the
/// first and the last two steps disagree; or the second differences over `h` do not shrink with `h`.
pub fn differences(f: impl Fn(Vec3) -> Spectrum, x: Vec3, size: f32) -> Option<Gradient> {
    let centre = f(x);
    let central = |h: f32| {
        let along = |axis: Vec3| {
            // The steps that rounding leaves of ±h.
            let (a, b) = (x + axis * h, x - axis * h);
            let (above, below) = (f(a), f(b));
            ((above - below) / (a - b).dot(axis), (above + below - centre * 2.0) / h)
        };
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(along);
        (Gradient { x: x.0, y: y.0, z: z.0 }, Gradient { x: x.1, y: y.1, z: z.1 })
    };
    let h = 0.02 * size;
    let [coarse, middle, fine] = [h, 0.5 * h, 0.25 * h].map(central);
    let extrapolated = |a: Gradient, b: Gradient| (b * 4.0 - a) * (1.0 / 3.0);
    let (far, near) = (extrapolated(coarse.0, middle.0), extrapolated(middle.0, fine.0));
    let scale = centre.map(f32::abs) / size + far.norm();
    let apart = (far - near).norm();
    let bend = (middle.1 * 2.0 - coarse.1).norm().max((fine.1 * 2.0 - middle.1).norm());
    let smooth = |c: usize| apart[c].max(bend[c]) <= 0.5 * tolerance::GRADIENT * scale[c];
    (0..3).all(smooth).then_some(far)
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
