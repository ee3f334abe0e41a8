//! Intersections against brute force in double precision, and the sides of surfaces.

use std::path::Path;

use fogbow::host::{Hit, Scene};
use fogbow::math::{Ray, Vec2, Vec3};
use fogbow::sampling::warp::uniform_sphere;
use fogbow::sampling::{Generator, uniform, uniform2};

use super::analytic::Primitive;
use super::{Storage, World};
use crate::scene_file::{Geometry, SceneFile};
use crate::transform::{Transform, cross, dot, to_array};

const HEAD: &str = r#"<scene version="3.0.0"><integrator type="volpath"/>
  <sensor type="perspective"><float name="fov" value="36"/><film type="hdrfilm"><rfilter type="box"/></film></sensor>"#;

fn with_world<T>(shapes: &str, work: impl FnOnce(&World<'_>, &SceneFile) -> T) -> T {
    let scene = SceneFile::parse(Path::new("test.xml"), &format!("{HEAD}{shapes}</scene>")).unwrap();
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage).unwrap();
    work(&world, &scene)
}

/// Random shapes of all analytic kinds.
fn zoo(count: usize, rng: &mut Generator) -> String {
    let mut number = |low: f32, high: f32| low + (high - low) * uniform(rng);
    let mut text = String::new();
    for index in 0..count {
        let kind = ["rectangle", "cube", "sphere", "disk"][index % 4];
        let size = if kind == "sphere" {
            format!("<scale value=\"{}\"/>", number(0.05, 0.4))
        } else {
            format!("<scale x=\"{}\" y=\"{}\" z=\"{}\"/>", number(0.05, 0.5), number(0.05, 0.5), number(0.05, 0.5))
        };
        // An axis that is no unit vector would scale, too.
        let (y, x) = number(0.0, core::f32::consts::PI).sin_cos();
        text.push_str(&format!(
            "<shape type=\"{kind}\"><transform name=\"to_world\">{size}<rotate x=\"{x}\" y=\"{y}\" angle=\"{}\"/>\
             <translate x=\"{}\" y=\"{}\" z=\"{}\"/></transform></shape>",
            number(0.0, 360.0),
            number(-2.0, 2.0),
            number(-2.0, 2.0),
            number(-2.0, 2.0),
        ));
    }
    text
}

fn random_ray(rng: &mut Generator, reach: f32) -> Ray {
    let origin = (Vec3::new(uniform(rng), uniform(rng), uniform(rng)) - 0.5) * (2.0 * reach);
    Ray::new(origin, uniform_sphere(uniform2(rng)).normalize())
}

/// Distance and outward normal by the definition of each shape, in double precision; also how
/// near the ray passes to a border, where rounding may decide.
fn brute_force(geometry: &Geometry, ray: &Ray) -> (f64, [f64; 3], f64) {
    let none = (f64::INFINITY, [0.0; 3], 1.0);
    let local = |t: &Transform| {
        let inverse = t.inverse().unwrap();
        let direction = to_array(ray.direction);
        (
            inverse.point(to_array(ray.origin)),
            inverse.rows.map(|r| r[0] * direction[0] + r[1] * direction[1] + r[2] * direction[2]),
            inverse,
        )
    };
    match geometry {
        Geometry::Rectangle(t) | Geometry::Disk(t) => {
            let (o, d, _) = local(t);
            let distance = -o[2] / d[2];
            let (x, y) = (o[0] + distance * d[0], o[1] + distance * d[1]);
            let radius = if matches!(geometry, Geometry::Disk(_)) { x.hypot(y) } else { x.abs().max(y.abs()) };
            let normal = cross(t.column(0), t.column(1));
            if distance > 0.0 && radius <= 1.0 {
                (distance, normal, (1.0 - radius).abs())
            } else {
                (f64::INFINITY, normal, (1.0 - radius).abs())
            }
        }
        Geometry::Cube(t) => {
            let (o, d, inverse) = local(t);
            let mut best = none;
            for axis in 0..3 {
                for side in [-1.0, 1.0] {
                    let distance = (side - o[axis]) / d[axis];
                    let at = |i: usize| (o[i] + distance * d[i]).abs();
                    let radius = at((axis + 1) % 3).max(at((axis + 2) % 3));
                    let near = (1.0 - radius).abs().min(best.2);
                    if distance > 0.0 && radius <= 1.0 && distance < best.0 {
                        let row = inverse.rows[axis];
                        best = (distance, [row[0] * side, row[1] * side, row[2] * side], near);
                    }
                    best.2 = near;
                }
            }
            best
        }
        Geometry::Sphere { centre, radius, .. } => {
            let d = to_array(ray.direction);
            let f = [0, 1, 2].map(|i| f64::from(ray.origin[i]) - centre[i]);
            let (a, b, c) = (dot(d, d), dot(f, d), dot(f, f) - radius * radius);
            let discriminant = b * b - a * c;
            if discriminant < 0.0 {
                return (f64::INFINITY, [0.0; 3], -discriminant);
            }
            let root = discriminant.sqrt();
            let distance = [(-b - root) / a, (-b + root) / a].into_iter().find(|t| *t > 0.0).unwrap_or(f64::INFINITY);
            (distance, [0, 1, 2].map(|i| f[i] + distance * d[i]), discriminant)
        }
        Geometry::Cylinder(_) | Geometry::Mesh(_) => none,
    }
}

