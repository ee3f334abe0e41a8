//! Rays that run close by a light, joined to it.

use glam::{Vec2, Vec3};

use crate::light::{FromRay, Light, LightSample, Lights, Question, ShadowMap, Source};
use crate::math::Ray;
use crate::sampling::distance::Equiangular;
use crate::sampling::uniform::ONE_MINUS_EPSILON;

/// Up to so many lights are looked at each by itself. More: time for every ray; fewer: which light is joined to is left to chance earlier.
const FEW: usize = ShadowMap::MOST_LIGHTS;

/// Looks along a ray, evenly spread as seen from a light, at each of which is asked whether it is lit. More: narrower shafts are met, and every ray takes
/// longer.
const LOOKS: usize = 24;

/// Halvings by which the border between a look in light and one in shadow is found. More: time, and borders finer than texels are.
const HALVINGS: u32 = 4;

/// What seems to lie in shadow is drawn as often as this share of what is lit: looks miss narrow shafts, and maps have texels. Larger: points in
/// shadow; smaller: where a map is wrong, heavier weights.
const LEAST_LIT: f32 = 0.1;

/// A light in whose near field a part of a ray lies: see [`Light::near_field`].
///
/// There `1/r²` rules: light scattered into the ray is joined to the light not from wherever a walk collides, but from a
/// point drawn in proportion to `1/r²` along the ray, which takes that factor out of the estimate. Kulla and Fajardo 2012.
///
/// ```text
/// ∫ f(t) L(t) dt  ≈  f(t) L(t)/p(t),   p(t) ∝ 1/r(t)²
/// ```
///
/// ```
/// # use fogbow::{light::{Light, PointLight}, math::{Ray, Vec2, Vec3}, spectrum::Spectrum, world::NearLight};
/// // Irradiance of a lamp one metre beside an endless ray: ∫ dt/(1 + t²) = π/2, from any one point.
/// let lamp = Light::Point(PointLight::new(Vec3::Y, Spectrum::ONE)?);
/// let ray = Ray::new(Vec3::ZERO, Vec3::X);
/// let near = NearLight::of(&lamp, &ray, 0.0, f32::INFINITY).unwrap();
/// for u in [0.1, 0.5, 0.9] {
///     let joint = near.join(&ray, u, Vec2::ZERO).unwrap();
///     let light = joint.light(|| Vec2::ZERO).unwrap().incident;
///     assert!((light.irradiance[0] / joint.pdf - core::f32::consts::FRAC_PI_2).abs() < 1e-5);
/// }
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[doc(alias("equiangular", "next-event estimation"))]
#[derive(Debug, Clone, Copy)]
pub struct NearLight<'a> {
    /// The light.
    pub light: &'a Light<'a>,
    /// From where to where (m) along the ray its near field reaches, and it shines.
    pub interval: (f32, f32),
}

/// A point of a ray, to be joined to a [`NearLight`].
#[derive(Debug, Clone, Copy)]
pub struct Joint<'a> {
    /// Distance along the ray (m).
    pub distance: f32,
    /// Where (m).
    pub point: Vec3,
    /// Density of the distance (m⁻¹).
    pub pdf: f32,
    light: &'a Light<'a>,
    /// The point of the light that the ray's was drawn around, where that is also the one to be joined to.
    anchor: Option<Source>,
}

impl<'a> NearLight<'a> {
    /// `light`, if it is near the part of `ray` between `near` and `far` (m; may be infinite).
    #[inline]
    #[must_use]
    pub fn of(light: &'a Light<'a>, ray: &Ray, near: f32, far: f32) -> Option<Self> {
        Some(Self { light, interval: light.near_interval(ray, near, far)? })
    }

    /// About what the light sends to its part of `ray`: see [`Light::sent_along`]. By it, one of several lights is chosen.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::{Ray, Vec3}, spectrum::Spectrum, world::NearLight};
    /// let lamp = Light::Point(PointLight::new(Vec3::Y, Spectrum::ONE)?);
    /// let ray = Ray::new(Vec3::ZERO, Vec3::X);
    /// let sent = NearLight::of(&lamp, &ray, 0.0, 1.0).unwrap().sent(&ray);
    /// assert!((sent - core::f32::consts::FRAC_PI_4).abs() < 1e-5);   // ∫₀¹ dt/(1 + t²)
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn sent(&self, ray: &Ray) -> f32 {
        self.light.sent_along(ray, self.interval)
    }

    /// A point of `ray`: `u` in [0, 1) decides where, `on_light` in the unit square around which point of the light.
    /// `None` where the light has no points, or the part of the ray no length.
    #[inline]
    #[must_use]
    pub fn join(&self, ray: &Ray, u: f32, on_light: Vec2) -> Option<Joint<'a>> {
        let (pivot, anchor) = self.light.anchor(on_light)?;
        let (near, far) = self.interval;
        let law = Equiangular::new(ray.origin, ray.direction, pivot, near, far)?;
        let distance = law.sample(u).clamp(near, far);
        Some(Joint { distance, point: ray.at(distance), pdf: law.pdf(distance), light: self.light, anchor })
    }
}

