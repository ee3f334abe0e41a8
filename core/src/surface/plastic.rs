//! A diffuse base under a dielectric coat, smooth or rough: light that enters is scattered at the base, comes out or is
//! reflected back to the base, again and again (Weidlich and Wilkie 2007; as Mitsuba 3's `plastic` and `roughplastic`).
//!
//! ```text
//! f = f_coat + ρ T(ω_i) T(ω_o) / (π η² (1 − ρ R̄))        R̄: what of diffuse light the coat reflects back from inside
//! ```

use glam::{Vec2, Vec3};

use super::SurfaceSample;
use super::conductor::{reflection, reflection_pdf};
use super::microfacet::{Distribution, GRAZING, Roughness};
use super::specular::{mirrored, refract};
use crate::math::float::{self, PI};
use crate::math::quadrature::gauss;
use crate::sampling::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::spectrum::Spectrum;

/// A diffuse base under a smooth coat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plastic {
    /// Index of refraction of the coat over that outside (> 0).
    pub eta: f32,
    /// Albedo of the base, in [0, 1].
    pub diffuse: Spectrum,
    /// Factor on light reflected by the coat.
    pub specular: Spectrum,
    /// Whether colours of the base grow more saturated by each reflection inside. If not, all channels are reflected there
    /// as if the base were white.
    pub nonlinear: bool,
}

/// Share of unpolarised diffuse light that a smooth interface reflects; `eta` is the index behind it over the one before.
/// Fits by Egan and Hilgeman 1973 from inside (`eta` < 1; within 0.6 % for indices up to 2), d'Eon and Irving 2011 from
/// outside (0.2 %).
///
/// ```
/// # use fogbow::{math::{Vec3, quadrature::integrate}, surface::{diffuse_reflectance, specular::refract}};
/// for eta in [1.5, 1.0 / 1.5] {
///     let reflected = |cos: f32| refract(Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos), Vec3::Z, eta).reflectance;
///     let panels = (0..16).map(|i| integrate(i as f32 / 16.0, (i + 1) as f32 / 16.0, |cos| 2.0 * cos * reflected(cos)));
///     assert!((panels.sum::<f32>() - diffuse_reflectance(eta)).abs() < 2e-3);
/// }
/// ```
#[must_use]
pub fn diffuse_reflectance(eta: f32) -> f32 {
    if eta < 1.0 {
        return 0.0636 / eta + (eta * (0.7099 - 1.4399 * eta) + 0.6681);
    }
    let inverse = 1.0 / eta;
    let coefficients = [-1.368_81, 4.985_54, -7.809_89, 6.753_35, -3.479_3, 0.919_317];
    coefficients.into_iter().fold(0.0, |sum, c| sum * inverse + c)
}

/// Share of light that a smooth interface reflects.
#[inline]
fn fresnel(cosine: f32, eta: f32) -> f32 {
    refract(Vec3::new(float::safe_sqrt(1.0 - cosine * cosine), 0.0, cosine), Vec3::Z, eta).reflectance
}

/// `ρ/(π η² (1 − ρ R̄))`.
#[inline]
fn base(plastic: &Plastic, internal: f32) -> Spectrum {
    let scale = 1.0 / (PI * plastic.eta * plastic.eta);
    let back = if plastic.nonlinear { plastic.diffuse } else { Spectrum::ONE };
    plastic.diffuse.zip(back, |diffuse, back| diffuse * scale / (1.0 - back * internal).max(1e-4))
}

/// Probability to sample the coat, which reflects the share `reflected`, rather than the base.
#[inline]
fn coat_share(plastic: &Plastic, reflected: f32) -> f32 {
    let coat = reflected * plastic.specular.mean();
    let base = (1.0 - reflected) * plastic.diffuse.mean();
    if coat <= 0.0 { 0.0 } else { coat / (coat + base) }
}

impl Plastic {
    #[inline]
    pub(super) fn value(&self, eye: Vec3, light: Vec3) -> Spectrum {
        let passed = (1.0 - fresnel(eye.z, self.eta)) * (1.0 - fresnel(light.z, self.eta));
        base(self, diffuse_reflectance(1.0 / self.eta)) * passed
    }

    #[inline]
    pub(super) fn pdf(&self, eye: Vec3, light: Vec3) -> f32 {
        (1.0 - coat_share(self, fresnel(eye.z, self.eta))) * cosine_hemisphere_pdf(light.z)
    }

    #[inline]
    pub(super) fn sample(&self, eye: Vec3, choice: f32, u: Vec2) -> Option<SurfaceSample> {
        let reflected = fresnel(eye.z, self.eta);
        let share = coat_share(self, reflected);
        if choice < share {
            let weight = self.specular * (reflected / share);
            return Some(SurfaceSample { to_light: mirrored(eye, Vec3::Z), weight, pdf: 0.0 });
        }
        let to_light = cosine_hemisphere(u);
        let weight = self.value(eye, to_light) * (PI / (1.0 - share));
        let pdf = (1.0 - share) * cosine_hemisphere_pdf(to_light.z);
        (pdf > 0.0 && !weight.is_black()).then_some(SurfaceSample { to_light, weight, pdf })
    }
}

