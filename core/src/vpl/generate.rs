//! Where virtual lights come from, and which of them are kept.

use super::light::VirtualLight;
use crate::host::{Medium, Rng, Scene};
use crate::math::Bounds;
use crate::path::Settings;
use crate::photon::{self, Event};
use crate::surface::Surface;
use crate::world::World;

/// Sends one path from the lights and keeps a virtual light wherever it is scattered, in the medium or on a
/// surface that is neither mirror nor glass.
///
/// Each stands for the flux of this one path: divide by the number of paths ([`VirtualLight::scaled`]). There is none
/// on the lights themselves: their own light is connected to, and single scattering would count twice (sheet § 3.2).
/// Walks, roulette and [`Settings::max_scatterings`]: see [`photon::trace()`]. The same random numbers give the same
/// lights: an animation that keeps them from frame to frame flickers less (Engelhardt et al. 2012, § 7).
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, path::Settings};
/// # use fogbow::{phase::Phase, sampling::Generator, spectrum::Spectrum, vpl, world::World};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let mut lights = Vec::new();
/// let settings = Settings { max_scatterings: 4, ..Settings::default() };
/// vpl::shoot(&world, &bounds, &settings, &mut Generator::new(1), &mut |light| lights.push(light));
/// assert_eq!(lights.len(), 3);                                  // the fourth scattering is towards the eye
/// assert!((lights[2].flux[0] - 1.0).abs() < 1e-5 && lights[2].scatterings == 3);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn shoot<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    bounds: &Bounds,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
    keep: &mut impl FnMut(VirtualLight),
) {
    let mut scatterings = 0_u32;
    photon::trace(world, bounds, settings, rng, &mut |event: &Event<'_>| {
        let light = match *event {
            Event::Collided { point, incoming, properties, power, .. } => {
                scatterings += 1;
                let flux = power * properties.albedo();
                Some(VirtualLight::in_medium(point, incoming, flux, scatterings, &properties.phase))
            }
            Event::Met { point, incoming, hit, power, .. } => {
                scatterings += 1;
                let reflects = hit.faces(-incoming) && !hit.surface.albedo().is_black();
                if reflects {
                    // What leaves does so through the area that there is; a lobe is where the shading normal has it.
                    let normal = if matches!(hit.surface, Surface::Lambert { .. }) { hit.normal } else { hit.shading };
                    let power = power * hit.power_factor(-incoming);
                    VirtualLight::on_surface(point, incoming, power, scatterings, normal, &hit.surface)
                } else {
                    None
                }
            }
            Event::Emitted { .. } | Event::Flew { .. } => None,
        };
        if let Some(light) =
            light.filter(|light| !light.flux.is_black() && light.scatterings < settings.max_scatterings)
        {
            keep(light);
        }
    });
}

/// Keeps about `wanted` of `lights`, at the front and in their order, and returns how many: those with a larger
/// `importance` (≥ 0, one for each) are likelier, and what is kept shines for what is not.
///
/// ```text
/// p_k = min(1, c I_k),   Σ p_k = wanted,   β_k ← β_k/p_k
/// ```
///
/// Systematic sampling with one uniform number `u`: unbiased, as long as no light that matters has importance 0; the
/// number kept is `wanted` to within one, or all that have importance. `importance` is left with the probabilities.
/// Engelhardt et al. 2012, § 7, after Georgiev and Slusallek 2010; there without weights.
///
/// ```
/// # use fogbow::{math::Vec3, phase::Phase, spectrum::Spectrum, vpl::{self, VirtualLight}};
/// let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
/// let (mut lights, mut importance) = ([light; 4], [1.0, 0.0, 8.0, 1.0]);
/// let kept = vpl::select(&mut lights, &mut importance, 2.0, 0.75);
/// assert_eq!((kept, importance), (2, [0.5, 0.0, 1.0, 0.5]));
/// assert_eq!([lights[0].flux[0], lights[1].flux[0]], [2.0, 1.0]);
/// ```
pub fn select(lights: &mut [VirtualLight], importance: &mut [f32], wanted: f32, u: f32) -> usize {
    let count = lights.len().min(importance.len());
    let importance = &mut importance[..count];
    for value in importance.iter_mut() {
        *value = if value.is_finite() { value.max(0.0) } else { 0.0 };
    }
    // Those that are certain take from what is left for the others, which may make more certain.
    let (mut certain_below, mut factor) = (f32::INFINITY, 0.0_f64);
    for _ in 0..count.clamp(1, 64) {
        let (mut certain, mut rest) = (0_usize, 0.0_f64);
        for &value in importance.iter() {
            if value >= certain_below {
                certain += 1;
            } else {
                rest += f64::from(value);
            }
        }
        let left = f64::from(wanted) - certain as f64;
        factor = if rest > 0.0 { (left / rest).max(0.0) } else { 0.0 };
        let limit = if factor > 0.0 { (1.0 / factor) as f32 } else { f32::INFINITY };
        if !(limit < certain_below) || !importance.iter().any(|&value| value >= limit && value < certain_below) {
            break;
        }
        certain_below = limit;
    }
    let (mut sum, mut kept) = (f64::from(u), 0);
    for (i, value) in importance.iter_mut().enumerate() {
        *value = if *value >= certain_below { 1.0 } else { ((f64::from(*value) * factor) as f32).min(1.0) };
        let before = libm::floor(sum);
        sum += f64::from(*value);
        if libm::floor(sum) > before {
            lights[kept] = lights[i].scaled(1.0 / *value);
            kept += 1;
        }
    }
    kept
}
