//! Nanoseconds per lookup in the cache's index, beside other trees:
//! `cargo bench -p fogbow-examples --features benches --bench lookups -- [--quick]`
//!
//! Every tree answers the same question: which spheres contain this point, and how deep does it lie in
//! each? Radii are scaled until ten spheres contain a point. The others are an R*-tree (`rstar`), packed
//! in bulk and asked through its visitor, and a binary hierarchy of boxes (`obvhs`) with its spheres in
//! the order of the leaves. All are measured in turns; times are those of the CPU, the least of all turns.
//!
//! - `even`: centres uniform in a cube, radii equal within a factor of four.
//! - `crowded`: centres near walls and lamps, radii the distance to the tenth neighbour.
//! - `apart`: points independent of each other, spread like the centres.
//! - `rays`: points at the steps of eye rays, line by line, as a picture asks for them.

use core::hint::black_box;
use core::ops::ControlFlow;
use std::time::Duration;

use cpu_time::ThreadTime;
use fogbow::cache::Index;
use fogbow::math::{Vec2, Vec3};
use fogbow::sampling::warp::uniform_sphere;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use rstar::{AABB, PointDistance, RTree, RTreeObject};

/// Spheres that contain a point, in the mean.
const HITS: f64 = 10.0;

/// Steps of an eye ray.
const STEPS: usize = 64;

/// A small generator: benches need no more.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
    fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }
}

#[derive(Clone, Copy)]
struct Sphere {
    centre: Vec3,
    radius: f32,
    index: u32,
}

impl Sphere {
    /// `distance / radius` where that is below one.
    #[inline]
    fn share(&self, point: Vec3) -> Option<f32> {
        let squared = point.distance_squared(self.centre);
        (squared < self.radius * self.radius).then(|| squared.sqrt() / self.radius)
    }
}

impl RTreeObject for Sphere {
    type Envelope = AABB<[f32; 3]>;
    fn envelope(&self) -> Self::Envelope {
        AABB::from_corners((self.centre - self.radius).to_array(), (self.centre + self.radius).to_array())
    }
}

impl PointDistance for Sphere {
    fn distance_2(&self, point: &[f32; 3]) -> f32 {
        let outside = (Vec3::from(*point).distance(self.centre) - self.radius).max(0.0);
        outside * outside
    }
    #[inline]
    fn contains_point(&self, point: &[f32; 3]) -> bool {
        Vec3::from(*point).distance_squared(self.centre) < self.radius * self.radius
    }
}

/// A point of the unit cube: near a wall, near a lamp, or anywhere.
fn crowded(random: &mut Random) -> Vec3 {
    const LAMPS: [Vec3; 3] = [Vec3::new(0.5, 0.9, 0.5), Vec3::new(0.2, 0.3, 0.7), Vec3::new(0.8, 0.4, 0.3)];
    let kind = random.unit();
    if kind < 0.5 {
        let mut point = random.point();
        let wall = (random.unit() * 6.0) as usize;
        let away = 0.3 * random.unit().powi(3);
        point[wall / 2 % 3] = if wall.is_multiple_of(2) { away } else { 1.0 - away };
        return point;
    }
    if kind < 0.8 {
        let lamp = LAMPS[(random.unit() * 2.999) as usize];
        let direction = uniform_sphere(Vec2::new(random.unit(), random.unit()));
        return lamp + direction * (0.4 * random.unit().powi(2));
    }
    random.point()
}

fn spheres(count: usize, in_crowds: bool, random: &mut Random) -> Vec<Sphere> {
    let mut centres: Vec<Vec3> = (0..count).map(|_| if in_crowds { crowded(random) } else { random.point() }).collect();
    let radii: Vec<f32> = if in_crowds {
        let tree = RTree::bulk_load(centres.iter().map(|c| c.to_array()).collect());
        let tenth = |c: &Vec3| {
            let neighbour = tree.nearest_neighbor_iter(c.to_array()).nth(10);
            neighbour.map_or(1.0, |n| Vec3::from(*n).distance(*c))
        };
        centres.iter().map(tenth).collect()
    } else {
        (0..count).map(|_| 4.0_f32.powf(random.unit()) * (count as f32).powf(-1.0 / 3.0)).collect()
    };
    (0..).zip(centres.drain(..).zip(radii)).map(|(index, (centre, radius))| Sphere { centre, radius, index }).collect()
}

/// Points at the steps of eye rays: a part of a picture of 1024 lines, line by line.
fn along_rays(count: usize) -> Vec<Vec3> {
    let (eye, step) = (Vec3::new(0.05, 0.5, 0.1), 1.0 / 1024.0);
    let mut random = Random(0x5DEE_CE66_D1CE_4E5B);
    let columns = 512;
    (0..count)
        .map(|i| {
            let (pixel, along) = (i / STEPS, i % STEPS);
            let place = Vec2::new((pixel % columns) as f32 + 256.0, (pixel / columns) as f32 + 400.0) * step;
            let target = Vec3::new(0.98, place.y, place.x);
            eye + (target - eye) * ((along as f32 + random.unit()) / STEPS as f32)
        })
        .collect()
}

/// The result and its CPU time (s).
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = ThreadTime::now();
    let result = black_box(work());
    (result, start.elapsed().as_secs_f64())
}

fn index(spheres: &[Sphere]) -> Index<'static> {
    let mut index = Index::new(Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let of = |i: u32| (spheres[i as usize].centre, spheres[i as usize].radius);
    index.rebuild(spheres.len() as u32, of).expect("a Vec grows");
    index
}

