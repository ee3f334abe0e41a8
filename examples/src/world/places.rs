//! What a hit is asked for where surfaces vary: texture coordinates, and interpolated normals.

use fogbow::math::{Vec2, Vec3, float::PI};
use fogbow::surface::{RoughConductor, RoughDielectric, Surface};

use super::analytic::Primitive;
use crate::mesh::Mesh;
use crate::scene_file::{Geometry, Relief, ReliefForm};
use crate::texture::Place;
use crate::transform::{Transform, dot, to_array, to_vec3};

/// Weights of a triangle's corners at a point of it.
pub(super) fn weights([a, b, c]: [Vec3; 3], point: Vec3) -> [f32; 3] {
    let normal = (b - a).cross(c - a);
    let scale = 1.0 / normal.length_squared();
    let v = (point - a).cross(c - a).dot(normal) * scale;
    let w = (b - a).cross(point - a).dot(normal) * scale;
    // A point on the border may lie outside by a rounding.
    let (v, w) = (v.clamp(0.0, 1.0), w.clamp(0.0, 1.0));
    [(1.0 - v - w).max(0.0), v, w]
}

/// The interpolated normal; the triangle's own where that is none, or points to its other side.
pub(super) fn smooth_normal(mesh: &Mesh, vertices: [u32; 3], weights: [f32; 3], own: Vec3) -> Vec3 {
    let sum: Vec3 = vertices
        .iter()
        .zip(weights)
        .map(|(vertex, weight)| mesh.normals.get(*vertex as usize).copied().unwrap_or(own) * weight)
        .sum();
    match sum.try_normalize() {
        Some(normal) if normal.dot(own) > 1e-3 => normal,
        _ => own,
    }
}

/// Where a surface that varies is hit.
pub(super) struct Spot<'a> {
    pub(super) place: Place<'a>,
    /// The interpolated normal (unit), on the side of the primitive's own.
    pub(super) normal: Vec3,
    /// How the point moves with each texture coordinate (m).
    tangents: [Vec3; 2],
}

impl<'a> Spot<'a> {
    /// A point of a triangle of a mesh, given its corners and normal.
    pub(super) fn of_triangle(
        mesh: &'a Mesh,
        triangle: usize,
        (corners, own): ([Vec3; 3], Vec3),
        point: Vec3,
        has_relief: bool,
    ) -> Self {
        let weights = weights(corners, point);
        let vertices = mesh.triangles.get(triangle).copied().unwrap_or_default();
        let [e1, e2] = [corners[1] - corners[0], corners[2] - corners[0]];
        let (mut uv, mut tangents) = (Vec2::new(weights[1], weights[2]), [e1, e2]);
        if !mesh.texcoords.is_empty() {
            let at = vertices.map(|vertex| mesh.texcoords.get(vertex as usize).copied().unwrap_or_default());
            uv = at.iter().zip(weights).map(|(at, weight)| *at * weight).sum();
            if has_relief {
                let [a, b] = [at[1] - at[0], at[2] - at[0]];
                let determinant = a.perp_dot(b);
                let scale = if determinant == 0.0 { 0.0 } else { 1.0 / determinant };
                tangents = [(e1 * b.y - e2 * a.y) * scale, (e2 * a.x - e1 * b.x) * scale];
            }
        }
        let normal = if mesh.normals.is_empty() { own } else { smooth_normal(mesh, vertices, weights, own) };
        let place = Place { point, uv, attributes: &mesh.attributes, triangle, vertices, weights };
        Self { place, normal, tangents }
    }

    /// A point of any other form, with the texture coordinates of Mitsuba 3.
    pub(super) fn of_form(geometry: &Geometry, primitive: &Primitive, point: Vec3, normal: Vec3) -> Self {
        let (uv, tangents) = uv_of(geometry, primitive, point);
        Self { place: Place::plain(point, uv), normal, tangents }
    }

    /// The surface with its roughness along the first texture coordinate.
    pub(super) fn aligned(&self, mut surface: Surface) -> Surface {
        match &mut surface {
            Surface::RoughConductor(RoughConductor { roughness, .. })
            | Surface::RoughDielectric(RoughDielectric { roughness, .. }) => roughness.tangent = self.tangents[0],
            Surface::Principled(body) => body.tangent = self.tangents[0],
            Surface::PrincipledThin(sheet) => sheet.tangent = self.tangents[0],
            _ => {}
        }
        surface
    }

    /// The normal as a relief has it: on the side of `own`, and if it is turned so that a ray from the side of `side · own` sees it.
    pub(super) fn bent(&self, relief: &Relief, own: Vec3, side: f32, direction: Vec3) -> Vec3 {
        // Mitsuba's frames follow the flipped normal.
        let n = self.normal * side;
        let [du, dv] = self.tangents;
        let bent = match &relief.form {
            ReliefForm::Height { texture, scale } => {
                let slope = texture.slope(&self.place) * *scale;
                let rise = |tangent: Vec3, by: f32| tangent + n * (by - n.dot(tangent));
                let bent = rise(du, slope.x).cross(rise(dv, slope.y));
                if bent.dot(own * side) < 0.0 { -bent } else { bent }
            }
            ReliefForm::Normals(texture) => {
                let local = Vec3::from_array(texture.at(&self.place).0) * 2.0 - Vec3::ONE;
                let s = (du - n * n.dot(du)).normalize_or(n.any_orthonormal_vector());
                s * local.x + n.cross(s) * local.y + n * local.z
            }
        };
        let Some(mut bent) = bent.try_normalize() else { return self.normal };
        // What faces away from the eye is turned about the normal.
        if relief.is_turned && n.dot(direction) * bent.dot(direction) <= 0.0 {
            bent = n * (2.0 * n.dot(bent)) - bent;
        }
        let bent = bent * side;
        if bent.dot(own) > 1e-3 { bent } else { self.normal }
    }
}

