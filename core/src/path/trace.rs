//! The walk of the path tracer.

use glam::Vec3;

use super::{InScattered, Radiance, Settings, connect};
use crate::host::{Hit, Medium, Rng, Scene};
use crate::math::Ray;
use crate::phase::deflection;
use crate::sampling::{Generator, mis, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::surface::Surface;
use crate::transmittance::{Flight, flight, transmittance};
use crate::world::{World, beyond, leave};

/// A path longer than this ends, whatever the settings say: a guard against worlds without
/// absorption, where roulette may never come up.
const MAX_SEGMENTS: u32 = 100_000;

/// The last scattering event, as far as weights of what the path hits next depend on it.
#[derive(Clone, Copy)]
struct Vertex {
    point: Vec3,
    in_medium: bool,
    /// Density (sr⁻¹) of the direction taken; 0 if it was discrete.
    pdf: f32,
}

/// Where light goes in [`Radiance`]: what the eye saw first.
#[derive(Clone, Copy, PartialEq)]
enum First {
    Nothing,
    Surface,
    Medium,
}

struct Path {
    radiance: Radiance,
    throughput: Spectrum,
    first: First,
    scatterings: u32,
    last: Option<Vertex>,
}

impl Path {
    /// Adds light that was scattered `scatterings` times, first at `first`.
    #[inline]
    fn add(&mut self, light: Spectrum, first: First, scatterings: u32) {
        let layer = match (first, scatterings) {
            (First::Nothing, _) => &mut self.radiance.emitted,
            (First::Surface, 1) => &mut self.radiance.surface_direct,
            (First::Surface, _) => &mut self.radiance.surface_indirect,
            (First::Medium, 1) => &mut self.radiance.medium_single,
            (First::Medium, _) => &mut self.radiance.medium_multiple,
        };
        *layer += light;
    }

    #[inline]
    fn arrive(&mut self, first: First) {
        self.scatterings += 1;
        if self.first == First::Nothing {
            self.first = first;
        }
    }
}

/// Radiance that arrives at the origin of `ray` from its direction: an unbiased estimate from one
/// path.
///
/// The number of draws from `rng` per vertex does not depend on what the path meets, so a
/// low-discrepancy sequence keeps its alignment. Infinite variance remains where a point light
/// lies inside the medium; the mean is right (sheet § 1.7).
///
/// ```
/// # use fogbow::{host::Empty, light::Light, math::*, medium::Homogeneous, phase::Lobe};
/// # use fogbow::{path::{self, Settings}, sampling::Generator, spectrum::Spectrum, world::World};
/// // Fog that glows and absorbs: from within, everything looks like ε/σₐ.
/// let fog = Homogeneous::new(Spectrum::splat(2.0), Spectrum::ZERO, Lobe::Isotropic)?
///     .with_emission(Spectrum::splat(6.0))?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let ray = Ray::new(Vec3::ZERO, Vec3::Z);
/// let seen = path::radiance(&ray, &world, &Settings::default(), &mut Generator::new(1));
/// assert_eq!(seen.total(), Spectrum::splat(3.0));
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn radiance<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    world: &World<'_, M, S>,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
) -> Radiance {
    walk::<false, M, S>(ray, world, settings, rng, |_: &Ray, _, _: &mut Generator| InScattered::default())
}

/// What a path leaves to another method: see [`radiance_beyond`]. A function `(segment, most, rng)` is one that
/// computes the medium's light alone.
///
/// ```
/// # use fogbow::{host::{Empty, Hit}, math::{Ray, Vec3}, medium::Homogeneous, phase::Phase, sampling::Generator};
/// # use fogbow::{path::{Delegate, InScattered, Settings, radiance_beyond}, spectrum::Spectrum};
/// # use fogbow::world::World;
/// struct Known;   // fog that looks as if it scattered 1 W·m⁻²·sr⁻¹ along every ray
/// impl Delegate for Known {
///     fn in_scattered(&mut self, _: &Ray, _: Spectrum, _: u32, _: &mut Generator) -> InScattered {
///         InScattered { single: Spectrum::ONE, multiple: Spectrum::ZERO }
///     }
///     fn reflected(&mut self, _: &Ray, _: &Hit, _: Spectrum, _: u32, _: &mut Generator) -> Option<Spectrum> {
///         Some(Spectrum::ZERO)   // surfaces reflect nothing but what comes straight from the lights
///     }
/// }
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let (ray, mut rng) = (Ray::new(Vec3::ZERO, Vec3::X), Generator::new(1));
/// let seen = radiance_beyond(&ray, &world, &Settings::default(), &mut rng, Known);
/// assert_eq!((seen.medium_single, seen.total()), (Spectrum::ONE, Spectrum::ONE));
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub trait Delegate {
    /// Light that the medium scatters towards the origin of `segment`, attenuated on its way there, of light
    /// scattered `most` times at most, here included. It will be multiplied by `throughput`.
    fn in_scattered(&mut self, segment: &Ray, throughput: Spectrum, most: u32, rng: &mut Generator) -> InScattered;

    /// Light that the surface at the end of `segment` reflects towards its origin, but for what comes to it straight
    /// from the lights; it was scattered `most` times at most before it comes. It will be multiplied by `throughput`.
    /// `None`, the default, lets the path find it.
    fn reflected(
        &mut self,
        segment: &Ray,
        hit: &Hit,
        throughput: Spectrum,
        most: u32,
        rng: &mut Generator,
    ) -> Option<Spectrum> {
        let _ = (segment, hit, throughput, most, rng);
        None
    }
}

