//! Whether gradients of records agree with the records around them.
//!
//! What gradients have wrong leaves blotches that are bright here and dark there, of less light than the noise of an audit, and no estimate is needed to see it:
//! between two records whose spheres reach each other light changes by what the gradients of both foretell.
//!
//! ```text
//! f = (∇L_i + ∇L_j)·(x_j − x_i)/(L_i + L_j),   c = 2 (L_j − L_i)/(L_i + L_j),   slope = Σ f c/Σ f²
//! ```
//!
//! over pairs of records: a regression through the origin, 1 where gradients are right, of light that changes quadratically; less the more noise they
//! have, and less than 0 only if they lead the wrong way.

use super::audit::{Deviation, SURE};
use super::slot::Slot;

/// Records whose neighbours are asked, at most. More: time; fewer: slopes are known less well.
const MOST: usize = 1 << 14;

/// Least cosine between the normals of records on surfaces that are compared: between others light changes by how they turn.
const LEAST_COSINE: f32 = 0.98;

/// Each pair counts twice, and records have a part in many: the standard error that pairs would have if they were independent is too small by about this.
const SHARED: f64 = 2.0;

/// What the slope of light between records deviates by from that of their gradients: −1 where gradients say nothing, −2 where they are turned
/// round. `None` of less than two records that have neighbours, or without gradients.
pub(super) fn of_gradients(slot: &Slot<'_>) -> Option<Deviation> {
    let (records, step) = (slot.records(), slot.len().div_ceil(MOST).max(1));
    let (mut count, mut fc, mut ff) = (0.0, 0.0, 0.0);
    // Products of sums of records.
    let mut squares = [0.0; 3];
    for (number, here) in records.iter().enumerate().step_by(step) {
        let normal = slot.place(number)?.normal;
        let [mut of_c, mut of_f] = [0.0; 2];
        slot.visit(here.position, &mut |other, _| {
            let there = &records[other];
            let is_aside = || {
                let normals = normal.zip(slot.place(other).and_then(|place| place.normal));
                normals.is_some_and(|(a, b)| a.dot(b) < LEAST_COSINE)
            };
            if other == number || is_aside() {
                return;
            }
            let apart = here.position - there.position;
            let light = f64::from(here.value.mean() + there.value.mean());
            let foretold = f64::from((here.gradient + there.gradient).along(apart).mean()) / light;
            let change = 2.0 * f64::from(here.value.mean() - there.value.mean()) / light;
            let products = [foretold * change, foretold * foretold];
            // Black records tell nothing.
            if products.iter().all(|product| product.is_finite()) {
                (of_c, of_f) = (of_c + products[0], of_f + products[1]);
            }
        });
        if of_f > 0.0 {
            (count, fc, ff) = (count + 1.0, fc + of_c, ff + of_f);
            let products = [of_c * of_c, of_c * of_f, of_f * of_f];
            squares.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        }
    }
    let slope = fc / ff;
    let residual = (squares[0] - 2.0 * slope * squares[1] + slope * slope * squares[2]).max(0.0);
    let error = SHARED * libm::sqrt(residual * count / (count - 1.0)) / ff;
    (count > 1.0 && error.is_finite()).then_some(Deviation { bias: slope - 1.0, error })
}

/// Whether gradients certainly lead the wrong way.
pub(super) fn is_misled(slope: &Deviation) -> bool {
    slope.bias + SURE * slope.error < -1.0
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::cache::{Cache, Record, VolumeCache};
    use crate::math::Vec3;
    use crate::sampling::{Generator, uniform};
    use crate::spectrum::{Gradient, Spectrum};

    /// Records in a cube, of light that changes by a fifth within their radius, with so much noise in values and gradients, which are scaled.
    fn slope(noise: [f32; 2], scale: f32) -> Option<Deviation> {
        let rng = &mut Generator::new(7);
        let mut cache: VolumeCache = Cache::growing(0);
        for _ in 0..2000 {
            let mut vary = |by: f32| by * (2.0 * uniform(rng) - 1.0);
            let (position, value) = (Vec3::from([(); 3].map(|()| vary(1.0))), 1.0 + vary(noise[0]));
            let light = |at: Vec3| 2.0 + at.x + at.y * at.z;
            let slope = Vec3::new(1.0, position.z, position.y) + Vec3::from([(); 3].map(|()| vary(noise[1])));
            let gradient = Gradient::outer(Spectrum::splat(scale), slope);
            let record = Record { position, radius: 0.3, value: Spectrum::splat(value * light(position)), gradient };
            cache.insert(record, &[]).unwrap();
        }
        cache.finish().unwrap();
        of_gradients(&Slot::Volume(cache))
    }

    #[test]
    fn gradients_that_lead_the_wrong_way_are_told_and_noise_is_not() {
        let right = slope([0.0, 0.0], 1.0).unwrap();
        assert!(right.bias.abs() < 0.02 && right.error < 0.02, "{right:?}");
        let noisy = slope([0.1, 1.0], 1.0).unwrap();
        assert!((-0.7..-0.1).contains(&noisy.bias) && !is_misled(&noisy), "{noisy:?}");
        let wild = slope([0.1, 30.0], 1.0).unwrap();
        assert!((wild.bias + 1.0).abs() < 0.1 && !is_misled(&wild), "{wild:?}");
        for noise in [[0.0, 0.0], [0.1, 1.0]] {
            let turned = slope(noise, -1.0).unwrap();
            assert!(is_misled(&turned), "{turned:?}");
        }
        assert_eq!(slope([0.0, 0.0], 0.0), None, "without gradients");
    }
}