fn agrees(world: &World<'_>, scene: &SceneFile, rays: usize, rng: &mut Generator) {
    let mut hits = 0;
    for _ in 0..rays {
        let ray = random_ray(rng, 2.5);
        let all: Vec<_> = scene.shapes.iter().map(|s| brute_force(&s.geometry, &ray)).collect();
        // Rays along a border are decided by rounding.
        if all.iter().any(|(_, _, border)| *border < 1e-4) {
            continue;
        }
        let (distance, normal, _) = all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        match world.closest_hit(&ray) {
            None => assert!(distance.is_infinite(), "missed a hit at {distance} of {ray:?}"),
            Some(hit) => {
                hits += 1;
                let error = (f64::from(hit.distance) - distance).abs();
                assert!(error < 2e-5 * (1.0 + distance), "{} for {distance} of {ray:?}", hit.distance);
                let length = dot(normal, normal).sqrt();
                let cosine = dot(normal, to_array(hit.normal)) / length;
                assert!(cosine > 0.9999, "normal {} is off: {cosine}", hit.normal);
                assert!(world.is_blocked(&ray.with_length(hit.distance * 1.001)));
                assert!(!world.is_blocked(&ray.with_length(hit.distance * 0.999)));
                assert!(world.closest_hit(&ray.with_length(hit.distance * 0.999)).is_none());
            }
        }
        assert_eq!(world.is_blocked(&ray), distance.is_finite());
    }
    assert!(hits > rays / 60, "{hits} hits of {rays} rays");
}

#[test]
fn few_shapes_agree_with_brute_force() {
    let mut rng = Generator::new(1);
    for _ in 0..20 {
        let shapes = zoo(15, &mut rng);
        with_world(&shapes, |world, scene| agrees(world, scene, 3000, &mut rng));
    }
}

#[test]
fn many_shapes_agree_with_brute_force() {
    let mut rng = Generator::new(2);
    let shapes = zoo(300, &mut rng);
    with_world(&shapes, |world, scene| {
        assert!(world.many.is_some());
        agrees(world, scene, 5000, &mut rng);
    });
}

