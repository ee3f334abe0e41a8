//! Files of curves.

use std::path::Path;

use super::Mesh;
use crate::error::DataError;
use crate::transform::{Transform, to_vec3};

/// Pieces that a segment of a spline becomes.
const PIECES: u32 = 8;

/// Sides of a cross-section, at least and at most. Fewer: where light grazes a side, it is dark; more: memory.
const SIDES: [u32; 2] = [12, 48];

/// Triangles of a file from which on cross-sections have fewer sides: hair is seen from afar.
const MANY_TRIANGLES: usize = 1 << 21;

/// Most points of all curves: beyond, their triangles fill the memory.
const MOST_POINTS: usize = 1 << 17;

/// A point and a radius (m).
type Point = ([f64; 3], f64);

pub(super) fn read(file: &Path, bytes: &[u8], is_smooth: bool, to_world: &Transform) -> Result<Mesh, DataError> {
    let (mut curves, mut curve, mut count) = (Vec::new(), Vec::new(), 0);
    let lines = bytes.split(|b| *b == b'\n').chain([b"".as_slice()]);
    for (number, line) in lines.enumerate() {
        let fail = |reason: String| DataError::new(file, format!("line {}", number + 1), reason);
        let line = String::from_utf8_lossy(line);
        if line.trim().is_empty() {
            let own = curve.len().saturating_sub(if is_smooth { 3 } else { 1 });
            let points = if is_smooth { spline(&curve).map_err(fail)? } else { core::mem::take(&mut curve) };
            count += points.len();
            if count > MOST_POINTS {
                return Err(fail(format!("curves have more than {MOST_POINTS} points")));
            }
            curves.push((points, own));
            curve.clear();
            continue;
        }
        let words: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        match words.as_deref() {
            Ok([x, y, z, radius, ..]) if [x, y, z, radius].iter().all(|c| c.is_finite()) && *radius > 0.0 => {
                curve.push((to_world.point([*x, *y, *z]), *radius));
            }
            _ => return Err(fail("four numbers are due: a point and a positive radius".to_owned())),
        }
    }
    // Two triangles for a side, and where straight pieces meet a ball of as many as the square.
    let of_each = MANY_TRIANGLES / count.max(1);
    let sides = if is_smooth { of_each / 2 } else { of_each.isqrt() };
    let sides = (sides as u32).clamp(SIDES[0], SIDES[1]);
    let bead = Mesh::bead(sides);
    // Of all curves of the file: the second texture coordinate runs along all of them.
    let (mut mesh, mut segments) = (Mesh::default(), 0);
    for (points, own) in &curves {
        let mut along = if is_smooth { Mesh::tube(points, sides) } else { straight(points, &bead, sides) };
        along.texcoords.iter_mut().for_each(|uv| uv.y = segments as f32 + uv.y * *own as f32);
        mesh.append(&along);
        segments += own;
    }
    mesh.texcoords.iter_mut().for_each(|uv| uv.y /= segments.max(1) as f32);
    Ok(mesh)
}

/// Straight pieces, round where they meet and end.
fn straight(points: &[Point], bead: &Mesh, sides: u32) -> Mesh {
    let mut mesh = Mesh::default();
    if points.len() < 2 {
        return mesh;
    }
    let last = (points.len() - 1) as f32;
    for (k, pair) in points.windows(2).enumerate() {
        let mut piece = Mesh::tube(pair, sides);
        piece.texcoords.iter_mut().for_each(|uv| uv.y = (k as f32 + uv.y) / last);
        mesh.append(&piece);
    }
    for (k, (centre, radius)) in points.iter().enumerate() {
        let mut ball = bead.clone();
        ball.vertices.iter_mut().for_each(|v| *v = *v * *radius as f32 + to_vec3(*centre));
        ball.texcoords.iter_mut().for_each(|uv| uv.y = k as f32 / last);
        mesh.append(&ball);
    }
    mesh
}