/// An angle as a share of a turn, in [0, 1).
fn turn(y: f32, x: f32) -> f32 {
    let share = y.atan2(x) / (2.0 * PI);
    if share < 0.0 { share + 1.0 } else { share }
}

/// Texture coordinates, and how the point moves with them.
fn uv_of(geometry: &Geometry, primitive: &Primitive, point: Vec3) -> (Vec2, [Vec3; 2]) {
    let axis = |to_world: &Transform, index: usize| to_vec3(to_world.column(index));
    match (geometry, primitive) {
        (Geometry::Rectangle(to_world), Primitive::Flat { u, v, .. }) => {
            let at = Vec2::new(u.0.dot(point) + u.1, v.0.dot(point) + v.1);
            (at * 0.5 + Vec2::splat(0.5), [axis(to_world, 0) * 2.0, axis(to_world, 1) * 2.0])
        }
        (Geometry::Disk(to_world), Primitive::Flat { u, v, .. }) => {
            let at = Vec2::new(u.0.dot(point) + u.1, v.0.dot(point) + v.1);
            let (x, y, out) = (axis(to_world, 0), axis(to_world, 1), at.normalize_or(Vec2::X));
            let around = (y * at.x - x * at.y) * (2.0 * PI);
            (Vec2::new(at.length(), turn(at.y, at.x)), [x * out.x + y * out.y, around])
        }
        (Geometry::Sphere { axes, .. }, Primitive::Sphere { centre, radius }) => {
            let out = (point - *centre) / *radius;
            let local = local_axes(axes, out);
            let [x, y, z] = [0, 1, 2].map(|i| axis(axes, i).normalize_or_zero() * *radius);
            let sine = local.x.hypot(local.y).max(1e-6);
            let down = (x * local.x + y * local.y) * (local.z / sine) - z * sine;
            let tangents = [(y * local.x - x * local.y) * (2.0 * PI), down * PI];
            (Vec2::new(turn(local.y, local.x), local.z.clamp(-1.0, 1.0).acos() / PI), tangents)
        }
        (Geometry::Cube(to_world), Primitive::Box { rows }) => {
            let local = Vec3::from_array(rows.map(|(gradient, start)| gradient.dot(point) + start));
            // Coordinates are linear on a face: what a unit of each moves is found by trying.
            let (uv, start) = (cube_uv(local), cube_face(local));
            let mut tangents = [Vec3::ZERO; 2];
            for i in (0..3).filter(|i| *i != start) {
                let mut near = local;
                near[i] += if near[i] > 0.0 { -0.5 } else { 0.5 };
                let moved = (cube_uv(near) - uv) / (near[i] - local[i]);
                // Each texture coordinate goes along one axis.
                for (slot, by) in tangents.iter_mut().zip(moved.to_array()) {
                    if by.abs() > 0.1 {
                        *slot = axis(to_world, i) / by;
                    }
                }
            }
            (uv, tangents)
        }
        (Geometry::Cylinder(to_world), Primitive::Cylinder { rows }) => {
            let [x, y, z] = rows.map(|(gradient, start)| gradient.dot(point) + start);
            let around = (axis(to_world, 1) * x - axis(to_world, 0) * y) * (2.0 * PI);
            (Vec2::new(turn(y, x), z), [around, axis(to_world, 2)])
        }
        _ => (Vec2::ZERO, [Vec3::ZERO; 2]),
    }
}

/// The axis across the face of a cube.
fn cube_face(at: Vec3) -> usize {
    let size = at.abs();
    if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    }
}

/// A direction along axes that may be stretched or mirrored.
fn local_axes(axes: &Transform, direction: Vec3) -> Vec3 {
    let d = to_array(direction);
    let along = |axis: [f64; 3]| (dot(axis, d) / dot(axis, axis).sqrt()) as f32;
    Vec3::from_array([0, 1, 2].map(|i| along(axes.column(i))))
}

/// Every face shows the whole unit square.
fn cube_uv(at: Vec3) -> Vec2 {
    let (x, y, z) = (at.x * 0.5 + 0.5, at.y * 0.5 + 0.5, at.z * 0.5 + 0.5);
    match (cube_face(at), at[cube_face(at)] > 0.0) {
        (0, true) => Vec2::new(y, 1.0 - z),
        (0, false) => Vec2::new(y, z),
        (1, true) => Vec2::new(1.0 - x, 1.0 - z),
        (1, false) => Vec2::new(z, x),
        (_, true) => Vec2::new(y, x),
        (_, false) => Vec2::new(1.0 - y, x),
    }
}
