//! Media in containers of any form.

use std::sync::Arc;

use fogbow::host::{Face, Gradients, MajorantSegment, Medium, Properties};
use fogbow::math::{Ray, Vec3};
use fogbow::medium::Region;
use fogbow::spectrum::{Gradient, Hessian, Spectrum};

use super::body::Body;
use super::coloured::Stuff;

/// A part of space.
#[derive(Debug, Clone)]
pub(super) enum Solid {
    Region(Region),
    Body(Arc<Body>),
}

impl Solid {
    fn contains(&self, point: Vec3) -> bool {
        match self {
            Self::Region(region) => region.contains(point),
            Self::Body(body) => body.contains(point),
        }
    }

    /// Whether the ray is inside at `from`, and until where (m) this is so.
    fn span(&self, ray: &Ray, from: f32) -> (bool, f32) {
        match self {
            Self::Region(region) => match region.interval(ray) {
                Some((entry, _)) if from < entry => (false, entry),
                Some((_, exit)) if from < exit => (true, exit),
                _ => (false, f32::INFINITY),
            },
            Self::Body(body) => body.span(ray, from),
        }
    }

    /// All crossings of the ray: distance and outward normal.
    fn crossings(&self, ray: &Ray, visit: &mut dyn FnMut(f32, Vec3)) {
        match self {
            Self::Region(region) => {
                let crossings = region.crossings(ray).into_iter().flatten();
                for crossing in crossings.filter(|c| c.distance >= 0.0 && c.distance <= ray.length) {
                    visit(crossing.distance, crossing.normal);
                }
            }
            Self::Body(body) => {
                let mut from = 0.0;
                while let Some((distance, normal)) = body.crossing(ray, from).filter(|c| c.0 <= ray.length) {
                    visit(distance, normal);
                    if !(distance > from) {
                        break;
                    }
                    from = distance;
                }
            }
        }
    }
}

/// A medium where all of `within` are, and none of `holes`.
#[derive(Debug, Clone)]
pub struct Contained<'a> {
    pub(super) medium: Stuff<'a>,
    pub(super) within: Vec<Solid>,
    pub(super) holes: Vec<Solid>,
}

impl<'a> Contained<'a> {
    pub(super) fn medium(&self) -> &Stuff<'a> {
        &self.medium
    }

    fn contains(&self, point: Vec3) -> bool {
        self.within.iter().all(|s| s.contains(point)) && !self.holes.iter().any(|s| s.contains(point))
    }

    fn segment(&self, ray: &Ray, from: f32, ask: impl FnOnce(&Stuff<'a>) -> MajorantSegment) -> MajorantSegment {
        let mut end = f32::INFINITY;
        for solid in &self.within {
            match solid.span(ray, from) {
                (false, until) => return MajorantSegment::vacuum(until),
                (true, until) => end = end.min(until),
            }
        }
        for hole in &self.holes {
            match hole.span(ray, from) {
                (true, until) => return MajorantSegment::vacuum(until),
                (false, until) => end = end.min(until),
            }
        }
        let segment = ask(&self.medium);
        MajorantSegment { until: segment.until.min(end), ..segment }
    }
}

impl Medium for Contained<'_> {
    fn properties(&self, point: Vec3) -> Properties {
        if self.contains(point) { self.medium.properties(point) } else { Properties::VACUUM }
    }

    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.segment(ray, from, |medium| medium.majorant_segment(ray, from))
    }

    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.segment(ray, from, |medium| medium.marching_segment(ray, from))
    }

    fn extinction(&self, point: Vec3) -> Spectrum {
        // Where the medium itself has nothing, nobody need ask for containers.
        let extinction = self.medium.extinction(point);
        if !extinction.is_black() && self.contains(point) { extinction } else { Spectrum::ZERO }
    }

    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        if self.contains(point) {
            self.medium.extinction_with_gradient(point)
        } else {
            (Spectrum::ZERO, Gradient::ZERO)
        }
    }

    fn resolution(&self) -> f32 {
        self.medium.resolution()
    }

    fn gradients(&self, point: Vec3) -> Gradients {
        if self.contains(point) { self.medium.gradients(point) } else { Gradients::default() }
    }

    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        if self.contains(point) { self.medium.extinction_hessian(point) } else { Hessian::ZERO }
    }

    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        let step = 1e-3 * self.medium.resolution();
        for (number, (solid, sign)) in
            self.within.iter().map(|s| (s, -1.0)).chain(self.holes.iter().map(|s| (s, 1.0))).enumerate()
        {
            solid.crossings(ray, &mut |distance, normal| {
                let point = ray.at(distance);
                // Of a container the medium is on the side where the normal comes from, of a hole where it goes to.
                let side = point + normal * (step * sign);
                let is_within = self.within.iter().enumerate().all(|(i, s)| i == number || s.contains(side));
                let count = self.within.len();
                let is_free = !self.holes.iter().enumerate().any(|(i, s)| i + count != number && s.contains(side));
                let jump = self.medium.extinction(side) * sign;
                if is_within && is_free && !jump.is_black() {
                    visit(Face { distance, normal, jump });
                }
            });
        }
        self.medium.faces(ray, &mut |face| {
            if self.contains(ray.at(face.distance)) {
                visit(face);
            }
        });
    }

    fn is_grey(&self) -> bool {
        self.medium.is_grey()
    }

    fn is_emissive(&self) -> bool {
        self.medium.is_emissive()
    }
}