/// A closed ball of triangles around the origin.
fn ball(rings: usize) -> Vec<[Vec3; 3]> {
    let at = |i: usize, j: usize| {
        let (polar, azimuth) = (
            i as f32 / rings as f32 * core::f32::consts::PI,
            (j % (2 * rings)) as f32 / rings as f32 * core::f32::consts::PI,
        );
        if i == rings {
            Vec3::NEG_Z
        } else {
            Vec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos())
        }
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..2 * rings {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    triangles.retain(|t| crate::mesh::has_area(*t));
    triangles
}

#[test]
fn triangles_agree_with_brute_force() {
    let triangles = ball(24);
    let tree = super::Triangles::new(&triangles);
    let mut rng = Generator::new(3);
    for _ in 0..3000 {
        let ray = random_ray(&mut rng, 2.0);
        let expected =
            triangles.iter().map(|t| super::triangles::distance(t, &ray, f32::INFINITY)).fold(f32::INFINITY, f32::min);
        let found = tree.closest(&ray, f32::INFINITY).map_or(f32::INFINITY, |(t, _)| t);
        assert_eq!(found, expected);
        assert_eq!(tree.is_hit(&ray, f32::INFINITY), expected.is_finite());
        if expected.is_finite() {
            // On the ball, whose facets lie at most 1 % inside.
            let radius = ray.at(found).length();
            assert!((0.98..1.0001).contains(&radius), "{radius}");
            assert!(!tree.is_hit(&ray, expected));
        }
    }
}

#[test]
fn nothing_leaks_through_edges_and_corners_of_a_mesh() {
    let triangles = ball(24);
    let tree = super::Triangles::new(&triangles);
    let mut rng = Generator::new(4);
    for round in 0..20_000 {
        let [a, b, _] = triangles[round % triangles.len()];
        let share = if round % 3 == 0 { 0.0 } else { uniform(&mut rng) };
        let target = a + (b - a) * share;
        let origin = (Vec3::new(uniform(&mut rng), uniform(&mut rng), uniform(&mut rng)) - 0.5) * 0.8;
        let ray = Ray::between(origin, target).with_length(f32::INFINITY);
        assert!(tree.closest(&ray, f32::INFINITY).is_some(), "{ray:?} leaked");
        assert!(tree.is_hit(&ray, f32::INFINITY), "{ray:?} leaked");
    }
}

#[test]
fn nothing_leaks_where_walls_meet() {
    let wall = |rotate: &str, translate: &str| {
        format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"1.7\"/><rotate {rotate}/><translate {translate}/><rotate y=\"1\" z=\"0.3\" angle=\"33\"/></transform></shape>"
        )
    };
    let room = [
        wall("x=\"1\" angle=\"-90\"", "y=\"-1.7\""),
        wall("x=\"1\" angle=\"90\"", "y=\"1.7\""),
        wall("y=\"1\" angle=\"0\"", "z=\"-1.7\""),
        wall("y=\"1\" angle=\"180\"", "z=\"1.7\""),
        wall("y=\"1\" angle=\"90\"", "x=\"-1.7\""),
        wall("y=\"1\" angle=\"-90\"", "x=\"1.7\""),
    ]
    .concat();
    with_world(&room, |world, _| {
        let turn = Transform::rotation([0.0, 1.0, 0.3], 33.0).unwrap();
        let mut rng = Generator::new(5);
        for round in 0..50_000 {
            let mut corner = [0.0; 3].map(|_: f64| if uniform(&mut rng) < 0.5 { -1.7 } else { 1.7 });
            if round % 4 != 0 {
                corner[round % 3] = f64::from(uniform(&mut rng) * 3.4 - 1.7);
            }
            let origin = (Vec3::new(uniform(&mut rng), uniform(&mut rng), uniform(&mut rng)) - 0.5) * 1.5;
            let ray = Ray::between(origin, crate::transform::to_vec3(turn.point(corner)));
            assert!(world.closest_hit(&ray.with_length(f32::INFINITY)).is_some(), "{ray:?} leaked");
        }
    });
}

fn seen(world: &World<'_>, from: Vec3, direction: Vec3) -> Hit {
    world.closest_hit(&Ray::new(from, direction)).unwrap()
}

