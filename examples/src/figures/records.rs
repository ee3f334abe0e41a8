//! Where records lie: Fig. 7, the section of Fig. 8. Takes nothing but points, wherever they come from.

use fogbow::math::Vec3;
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;

use super::montage;
use crate::camera::Camera;
use crate::cli::Failure;

const INK: Spectrum = Spectrum([0.0; 3]);

/// Records as the camera sees them, a dot each.
pub(super) fn seen(points: &[Vec3], camera: &Camera, [width, height]: [u32; 2]) -> Result<Image, Failure> {
    let mut image = montage::made(width, height, |_, _| Spectrum::ONE)?;
    for point in points {
        if let Some(film) = camera.project(*point) {
            let at = [film.x * width as f32, film.y * height as f32];
            dot(&mut image, at, 1);
        }
    }
    Ok(image)
}

/// Records between two heights, seen from above, +x to the right and −z upwards.
pub(super) fn section(points: &[Vec3], heights: [f32; 2], low: Vec3, high: Vec3, width: u32) -> Result<Image, Failure> {
    let scale = width as f32 / (high.x - low.x);
    let height = ((high.z - low.z) * scale).ceil().clamp(1.0, 4096.0) as u32;
    let mut image = montage::made(width, height, |_, _| Spectrum::ONE)?;
    for point in points.iter().filter(|p| (heights[0]..heights[1]).contains(&p.y)) {
        let at = [(point.x - low.x) * scale, (point.z - low.z) * scale];
        dot(&mut image, at, 3);
    }
    Ok(image)
}

/// A square of `size` pixels.
fn dot(image: &mut Image, [x, y]: [f32; 2], size: u32) {
    if x >= 0.0 && y >= 0.0 {
        for i in 0..size * size {
            montage::set(image, x as u32 + i % size, y as u32 + i / size, INK);
        }
    }
}
