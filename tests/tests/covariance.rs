//! What must hold for every covariance: symmetric (by its type), positive semi-definite, the same in whatever frame
//! it is written, additive over flights, never more after scattering, and finite for any finite input.
//!
//! Eigenvalues are taken in `f64`, with every axis in units of the largest variance that took part in the
//! operation: so a tolerance in units of rounding means the same for metres and radians.

use fogbow::covariance::operators::PER_HESSIAN;
use fogbow::covariance::{
    self, ImageCovariance, LIMIT, LightField, Patch, Symmetric4, Voxel, emitted, operators, phase_covariance,
};
use fogbow::light::{
    EnvironmentMap, Light, MeshLight, PhongLight, PointLight, QuadLight, SphereLight, SpotLight, Sun, Triangle,
};
use fogbow::math::{Frame, Mat3, Ray, Symmetric2, Symmetric3, Vec2, Vec3};
use fogbow::phase::{Deflection, Lobe, MAX_ANISOTROPY, Phase};
use fogbow::sampling::warp::uniform_sphere;
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow_tests::tolerance::{COVARIANCE, FRAMES};

/// Random covariances per property.
const COUNT: u64 = 100_000;

type Matrix = [[f64; 4]; 4];

fn rows(a: &Symmetric4) -> Matrix {
    let u = a.to_upper().map(f64::from);
    [[u[0], u[1], u[2], u[3]], [u[1], u[4], u[5], u[6]], [u[2], u[5], u[7], u[8]], [u[3], u[6], u[8], u[9]]]
}

fn symmetric(a: &Matrix) -> Symmetric4 {
    let x = |i: usize, j: usize| a[i][j] as f32;
    let upper = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
    Symmetric4::from_upper(upper.map(|(i, j)| x(i, j)))
}

fn map2(f: impl Fn(usize, usize) -> f64) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| f(i, j)))
}

/// `A B Aᵀ`.
fn congruent(a: &Matrix, b: &Matrix) -> Matrix {
    let ab = map2(|i, j| (0..4).map(|k| a[i][k] * b[k][j]).sum());
    map2(|i, j| (0..4).map(|k| ab[i][k] * a[j][k]).sum())
}

/// The smallest eigenvalue, by Jacobi rotations.
#[expect(clippy::needless_range_loop, reason = "rows and columns of one matrix change together")]
fn least_eigenvalue<const N: usize>(mut a: [[f64; N]; N]) -> f64 {
    for _ in 0..12 {
        for p in 0..N {
            for q in p + 1..N {
                if a[p][q].abs() < 1e-300 {
                    continue;
                }
                let slope = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
                let t = 1.0_f64.copysign(slope) / (slope.abs() + slope.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                let s = t * c;
                for k in 0..N {
                    (a[k][p], a[k][q]) = (c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]);
                }
                for k in 0..N {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                }
            }
        }
    }
    (0..N).fold(f64::INFINITY, |least, i| least.min(a[i][i]))
}

/// The least eigenvalue of `a` with its axes in units of the standard deviations `√scales`.
fn definiteness<const N: usize>(a: [[f64; N]; N], scales: [f64; N]) -> f64 {
    let s = scales.map(|d| 1.0 / d.max(1e-60).sqrt());
    least_eigenvalue::<N>(core::array::from_fn(|i| core::array::from_fn(|j| a[i][j] * s[i] * s[j])))
}

#[track_caller]
fn assert_sound(a: &Symmetric4, scales: [f64; 4], what: &str) {
    let upper = a.to_upper();
    assert!(upper.iter().all(|x| x.is_finite()), "{what}: not finite: {a:?}");
    assert!([0, 4, 7, 9].iter().all(|&i| upper[i] >= 0.0), "{what}: a negative variance: {a:?}");
    let least = definiteness(rows(a), scales);
    assert!(least >= -COVARIANCE, "{what}: eigenvalue {least:.2e}\n{a:?}\nscales {scales:?}");
}

fn diagonal(a: &Symmetric4) -> [f64; 4] {
    [a.spatial.xx, a.spatial.yy, a.angular.xx, a.angular.yy].map(f64::from)
}

struct Random(Generator);

