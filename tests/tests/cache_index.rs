//! The index of the radiance cache finds the spheres that brute force finds, wherever they lie.

use fogbow::cache::{Block, Index, IndexNode};
use fogbow::math::Vec3;
use fogbow::storage::Full;
use proptest::prelude::*;

type Sphere = (Vec3, f32);

/// Every float decides alike only if it is computed alike: this is the index's own test of a sphere.
fn share((centre, radius): Sphere, point: Vec3) -> f32 {
    let offset = (point - centre) * (1.0 / radius);
    (offset.x * offset.x + offset.y * offset.y + offset.z * offset.z).sqrt()
}

fn brute(spheres: &[Sphere], point: Vec3) -> Vec<(u32, f32)> {
    let valid = |s: &Sphere| s.0.is_finite() && s.1.is_finite() && s.1 > 0.0;
    (0..).zip(spheres).filter(|(_, s)| valid(s)).map(|(i, s)| (i, share(*s, point))).filter(|f| f.1 < 1.0).collect()
}

fn found(index: &Index<'_>, point: Vec3) -> Vec<(u32, f32)> {
    let mut found = Vec::new();
    index.visit(point, |i, share| found.push((i, share)));
    found
}

fn build(spheres: &[Sphere]) -> Index<'static> {
    let mut index = Index::new(Vec::new(), Vec::new(), Vec::new(), Vec::new());
    index.rebuild(spheres.len() as u32, |i| spheres[i as usize]).expect("a Vec grows");
    index
}

fn agree(spheres: &[Sphere], points: impl IntoIterator<Item = Vec3>) {
    let index = build(spheres);
    for point in points {
        assert_eq!(found(&index, point), brute(spheres, point), "point {point}");
    }
}

/// Numbers in [0, 1).
fn random(mut state: u64) -> impl FnMut() -> f32 {
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1 << 24) as f32
    }
}

fn point(unit: &mut impl FnMut() -> f32) -> Vec3 {
    Vec3::new(unit(), unit(), unit())
}

/// Centres in a cube of edge 2 around the origin, radii spread over a factor of 30.
fn even(count: usize, seed: u64) -> Vec<Sphere> {
    let mut unit = random(seed);
    (0..count).map(|_| (point(&mut unit) * 2.0 - 1.0, 0.3 * 30_f32.powf(-unit()))).collect()
}

/// Crowds whose radii shrink with the distance from their middles.
fn crowds(count: usize, seed: u64) -> Vec<Sphere> {
    let mut unit = random(seed);
    let middles = [Vec3::ZERO, Vec3::new(0.9, 0.1, -0.3), Vec3::new(-0.5, 0.5, 0.5)];
    (0..count)
        .map(|i| {
            let away = 10_f32.powf(-4.0 * unit());
            (middles[i % 3] + (point(&mut unit) - 0.5) * away, 0.2 * away)
        })
        .collect()
}

#[test]
fn random_spheres_are_found_as_by_brute_force() {
    let mut unit = random(3);
    let points: Vec<Vec3> = (0..2000).map(|_| point(&mut unit) * 3.0 - 1.5).collect();
    for count in [0, 1, 7, 8, 9, 100, 3000] {
        agree(&even(count, 5), points.iter().copied());
    }
}

#[test]
fn crowded_spheres_are_found_as_by_brute_force() {
    let spheres = crowds(3000, 7);
    let mut unit = random(11);
    let near = spheres.iter().map(|(centre, radius)| *centre + (point(&mut unit) - 0.5) * 2.0 * *radius);
    agree(&spheres, near);
}

#[test]
fn spheres_are_found_at_every_scale_and_far_from_the_origin() {
    let mut unit = random(13);
    for scale in [1e-19_f32, 1e-10, 1.0, 1e10, 1e30] {
        for offset in [Vec3::ZERO, Vec3::new(-3.0, 1e3, -1e5), Vec3::new(1e7, -1e7, 1e7)] {
            let spheres: Vec<Sphere> = even(400, 17).iter().map(|s| ((s.0 + offset) * scale, s.1 * scale)).collect();
            let points: Vec<Vec3> = (0..200).map(|_| (point(&mut unit) * 2.0 - 1.0 + offset) * scale).collect();
            agree(&spheres, points.into_iter().chain(spheres.iter().map(|s| s.0)));
        }
    }
}

