//! Hosts for tests: media with exact gradients, bodies with faces, and wrappers that complain.

use std::sync::atomic::{AtomicU64, Ordering};

use fogbow::host::{Face, Gradients, Hit, MajorantSegment, Medium, Properties, Scene};
use fogbow::math::{Bounds, Ray, Vec3};
use fogbow::phase::Phase;
use fogbow::spectrum::{Gradient, Hessian, Spectrum};

/// Extinction as a function of position, with its exact gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Field {
    /// `a`
    Homogeneous {
        /// m⁻¹
        a: f32,
    },
    /// `a + b·p`
    Linear {
        /// m⁻¹
        a: f32,
        /// m⁻²
        b: Vec3,
    },
    /// `a exp(b·p)`
    Exponential {
        /// m⁻¹
        a: f32,
        /// m⁻¹
        b: Vec3,
    },
    /// `a + k exp(−|p − c|²/(2s²))`
    Gaussian {
        /// m⁻¹
        a: f32,
        /// m⁻¹
        k: f32,
        /// Centre (m).
        c: Vec3,
        /// Width (m).
        s: f32,
    },
}

impl Field {
    /// Extinction (m⁻¹) and its gradient (m⁻²).
    #[must_use]
    pub fn at(&self, p: Vec3) -> (f32, Vec3) {
        match *self {
            Self::Homogeneous { a } => (a, Vec3::ZERO),
            Self::Linear { a, b } => (a + b.dot(p), b),
            Self::Exponential { a, b } => {
                let value = a * exp(b.dot(p));
                (value, b * value)
            }
            Self::Gaussian { a, k, c, s } => {
                let offset = p - c;
                let bump = k * exp(-offset.length_squared() / (2.0 * s * s));
                (a + bump, offset * (-bump / (s * s)))
            }
        }
    }
}

fn exp(x: f32) -> f32 {
    fogbow::math::float::exp(x)
}

/// A [`Field`] as a medium without bounds, with colours: `tint · σ(p)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Analytic {
    /// Extinction before the tint.
    pub field: Field,
    /// Factor on extinction per channel.
    pub tint: Spectrum,
    /// `σₛ/σₜ`.
    pub albedo: Spectrum,
    /// Angular law of scattering.
    pub phase: Phase,
}

impl Analytic {
    /// Grey, isotropic.
    #[must_use]
    pub fn grey(field: Field, albedo: f32) -> Self {
        Self { field, tint: Spectrum::ONE, albedo: Spectrum::splat(albedo), phase: Phase::ISOTROPIC }
    }
}

/// Length of the segments that a changing field reports (m).
const SEGMENT: f32 = 0.75;

impl Medium for Analytic {
    fn properties(&self, point: Vec3) -> Properties {
        let extinction = self.extinction(point);
        let scattering = extinction * self.albedo;
        Properties { absorption: extinction - scattering, scattering, emission: Spectrum::ZERO, phase: self.phase }
    }

    fn extinction(&self, point: Vec3) -> Spectrum {
        self.tint * self.field.at(point).0.max(0.0)
    }

    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        if let Field::Homogeneous { a } = self.field {
            let extinction = self.tint * a;
            return MajorantSegment { until: f32::INFINITY, minorant: extinction, majorant: extinction };
        }
        let until = from + SEGMENT.max(from * 1e-3);
        let ends = [from, until].map(|t| self.field.at(ray.at(t)).0.max(0.0));
        let mut top = ends[0].max(ends[1]);
        if let Field::Gaussian { c, .. } = self.field {
            let closest = ray.direction.dot(c - ray.origin).clamp(from, until);
            top = top.max(self.field.at(ray.at(closest)).0);
        }
        // A little room for rounding; monotonic or with one maximum, so the ends hold the minimum.
        let (low, high) = (ends[0].min(ends[1]) * 0.999 - 1e-6, top * 1.001 + 1e-6);
        MajorantSegment { until, minorant: self.tint * low.max(0.0), majorant: self.tint * high }
    }

    fn gradients(&self, point: Vec3) -> Gradients {
        let extinction = Gradient::outer(self.tint, self.field.at(point).1);
        Gradients { extinction, scattering: extinction * self.albedo }
    }

    fn is_grey(&self) -> bool {
        self.tint.is_grey()
    }
}

