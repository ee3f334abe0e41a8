//! The frequency photon: a walk from the lights that carries the light field along.
//!
//! Belcour et al. 2014, Algorithm 2, with the scattering step that its print leaves out (sheet § 2.10):
//!
//! ```text
//! per cell crossed: travel · occlusion · attenuation · deposit
//! at a collision:   turn · scatter             at a surface: turn · project · curve · lobe · curve · unproject
//! ```

use glam::Vec3;

use super::emission::emitted;
use super::lattice::{CellCrossing, Lattice};
use super::light_field::{LightField, Patch};
use super::metrics::{Voxel, divergence};
use super::occluders::Occluders;
use crate::host::{Hit, Medium, Scene};
use crate::math::{Frame, Ray, Symmetric3, float};
use crate::photon::Event;
use crate::surface::{Principled, RoughDielectric, Surface};
use crate::world::World;

/// What frequency photons fly through and where they leave what they carry.
///
/// ```
/// # use fogbow::{covariance::{FrequencyPhotons, GridView, Lattice, Voxel}, math::{Bounds, Vec3, float::PI}};
/// # use fogbow::{host::Empty, light::{Light, PointLight}, path::Settings, photon, sampling::Generator, spectrum::Spectrum};
/// # use fogbow::world::World;
/// // A lamp of 4π W in the middle of a vacuum: at 2 m its fluence is 1/4 W·m⁻².
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::splat(4.0 * PI))?)];
/// let world = World { medium: &Empty, scene: &Empty, lights: (&lamps).into() };
/// let lattice = Lattice::new(Bounds { min: Vec3::splat(-2.5), max: Vec3::splat(2.5) }, [5, 5, 5])?;
/// let (mut voxels, mut rng) = ([Voxel::EMPTY; 125], Generator::new(1));
/// let mut photons = FrequencyPhotons::new(world, None, lattice);
/// for _ in 0..4000 {
///     photon::trace(&world, &lattice.bounds(), &Settings::default(), &mut rng, &mut |event| {
///         photons.visit(event, &mut voxels);
///     });
/// }
/// assert!(photons.light_field().is_some());   // of the last one
/// let grid = GridView::new(lattice, &voxels, 4000)?;
/// assert!((grid.fluence(2.0 * Vec3::X).unwrap() - 0.25).abs() < 0.03);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct FrequencyPhotons<'a, M: ?Sized, S: ?Sized> {
    world: World<'a, M, S>,
    occluders: Option<&'a Occluders<'a>>,
    lattice: Lattice,
    point_radius: f32,
    light: Option<LightField>,
    /// Radius (m) of the light it comes from straight; `None` after the first event.
    straight: Option<f32>,
}

impl<'a, M: Medium + ?Sized, S: Scene + ?Sized> FrequencyPhotons<'a, M, S> {
    /// For photons of `world`, deposited in the cells of `lattice`.
    ///
    /// Lights without extent count as discs of a thousandth of the lattice's diagonal.
    #[must_use]
    pub fn new(world: World<'a, M, S>, occluders: Option<&'a Occluders<'a>>, lattice: Lattice) -> Self {
        let point_radius = 1e-3 * lattice.bounds().size().length();
        Self { world, occluders, lattice, point_radius, light: None, straight: None }
    }

    /// The light field that the photon carries now; `None` before it is emitted and after it has gone.
    #[must_use]
    pub fn light_field(&self) -> Option<&LightField> {
        self.light.as_ref()
    }

    /// Takes in what happens to the photon, as [`photon::trace`](crate::photon::trace()) tells it, and adds to
    /// `voxels`, one per cell of the lattice.
    ///
    /// The weight of a crossing is flux times length. Cells beyond the end of `voxels` take nothing.
    #[inline]
    pub fn visit(&mut self, event: &Event<'_>, voxels: &mut [Voxel]) {
        self.visit_each(event, &mut |cell, covariance, energy| {
            if let Some(voxel) = voxels.get_mut(cell) {
                voxel.add_covariance(covariance, energy);
            }
        });
    }

