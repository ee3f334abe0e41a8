//! A truth for fog that is many free paths deep: a picture of the box of `tests/acceptance/deep_fog.py` by walks of light from its lamp.
//!
//! ```text
//! deep_fog THICKNESS ALBEDO SECONDS SEED IMAGE.pfm
//! ```
//!
//! Path tracing has 20 to 80 % of noise there. These walks split on their way to the eye, by as much as light falls off with depth (Booth and Hendricks 1984), and each of their vertices is
//! connected to the eye. Nothing here comes from the library but random numbers, and only what this box needs is here.

use fogbow::sampling::{Generator, uniform};
use std::f64::consts::PI;
use std::io::Write;
use std::time::Instant;

type Triple = [f64; 3];

const SIDE: usize = 64;
const EYE: f64 = 4.0;
const FIELD: f64 = 36.0;

/// Where fog ends before the eye (m); elsewhere walls stand at 1 m.
const FRONT: f64 = 1.001;

/// Half the side of the lamp, its height and radiance.
const LAMP: (f64, f64, Triple) = (0.35, 0.995, [20.0, 18.0, 15.0]);

/// The block: its middle, half its size, how it is turned (degrees) and what it reflects.
const BLOCK: (Triple, Triple, f64, Triple) = ([0.3, -0.4, -0.25], [0.3, 0.6, 0.3], 25.0, [0.6, 0.6, 0.65]);

/// Free paths beyond which the eye is not asked.
const FARTHEST: f64 = 25.0;

/// A hair (m) by which walks start before a surface.
const HAIR: f64 = 1e-9;

/// Walks that one splits into at most.
const MOST_PARTS: f64 = 1000.0;