/// A convex body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Body {
    /// Axis-aligned.
    Box(Bounds),
    /// A ball.
    Sphere {
        /// m
        centre: Vec3,
        /// m
        radius: f32,
    },
}

impl Body {
    /// Where the line of `ray` enters and leaves.
    #[must_use]
    pub fn crossing(&self, ray: &Ray) -> Option<(f32, f32)> {
        match self {
            Self::Box(bounds) => bounds.intersect(ray),
            Self::Sphere { centre, radius } => {
                let offset = ray.origin - *centre;
                let half = offset.dot(ray.direction);
                let across = (offset - ray.direction * half).length_squared();
                let chord = radius * radius - across;
                (chord > 0.0).then(|| (-half - chord.sqrt(), -half + chord.sqrt()))
            }
        }
    }

    /// Outward normal at a point of the surface.
    #[must_use]
    pub fn normal(&self, at: Vec3) -> Vec3 {
        match self {
            Self::Box(bounds) => {
                let local = (at - bounds.centre()) / bounds.size();
                let size = local.abs();
                let axis = if size.x >= size.y && size.x >= size.z {
                    Vec3::X
                } else if size.y >= size.z {
                    Vec3::Y
                } else {
                    Vec3::Z
                };
                axis * axis.dot(local).signum()
            }
            Self::Sphere { centre, .. } => (at - *centre).normalize(),
        }
    }

    /// Whether `point` lies inside.
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        match self {
            Self::Box(bounds) => bounds.contains(point),
            Self::Sphere { centre, radius } => point.distance(*centre) <= *radius,
        }
    }
}

/// A medium that fills a body and reports the body's faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filled<M> {
    /// What is inside.
    pub medium: M,
    /// Where.
    pub body: Body,
}

impl<M: Medium> Medium for Filled<M> {
    fn properties(&self, point: Vec3) -> Properties {
        if self.body.contains(point) { self.medium.properties(point) } else { Properties::VACUUM }
    }

    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        let Some((near, far)) = self.body.crossing(ray) else { return MajorantSegment::vacuum(f32::INFINITY) };
        if from < near {
            return MajorantSegment::vacuum(near);
        }
        if from >= far {
            return MajorantSegment::vacuum(f32::INFINITY);
        }
        let inside = self.medium.majorant_segment(ray, from);
        MajorantSegment { until: inside.until.min(far), ..inside }
    }

    fn gradients(&self, point: Vec3) -> Gradients {
        if self.body.contains(point) { self.medium.gradients(point) } else { Gradients::default() }
    }

    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        let Some((near, far)) = self.body.crossing(ray) else { return };
        for distance in [near, far] {
            if distance > 0.0 && distance < ray.length {
                let at = ray.at(distance);
                visit(Face { distance, normal: self.body.normal(at), jump: -self.medium.extinction(at) });
            }
        }
    }
}

/// A sphere of matter around the origin, seen from inside or outside.
#[derive(Debug, Clone, Copy)]
pub struct Ball {
    /// Centre (m).
    pub centre: Vec3,
    /// Radius (m).
    pub radius: f32,
    /// What it is made of.
    pub surface: fogbow::surface::Surface,
}

impl Scene for Ball {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (near, far) = Body::Sphere { centre: self.centre, radius: self.radius }.crossing(ray)?;
        let distance = if near > 1e-4 { near } else { far };
        if !(distance > 1e-4 && distance < ray.length) {
            return None;
        }
        let outward = (ray.at(distance) - self.centre).normalize();
        let normal = if outward.dot(ray.direction) > 0.0 { -outward } else { outward };
        Some(Hit { distance, normal, shading: normal, surface: self.surface, light: None })
    }
}

/// A room: a box seen from inside.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// Its walls.
    pub bounds: Bounds,
    /// What they are made of.
    pub surface: fogbow::surface::Surface,
}

impl Scene for Room {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (_, distance) = self.bounds.intersect(ray)?;
        if !(distance > 1e-5 && distance < ray.length) {
            return None;
        }
        let normal = -Body::Box(self.bounds).normal(ray.at(distance));
        Some(Hit { distance, normal, shading: normal, surface: self.surface, light: None })
    }
}

