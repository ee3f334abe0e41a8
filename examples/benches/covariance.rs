//! Nanoseconds per operator on covariances of light fields, beside the same written with a general matrix crate:
//! `cargo bench -p fogbow-examples --features benches --bench covariance -- [--quick]`
//!
//! The other is `nalgebra`, in `f32`: products of 4×4 matrices and their dense inverse, as the formulas stand in
//! Belcour et al. 2014. Both work on the same covariances, regular ones, since a dense inverse knows no others, and
//! are measured in turns; times are those of the CPU, the least of all turns. Results are compared before.
//!
//! The last lines are paths of six scatterings, with flights, shadows and media between, from lights whose
//! covariance is singular: what it costs per scattering, and how many of the other's inverses fail.

use core::hint::black_box;

use cpu_time::ThreadTime;
use fogbow::covariance::operators::PER_HESSIAN;
use fogbow::covariance::{LightField, Patch, Symmetric4, phase_covariance};
use fogbow::math::{Frame, Symmetric2, Symmetric3, Vec2, Vec3};
use fogbow::phase::{Deflection, Lobe, Phase};
use fogbow::sampling::warp::uniform_sphere;
use fogbow::surface::Surface;
use nalgebra::{Matrix2, Matrix4, Vector4};

/// Covariances that are asked in turn: they fit the first cache with what else an operator needs.
const COUNT: usize = 256;

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
    fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }
    fn direction(&mut self) -> Vec3 {
        uniform_sphere(Vec2::new(self.unit(), self.unit())).normalize()
    }
    fn frame(&mut self, w: Vec3) -> Frame {
        let (around, (sin, cos)) = (Frame::around(w), self.within(0.0, 6.3).sin_cos());
        let u = (around.u * cos + around.v * sin).normalize();
        Frame { u, v: w.cross(u), w }
    }
}

/// What an operator is given, in both forms.
struct Case {
    ours: Symmetric4,
    theirs: Matrix4<f32>,
    other: Symmetric4,
    other_theirs: Matrix4<f32>,
    lobe: Symmetric2,
    lobe_theirs: Matrix2<f32>,
    hessian: Symmetric2,
    distance: f32,
    cos: f32,
    sin: f32,
}

fn dense(a: &Symmetric4) -> Matrix4<f32> {
    let u = a.to_upper();
    Matrix4::new(u[0], u[1], u[2], u[3], u[1], u[4], u[5], u[6], u[2], u[5], u[7], u[8], u[3], u[6], u[8], u[9])
}

fn dense2(a: &Symmetric2) -> Matrix2<f32> {
    Matrix2::new(a.xx, a.xy, a.xy, a.yy)
}

/// A regular covariance.
fn covariance(random: &mut Random) -> Symmetric4 {
    let g = Matrix4::from_fn(|_, _| random.within(-1.0, 1.0));
    let a = g * g.transpose() + Matrix4::identity() * 0.1;
    let upper = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
    Symmetric4::from_upper(upper.map(|at| a[at]))
}

fn cases() -> Vec<Case> {
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut case = || {
        let (ours, other) = (covariance(&mut random), covariance(&mut random));
        let g = random.within(0.2, 0.9);
        let lobe =
            phase_covariance(&Phase::from(Lobe::HenyeyGreenstein { g }), Deflection::from_cos(random.within(0.5, 1.0)));
        let hessian = Symmetric2::new(random.within(-3.0, 3.0), random.within(-3.0, 3.0), random.within(-3.0, 3.0));
        let (sin, cos) = random.within(0.1, 1.4).sin_cos();
        Case {
            theirs: dense(&ours),
            other_theirs: dense(&other),
            lobe_theirs: dense2(&lobe),
            ours,
            other,
            lobe,
            hessian,
            distance: random.within(0.1, 2.0),
            cos,
            sin,
        }
    };
    (0..COUNT).map(|_| case()).collect()
}

/// `[[I, b I], [c, I]]`-like matrices and diagonals, as the formulas have them.
fn travel(d: f32) -> Matrix4<f32> {
    let mut t = Matrix4::identity();
    (t[(0, 2)], t[(1, 3)]) = (-d, -d);
    t
}

