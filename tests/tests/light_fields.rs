//! Predicted covariances against measured ones: sampled light fields and their FFT, traced bundles of rays.
//!
//! A measured covariance is `Σ Ω_i Ω_j |f̂| / Σ |f̂|` over the discrete spectrum of samples in [−1, 1]ᴰ, weighted
//! by the *amplitude* (sheet § 0). Gaussians of covariance 1 and more fade within that window.

use fogbow::covariance::{LightField, Patch, Symmetric4, phase_covariance};
use fogbow::math::{Frame, Symmetric2, Symmetric3, Vec2, Vec3};
use fogbow::phase::{Deflection, Lobe, Phase};
use fogbow::sampling::warp::uniform_sphere;
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow_tests::tolerance::{BUNDLE, FFT, FFT_PEAKED};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Samples on a grid over [−1, 1]ᴰ, `n` along each axis, the last one fastest.
struct Samples<const D: usize> {
    n: usize,
    values: Vec<Complex<f64>>,
}

impl<const D: usize> Samples<D> {
    fn new(n: usize, f: impl Fn([f64; D]) -> f64) -> Self {
        let at = |index: usize| {
            let mut rest = index;
            let mut x = [0.0; D];
            for i in (0..D).rev() {
                x[i] = place(n, rest % n);
                rest /= n;
            }
            Complex::from(f(x))
        };
        Self { n, values: (0..n.pow(D as u32)).map(at).collect() }
    }

    /// Fourier transform along one axis.
    fn transform(&mut self, axis: usize) {
        let n = self.n;
        let fft = FftPlanner::new().plan_fft_forward(n);
        let stride = n.pow((D - 1 - axis) as u32);
        let mut line = vec![Complex::default(); n];
        for start in (0..self.values.len()).filter(|i| (i / stride).is_multiple_of(n)) {
            for (k, x) in line.iter_mut().enumerate() {
                *x = self.values[start + k * stride];
            }
            fft.process(&mut line);
            for (k, x) in line.iter().enumerate() {
                self.values[start + k * stride] = *x;
            }
        }
    }

    /// Covariance of a spectrum, of samples transformed along all axes.
    fn covariance(&self) -> [[f64; D]; D] {
        let n = self.n;
        let frequency = |k: usize| 0.5 * (if 2 * k < n { k as f64 } else { k as f64 - n as f64 });
        let (mut sum, mut weight) = ([[0.0; D]; D], 0.0);
        for (index, value) in self.values.iter().enumerate() {
            let amplitude = value.norm();
            let mut rest = index;
            let mut x = [0.0; D];
            for i in (0..D).rev() {
                x[i] = frequency(rest % n);
                rest /= n;
            }
            weight += amplitude;
            for i in 0..D {
                for j in 0..D {
                    sum[i][j] += amplitude * x[i] * x[j];
                }
            }
        }
        sum.map(|row| row.map(|x| x / weight))
    }
}

/// Where sample `k` of `n` lies.
fn place(n: usize, k: usize) -> f64 {
    2.0 * k as f64 / n as f64 - 1.0
}

fn measured<const D: usize>(n: usize, f: impl Fn([f64; D]) -> f64) -> [[f64; D]; D] {
    let mut samples = Samples::new(n, f);
    (0..D).for_each(|axis| samples.transform(axis));
    samples.covariance()
}

/// `exp(−2π² xᵀ Σ x)`, whose spectrum has the covariance `Σ`.
fn gaussian<const D: usize>(sigma: &[[f64; D]; D], x: [f64; D]) -> f64 {
    let square: f64 = (0..D).map(|i| (0..D).map(|j| x[i] * sigma[i][j] * x[j]).sum::<f64>()).sum();
    (-2.0 * core::f64::consts::PI.powi(2) * square).exp()
}

/// Entries within `tolerance`, in units of the standard deviations they belong to.
#[track_caller]
fn assert_near<const D: usize>(predicted: [[f64; D]; D], measured: [[f64; D]; D], tolerance: f64, what: &str) {
    let mut worst = 0.0_f64;
    for i in 0..D {
        for j in 0..D {
            let off = (predicted[i][j] - measured[i][j]).abs() / (measured[i][i] * measured[j][j]).sqrt();
            assert!(off <= tolerance, "{what}, {i} {j}: {off:.1e}\npredicted {predicted:?}\nmeasured {measured:?}");
            worst = worst.max(off);
        }
    }
    println!("{what}: within {worst:.1e}");
}