/// Wraps a medium or a scene, asserts that it is asked and answers sensibly, and counts.
#[derive(Debug, Default)]
pub struct Complaining<T> {
    /// What is wrapped.
    pub inner: T,
    /// Properties and extinction asked for.
    pub points: AtomicU64,
    /// Segments asked for.
    pub segments: AtomicU64,
    /// Rays traced.
    pub rays: AtomicU64,
}

impl<T> Complaining<T> {
    /// Around `inner`.
    pub fn new(inner: T) -> Self {
        Self { inner, points: AtomicU64::new(0), segments: AtomicU64::new(0), rays: AtomicU64::new(0) }
    }

    /// Points, segments and rays asked for.
    pub fn counts(&self) -> [u64; 3] {
        [&self.points, &self.segments, &self.rays].map(|c| c.load(Ordering::Relaxed))
    }
}

fn check_ray(ray: &Ray) {
    assert!(ray.origin.is_finite(), "origin {} is not finite", ray.origin);
    assert!((ray.direction.length_squared() - 1.0).abs() < 1e-5, "{} is no unit vector", ray.direction);
    assert!(ray.length >= 0.0, "length {}", ray.length);
}

fn check_point(point: Vec3) {
    assert!(point.is_finite(), "asked at {point}");
}

impl<M: Medium> Medium for Complaining<M> {
    fn properties(&self, point: Vec3) -> Properties {
        self.points.fetch_add(1, Ordering::Relaxed);
        check_point(point);
        let p = self.inner.properties(point);
        assert!(p.absorption.is_valid() && p.scattering.is_valid() && p.emission.is_valid(), "{p:?} at {point}");
        p
    }
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.segments.fetch_add(1, Ordering::Relaxed);
        check_ray(ray);
        assert!(from >= 0.0 && from.is_finite(), "from {from}");
        let segment = self.inner.majorant_segment(ray, from);
        assert!(segment.until > from, "{segment:?} does not advance from {from}");
        // The bounds must hold: asked at a few points of the segment.
        let end = segment.until.min(ray.length).min(from + 1e3);
        for k in 1..4 {
            let value = self.inner.extinction(ray.at(from + (end - from) * (k as f32 * 0.2502)));
            for c in 0..3 {
                assert!(value[c] <= segment.majorant[c] * (1.0 + 1e-5), "{value:?} above {segment:?}");
                assert!(value[c] >= segment.minorant[c] * (1.0 - 1e-5), "{value:?} below {segment:?}");
            }
        }
        segment
    }
    fn extinction(&self, point: Vec3) -> Spectrum {
        self.points.fetch_add(1, Ordering::Relaxed);
        check_point(point);
        let extinction = self.inner.extinction(point);
        assert!(extinction.is_valid(), "{extinction:?} at {point}");
        extinction
    }
    fn resolution(&self) -> f32 {
        self.inner.resolution()
    }
    fn gradients(&self, point: Vec3) -> Gradients {
        check_point(point);
        let g = self.inner.gradients(point);
        assert!(g.extinction.is_finite() && g.scattering.is_finite(), "{g:?} at {point}");
        g
    }
    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        self.inner.extinction_hessian(point)
    }
    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        self.inner.mean_extinction(centre, radius)
    }
    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        check_ray(ray);
        self.inner.faces(ray, &mut |face| {
            assert!(face.distance >= 0.0 && face.distance <= ray.length, "{face:?} outside {ray:?}");
            assert!((face.normal.length_squared() - 1.0).abs() < 1e-4 && face.jump.is_finite(), "{face:?}");
            visit(face);
        });
    }
    fn is_grey(&self) -> bool {
        self.inner.is_grey()
    }
    fn is_emissive(&self) -> bool {
        self.inner.is_emissive()
    }
}

impl<S: Scene> Scene for Complaining<S> {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.rays.fetch_add(1, Ordering::Relaxed);
        check_ray(ray);
        let hit = self.inner.closest_hit(ray);
        if let Some(hit) = hit {
            assert!(hit.distance >= 0.0 && hit.distance <= ray.length, "{hit:?} outside {ray:?}");
            assert!((hit.normal.length_squared() - 1.0).abs() < 1e-4, "{hit:?}");
        }
        hit
    }
    fn is_blocked(&self, ray: &Ray) -> bool {
        self.rays.fetch_add(1, Ordering::Relaxed);
        check_ray(ray);
        self.inner.is_blocked(ray)
    }
}