/// Terms that the transmittance of a rough coat is kept in.
const TERMS: usize = 14;

/// Points of the rules, along each axis, that tell what a rough coat lets pass from outside, and what it reflects from inside. The first
/// is that which the model was defined with: for long tails it is 4·10⁻⁴ off the integral. The second is within 3·10⁻⁵ of one of 128.
const POINTS: (usize, usize) = (32, 64);

/// A diffuse base under a rough coat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoughPlastic {
    plastic: Plastic,
    distribution: Distribution,
    alpha: f32,
    /// Share of diffuse light reflected back from inside.
    internal: f32,
    /// Chebyshev series of the transmittance from outside, in `2μ/(1 + μ)`.
    transmittance: [f32; TERMS],
}

impl RoughPlastic {
    /// Of a base with a coat, whose facets are spread as `distribution` says. Takes a tenth of a second: what a rough coat
    /// lets pass is integrated here once (decision 62). Hosts whose colours vary change them by [`RoughPlastic::with_colours`].
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::Spectrum, surface::{Distribution, Plastic, RoughPlastic, Surface}};
    /// let (diffuse, specular) = (Spectrum::splat(0.5), Spectrum::ONE);
    /// let smooth = Plastic { eta: 1.5, diffuse, specular, nonlinear: false };
    /// let rough = RoughPlastic::new(smooth, Distribution::Beckmann, 0.1);
    /// let sideways = Vec3::new(0.8, 0.0, 0.6);
    /// let values = [Surface::Plastic(smooth), Surface::RoughPlastic(rough)].map(|s| s.value(Vec3::Z, Vec3::Z, sideways)[0]);
    /// assert!((values[0] / values[1] - 1.0).abs() < 0.1);   // far from the coat's highlight they look alike
    /// ```
    #[must_use]
    pub fn new(plastic: Plastic, distribution: Distribution, alpha: f32) -> Self {
        let roughness = Roughness::even(distribution, alpha);
        let (outside, inside) = (gauss::<{ POINTS.0 }>(), gauss::<{ POINTS.1 }>());
        let mut samples = [0.0; TERMS];
        for (k, sample) in samples.iter_mut().enumerate() {
            let (_, cos) = float::sin_cos(PI * (k as f32 + 0.5) / TERMS as f32);
            let t = 0.5 * (cos + 1.0);
            *sample = sent(&roughness, t / (2.0 - t), plastic.eta, true, &outside);
        }
        let transmittance = core::array::from_fn(|n| {
            let term =
                |(k, sample): (usize, &f32)| sample * float::sin_cos(PI * n as f32 * (k as f32 + 0.5) / TERMS as f32).1;
            samples.iter().enumerate().map(term).sum::<f32>() * if n == 0 { 1.0 } else { 2.0 } / TERMS as f32
        });
        // The mean over as many angles as the model was defined with: 1.5 % less than the integral.
        const ANGLES: u32 = 64;
        let at = |i: u32| float::max(i as f32 / (ANGLES - 1) as f32, GRAZING);
        let sum: f32 = (0..ANGLES).map(|i| at(i) * sent(&roughness, at(i), 1.0 / plastic.eta, false, &inside)).sum();
        Self { plastic, distribution, alpha, internal: 2.0 * sum / ANGLES as f32, transmittance }
    }

    /// The same with other colours: [`Plastic::diffuse`] and [`Plastic::specular`].
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::{Distribution, Plastic, RoughPlastic}};
    /// let plastic = Plastic { eta: 1.5, diffuse: Spectrum::ZERO, specular: Spectrum::ONE, nonlinear: true };
    /// let (rough, red) = (RoughPlastic::new(plastic, Distribution::Beckmann, 0.3), Spectrum::new(0.8, 0.1, 0.1));
    /// let made = RoughPlastic::new(Plastic { diffuse: red, ..plastic }, Distribution::Beckmann, 0.3);
    /// assert_eq!(rough.with_colours(red, Spectrum::ONE), made);
    /// ```
    #[must_use]
    pub fn with_colours(self, diffuse: Spectrum, specular: Spectrum) -> Self {
        Self { plastic: Plastic { diffuse, specular, ..self.plastic }, ..self }
    }

    /// What it is made of, but for the roughness of its coat.
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::{Distribution, Plastic, RoughPlastic}};
    /// let plastic = Plastic { eta: 1.5, diffuse: Spectrum::ONE, specular: Spectrum::ONE, nonlinear: true };
    /// assert_eq!(RoughPlastic::new(plastic, Distribution::Ggx, 0.3).plastic(), plastic);
    /// ```
    #[must_use]
    pub fn plastic(&self) -> Plastic {
        self.plastic
    }

    /// How rough its coat is.
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::{Distribution, Plastic, RoughPlastic}};
    /// let plastic = Plastic { eta: 1.5, diffuse: Spectrum::ONE, specular: Spectrum::ONE, nonlinear: true };
    /// assert_eq!(RoughPlastic::new(plastic, Distribution::Ggx, 0.3).roughness().alpha, [0.3, 0.3]);
    /// ```
    #[must_use]
    pub fn roughness(&self) -> Roughness {
        Roughness::even(self.distribution, self.alpha)
    }

    /// Share of light that the coat lets pass into the base.
    #[inline]
    fn passes(&self, cosine: f32) -> f32 {
        // Clenshaw's sum.
        let x = 4.0 * cosine / (1.0 + cosine) - 1.0;
        let (mut b1, mut b2) = (0.0, 0.0);
        for c in self.transmittance[1..].iter().rev() {
            (b1, b2) = (2.0 * x * b1 - b2 + c, b1);
        }
        (x * b1 - b2 + self.transmittance[0]).clamp(0.0, 1.0)
    }

    /// The base alone.
    pub(super) fn diffuse_value(&self, eye: Vec3, light: Vec3) -> Spectrum {
        base(&self.plastic, self.internal) * (self.passes(eye.z) * self.passes(light.z))
    }

    #[inline]
    pub(super) fn value(&self, eye: Vec3, light: Vec3) -> Spectrum {
        let Some((m, coat)) = reflection(&self.roughness(), eye, light) else { return Spectrum::ZERO };
        let reflected = fresnel(eye.dot(m).min(1.0), self.plastic.eta);
        self.plastic.specular * (coat * reflected) + self.diffuse_value(eye, light)
    }

    #[inline]
    pub(super) fn pdf(&self, eye: Vec3, light: Vec3) -> f32 {
        let share = coat_share(&self.plastic, 1.0 - self.passes(eye.z));
        share * reflection_pdf(&self.roughness(), eye, light) + (1.0 - share) * cosine_hemisphere_pdf(light.z)
    }

    #[inline]
    pub(super) fn sample(&self, eye: Vec3, choice: f32, u: Vec2) -> Option<SurfaceSample> {
        let share = coat_share(&self.plastic, 1.0 - self.passes(eye.z));
        let to_light =
            if choice < share { mirrored(eye, self.roughness().sample(eye, u)) } else { cosine_hemisphere(u) };
        if !(to_light.z > GRAZING && eye.z > GRAZING) {
            return None;
        }
        let (pdf, value) = (self.pdf(eye, to_light), self.value(eye, to_light));
        (pdf > 0.0 && !value.is_black()).then(|| SurfaceSample { to_light, weight: value * (to_light.z / pdf), pdf })
    }
}