fn turn(cos: f32, sin: f32) -> Matrix4<f32> {
    Matrix4::new(cos, -sin, 0.0, 0.0, sin, cos, 0.0, 0.0, 0.0, 0.0, cos, -sin, 0.0, 0.0, sin, cos)
}

fn spatial(a: &Matrix2<f32>) -> Matrix4<f32> {
    let mut m = Matrix4::zeros();
    m.fixed_view_mut::<2, 2>(0, 0).copy_from(a);
    m
}

/// `((V Σ V)⁻¹ + [[0, 0], [0, σ⁻¹]])⁻¹`; `None` where an inverse fails.
fn scattered(sigma: &Matrix4<f32>, cos: f32, lobe: &Matrix2<f32>) -> Option<Matrix4<f32>> {
    let v = Matrix4::from_diagonal(&Vector4::new(cos, 1.0, 1.0, 1.0));
    let mut inverse = (v * sigma * v).try_inverse()?;
    let added = inverse.fixed_view::<2, 2>(2, 2) + lobe.try_inverse()?;
    inverse.fixed_view_mut::<2, 2>(2, 2).copy_from(&added);
    inverse.try_inverse()
}

fn curvature(k: &Matrix2<f32>, cos: f32) -> Matrix4<f32> {
    let mut m = Matrix4::identity();
    let n = k * Matrix2::new(1.0, 0.0, 0.0, cos);
    m.fixed_view_mut::<2, 2>(0, 2).copy_from(&(-n));
    m
}

fn diagonal(x: [f32; 4]) -> Matrix4<f32> {
    Matrix4::from_diagonal(&x.into())
}

/// The result and its CPU time (s).
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = ThreadTime::now();
    let result = black_box(work());
    (result, start.elapsed().as_secs_f64())
}

struct Bench {
    cases: Vec<Case>,
    rounds: usize,
    turns: usize,
}

impl Bench {
    /// Nanoseconds of both, the least of all turns.
    fn times<A, B>(&self, ours: impl Fn(&Case) -> A, theirs: impl Fn(&Case) -> B) -> [f64; 2] {
        let mut best = [f64::INFINITY; 2];
        for _ in 0..self.turns {
            let times = [self.time(&ours), self.time(&theirs)];
            for (best, time) in best.iter_mut().zip(times) {
                *best = best.min(time);
            }
        }
        best
    }

    /// Nanoseconds; results go where a caller would keep them.
    fn time<T>(&self, f: impl Fn(&Case) -> T) -> f64 {
        let mut results: Vec<T> = self.cases.iter().map(&f).collect();
        let ((), time) = timed(|| {
            for _ in 0..self.rounds {
                for (result, case) in results.iter_mut().zip(black_box(&self.cases)) {
                    *result = f(case);
                }
                black_box(&mut results);
            }
        });
        time * 1e9 / (self.rounds * COUNT) as f64
    }

