//! Noise of irradiance records, averaged over their neighbours.
//!
//! Near corners, and where an estimate met something bright, records are small, have few samples and are seen as dots. Around them others tell
//! the same light with other noise. So every record is given the mean of what those near it say of its place, carried there as look-ups
//! carry. Nothing is weighed by how much samples differ, which would favour what is dark.

use glam::Vec3;

use super::extrapolate::weight;
use super::lookup::facing_distance;
use super::record::{Facing, Record};
use super::store::SurfaceCache;
use crate::math::float;
use crate::spectrum::{Gradient, Spectrum};

/// What records say of a place together.
///
/// ```text
/// E = Σ w_k (E_k + ½ ∇E_k·Δ_k)/W + ½ ∇Ē·Δ̄        ∇Ē = Σ w_k ∇E_k/W,  Δ̄ = Σ w_k Δ_k/W
/// ```
///
/// Exact for light that changes quadratically where records surround the place, as
/// [`Extrapolation::Curved`](super::Extrapolation::Curved).
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    weight: f32,
    offset: Vec3,
    value: Spectrum,
    gradient: Gradient,
    turn: Gradient,
}

impl Mean {
    fn add(&mut self, weight: f32, offset: Vec3, (value, gradient, turn): (Spectrum, Gradient, Gradient)) {
        self.weight += weight;
        self.offset += offset * weight;
        self.value += (value + gradient.along(offset) * 0.5) * weight;
        self.gradient += gradient * weight;
        self.turn += turn * weight;
    }
}

impl SurfaceCache<'_> {
    /// A record with what those within twice their radius say of its place; `None` if there is no such record, or its neighbours have the
    /// light negative. After [`Cache::finish`](super::Cache::finish).
    ///
    /// What reaches far counts less for what reaches less far, for that is where light changes: distances are measured in the geometric mean of
    /// both radii, or in the neighbour's if it is smaller.
    pub(super) fn smoothed(&self, number: u32) -> Option<(Record, Facing)> {
        let here = *self.records().get(number as usize)?;
        let normal = self.attached(number).first()?.normal;
        let mut mean = Mean::default();
        self.visit_wide(here.position, |i, record, share| {
            let Some(facing) = self.attached(i).first() else { return };
            let share = share * float::sqrt(float::max(record.radius / here.radius, 1.0));
            let d = 1.0 - facing_distance(here.position, normal, record, facing, share);
            if d > 0.0 {
                let value = record.value + facing.turn.along(normal - facing.normal);
                mean.add(weight(d), here.position - record.position, (value, record.gradient, facing.turn));
            }
        });
        let share = 1.0 / mean.weight;
        let gradient = mean.gradient * share;
        let value = mean.value * share + gradient.along(mean.offset * (0.5 * share));
        let smoothed = Record { value: value.max(Spectrum::ZERO), gradient, ..here };
        smoothed.is_valid().then_some((smoothed, Facing { normal, turn: mean.turn * share }))
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::cache::Cache;
    use crate::sampling::{Generator, uniform};

    const UP: Facing = Facing { normal: Vec3::Z, turn: Gradient::ZERO };

    /// Records of `light(x, y)` and its slope, 0.1 m apart, on a floor that is 2 m wide.
    fn floor(radius: f32, mut light: impl FnMut(f32, f32) -> (f32, Vec3)) -> SurfaceCache<'static> {
        let mut cache: SurfaceCache = Cache::growing(1);
        for i in -10..=10 {
            for j in -10..=10 {
                let (x, y) = (0.1 * i as f32, 0.1 * j as f32);
                let (value, slope) = light(x, y);
                let gradient = Gradient::outer(Spectrum::ONE, slope);
                let record = Record { position: Vec3::new(x, y, 0.0), radius, value: Spectrum::splat(value), gradient };
                cache.insert(record, &[UP]).unwrap();
            }
        }
        cache.finish().unwrap();
        cache
    }

    /// Numbers of the records that are surrounded by others.
    fn inner(cache: &SurfaceCache<'_>) -> impl Iterator<Item = u32> {
        let is_inner = |record: &Record| record.position.abs().max_element() < 0.65;
        (0..cache.len() as u32).filter(move |&i| is_inner(&cache.records()[i as usize]))
    }

    #[test]
    fn light_that_changes_quadratically_stays() {
        let cache = floor(0.15, |x, y| {
            (2.0 + x - 0.5 * y + x * x - 2.0 * x * y, Vec3::new(1.0 + 2.0 * x - 2.0 * y, -0.5 - 2.0 * x, 0.0))
        });
        for i in inner(&cache) {
            let (before, after) = (cache.records()[i as usize], cache.smoothed(i).unwrap().0);
            assert!((after.value[0] - before.value[0]).abs() < 1e-5, "{before:?} {after:?}");
        }
    }

    #[test]
    fn noise_is_that_of_many() {
        let mut rng = Generator::new(5);
        let cache = floor(0.15, |_, _| (1.0 + uniform(&mut rng), Vec3::ZERO));
        let spread = |values: &[f32]| {
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            (mean, values.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / values.len() as f32)
        };
        let before: Vec<f32> = inner(&cache).map(|i| cache.records()[i as usize].value[0]).collect();
        let after: Vec<f32> = inner(&cache).map(|i| cache.smoothed(i).unwrap().0.value[0]).collect();
        let ((mean, all), (smoothed_mean, smoothed)) = (spread(&before), spread(&after));
        // Some 29 neighbours within three spacings, the near ones of which count most: of ten, about.
        assert!(smoothed < all / 8.0 && smoothed > all / 16.0, "{smoothed} of {all}");
        assert!((smoothed_mean - mean).abs() < 0.02, "{smoothed_mean} {mean}");
    }

    #[test]
    fn neither_corners_nor_large_neighbours_leak() {
        // A small dark record on the floor; a wall beside it and a large bright record far off.
        let mut cache: SurfaceCache = Cache::growing(1);
        let record = |x: f32, radius, value| Record {
            position: Vec3::X * x,
            radius,
            value: Spectrum::splat(value),
            gradient: Gradient::ZERO,
        };
        cache.insert(record(0.0, 0.1, 1.0), &[UP]).unwrap();
        cache.insert(record(0.05, 0.1, 100.0), &[Facing { normal: Vec3::X, turn: Gradient::ZERO }]).unwrap();
        cache.insert(record(0.9, 0.9, 100.0), &[UP]).unwrap();
        cache.finish().unwrap();
        // Within twice its own radius, but beyond that of the mean.
        assert_eq!(cache.records()[2].radius, 0.9);
        assert_eq!(cache.smoothed(0).unwrap().0.value, Spectrum::ONE);
        assert!(cache.smoothed(3).is_none());
    }
}