/// One place across the ray, one angle.
fn flat([[x, c], [_, p]]: [[f64; 2]; 2]) -> Symmetric4 {
    let [x, c, p] = [x, c, p].map(|x| x as f32);
    Symmetric4::from_upper([x, 0.0, c, 0.0, 0.0, 0.0, 0.0, p, 0.0, 0.0])
}

fn flat_part(a: &Symmetric4) -> [[f64; 2]; 2] {
    let [x, c, p] = [a.spatial.xx, a.mixed[0], a.angular.xx].map(f64::from);
    [[x, c], [c, p]]
}

#[test]
fn flights_are_sheared_light_fields() {
    for sigma in [[[3.0, 0.0], [0.0, 4.0]], [[3.0, 1.5], [1.5, 4.0]], [[2.0, -2.0], [-2.0, 9.0]]] {
        for d in [0.2, 0.7, 1.5, -0.4] {
            let seen = measured(256, |[x, a]| gaussian(&sigma, [x - d * a, a]));
            let predicted = flat_part(&flat(sigma).travelled(d as f32));
            assert_near(predicted, seen, FFT, &format!("flight {d}"));
        }
    }
}

#[test]
fn occluders_multiply_light_fields() {
    let sigma = [[2.0, 1.0], [1.0, 5.0]];
    for mask in [0.5, 3.0, 10.0] {
        let seen = measured(256, |[x, a]| gaussian(&sigma, [x, a]) * gaussian(&[[mask]], [x]));
        let predicted = flat(sigma).masked(&Symmetric2::diagonal(mask as f32, 0.0));
        assert_near(flat_part(&predicted), seen, FFT, &format!("mask {mask}"));
        // A flight on, what was cut in space shows in angle.
        let seen = measured(256, |[x, a]| gaussian(&sigma, [x - 0.5 * a, a]) * gaussian(&[[mask]], [x - 0.5 * a]));
        assert_near(flat_part(&predicted.travelled(0.5)), seen, FFT, &format!("mask {mask}, and a flight"));
    }
}

/// Beams through a Gaussian dip or bump of extinction, `σ = ∓a exp(−u²/2w²)`, with `|σ″| = a/w²`.
#[test]
fn attenuation_is_right_at_minima_and_conservative_at_maxima() {
    let (sigma, length, width) = ([[3.0, 1.0], [1.0, 4.0]], 0.5_f64, 1.0_f64);
    for h in [3.0, 20.0, 60.0] {
        let depth = |x: f64| length * h * width * width * (-0.5 * (x / width).powi(2)).exp();
        let add = length * h / (4.0 * core::f64::consts::PI.powi(2));
        let predicted =
            |h: f64| flat_part(&flat(sigma).attenuated(&Symmetric2::diagonal(h as f32, 0.0), length as f32));
        let minimum = measured(256, |[x, a]| gaussian(&sigma, [x, a]) * (depth(x) - depth(0.0)).exp());
        assert_near(predicted(h), minimum, FFT, &format!("minimum, second derivative {h}"));
        let maximum = measured(256, |[x, a]| gaussian(&sigma, [x, a]) * (depth(0.0) - depth(x)).exp());
        let above = predicted(-h)[0][0] - maximum[0][0];
        println!("maximum, second derivative −{h}: {above:.4} too much, twice {add:.4} expected");
        assert!(above > 0.0 && (above / (2.0 * add) - 1.0).abs() < 0.1, "{h}: {above} {add}");
    }
    // Between, in two axes across the ray: right along one principal axis, twice the other's too much.
    let (spatial, (sin, cos)) = ([[3.0, 0.4], [0.4, 2.5]], 0.6_f64.sin_cos());
    let (up, down) = (40.0_f64, 25.0_f64);
    let saddle = |x: f64, y: f64| {
        let (p, q) = (cos * x + sin * y, cos * y - sin * x);
        0.5 * length * (up * p * p - down * q * q)
    };
    let seen = measured(256, |[x, y]| gaussian(&spatial, [x, y]) * (-saddle(x, y)).exp());
    let [xx, xy, yy] = [up * cos * cos - down * sin * sin, (up + down) * sin * cos, up * sin * sin - down * cos * cos]
        .map(|x| x as f32);
    let field = Symmetric4::separable(Symmetric2::new(3.0, 0.4, 2.5), Symmetric2::ZERO);
    let s = field.attenuated(&Symmetric2::new(xx, xy, yy), length as f32).spatial;
    let over = 2.0 * down * length / (4.0 * core::f64::consts::PI.powi(2));
    let signed = [
        [f64::from(s.xx) - over * sin * sin, f64::from(s.xy) + over * sin * cos],
        [f64::from(s.xy) + over * sin * cos, f64::from(s.yy) - over * cos * cos],
    ];
    assert_near(signed, seen, FFT, "saddle");
}

