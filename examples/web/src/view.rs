//! A camera, and parts of pictures; rays in batches.

use alloc::vec::Vec;

use fogbow::math::{Ray, Vec3, float};
use fogbow::sampling::{Generator, GeneratorSource, Independent, pixel_key, uniform2};
use fogbow::spectrum::Spectrum;

use super::words::{Fault, Words};

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    eye: Vec3,
    forward: Vec3,
    /// Half the width and half the height of the picture at a distance of 1.
    right: Vec3,
    up: Vec3,
    size: [u32; 2],
    pixel: f32,
}

/// Most pixels of a picture.
const MOST_PIXELS: u32 = 1 << 26;

impl View {
    /// From words: eye, target, upward direction, vertical field of view (rad), columns, rows.
    ///
    /// # Errors
    /// An eye at its target, a direction up that is the one of sight, an angle not within (0, π), no pixels or too many.
    pub fn read(words: &mut Words<'_>) -> Result<Self, Fault> {
        let (eye, target, upward) = (words.vector()?, words.vector()?, words.vector()?);
        let fov = words.float()?;
        let size = [words.integer()?, words.integer()?];
        let none = || {
            Fault::new("a view needs an eye, a target away from it, and a direction up that is not the one of sight")
        };
        let forward = (target - eye).try_normalize().filter(|_| eye.is_finite()).ok_or_else(none)?;
        let right = forward.cross(upward).try_normalize().ok_or_else(none)?;
        if !(fov > 0.0 && fov < core::f32::consts::PI) {
            return Err(Fault::new("a field of view lies between 0 and pi"));
        }
        if size.contains(&0) || size[0].checked_mul(size[1]).is_none_or(|pixels| pixels > MOST_PIXELS) {
            return Err(Fault::new("a picture needs pixels, at most 2^26"));
        }
        let half = float::tan(0.5 * fov);
        let aspect = size[0] as f32 / size[1] as f32;
        let up = right.cross(forward) * half;
        Ok(Self { eye, forward, right: right * (half * aspect), up, size, pixel: 2.0 * half / size[1] as f32 })
    }

    /// The ray through a point of the film, both coordinates in [0, 1], from the top left.
    #[must_use]
    pub fn ray(&self, [x, y]: [f32; 2]) -> Ray {
        let direction = self.forward + self.right * (2.0 * x - 1.0) + self.up * (1.0 - 2.0 * y);
        Ray::new(self.eye, direction.normalize())
    }

    /// Angular width of a pixel (rad).
    #[must_use]
    pub fn pixel(&self) -> f32 {
        self.pixel
    }

    /// Columns times rows.
    #[must_use]
    pub fn pixels(&self) -> u32 {
        self.size[0] * self.size[1]
    }
}

/// A rectangle of pixels, and which samples of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    origin: [u32; 2],
    size: [u32; 2],
    first: u32,
    samples: u32,
    seed: u64,
}

impl Part {
    /// From words: column, row, columns, rows, number of the first sample, samples, seed.
    ///
    /// # Errors
    /// No samples, no pixels or too many.
    pub fn read(words: &mut Words<'_>) -> Result<Self, Fault> {
        let origin = [words.integer()?, words.integer()?];
        let size = [words.integer()?, words.integer()?];
        let (first, samples, seed) = (words.integer()?, words.integer()?, u64::from(words.integer()?));
        if size.contains(&0) || size[0].checked_mul(size[1]).is_none_or(|pixels| pixels > MOST_PIXELS) {
            return Err(Fault::new("a part of a picture needs pixels, at most 2^26"));
        }
        if samples == 0 {
            return Err(Fault::new("a picture needs samples"));
        }
        Ok(Self { origin, size, first, samples, seed })
    }

    /// Means of samples, pixel after pixel. What a sample is depends on its pixel and number alone, so pictures may be taken in parts.
    pub(crate) fn picture(
        &self,
        view: &View,
        sample: impl Fn(&Ray, &mut Generator) -> Spectrum,
    ) -> Result<Vec<Spectrum>, Fault> {
        let [width, height] = self.size;
        let of_pixel = |number: u32| {
            let (x, y) = (self.origin[0] + number % width, self.origin[1] + number / width);
            let mut sum = [0.0_f64; 3];
            for index in self.first..self.first.saturating_add(self.samples) {
                let mut rng = Independent.start(self.seed, pixel_key(x, y), index);
                let at = uniform2(&mut rng);
                let at = [(x as f32 + at.x) / view.size[0] as f32, (y as f32 + at.y) / view.size[1] as f32];
                let seen = sample(&view.ray(at), &mut rng);
                // No light is better than no number, which would be all that is seen of the pixel.
                if seen.is_finite() {
                    sum.iter_mut().zip(seen.0).for_each(|(sum, c)| *sum += f64::from(c));
                }
            }
            Spectrum(sum.map(|c| (c / f64::from(self.samples)) as f32))
        };
        Ok((0..width * height).map(of_pixel).collect())
    }
}

/// Rays in words: origin, direction (unit), length of each.
#[derive(Debug, Clone, Copy)]
pub struct Rays<'a>(&'a [[u32; 7]]);

impl<'a> Rays<'a> {
    /// From words.
    ///
    /// # Errors
    /// Not a whole number of rays, or a direction that is none.
    pub fn read(words: &'a [u32]) -> Result<Self, Fault> {
        let (rays, rest) = words.as_chunks();
        if !rest.is_empty() {
            return Err(Fault::new("a ray is 7 numbers: origin, direction, length"));
        }
        let is_unit = |ray: &[u32; 7]| (ray_of(ray).direction.length_squared() - 1.0).abs() < 1e-3;
        match rays.iter().position(|ray| !is_unit(ray)) {
            Some(number) => Err(Fault::new("its direction is no unit vector").of("ray", number)),
            None => Ok(Self(rays)),
        }
    }

    pub(crate) fn radiance(
        &self,
        samples: u32,
        seed: u64,
        sample: impl Fn(&Ray, &mut Generator) -> Spectrum,
    ) -> Vec<Spectrum> {
        let of = |(number, ray): (usize, &[u32; 7])| {
            let mut sum = Spectrum::ZERO;
            for index in 0..samples.max(1) {
                sum += sample(&ray_of(ray), &mut Independent.start(seed, number as u64, index));
            }
            sum / samples.max(1) as f32
        };
        self.0.iter().enumerate().map(of).collect()
    }
}

fn ray_of(words: &[u32; 7]) -> Ray {
    let [ox, oy, oz, dx, dy, dz, length] = words.map(f32::from_bits);
    // Not by `Ray::new`, which takes unit vectors alone.
    Ray { origin: Vec3::new(ox, oy, oz), direction: Vec3::new(dx, dy, dz), length }
}