/// Points along a uniform cubic B-spline.
fn spline(points: &[Point]) -> Result<Vec<Point>, String> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    if points.len() < 4 {
        return Err(format!("a B-spline needs four control points, and this one has {}", points.len()));
    }
    let mut along = Vec::new();
    for window in points.windows(4) {
        let last = if along.len() as u32 / PIECES == points.len() as u32 - 4 { PIECES } else { PIECES - 1 };
        for piece in 0..=last {
            let t = f64::from(piece) / f64::from(PIECES);
            let weights = [
                (1.0 - t).powi(3) / 6.0,
                (3.0 * t.powi(3) - 6.0 * t * t + 4.0) / 6.0,
                (-3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0) / 6.0,
                t.powi(3) / 6.0,
            ];
            let mean =
                |value: &dyn Fn(&Point) -> f64| -> f64 { window.iter().zip(weights).map(|(p, w)| value(p) * w).sum() };
            along.push(([0, 1, 2].map(|axis| mean(&|p| p.0[axis])), mean(&|p| p.1)));
        }
    }
    Ok(along)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Curves that become wider face back, and a file of few has many sides.
    #[test]
    fn normals_are_those_of_cones_and_few_curves_are_round() {
        let read = |text: &str| read(Path::new("x.txt"), text.as_bytes(), true, &Transform::IDENTITY).unwrap();
        let few = read("0 0 0 0.1\n1 0 0 0.3\n2 0 0 0.5\n3 0 0 0.7\n");
        assert_eq!(few.vertices.len(), 9 * 49);
        let due = -0.2 / 1.04_f32.sqrt();
        assert!(few.normals.iter().all(|normal| (normal.x - due).abs() < 1e-5 && normal.is_normalized()));
        let many = read(&"0 0 0 0.1\n1 0 0 0.1\n2 0 0 0.1\n3 0 0 0.1\n\n".repeat(13_000));
        assert_eq!(many.vertices.len(), 13_000 * 9 * 13);
        // A curve that stands still has normals all the same.
        let still = read("0 0 0 0.1\n0 0 0 0.2\n0 0 0 0.3\n0 0 0 0.4\n");
        assert!(still.normals.iter().all(|normal| normal.is_normalized()));
    }

    /// Around an axis along x Mitsuba counts from y by way of z; along, over all curves of a file.
    #[test]
    fn textures_run_as_the_independent_renderer_has_them() {
        let read =
            |text: &str, is_smooth| read(Path::new("x.txt"), text.as_bytes(), is_smooth, &Transform::IDENTITY).unwrap();
        let line = "0 0 0 0.1\n1 0 0 0.1\n\n5 0 0 0.1\n6 0 0 0.1\n7 0 0 0.1\n";
        let spline =
            "0 0 0 0.1\n1 0 0 0.1\n2 0 0 0.1\n3 0 0 0.1\n\n6 0 0 0.1\n7 0 0 0.1\n8 0 0 0.1\n9 0 0 0.1\n10 0 0 0.1\n";
        for (mesh, starts) in [(read(line, false), [0.0, 5.0]), (read(spline, true), [1.0, 7.0])] {
            let mut seen = 0;
            for (at, uv) in mesh.vertices.iter().zip(&mesh.texcoords) {
                let x = if at.x < 4.5 { at.x - starts[0] } else { 1.0 + at.x - starts[1] };
                // Not the balls where straight pieces meet: these are no rings.
                if (uv.y - x / 3.0).abs() > 1e-5 || (at.y.hypot(at.z) - 0.1).abs() > 0.01 {
                    continue;
                }
                let turns = f64::from(at.z).atan2(f64::from(at.y)) / (2.0 * core::f64::consts::PI);
                let off = f64::from(uv.x) - turns;
                seen += usize::from((off - off.round()).abs() < 1e-5);
            }
            let rings = if starts[0] == 0.0 { 6 } else { 9 + 17 };
            assert!(seen >= rings * 13, "{seen}");
        }
    }
}