impl Random {
    fn new(seed: u64) -> Self {
        Self(Generator::new(seed))
    }
    fn unit(&mut self) -> f64 {
        f64::from(uniform(&mut self.0))
    }
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    /// Over magnitudes.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        10.0_f64.powf(self.within(low, high))
    }
    fn direction(&mut self) -> Vec3 {
        uniform_sphere(Vec2::new(self.unit() as f32, self.unit() as f32)).normalize()
    }
    /// A direction that another one is turned into: often nearly, sometimes exactly, straight on or back.
    fn turned(&mut self, w: Vec3) -> Vec3 {
        match (self.unit() * 8.0) as u32 {
            0 => w,
            1 => -w,
            2 => (w + self.direction() * self.decades(-8.0, -1.0) as f32).normalize(),
            3 => (self.direction() * self.decades(-8.0, -1.0) as f32 - w).normalize(),
            _ => self.direction(),
        }
    }
    /// A frame turned at random about its axis.
    fn frame(&mut self, w: Vec3) -> Frame {
        let around = Frame::around(w);
        let (sin, cos) = self.within(0.0, 6.3).sin_cos();
        let u = (around.u * cos as f32 + around.v * sin as f32).normalize();
        Frame { u, v: w.cross(u), w }
    }
    /// `G Gᵀ` of any rank, axes of very different size, some nearly singular, some zero.
    fn matrix<const N: usize>(&mut self) -> [[f64; N]; N] {
        let rank = (self.unit() * (N + 1) as f64) as usize;
        let axes: [f64; N] = core::array::from_fn(|_| self.decades(-3.0, 3.0));
        let sizes: [f64; N] =
            core::array::from_fn(|i| if i < rank { 1.0 } else { [0.0, 0.0, 1e-6, 1e-4][(self.unit() * 4.0) as usize] });
        let g: [[f64; N]; N] =
            core::array::from_fn(|i| core::array::from_fn(|k| axes[i] * sizes[k] * self.within(-1.0, 1.0)));
        core::array::from_fn(|i| core::array::from_fn(|j| (0..N).map(|k| g[i][k] * g[j][k]).sum()))
    }
    fn covariance(&mut self) -> Symmetric4 {
        let matrix = self.matrix();
        symmetric(&matrix)
    }
    fn covariance2(&mut self) -> Symmetric2 {
        let a: [[f64; 2]; 2] = self.matrix();
        Symmetric2::new(a[0][0] as f32, a[0][1] as f32, a[1][1] as f32)
    }
    fn covariance3(&mut self) -> Symmetric3 {
        let a: [[f64; 3]; 3] = self.matrix();
        Symmetric3::from_upper([a[0][0], a[0][1], a[0][2], a[1][1], a[1][2], a[2][2]].map(|x| x as f32))
    }
    /// Of any sign.
    fn hessian(&mut self) -> Symmetric3 {
        let (a, b) = (self.covariance3(), self.covariance3());
        a.plus(&b.times(-1.0))
    }
    fn lobe(&mut self) -> Lobe {
        match (self.unit() * 8.0) as u32 {
            0 => Lobe::Isotropic,
            1 => Lobe::Rayleigh,
            2 => Lobe::Schlick { k: self.within(-0.999, 0.999) as f32 },
            3 => Lobe::Draine { g: self.within(-0.999, 0.999) as f32, alpha: self.within(0.0, 50.0) as f32 },
            4 => Lobe::HenyeyGreenstein { g: [-MAX_ANISOTROPY, 0.0, MAX_ANISOTROPY][(self.unit() * 3.0) as usize] },
            _ => Lobe::HenyeyGreenstein { g: self.within(-0.999, 0.999) as f32 },
        }
    }
    /// Angular covariances of lobes: of phase functions, zero, singular, huge.
    fn sigma(&mut self) -> Symmetric2 {
        match (self.unit() * 6.0) as u32 {
            0 => Symmetric2::ZERO,
            1 => self.covariance2(),
            2 => self.covariance2().times(LIMIT),
            3 => Symmetric2::diagonal(self.decades(-3.0, 3.0) as f32, 0.0),
            _ => phase_covariance(&Phase::from(self.lobe()), Deflection::from_cos(self.within(-1.0, 1.0) as f32)),
        }
    }
    fn surface(&mut self) -> Surface {
        let grey = Spectrum::splat(0.5);
        match (self.unit() * 3.0) as u32 {
            0 => Surface::Lambert { reflectance: grey },
            1 => Surface::Phong { diffuse: grey, specular: grey, exponent: self.decades(0.0, 4.0) as f32 },
            _ => Surface::Mirror { reflectance: grey },
        }
    }
    /// Any finite number, extreme ones as often as not.
    fn any(&mut self) -> f32 {
        let sign = if self.unit() < 0.5 { -1.0 } else { 1.0 };
        let size = match (self.unit() * 8.0) as u32 {
            0 => 0.0,
            1 => f32::MAX,
            2 => f32::MIN_POSITIVE,
            3 => f32::from_bits(1),
            4 => self.decades(-45.0, -30.0) as f32,
            5 => self.decades(12.0, 38.0) as f32,
            _ => self.decades(-6.0, 6.0) as f32,
        };
        sign * size
    }
    fn any4(&mut self) -> Symmetric4 {
        Symmetric4::from_upper(core::array::from_fn(|_| self.any()))
    }
    fn any2(&mut self) -> Symmetric2 {
        Symmetric2::new(self.any(), self.any(), self.any())
    }
    fn any3(&mut self) -> Symmetric3 {
        Symmetric3::from_upper(core::array::from_fn(|_| self.any()))
    }
}

