//! Round forms as triangles: where a light, an instance or a curve needs them.

use core::f64::consts::PI;

use fogbow::math::{Vec2, Vec3};

use super::Mesh;
use crate::transform::{Transform, cross, dot, normalized, to_vec3};

/// Sides of a circle.
const AROUND: u32 = 96;

impl Mesh {
    /// The unit disc at z = 0, normal +z; with as much area as the disc.
    #[must_use]
    pub fn disc(to_world: &Transform) -> Self {
        let turn = 2.0 * PI / f64::from(AROUND);
        // A polygon through points of the circle has a smaller area.
        let radius = (turn / turn.sin()).sqrt();
        let mut mesh = Self { vertices: vec![to_vec3(to_world.point([0.0; 3]))], ..Self::default() };
        for i in 0..AROUND {
            let (sin, cos) = (f64::from(i) * turn).sin_cos();
            mesh.vertices.push(to_vec3(to_world.point([radius * cos, radius * sin, 0.0])));
            mesh.triangles.push([0, i + 1, (i + 1) % AROUND + 1]);
        }
        mesh.mirrored(to_world)
    }

    /// The unit sphere, normals outwards.
    #[must_use]
    pub fn ball(to_world: &Transform) -> Self {
        let down = AROUND / 2;
        let at = |i: u32, j: u32| {
            let (theta, phi) = (PI * f64::from(j) / f64::from(down), 2.0 * PI * f64::from(i) / f64::from(AROUND));
            [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]
        };
        let uv = |i: u32, j: u32| [f64::from(i) / f64::from(AROUND), f64::from(j) / f64::from(down)];
        let mut mesh = Self::patch(AROUND, down, to_world, |i, j| (at(i, j), at(i, j), uv(i, j)));
        // As far outside as inside, in the mean over the area.
        let area: f64 = mesh.triangles.iter().map(|t| twice_area(mesh.corners(*t))).sum();
        let true_area = Self::patch(4 * AROUND, 4 * down, to_world, |i, j| {
            let (theta, phi) = (PI * f64::from(j) / f64::from(4 * down), PI * f64::from(i) / f64::from(2 * AROUND));
            ([theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()], [0.0; 3], [0.0; 2])
        });
        let true_area: f64 = true_area.triangles.iter().map(|t| twice_area(true_area.corners(*t))).sum();
        let grown = (true_area / area).sqrt();
        let centre = to_vec3(to_world.column(3));
        mesh.vertices.iter_mut().for_each(|v| *v = centre + (*v - centre) * grown as f32);
        mesh.mirrored(to_world)
    }

    /// The open cylinder around the z axis, of radius 1 from z = 0 to z = 1, normals outwards.
    #[must_use]
    pub fn cylinder(to_world: &Transform) -> Self {
        let turn = 2.0 * PI / f64::from(AROUND);
        // Sides of the polygon as long as their arcs.
        let radius = 0.5 * turn / (0.5 * turn).sin();
        let mesh = Self::patch(AROUND, 1, to_world, |i, j| {
            let (sin, cos) = (f64::from(i) * turn).sin_cos();
            let z = 1.0 - f64::from(j);
            ([radius * cos, radius * sin, z], [cos, sin, 0.0], [f64::from(i) / f64::from(AROUND), z])
        });
        mesh.mirrored(to_world)
    }

    /// The unit sphere with so many sides around and half as many down, and as much area.
    pub(super) fn bead(sides: u32) -> Self {
        let down = sides / 2;
        let at = |i: u32, j: u32| {
            let (theta, phi) = (PI * f64::from(j) / f64::from(down), 2.0 * PI * f64::from(i) / f64::from(sides));
            [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]
        };
        let mut mesh = Self::patch(sides, down, &Transform::IDENTITY, |i, j| (at(i, j), at(i, j), [0.0; 2]));
        let area: f64 = 0.5 * mesh.triangles.iter().map(|t| twice_area(mesh.corners(*t))).sum::<f64>();
        let grown = (4.0 * PI / area).sqrt() as f32;
        mesh.vertices.iter_mut().for_each(|v| *v *= grown);
        mesh
    }

