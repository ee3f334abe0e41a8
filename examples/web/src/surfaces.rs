//! Triangles, quadrilaterals and spheres, and a tree of boxes for casting rays at them.

use alloc::vec::Vec;

use fogbow::host::{Hit, Scene};
use fogbow::light::Light;
use fogbow::math::{Bounds, Ray, Symmetric2, Symmetric3, Vec3, float};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;

use super::words::{Fault, Words};

/// Where light meets it.
#[derive(Debug, Clone, Copy)]
enum Shape {
    Triangle {
        corner: Vec3,
        edges: [Vec3; 2],
        normal: Vec3,
    },
    /// A parallelogram.
    Quad {
        corner: Vec3,
        edges: [Vec3; 2],
        normal: Vec3,
    },
    Sphere {
        centre: Vec3,
        radius: f32,
    },
}

/// What a surface does to light, and whether on both sides.
#[derive(Debug, Clone, Copy)]
struct Material {
    surface: Surface,
    is_two_sided: bool,
}

/// The surface of a lamp: what meets it is not reflected.
const LAMP: Material = Material { surface: Surface::BLACK, is_two_sided: false };

#[derive(Debug, Clone, Copy)]
struct Primitive {
    shape: Shape,
    material: Material,
    light: Option<u32>,
}

/// A box of the tree: of primitives, if there are any, or of the next node and of `other`.
#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds,
    first: u32,
    count: u32,
    other: u32,
}

/// The surfaces of a world.
#[derive(Debug)]
pub(crate) struct Surfaces {
    primitives: Vec<Primitive>,
    nodes: Vec<Node>,
}

/// Primitives of a leaf. More: longer look-ups in each; fewer: more boxes.
const LEAF: usize = 4;

/// A tree of halves is no deeper than there are bits in the number of primitives.
const DEEPEST: usize = 40;

impl Surfaces {
    /// From words: materials, vertices, triangles, quadrilaterals, spheres; each as how many, then all of them.
    pub(crate) fn read(words: &mut Words<'_>) -> Result<Self, Fault> {
        let count = words.integer()? as usize;
        let materials: Vec<Material> =
            (0..count).map(|n| material(words).map_err(|fault| fault.of("material", n))).collect::<Result<_, _>>()?;
        let mut primitives = Vec::new();
        let vertices: &[[u32; 3]] = {
            let count = words.integer()? as usize;
            words.take(count.saturating_mul(3))?.as_chunks().0
        };
        let count = words.integer()? as usize;
        let triangles: &[[u32; 4]] = words.take(count.saturating_mul(4))?.as_chunks().0;
        for (number, [indices @ .., material]) in triangles.iter().enumerate() {
            let primitive = triangle(vertices, *indices).and_then(|shape| painted(shape, &materials, *material));
            primitives.push(primitive.map_err(|fault| fault.of("triangle", number))?);
        }
        for number in 0..words.integer()? as usize {
            let (corner, edges) = (words.vector()?, [words.vector()?, words.vector()?]);
            let primitive = quad(corner, edges).and_then(|shape| painted(shape, &materials, words.integer()?));
            primitives.push(primitive.map_err(|fault| fault.of("quadrilateral", number))?);
        }
        for number in 0..words.integer()? as usize {
            let (centre, radius) = (words.vector()?, words.float()?);
            let primitive = sphere(centre, radius).and_then(|shape| painted(shape, &materials, words.integer()?));
            primitives.push(primitive.map_err(|fault| fault.of("sphere", number))?);
        }
        Ok(Self { primitives, nodes: Vec::new() })
    }