#[test]
fn mixtures_have_mean_covariances() {
    let (a, b) = ([[3.0, 1.5], [1.5, 4.0]], [[1.0, -0.5], [-0.5, 8.0]]);
    for (one, other) in [(1.0, 1.0), (0.2, 3.0), (5.0, 1.0)] {
        let seen = measured(256, |x| one * gaussian(&a, x) + other * gaussian(&b, x));
        let predicted = flat(a).combined(one as f32, &flat(b), other as f32);
        assert_near(flat_part(&predicted), seen, FFT, &format!("mixture {one} : {other}"));
    }
}

type Matrix = [[f64; 4]; 4];

fn rows(a: &Symmetric4) -> Matrix {
    let u = a.to_upper().map(f64::from);
    [[u[0], u[1], u[2], u[3]], [u[1], u[4], u[5], u[6]], [u[2], u[5], u[7], u[8]], [u[3], u[6], u[8], u[9]]]
}

/// Samples along each axis of a light field in 4D.
const SIDE: usize = 36;

/// A light field after scattering by an angle of cosine `cos`: `∫∫ K(θ′ − θ, φ′, φ) l(u cos α, v, θ, φ) dθ dφ`,
/// measured. The kernel `K` is a convolution in `θ` only.
fn measured_scattering(sigma: &Matrix, cos: f64, kernel: impl Fn(f64, f64, f64) -> f64) -> Matrix {
    let n = SIDE;
    let mut light = Samples::<4>::new(n, |[u, v, t, p]| gaussian(sigma, [u * cos, v, t, p]));
    // K over (φ′, φ, θ′ − θ), in the order of an FFT: zero first.
    let mut lobe =
        Samples::<3>::new(n, |[to, from, turn]| kernel(if turn < 0.0 { turn + 1.0 } else { turn - 1.0 }, to, from));
    lobe.transform(2);
    light.transform(2);
    let mut line = vec![Complex::default(); n];
    for start in 0..n.pow(3) {
        // Lines along φ, one for each (u, v, Ω_θ).
        let (place, omega) = (start * n, start % n);
        for (to, out) in line.iter_mut().enumerate() {
            *out = (0..n).map(|from| light.values[place + from] * lobe.values[(to * n + from) * n + omega]).sum();
        }
        light.values[place..place + n].copy_from_slice(&line);
    }
    for axis in [0, 1, 3] {
        light.transform(axis);
    }
    light.covariance()
}

/// The difference of two angles in a window of [−1, 1], which an FFT takes for periodic.
fn wrapped(x: f64) -> f64 {
    x - 2.0 * (0.5 * x).round()
}

#[test]
fn scattering_by_gaussian_lobes_is_exact() {
    let light = Symmetric4::from_upper([3.0, 0.3, 1.5, -0.4, 2.0, 0.2, 1.0, 6.0, 0.5, 5.0]);
    for (alpha, lobe) in [(0.0, [1.5, 1.5]), (0.6, [1.0, 3.0]), (2.0, [2.5, 1.2])] {
        let cos = f64::cos(alpha);
        let seen = measured_scattering(&rows(&light), cos, |turn, to, from| {
            gaussian(&[[lobe[0], 0.0], [0.0, lobe[1]]], [turn, wrapped(to - from)])
        });
        let lobe = Symmetric2::diagonal(lobe[0] as f32, lobe[1] as f32);
        assert_near(rows(&light.scattered(cos as f32, &lobe)), seen, FFT, &format!("scattering by {alpha}"));
    }
}