    /// A tube of so many sides along points with radii, with texture coordinates around and along; its cross-sections are as long around as circles, so it is as wide
    /// in the mean.
    #[must_use]
    pub fn tube(points: &[([f64; 3], f64)], sides: u32) -> Self {
        let mut mesh = Self::default();
        if points.len() < 2 {
            return mesh;
        }
        let (mut side, mut turn) = ([1.0, 0.0, 0.0], 0.0);
        let half = PI / f64::from(sides);
        let wide = half / half.sin();
        for (k, (point, radius)) in points.iter().enumerate() {
            let before = points[k.saturating_sub(1)];
            let after = points[(k + 1).min(points.len() - 1)];
            let along = [0, 1, 2].map(|i| after.0[i] - before.0[i]);
            let taper = (after.1 - before.1) / dot(along, along).sqrt();
            let along = normalized(along).unwrap_or([0.0, 0.0, 1.0]);
            // The cross-section is carried along, so that it does not twist.
            let across = [0, 1, 2].map(|i| side[i] - along[i] * dot(side, along));
            let other = if along[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
            side = normalized(across).or_else(|| normalized(cross(along, other))).unwrap_or(side);
            let up = cross(along, side);
            // Where the cross-section begins, in turns from where Mitsuba's does. Whole turns are added so that neighbouring
            // rings are near each other, or the texture would run backwards between them.
            let found = from_guide(along, side);
            turn = found + if k == 0 { 0.0 } else { f64::round(turn - found) };
            for i in 0..=sides {
                let (sin, cos) = (2.0 * PI * f64::from(i) / f64::from(sides)).sin_cos();
                let out = [0, 1, 2].map(|axis| side[axis] * cos + up[axis] * sin);
                mesh.vertices.push(to_vec3([0, 1, 2].map(|axis| point[axis] + out[axis] * radius * wide)));
                // Leaning back where it becomes wider.
                let normal = normalized([0, 1, 2].map(|axis| out[axis] - taper * along[axis]));
                mesh.normals.push(to_vec3(normal.unwrap_or(out)));
                let v = k as f32 / (points.len() - 1) as f32;
                mesh.texcoords.push(Vec2::new(turn as f32 + i as f32 / sides as f32, v));
            }
        }
        for k in 0..points.len() as u32 - 1 {
            for i in 0..sides {
                let (low, high) = (k * (sides + 1) + i, (k + 1) * (sides + 1) + i);
                mesh.triangles.extend([[low, low + 1, high + 1], [low, high + 1, high]]);
            }
        }
        mesh
    }

    /// Adds the triangles of another.
    pub fn append(&mut self, other: &Self) {
        let base = self.vertices.len() as u32;
        self.vertices.extend(&other.vertices);
        self.normals.extend(&other.normals);
        self.texcoords.extend(&other.texcoords);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
    }

    /// A grid of points with normals and texture coordinates.
    fn patch(
        across: u32,
        down: u32,
        to_world: &Transform,
        at: impl Fn(u32, u32) -> ([f64; 3], [f64; 3], [f64; 2]),
    ) -> Self {
        let upright = to_world.inverse().unwrap_or(Transform::IDENTITY).transposed();
        let mut mesh = Self::default();
        for j in 0..=down {
            for i in 0..=across {
                let (point, normal, uv) = at(i, j);
                mesh.vertices.push(to_vec3(to_world.point(point)));
                mesh.normals.push(to_vec3(normalized(upright.point(normal)).unwrap_or_default()));
                mesh.texcoords.push(Vec2::from_array(uv.map(|c| c as f32)));
            }
        }
        for j in 0..down {
            for i in 0..across {
                let (a, b) = (j * (across + 1) + i, (j + 1) * (across + 1) + i);
                mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
            }
        }
        mesh
    }

    /// With triangles that face outwards after a mirror image, too.
    fn mirrored(mut self, to_world: &Transform) -> Self {
        if to_world.determinant() < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        self
    }
}

fn twice_area([a, b, c]: [Vec3; 3]) -> f64 {
    f64::from((b - a).cross(c - a).length())
}

/// Turns around an axis to a direction across it, from where Mitsuba's curves begin to count: `z` across the axis is a quarter of a turn.
fn from_guide(axis: [f64; 3], direction: [f64; 3]) -> f64 {
    let guide = [0.0, 0.0, 1.0];
    let across = [0, 1, 2].map(|i| guide[i] - axis[i] * dot(axis, guide));
    let quarter = normalized(across).unwrap_or([0.0, 1.0, 0.0]);
    f64::atan2(dot(quarter, direction), dot(cross(quarter, axis), direction)) / (2.0 * PI)
}