#[test]
fn every_operator_keeps_covariances_positive_semi_definite() {
    let mut random = Random::new(1);
    for i in 0..COUNT {
        let a = random.covariance();
        let [u, v, t, p] = diagonal(&a);
        assert_sound(&a, [u, v, t, p], "the input");

        let d = random.decades(-3.0, 3.0);
        let far = [u, v, t + d * d * u, p + d * d * v];
        assert_sound(&a.travelled(d as f32), far, &format!("{i}: travelled"));
        assert_sound(&a.travelled(-d as f32), far, &format!("{i}: travelled back"));

        let mask = random.covariance2();
        let (x, y) = (f64::from(mask.xx), f64::from(mask.yy));
        assert_sound(&a.masked(&mask), [u + x, v + y, t, p], &format!("{i}: masked"));

        let hessian = random.hessian().within(Vec3::X, Vec3::Y);
        let more = f64::from(hessian.absolute().trace()) * d * f64::from(PER_HESSIAN);
        assert_sound(&a.attenuated(&hessian, d as f32), [u + more, v + more, t, p], &format!("{i}: attenuated"));

        let (lobe, cos) = (random.sigma(), random.within(-1.0, 1.0) as f32);
        let seen = a.scattered(cos, &lobe);
        let turned = f64::from(cos).powi(2) * u;
        assert_sound(&seen, [turned, v, t, p], &format!("{i}: scattered, {cos} {lobe:?} {a:?}"));

        let (sin, cos) = random.within(0.0, 6.3).sin_cos();
        let scales = [u + v, u + v, t + p, t + p];
        assert_sound(&a.rotated(cos as f32, sin as f32), scales, &format!("{i}: rotated"));

        let s: [f64; 4] = core::array::from_fn(|_| random.decades(-2.0, 2.0));
        let scales = [u * s[0] * s[0], v * s[1] * s[1], t * s[2] * s[2], p * s[3] * s[3]];
        assert_sound(&a.scaled(s.map(|s| s as f32)), scales, &format!("{i}: scaled"));

        let (k, cos) = (random.covariance2(), random.unit());
        let n = [f64::from(k.xx), cos * f64::from(k.xy), f64::from(k.xy), cos * f64::from(k.yy)].map(|x| x * x);
        let bent = [u + 2.0 * (n[0] * t + n[1] * p), v + 2.0 * (n[2] * t + n[3] * p), t, p];
        assert_sound(&a.curved(&k, cos as f32), bent, &format!("{i}: curved"));

        let b = random.covariance();
        let (one, other) = (random.decades(-5.0, 5.0) as f32, random.decades(-5.0, 5.0) as f32);
        let share = f64::from(one) / (f64::from(one) + f64::from(other));
        let (x, y) = (diagonal(&a), diagonal(&b));
        let scales = core::array::from_fn(|i| share * x[i] + (1.0 - share) * y[i]);
        assert_sound(&a.combined(one, &b, other), scales, &format!("{i}: combined"));

        for (slice, whole) in [(a.slice(), [u, v]), (a.angular_slice(), [t, p])] {
            let Symmetric2 { xx, xy, yy } = slice;
            let least = definiteness([[xx, xy], [xy, yy]].map(|r| r.map(f64::from)), whole);
            assert!(xx >= 0.0 && yy >= 0.0 && least >= -COVARIANCE, "{i}: slice {least:.2e} {a:?}");
        }
    }
}

#[test]
fn flights_add_up_and_lead_back() {
    let mut random = Random::new(2);
    for i in 0..COUNT {
        let a = random.covariance();
        let (d, e) = (random.decades(-3.0, 2.0) as f32, random.decades(-3.0, 2.0) as f32);
        let (twice, once, back) = (a.travelled(d).travelled(e), a.travelled(d + e), a.travelled(d).travelled(-d));
        let [u, v, t, p] = diagonal(&a);
        let far = f64::from(d + e).powi(2);
        let scales = [u, v, t + far * u, p + far * v];
        for (x, y, what) in [(twice, once, "twice"), (back, a, "back")] {
            let (x, y) = (rows(&x), rows(&y));
            for j in 0..4 {
                for k in 0..4 {
                    // Where a variance cancels, a covariance is held to what is left of it; and a focus on the way
                    // back leaves only roots.
                    let left = (y[j][j] / scales[j].max(1e-60)).min(y[k][k] / scales[k].max(1e-60));
                    let tolerance = match what {
                        "back" => COVARIANCE.sqrt(),
                        _ if j == k => COVARIANCE,
                        _ => 4.0 * COVARIANCE / left.max(COVARIANCE).sqrt(),
                    };
                    let most = tolerance * (scales[j] * scales[k]).sqrt();
                    assert!((x[j][k] - y[j][k]).abs() <= most, "{i}, {what}: {j} {k}: {} {}", x[j][k], y[j][k]);
                }
            }
        }
    }
}

/// Where light is scattered, no frequency is gained: `Σ_s ≼ V Σ V`; nor in what is left of the fluence: `S ≼ X`.
#[test]
fn scattering_never_adds() {
    let mut random = Random::new(3);
    for i in 0..COUNT {
        let (a, lobe, cos) = (random.covariance(), random.sigma(), random.within(-1.0, 1.0));
        let turn = [cos, 1.0, 1.0, 1.0];
        let before = rows(&a);
        let after = rows(&a.scattered(cos as f32, &lobe));
        let [u, v, t, p] = diagonal(&a);
        let lost = map2(|i, j| turn[i] * turn[j] * before[i][j] - after[i][j]);
        let least = definiteness(lost, [cos * cos * u, v, t, p]);
        assert!(least >= -COVARIANCE, "{i}: gained {:.2e}\n{a:?}\n{lobe:?} {cos}", -least);

        // Nor does more reach than the lobe lets through.
        let reach = [[f64::from(lobe.xx), f64::from(lobe.xy)], [f64::from(lobe.xy), f64::from(lobe.yy)]];
        let over = core::array::from_fn(|j| core::array::from_fn(|k| reach[j][k] - after[j + 2][k + 2]));
        let scales = [reach[0][0].max(t), reach[1][1].max(p)];
        assert!(definiteness(over, scales) >= -COVARIANCE, "{i}: beyond the lobe\n{a:?}\n{lobe:?}");

        let s = a.slice();
        let lost = [[u - f64::from(s.xx), before[0][1] - f64::from(s.xy)], [0.0, v - f64::from(s.yy)]];
        let lost = [lost[0], [lost[0][1], lost[1][1]]];
        // A variance that counts as rounding takes along what it shares with the other.
        assert!(definiteness(lost, [u, v]) >= -COVARIANCE.sqrt(), "{i}: the slice gained\n{a:?}");
    }
}

