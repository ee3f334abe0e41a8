//! Light that arrives through the medium, and what a phase function makes of it.

use glam::Vec3;

use crate::host::{Hit, Medium};
use crate::light::{Falloff, Source};
use crate::math::Ray;
use crate::phase::{self, Phase, deflection_gradient};
use crate::sh::{self, Coefficient, MAX_DEGREE};
use crate::spectrum::{Gradient, Spectrum};
use crate::transmittance::thickness::{self, Marching, Transmittance};

/// Smallest cosine in the gradient of a surface hit: `1/c` at grazing hits has a variance that
/// grows without bound near silhouettes (sheet § 1.5).
const MIN_HIT_COSINE: f32 = 1e-3;

/// Light that arrives at a point from one direction, after fog and before shadows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    /// Where it comes from (unit).
    pub to_light: Vec3,
    /// Irradiance across the light, `w T H` (W·m⁻²).
    pub irradiance: Spectrum,
    /// `w (T ∇H + H ∇T)` (W·m⁻³).
    pub gradient: Gradient,
    /// Irradiance over the distance (W·m⁻³), by which the direction turns; 0 for a distant source.
    pub turning: Spectrum,
}

/// One summand of an estimate: radiance (W·m⁻²·sr⁻¹) and its gradient (W·m⁻³·sr⁻¹).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Contribution {
    /// `L_j`.
    pub radiance: Spectrum,
    /// `∇L_j`.
    pub gradient: Gradient,
}

impl Contribution {
    /// Nothing.
    pub const ZERO: Self = Self { radiance: Spectrum::ZERO, gradient: Gradient::ZERO };
}

impl core::ops::Mul<f32> for Contribution {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f32) -> Self {
        Self { radiance: self.radiance * factor, gradient: self.gradient * factor }
    }
}

impl core::ops::AddAssign for Contribution {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.radiance += other.radiance;
        self.gradient += other.gradient;
    }
}

impl core::ops::Mul<f32> for Arrival {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f32) -> Self {
        Self {
            irradiance: self.irradiance * factor,
            gradient: self.gradient * factor,
            turning: self.turning * factor,
            ..self
        }
    }
}

impl Arrival {
    /// Light from `source` at `point`; `None` where nothing arrives (at the source itself, behind
    /// it, outside its cone).
    ///
    /// ```text
    /// E = w T H,   ∇E = w (T ∇H + H ∇T),   ∇T with the source fixed
    /// ```
    ///
    /// `closest` (m) bounds the fall-off of a source within the medium: nearer, `H` is that at this
    /// distance and `∇H = 0`. 0 leaves it exact; see [`crate::multiple_scatter`] for when not to.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::PointLight, math::Vec3, spectrum::Spectrum};
    /// # use fogbow::{single_scatter::Arrival, transmittance::thickness::Marching};
    /// let lamp = PointLight::new(Vec3::new(0.0, 0.0, 2.0), Spectrum::ONE).unwrap().source();
    /// let arrival = Arrival::from_source(Vec3::ZERO, &Empty, &lamp, Marching::midpoints(8), 0.0).unwrap();
    /// assert_eq!((arrival.irradiance[0], arrival.gradient.z[0]), (0.25, 0.25));   // nearer is brighter
    /// ```
    #[must_use]
    pub fn from_source(
        point: Vec3,
        medium: &(impl Medium + ?Sized),
        source: &Source,
        marching: Marching,
        closest: f32,
    ) -> Option<Self> {
        let ray = if source.falloff == Falloff::Distant {
            Ray { origin: point, direction: -source.normal, length: f32::INFINITY }
        } else {
            Ray::between(point, source.position)
        };
        let (irradiance, slope) = if ray.length < closest {
            let (held, _) = source.irradiance(source.position - ray.direction * closest)?;
            (held, Gradient::ZERO)
        } else {
            source.irradiance(point)?
        };
        if irradiance.is_black() && slope == Gradient::ZERO {
            return None;
        }
        let through = thickness::transmittance_with_gradients(&ray, medium, marching);
        Self::through(&ray, irradiance, slope, &through)
    }