    /// With the surfaces of lamps; and with the tree.
    pub(crate) fn with_lights(mut self, lights: &[Light<'_>]) -> Self {
        for (number, light) in lights.iter().enumerate() {
            let shape = match light {
                Light::Quad(quad) => {
                    let edges = quad.edges();
                    let corner = quad.centre() - (edges[0] + edges[1]) * 0.5;
                    Shape::Quad { corner, edges, normal: quad.normal() }
                }
                Light::Sphere(sphere) => Shape::Sphere { centre: sphere.centre, radius: sphere.radius },
                _ => continue,
            };
            self.primitives.push(Primitive { shape, material: LAMP, light: Some(number as u32) });
        }
        if !self.primitives.is_empty() {
            divide(&mut self.primitives, 0, &mut self.nodes);
        }
        self
    }

    /// The smallest box around all of them.
    pub(crate) fn bounds(&self) -> Bounds {
        self.primitives.iter().fold(Bounds::EMPTY, |all, one| all.union(one.shape.bounds()))
    }

    /// Calls `meets(primitive, length so far)` for primitives in boxes that the ray meets, until it says that the rest does not matter;
    /// it answers with the length that matters from now on.
    fn visit<'s>(&'s self, ray: &Ray, mut meets: impl FnMut(&'s Primitive, f32) -> Option<f32>) {
        let inverse = ray.direction.recip();
        let mut length = ray.length;
        let mut stack = [0_u32; DEEPEST];
        let mut open = usize::from(!self.nodes.is_empty());
        while open > 0 {
            open -= 1;
            let at = stack[open];
            let node = &self.nodes[at as usize];
            if !passes(&node.bounds, ray, inverse, length) {
                continue;
            }
            if node.count == 0 {
                // The child that the ray comes to first is looked at first.
                let [a, b] = [at + 1, node.other];
                let centre = |at: u32| self.nodes[at as usize].bounds.centre().dot(ray.direction);
                let [first, last] = if centre(a) <= centre(b) { [a, b] } else { [b, a] };
                if open + 2 <= DEEPEST {
                    (stack[open], stack[open + 1]) = (last, first);
                    open += 2;
                }
                continue;
            }
            for primitive in &self.primitives[node.first as usize..][..node.count as usize] {
                match meets(primitive, length) {
                    Some(until) => length = until,
                    None => return,
                }
            }
        }
    }
}

/// Whether a ray comes through a box before `length`. Boxes are a little larger than what they hold, so that rounding misses nothing.
#[inline(always)]
fn passes(bounds: &Bounds, ray: &Ray, inverse: Vec3, length: f32) -> bool {
    let (a, b) = ((bounds.min - ray.origin) * inverse, (bounds.max - ray.origin) * inverse);
    let (mut near, mut far) = (0.0, length);
    for (a, b) in [(a.x, b.x), (a.y, b.y), (a.z, b.z)] {
        // Where the ray lies in a face, 0·∞ is no number, and may be left out.
        near = float::max(float::min(a, b), near);
        far = float::min(float::max(a, b), far);
    }
    near <= far
}

/// Builds the tree over a slice of primitives that starts at number `first`: in halves along the longest axis.
fn divide(primitives: &mut [Primitive], first: u32, nodes: &mut Vec<Node>) {
    let bounds = primitives.iter().fold(Bounds::EMPTY, |all, one| all.union(one.shape.bounds()));
    let margin =
        1e-5 * bounds.size().max_element().max(bounds.min.abs().max_element()).max(bounds.max.abs().max_element());
    let bounds = Bounds { min: bounds.min - margin, max: bounds.max + margin };
    let at = nodes.len();
    nodes.push(Node { bounds, first, count: primitives.len() as u32, other: 0 });
    if primitives.len() <= LEAF {
        return;
    }
    let centres = Bounds::of(primitives.iter().map(|one| one.shape.bounds().centre())).size();
    let axis = if centres.x >= centres.max_element() { 0 } else { 1 + usize::from(centres.z > centres.y) };
    let key = |one: &Primitive| one.shape.bounds().centre()[axis];
    // Stable: of equals the order is that of the description.
    primitives.sort_by(|a, b| key(a).total_cmp(&key(b)));
    let half = primitives.len() / 2;
    let (low, high) = primitives.split_at_mut(half);
    divide(low, first, nodes);
    nodes[at].other = nodes.len() as u32;
    nodes[at].count = 0;
    divide(high, first + half as u32, nodes);
}

impl Shape {
    fn bounds(&self) -> Bounds {
        match *self {
            Self::Triangle { corner, edges: [u, v], .. } => Bounds::of([corner, corner + u, corner + v]),
            Self::Quad { corner, edges: [u, v], .. } => Bounds::of([corner, corner + u, corner + v, corner + u + v]),
            Self::Sphere { centre, radius } => Bounds { min: centre - radius, max: centre + radius },
        }
    }