/// `σ_ρ ≼ σ_ρ'` scatters into `Σ_s ≼ Σ_s'`, and isotropic scattering leaves nothing over directions.
#[test]
fn sharper_lobes_let_more_through() {
    let mut random = Random::new(4);
    for i in 0..COUNT {
        // As phase functions have them: of others, singular ones above all, `f32` does not hold the sum.
        let [lobe, more] = [random.sigma(), random.covariance2()].map(|s| Symmetric2::diagonal(s.xx, s.yy));
        let (a, cos) = (random.covariance(), random.within(-1.0, 1.0));
        let (blunt, sharp) = (a.scattered(cos as f32, &lobe), a.scattered(cos as f32, &lobe.plus(&more)));
        let (x, y) = (rows(&blunt), rows(&sharp));
        let [u, v, t, p] = diagonal(&a);
        let least = definiteness(map2(|i, j| y[i][j] - x[i][j]), [cos * cos * u, v, t, p]);
        assert!(least >= -COVARIANCE, "{i}: {least:.2e}\n{a:?}\n{lobe:?} {more:?} {cos}");
        let even = a.scattered(cos as f32, &Symmetric2::ZERO);
        assert!(even.angular == Symmetric2::ZERO && even.mixed == [0.0; 4], "{i}: {even:?}");
    }
}

#[test]
fn mixing_commutes_and_weighs() {
    let mut random = Random::new(5);
    for i in 0..COUNT {
        let (a, b) = (random.covariance(), random.covariance());
        let (x, y) = (random.decades(-20.0, 20.0) as f32, random.decades(-20.0, 20.0) as f32);
        assert_eq!(a.combined(x, &b, y), b.combined(y, &a, x), "{i}");
        assert_eq!(a.combined(x, &b, 0.0), a.flipped().flipped(), "{i}: with nothing");
        let w = random.direction();
        let (light, other) = (
            LightField { covariance: a, frame: random.frame(w) },
            LightField { covariance: b, frame: random.frame(w) },
        );
        let mut one = Voxel::EMPTY;
        one.add(&light, x);
        one.add(&other, y);
        let mut two = Voxel::EMPTY;
        two.add(&other, y);
        two.add(&light, x);
        assert_eq!(one, two, "{i}");
        let (p, q) = (light.combined(x, &other, y).unwrap(), other.combined(y, &light, x).unwrap());
        // Singular matrices turned: a variance lost in rounding takes the root of it along.
        let scale = 10.0 * f64::from(a.trace() + b.trace());
        assert_alike(&p, &q, [scale; 4], &format!("{i}: frames"));
    }
}

/// The same light field, up to the choice of frame and rounding in units of `scales`.
#[track_caller]
fn assert_alike(a: &LightField, b: &LightField, scales: [f64; 4], what: &str) {
    assert!(a.frame.w.distance(b.frame.w) < 1e-6, "{what}: {:?} {:?}", a.frame, b.frame);
    let (x, y) = (rows(&a.covariance), rows(&b.turned_to(a.frame.u).covariance));
    for i in 0..4 {
        for j in 0..4 {
            let most = FRAMES * (scales[i] * scales[j]).sqrt();
            assert!(
                (x[i][j] - y[i][j]).abs() <= most,
                "{what}: {i} {j}: {} {} ± {most:.1e}\n{a:?}\n{b:?}",
                x[i][j],
                y[i][j]
            );
        }
    }
}

