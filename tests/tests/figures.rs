//! What figures 4 and 5 of Jarosz et al. 2008 claim.

use fogbow_examples::figures::extrapolation::{heterogeneous, homogeneous};
use fogbow_examples::figures::radius::{claims, radii, twenty, two};

#[test]
fn valid_radii_stay_below_the_optimum_where_logarithmic_gradients_diverge() {
    for lamps in [two(), twenty()] {
        let radii = radii(&lamps, 1000);
        assert!(radii.len() > 900);
        let claims = claims(&radii);
        assert!(claims.ours[0] > 0.0 && claims.ours[1] < 1.0, "{claims:?}");
        assert!(claims.safe >= 0.95 && claims.safe_constant >= 0.95, "{claims:?}");
        // Between two neighbours is a saddle point; sampled, its radius is large instead of infinite.
        let mut order: Vec<f64> = lamps.iter().map(|lamp| lamp.0).collect();
        order.sort_by(f64::total_cmp);
        for pair in order.windows(2) {
            let between = radii.iter().filter(|r| (pair[0]..pair[1]).contains(&r.x));
            let (log, ours) = between.fold((0.0, 0.0), |m: (f64, f64), r| (m.0.max(r.log_gradient), m.1.max(r.ours)));
            assert!(log > 5.0 * ours && ours < 0.5 * (pair[1] - pair[0]), "{pair:?}: {log} and {ours}");
        }
    }
}

#[test]
fn exponential_extrapolation_beats_linear_and_linear_beats_constant() {
    for (name, slice) in [("even fog", homogeneous(96)), ("smoke", heterogeneous(96))] {
        let [constant, linear, exponential, _] = slice.errors();
        println!("{name}: {} records, {constant} {linear} {exponential}", slice.records);
        assert!(exponential < linear && linear < constant, "{name}: {constant} {linear} {exponential}");
        assert!(slice.carried.iter().flatten().all(|l| *l > 0.0), "{name}: holes");
    }
}