    /// Where a ray meets it first, before `length`.
    #[inline]
    fn meet(&self, ray: &Ray, length: f32) -> Option<f32> {
        let distance = match *self {
            Self::Triangle { corner, edges, .. } => {
                let [distance, u, v] = across(ray, corner, edges)?;
                (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(distance)
            }
            Self::Quad { corner, edges, .. } => {
                let [distance, u, v] = across(ray, corner, edges)?;
                (u >= 0.0 && v >= 0.0 && u <= 1.0 && v <= 1.0).then_some(distance)
            }
            Self::Sphere { centre, radius } => {
                let from_centre = ray.origin - centre;
                let half = from_centre.dot(ray.direction);
                // Of the point of the ray nearest to the centre: no cancellation for small spheres far away.
                let nearest = from_centre - ray.direction * half;
                let inside = radius * radius - nearest.length_squared();
                if inside < 0.0 {
                    return None;
                }
                let root = float::sqrt(inside);
                [-half - root, -half + root].into_iter().find(|distance| *distance > 0.0)
            }
        }?;
        (distance > 0.0 && distance < length).then_some(distance)
    }

    fn normal(&self, point: Vec3) -> Vec3 {
        match *self {
            Self::Triangle { normal, .. } | Self::Quad { normal, .. } => normal,
            Self::Sphere { centre, .. } => (point - centre).normalize_or(Vec3::Z),
        }
    }
}

/// Distance, and coordinates along both edges (Möller and Trumbore 1997).
#[inline(always)]
fn across(ray: &Ray, corner: Vec3, [edge_u, edge_v]: [Vec3; 2]) -> Option<[f32; 3]> {
    let p = ray.direction.cross(edge_v);
    let determinant = edge_u.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let to_origin = ray.origin - corner;
    let q = to_origin.cross(edge_u);
    Some([edge_v.dot(q) * inverse, to_origin.dot(p) * inverse, ray.direction.dot(q) * inverse])
}

impl Scene for Surfaces {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut nearest = None;
        self.visit(ray, |primitive, length| {
            let Some(distance) = primitive.shape.meet(ray, length) else { return Some(length) };
            nearest = Some((distance, primitive));
            Some(distance)
        });
        let (distance, &Primitive { shape, material, light }) = nearest?;
        let mut normal = shape.normal(ray.at(distance));
        if material.is_two_sided && normal.dot(ray.direction) > 0.0 {
            normal = -normal;
        }
        Some(Hit { distance, normal, shading: normal, surface: material.surface, light })
    }

    fn is_blocked(&self, ray: &Ray) -> bool {
        let mut is_blocked = false;
        self.visit(ray, |primitive, length| {
            let blocks = primitive.material.surface != Surface::Null && primitive.shape.meet(ray, length).is_some();
            is_blocked |= blocks;
            (!blocks).then_some(length)
        });
        is_blocked
    }

