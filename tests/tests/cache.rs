//! The radiance cache: radii, records, mixtures and look-ups. What fills it: `cache_light.rs`.

use fogbow::cache::{
    Basis, Blend, Cache, Extrapolation, Facing, InsertError, Limits, Reading, Record, SurfaceCache, TurningBasis,
    VolumeCache, clamp_gradient, exponent_limit, log_gradient_radius, neighbour_clamped, valid_radius, weight,
};
use fogbow::math::Vec3;
use fogbow::sampling::{Generator, uniform};
use fogbow::sh::Coefficient;
use fogbow::single_scatter::{Contribution, Sums};
use fogbow::spectrum::{Gradient, Spectrum};
use fogbow::storage::Chunk;
use proptest::prelude::*;

const KINDS: [Extrapolation; 4] =
    [Extrapolation::Curved, Extrapolation::Exponential, Extrapolation::Linear, Extrapolation::Constant];

/// The same cases in every run.
fn config() -> ProptestConfig {
    ProptestConfig {
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Wider than anything a test asks for.
const WIDE: Limits = Limits { min: 0.0, max: f32::MAX };

fn sums(samples: &[(Contribution, bool)]) -> Sums {
    let mut sums = Sums::default();
    samples.iter().for_each(|(light, visible)| sums.add(light, *visible));
    sums
}

fn light(radiance: f32, slope: Vec3) -> Contribution {
    Contribution { radiance: Spectrum::splat(radiance), gradient: Gradient::outer(Spectrum::ONE, slope) }
}

fn vector(size: f32) -> impl Strategy<Value = Vec3> {
    [-size..size, -size..size, -size..size].prop_map(Vec3::from)
}

fn colour() -> impl Strategy<Value = Spectrum> {
    [0.01..5.0_f32, 0.01..5.0_f32, 0.01..5.0_f32].prop_map(Spectrum)
}

fn gradient(size: f32) -> impl Strategy<Value = Gradient> {
    [vector(size), vector(size), vector(size)].prop_map(|[r, g, b]| Gradient::from_channels(r, g, b))
}

fn contributions() -> impl Strategy<Value = Vec<(Contribution, bool)>> {
    let one = (colour(), gradient(3.0), any::<bool>())
        .prop_map(|(radiance, gradient, visible)| (Contribution { radiance, gradient }, visible));
    prop::collection::vec(one, 1..6)
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn radii_do_not_depend_on_the_brightness_of_the_scene(samples in contributions(), tolerance in 0.01..2.0_f32) {
        let expected = valid_radius(&sums(&samples), tolerance).unwrap();
        for scale in [1e-30, 1e30] {
            let scaled: Vec<_> = samples
                .iter()
                .map(|(l, v)| (Contribution { radiance: l.radiance * scale, gradient: l.gradient * scale }, *v))
                .collect();
            let got = valid_radius(&sums(&scaled), tolerance).unwrap();
            prop_assert!((got - expected).abs() <= 1e-5 * expected, "{scale:e}: {got} instead of {expected}");
        }
    }

    #[test]
    fn radii_shrink_as_the_scene_does(samples in contributions(), scale in 0.01..100.0_f32) {
        let shrunk: Vec<_> = samples.iter().map(|(l, v)| (Contribution { gradient: l.gradient * scale, ..*l }, *v)).collect();
        let (a, b) = (valid_radius(&sums(&samples), 0.3).unwrap(), valid_radius(&sums(&shrunk), 0.3).unwrap());
        prop_assert!((a - b * scale).abs() <= 1e-5 * a);
    }

    #[test]
    fn radii_are_proportional_to_the_tolerance(samples in contributions(), tolerance in 0.01..2.0_f32) {
        let sums = sums(&samples);
        let (once, twice) = (valid_radius(&sums, tolerance).unwrap(), valid_radius(&sums, 2.0 * tolerance).unwrap());
        prop_assert!((twice - 2.0 * once).abs() <= 1e-6 * twice);
    }

    /// `‖Σ∇L_j‖ ≤ Σ‖∇L_j‖`: what Eq. 34 gains over the logarithmic gradient is safety.
    #[test]
    fn radii_never_exceed_those_of_the_logarithmic_gradient(samples in contributions()) {
        let sums = sums(&samples);
        let plain = log_gradient_radius(sums.value, &sums.gradient, 0.3);
        prop_assert!(valid_radius(&sums, 0.3).unwrap() <= plain * (1.0 + 1e-5) || sums.value.is_black());
    }

    #[test]
    fn no_record_may_be_carried_by_more_than_its_tolerance(samples in contributions(), tolerance in 0.0..1.0_f32) {
        let sums = sums(&samples);
        let limits = Limits { min: 0.05, max: 2.0 };
        let Some(record) = Record::new(Vec3::ZERO, &sums, tolerance, limits) else { return Ok(()) };
        prop_assert!((0.05..=2.0).contains(&record.radius));
        // Where the least radius wins, the clamped gradient allows a factor of e.
        let bound = if record.radius > 0.05 { tolerance } else { tolerance.max(1.0) };
        for c in 0..3 {
            let exponent = record.gradient.norm()[c] * record.radius;
            prop_assert!(exponent <= bound * record.value[c] * (1.0 + 1e-4), "{exponent} of {:?}", record.value);
        }
    }

    #[test]
    fn clamped_gradients_keep_their_direction(value in colour(), slope in gradient(30.0), radius in 0.01..2.0_f32) {
        let clamped = clamp_gradient(&slope, value, radius);
        for c in 0..3 {
            let (before, after) = (slope.channel(c), clamped.channel(c));
            prop_assert!(after.length() * radius <= value[c] * (1.0 + 1e-5));
            prop_assert!(after.length() <= before.length() * (1.0 + 1e-5));
            prop_assert!(before.cross(after).length() <= 1e-4 * before.length_squared());
            prop_assert!(before.dot(after) >= 0.0);
        }
    }

    /// A record that comes in reaches no farther than its neighbours allow, and none grows by it.
    #[test]
    fn neighbours_bound_each_other(places in prop::collection::vec((vector(1.0), 0.01..3.0_f32), 2..40)) {
        let mut cache: VolumeCache<'_> = Cache::growing(0);
        for (position, radius) in places {
            let before: Vec<f32> = cache.records().iter().map(|r| r.radius).collect();
            cache.insert(record(position, radius), &[]).unwrap();
            let (newest, others) = cache.records().split_last().unwrap();
            for (other, before) in others.iter().zip(before) {
                prop_assert!(newest.radius <= other.radius + newest.position.distance(other.position) + 1e-5);
                prop_assert!(other.radius <= before && newest.radius <= radius);
            }
        }
    }

    #[test]
    fn limits_on_the_screen_stay_within_those_of_the_world(
        least in 0.0..4.0_f32, more in 0.0..100.0_f32, distance in 0.0..1e4_f32, pixel in 1e-5..0.1_f32,
    ) {
        let world = Limits { min: 0.01, max: 2.0 };
        let screen = world.on_screen(least, least + more, pixel, distance);
        prop_assert!(world.min <= screen.min && screen.min <= screen.max && screen.max <= world.max, "{screen:?}");
        let nearest = (least * pixel * distance).clamp(world.min, screen.max);
        prop_assert!((screen.min - nearest).abs() <= 1e-6 * nearest, "{screen:?}");
    }
}

#[test]
fn undefined_radii_have_defined_answers() {
    assert_eq!(valid_radius(&Sums::default(), 0.5), None, "no light at all");
    assert_eq!(valid_radius(&sums(&[(light(1.0, Vec3::ZERO), true)]), 0.5), None, "no gradient");
    assert_eq!(valid_radius(&sums(&[(light(0.0, Vec3::X), true)]), 0.5), Some(0.0), "black, but it could change");
    let hidden = [(light(2.0, Vec3::X), false)];
    assert_eq!(valid_radius(&sums(&hidden), 0.5), Some(1.0), "occluded: the unshadowed estimate remains");
    let limits = Limits { min: 0.1, max: 4.0 };
    assert_eq!((limits.clamp(None), limits.clamp(Some(0.0)), limits.clamp(Some(9.0))), (4.0, 0.1, 4.0));
}

#[test]
fn with_tolerance_0_nothing_is_reused() {
    let sums = sums(&[(light(1.0, Vec3::X), true)]);
    assert_eq!(valid_radius(&sums, 0.0), Some(0.0));
    assert_eq!(Record::new(Vec3::ZERO, &sums, 0.0, WIDE), None, "a record without extent");
    let least = Limits { min: 0.25, max: 1.0 };
    assert_eq!(Record::new(Vec3::ZERO, &sums, 0.0, least).unwrap().radius, 0.25);
}

#[test]
fn energies_far_from_1_make_records_like_any_other() {
    for scale in [1e-30_f32, 1.0, 1e30] {
        let sums = sums(&[(light(2.0 * scale, Vec3::X * scale), true)]);
        let record = Record::new(Vec3::ZERO, &sums, 0.5, Limits { min: 0.1, max: 4.0 }).unwrap();
        assert_eq!(record.radius, 1.0);
        let mut cache: VolumeCache<'_> = Cache::growing(0);
        assert_eq!(cache.insert(record, &[]), Ok(()));
        for extrapolation in KINDS {
            let reading = Reading { extrapolation, ..Reading::new(0.5) };
            let got = cache.lookup(Vec3::X * 0.5, &Basis::new(Vec3::Z, 0), &reading).unwrap() / scale;
            let expected = match extrapolation {
                Extrapolation::Exponential => 2.0 * 0.25_f32.exp(),
                // One record tells nothing of curvature.
                Extrapolation::Curved | Extrapolation::Linear => 2.5,
                Extrapolation::Constant => 2.0,
            };
            assert!((got[0] - expected).abs() < 1e-4 * expected, "{extrapolation:?}, {scale:e}: {got:?}");
        }
    }
}

#[test]
fn a_neighbour_tells_of_what_a_record_missed() {
    assert_eq!(neighbour_clamped(3.0, Vec3::ZERO, (Vec3::X, 0.5)), 1.5);
    assert_eq!(neighbour_clamped(1.0, Vec3::ZERO, (Vec3::X, 0.5)), 1.0);
}

#[test]
fn records_that_are_no_numbers_are_left_out() {
    let mut cache: VolumeCache<'_> = Cache::growing(0);
    let good = record(Vec3::ZERO, 1.0);
    let nan = Spectrum::splat(f32::NAN);
    for bad in [
        Record { radius: 0.0, ..good },
        Record { radius: f32::NAN, ..good },
        Record { radius: f32::INFINITY, ..good },
        Record { position: Vec3::splat(f32::NAN), ..good },
        Record { value: nan, ..good },
        Record { value: Spectrum::splat(-1.0), ..good },
        Record { gradient: Gradient::outer(nan, Vec3::X), ..good },
    ] {
        assert_eq!(cache.insert(bad, &[]), Err(InsertError::Record), "{bad:?}");
    }
    assert!(cache.is_empty());
}

#[test]
fn attachments_that_are_no_numbers_or_of_another_number_are_refused() {
    let good = record(Vec3::ZERO, 1.0);
    let nan = Coefficient { value: Spectrum::splat(f32::NAN), ..Coefficient::ZERO };
    let steep =
        Coefficient { gradient: Gradient::outer(Spectrum::splat(f32::INFINITY), Vec3::ONE), ..Coefficient::ZERO };
    let mut cache: VolumeCache<'_> = Cache::growing(3);
    for bad in [nan, steep] {
        let attached = [Coefficient::ZERO, Coefficient::ZERO, bad];
        assert_eq!(cache.insert(good, &attached), Err(InsertError::Attachment(2)));
    }
    assert_eq!(cache.insert(good, &[Coefficient::ZERO; 4]), Err(InsertError::Stride { found: 4, due: 3 }));
    assert!(cache.is_empty());

    cache.insert(good, &[Coefficient::ZERO; 3]).unwrap();
    let mut revise = |value, attached: &[Coefficient]| cache.revise(0, value, &Gradient::ZERO, attached);
    assert_eq!(revise(Spectrum::ONE, &[nan; 3]), Err(InsertError::Attachment(0)));
    assert_eq!(revise(Spectrum::ONE, &[]), Err(InsertError::Stride { found: 0, due: 3 }));
    assert_eq!(revise(Spectrum::splat(-1.0), &[Coefficient::ZERO; 3]), Err(InsertError::Record));
    assert_eq!((cache.records(), cache.attachments()), (&[good][..], &[Coefficient::ZERO; 3][..]));

    let mut floor: SurfaceCache<'_> = Cache::growing(1);
    for normal in [Vec3::splat(f32::NAN), Vec3::ZERO, Vec3::Y * 2.0] {
        let facing = Facing { normal, turn: Gradient::ZERO };
        assert_eq!(floor.insert(good, &[facing]), Err(InsertError::Attachment(0)), "{normal}");
    }
}

/// No room for a third: neither its neighbours nor anything else may know that it was there.
#[test]
fn a_full_cache_is_as_before() {
    for spare in [0, 1] {
        // A chunk more is not enough for a third record.
        let mut memory = vec![Chunk::default(); VolumeCache::chunks(2, 3) + spare];
        let mut cache = VolumeCache::lent(&mut memory, 3);
        for x in [0.0, 3.0] {
            cache.insert(record(Vec3::X * x, 5.0), &[Coefficient::ZERO; 3]).unwrap();
        }
        let before = (cache.records().to_vec(), cache.attachments().to_vec());
        assert_eq!(cache.insert(record(Vec3::X, 0.1), &[Coefficient::ZERO; 3]), Err(InsertError::Full));
        assert_eq!((cache.records().to_vec(), cache.attachments().to_vec()), before);
    }
}

/// What [`Cache::visit`] has to find, to the last bit.
fn containing(records: &[Record], point: Vec3, wide: f32) -> Vec<(u32, u32)> {
    let share = |record: &Record| {
        let offset = (point - record.position) * (1.0 / (wide * record.radius));
        (offset.x * offset.x + offset.y * offset.y + offset.z * offset.z).sqrt()
    };
    (0..).zip(records).map(|(i, r)| (i, share(r))).filter(|f| f.1 < 1.0).map(|(i, s)| (i, s.to_bits())).collect()
}

/// Whether a record is in the index yet, and with which radius it came there, decides nothing.
#[test]
fn a_cache_knows_the_radii_of_now() {
    let rng = &mut Generator::new(5);
    let mut point = move || Vec3::new(uniform(rng), uniform(rng), uniform(rng));
    let mut cache: VolumeCache<'_> = Cache::growing(0);
    for round in 0..600 {
        // Ever smaller ones, which clamp what is there.
        cache.insert(record(point(), 2.0 / (round + 3) as f32), &[]).unwrap();
        if round == 300 {
            cache.finish().unwrap();
        }
        for _ in 0..8 {
            let at = point() * 1.2;
            let (mut found, mut wide) = (Vec::new(), Vec::new());
            cache.visit(at, |i, _, share| found.push((i, share.to_bits())));
            cache.visit_wide(at, |i, _, share| wide.push((i, share.to_bits())));
            assert_eq!(found, containing(cache.records(), at, 1.0), "{round}");
            let finished = if round < 300 { 0 } else { 301 };
            assert_eq!(wide, containing(&cache.records()[..finished], at, 2.0), "{round}");
        }
    }
}

fn record(position: Vec3, radius: f32) -> Record {
    Record { position, radius, value: Spectrum::ONE, gradient: Gradient::ZERO }
}

/// The weight of a record at a share of its radius.
fn at_share(share: f32) -> f32 {
    weight(1.0 - share)
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn one_record_carries_an_exponential_field_exactly(
        value in colour(), slope in vector(1.0), offset in vector(0.5), share in 0.0..0.99_f32,
    ) {
        let mut blend = Blend::new(Extrapolation::Exponential, 4.0);
        blend.add(at_share(share), value, &Gradient::outer(value, slope), offset);
        let (got, truth) = (blend.value().unwrap(), value * slope.dot(offset).exp());
        for c in 0..3 {
            prop_assert!((got[c] - truth[c]).abs() <= 2e-5 * truth[c], "{got:?}, {truth:?}");
        }
    }

    /// Any number of records of one exponential field say the same.
    #[test]
    fn mixtures_are_exact_in_exponential_fields(
        slope in vector(0.5), point in vector(0.4), others in prop::collection::vec(vector(0.5), 1..8),
    ) {
        let field = |p: Vec3| Spectrum::new(1.0, 0.3, 2.0) * slope.dot(p).exp();
        let mut cache: VolumeCache<'_> = Cache::growing(0);
        for position in others {
            let value = field(position);
            cache.insert(Record { position, radius: 2.0, value, gradient: Gradient::outer(value, slope) }, &[]).unwrap();
        }
        let reading = Reading { extrapolation: Extrapolation::Exponential, ..Reading::new(1.0) };
        let got = cache.lookup(point, &Basis::new(Vec3::Z, 0), &reading).unwrap();
        for c in 0..3 {
            prop_assert!((got[c] / field(point)[c] - 1.0).abs() < 1e-4, "{got:?}");
        }
    }

    #[test]
    fn a_mixture_lies_between_its_parts(values in prop::collection::vec((colour(), 0.01..1.0_f32), 1..8)) {
        for kind in KINDS {
            let mut blend = Blend::new(kind, 4.0);
            values.iter().for_each(|(value, weight)| blend.add(*weight, *value, &Gradient::ZERO, Vec3::X));
            let mixture = blend.value().unwrap();
            for c in 0..3 {
                let low = values.iter().map(|(v, _)| v[c]).fold(f32::MAX, f32::min);
                let high = values.iter().map(|(v, _)| v[c]).fold(0.0, f32::max);
                prop_assert!(low * 0.9999 <= mixture[c] && mixture[c] <= high * 1.0001, "{kind:?}: {mixture:?}");
            }
        }
    }

    /// Where another record covers it, the edge of a record cannot be seen.
    #[test]
    fn the_edge_of_a_record_is_smooth_where_another_covers(value in colour(), slope in gradient(1.0)) {
        let mut cache: VolumeCache<'_> = Cache::growing(0);
        cache.insert(record(Vec3::ZERO, 2.0), &[]).unwrap();
        let steep = clamp_gradient(&slope, value, 0.5);
        cache.insert(Record { position: Vec3::X, radius: 0.5, value, gradient: steep }, &[]).unwrap();
        prop_assert_eq!(cache.records()[0].radius, 1.5, "clamped by its neighbour");
        for extrapolation in KINDS {
            let reading = Reading { extrapolation, ..Reading::new(1.0) };
            let at = |x: f32| cache.lookup(Vec3::new(x, 0.1, 0.0), &Basis::new(Vec3::Z, 0), &reading).unwrap();
            let edge = 1.0 - (0.25_f32 - 0.01).sqrt();
            let (outside, inside) = (at(edge - 1e-4), at(edge + 1e-4));
            for c in 0..3 {
                prop_assert!((inside[c] - outside[c]).abs() < 1e-3, "{extrapolation:?}: {inside:?} {outside:?}");
            }
        }
    }

    /// Finite records make finite mixtures, whatever the size and sign of what they hold.
    #[test]
    fn mixtures_of_finite_records_are_numbers(
        parts in prop::collection::vec((0.0..1.0_f32, wild(), wild()), 1..5), tolerance in 0.0..10.0_f32,
    ) {
        for kind in KINDS {
            let mut blend = Blend::new(kind, exponent_limit(tolerance));
            for &(weight, value, change) in &parts {
                blend.add(weight, Spectrum::splat(value), &Gradient::outer(Spectrum::splat(change), Vec3::X), Vec3::X);
            }
            let Some(mixture) = blend.value() else { continue };
            prop_assert!(!mixture[0].is_nan(), "{kind:?}: {mixture:?}");
            if kind == Extrapolation::Exponential {
                prop_assert!(mixture[0] >= 0.0, "{kind:?}: {mixture:?}");
            }
        }
    }
}

/// `f = a + b·p + ½ pᵀ H p` with its gradient.
#[derive(Debug, Clone, Copy)]
struct Quadratic {
    a: f32,
    b: Vec3,
    /// Symmetric.
    h: [Vec3; 3],
}

impl Quadratic {
    fn bent(&self, p: Vec3) -> Vec3 {
        self.h[0] * p.x + self.h[1] * p.y + self.h[2] * p.z
    }

    fn at(&self, p: Vec3) -> f32 {
        self.a + self.b.dot(p) + 0.5 * p.dot(self.bent(p))
    }

    fn add_to(&self, blend: &mut Blend, weight: f32, record: Vec3, point: Vec3) {
        let slope = Gradient::outer(Spectrum::ONE, self.b + self.bent(record));
        blend.add(weight, Spectrum::splat(self.at(record)), &slope, point - record);
    }
}

fn quadratic() -> impl Strategy<Value = Quadratic> {
    (-1.0..1.0_f32, vector(1.0), vector(2.0), vector(2.0)).prop_map(|(a, b, d, o)| Quadratic {
        a,
        b,
        h: [Vec3::new(d.x, o.x, o.y), Vec3::new(o.x, d.y, o.z), Vec3::new(o.y, o.z, d.z)],
    })
}

proptest! {
    #![proptest_config(config())]

    /// Records in pairs around the point, each pair of one weight, tell it exactly.
    #[test]
    fn curved_mixtures_are_exact_for_quadratic_light_that_records_surround(
        light in quadratic(), point in vector(1.0), pairs in prop::collection::vec((vector(1.0), 0.01..1.0_f32), 1..6),
    ) {
        let mut blend = Blend::new(Extrapolation::Curved, 4.0);
        for (offset, weight) in pairs {
            light.add_to(&mut blend, weight, point + offset, point);
            light.add_to(&mut blend, weight, point - offset, point);
        }
        let got = blend.value().unwrap()[0];
        prop_assert!((got - light.at(point)).abs() < 2e-5, "{got} instead of {}", light.at(point));
    }

    /// Elsewhere they miss it by `½ Δ̄ᵀ H Δ̄` with the mean way `Δ̄` from the records to the point.
    #[test]
    fn curved_mixtures_miss_quadratic_light_by_its_curvature_at_the_mean_offset(
        light in quadratic(), point in vector(1.0), records in prop::collection::vec((vector(1.0), 0.01..1.0_f32), 1..8),
    ) {
        let mut blend = Blend::new(Extrapolation::Curved, 4.0);
        let (mut offset, mut total) = (Vec3::ZERO, 0.0);
        for (record, weight) in records {
            light.add_to(&mut blend, weight, record, point);
            offset += (point - record) * weight;
            total += weight;
        }
        let offset = offset / total;
        let expected = light.at(point) - 0.5 * offset.dot(light.bent(offset));
        let got = blend.value().unwrap()[0];
        prop_assert!((got - expected).abs() < 5e-5, "{got} instead of {expected}");
    }

    /// Noise of mean 0 in what records hold adds noise of mean 0 to mixtures.
    #[test]
    fn curved_mixtures_are_linear_in_what_records_hold(
        records in prop::collection::vec((0.01..1.0_f32, vector(1.0), (colour(), gradient(3.0)), (colour(), gradient(3.0))), 1..8),
        factor in -2.0..2.0_f32,
    ) {
        let [mut one, mut other, mut both] = [Blend::new(Extrapolation::Curved, 4.0); 3];
        for (weight, offset, (l, dl), (m, dm)) in &records {
            one.add(*weight, *l, dl, *offset);
            other.add(*weight, *m, dm, *offset);
            both.add(*weight, *l + *m * factor, &(*dl + *dm * factor), *offset);
        }
        let expected = one.value().unwrap() + other.value().unwrap() * factor;
        let got = both.value().unwrap();
        for c in 0..3 {
            prop_assert!((got[c] - expected[c]).abs() < 1e-4, "{got:?} instead of {expected:?}");
        }
    }

    /// Where expansions are even around their records, the tangential gradient of a mixture is that of its value.
    /// (Carried by their gradients, they turn otherwise by the change along the way, which is left out.)
    #[test]
    fn mixtures_turn_with_the_direction_as_their_gradients_say(
        degree in 1_usize..=3, to_eye in vector(1.0), point in vector(0.3), seed in 0..1000_u64,
    ) {
        prop_assume!(to_eye.length() > 0.1);
        let to_eye = to_eye.normalize();
        let mut cache: VolumeCache<'_> = Cache::growing((degree + 1) * (degree + 1) - 1);
        let mut rng = Generator::new(seed);
        let mut unit = || uniform(&mut rng);
        for _ in 0..5 {
            let position = Vec3::new(unit(), unit(), unit()) - 0.5;
            let higher: Vec<_> = (0..cache.stride())
                .map(|_| Coefficient { value: Spectrum::new(unit(), unit(), unit()), gradient: Gradient::ZERO })
                .collect();
            let gradient = Gradient::outer(Spectrum::ONE, Vec3::new(unit(), unit(), unit()));
            cache.insert(Record { gradient, ..record(position, 3.0) }, &higher).unwrap();
        }
        cache.finish().unwrap();
        let reading = Reading::new(0.5);
        let at = |to_eye: Vec3| cache.lookup_with_gradients(point, &TurningBasis::new(to_eye, degree), &reading).unwrap();
        let (light, turned) = at(to_eye);
        let (across, _) = to_eye.any_orthonormal_pair();
        for axis in [across, to_eye.cross(across)] {
            let h = 0.01_f32;
            let change = (at(to_eye * h.cos() + axis * h.sin()).0.radiance - at(to_eye * h.cos() - axis * h.sin()).0.radiance)
                / (2.0 * h);
            for c in 0..3 {
                let expected = turned.along(axis)[c];
                // Differences of degree 3 over 0.01: about 3² · 0.01²/6 of them.
                prop_assert!((change[c] - expected).abs() < 2e-3, "{axis}: {expected} instead of {}", change[c]);
            }
        }
        prop_assert!(turned.along(to_eye).map(f32::abs).max_element() < 1e-4, "not tangential: {turned:?}");
        // The value is that of a plain look-up, the gradient that of the records, weights held.
        let plain = cache.lookup(point, &Basis::new(to_eye, degree), &reading).unwrap();
        let (mut slope, mut total) = (Gradient::ZERO, 0.0);
        for record in cache.records() {
            let weight = weight(1.0 - record.position.distance(point) / record.radius);
            slope += record.gradient * weight;
            total += weight;
        }
        let apart = (light.gradient * total - slope).norm().max_element();
        prop_assert!(apart < 1e-4 * total, "{:?}", light.gradient);
        for c in 0..3 {
            prop_assert!((plain[c] - light.radiance[c].max(0.0)).abs() < 1e-5, "{plain:?}, {light:?}");
        }
    }
}

/// A number of any sign, up to 10³⁰ in size: sums of a few stay finite.
fn wild() -> impl Strategy<Value = f32> {
    prop_oneof![
        Just(0.0_f32),
        (-38.0..30.0_f32, any::<bool>()).prop_map(|(e, s)| {
            let size = 10.0_f32.powf(e);
            if s { size } else { -size }
        })
    ]
}

#[test]
fn a_black_record_darkens_by_its_weight_and_no_more() {
    for (kind, expected) in [(Extrapolation::Exponential, 1.5), (Extrapolation::Curved, 1.5)] {
        let mut blend = Blend::new(kind, 4.0);
        blend.add(0.25, Spectrum::new(0.0, 2.0, 0.0), &Gradient::ZERO, Vec3::X);
        blend.add(0.75, Spectrum::new(2.0, 2.0, 0.0), &Gradient::ZERO, Vec3::X);
        let mixture = blend.value().unwrap();
        assert!((mixture[0] - expected).abs() < 1e-6 && (mixture[1] - 2.0).abs() < 1e-6, "{kind:?}: {mixture:?}");
        assert_eq!(mixture[2], 0.0, "{kind:?}");
        assert_eq!(blend.weight(), 1.0);
    }
}

#[test]
fn negative_channels_never_come_out() {
    let steep = Gradient::outer(Spectrum::splat(10.0), Vec3::X);
    let mut blend = Blend::new(Extrapolation::Exponential, 4.0);
    blend.add(1.0, Spectrum::splat(-0.5), &steep, Vec3::X);
    assert_eq!(blend.value(), Some(Spectrum::ZERO));
    // Other mixtures are linear in what is stored, and may turn negative: look-ups cut that off.
    let mut cache: VolumeCache<'_> = Cache::growing(0);
    cache.insert(Record { gradient: steep, ..record(Vec3::ZERO, 1.0) }, &[]).unwrap();
    cache.finish().unwrap();
    for extrapolation in KINDS {
        let reading = Reading { extrapolation, ..Reading::new(0.5) };
        // Within the record, and in the gap beside it.
        for x in [-0.5, -1.2] {
            let got = cache.lookup(Vec3::X * x, &Basis::new(Vec3::Z, 0), &reading).unwrap();
            assert!(got[0] >= 0.0, "{extrapolation:?} at {x}: {got:?}");
        }
    }
    assert_eq!(Blend::new(Extrapolation::Exponential, 4.0).value(), None, "nothing took part");
}

#[test]
fn steep_slopes_of_nearly_black_directions_do_not_explode() {
    let limit = exponent_limit(0.1);
    assert_eq!(limit, 4.0);
    let mut blend = Blend::new(Extrapolation::Exponential, limit);
    let steep = Gradient::outer(Spectrum::ONE, Vec3::X);
    blend.add(1.0, Spectrum::splat(1e-6), &steep, Vec3::X);
    assert!(blend.value().unwrap()[0] < 1e-6 * 55.0, "{blend:?}");
    let mut blend = Blend::new(Extrapolation::Curved, limit);
    blend.add(1.0, Spectrum::splat(1e-6), &steep, Vec3::X);
    assert!(blend.value().unwrap()[0] < 1.0001, "no farther than the slope goes: {blend:?}");
}

/// Records at random places, with expansions.
fn scattered(count: usize, stride: usize) -> VolumeCache<'static> {
    let mut cache: VolumeCache<'static> = Cache::growing(stride);
    let mut unit = random();
    for _ in 0..count {
        let position = Vec3::new(unit(), unit(), unit());
        let value = Spectrum::new(unit(), unit(), unit()) + Spectrum::splat(0.1);
        let slope = Vec3::new(unit(), unit(), unit()) - 0.5;
        let gradient = Gradient::outer(value, slope);
        let higher: Vec<_> = (0..stride)
            .map(|_| Coefficient { value: value * (0.2 * unit()), gradient: gradient * (0.2 * unit()) })
            .collect();
        cache.insert(Record { position, radius: 0.05 + 0.3 * unit(), value, gradient }, &higher).unwrap();
    }
    cache
}

/// Numbers in [0, 1).
fn random() -> impl FnMut() -> f32 {
    let mut rng = Generator::new(5);
    move || uniform(&mut rng)
}

#[test]
fn lookups_equal_brute_force_before_and_after_indexing() {
    for degree in [0, 2] {
        let mut cache = scattered(300, (degree + 1) * (degree + 1) - 1);
        for finished in [false, true] {
            if finished {
                cache.finish().unwrap();
            }
            let mut unit = random();
            let mut covered = 0;
            for _ in 0..400 {
                let point = Vec3::new(unit(), unit(), unit()) * 1.2 - 0.1;
                let to_eye = (Vec3::new(unit(), unit(), unit()) - 0.5).normalize();
                let basis = Basis::new(to_eye, degree);
                for extrapolation in KINDS {
                    let reading = Reading { extrapolation, ..Reading::new(0.5) };
                    let expected = brute(&cache, point, to_eye, &reading);
                    assert_eq!(cache.covers(point, &reading), expected.is_some());
                    let Some(expected) = expected else { continue };
                    covered += 1;
                    let got = cache.lookup(point, &basis, &reading).unwrap();
                    for c in 0..3 {
                        let scale = expected[c].abs() + 1e-3;
                        assert!((got[c] - expected[c]).abs() < 2e-4 * scale, "{got:?} instead of {expected:?}");
                    }
                }
            }
            assert!(covered > 400, "{covered}");
        }
    }
}

/// The mixture of all records, one by one.
fn brute(cache: &VolumeCache<'_>, point: Vec3, to_eye: Vec3, reading: &Reading) -> Option<Spectrum> {
    let mut blend = Blend::new(reading.extrapolation, exponent_limit(reading.tolerance));
    let mut y = [0.0; 9];
    let y = &mut y[..=cache.stride()];
    fogbow::sh::evaluate(to_eye, cache.degree(), y);
    for (i, record) in cache.records().iter().enumerate() {
        let share = record.position.distance(point) / record.radius;
        if share < 1.0 {
            let (mut value, mut gradient) = (record.value, record.gradient);
            for (c, y) in cache.attached(i as u32).iter().zip(&y[1..]) {
                value += c.value * *y;
                gradient += c.gradient * *y;
            }
            blend.add(weight(1.0 - share), value, &gradient, point - record.position);
        }
    }
    blend.value().map(|light| light.max(Spectrum::ZERO))
}

#[test]
fn gaps_are_filled_by_the_nearest_once_filling_is_done() {
    let mut cache: VolumeCache<'_> = Cache::growing(0);
    cache.insert(record(Vec3::ZERO, 1.0), &[]).unwrap();
    let (basis, reading) = (Basis::new(Vec3::Z, 0), Reading::new(0.5));
    let at = |cache: &VolumeCache<'_>, x: f32| cache.lookup(Vec3::X * x, &basis, &reading);
    assert_eq!(at(&cache, 1.5), None);
    cache.finish().unwrap();
    assert!(at(&cache, 1.5).is_some() && !cache.covers(Vec3::X * 1.5, &reading));
    assert_eq!(at(&cache, 2.5), None);

    let (mut floor, reading) = (floor(), Reading::new(0.5));
    let at = |floor: &SurfaceCache<'_>, x: f32| floor.lookup(Vec3::X * x, Vec3::Y, &reading);
    assert_eq!(at(&floor, 1.1), None);
    floor.finish().unwrap();
    // Beyond what is read for the sake of noise, too.
    assert!(at(&floor, 1.4).is_some() && at(&floor, 1.9).is_some());
    assert_eq!(at(&floor, 2.1), None);
}

#[test]
fn while_filling_the_margin_of_every_record_does_not_count() {
    let mut cache: VolumeCache<'_> = Cache::growing(0);
    cache.insert(record(Vec3::ZERO, 1.0), &[]).unwrap();
    let reading = Reading { margin: 0.25, ..Reading::new(0.5) };
    assert!(cache.covers(Vec3::X * 0.7, &reading) && !cache.covers(Vec3::X * 0.8, &reading));
}

/// A record on the floor whose irradiance rises along +x by half per metre.
fn floor() -> SurfaceCache<'static> {
    let mut cache: SurfaceCache<'static> = Cache::growing(1);
    let gradient = Gradient::outer(Spectrum::splat(0.5), Vec3::X);
    let facing = Facing { normal: Vec3::Y, turn: Gradient::outer(Spectrum::splat(0.8), Vec3::X) };
    cache.insert(Record { gradient, ..record(Vec3::ZERO, 1.0) }, &[facing]).unwrap();
    cache
}