    fn operator(&self, name: &str, ours: impl Fn(&Case) -> Symmetric4, theirs: impl Fn(&Case) -> Matrix4<f32>) {
        for case in &self.cases {
            let (a, b) = (dense(&ours(case)), theirs(case));
            let off = (a - b).abs().max() / b.abs().max();
            assert!(off < 1e-3, "{name}: {off} apart\n{a}{b}");
        }
        let [a, b] = self.times(ours, theirs);
        println!("{name:24} {a:>8.1} {b:>9.1} {:>7.2}", b / a);
    }
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick");
    let bench = Bench { cases: cases(), rounds: if quick { 200 } else { 2_000 }, turns: if quick { 5 } else { 15 } };
    println!("{:24} {:>8} {:>9} {:>7}", "ns", "fogbow", "nalgebra", "ratio");
    bench.operator(
        "travel",
        |c| c.ours.travelled(c.distance),
        |c| {
            let t = travel(c.distance);
            t.transpose() * c.theirs * t
        },
    );
    bench.operator("occlusion", |c| c.ours.masked(&c.lobe), |c| c.theirs + spatial(&c.lobe_theirs));
    bench.operator(
        "attenuation",
        |c| c.ours.attenuated(&c.hessian, c.distance),
        |c| {
            let eigen = dense2(&c.hessian).symmetric_eigen();
            let absolute =
                eigen.eigenvectors * Matrix2::from_diagonal(&eigen.eigenvalues.abs()) * eigen.eigenvectors.transpose();
            c.theirs + spatial(&(absolute * (c.distance * PER_HESSIAN)))
        },
    );
    bench.operator(
        "scattering",
        |c| c.ours.scattered(c.cos, &c.lobe),
        |c| scattered(&c.theirs, c.cos, &c.lobe_theirs).expect("regular"),
    );
    bench.operator(
        "lobe of a surface",
        |c| c.ours.reflected_in_lobe(&c.lobe),
        |c| scattered(&c.theirs, 1.0, &c.lobe_theirs).expect("regular"),
    );
    bench.operator(
        "turn",
        |c| c.ours.rotated(c.cos, c.sin),
        |c| {
            let r = turn(c.cos, c.sin);
            r.transpose() * c.theirs * r
        },
    );
    bench.operator(
        "projection",
        |c| c.ours.projected(c.cos),
        |c| {
            let s = diagonal([c.cos, 1.0, 1.0, 1.0]);
            s * c.theirs * s
        },
    );
    bench.operator(
        "curvature",
        |c| c.ours.curved(&c.hessian, c.cos),
        |c| {
            let m = curvature(&dense2(&c.hessian), c.cos);
            m * c.theirs * m.transpose()
        },
    );
    bench.operator(
        "refraction",
        |c| c.ours.refracted(&c.hessian, (c.cos, 0.8), (1.0, 1.5)),
        |c| {
            let k = dense2(&c.hessian);
            let ratio: f32 = 1.0 / 1.5;
            let step = diagonal([1.0 / 0.8, 1.0, 1.0, 1.0])
                * curvature(&-k, 0.8)
                * diagonal([1.0, 1.0, 0.8 / (ratio * c.cos), 1.0 / ratio])
                * curvature(&k, c.cos)
                * diagonal([c.cos, 1.0, 1.0, 1.0]);
            step * c.theirs * step.transpose()
        },
    );
    bench.operator(
        "mixing",
        |c| c.ours.combined(c.cos, &c.other, c.sin),
        |c| (c.theirs * c.cos + c.other_theirs * c.sin) / (c.cos + c.sin),
    );
    bench.operator(
        "slice",
        |c| Symmetric4::separable(c.ours.slice(), Symmetric2::ZERO),
        |c| {
            let inverse = c.theirs.try_inverse().expect("regular");
            spatial(&inverse.fixed_view::<2, 2>(0, 0).clone_owned().try_inverse().expect("regular"))
        },
    );
    world(&bench);
    paths(quick);
}

/// Operators in world coordinates, with their frames: no counterpart.
fn world(bench: &Bench) {
    let mut random = Random(7);
    let white = fogbow::spectrum::Spectrum::ONE;
    let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.8 });
    let curvature = Symmetric3::embedded(&Symmetric2::diagonal(0.4, 0.7), Vec3::X, Vec3::Y);
    let patch = Patch { curvature, ..Patch::flat(Vec3::Z) };
    let mirror = Surface::Mirror { reflectance: white };
    let fields: Vec<(LightField, Vec3)> = bench
        .cases
        .iter()
        .map(|case| {
            let w = random.direction();
            let w = Vec3::new(w.x, w.y, -w.z.abs());
            (LightField { covariance: case.ours, frame: random.frame(w) }, random.direction())
        })
        .collect();
    let time = |name: &str, f: &dyn Fn(&LightField, Vec3) -> LightField| {
        let mut best = f64::INFINITY;
        for _ in 0..bench.turns {
            let ((), time) = timed(|| {
                for _ in 0..bench.rounds / 4 {
                    for (light, out) in black_box(&fields) {
                        black_box(f(light, *out));
                    }
                }
            });
            best = best.min(time * 1e9 / (bench.rounds / 4 * COUNT) as f64);
        }
        println!("{name:24} {best:>8.1}");
    };
    time("scattered, in the world", &|light, out| light.scattered(out, &phase));
    time("reflected, in the world", &|light, _| {
        let w = light.frame.w;
        light.reflected(Vec3::new(w.x, w.y, -w.z), &patch, &mirror)
    });
}

/// What happens along a path, drawn beforehand: six of these.
struct Step {
    distance: f32,
    edge: Option<Symmetric3>,
    hessian: Option<Symmetric3>,
    phase: Phase,
    out: Vec3,
}