/// The lights in whose near fields a ray runs, where they are few: one distribution over lights and distances, in proportion to what they send and, as far
/// as shadow maps tell, to where it arrives.
///
/// ```text
/// p(l, t) ∝ I_l/r_l(t)² · max(ε, V_l(t))     V: 1 in light, 0 in shadow by the map; ε = 1/10: it may be wrong
/// ```
///
/// With one number for both, connections that are evenly spread are so over all lights and all distances together.
pub(crate) struct NearLights<'a>(heapless::Vec<Lit<'a>, FEW>);

struct Lit<'a> {
    near: NearLight<'a>,
    law: Equiangular,
    anchor: Option<Source>,
    runs: heapless::Vec<Run, LOOKS>,
    total: f32,
}

/// A part of a ray that is all lit, or all in shadow, as far as is known.
#[derive(Clone, Copy)]
struct Run {
    /// Up to where, of the whole angle.
    until: f32,
    weight: f32,
}

/// Runs of one value of `is_lit` over [0, 1], each with its length times 1 or [`LEAST_LIT`].
fn runs(is_lit: &dyn Fn(f32) -> bool) -> heapless::Vec<Run, LOOKS> {
    let (mut runs, mut from) = (heapless::Vec::new(), 0.0);
    let mut end = |until: f32, lit: bool| {
        let weight = (until - from) * if lit { 1.0 } else { LEAST_LIT };
        from = until;
        let _ = runs.push(Run { until, weight });
    };
    let look = |k: usize| (k as f32 + 0.5) / LOOKS as f32;
    let mut before = is_lit(look(0));
    for k in 1..LOOKS {
        let lit = is_lit(look(k));
        if lit == before {
            continue;
        }
        let (mut low, mut high) = (look(k - 1), look(k));
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            *(if is_lit(middle) == before { &mut low } else { &mut high }) = middle;
        }
        // What may be lit counts as lit.
        end(if before { high } else { low }, before);
        before = lit;
    }
    end(1.0, before);
    runs
}

impl<'a> NearLights<'a> {
    /// Whether lights are too many to be looked at each by itself.
    pub(crate) fn are_many(lights: &Lights<'_>) -> bool {
        lights.len() > FEW
    }

    /// Of lights that are not [too many](Self::are_many). `on_light`, in the unit square, decides around which points of those that are near.
    pub(crate) fn of(lights: &Lights<'a>, ray: &Ray, on_light: Vec2) -> Self {
        debug_assert!(!Self::are_many(lights));
        let mut all = heapless::Vec::new();
        let question = FromRay { ray: *ray, near: 0.0, far: ray.length, steep: true, until: None };
        for (index, light) in lights.all().iter().enumerate() {
            let Some(interval) = question.part(light) else { continue };
            let Some((pivot, anchor)) = light.anchor(on_light) else { continue };
            let Some(law) = Equiangular::new(ray.origin, ray.direction, pivot, interval.0, interval.1) else {
                continue;
            };
            let sent = question.light(light);
            let mut runs = match lights.shadow_map(index) {
                Some(map) => runs(&|u| map.is_lit(ray.at(law.sample(u)))),
                None => runs(&|_| true),
            };
            runs.iter_mut().for_each(|run| run.weight *= sent);
            let total = runs.iter().map(|run| run.weight).sum();
            let _ = all.push(Lit { near: NearLight { light, interval }, law, anchor, runs, total });
        }
        Self(all)
    }

    /// A point of the ray and the light it is to be joined to, by one number `u` in [0, 1); its density is that of both. `None` where no light is near.
    pub(crate) fn join(&self, ray: &Ray, u: f32) -> Option<Joint<'a>> {
        let total: f32 = self.0.iter().map(|lit| lit.total).sum();
        let (mut left, mut found) = (u * total, None);
        for lit in self.0.iter().filter(|lit| lit.total > 0.0) {
            found = Some(lit);
            if left < lit.total {
                break;
            }
            left -= lit.total;
        }
        let Lit { near, law, anchor, runs, .. } = found?;
        let (mut from, mut at) = (0.0, Run { until: 0.0, weight: 0.0 });
        for run in runs {
            (from, at) = (at.until, *run);
            if left < run.weight {
                break;
            }
            left -= run.weight;
        }
        let within = from + (at.until - from) * (left / at.weight).min(1.0);
        let distance = law.sample(within.min(ONE_MINUS_EPSILON)).clamp(near.interval.0, near.interval.1);
        let pdf = law.pdf(distance) * (at.weight / (total * (at.until - from)));
        Some(Joint { distance, point: ray.at(distance), pdf, light: near.light, anchor: *anchor })
    }
}