fn dot(a: Triple, b: Triple) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn times(a: Triple, b: Triple) -> Triple {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

fn along(at: Triple, towards: Triple, distance: f64) -> Triple {
    [0, 1, 2].map(|i| at[i] + towards[i] * distance)
}

/// From the world to the axes of the block, or back.
fn turned(v: Triple, back: bool) -> Triple {
    let (s, c) = BLOCK.2.to_radians().sin_cos();
    let s = if back { -s } else { s };
    [c * v[0] - s * v[2], v[1], s * v[0] + c * v[2]]
}

#[derive(Clone, Copy)]
struct Light {
    at: Triple,
    towards: Triple,
    power: Triple,
}

/// What light comes to.
enum Met {
    Fog,
    Surface {
        normal: Triple,
        reflectance: Triple,
    },
    /// The lamp, or the open.
    Nothing,
}

impl Light {
    /// How far it comes of `length`, and what to.
    fn flight(&self, length: f64) -> (f64, Met) {
        let Self { at, towards, .. } = *self;
        let (mut end, mut met) = (length, Met::Fog);
        for axis in 0..3 {
            let up = towards[axis] > 0.0;
            let is_open = axis == 2 && up;
            let wall = if is_open { FRONT } else { f64::from(if up { 1_i8 } else { -1 }) };
            let distance = ((wall - at[axis]) / towards[axis]).max(0.0);
            // NaN, of what lies in a wall and flies along it, is no wall that is met.
            if distance < end {
                let mut normal = [0.0; 3];
                normal[axis] = if up { -1.0 } else { 1.0 };
                let reflectance = match (axis, up) {
                    (0, false) => [0.63, 0.1, 0.08],
                    (0, true) => [0.14, 0.45, 0.1],
                    _ => [0.7; 3],
                };
                (end, met) = (distance, if is_open { Met::Nothing } else { Met::Surface { normal, reflectance } });
            }
        }
        let (half, height, _) = LAMP;
        let distance = (height - at[1]) / towards[1];
        let above = along(at, towards, distance);
        if distance > HAIR && distance < end && above[0].abs() < half && above[2].abs() < half {
            (end, met) = (distance, Met::Nothing);
        }
        let (middle, size, _, reflectance) = BLOCK;
        let (from, to) = (turned(along(at, middle, -1.0), false), turned(towards, false));
        let (mut near, mut far, mut face) = (f64::NEG_INFINITY, f64::INFINITY, 0);
        for axis in 0..3 {
            let [a, b] = [-size[axis], size[axis]].map(|x| (x - from[axis]) / to[axis]);
            if a.min(b) > near {
                (near, face) = (a.min(b), axis);
            }
            far = far.min(a.max(b));
        }
        if near < far && near > HAIR && near < end {
            let mut normal = [0.0; 3];
            normal[face] = -to[face].signum();
            (end, met) = (near, Met::Surface { normal: turned(normal, true), reflectance });
        }
        (end, met)
    }
}

struct Walks {
    rng: Generator,
    /// Extinction (m⁻¹), albedo, and how light falls off with depth (m⁻¹).
    extinction: f64,
    albedo: f64,
    falls: f64,
    film: Vec<f64>,
}

impl Walks {
    fn random(&mut self) -> f64 {
        // Two of 24 bits each: lengths of many free paths are asked for.
        let [high, low] = [(); 2].map(|()| f64::from(uniform(&mut self.rng)));
        high + (low + 0.5_f64.powi(25)) * 0.5_f64.powi(24)
    }

    fn sphere(&mut self) -> Triple {
        let (z, angle) = (2.0 * self.random() - 1.0, 2.0 * PI * self.random());
        let r = (1.0 - z * z).sqrt();
        [r * angle.cos(), r * angle.sin(), z]
    }

    /// By the cosine about a normal: a point of the sphere that stands on it.
    fn above(&mut self, normal: Triple) -> Triple {
        let v = along(normal, self.sphere(), 1.0 - HAIR);
        let length = dot(v, v).sqrt();
        v.map(|x| x / length)
    }

    /// Adds what a vertex sends to the eye: `scattered(direction)` is its part per steradian.
    fn show(&mut self, at: Triple, power: Triple, scattered: impl Fn(Triple) -> f64) {
        let apart = along([0.0, 0.0, EYE], at, -1.0);
        let square = dot(apart, apart);
        let to_eye = apart.map(|x| x / square.sqrt());
        let depth = (FRONT - at[2]) / to_eye[2];
        let exit = along(at, to_eye, depth);
        if depth < 0.0 || exit[0].abs() > FRONT || exit[1].abs() > FRONT || self.extinction * depth > FARTHEST {
            return;
        }
        let tangent = (0.5 * FIELD).to_radians().tan();
        let pixel = |x: f64| (x / (EYE - at[2]) / tangent + 1.0) * 0.5 * SIDE as f64;
        let (x, y) = (pixel(at[0]), pixel(-at[1]));
        let is_seen = |x: f64| x >= 0.0 && x < SIDE as f64;
        if !(is_seen(x) && is_seen(y)) {
            return;
        }
        let angle = (2.0 * tangent / SIDE as f64).powi(2) * to_eye[2].powi(3);
        let seen = scattered(to_eye) * (-self.extinction * depth).exp() / (square * angle);
        let first = (y as usize * SIDE + x as usize) * 3;
        // A hair less, so that the open front is not met.
        let sight = Light { at, towards: to_eye, power };
        if !matches!(sight.flight(depth - HAIR), (_, Met::Fog)) {
            return;
        }
        self.film[first..first + 3].iter_mut().zip(power).for_each(|(sum, power)| *sum += seen * power);
    }

    /// Power that light should have at a depth, in steps of two.
    fn usual(&self, at: Triple) -> f64 {
        let steps = |z: f64| (self.falls * (z - 1.0) / 2.0_f64.ln()).floor();
        lamp_power()[0] * 2.0_f64.powf(steps(0.0) - steps(at[2]))
    }

    /// All that one start at the lamp brings.
    fn walk(&mut self) {
        let (half, height, _) = LAMP;
        let [x, z] = [(); 2].map(|()| (2.0 * self.random() - 1.0) * half);
        let (at, down) = ([x, height, z], [0.0, -1.0, 0.0]);
        self.show(at, lamp_power(), |to_eye| dot(to_eye, down).max(0.0) / PI);
        let mut waiting = vec![Light { at, towards: self.above(down), power: lamp_power() }];
        while let Some(mut light) = waiting.pop() {
            loop {
                let length = -self.random().ln() / self.extinction;
                let (distance, met) = light.flight(length);
                light.at = along(light.at, light.towards, distance);
                match met {
                    Met::Nothing => break,
                    Met::Fog => {
                        light.power = light.power.map(|power| power * self.albedo);
                        self.show(light.at, light.power, |_| 0.25 / PI);
                        light.towards = self.sphere();
                    }
                    Met::Surface { normal, reflectance } => {
                        light.power = times(light.power, reflectance);
                        light.at = along(light.at, normal, HAIR);
                        self.show(light.at, light.power, |to_eye| dot(to_eye, normal).max(0.0) / PI);
                        light.towards = self.above(normal);
                    }
                }
                let share = light.power.into_iter().fold(0.0, f64::max) / self.usual(light.at);
                if share < 0.5 {
                    if self.random() > share {
                        break;
                    }
                    light.power = light.power.map(|power| power / share);
                } else if share > 2.0 {
                    let parts = share.floor().min(MOST_PARTS);
                    light.power = light.power.map(|power| power / parts);
                    waiting.extend((1..parts as usize).map(|_| light));
                }
            }
        }
    }
}

fn lamp_power() -> Triple {
    let (half, _, radiance) = LAMP;
    radiance.map(|radiance| radiance * PI * 4.0 * half * half)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [thickness, albedo, seconds, seed, image] = &arguments[..] else {
        return Err("usage: deep_fog THICKNESS ALBEDO SECONDS SEED IMAGE.pfm".into());
    };
    let [thickness, albedo, seconds] = [thickness, albedo, seconds].map(|word| word.parse::<f64>());
    let (extinction, albedo, seconds) = (0.5 * thickness?, albedo?, seconds?);
    // Of diffusion.
    let falls = extinction * (3.0 * (1.0 - albedo)).sqrt();
    let (rng, film) = (Generator::new(seed.parse()?), vec![0.0; 3 * SIDE * SIDE]);
    let mut walks = Walks { rng, extinction, albedo, falls, film };
    let (start, mut count) = (Instant::now(), 0.0);
    while start.elapsed().as_secs_f64() < seconds {
        walks.walk();
        count += 1.0;
    }
    let mut file = std::io::BufWriter::new(std::fs::File::create(image)?);
    write!(file, "PF\n{SIDE} {SIDE}\n-1.0\n")?;
    for value in walks.film.chunks(3 * SIDE).rev().flatten() {
        file.write_all(&((value / count) as f32).to_le_bytes())?;
    }
    println!("{count} walks");
    Ok(file.flush()?)
}
