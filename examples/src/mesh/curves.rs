//! Files of curves.

use std::path::Path;

use super::Mesh;
use crate::error::DataError;
use crate::transform::{Transform, to_vec3};

/// Pieces that a segment of a spline becomes.
const PIECES: u32 = 8;

/// Most points of all curves: beyond, their triangles fill the memory.
const MOST_POINTS: usize = 1 << 17;

/// A point and a radius (m).
type Point = ([f64; 3], f64);

pub(super) fn read(file: &Path, bytes: &[u8], is_smooth: bool, to_world: &Transform) -> Result<Mesh, DataError> {
    let (mut mesh, mut curve, mut count) = (Mesh::default(), Vec::new(), 0);
    let bead = Mesh::bead();
    let lines = bytes.split(|b| *b == b'\n').chain([b"".as_slice()]);
    for (number, line) in lines.enumerate() {
        let fail = |reason: String| DataError::new(file, format!("line {}", number + 1), reason);
        let line = String::from_utf8_lossy(line);
        if line.trim().is_empty() {
            let points = if is_smooth { spline(&curve).map_err(fail)? } else { core::mem::take(&mut curve) };
            count += points.len();
            if count > MOST_POINTS {
                return Err(fail(format!("curves have more than {MOST_POINTS} points")));
            }
            if is_smooth {
                mesh.append(&Mesh::tube(&points));
            } else {
                append_straight(&mut mesh, &points, &bead);
            }
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
    Ok(mesh)
}

/// Straight pieces, round where they meet and end.
fn append_straight(mesh: &mut Mesh, points: &[Point], bead: &Mesh) {
    if points.len() < 2 {
        return;
    }
    let last = (points.len() - 1) as f32;
    for (k, pair) in points.windows(2).enumerate() {
        let mut piece = Mesh::tube(pair);
        piece.texcoords.iter_mut().for_each(|uv| uv.y = (k as f32 + uv.y) / last);
        mesh.append(&piece);
    }
    for (k, (centre, radius)) in points.iter().enumerate() {
        let mut ball = bead.clone();
        ball.vertices.iter_mut().for_each(|v| *v = *v * *radius as f32 + to_vec3(*centre));
        ball.texcoords.iter_mut().for_each(|uv| uv.y = k as f32 / last);
        mesh.append(&ball);
    }
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
