//! Records that contradict each other reach less far.
//!
//! Gradients know nothing of the border of a shaft, or of a hole in the shade of a lamp, behind which light is a hundred times as bright. But where a record reaches one that lies
//! behind it, that one knows better: what it holds is far from what is foretold of its place, and by more than noise. So neither is carried so far (decision 115).
//!
//! ```text
//! f = L_i + ∇L_i·(x_j − x_i),   |f − L_j| > ½ (f + L_j) √(c² + k² (v_i + v_j))   ⇒   R_i ≤ 0.7 ‖x_j − x_i‖
//! ```
//!
//! with the relative variances `v` of the means `L` over directions.

use super::record::Record;

/// `c` above: 2.3 times as bright. Larger: light bleeds out of shafts; smaller: records where light only bends.
const CONTRAST: f32 = 0.8;

/// `k` above. Larger: nothing is seen in noise; smaller: noise makes records small.
const SURE: f32 = 2.0;

/// How much of the way to the other a record may reach that contradicts it. Larger: it is still mixed in close to it; smaller: more records.
const OF_THE_WAY: f32 = 0.7;

/// How often records are parted: those that fill what is left open may contradict others. More: time; fewer: what is left.
pub(super) const ROUNDS: u32 = 2;

/// How far (m) a record may reach by what it foretells of another: infinitely far if that agrees. `variance` is the relative one of both, in sum.
pub(super) fn reach(here: &Record, there: &Record, variance: f32) -> f32 {
    let way = there.position - here.position;
    let (foretold, found) = ((here.value + here.gradient.along(way)).mean().max(0.0), there.value.mean());
    let contrast = 2.0 * (foretold - found) / (foretold + found);
    // Written so that NaN, of two that are black, agrees.
    let is_clash = contrast * contrast > CONTRAST * CONTRAST + SURE * SURE * variance;
    if is_clash { OF_THE_WAY * way.length() } else { f32::INFINITY }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::cache::{Cache, VolumeCache};
    use crate::math::Vec3;
    use crate::spectrum::{Gradient, Spectrum};

    fn record(x: f32, light: f32, slope: f32) -> Record {
        let gradient = Gradient::outer(Spectrum::splat(slope), Vec3::X);
        Record { position: Vec3::X * x, radius: 1.0, value: Spectrum::splat(light), gradient }
    }

    #[test]
    fn what_agrees_or_may_be_noise_stays() {
        // As steep as the gradient says.
        assert_eq!(reach(&record(0.0, 1.0, 18.0), &record(0.5, 10.0, 0.0), 0.0), f32::INFINITY);
        assert_eq!(reach(&record(0.0, 1.0, 0.0), &record(0.5, 10.0, 0.0), 0.0), 0.35);
        assert_eq!(reach(&record(0.0, 10.0, 0.0), &record(0.5, 1.0, 0.0), 0.0), 0.35);
        // Twice as bright is no border, and five times as bright none where their variances are a half in sum.
        assert_eq!(reach(&record(0.0, 2.0, 0.0), &record(0.5, 1.0, 0.0), 0.0), f32::INFINITY);
        assert_eq!(reach(&record(0.0, 5.0, 0.0), &record(0.5, 1.0, 0.0), 0.5), f32::INFINITY);
        assert_eq!(reach(&record(0.0, 5.0, 0.0), &record(0.5, 1.0, 0.0), 0.2), 0.35);
        assert_eq!(reach(&record(0.0, 0.0, 0.0), &record(0.5, 0.0, 0.0), 0.0), f32::INFINITY);
        // What is foretold to be less than nothing is dark.
        assert_eq!(reach(&record(0.0, 1.0, -18.0), &record(0.5, 0.0, 0.0), 0.0), f32::INFINITY);
    }

    /// Two bright records before a wall of shadow, and dark ones behind it: all reach up to it, and no farther.
    #[test]
    fn records_are_parted_where_light_ends() {
        let mut cache: VolumeCache = Cache::growing(0);
        for i in 0..10 {
            let x = 0.2 * i as f32;
            cache.insert(record(x, if x < 0.9 { 10.0 } else { 1.0 }, 0.0), &[]).unwrap();
        }
        cache.finish().unwrap();
        assert!(cache.limit(&|_, [here, there]| reach(here, there, 0.0)).unwrap() > 0);
        for record in cache.records() {
            let x = record.position.x;
            let across =
                cache.records().iter().map(|other| other.position.x).filter(|other| (*other < 0.9) != (x < 0.9));
            let nearest = across.map(|other| (other - x).abs()).fold(f32::INFINITY, f32::min);
            let expected = if nearest < 1.0 { OF_THE_WAY * nearest } else { 1.0 };
            assert!((record.radius - expected).abs() < 1e-6, "{x}: {} instead of {expected}", record.radius);
        }
        // The index knows it.
        let mut met = 0;
        cache.visit(Vec3::X * 0.8, |_, record, _| met += u32::from(record.value[0] < 10.0));
        assert_eq!(met, 0);
        assert_eq!(cache.limit(&|_, [here, there]| reach(here, there, 0.0)).unwrap(), 0);
    }
}