/// Belcour et al. 2014, Fig. 6: diagonals after scattering with g = 0.8: predicted, measured with the paper's kernel
/// (a convolution), and measured with directions as they are.
///
/// ```text
/// cos α′ = cos(α + Δθ) cos Δφ   and   sin φ₁ sin φ₂ + cos φ₁ cos φ₂ cos(α + Δθ)
/// ```
fn figure_six(light: &Symmetric4, alpha: f64) -> [[f64; 4]; 3] {
    let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.8 });
    let value = |cos: f64| f64::from(phase.value(Deflection::from_cos(cos as f32))[0]);
    let convolved = measured_scattering(&rows(light), alpha.cos(), |turn, to, from| {
        value((alpha + turn).cos() * wrapped(to - from).cos())
    });
    let scattered = measured_scattering(&rows(light), alpha.cos(), |turn, to, from| {
        value(to.sin() * from.sin() + to.cos() * from.cos() * (alpha + turn).cos()) * from.cos()
    });
    let lobe = phase_covariance(&phase, Deflection::from_cos(alpha.cos() as f32));
    let predicted = rows(&light.scattered(alpha.cos() as f32, &lobe));
    [predicted, convolved, scattered].map(|a| [a[0][0], a[1][1], a[2][2], a[3][3]])
}

#[test]
fn scattering_by_henyey_greenstein_is_near() {
    let light = Symmetric4::from_upper([3.0, 0.0, 1.5, 0.0, 3.0, 0.0, 1.0, 6.0, 0.0, 6.0]);
    println!("g = 0.8, diagonals (u, v, θ, φ):");
    for alpha in [0.0, 0.2] {
        let [predicted, convolved, scattered] = figure_six(&light, alpha);
        println!("α = {alpha}: predicted {predicted:.3?}");
        for (what, seen) in [("as a convolution", convolved), ("as directions are", scattered)] {
            let off: [f64; 4] = core::array::from_fn(|i| predicted[i] / seen[i] - 1.0);
            println!("  measured {what} {seen:.3?}: prediction off by {:.1?} %", off.map(|x| 100.0 * x));
            assert!(off.iter().all(|x| x.abs() <= FFT_PEAKED), "α = {alpha}, {what}: {off:.3?}");
        }
    }
}

type Vector = [f64; 3];

fn v(a: Vec3) -> Vector {
    a.to_array().map(f64::from)
}
fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}
/// `a + b s`
fn along(a: Vector, b: Vector, s: f64) -> Vector {
    core::array::from_fn(|i| a[i] + b[i] * s)
}
fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

/// Axes made orthonormal in `f64`.
fn axes(frame: &Frame) -> [Vector; 3] {
    let w = unit(v(frame.w));
    let u = v(frame.u);
    let u = unit(along(u, w, -dot(u, w)));
    let v = v(frame.v);
    let v = along(along(v, w, -dot(v, w)), u, -dot(v, u));
    [u, unit(v), w]
}

/// A curved surface `n·x = −½ (k₁₁ s² + 2 k₁₂ s t + k₂₂ t²)` through the origin: convex seen from its normal.
struct Quadric {
    axes: [Vector; 3],
    k: [f64; 3],
}

impl Quadric {
    fn local(&self, x: Vector) -> Vector {
        self.axes.map(|axis| dot(axis, x))
    }
    /// Where a ray meets it near the origin, and the normal there.
    fn hit(&self, origin: Vector, direction: Vector) -> (Vector, Vector) {
        let (o, d) = (self.local(origin), self.local(direction));
        let [a, b, c] = self.k;
        let f = |x: Vector| x[2] + 0.5 * (a * x[0] * x[0] + 2.0 * b * x[0] * x[1] + c * x[1] * x[1]);
        let gradient = |x: Vector| [a * x[0] + b * x[1], b * x[0] + c * x[1], 1.0];
        let mut t = 0.0;
        for _ in 0..30 {
            let x = along(o, d, t);
            t -= f(x) / dot(gradient(x), d);
        }
        let g = gradient(along(o, d, t));
        let normal = core::array::from_fn(|i| (0..3).map(|k| self.axes[k][i] * g[k]).sum());
        (along(origin, direction, t), unit(normal))
    }
    fn curvature(&self) -> Symmetric3 {
        let axis = |i: usize| Vec3::from_array(self.axes[i].map(|x| x as f32));
        Symmetric3::embedded(&Symmetric2::new(self.k[0] as f32, self.k[1] as f32, self.k[2] as f32), axis(0), axis(1))
    }
}