impl<F: FnMut(&Ray, u32, &mut Generator) -> InScattered> Delegate for F {
    #[inline]
    fn in_scattered(&mut self, segment: &Ray, _: Spectrum, most: u32, rng: &mut Generator) -> InScattered {
        self(segment, most, rng)
    }
}

/// The same with the medium's part left to another method: where the eye sees into the medium, straight or by
/// way of mirrors and glass, the path does not collide with it, and what is scattered there comes from
/// `delegate`.
///
/// From the first surface on that is neither mirror nor glass, paths go on as those of [`radiance`], unless
/// `delegate` takes that surface's indirect light upon itself, too;
/// their light counts as that of the surface, also where a medium scattered it on its way there.
/// The medium's own glow is taken along the way.
///
/// ```
/// # use fogbow::{host::Empty, math::*, medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
/// # use fogbow::{path::{self, InScattered, Settings}, sampling::Generator, world::World};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Lobe::Isotropic)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let ray = Ray::new(Vec3::ZERO, Vec3::Z);
/// let haze = |_: &Ray, _: u32, _: &mut Generator| InScattered { single: Spectrum::ONE, ..InScattered::default() };
/// let seen = path::radiance_beyond(&ray, &world, &Settings::default(), &mut Generator::new(1), haze);
/// assert_eq!((seen.medium_single, seen.total()), (Spectrum::ONE, Spectrum::ONE));
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn radiance_beyond<M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    world: &World<'_, M, S>,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
    delegate: impl Delegate,
) -> Radiance {
    walk::<true, M, S>(ray, world, settings, rng, delegate)
}