/// Paths of six scatterings, from small lights and slits.
fn paths(quick: bool) {
    let count = if quick { 10_000 } else { 100_000 };
    let mut random = Random(0x5DEE_CE66_D1CE_4E5B);
    let walks: Vec<(LightField, [Step; 6])> = (0..count)
        .map(|_| {
            let size = 0.1 / random.within(0.001, 0.3).powi(2);
            let slit = if random.unit() < 0.3 { 0.0 } else { size };
            let w = random.direction();
            let light = LightField {
                covariance: Symmetric4::separable(Symmetric2::diagonal(size, slit), Symmetric2::ZERO),
                frame: random.frame(w),
            };
            let steps = core::array::from_fn(|_| {
                let mut square = || {
                    let [x, y, z] = (random.direction() * random.within(0.1, 30.0)).to_array();
                    Symmetric3::from_upper([x * x, x * y, x * z, y * y, y * z, z * z])
                };
                let (edge, hessian) = (square(), square());
                Step {
                    distance: random.within(0.01, 10.0),
                    edge: (random.unit() < 0.5).then_some(edge),
                    hessian: (random.unit() < 0.5).then_some(hessian),
                    phase: Phase::from(Lobe::HenyeyGreenstein { g: random.within(0.0, 0.95) }),
                    out: random.direction(),
                }
            });
            (light, steps)
        })
        .collect();
    let walk = |(light, steps): &(LightField, [Step; 6])| {
        let mut light = *light;
        for step in steps {
            light = light.travelled(step.distance);
            if let Some(edge) = &step.edge {
                light = light.occluded(edge);
            }
            if let Some(hessian) = &step.hessian {
                light = light.attenuated(hessian, step.distance);
            }
            light = light.scattered(step.out, &step.phase);
        }
        light.covariance
    };
    let walk_dense = |(light, steps): &(LightField, [Step; 6])| {
        let (mut sigma, mut frame) = (dense(&light.covariance), light.frame);
        for step in steps {
            let t = travel(step.distance);
            sigma = t.transpose() * sigma * t;
            if let Some(edge) = &step.edge {
                sigma += spatial(&dense2(&edge.within(frame.u, frame.v)));
            }
            if let Some(hessian) = &step.hessian {
                let hessian = hessian.within(frame.u, frame.v).absolute().times(step.distance * PER_HESSIAN);
                sigma += spatial(&dense2(&hessian));
            }
            let v = frame.w.cross(step.out).normalize();
            let u = v.cross(frame.w);
            let r = turn(frame.u.dot(u), frame.v.dot(u));
            sigma = r.transpose() * sigma * r;
            let deflection = fogbow::phase::deflection(-frame.w, step.out);
            let lobe = dense2(&phase_covariance(&step.phase, deflection));
            sigma = scattered(&sigma, deflection.cos, &lobe)?;
            frame = Frame { u: v.cross(step.out), v, w: step.out };
        }
        Some(sigma)
    };
    let is_sound = |d: [f32; 4]| d.iter().all(|x| *x >= 0.0 && x.is_finite());
    let mut bad = 0;
    for path in &walks {
        let upper = walk(path).to_upper();
        bad += usize::from(!is_sound([upper[0], upper[4], upper[7], upper[9]]));
    }
    let (mut failed, mut negative) = (0, 0);
    for path in &walks {
        match walk_dense(path) {
            None => failed += 1,
            Some(a) => negative += usize::from(!is_sound([a[(0, 0)], a[(1, 1)], a[(2, 2)], a[(3, 3)]])),
        }
    }
    let mut best = [f64::INFINITY; 2];
    for _ in 0..5 {
        let times = [
            timed(|| {
                walks.iter().for_each(|w| {
                    black_box(walk(w));
                })
            })
            .1,
            timed(|| {
                walks.iter().for_each(|w| {
                    black_box(walk_dense(w));
                })
            })
            .1,
        ];
        for i in 0..2 {
            best[i] = best[i].min(times[i] * 1e9 / (6 * count) as f64);
        }
    }
    println!("{:24} {:>8.1} {:>9.1} {:>7.2}", "path, per scattering", best[0], best[1], best[1] / best[0]);
    println!("of {count} paths of 6 scatterings: fogbow {bad} negative or not finite;");
    println!("nalgebra {negative} negative or not finite, {failed} ended by an inverse that failed");
}