    /// As [`FrequencyPhotons::visit`], but calls `deposit(cell, covariance, energy)` for what is to be added
    /// ([`Voxel::add_covariance`]) to the cells crossed, in order.
    #[inline]
    pub(super) fn visit_each(&mut self, event: &Event<'_>, deposit: &mut impl FnMut(usize, &Symmetric3, f32)) {
        match *event {
            Event::Emitted { light, ray, normal, .. } => {
                self.light = self.world.lights.get(light).map(|light| emitted(light, ray, normal, self.point_radius));
                // By what it varies in space a light is as large as this; lights at infinity do not vary.
                let variation = self.light.map_or(0.0, |light| 0.5 * light.covariance.spatial.trace());
                self.straight = (variation > 0.0).then(|| 1.0 / (float::PI * float::sqrt(variation)));
            }
            Event::Flew { reach, distance, power } => self.fly(reach, distance, power.mean(), deposit),
            Event::Collided { properties, outgoing, .. } => {
                self.straight = None;
                self.light = match (self.light, outgoing) {
                    (Some(light), Some(outgoing)) => Some(light.scattered(outgoing, &properties.phase)),
                    _ => None,
                };
            }
            Event::Met { point, incoming, hit, outgoing, .. } => {
                self.straight = None;
                self.light = match (self.light, outgoing) {
                    (Some(light), Some(outgoing)) => Some(self.met(&light, point, incoming, hit, outgoing)),
                    _ => None,
                };
            }
        }
    }

    fn fly(&mut self, reach: &Ray, distance: f32, power: f32, deposit: &mut impl FnMut(usize, &Symmetric3, f32)) {
        let Some(mut light) = self.light else { return };
        let ray = reach.with_length(distance);
        let (medium, occluders) = (self.world.medium, self.occluders);
        // Where a flight leaves a surface or ends at one, that surface is what is lit, and no occluder.
        let spared = self.lattice.cell().max_element();
        let (occluded_from, occluded_to) = (spared, reach.length - spared);
        // Bounds hold along segments; only where they are not equal is there a Hessian to ask for.
        let (mut even_until, mut even) = (0.0, true);
        let mut at = 0.0;
        for CellCrossing { cell, enter, leave } in self.lattice.cells(&ray) {
            let middle = 0.5 * (enter + leave);
            let length = leave - enter;
            light = light.travelled(middle - at);
            at = middle;
            let point = ray.at(middle);
            if let Some(occluders) = occluders
                && middle > occluded_from
                && middle < occluded_to
                && let Some(occlusion) = occluders.covariance(point, ray.direction)
            {
                light = light.occluded(&occlusion);
            }
            if !(middle < even_until) {
                let segment = medium.majorant_segment(&ray, middle);
                even_until = segment.until;
                even = segment.is_constant();
            }
            if !even {
                light = light.attenuated(&medium.extinction_hessian(point).mean(), length);
            }
            let mut covariance = light.volumetric();
            if let Some(size) = self.straight {
                covariance = covariance.plus(&divergence(ray.direction, middle, size));
            }
            deposit(cell, &covariance, power * length);
        }
        self.light = Some(light.travelled((distance - at).max(0.0)));
    }

    fn met(&self, light: &LightField, point: Vec3, incoming: Vec3, hit: &Hit, outgoing: Vec3) -> LightField {
        let ray = Ray { origin: point - incoming * hit.distance, direction: incoming, length: f32::INFINITY };
        let curvature = self.world.scene.curvature(&ray, hit);
        let patch = Patch { normal: hit.shading, curvature, texture: Symmetric3::ZERO };
        let passes = incoming.dot(hit.shading) * outgoing.dot(hit.shading) > 0.0;
        match hit.surface {
            Surface::Null => *light,
            Surface::ThinDielectric { .. } if passes => *light,
            Surface::Dielectric { eta, .. }
            | Surface::RoughDielectric(RoughDielectric { eta, .. })
            | Surface::Principled(Principled { eta, .. })
                if passes =>
            {
                let indices = if incoming.dot(hit.shading) < 0.0 { (1.0, eta) } else { (eta, 1.0) };
                light.refracted(outgoing, &patch, indices)
            }
            // What passes a sheet is spread as if it had been reflected, and then turned to the other side.
            ref surface if passes => {
                let turned = |v: Vec3| v - hit.shading * (2.0 * hit.shading.dot(v));
                let near = light.reflected(turned(outgoing), &patch, surface);
                let (u, v) = (turned(near.frame.u), -turned(near.frame.v));
                LightField { covariance: near.covariance.flipped(), frame: Frame { u, v, w: outgoing } }
            }
            ref surface => light.reflected(outgoing, &patch, surface),
        }
    }
}