/// `BEYOND` tells [`radiance_beyond`] from [`radiance`].
fn walk<const BEYOND: bool, M: Medium + ?Sized, S: Scene + ?Sized>(
    ray: &Ray,
    world: &World<'_, M, S>,
    settings: &Settings,
    rng: &mut (impl Rng + ?Sized),
    mut delegate: impl Delegate,
) -> Radiance {
    let mut is_seen = BEYOND;
    let mut max_scatterings = settings.max_scatterings;
    let mut path = Path {
        radiance: Radiance::default(),
        throughput: Spectrum::ONE,
        first: First::Nothing,
        scatterings: 0,
        last: None,
    };
    let has_near_fields = world.lights.iter().any(|light| light.near_field().is_some());
    let mut ray = *ray;
    for segment_index in 0..MAX_SEGMENTS {
        let hit = world.scene.closest_hit(&ray);
        let segment = hit.map_or(ray, |hit| ray.with_length(hit.distance));
        let u_distance = uniform(rng);
        let mut child = Generator::new(u64::from(rng.next_u32()) | u64::from(segment_index) << 32);
        let mut flown = if is_seen && !world.medium.is_emissive() {
            Flight::through(&segment)
        } else {
            flight(world.medium, &segment, path.throughput, u_distance, &mut child)
        };
        path.add(path.throughput * flown.emission, path.first, path.scatterings);
        if is_seen {
            let weight = transmittance(world.medium, &segment, &mut child);
            flown = Flight { weight, ..Flight::through(&segment) };
            let left = max_scatterings.saturating_sub(path.scatterings);
            if left > 0 {
                let light = delegate.in_scattered(&segment, path.throughput, left, &mut child);
                let first = if path.first == First::Nothing { First::Medium } else { path.first };
                path.add(path.throughput * light.single, first, path.scatterings + 1);
                path.add(path.throughput * light.multiple, first, path.scatterings + 2);
            }
        }
        if has_near_fields {
            let random = (uniform(rng), uniform(rng), uniform2(rng));
            if !is_seen && path.scatterings < max_scatterings && flown.span.1 > flown.span.0 {
                let first = if path.first == First::Nothing { First::Medium } else { path.first };
                if let Some(light) = connect::along(world, &segment, &flown, random, &mut child) {
                    path.add(path.throughput * light, first, path.scatterings + 1);
                }
            }
        }
        path.throughput *= flown.weight;

        // Every vertex uses as many numbers, whatever it is.
        let light_choice = uniform(rng);
        let light_u = uniform2(rng);
        let lobe_choice = uniform(rng);
        let lobe_u = uniform2(rng);
        let survival = uniform(rng);

        let next = if let Some(properties) = flown.collision {
            path.arrive(First::Medium);
            path.radiance.collisions += 1;
            path.throughput *= properties.albedo();
            if path.scatterings > max_scatterings || path.throughput.is_black() {
                break;
            }
            let point = segment.at(flown.distance);
            let to_eye = -ray.direction;
            let phase = properties.phase;
            let light = connect::next_event(
                world,
                point,
                true,
                |_| point,
                |to_light| {
                    let deflection = deflection(to_light, to_eye);
                    let value = phase.value(deflection);
                    (value, phase.pdf(deflection))
                },
                (light_choice, light_u),
                &mut child,
            );
            path.add(path.throughput * light, path.first, path.scatterings);
            let sample = phase.sample(to_eye, lobe_u);
            path.throughput *= sample.weight;
            path.last = Some(Vertex { point, in_medium: true, pdf: sample.pdf });
            Ray::new(point, sample.to_light)
        } else if let Some(hit) = hit {
            let point = segment.at(hit.distance);
            let hidden = path.scatterings == 0 && !settings.lights_visible && hit.light.is_some();
            if !hidden {
                emitted(&mut path, world, &ray, &hit, point);
            }
            if hidden || hit.surface == Surface::Null {
                ray = beyond(&ray, &hit);
                continue;
            }
            path.arrive(First::Surface);
            if path.scatterings > max_scatterings {
                break;
            }
            let to_eye = -ray.direction;
            let seen_surface = is_seen && !hit.surface.is_followed();
            let left = max_scatterings - path.scatterings;
            if seen_surface && let Some(light) = delegate.reflected(&segment, &hit, path.throughput, left, &mut child) {
                path.add(path.throughput * light, path.first, path.scatterings + 1);
                // The path itself goes on only to meet lights, which weigh against connections to them.
                max_scatterings = path.scatterings;
            }
            let surface = hit.surface;
            if !surface.is_discrete() {
                let light = connect::next_event(
                    world,
                    point,
                    false,
                    |to_light| leave(point, hit.normal, to_light, hit.distance),
                    |to_light| {
                        let value = hit.value(to_eye, to_light) * hit.cosine(to_light).abs();
                        (value, hit.pdf(to_eye, to_light))
                    },
                    (light_choice, light_u),
                    &mut child,
                );
                path.add(path.throughput * light, path.first, path.scatterings);
            }
            let Some(sample) = hit.sample(to_eye, lobe_choice, lobe_u) else {
                break;
            };
            path.throughput *= sample.weight;
            is_seen &= sample.pdf == 0.0;
            path.last = Some(Vertex { point, in_medium: false, pdf: sample.pdf });
            Ray::new(leave(point, hit.normal, sample.to_light, hit.distance), sample.to_light)
        } else {
            background(&mut path, world, &ray, settings);
            break;
        };

        let strength = path.throughput.max_element();
        if path.scatterings >= settings.roulette_after {
            let survives = (2.0 * strength).min(0.95);
            if survival >= survives {
                break;
            }
            path.throughput *= 1.0 / survives;
        } else if strength <= 0.0 {
            break;
        }
        ray = next;
    }
    path.radiance
}

/// Light from a surface the path ran into.
#[inline]
fn emitted<M: ?Sized, S: ?Sized>(path: &mut Path, world: &World<'_, M, S>, ray: &Ray, hit: &Hit, point: Vec3) {
    let Some((index, light)) = hit.light.and_then(|i| Some((i as usize, world.lights.get(i as usize)?))) else {
        return;
    };
    let radiance = light.radiance(point, hit.normal, -ray.direction);
    if radiance.is_black() {
        return;
    }
    let weight = match path.last {
        Some(vertex) if vertex.pdf > 0.0 => {
            let distance = vertex.point.distance(point);
            let from = (vertex.point, vertex.in_medium);
            let pdf = connect::pdf(&world.lights, index, from, ray.direction, distance, hit.normal);
            mis::power(vertex.pdf, pdf)
        }
        _ => 1.0,
    };
    path.add(path.throughput * radiance * weight, path.first, path.scatterings);
}

/// Light from infinity.
#[inline]
fn background<M: ?Sized, S: ?Sized>(path: &mut Path, world: &World<'_, M, S>, ray: &Ray, settings: &Settings) {
    if path.scatterings == 0 && !settings.lights_visible {
        return;
    }
    for (index, light) in world.lights.distant() {
        let radiance = light.background(ray.direction);
        if radiance.is_black() {
            continue;
        }
        let weight = match path.last {
            Some(vertex) if vertex.pdf > 0.0 => {
                let from = (vertex.point, vertex.in_medium);
                let pdf = connect::pdf(&world.lights, index, from, ray.direction, f32::INFINITY, Vec3::ZERO);
                mis::power(vertex.pdf, pdf)
            }
            _ => 1.0,
        };
        path.add(path.throughput * radiance * weight, path.first, path.scatterings);
    }
}
