//! Counts how often a host's world is asked: wrappers that stand beside the traits they forward.

use core::cell::Cell;
use core::ops::{Add, AddAssign};

use super::integrand::Tally;
use crate::host::{Face, Gradients, Hit, MajorantSegment, Medium, Properties, Scene};
use crate::math::{Ray, Symmetric3, Vec3};
use crate::spectrum::{Gradient, Hessian, Spectrum};

/// How often the world was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Samples in the film.
    pub samples: u64,
    /// Closest-hit queries.
    pub rays: u64,
    /// Visibility queries.
    pub shadow_rays: u64,
    /// Collisions of paths with a medium, as the integrand reports them: see [`Queries::collide`].
    pub collisions: u64,
    /// Queries of a medium at a point: properties, extinction, derivatives.
    pub lookups: u64,
    /// Queries of a medium's bounds along a ray.
    pub segments: u64,
    /// Questions asked of caches: see [`Queries::look_up`].
    pub cache_lookups: u64,
    /// Of these, questions no record answered.
    pub cache_misses: u64,
    /// Samples that were no finite numbers and were taken for black: 0 unless something is wrong.
    pub non_finite: u64,
}

impl Add for Counters {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            samples: self.samples + o.samples,
            rays: self.rays + o.rays,
            shadow_rays: self.shadow_rays + o.shadow_rays,
            collisions: self.collisions + o.collisions,
            lookups: self.lookups + o.lookups,
            segments: self.segments + o.segments,
            cache_lookups: self.cache_lookups + o.cache_lookups,
            cache_misses: self.cache_misses + o.cache_misses,
            non_finite: self.non_finite + o.non_finite,
        }
    }
}

impl AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// Counters that many wrappers of one thread may raise.
#[derive(Debug, Default)]
pub struct Queries {
    rays: Cell<u64>,
    shadow_rays: Cell<u64>,
    collisions: Cell<u64>,
    lookups: Cell<u64>,
    segments: Cell<u64>,
    cache_lookups: Cell<u64>,
    cache_misses: Cell<u64>,
}

impl Queries {
    /// Adds collisions: what only the integrand knows.
    ///
    /// ```
    /// let tally = fogbow::picture::Queries::default();
    /// tally.collide(3);
    /// assert_eq!(tally.counters().collisions, 3);
    /// ```
    #[inline]
    pub fn collide(&self, collisions: u32) {
        self.collisions.set(self.collisions.get() + u64::from(collisions));
    }

    /// Adds questions asked of caches, and those of them that no record answered.
    ///
    /// ```
    /// let tally = fogbow::picture::Queries::default();
    /// tally.look_up(5, 2);
    /// assert_eq!((tally.counters().cache_lookups, tally.counters().cache_misses), (5, 2));
    /// ```
    #[inline]
    pub fn look_up(&self, lookups: u32, misses: u32) {
        self.cache_lookups.set(self.cache_lookups.get() + u64::from(lookups));
        self.cache_misses.set(self.cache_misses.get() + u64::from(misses));
    }

    /// What was counted so far.
    ///
    /// ```
    /// # use fogbow::picture::{Counters, Queries};
    /// assert_eq!(Queries::default().counters(), Counters::default());
    /// ```
    #[must_use]
    pub fn counters(&self) -> Counters {
        Counters {
            rays: self.rays.get(),
            shadow_rays: self.shadow_rays.get(),
            collisions: self.collisions.get(),
            lookups: self.lookups.get(),
            segments: self.segments.get(),
            cache_lookups: self.cache_lookups.get(),
            cache_misses: self.cache_misses.get(),
            ..Counters::default()
        }
    }
}

impl Tally for Queries {
    type Total = Counters;

    fn add_to(&self, total: &mut Counters) {
        *total += self.counters();
    }
}

#[inline]
fn raise(counter: &Cell<u64>) {
    counter.set(counter.get() + 1);
}

/// A scene that counts what it is asked; two references, to be made where it is needed.
///
/// ```
/// use fogbow::{host::{Empty, Scene}, math::{Ray, Vec3}};
/// use fogbow::picture::{CountingScene, Queries};
/// let tally = Queries::default();
/// let scene = CountingScene { scene: &Empty, tally: &tally };
/// assert!(scene.closest_hit(&Ray::new(Vec3::ZERO, Vec3::X)).is_none());
/// assert_eq!(tally.counters().rays, 1);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct CountingScene<'t, S> {
    /// The scene that answers.
    pub scene: S,
    /// Where the queries are counted.
    pub tally: &'t Queries,
}

impl<S: Scene> Scene for CountingScene<'_, S> {
    #[inline]
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        raise(&self.tally.rays);
        self.scene.closest_hit(ray)
    }
    #[inline]
    fn is_blocked(&self, ray: &Ray) -> bool {
        raise(&self.tally.shadow_rays);
        self.scene.is_blocked(ray)
    }
    fn curvature(&self, ray: &Ray, hit: &Hit) -> Symmetric3 {
        self.scene.curvature(ray, hit)
    }
}

/// A medium that counts what it is asked.
///
/// ```
/// use fogbow::{host::{Empty, Medium}, math::Vec3};
/// use fogbow::picture::{CountingMedium, Queries};
/// let tally = Queries::default();
/// let medium = CountingMedium { medium: &Empty, tally: &tally };
/// medium.extinction(Vec3::ZERO);
/// assert_eq!(tally.counters().lookups, 1);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct CountingMedium<'t, M> {
    /// The medium that answers.
    pub medium: M,
    /// Where the queries are counted.
    pub tally: &'t Queries,
}

impl<M: Medium> Medium for CountingMedium<'_, M> {
    #[inline]
    fn properties(&self, point: Vec3) -> Properties {
        raise(&self.tally.lookups);
        self.medium.properties(point)
    }
    #[inline]
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        raise(&self.tally.segments);
        self.medium.majorant_segment(ray, from)
    }
    #[inline]
    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        raise(&self.tally.segments);
        self.medium.marching_segment(ray, from)
    }
    #[inline]
    fn extinction(&self, point: Vec3) -> Spectrum {
        raise(&self.tally.lookups);
        self.medium.extinction(point)
    }
    #[inline]
    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        raise(&self.tally.lookups);
        self.medium.extinction_with_gradient(point)
    }
    #[inline]
    fn resolution(&self) -> f32 {
        self.medium.resolution()
    }
    fn gradients(&self, point: Vec3) -> Gradients {
        raise(&self.tally.lookups);
        self.medium.gradients(point)
    }
    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        raise(&self.tally.lookups);
        self.medium.extinction_hessian(point)
    }
    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        raise(&self.tally.lookups);
        self.medium.mean_extinction(centre, radius)
    }
    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        self.medium.faces(ray, visit);
    }
    #[inline]
    fn is_grey(&self) -> bool {
        self.medium.is_grey()
    }
    #[inline]
    fn is_emissive(&self) -> bool {
        self.medium.is_emissive()
    }
}