#[test]
fn results_do_not_depend_on_the_choice_of_frame() {
    let mut random = Random::new(6);
    for i in 0..COUNT {
        // Away from singular matrices: what they turn into depends on rounding.
        let (x, y) = (random.decades(-2.0, 2.0), random.decades(-2.0, 2.0));
        let g: Matrix = core::array::from_fn(|_| core::array::from_fn(|_| random.within(-1.0, 1.0)));
        let core = congruent(&g, &map2(|i, j| f64::from(u8::from(i == j))));
        let s = [x, x, y, y];
        let a = symmetric(&map2(|i, j| s[i] * s[j] * (core[i][j] + if i == j { 0.1 } else { 0.0 })));
        let w = random.direction();
        let light = LightField { covariance: a, frame: random.frame(w) };
        let axis = random.frame(w).u;
        let other = light.turned_to(axis);
        let [u, v, t, p] = diagonal(&a);
        let (s, t) = (u + v, t + p);
        assert_alike(&light, &other, [s, s, t, t], &format!("{i}: turned"));
        assert_alike(&light, &other.turned_to(light.frame.u), [s, s, t, t], &format!("{i}: there and back"));

        let d = random.decades(-1.0, 1.0);
        let far = t + d * d * s;
        assert_alike(&light.travelled(d as f32), &other.travelled(d as f32), [s, s, far, far], &format!("{i}: far"));
        let occluders = random.covariance3();
        let more = s + f64::from(occluders.trace());
        let (one, two) = (light.occluded(&occluders), other.occluded(&occluders));
        assert_alike(&one, &two, [more, more, t, t], &format!("{i}: occluded"));
        let hessian = random.hessian();
        let more = s + f64::from(hessian.absolute().trace());
        let (one, two) = (light.attenuated(&hessian, 0.5), other.attenuated(&hessian, 0.5));
        assert_alike(&one, &two, [more, more, t, t], &format!("{i}: attenuated"));

        let phase = Phase::from(random.lobe());
        let out = random.turned(w);
        // Straight back there is no plane of scattering, and the model needs one (sheet § 2.4).
        if w.dot(out) > -0.999_999 {
            let (one, two) = (light.scattered(out, &phase), other.scattered(out, &phase));
            assert_alike(&one, &two, [s, s, t, t], &format!("{i}: scattered {phase:?}"));
            let (g, h) = (one.volumetric().to_upper(), two.volumetric().to_upper());
            assert!(g.iter().zip(h).all(|(a, b)| f64::from((a - b).abs()) <= FRAMES * s), "{i}: {g:?} {h:?}");
        }

        let n = random.direction();
        let n = if n.dot(w) > 0.0 { -n } else { n };
        let around = Frame::around(n);
        let curvature = Symmetric3::embedded(&random.covariance2(), around.u, around.v).times(0.1);
        let texture = Symmetric3::embedded(&random.covariance2(), around.u, around.v);
        let patch = Patch { normal: n, curvature, texture };
        let surface = random.surface();
        let out = if matches!(surface, Surface::Mirror { .. }) {
            w - n * (2.0 * w.dot(n))
        } else {
            let out = random.direction();
            if out.dot(n) < 0.0 { -out } else { out }
        };
        // Grazing light is stretched without bound.
        if out.dot(n) < 0.1 || w.dot(n) > -0.1 {
            continue;
        }
        let k = f64::from(curvature.trace()).powi(2);
        let spatial = 100.0 * (s + 8.0 * k * t + f64::from(texture.trace()));
        let (one, two) = (light.reflected(out, &patch, &surface), other.reflected(out, &patch, &surface));
        assert_alike(&one, &two, [spatial, spatial, t, t], &format!("{i}: reflected"));
        let back = Patch { normal: -n, curvature: curvature.times(-1.0), texture };
        let three = light.reflected(out, &back, &surface);
        assert_alike(&one, &three, [spatial, spatial, t, t], &format!("{i}: reflected, normal turned"));
        let ratio = random.within(0.5, 1.0) as f32;
        let bent = refract(w, n, ratio);
        let (one, two) = (light.refracted(bent, &patch, (ratio, 1.0)), other.refracted(bent, &patch, (ratio, 1.0)));
        let t = 400.0 * t;
        assert_alike(&one, &two, [spatial, spatial, t, t], &format!("{i}: refracted"));
    }
}

/// Into the denser side.
fn refract(w: Vec3, n: Vec3, ratio: f32) -> Vec3 {
    let cos = -w.dot(n);
    let cos_t = (1.0 - ratio * ratio * (1.0 - cos * cos)).sqrt();
    (w * ratio + n * (ratio * cos - cos_t)).normalize()
}

#[track_caller]
fn assert_finite(numbers: &[f32], what: impl Fn() -> String) {
    assert!(numbers.iter().all(|x| x.is_finite()), "{}: {numbers:?}", what());
}

/// Any finite entries, positive semi-definite or not: never NaN, never a negative variance.
#[test]
fn any_finite_input_gives_finite_covariances() {
    let mut random = Random::new(7);
    for i in 0..COUNT {
        let (a, b, mask, h) = (random.any4(), random.any4(), random.any2(), random.any3());
        let x: [f32; 4] = core::array::from_fn(|_| random.any());
        let (cos, sin) = (random.within(-1.0, 1.0) as f32, 0.3);
        let results = [
            ("travelled", a.travelled(x[0])),
            ("masked", a.masked(&mask)),
            ("attenuated", a.attenuated(&mask, x[0])),
            ("scattered", a.scattered(cos, &mask)),
            ("reflected", a.reflected_in_lobe(&mask)),
            ("scattered without lobe", a.scattered(cos, &Symmetric2::ZERO)),
            ("rotated", a.rotated(cos, sin)),
            ("scaled", a.scaled(x)),
            ("projected", a.projected(cos)),
            ("unprojected", a.unprojected(cos)),
            ("curved", a.curved(&mask, cos)),
            ("flipped", a.flipped()),
            ("refracted", a.refracted(&mask, (cos, sin), (x[0].abs().max(1e-38), x[1].abs().max(1e-38)))),
            ("combined", a.combined(x[0].abs(), &b, x[1].abs())),
        ];
        for (name, result) in results {
            let upper = result.to_upper();
            assert_finite(&upper, || format!("{i}, {name}: {a:?} {mask:?} {x:?}"));
            assert!([0, 4, 7, 9].iter().all(|&k| upper[k] >= 0.0), "{i}, {name}: {result:?}");
            assert!(upper.iter().all(|x| x.abs() <= LIMIT * 1.000_001), "{i}, {name}: beyond the limit: {result:?}");
        }
        for slice in [a.slice(), a.angular_slice(), mask.absolute(), mask.pseudo_inverse()] {
            assert_finite(&[slice.xx, slice.xy, slice.yy], || format!("{i}: {a:?} {mask:?}"));
        }
        for m in [h.absolute(), h.pseudo_inverse()] {
            assert_finite(&m.to_upper(), || format!("{i}: {h:?}"));
        }
        for m in [a.absolute(), a.pseudo_inverse()] {
            assert_finite(&m.to_upper(), || format!("{i}: {a:?}"));
        }
        for eigen in [a.eigen().values.to_vec(), h.eigen().values.to_vec(), mask.eigen().values.to_vec()] {
            assert_finite(&eigen, || format!("{i}: {a:?} {h:?} {mask:?}"));
        }
        assert!(!mask.determinant().is_nan() && covariance::sample_density(&mask) >= 0.0, "{i}: {mask:?}");

        let w = random.direction();
        let light = LightField { covariance: a, frame: random.frame(w) };
        let patch = Patch { normal: random.direction(), curvature: h, texture: random.any3() };
        let (out, phase, surface) = (random.turned(w), Phase::from(random.lobe()), random.surface());
        let fields = [
            ("occluded", light.occluded(&h)),
            ("attenuated", light.attenuated(&h, x[0])),
            ("scattered", light.scattered(out, &phase)),
            ("convolved", light.convolved(out, w.dot(out), &mask)),
            ("reflected", light.reflected(out, &patch, &surface)),
            ("refracted", light.refracted(out, &patch, (1.0, 1.5))),
            ("turned", light.turned_to(out)),
        ];
        for (name, field) in fields {
            let Frame { u, v, w } = field.frame;
            assert_finite(&field.covariance.to_upper(), || format!("{i}, {name}: {light:?} {out} {patch:?}"));
            assert_finite(&field.volumetric().to_upper(), || format!("{i}, {name}: {field:?}"));
            let off = u.dot(v).abs().max(u.dot(w).abs()).max(u.cross(v).distance(w));
            assert!(off < 1e-5, "{i}, {name}: {:?} {light:?} {out}", field.frame);
        }
        let mut voxel = Voxel::EMPTY;
        voxel.add(&light, x[0].abs());
        voxel.add(&LightField { covariance: b, ..light }, x[1].abs());
        if let Some(gamma) = voxel.covariance() {
            assert_finite(&gamma.to_upper(), || format!("{i}: {a:?} {b:?} {x:?}"));
            assert_metrics(&gamma, x, w, &format!("{i}"));
        }
        assert_metrics(&h, x, w, &format!("{i}"));
        let mut image = ImageCovariance::new(light.frame);
        image.add(x[2].abs(), x[3].abs(), x[0].abs(), &h, Some(&patch.texture));
        image.add(x[3].abs(), x[2].abs(), x[1].abs(), &patch.texture, None);
        if let Some(value) = image.value() {
            assert_finite(&value.to_upper(), || format!("{i}: {h:?} {patch:?} {x:?}"));
        }
    }
}