/// The linear map of `(u, v, θ, φ)` from one frame to the other that rays through the origin follow.
fn ray_matrix(from: &Frame, to: &Frame, bent: impl Fn(Vector, Vector) -> (Vector, Vector)) -> Matrix {
    let (a, b) = (axes(from), axes(to));
    let trace = |x: [f64; 4]| {
        let origin = along(along([0.0; 3], a[0], x[0]), a[1], x[1]);
        let direction = unit(along(along(a[2], a[0], x[2]), a[1], x[3]));
        let (origin, direction) = bent(origin, direction);
        let origin = along(origin, direction, -dot(origin, b[2]) / dot(direction, b[2]));
        let ahead = dot(direction, b[2]);
        [dot(origin, b[0]), dot(origin, b[1]), dot(direction, b[0]) / ahead, dot(direction, b[1]) / ahead]
    };
    let h = 1e-4;
    let column = |j: usize| {
        let mut x = [0.0; 4];
        x[j] = h;
        let (above, below) = (trace(x), trace(x.map(|x| -x)));
        core::array::from_fn::<f64, 4, _>(|i| (above[i] - below[i]) / (2.0 * h))
    };
    let columns = [0, 1, 2, 3].map(column);
    core::array::from_fn(|i| core::array::from_fn(|j| columns[j][i]))
}

/// `J⁻ᵀ Σ J⁻¹`: the spectrum's covariance of a light field whose rays `J` moves.
fn moved(j: &Matrix, sigma: &Matrix) -> Matrix {
    // Gauss–Jordan.
    let mut a = *j;
    let mut inverse: Matrix = core::array::from_fn(|i| core::array::from_fn(|k| f64::from(u8::from(i == k))));
    for column in 0..4 {
        let pivot = (column..4).max_by(|&p, &q| a[p][column].abs().total_cmp(&a[q][column].abs())).unwrap();
        a.swap(column, pivot);
        inverse.swap(column, pivot);
        let f = 1.0 / a[column][column];
        a[column] = a[column].map(|x| x * f);
        inverse[column] = inverse[column].map(|x| x * f);
        for row in (0..4).filter(|row| *row != column) {
            let f = a[row][column];
            for k in 0..4 {
                a[row][k] -= f * a[column][k];
                inverse[row][k] -= f * inverse[column][k];
            }
        }
    }
    core::array::from_fn(|i| {
        core::array::from_fn(|k| {
            (0..4).map(|p| (0..4).map(|q| inverse[p][i] * sigma[p][q] * inverse[q][k]).sum::<f64>()).sum()
        })
    })
}

fn reflect(direction: Vector, normal: Vector) -> Vector {
    along(direction, normal, -2.0 * dot(direction, normal))
}

/// `ratio` is that of the indices, before over behind; against the normal.
fn refract(direction: Vector, normal: Vector, ratio: f64) -> Option<Vector> {
    let cos = -dot(direction, normal);
    let rest = 1.0 - ratio * ratio * (1.0 - cos * cos);
    (rest > 0.02).then(|| along(direction.map(|x| x * ratio), normal, ratio * cos - rest.sqrt()))
}

fn single(x: Vector) -> Vec3 {
    Vec3::from_array(unit(x).map(|x| x as f32))
}

struct Random(Generator);