    /// Light from a surface that a ray from its origin has hit, the ray's direction being drawn with
    /// density `pdf` (sr⁻¹) and `outgoing` the radiance (W·m⁻²·sr⁻¹) the surface sends back.
    ///
    /// ```text
    /// w H = L/pdf,   ∇(w H) = (L/pdf) (n − 3cu)/(c r)
    /// ```
    ///
    /// The hit stays where it is while the point moves, the density is frozen, and `c` is at least
    /// 10⁻³ in the gradient. Source: sheet § 1.5 (Jarosz et al. 2008, Eq. 9–13; Eq. 13 lacks 1/(4π)).
    ///
    /// ```
    /// # use fogbow::{host::{Empty, Hit}, math::{Ray, Vec3, float::PI}, spectrum::Spectrum, surface::Surface};
    /// # use fogbow::{single_scatter::Arrival, transmittance::thickness::Marching};
    /// // A wall two metres ahead, in vacuum; its direction was drawn uniformly from the sphere.
    /// let wall = Hit { distance: 2.0, normal: Vec3::NEG_X, shading: Vec3::NEG_X, surface: Surface::BLACK, light: None };
    /// let (ray, pdf) = (Ray::new(Vec3::ZERO, Vec3::X), 1.0 / (4.0 * PI));
    /// let arrival = Arrival::from_surface(&ray, &wall, Spectrum::ONE, pdf, &Empty, Marching::midpoints(1)).unwrap();
    /// assert!((arrival.irradiance[0] - 4.0 * PI).abs() < 1e-5);
    /// // Closer by dx, a piece of the wall is seen larger by 2 dx/r.
    /// assert!((arrival.gradient.x[0] / arrival.irradiance[0] - 2.0 / 2.0).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn from_surface(
        ray: &Ray,
        hit: &Hit,
        outgoing: Spectrum,
        pdf: f32,
        medium: &(impl Medium + ?Sized),
        marching: Marching,
    ) -> Option<Self> {
        let segment = ray.with_length(hit.distance);
        let through = || thickness::transmittance_with_gradients(&segment, medium, marching);
        Self::from_surface_through(ray, hit, outgoing, pdf, through)
    }

    /// [`Arrival::from_surface`] where transmittance is known, or is asked for if needed.
    ///
    /// ```
    /// # use fogbow::{host::Hit, math::{Ray, Vec3}, spectrum::{Gradient, Spectrum}, surface::Surface};
    /// # use fogbow::{single_scatter::Arrival, transmittance::thickness::Transmittance};
    /// let wall = Hit { distance: 2.0, normal: Vec3::NEG_X, shading: Vec3::NEG_X, surface: Surface::BLACK, light: None };
    /// let still = Gradient::ZERO;
    /// let half = || Transmittance { value: Spectrum::splat(0.5), gradient_fixed: still, gradient_joint: still };
    /// let arrival = Arrival::from_surface_through(&Ray::new(Vec3::ZERO, Vec3::X), &wall, Spectrum::ONE, 1.0, half).unwrap();
    /// assert_eq!(arrival.irradiance, Spectrum::splat(0.5));
    /// assert_eq!(arrival.turning, arrival.irradiance / 2.0);   // over the distance
    /// ```
    #[must_use]
    pub fn from_surface_through(
        ray: &Ray,
        hit: &Hit,
        outgoing: Spectrum,
        pdf: f32,
        through: impl FnOnce() -> Transmittance,
    ) -> Option<Self> {
        Self::from_end(ray, Some(hit), outgoing, pdf, through)
    }

    /// [`Arrival::from_surface_through`] for the `end` of a ray: a surface, or, without one, the sky
    /// ([`crate::light::sky`]), a surface infinitely far.
    ///
    /// ```
    /// # use fogbow::{math::{Ray, Vec3}, spectrum::{Gradient, Spectrum}};
    /// # use fogbow::{single_scatter::Arrival, transmittance::thickness::Transmittance};
    /// let still = Gradient::ZERO;
    /// let clear = || Transmittance { value: Spectrum::ONE, gradient_fixed: still, gradient_joint: still };
    /// let sky = Arrival::from_end(&Ray::new(Vec3::ZERO, Vec3::Z), None, Spectrum::ONE, 0.5, clear).unwrap();
    /// assert_eq!((sky.irradiance, sky.gradient, sky.turning), (Spectrum::splat(2.0), still, Spectrum::ZERO));
    /// ```
    #[must_use]
    pub fn from_end(
        ray: &Ray,
        end: Option<&Hit>,
        outgoing: Spectrum,
        pdf: f32,
        through: impl FnOnce() -> Transmittance,
    ) -> Option<Self> {
        let is_apart = end.is_none_or(|hit| hit.distance > 0.0);
        let arrives = is_apart && pdf > 0.0 && !outgoing.is_black();
        arrives.then(|| Self::from_end_through(ray, end, outgoing / pdf, &through())).flatten()
    }

    /// [`Arrival::from_end`] of what does arrive: not generic, as it is most of it.
    fn from_end_through(ray: &Ray, end: Option<&Hit>, irradiance: Spectrum, through: &Transmittance) -> Option<Self> {
        let Some(hit) = end else {
            return Self::through(&ray.with_length(f32::INFINITY), irradiance, Gradient::ZERO, through);
        };
        let u = -ray.direction;
        let signed = hit.normal.dot(u);
        // The side that is seen.
        let normal = if signed < 0.0 { -hit.normal } else { hit.normal };
        let cosine = signed.abs();
        let slope = (normal - u * (3.0 * cosine)) / cosine.max(MIN_HIT_COSINE) / hit.distance;
        let slope = Gradient::outer(irradiance, slope);
        Self::through(&ray.with_length(hit.distance), irradiance, slope, through)
    }

    /// `None` where the light or its slope leaves the range of `f32`, within about 10⁻¹² m of a strong
    /// source: as at the source itself.
    fn through(ray: &Ray, irradiance: Spectrum, slope: Gradient, t: &Transmittance) -> Option<Self> {
        // Room for the slopes of the basis functions, which come on top.
        const MOST: f32 = 1e-6 * f32::MAX;
        let irradiance_here = irradiance * t.value;
        let gradient = slope * t.value + t.gradient_fixed * irradiance;
        let steepest = gradient.norm().max_element().max(irradiance_here.max_element() / ray.length);
        // NaN, too, is not below.
        (steepest < MOST && gradient.is_finite() && irradiance_here.max_element() < MOST).then_some(Self {
            to_light: ray.direction,
            irradiance: irradiance_here,
            gradient,
            turning: irradiance_here / ray.length,
        })
    }

    /// Scattered once towards `to_eye` (unit): `L = p E`, `∇L = E ∇p + p ∇E`. Nothing where that leaves
    /// the range of `f32`.
    ///
    /// ```
    /// # use fogbow::{math::{Vec3, float::INV_FOUR_PI}, phase::Phase, single_scatter::Arrival};
    /// # use fogbow::spectrum::{Gradient, Spectrum};
    /// let gradient = Gradient::outer(Spectrum::ONE, Vec3::Z);
    /// let arrival = Arrival { to_light: Vec3::Z, irradiance: Spectrum::splat(2.0), gradient, turning: Spectrum::ONE };
    /// let scattered = arrival.scatter(Vec3::X, &Phase::ISOTROPIC);
    /// assert!((scattered.radiance[0] - 2.0 * INV_FOUR_PI).abs() < 1e-7);
    /// assert_eq!(scattered.gradient, gradient * INV_FOUR_PI);   // isotropic: that light turns does not matter
    /// ```
    #[inline]
    #[must_use]
    pub fn scatter(&self, to_eye: Vec3, phase: &Phase) -> Contribution {
        let deflection = phase::deflection(self.to_light, to_eye);
        let value = phase.value(deflection);
        let turn = deflection_gradient(self.to_light, to_eye, 1.0);
        let slope = Gradient::outer(phase.derivative(deflection), turn);
        let scattered =
            Contribution { radiance: value * self.irradiance, gradient: slope * self.turning + self.gradient * value };
        if scattered.radiance.is_finite() && scattered.gradient.is_finite() { scattered } else { Contribution::ZERO }
    }

    /// How what is scattered towards `to_eye` changes as that direction turns: a tangential gradient
    /// (W·m⁻²·sr⁻¹ per radian).
    ///
    /// ```
    /// # use fogbow::{math::Vec3, phase::{Lobe, Phase}, single_scatter::Arrival, spectrum::{Gradient, Spectrum}};
    /// let fog = Phase::from(Lobe::HenyeyGreenstein { g: 0.5 });
    /// let (irradiance, gradient, turning) = (Spectrum::ONE, Gradient::ZERO, Spectrum::ZERO);
    /// let arrival = Arrival { to_light: Vec3::Z, irradiance, gradient, turning };
    /// let seen = |angle: f32| arrival.scatter(Vec3::new(angle.cos(), 0.0, -angle.sin()), &fog).radiance[0];
    /// let difference = (seen(0.01) - seen(-0.01)) / 0.02;   // per radian, towards −z
    /// assert!((arrival.turned(Vec3::X, &fog).along(Vec3::NEG_Z)[0] - difference).abs() < 1e-4);
    /// ```
    #[inline]
    #[must_use]
    pub fn turned(&self, to_eye: Vec3, phase: &Phase) -> Gradient {
        let slope = phase.derivative(phase::deflection(self.to_light, to_eye));
        let turned = Gradient::outer(slope * self.irradiance, to_eye * to_eye.dot(self.to_light) - self.to_light);
        if turned.is_finite() { turned } else { Gradient::ZERO }
    }

    /// Scattered once in all directions: adds `weight` times the coefficients and their gradients
    /// to `expansion`, and returns the mean over directions, `E/(4π)`.
    ///
    /// ```text
    /// L_lm = f_l Y_lm(u) E,   ∇L_lm = f_l (E ∇Y_lm + Y_lm ∇E),   u = −to_light
    /// ```
    ///
    /// Source: Jarosz et al. 2008, Eq. 23–26; sheet § 1.6. The expansion is evaluated at `to_eye`.
    /// As many whole degrees take part as have a moment and fit into `expansion`.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, phase::{Lobe, Phase}, sh::{Coefficient, expansion}};
    /// # use fogbow::{single_scatter::{Arrival, moments}, spectrum::{Gradient, Spectrum}};
    /// let fog = Phase::from(Lobe::HenyeyGreenstein { g: 0.2 });
    /// let (irradiance, gradient, turning) = (Spectrum::ONE, Gradient::ZERO, Spectrum::ZERO);
    /// let arrival = Arrival { to_light: Vec3::Z, irradiance, gradient, turning };
    /// let mut coefficients = [Coefficient::ZERO; 49];
    /// arrival.scatter_directional(&moments(&fog, 6)[..7], 1.0, &mut coefficients);
    /// let to_eye = Vec3::new(0.6, 0.0, 0.8);
    /// let expanded = expansion::value_with_gradient(&coefficients, to_eye).0[0];
    /// assert!((expanded - arrival.scatter(to_eye, &fog).radiance[0]).abs() < 1e-4);   // 0.2⁷ is left out
    /// ```
    pub fn scatter_directional(
        &self,
        moments: &[Spectrum],
        weight: f32,
        expansion: &mut [Coefficient],
    ) -> Contribution {
        if weight != 0.0 {
            let known = moments.len().min(sh::degree_of(expansion.len()).map_or(0, |d| d + 1));
            sh::zonal::coefficients_with_gradients(&moments[..known], -self.to_light, 1.0, |k, value, slope| {
                expansion[k].value += value * self.irradiance * weight;
                expansion[k].gradient += (slope * self.turning + self.gradient * value) * weight;
            });
        }
        Contribution { radiance: self.irradiance, gradient: self.gradient } * crate::math::float::INV_FOUR_PI
    }
}