/// Centres, radii and points on a lattice of negative powers of two: many points lie on borders of
/// cells and on the very surfaces of spheres.
#[test]
fn points_on_borders_miss_nothing() {
    let mut unit = random(19);
    let mut lattice = |steps: f32| (point(&mut unit) * steps).floor() / steps * 2.0 - 1.0;
    let spheres: Vec<Sphere> = (0..2000).map(|i| (lattice(16.0), 1.0 / (1 << (i % 5 + 1)) as f32)).collect();
    let points: Vec<Vec3> = (0..2000).map(|_| lattice(64.0)).collect();
    agree(&spheres, points);

    // Borders of the tree's own cells: the root is known from its room around two extreme spheres.
    let mut spheres = even(3000, 23);
    spheres.push((Vec3::splat(-3.0), 1.0));
    spheres.push((Vec3::splat(3.0), 1.0));
    let (low, edge) = (Vec3::splat(-4.0) - Vec3::new(0.023, 0.031, 0.017) * 8.0, 8.0 * 1.07);
    let mut unit = random(29);
    let border = |_| {
        let exact = low + (point(&mut unit) * 256.0).floor() / 256.0 * edge;
        let neighbour = |x: f32, up: bool| if up { x.next_up() } else { x.next_down() };
        [exact, exact.map(|x| neighbour(x, true)), exact.map(|x| neighbour(x, false))]
    };
    agree(&spheres, (0..5000).flat_map(border).collect::<Vec<_>>());
}

#[test]
fn what_is_no_sphere_is_left_out_and_what_is_no_point_finds_nothing() {
    let mut spheres = even(200, 31);
    spheres[3].1 = 0.0;
    spheres[5].1 = -1.0;
    spheres[7].1 = f32::NAN;
    spheres[11].1 = f32::INFINITY;
    spheres[13].0.x = f32::NAN;
    spheres[17].0.y = f32::NEG_INFINITY;
    let index = build(&spheres);
    assert_eq!(index.len(), 200);
    for p in spheres.iter().map(|s| s.0) {
        assert_eq!(found(&index, p), brute(&spheres, p));
    }
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38, -3e38] {
        for axis in 0..3 {
            let mut p = Vec3::ZERO;
            p[axis] = bad;
            assert_eq!(found(&index, p), [], "{p}");
        }
    }
    let none = build(&[(Vec3::ZERO, 0.0), (Vec3::NAN, 1.0)]);
    assert_eq!((none.len(), found(&none, Vec3::ZERO).len()), (2, 0));
}

#[test]
fn degenerate_crowds_cost_bounded_memory() {
    let count = 100_000;
    let equal = vec![(Vec3::new(1.0, -2.0, 3.0), 0.5); count];
    let nested: Vec<Sphere> =
        (0..count).map(|i| (Vec3::ZERO, 10_f32.powf(i as f32 / count as f32 * 50.0 - 20.0))).collect();
    let tiny: Vec<Sphere> = (0..count).map(|i| (Vec3::splat(if i == 0 { 1e30 } else { i as f32 }), 1e-20)).collect();
    for spheres in [&equal, &nested, &tiny] {
        let index = build(spheres);
        assert!(index.bytes() < 500 * count, "{} bytes a sphere", index.bytes() / count);
        for p in [spheres[0].0, spheres[count / 2].0, Vec3::splat(1e-3), Vec3::splat(1e25)] {
            assert_eq!(found(&index, p), brute(spheres, p));
        }
    }
}