struct Boxes {
    tree: Bvh2,
    spheres: Vec<Sphere>,
}

impl Boxes {
    fn new(spheres: &[Sphere]) -> Self {
        let boxes: Vec<Aabb> = spheres
            .iter()
            .map(|s| Aabb::new((s.centre - s.radius).to_array().into(), (s.centre + s.radius).to_array().into()))
            .collect();
        let settings = BvhBuildParams { pre_split: false, max_prims_per_leaf: 2, ..BvhBuildParams::medium_build() };
        let tree = build_bvh2(&boxes, settings, &mut Duration::default());
        let spheres = tree.primitive_indices.iter().map(|i| spheres[*i as usize]).collect();
        Self { tree, spheres }
    }
}

/// Sums of a tree: what a caller does with a hit is the same for all.
fn ask_index(index: &Index<'_>, points: &[Vec3]) -> (u64, u64, f32) {
    let (mut hits, mut numbers, mut shares) = (0, 0_u64, 0.0);
    for point in points {
        index.visit(*point, |i, share| {
            hits += 1;
            numbers += u64::from(i);
            shares += share;
        });
    }
    (hits, numbers, shares)
}

fn ask_rstar(tree: &RTree<Sphere>, points: &[Vec3]) -> (u64, u64, f32) {
    let (mut hits, mut numbers, mut shares) = (0, 0_u64, 0.0);
    for point in points {
        let found = tree.locate_all_at_point_int(point.to_array(), |sphere| {
            hits += 1;
            numbers += u64::from(sphere.index);
            shares += sphere.share(*point).unwrap_or(0.0);
            ControlFlow::<()>::Continue(())
        });
        black_box(found.is_continue());
    }
    (hits, numbers, shares)
}

fn ask_boxes(boxes: &Boxes, points: &[Vec3]) -> (u64, u64, f32) {
    let (mut hits, mut numbers, mut shares) = (0, 0_u64, 0.0);
    for point in points {
        boxes.tree.point_traverse(point.to_array().into(), |tree, node| {
            let node = &tree.nodes[node as usize];
            let first = node.first_index as usize;
            for sphere in &boxes.spheres[first..first + node.prim_count as usize] {
                if let Some(share) = sphere.share(*point) {
                    hits += 1;
                    numbers += u64::from(sphere.index);
                    shares += share;
                }
            }
            true
        });
    }
    (hits, numbers, shares)
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick");
    let (sizes, count, turns) = if quick {
        (&[1_000, 10_000, 100_000][..], 1 << 16, 3)
    } else {
        (&[1_000, 10_000, 100_000, 1_000_000][..], 1 << 19, 5)
    };
    println!("{:26} {:>5} {:>26} {:>7} {:>25} {:>7}", "", "", "ns per lookup", "", "build (ms)", "bytes");
    print!("{:8} {:6} {:>10} {:>5} {:>8} {:>8}", "spheres", "points", "number", "hits", "fogbow", "rstar");
    println!(" {:>8} {:>7} {:>9} {:>7} {:>7} {:>7}", "obvhs", "ratio", "fogbow", "rstar", "obvhs", "each");
    for in_crowds in [false, true] {
        for &size in sizes {
            let mut random = Random(0x9E37_79B9_7F4A_7C15);
            let mut spheres = spheres(size, in_crowds, &mut random);
            let apart: Vec<Vec3> =
                (0..count).map(|_| if in_crowds { crowded(&mut random) } else { random.point() }).collect();
            for (name, points) in [("apart", apart), ("rays", along_rays(count))] {
                for _ in 0..8 {
                    let sample: Vec<Vec3> = points.iter().step_by(7).copied().collect();
                    let hits = ask_index(&index(&spheres), &sample).0 as f64 / sample.len() as f64;
                    let factor = (HITS / hits).powf(1.0 / 3.0) as f32;
                    spheres.iter_mut().for_each(|s| s.radius *= factor);
                }
                let (ours, build) = timed(|| index(&spheres));
                let (rstar, build_rstar) = timed(|| RTree::bulk_load(spheres.clone()));
                let (boxes, build_boxes) = timed(|| Boxes::new(&spheres));
                let mut best = [f64::INFINITY; 3];
                let mut hits = [(0, 0, 0.0); 3];
                for _ in 0..turns {
                    let times = [
                        timed(|| ask_index(&ours, black_box(&points))),
                        timed(|| ask_rstar(&rstar, black_box(&points))),
                        timed(|| ask_boxes(&boxes, black_box(&points))),
                    ];
                    for i in 0..3 {
                        hits[i] = times[i].0;
                        best[i] = best[i].min(times[i].1 * 1e9 / points.len() as f64);
                    }
                }
                // Rounding may decide otherwise for a point on the very surface of a sphere.
                let differ = |other: (u64, u64, f32)| other.0.abs_diff(hits[0].0) * 100_000 > hits[0].0;
                assert!(!differ(hits[1]) && !differ(hits[2]), "the trees disagree: {hits:?}");
                print!("{:8} {name:6} {size:>10}", if in_crowds { "crowded" } else { "even" });
                print!(" {:>5.1}", hits[0].0 as f64 / points.len() as f64);
                best.iter().for_each(|b| print!(" {b:>8.1}"));
                print!(" {:>7.2}", best[1].min(best[2]) / best[0]);
                print!(" {:>9.2} {:>7.1} {:>7.1}", build * 1e3, build_rstar * 1e3, build_boxes * 1e3);
                println!(" {:>7.0}", ours.bytes() as f64 / size as f64);
            }
        }
    }
}