impl Random {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(uniform(&mut self.0))
    }
    fn direction(&mut self) -> Vec3 {
        let u = Vec2::new(uniform(&mut self.0), uniform(&mut self.0));
        uniform_sphere(u).normalize()
    }
    fn frame(&mut self, w: Vec3) -> Frame {
        let (around, (sin, cos)) = (Frame::around(w), self.within(0.0, 6.3).sin_cos());
        let u = (around.u * cos as f32 + around.v * sin as f32).normalize();
        Frame { u, v: w.cross(u), w }
    }
    /// Of full rank, or of rank one: a single wave.
    fn covariance(&mut self, rank: usize) -> Symmetric4 {
        let g: Matrix =
            core::array::from_fn(|_| core::array::from_fn(|k| if k < rank { self.within(-1.0, 1.0) } else { 0.0 }));
        let entry = |i: usize, j: usize| (0..4).map(|k| g[i][k] * g[j][k]).sum::<f64>() as f32;
        let upper = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
        Symmetric4::from_upper(upper.map(|(i, j)| entry(i, j)))
    }
}

/// Entries within the tolerance of bundles, in units of what their blocks held before and after.
#[track_caller]
fn assert_moved(before: &Symmetric4, predicted: &Matrix, traced: &Matrix, what: &str) -> f64 {
    let trace = |i: usize| traced[i][i] + traced[i + 1][i + 1];
    let [x, p] = [before.spatial, before.angular].map(|block| f64::from(block.trace()));
    let scales = [trace(0) + x, trace(0) + x, trace(2) + p, trace(2) + p];
    let mut worst = 0.0_f64;
    for i in 0..4 {
        for j in 0..4 {
            let off = (predicted[i][j] - traced[i][j]).abs() / (scales[i] * scales[j]).sqrt();
            assert!(off <= BUNDLE, "{what}: {i} {j}: {off:.1e}\npredicted {predicted:?}\ntraced {traced:?}");
            worst = worst.max(off);
        }
    }
    worst
}

#[test]
fn mirrors_and_interfaces_of_any_curvature_move_bundles_as_traced() {
    let mut random = Random(Generator::new(3));
    let mirror = Surface::Mirror { reflectance: Spectrum::ONE };
    let mut worst = [0.0_f64; 2];
    let mut count = [0; 2];
    for i in 0..2000 {
        let quadric =
            Quadric { axes: axes(&random.frame(Vec3::Z)), k: core::array::from_fn(|_| random.within(-1.0, 1.0)) };
        let tilted = random.direction();
        let around = random.frame(tilted);
        let quadric = Quadric { axes: axes(&around), ..quadric };
        let normal = quadric.axes[2];
        // Steep to nearly grazing, and straight on.
        let w = loop {
            let w = if i % 50 == 0 { -around.w } else { random.direction() };
            if f64::from(w.dot(around.w)) < -0.15 {
                break w;
            }
        };
        let frame = random.frame(w);
        let light = LightField { covariance: random.covariance(if i % 2 == 0 { 4 } else { 1 }), frame };
        // Whichever side the normal points to.
        let (sign, curvature) =
            if i % 3 == 0 { (-1.0, quadric.curvature().times(-1.0)) } else { (1.0, quadric.curvature()) };
        let patch = Patch { normal: around.w * sign, curvature, texture: Symmetric3::ZERO };

        let out = single(reflect(v(w), normal));
        let seen = light.reflected(out, &patch, &mirror);
        let j = ray_matrix(&frame, &seen.frame, |origin, direction| {
            let (place, normal) = quadric.hit(origin, direction);
            (place, reflect(direction, normal))
        });
        let traced = moved(&j, &rows(&light.covariance));
        worst[0] =
            worst[0].max(assert_moved(&light.covariance, &rows(&seen.covariance), &traced, &format!("{i}: mirror")));
        count[0] += 1;

        let ratio = if i % 4 < 2 { 1.0 / random.within(1.05, 2.0) } else { random.within(1.05, 2.0) };
        let Some(out) = refract(v(w), normal, ratio) else { continue };
        let seen = light.refracted(single(out), &patch, (ratio as f32, 1.0));
        let j = ray_matrix(&frame, &seen.frame, |origin, direction| {
            let (place, normal) = quadric.hit(origin, direction);
            (place, refract(direction, normal, ratio).expect("no total reflection near"))
        });
        let traced = moved(&j, &rows(&light.covariance));
        worst[1] = worst[1].max(assert_moved(
            &light.covariance,
            &rows(&seen.covariance),
            &traced,
            &format!("{i}: interface {ratio}"),
        ));
        count[1] += 1;
    }
    println!("{} mirrors within {:.1e}, {} interfaces within {:.1e}", count[0], worst[0], count[1], worst[1]);
    assert!(count[1] > 1000);
}