#[test]
fn results_do_not_depend_on_the_order_of_building() {
    let spheres = even(2000, 37);
    let count = spheres.len();
    let mirrored: Vec<Sphere> = spheres.iter().rev().copied().collect();
    let (one, other) = (build(&spheres), build(&mirrored));
    let mut unit = random(41);
    for _ in 0..500 {
        let p = point(&mut unit) * 2.0 - 1.0;
        let mut there: Vec<(u32, f32)> = found(&other, p);
        there.iter_mut().for_each(|f| f.0 = count as u32 - 1 - f.0);
        there.reverse();
        assert_eq!(found(&one, p), there);
    }
}

#[test]
fn building_anew_forgets_what_was_before() {
    let mut index = build(&even(1000, 43));
    let spheres = crowds(300, 47);
    index.rebuild(300, |i| spheres[i as usize]).expect("a Vec grows");
    for (p, _) in &spheres {
        assert_eq!(found(&index, *p), brute(&spheres, *p));
    }
    index.rebuild(0, |_| unreachable!("there is none")).expect("a Vec grows");
    assert!(index.is_empty());
    assert_eq!(found(&index, Vec3::ZERO), []);
}

#[test]
fn storage_of_the_sizes_advised_is_enough() {
    for spheres in [even(5000, 53), crowds(5000, 59)] {
        let n = spheres.len();
        let mut nodes = vec![IndexNode::default(); n];
        let (mut entries, mut copies) = (vec![0; 6 * n], vec![[0.0; 4]; n]);
        let mut blocks = vec![Block::default(); 4 * n + 16];
        let mut index = Index::new(&mut nodes[..], &mut entries[..], &mut copies[..], &mut blocks[..]);
        assert_eq!(index.rebuild(n as u32, |i| spheres[i as usize]), Ok(()));
        assert!(index.bytes() < 500 * n, "{} bytes a sphere", index.bytes() / n);
    }
}

#[test]
fn lent_storage_that_is_full_says_so_and_serves_again() {
    let spheres = even(500, 61);
    let n = spheres.len();
    let (nodes, entries, blocks) = (n, 6 * n, 4 * n + 16);
    for (nodes, entries, copies, blocks) in [
        (0, entries, n, blocks),
        (3, entries, n, blocks),
        (nodes, 40, n, blocks),
        (nodes, n, n, blocks),
        (nodes, n + 150, n, blocks),
        (nodes, entries, 40, blocks),
        (nodes, entries, n, 0),
        (nodes, entries, n, 20),
    ] {
        let mut nodes = vec![IndexNode::default(); nodes];
        let (mut entries, mut copies) = (vec![0; entries], vec![[0.0; 4]; copies]);
        let mut blocks = vec![Block::default(); blocks];
        let room_for_few = blocks.len() >= 2;
        let mut index = Index::new(&mut nodes[..], &mut entries[..], &mut copies[..], &mut blocks[..]);
        assert_eq!(index.rebuild(n as u32, |i| spheres[i as usize]), Err(Full));
        assert!(index.is_empty());
        assert_eq!(found(&index, Vec3::ZERO), []);
        if room_for_few {
            assert_eq!(index.rebuild(8, |i| spheres[i as usize]), Ok(()));
            for (p, _) in &spheres[..8] {
                assert_eq!(found(&index, *p), brute(&spheres[..8], *p));
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn no_sphere_around_a_point_is_missed(
        seed: u64,
        count in 1_usize..300,
        scale in -20.0_f32..29.0,
        spread in 0.0_f32..8.0,
        offset in -10.0_f32..10.0,
    ) {
        let mut unit = random(seed | 1);
        let scale = 10_f32.powf(scale);
        let spheres: Vec<Sphere> = (0..count)
            .map(|_| ((point(&mut unit) + offset) * scale, 10_f32.powf(-spread * unit()) * scale))
            .collect();
        let index = build(&spheres);
        for i in 0..100 {
            // Close to a surface, from within and from without.
            let (centre, radius) = spheres[i % count];
            let direction = (point(&mut unit) - 0.5).normalize_or_zero();
            let p = centre + direction * (radius * (1.0 + (unit() - 0.5) * 10_f32.powi(-(i as i32 % 8))));
            prop_assert_eq!(found(&index, p), brute(&spheres, p));
        }
    }
}