/// Once filling is done, more records speak for a point: noise that differs from record to record is averaged over
/// them, and light that changes evenly stays as it is.
#[test]
fn finished_irradiance_averages_noise_and_keeps_slopes() {
    let slope = Gradient::outer(Spectrum::splat(0.5), Vec3::X);
    let facing = Facing { normal: Vec3::Y, turn: Gradient::ZERO };
    let truth = |point: Vec3| 10.0 + 0.5 * point.x;
    let filled = |noise: f32| {
        let mut cache: SurfaceCache<'static> = Cache::growing(1);
        let mut rng = Generator::new(7);
        for i in 0..400 {
            let at = Vec3::new((i % 20) as f32, 0.0, (i / 20) as f32) * 0.8;
            let value = Spectrum::splat(truth(at) + noise * (uniform(&mut rng) - 0.5));
            cache.insert(Record { value, gradient: slope, ..record(at, 1.0) }, &[facing]).unwrap();
        }
        cache
    };
    let reading = Reading::new(0.35);
    let error = |cache: &SurfaceCache<'_>| {
        let mut rng = Generator::new(8);
        let squares = (0..500).map(|_| {
            let [x, z] = [uniform(&mut rng), uniform(&mut rng)].map(|u| 3.0 + 9.0 * u);
            let point = Vec3::new(x, 0.0, z);
            (cache.lookup(point, Vec3::Y, &reading).unwrap()[0] - truth(point)).powi(2)
        });
        (squares.sum::<f32>() / 500.0).sqrt()
    };
    let mut cache = filled(1.0);
    let before = error(&cache);
    cache.finish().unwrap();
    let after = error(&cache);
    assert!(after < 0.7 * before, "{before} before, {after} after");
    let mut exact = filled(0.0);
    exact.finish().unwrap();
    assert!(error(&exact) < 1e-4, "{}", error(&exact));
}