impl Joint<'_> {
    /// The point of the light it is joined to, what that sends, and the density (sr⁻¹) of its direction as
    /// [`Light::anchor_pdf`] has it. `on_light` is asked where the point of the light has yet to be drawn. `None` where
    /// nothing arrives.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight}, math::{Ray, Vec2, Vec3}, spectrum::Spectrum, world::NearLight};
    /// let lamp = Light::Point(PointLight::new(Vec3::Y, Spectrum::ONE)?);
    /// let ray = Ray::new(Vec3::NEG_X, Vec3::X);
    /// let joint = NearLight::of(&lamp, &ray, 0.0, 2.0).unwrap().join(&ray, 0.3, Vec2::ZERO).unwrap();
    /// // A lamp that is a point is joined to where it is, with the light that falls off like 1/r².
    /// let light = joint.light(|| unreachable!()).unwrap().incident;
    /// let r = joint.point.distance(Vec3::Y);
    /// assert!((light.distance - r).abs() < 1e-6 && (light.irradiance[0] - 1.0 / (r * r)).abs() < 1e-6);
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn light(&self, on_light: impl FnOnce() -> Vec2) -> Option<LightSample> {
        let Some(source) = self.anchor else { return self.light.sample(self.point, on_light()) };
        let incident = source.incident(self.point)?;
        let pdf = self.light.anchor_pdf(self.point, incident.to_light, incident.distance, source.normal);
        Some(LightSample { source, incident, pdf })
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::host::{Hit, Scene};
    use crate::light::{PointLight, SpotLight};
    use crate::sampling::{Generator, uniform, uniform2};
    use crate::spectrum::Spectrum;
    use crate::surface::Surface;
    use crate::world::shadow_ray;

    /// A plane at height 1 with a slit 0.2 m wide, and a smaller hole.
    struct Shutter;

    impl Scene for Shutter {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let distance = (1.0 - ray.origin.z) / ray.direction.z;
            let at = ray.at(distance);
            let is_open = (at.x - 0.3).abs() < 0.1 || (at.x + 0.6).abs() < 0.03;
            let hit = Hit { distance, normal: Vec3::Z, shading: Vec3::Z, surface: Surface::BLACK, light: None };
            (distance > 0.0 && distance < ray.length && !is_open).then_some(hit)
        }
    }

    /// What a sample of a ray below the shutter brings, with four connections, and its square: means.
    fn sampled(lights: &Lights<'_>, samples: u32) -> [f64; 2] {
        let ray = Ray::between(Vec3::new(-2.0, 0.1, 0.2), Vec3::new(2.0, -0.1, 0.3));
        let mut sums = [0.0; 2];
        for i in 0..samples {
            let mut rng = Generator::new(u64::from(i));
            let near = NearLights::of(lights, &ray, uniform2(&mut rng));
            let shift = uniform(&mut rng);
            let value = |k: u32| {
                let joint = near.join(&ray, (k as f32 + shift) / 4.0)?;
                let LightSample { source, incident, .. } = joint.light(|| Vec2::ZERO)?;
                let is_hidden = Shutter.is_blocked(&shadow_ray(joint.point, &source));
                (!is_hidden).then(|| f64::from(incident.irradiance.mean() / joint.pdf) / 4.0)
            };
            let value: f64 = (0..4).filter_map(value).sum();
            sums[0] += value / f64::from(samples);
            sums[1] += value * value / f64::from(samples);
        }
        sums
    }

    #[test]
    fn maps_of_shadows_change_noise_and_nothing_else() {
        let lamp = Light::Point(PointLight::new(Vec3::new(0.1, 0.0, 3.0), Spectrum::ONE).unwrap());
        let (at, down) = (Vec3::new(-0.8, 0.5, 2.0), Vec3::new(0.3, -0.2, -1.0));
        let spot = Light::Spot(SpotLight::new(at, down, 0.4, 0.5, Spectrum::splat(2.0)).unwrap());
        let lamps = [lamp, spot];
        let maps: Vec<_> = lamps.iter().map(|light| ShadowMap::new(light, &Shutter, 128, Vec::new())).collect();
        // Maps of lamps elsewhere: nothing that they say is right.
        let away = Light::Point(PointLight::new(Vec3::new(1.5, 0.2, 1.2), Spectrum::ONE).unwrap());
        let wrong: Vec<_> = (0..2).map(|_| ShadowMap::new(&away, &Shutter, 16, Vec::new())).collect();
        let lights = Lights::from(&lamps);
        const SAMPLES: u32 = 200_000;
        let [blind, seeing, misled] =
            [lights, lights.with_shadows(&maps), lights.with_shadows(&wrong)].map(|lights| sampled(&lights, SAMPLES));
        let variance = |[mean, square]: [f64; 2]| square - mean * mean;
        for found in [seeing, misled] {
            let error = ((variance(blind) + variance(found)) / f64::from(SAMPLES)).sqrt();
            assert!(error < 0.02 * blind[0], "too noisy to tell: {error} of {}", blind[0]);
            assert!((found[0] - blind[0]).abs() < 4.0 * error, "{found:?} instead of {blind:?}, ± {error}");
        }
        let gain = variance(blind) / variance(seeing);
        assert!(gain > 5.0, "{gain} times less variance");
    }
}