#[test]
fn sides_of_surfaces_and_lights() {
    let lamp = "<emitter type=\"area\"/>";
    let (up, down) = (Vec3::Z, Vec3::NEG_Z);
    with_world(&format!("<shape type=\"rectangle\">{lamp}</shape>"), |world, _| {
        let (front, back) = (seen(world, Vec3::Z, down), seen(world, Vec3::NEG_Z, up));
        assert_eq!((front.normal, front.light), (up, Some(0)));
        assert_eq!((back.normal, back.light), (up, None));
    });
    let two_sided = "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf>";
    with_world(&format!("<shape type=\"rectangle\">{two_sided}{lamp}</shape>"), |world, _| {
        let (front, back) = (seen(world, Vec3::Z, down), seen(world, Vec3::NEG_Z, up));
        assert_eq!((front.normal, front.light), (up, Some(0)));
        assert_eq!((back.normal, back.light), (down, None));
    });
    let flipped = "<boolean name=\"flip_normals\" value=\"true\"/>";
    with_world(&format!("<shape type=\"rectangle\">{flipped}{lamp}</shape>"), |world, _| {
        assert_eq!(seen(world, Vec3::NEG_Z, up).light, Some(0));
        let sample = world.lights()[0].sample(Vec3::new(0.1, 0.2, -2.0), Vec2::splat(0.3));
        assert!(sample.is_some() && world.lights()[0].sample(Vec3::Z, Vec2::splat(0.3)).is_none());
    });
    with_world(&format!("<shape type=\"cube\">{flipped}</shape>"), |world, _| {
        assert_eq!(seen(world, Vec3::ZERO, Vec3::X).normal, Vec3::NEG_X);
    });
    with_world(&format!("<shape type=\"cube\">{lamp}</shape>"), |world, _| {
        for direction in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            let hit = seen(world, direction * 3.0 + Vec3::splat(0.1), -direction);
            assert_eq!((hit.normal, hit.light), (direction, Some(0)));
            let sample =
                (0..40).find_map(|i| world.lights()[0].sample(direction * 3.0, Vec2::new(i as f32 / 40.0, 0.5)));
            assert!(sample.is_some(), "the side {direction} is dark");
        }
    });
}

#[test]
fn null_shapes_are_not_there() {
    with_world("<shape type=\"cube\"><bsdf type=\"null\"/></shape>", |world, _| {
        assert!(world.closest_hit(&Ray::new(Vec3::splat(0.2), Vec3::X)).is_none());
        assert!(!world.is_blocked(&Ray::new(Vec3::splat(0.2), Vec3::X)));
    });
}

/// At four million kilometres points are 512 m apart: the one where a sphere of a metre is hit may be its centre.
#[test]
fn what_is_far_away_has_a_normal() {
    let centre = 4_294_967_300.0 * Vec3::Z;
    let normal = Primitive::Sphere { centre, radius: 1.0 }.normal(centre);
    assert!((normal.length() - 1.0).abs() < 1e-6, "{normal}");
}

#[test]
fn normals_that_face_away_are_turned_or_black_as_the_scene_says() {
    let steep = |flips: bool| {
        format!(
            "<shape type=\"rectangle\"><bsdf type=\"normalmap\"><boolean name=\"flip_invalid_normals\" value=\"{flips}\"/>\
             <boolean name=\"use_shadowing_function\" value=\"false\"/><rgb name=\"normalmap\" value=\"1, 0.5, 0.6\"/>\
             <bsdf type=\"diffuse\"/></bsdf></shape>"
        )
    };
    let to_eye = Vec3::new(-1.0, 0.0, 0.1).normalize();
    let hit = |flips| with_world(&steep(flips), |world, _| seen(world, 2.0 * to_eye, -to_eye));
    let bent = Vec3::new(1.0, 0.0, 0.2).normalize();
    assert!((hit(false).shading - bent).length() < 1e-5, "{:?}", hit(false));
    assert!((hit(true).shading - bent * Vec3::new(-1.0, 1.0, 1.0)).length() < 1e-5, "{:?}", hit(true));
    let value = |hit: Hit| hit.value(to_eye, Vec3::Z).mean();
    assert!(value(hit(false)) == 0.0 && value(hit(true)) > 0.1);
}
