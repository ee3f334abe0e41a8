//! A medium inside a region, and outside of holes in it.

use glam::Vec3;

use super::{Crossing, Region, ball};
use crate::host::{Face, Gradients, MajorantSegment, Medium, Properties};
use crate::math::Ray;
use crate::spectrum::{Gradient, Hessian, Spectrum};

/// A medium that fills a region, except for holes; elsewhere is vacuum.
///
/// Every face where extinction jumps is reported by [`Medium::faces`], for the boundary terms of
/// gradients (sheet § 1.4).
///
/// ```
/// # use fogbow::{host::Medium, math::{Ray, Vec3}, phase::Phase, spectrum::Spectrum};
/// # use fogbow::medium::{Homogeneous, Placed, Region};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
/// let bubble = [Region::sphere(Vec3::ZERO, 1.0).unwrap()];
/// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 2.0).unwrap()).with_holes(&bubble);
/// let ray = Ray::new(Vec3::new(-5.0, 0.0, 0.0), Vec3::X);
/// assert_eq!(ball.majorant_segment(&ray, 0.0).until, 3.0);     // vacuum before the ball
/// assert_eq!(ball.majorant_segment(&ray, 3.0).until, 4.0);     // fog before the hole
/// assert_eq!(ball.majorant_segment(&ray, 3.0).majorant, Spectrum::ONE);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed<'a, M> {
    medium: M,
    region: Region,
    holes: &'a [Region],
}

impl<M> Placed<'_, M> {
    /// `medium` inside `region`, without holes.
    #[inline]
    #[must_use]
    pub fn new(medium: M, region: Region) -> Self {
        Self { medium, region, holes: &[] }
    }

    /// The same with `holes` in place of those it had. Holes may overlap and poke out of the region.
    #[inline]
    #[must_use]
    pub fn with_holes<'b>(self, holes: &'b [Region]) -> Placed<'b, M> {
        Placed { medium: self.medium, region: self.region, holes }
    }

    /// The medium, as if it were everywhere.
    ///
    /// ```
    /// # use fogbow::{host::Medium, math::Vec3, medium::{Homogeneous, Placed, Region}, phase::Phase, spectrum::Spectrum};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 2.0)?);
    /// let outside = 3.0 * Vec3::X;
    /// assert_eq!((ball.extinction(outside), ball.medium().extinction(outside)), (Spectrum::ZERO, Spectrum::ONE));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn medium(&self) -> &M {
        &self.medium
    }

    /// Where it is placed.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::Vec3, medium::{Placed, Region}};
    /// let ball = Region::sphere(Vec3::ZERO, 2.0)?;
    /// assert_eq!(Placed::new(Empty, ball).region(), &ball);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// Where it is not.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::Vec3, medium::{Placed, Region}};
    /// let bubbles = [Region::sphere(Vec3::ZERO, 1.0)?];
    /// let solid = Placed::new(Empty, Region::sphere(Vec3::ZERO, 2.0)?);
    /// assert_eq!((solid.holes(), solid.with_holes(&bubbles).holes()), (&[][..], &bubbles[..]));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn holes(&self) -> &[Region] {
        self.holes
    }

    /// Whether the medium is there at `point`.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::Vec3, medium::{Placed, Region}};
    /// let bubbles = [Region::sphere(Vec3::ZERO, 1.0)?];
    /// let ball = Placed::new(Empty, Region::sphere(Vec3::ZERO, 2.0)?).with_holes(&bubbles);
    /// let inside = [0.5, 1.5, 2.5].map(|x| ball.contains(x * Vec3::X));
    /// assert_eq!(inside, [false, true, false]);   // in the hole, in the medium, outside
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        self.region.contains(point) && !self.holes.iter().any(|hole| hole.contains(point))
    }
}

impl<M: Medium> Placed<'_, M> {
    /// A segment of the medium itself, cut at the faces of the region and its holes; vacuum outside.
    #[inline]
    fn within(&self, ray: &Ray, from: f32, ask: impl FnOnce(&M) -> MajorantSegment) -> MajorantSegment {
        let Some((entry, exit)) = self.region.interval(ray) else { return MajorantSegment::vacuum(f32::INFINITY) };
        if from >= exit {
            return MajorantSegment::vacuum(f32::INFINITY);
        }
        if from < entry {
            return MajorantSegment::vacuum(entry);
        }
        let mut end = exit;
        for (entry, exit) in self.holes.iter().filter_map(|hole| hole.interval(ray)) {
            if from >= exit {
                continue;
            }
            if from >= entry {
                return MajorantSegment::vacuum(exit);
            }
            end = end.min(entry);
        }
        let segment = ask(&self.medium);
        MajorantSegment { until: segment.until.min(end), ..segment }
    }

    /// Reports the faces of one region: the outer one, or of the hole with index `hole`.
    fn own_faces(&self, ray: &Ray, region: &Region, hole: Option<usize>, visit: &mut dyn FnMut(Face)) {
        let crossings = region.crossings(ray).into_iter().flatten();
        for Crossing { distance, normal } in crossings.filter(|c| c.distance >= 0.0 && c.distance <= ray.length) {
            let point = ray.at(distance);
            // A hair into the medium, should it have faces of its own there.
            let step = normal * (1e-3 * self.medium.resolution());
            let (medium_side, sign) = if hole.is_some() { (point + step, 1.0) } else { (point - step, -1.0) };
            let is_hidden = hole.is_some() && !self.region.contains(point)
                || self.holes.iter().enumerate().any(|(i, other)| Some(i) != hole && other.contains(point));
            let jump = self.medium.extinction(medium_side) * sign;
            if !(is_hidden || jump.is_black()) {
                visit(Face { distance, normal, jump });
            }
        }
    }
}

impl<M: Medium> Medium for Placed<'_, M> {
    #[inline]
    fn properties(&self, point: Vec3) -> Properties {
        if self.contains(point) { self.medium.properties(point) } else { Properties::VACUUM }
    }

    #[inline]
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.within(ray, from, |medium| medium.majorant_segment(ray, from))
    }

    #[inline]
    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.within(ray, from, |medium| medium.marching_segment(ray, from))
    }

    #[inline]
    fn extinction(&self, point: Vec3) -> Spectrum {
        if self.contains(point) { self.medium.extinction(point) } else { Spectrum::ZERO }
    }

    #[inline]
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

    /// Where the ball meets faces: from some 300 points, of which those outside count as nothing.
    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        if radius.max(0.0) == 0.0 {
            return self.extinction(centre);
        }
        if self.region.contains_ball(centre, radius) && self.holes.iter().all(|h| h.is_clear_of_ball(centre, radius)) {
            return self.medium.mean_extinction(centre, radius);
        }
        ball::mean(centre, radius, 8, |point| self.extinction(point))
    }

    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        self.own_faces(ray, &self.region, None, visit);
        for (i, hole) in self.holes.iter().enumerate() {
            self.own_faces(ray, hole, Some(i), visit);
        }
        // The medium's own faces, but not again where they coincide with the region's.
        let near = |a: f32, b: f32| (a - b).abs() <= 1e-3 * self.medium.resolution() + 1e-6 * a.abs();
        let Some((entry, exit)) = self.region.interval(ray) else { return };
        self.medium.faces(ray, &mut |face| {
            let t = face.distance;
            let is_within = t > entry && t < exit && !near(t, entry) && !near(t, exit);
            if is_within && !self.holes.iter().any(|hole| hole.contains(ray.at(t))) {
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
