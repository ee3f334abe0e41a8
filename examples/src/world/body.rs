//! Bodies of any form: closed meshes, as containers of media.

use std::collections::HashMap;

use fogbow::math::{Bounds, Ray, Vec3};

use super::triangles::Triangles;
use crate::mesh::{Mesh, has_area};
use crate::transform::{Transform, to_array};

/// Rays look for the next crossing this far behind the last, relative to the coordinates: 16 roundings.
const BEHIND: f32 = 16.0 * f32::EPSILON;

/// A closed mesh: what is inside, and where rays enter and leave.
#[derive(Debug)]
pub struct Body {
    corners: Vec<[Vec3; 3]>,
    tree: Triangles,
    bounds: Bounds,
    is_inside_out: bool,
}

impl Body {
    /// The body that a mesh encloses, with its normals outwards.
    ///
    /// # Errors
    /// In words: a mesh that is not closed.
    pub fn new(mesh: &Mesh) -> Result<Self, String> {
        let mut corners: Vec<[Vec3; 3]> =
            mesh.triangles.iter().map(|t| mesh.corners(*t)).filter(|c| has_area(*c)).collect();
        let open = open_edges(mesh);
        if open > 0 {
            return Err(format!("its mesh is not closed: {open} edges do not join two triangles"));
        }
        // Six times the signed volume.
        let centre = mesh.bounds().centre();
        let volume: f64 = corners
            .iter()
            .map(|c| {
                let [a, b, c] = c.map(|p| to_array(p - centre));
                crate::transform::dot(a, crate::transform::cross(b, c))
            })
            .sum();
        let is_inside_out = volume < 0.0;
        if is_inside_out {
            corners.iter_mut().for_each(|c| c.swap(1, 2));
        }
        let tree = Triangles::new(&corners);
        Ok(Self { bounds: Bounds::of(corners.iter().flatten().copied()), corners, tree, is_inside_out })
    }

    /// Whether normals of the mesh point inwards.
    #[must_use]
    pub fn is_inside_out(&self) -> bool {
        self.is_inside_out
    }

    /// The smallest box around it (m).
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Whether a point lies inside.
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        if point.cmplt(self.bounds.min).any() || point.cmpgt(self.bounds.max).any() {
            return false;
        }
        // Along no axis, and in no plane that scenes are built of.
        let ray = Ray::new(point, Vec3::new(0.482_103_9, 0.621_774_1, 0.617_211_5).normalize());
        self.span(&ray, 0.0).0
    }

    /// Whether the ray is inside at distance `from` (m), and how far this remains so.
    #[must_use]
    pub fn span(&self, ray: &Ray, from: f32) -> (bool, f32) {
        match self.crossing(ray, from) {
            Some((distance, normal)) => (normal.dot(ray.direction) > 0.0, distance),
            None => (false, f32::INFINITY),
        }
    }

    /// The next crossing behind `from`: its distance (m) and the outward normal (unit).
    #[must_use]
    pub fn crossing(&self, ray: &Ray, from: f32) -> Option<(f32, Vec3)> {
        let (mut near, mut far) = (from, f32::INFINITY);
        for axis in 0..3 {
            let inverse = 1.0 / ray.direction[axis];
            let [a, b] = [self.bounds.min[axis], self.bounds.max[axis]].map(|side| (side - ray.origin[axis]) * inverse);
            // What is no number (a ray in the plane of a face) decides nothing.
            near = near.max(a.min(b) * (1.0 - 1e-6) - 1e-30);
            far = far.min(a.max(b) * (1.0 + 1e-6) + 1e-30);
        }
        if near > far {
            return None;
        }
        let step = BEHIND * ray.origin.abs().max_element().max(ray.at(from).abs().max_element()).max(from);
        let start = from + step;
        let rest = Ray { origin: ray.at(start), direction: ray.direction, length: f32::INFINITY };
        let (distance, index) = self.tree.closest(&rest, f32::INFINITY)?;
        let [a, b, c] = self.corners.get(index as usize)?;
        Some((start + distance, (*b - *a).cross(*c - *a).normalize_or(ray.direction)))
    }

    /// Points just inside its surface.
    #[must_use]
    pub fn probes(&self) -> Vec<[f64; 3]> {
        let inwards = 1e-4 * self.bounds.size().max_element();
        let step = self.corners.len().div_ceil(256).max(1);
        let mut points = Vec::new();
        for [a, b, c] in self.corners.iter().step_by(step) {
            let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
            for [u, v, w] in [[1.0, 1.0, 1.0], [4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]] {
                let middle = (*a * u + *b * v + *c * w) / (u + v + w);
                points.push(to_array(middle - normal * inwards));
            }
        }
        // Where the body is thinner than that, points are outside.
        points.retain(|p| self.contains(crate::transform::to_vec3(*p)));
        points
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.corners) + self.tree.bytes()
    }
}