#[track_caller]
fn assert_metrics(gamma: &Symmetric3, x: [f32; 4], w: Vec3, what: &str) {
    let (least, most) = (1e-3, 10.0);
    let step = covariance::step(gamma, w, least, most);
    assert!((least..=most).contains(&step), "{what}: step {step}");
    let radius = covariance::kernel_radius(gamma.trace(), x[0].abs(), 0.25, most);
    assert!((0.0..=most).contains(&radius), "{what}: radius {radius}");
    let bound = covariance::hessian_bound(x[1].abs(), gamma).to_upper();
    let filter = covariance::filter_precision(&gamma.within(Vec3::X, Vec3::Y));
    assert!(!bound.iter().chain(&[filter.xx, filter.xy, filter.yy]).any(|x| x.is_nan()), "{what}: {bound:?}");
}

/// Entries far beyond [`LIMIT`] and far below what has a normal `f32`: still positive semi-definite.
#[test]
fn huge_and_tiny_covariances_stay_positive_semi_definite() {
    let mut random = Random::new(8);
    for i in 0..COUNT {
        let mut a: Matrix = random.matrix();
        let largest = (0..4).fold(0.0_f64, |m, k| m.max(a[k][k])).max(1e-30);
        let size = if i % 2 == 0 { random.decades(12.0, 38.53) } else { random.decades(-44.0, -12.0) };
        a = map2(|i, j| (a[i][j] * size / largest).clamp(-f64::from(f32::MAX), f64::from(f32::MAX)));
        let a = symmetric(&a);
        let (d, lobe, cos) = (random.decades(-3.0, 12.0) as f32, random.sigma(), random.within(-1.0, 1.0) as f32);
        let mask = random.covariance2().times(random.decades(0.0, 30.0) as f32);
        let results = [
            ("travelled", a.travelled(d)),
            ("masked", a.masked(&mask)),
            ("scattered", a.scattered(cos, &lobe)),
            ("rotated", a.rotated(cos, (1.0 - cos * cos).sqrt())),
            ("scaled", a.scaled([d, 1.0 / d, cos, d])),
            ("combined", a.combined(d, &a.travelled(d), 1.0)),
        ];
        for (name, result) in results {
            let largest = |a: &Symmetric4| diagonal(a).iter().fold(0.0_f64, |m, x| m.max(*x));
            // What cancels leaves rounding in units of the input: of all of it where scattering brings it down.
            let before = if name == "scattered" { largest(&a) } else { largest(&a).min(f64::from(LIMIT)) };
            let most = largest(&result).max(before);
            // Subnormal numbers round by more than their last bit, and flights blow that up: a wave of 10¹⁰ metres.
            let tiny = 1e-20;
            let least = least_eigenvalue(rows(&result).map(|r| r.map(|x| x / most.max(1e-60))));
            assert!(least * most >= -4.0 * COVARIANCE * most - tiny, "{i}, {name}: {least:.2e}\n{a:?}\n{result:?}");
            assert_finite(&result.to_upper(), || format!("{i}, {name}: {a:?}"));
        }
    }
}