    fn curvature(&self, ray: &Ray, hit: &Hit) -> Symmetric3 {
        let mut curvature = Symmetric3::ZERO;
        self.visit(ray, |primitive, length| {
            if let Shape::Sphere { radius, .. } = primitive.shape
                && primitive.shape.meet(ray, length) == Some(hit.distance)
            {
                // Seen from inside it is hollow.
                let side = if hit.normal.dot(ray.at(hit.distance) - primitive.shape.bounds().centre()) < 0.0 {
                    -1.0
                } else {
                    1.0
                };
                let (u, v) = hit.normal.any_orthonormal_pair();
                curvature = Symmetric3::embedded(&Symmetric2::diagonal(side / radius, side / radius), u, v);
            }
            Some(length)
        });
        curvature
    }
}

const LAMBERT: u32 = 0;
const PHONG: u32 = 1;
const MIRROR: u32 = 2;
const DIELECTRIC: u32 = 3;
const NULL: u32 = 4;

fn material(words: &mut Words<'_>) -> Result<Material, Fault> {
    let (kind, sides) = (words.integer()?, words.integer()?);
    let (first, second, number) = (words.colour()?, words.colour()?, words.float()?);
    let is_share = |colour: Spectrum| colour.0.iter().all(|c| (0.0..=1.0).contains(c));
    if !(is_share(first) && is_share(second) && is_share(first + second)
        || kind == DIELECTRIC && is_share(first) && is_share(second))
    {
        return Err(Fault::new("reflectances must lie in [0, 1], and their sum, too"));
    }
    let surface = match kind {
        LAMBERT => Surface::Lambert { reflectance: first },
        PHONG if number >= 0.0 && number.is_finite() => {
            Surface::Phong { diffuse: first, specular: second, exponent: number }
        }
        PHONG => return Err(Fault::new("a Phong exponent must be finite and not negative")),
        MIRROR => Surface::Mirror { reflectance: first },
        DIELECTRIC if number > 0.0 && number.is_finite() => {
            Surface::Dielectric { eta: number, reflectance: first, transmittance: second }
        }
        DIELECTRIC => return Err(Fault::new("an index of refraction must be finite and positive")),
        NULL => Surface::Null,
        _ => return Err(Fault::new("no such kind of surface")),
    };
    Ok(Material { surface, is_two_sided: sides == 2 && !matches!(surface, Surface::Dielectric { .. }) })
}

fn painted(shape: Shape, materials: &[Material], material: u32) -> Result<Primitive, Fault> {
    let material = materials
        .get(material as usize)
        .ok_or_else(|| Fault(alloc::format!("material {material} is none of {}", materials.len())))?;
    Ok(Primitive { shape, material: *material, light: None })
}

fn triangle(vertices: &[[u32; 3]], indices: [u32; 3]) -> Result<Shape, Fault> {
    let vertex = |index: u32| {
        let bits = vertices.get(index as usize);
        let bits = bits.ok_or_else(|| Fault(alloc::format!("vertex {index} is none of {}", vertices.len())))?;
        Ok::<Vec3, Fault>(bits.map(f32::from_bits).into())
    };
    let [corner, b, c] = [vertex(indices[0])?, vertex(indices[1])?, vertex(indices[2])?];
    let edges = [b - corner, c - corner];
    // One without area is met by no ray, and its normal does not matter.
    let normal = edges[0].cross(edges[1]).normalize_or(Vec3::Z);
    finite(&[corner, b, c])?;
    Ok(Shape::Triangle { corner, edges, normal })
}

fn quad(corner: Vec3, edges: [Vec3; 2]) -> Result<Shape, Fault> {
    finite(&[corner, edges[0], edges[1]])?;
    let normal = edges[0].cross(edges[1]).try_normalize().ok_or_else(|| Fault::new("it has no area"))?;
    Ok(Shape::Quad { corner, edges, normal })
}

fn sphere(centre: Vec3, radius: f32) -> Result<Shape, Fault> {
    finite(&[centre])?;
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(Fault::new("a radius must be finite and positive"));
    }
    Ok(Shape::Sphere { centre, radius })
}

fn finite(vectors: &[Vec3]) -> Result<(), Fault> {
    if vectors.iter().all(|v| v.is_finite()) { Ok(()) } else { Err(Fault::new("coordinates must be finite")) }
}