#[test]
fn surface_records_count_on_their_own_plane_and_side() {
    let (floor, reading) = (floor(), Reading::new(0.5));
    let covers = |point: Vec3, normal: Vec3| floor.covers(point, normal, &reading);
    assert!(covers(Vec3::X * 0.9, Vec3::Y));
    assert!(!covers(Vec3::X * 1.1, Vec3::Y), "beyond the radius");
    assert!(!covers(Vec3::ZERO, -Vec3::Y), "the ceiling of the floor below");
    assert!(!covers(Vec3::ZERO, Vec3::X), "the wall beside");
    assert!(covers(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.0).normalize()), "a surface that bends");
    assert!(!covers(Vec3::new(0.0, 0.3, 0.0), Vec3::Y), "a step above");
    assert!(!covers(Vec3::new(0.0, 0.03, 0.0), Vec3::Y), "a doorstep");
    assert!(covers(Vec3::new(0.0, 0.02, 0.0), Vec3::Y), "a bump");
}

#[test]
fn irradiance_changes_with_position_and_normal() {
    let floor = floor();
    let reading = Reading { extrapolation: Extrapolation::Linear, ..Reading::new(0.5) };
    let at = |point: Vec3, normal: Vec3| floor.lookup(point, normal, &reading).unwrap()[0];
    assert!((at(Vec3::X * 0.5, Vec3::Y) - 1.25).abs() < 1e-6);
    let tilted = Vec3::new(0.2, 1.0, 0.0).normalize();
    assert!((at(Vec3::ZERO, tilted) - (1.0 + 0.8 * tilted.x)).abs() < 1e-5);
}