#[test]
fn absolute_values_and_inverses_are_what_they_say() {
    let mut random = Random::new(9);
    for i in 0..COUNT {
        let h = random.hessian().within(Vec3::X, Vec3::Y);
        let absolute = h.absolute();
        let size = f64::from(h.xx.abs() + h.yy.abs() + h.xy.abs());
        // |H| − H and |H| + H are both positive semi-definite, and |H|² = H².
        for sign in [1.0, -1.0] {
            let d = absolute.plus(&h.times(sign));
            let least = definiteness([[d.xx, d.xy], [d.xy, d.yy]].map(|r| r.map(f64::from)), [size; 2]);
            assert!(least >= -COVARIANCE, "{i}: {least:.2e} {h:?}");
        }
        let square = |a: &Symmetric2| {
            let [x, y, z] = [a.xx, a.xy, a.yy].map(f64::from);
            [x * x + y * y, y * (x + z), y * y + z * z]
        };
        let off = square(&h).iter().zip(square(&absolute)).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off <= 4.0 * COVARIANCE * size * size, "{i}: {off:.2e} {h:?}");

        let a = random.covariance2();
        let q = a.pseudo_inverse();
        let [a, q] = [&a, &q].map(|m| [[m.xx, m.xy], [m.xy, m.yy]].map(|r| r.map(f64::from)));
        // A Q A = A, as far as A's own rounding allows.
        let aq: [[f64; 2]; 2] =
            core::array::from_fn(|i| core::array::from_fn(|j| a[i][0] * q[0][j] + a[i][1] * q[1][j]));
        let aqa: [[f64; 2]; 2] =
            core::array::from_fn(|i| core::array::from_fn(|j| aq[i][0] * a[0][j] + aq[i][1] * a[1][j]));
        for j in 0..2 {
            for k in 0..2 {
                let correlated = a[0][1] * a[0][1] / (a[0][0] * a[1][1]).max(1e-300);
                let most = COVARIANCE * (8.0 + (1.0 / (1.0 - correlated).abs()).min(1e6)) * (a[0][0] + a[1][1]);
                assert!((aqa[j][k] - a[j][k]).abs() <= most, "{i}: {a:?} {q:?} {aqa:?}");
            }
        }
    }
}

/// What photons live through: flights, shadows, media, turns. Nothing negative, nothing that is no number.
#[test]
fn a_hundred_thousand_paths_of_six_scatterings_end_well() {
    let mut random = Random::new(10);
    let mut worst = 0.0_f64;
    for i in 0..COUNT {
        let start = random.direction();
        let spatial = 0.1 / random.decades(-3.0, 0.0).powi(2);
        let mut light = LightField {
            covariance: Symmetric4::separable(
                Symmetric2::diagonal(spatial as f32, if random.unit() < 0.3 { 0.0 } else { spatial as f32 }),
                if random.unit() < 0.5 { Symmetric2::ZERO } else { random.covariance2() },
            ),
            frame: random.frame(start),
        };
        let mut noise = [light.covariance.spatial, light.covariance.angular].map(|b| f64::from(b.trace()));
        let mut voxel = Voxel::EMPTY;
        for step in 0..6 {
            let d = random.decades(-2.0, 2.0) as f32;
            light = light.travelled(d);
            if random.unit() < 0.5 {
                let edge = random.direction() * random.decades(-1.0, 2.0) as f32;
                let [x, y, z] = edge.to_array();
                light = light.occluded(&Symmetric3::from_upper([x * x, x * y, x * z, y * y, y * z, z * z]));
            }
            if random.unit() < 0.5 {
                light = light.attenuated(&random.hessian(), d);
            }
            let phase = Phase::from(random.lobe());
            let out = random.turned(light.frame.w);
            // The largest variances so far: what cancels leaves rounding in units of them.
            let [x, p] = [light.covariance.spatial, light.covariance.angular].map(|b| f64::from(b.trace()));
            noise = [noise[0].max(x), (noise[1] + f64::from(d).powi(2) * noise[0]).max(p)];
            light = light.scattered(out, &phase);
            let upper = light.covariance.to_upper();
            assert!(upper.iter().all(|x| x.is_finite()), "{i}.{step}: {light:?}");
            assert!([0, 4, 7, 9].iter().all(|&k| upper[k] >= 0.0), "{i}.{step}: {light:?}");
            let least = definiteness(rows(&light.covariance), [noise[0], noise[0], noise[1], noise[1]]);
            assert!(least >= -COVARIANCE, "{i}.{step}: eigenvalue {least:.2e} {light:?}");
            worst = worst.min(least);
            voxel.add(&light, 1.0);
        }
        let gamma = voxel.covariance().unwrap().to_upper().map(f64::from);
        let [xx, xy, xz, yy, yz, zz] = gamma;
        let least = definiteness([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], [xx + yy + zz; 3]);
        assert!(least >= -COVARIANCE, "{i}: Γ {least:.2e} {gamma:?}");
    }
    println!("{COUNT} paths of 6 scatterings: no negative variance, no failure; least relative eigenvalue {worst:.1e}");
}