/// In-scattered radiance at `point` towards `to_eye` from one source, without shadows, and its
/// gradient.
///
/// ```text
/// L = w p T H,     ∇L = w [(∇p) T H + p (∇T) H + p T (∇H)]
/// ```
///
/// `source` stays fixed. Nothing where no light arrives. Exact where the medium is constant along
/// the connection, else as exact as `marching`. Source: Jarosz et al. 2008, Eq. 14–15; sheet § 1.5.
///
/// ```
/// # use fogbow::{host::Empty, light::PointLight, math::Vec3, phase::Phase, spectrum::Spectrum};
/// # use fogbow::{single_scatter::connect, transmittance::thickness::Marching};
/// let lamp = PointLight::new(Vec3::new(0.0, 0.0, 2.0), Spectrum::ONE).unwrap().source();
/// let l = connect(Vec3::ZERO, Vec3::X, &Phase::ISOTROPIC, &Empty, &lamp, Marching::midpoints(8));
/// assert!((l.radiance[0] - 0.25 / (4.0 * 3.14159265)).abs() < 1e-8);
/// ```
#[must_use]
pub fn connect(
    point: Vec3,
    to_eye: Vec3,
    phase: &Phase,
    medium: &(impl Medium + ?Sized),
    source: &Source,
    marching: Marching,
) -> Contribution {
    Arrival::from_source(point, medium, source, marching, 0.0)
        .map_or(Contribution::ZERO, |arrival| arrival.scatter(to_eye, phase))
}

/// Legendre moments of `phase` up to `degree`, for the expansions of this layer; the rest is 0.
/// Slices of the first `degree + 1` are what those take.
///
/// ```
/// # use fogbow::{phase::{Lobe, Phase}, single_scatter::moments};
/// let f = moments(&Phase::from(Lobe::HenyeyGreenstein { g: 0.5 }), 2);
/// assert_eq!([f[0][0], f[1][0], f[2][0], f[3][0]], [1.0, 0.5, 0.25, 0.0]);
/// ```
#[must_use]
pub fn moments(phase: &Phase, degree: usize) -> [Spectrum; MAX_DEGREE + 1] {
    let mut moments = [Spectrum::ZERO; MAX_DEGREE + 1];
    for (l, slot) in moments.iter_mut().enumerate().take(degree + 1) {
        *slot = phase.moment(l);
    }
    moments
}
