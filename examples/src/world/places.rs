//! What a hit is asked for where surfaces vary: texture coordinates, and interpolated normals.

use fogbow::math::{Vec2, Vec3, float::PI};

use super::analytic::Primitive;
use crate::mesh::Mesh;
use crate::scene_file::Geometry;
use crate::texture::Place;
use crate::transform::{Transform, dot, to_array};

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

/// A place in a triangle of a mesh.
pub(super) fn of_triangle(mesh: &Mesh, triangle: usize, weights: [f32; 3], point: Vec3) -> Place<'_> {
    let vertices = mesh.triangles.get(triangle).copied().unwrap_or_default();
    let uv = if mesh.texcoords.is_empty() {
        Vec2::new(weights[1], weights[2])
    } else {
        let at = |vertex: u32| mesh.texcoords.get(vertex as usize).copied().unwrap_or_default();
        vertices.iter().zip(weights).map(|(vertex, weight)| at(*vertex) * weight).sum()
    };
    Place { point, uv, attributes: &mesh.attributes, triangle, vertices, weights }
}

/// A place of any other form, with the texture coordinates of Mitsuba 3.
pub(super) fn of_form(geometry: &Geometry, primitive: &Primitive, point: Vec3) -> Place<'static> {
    Place::plain(point, uv_of(geometry, primitive, point))
}

/// An angle as a share of a turn, in [0, 1).
fn turn(y: f32, x: f32) -> f32 {
    let share = y.atan2(x) / (2.0 * PI);
    if share < 0.0 { share + 1.0 } else { share }
}

fn uv_of(geometry: &Geometry, primitive: &Primitive, point: Vec3) -> Vec2 {
    match (geometry, primitive) {
        (Geometry::Rectangle(_), Primitive::Flat { u, v, .. }) => {
            Vec2::new(u.0.dot(point) + u.1, v.0.dot(point) + v.1) * 0.5 + Vec2::splat(0.5)
        }
        (Geometry::Disk(_), Primitive::Flat { u, v, .. }) => {
            let at = Vec2::new(u.0.dot(point) + u.1, v.0.dot(point) + v.1);
            Vec2::new(at.length(), turn(at.y, at.x))
        }
        (Geometry::Sphere { axes, .. }, Primitive::Sphere { centre, radius }) => {
            let out = (point - *centre) / *radius;
            let local = local_axes(axes, out);
            Vec2::new(turn(local.y, local.x), local.z.clamp(-1.0, 1.0).acos() / PI)
        }
        (Geometry::Cube(_), Primitive::Box { rows }) => {
            let local = Vec3::from_array(rows.map(|(gradient, start)| gradient.dot(point) + start));
            cube_uv(local)
        }
        _ => Vec2::ZERO,
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
    let size = at.abs();
    let (x, y, z) = (at.x * 0.5 + 0.5, at.y * 0.5 + 0.5, at.z * 0.5 + 0.5);
    if size.x >= size.y && size.x >= size.z {
        if at.x > 0.0 { Vec2::new(y, 1.0 - z) } else { Vec2::new(y, z) }
    } else if size.y >= size.z {
        if at.y > 0.0 { Vec2::new(1.0 - x, 1.0 - z) } else { Vec2::new(z, x) }
    } else if at.z > 0.0 {
        Vec2::new(y, x)
    } else {
        Vec2::new(1.0 - y, x)
    }
}