/// Points of a mesh nearer to each other than this part of its size are one.
const WELD: f32 = 1e-6;

/// A number for every vertex of a mesh, the same for all that lie at one place.
fn welded(mesh: &Mesh) -> Vec<u32> {
    let bounds = mesh.bounds();
    let reach = (WELD * bounds.size().max_element()).max(f32::MIN_POSITIVE);
    // Two points that near lie in cells next to each other.
    let mut cells: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
    let mut numbers = Vec::with_capacity(mesh.vertices.len());
    for (index, vertex) in (0_u32..).zip(&mesh.vertices) {
        let cell = ((*vertex - bounds.min) / (4.0 * reach)).floor().to_array().map(|c| c as i32);
        let near = (0..27).find_map(|i| {
            let at = [cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1];
            let known = cells
                .get(&at)?
                .iter()
                .find(|k| mesh.vertices.get(**k as usize).is_some_and(|other| other.distance(*vertex) <= reach))?;
            Some(*known)
        });
        if near.is_none() {
            cells.entry(cell).or_default().push(index);
        }
        numbers.push(near.unwrap_or(index));
    }
    numbers
}

/// Edges that are not passed in one direction as often as in the other.
fn open_edges(mesh: &Mesh) -> usize {
    let numbers = welded(mesh);
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| numbers.get(i as usize).copied().unwrap_or(i));
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if a != b {
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
    }
    edges.values().filter(|count| **count != 0).count()
}

/// The map from `[−1, 1]³` to a mesh that is a parallelepiped, which is much quicker to ask.
#[must_use]
pub fn as_box(mesh: &Mesh) -> Option<Transform> {
    let mut points: Vec<Vec3> = Vec::new();
    for triangle in &mesh.triangles {
        for corner in mesh.corners(*triangle) {
            if !points.contains(&corner) {
                if points.len() == 8 {
                    return None;
                }
                points.push(corner);
            }
        }
    }
    if points.len() != 8 || mesh.triangles.len() != 12 || open_edges(mesh) > 0 {
        return None;
    }
    let centre = points.iter().sum::<Vec3>() / 8.0;
    let reach = points.iter().map(|p| p.distance(centre)).fold(0.0, f32::max);
    let first = *points.first()?;
    // Three edges from one corner lead to all others.
    for i in 1..8 {
        for j in i + 1..8 {
            for k in j + 1..8 {
                let edges = [i, j, k].map(|at| points.get(at).copied().unwrap_or(first) - first);
                let corner = |bits: usize| (0..3).map(|e| edges[e] * (bits >> e & 1) as f32).sum::<Vec3>() + first;
                let is_there = |at: Vec3| points.iter().any(|p| p.distance(at) < 1e-5 * reach);
                let volume = edges[0].cross(edges[1]).dot(edges[2]).abs();
                if volume > 1e-6 * reach.powi(3) && (0..8).all(|bits| is_there(corner(bits))) {
                    let [x, y, z] = edges.map(|e| to_array(e * 0.5));
                    // The faces must be those of the box, not its diagonals.
                    let placed = Transform::from_columns(x, y, z, to_array(centre));
                    return is_on_faces(mesh, &placed).then_some(placed);
                }
            }
        }
    }
    None
}

fn is_on_faces(mesh: &Mesh, placed: &Transform) -> bool {
    let Some(to_local) = placed.inverse() else { return false };
    mesh.triangles.iter().all(|t| {
        let corners = mesh.corners(*t).map(|c| to_local.point(to_array(c)));
        (0..3).any(|axis| corners.iter().all(|c| (c[axis] - corners[0][axis]).abs() < 1e-3))
    })
}