/// A concave mirror makes parallel light meet at half its radius; a ball of glass at `n R/(2(n − 1))` from its centre.
#[test]
fn focal_lengths_are_those_of_textbooks() {
    let radius = 2.0_f32;
    // Parallel light that varies across: all of its content is in place.
    let spatial = Symmetric2::diagonal(3.0, 3.0);
    let light = LightField::around(Vec3::NEG_Z, Symmetric4::separable(spatial, Symmetric2::diagonal(1e-6, 1e-6)));
    // Waves in angle, of a point in space: at the focus of a bundle light varies with angle only where it did in place.
    let bent = Symmetric3::embedded(&Symmetric2::diagonal(-1.0 / radius, -1.0 / radius), Vec3::X, Vec3::Y);
    let patch = Patch { curvature: bent, ..Patch::flat(Vec3::Z) };
    let mirror = Surface::Mirror { reflectance: Spectrum::ONE };
    // One angle, all places: sharp in angle.
    let sharp = Symmetric4::separable(Symmetric2::ZERO, Symmetric2::diagonal(5.0, 5.0));
    let parallel = LightField { covariance: sharp, ..light };
    let focus = parallel.reflected(Vec3::Z, &patch, &mirror).travelled(0.5 * radius).covariance;
    // At the focus all rays meet in a point: sharp in space, nothing left in angle.
    assert!(focus.angular.trace() < 1e-5 * focus.spatial.trace(), "{focus:?}");

    let index = 1.5_f32;
    let ball = |sign: f32| Patch {
        curvature: Symmetric3::embedded(&Symmetric2::diagonal(sign / radius, sign / radius), Vec3::X, Vec3::Y),
        ..Patch::flat(Vec3::Z)
    };
    let inside = parallel.refracted(Vec3::NEG_Z, &ball(1.0), (1.0, index)).travelled(2.0 * radius);
    let behind = inside.refracted(Vec3::NEG_Z, &ball(-1.0), (index, 1.0));
    let from_surface = index * radius / (2.0 * (index - 1.0)) - radius;
    let focus = behind.travelled(from_surface).covariance;
    assert!(focus.angular.trace() < 1e-5 * focus.spatial.trace(), "{focus:?}");
}

/// The sheet's § 2.2: a mirror with k = (0.7, 0.2, 0.4), met at 0.9 rad.
#[test]
fn a_tilted_curved_mirror_has_the_powers_of_the_sheet() {
    let (sin, cos) = 0.9_f32.sin_cos();
    let w = Vec3::new(sin, 0.0, -cos);
    let frame = Frame { u: Vec3::new(cos, 0.0, sin), v: Vec3::NEG_Y, w };
    assert!((frame.u.cross(frame.v) - w).length() < 1e-6);
    // The second tangent is t × n, as the light field has it.
    let k = Symmetric3::embedded(&Symmetric2::new(0.7, 0.2, 0.4), Vec3::X, Vec3::NEG_Y);
    let patch = Patch { curvature: k, ..Patch::flat(Vec3::Z) };
    let mirror = Surface::Mirror { reflectance: Spectrum::ONE };
    let wave = |t: f32, p: f32| {
        let angular = Symmetric2::diagonal(t, p);
        let light = LightField { covariance: Symmetric4::separable(Symmetric2::ZERO, angular), frame };
        light.reflected(Vec3::new(sin, 0.0, cos), &patch, &mirror)
    };
    // A wave over one angle alone shows the row of the ray matrix that says how place turns that angle.
    for (field, row) in [(wave(1.0, 0.0), [2.25222, 0.4]), (wave(0.0, 1.0), [0.4, 0.49729])] {
        let s = field.covariance.spatial;
        for (variance, power) in [(s.xx, row[0]), (s.yy, row[1])] {
            assert!((variance.sqrt() - power).abs() < 1e-5, "{:?} {row:?}", field.covariance);
        }
    }
}