#[test]
fn lights_emit_sound_light_fields_in_all_directions() {
    let mut random = Random::new(11);
    let white = Spectrum::ONE;
    let texels: Vec<Spectrum> = (0..32).map(|i| Spectrum::splat(if i == 13 { 1e4 } else { (i % 3) as f32 })).collect();
    let (mut weights, mut column) = ([0.0; 32], [0.0; 4]);
    let map = EnvironmentMap::new(8, 4, &texels, &mut weights, &mut column, Mat3::IDENTITY).unwrap();
    let triangles =
        [Triangle { corners: [Vec3::ZERO, Vec3::X, Vec3::Y] }, Triangle { corners: [Vec3::X, Vec3::ONE, Vec3::Y] }];
    let mut table = [0.0; 2];
    let mesh = MeshLight::new(&triangles, &mut table, white).unwrap();
    let mut lights = vec![
        Light::Point(PointLight::new(Vec3::ZERO, white).unwrap()),
        Light::Sphere(SphereLight::new(Vec3::ZERO, 0.2, white).unwrap()),
        Light::Sphere(SphereLight::new(Vec3::ZERO, 1e-30, white).unwrap()),
        Light::Mesh(mesh),
        Light::Sun(Sun::new(Vec3::Y, white).unwrap()),
        Light::Constant(white),
        Light::Environment(&map),
        Light::Quad(QuadLight::new(Vec3::ZERO, Vec3::X * 1e-6, Vec3::Y * 1e3, white).unwrap()),
        Light::Quad(QuadLight::new(Vec3::ZERO, Vec3::X * 1e9, Vec3::Y * 1e9, white).unwrap()),
        Light::Quad(QuadLight::new(Vec3::ZERO, Vec3::X * 1e-7, Vec3::Y * 1e-7, white).unwrap()),
        Light::Quad(QuadLight::new(Vec3::ZERO, Vec3::new(1.0, 2.0, 0.0), Vec3::Y, white).unwrap()),
    ];
    for exponent in [0.0, 1.0, 1e3, 1e30] {
        lights.push(Light::Phong(PhongLight::new(Vec3::ZERO, Vec3::Z, exponent, white).unwrap()));
    }
    for (beam, cutoff) in [(0.0, 1e-6), (0.3, 0.3), (0.0, 0.5), (3.0, 3.1), (0.5, core::f32::consts::PI)] {
        lights.push(Light::Spot(SpotLight::new(Vec3::ZERO, Vec3::Z, beam, cutoff, white).unwrap()));
    }
    let special = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    for light in &lights {
        for i in 0..20_000 {
            let direction = if i < 6 {
                special[i]
            } else if i % 3 == 0 {
                (special[i % 6] + random.direction() * random.decades(-8.0, -1.0) as f32).normalize()
            } else {
                random.direction()
            };
            let normal = [None, Some(Vec3::Z), Some(direction), Some(random.direction())][i % 4];
            let radius = [0.01, 0.0, 1e-20, 1e20][i % 4];
            let field = emitted(light, &Ray::new(Vec3::ZERO, direction), normal, radius);
            assert_sound(&field.covariance, diagonal(&field.covariance), &format!("{light:?} {direction}"));
            assert!(field.covariance.to_upper().iter().all(|x| x.abs() <= LIMIT * 1.000_001), "{light:?}");
            assert_eq!(field.frame.w, direction);
        }
    }
}

#[test]
fn a_square_light_has_the_covariance_of_its_size_and_more_when_oblique() {
    let side = 0.4;
    let light = Light::Quad(QuadLight::new(Vec3::ZERO, Vec3::X * side, Vec3::Y * side, Spectrum::ONE).unwrap());
    let expected = 3.0 / (core::f32::consts::PI * side).powi(2);
    let mut last = 0.0;
    for angle in [0.0, 0.3, 0.6, 0.9, 1.2, 1.5] {
        let (sin, cos) = f32::sin_cos(angle);
        let field = emitted(&light, &Ray::new(Vec3::ZERO, Vec3::new(sin, 0.0, cos)), Some(Vec3::Z), 0.01);
        let along = field.turned_to(Vec3::X).covariance.spatial;
        assert!((along.yy / expected - 1.0).abs() < 1e-3, "across the tilt: {} {expected}", along.yy);
        // Foreshortened by the cosine, but never sharper than a hundredth of its side.
        let most = expected / (cos * cos + 1e-4);
        assert!((along.xx / most - 1.0).abs() < 1e-3, "{angle}: {} {most}", along.xx);
        assert!(along.xx > last, "{angle}");
        last = along.xx;
        assert_eq!(field.covariance.angular, Symmetric2::ZERO);
    }
    // A disc of radius ρ: 1/(π²ρ²), the variance of a disc being ρ²/4.
    let lamp = Light::Sphere(SphereLight::new(Vec3::ZERO, 0.1, Spectrum::ONE).unwrap());
    let field = emitted(&lamp, &Ray::new(Vec3::ZERO, Vec3::Z), None, 0.01);
    let expected = 1.0 / (core::f32::consts::PI * 0.1).powi(2);
    assert!((field.covariance.spatial.xx / expected - 1.0).abs() < 1e-5);
    // A spot varies most across its border, in the plane through its axis.
    let spot = Light::Spot(SpotLight::new(Vec3::ZERO, Vec3::Z, 0.4, 0.6, Spectrum::ONE).unwrap());
    let at = |angle: f32| {
        let (sin, cos) = angle.sin_cos();
        emitted(&spot, &Ray::new(Vec3::ZERO, Vec3::new(sin, 0.0, cos)), None, 0.01)
            .turned_to(Vec3::X)
            .covariance
            .angular
    };
    assert!(at(0.55).xx > 2.0 * at(0.2).xx && at(0.55).yy < 1e-3 * at(0.55).xx, "{:?} {:?}", at(0.55), at(0.2));
    // Phong lobes: as the one of a surface.
    let phong = Light::Phong(PhongLight::new(Vec3::ZERO, Vec3::Z, 50.0, Spectrum::ONE).unwrap());
    let field = emitted(&phong, &Ray::new(Vec3::ZERO, Vec3::Z), None, 0.01);
    assert_eq!(field.covariance.angular, operators::phong_lobe(50.0));
}