/// Share of light that a rough interface sends on, by one reflection or, where `transmits`, one refraction, at an angle of
/// incidence with `cosine`: an integral over the normals that are seen, by an even `rule` along each axis of [`seen`].
fn sent(rough: &Roughness, cosine: f32, eta: f32, transmits: bool, rule: &[(f32, f32)]) -> f32 {
    let cosine = float::max(cosine, GRAZING);
    let eye = Vec3::new(float::safe_sqrt(1.0 - cosine * cosine), 0.0, cosine);
    let mut sum = 0.0;
    // What is seen to the left is seen to the right.
    for &(across, weight_across) in &rule[..rule.len() / 2] {
        for &(along, weight_along) in rule {
            let m = seen(rough, eye, along, across);
            let refraction = refract(eye, m, eta);
            let share = if transmits {
                let through = refraction.transmitted.filter(|through| through.z < 0.0);
                through.map_or(0.0, |through| (1.0 - refraction.reflectance) * rough.masking(through, m))
            } else {
                let to_light = mirrored(eye, m);
                if to_light.z > 0.0 { refraction.reflectance * rough.masking(to_light, m) } else { 0.0 }
            };
            sum += 2.0 * weight_across * weight_along * share;
        }
    }
    sum
}

/// A normal as `eye`, which lies in the plane of `x` and `z`, sees it, by two numbers in [0, 1): along that plane and across. As
/// [`Roughness::sample`], but for long tails by the map of Heitz 2018 from concentric squares of a disk, where a rule of few points has the
/// errors of the model's definition.
fn seen(rough: &Roughness, eye: Vec3, along: f32, across: f32) -> Vec3 {
    if rough.distribution == Distribution::Beckmann {
        return rough.sample(eye, Vec2::new(along, across));
    }
    let alpha = rough.least();
    let stretched = Vec3::new(alpha * eye.x, 0.0, eye.z).normalize();
    let square = 2.0 * Vec2::new(across, along) - Vec2::ONE;
    let (radius, turn) = if square.x.abs() < square.y.abs() {
        (square.y, 0.5 * PI - 0.25 * PI * square.x / square.y)
    } else {
        (square.x, if square.x == 0.0 { 0.0 } else { 0.25 * PI * square.y / square.x })
    };
    let (sin, cos) = float::sin_cos(turn);
    let (x, y) = (radius * cos, radius * sin);
    // The part of the disk that is seen is squeezed along.
    let share = 0.5 * (1.0 + stretched.z);
    let y = (1.0 - share) * float::safe_sqrt(1.0 - x * x) + share * y;
    let z = float::safe_sqrt(1.0 - x * x - y * y);
    let (ahead, up) = (stretched.x * z - stretched.z * y, stretched.x * y + stretched.z * z);
    Vec3::new(alpha * ahead, -alpha * x, up).normalize()
}
