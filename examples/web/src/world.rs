//! A world, from words.

use alloc::vec::Vec;
use core::cell::OnceCell;

use fogbow::bytes::Crc;
use fogbow::light::{Light, LightTree, Lights, PointLight, QuadLight, SphereLight, SpotLight, Sun};
use fogbow::math::Bounds;
use fogbow::medium::Overlap;
use fogbow::sampling::{GeneratorSource, Independent};
use fogbow::world::{Outline, World};
use fogbow::{path, spectrum::Spectrum};

use super::matter::{Matter, Media};
use super::surfaces::Surfaces;
use super::view::{Part, Rays, View};
use super::words::{Fault, Words};

/// What descriptions begin with.
const VERSION: u32 = 1;

/// From so many lights on there is a tree over them; for fewer, looking at each is quicker.
const MANY: usize = 16;

/// What is in a world, as the core knows it.
pub(crate) type CoreWorld<'w> = World<'w, Overlap<'w, Matter<'w>>, Surfaces>;

/// A world that owns all that is in it.
#[derive(Debug)]
pub struct WebWorld {
    media: Media,
    surfaces: Surfaces,
    lights: Vec<Light<'static>>,
    tree: Option<LightTree<'static>>,
    bounds: Bounds,
    tag: u64,
    /// Known once somebody has asked: looking takes some milliseconds.
    outline: OnceCell<Outline>,
}

impl WebWorld {
    /// From words: a version, a box (its first number no number: around all there is), media, surfaces, lights.
    ///
    /// # Errors
    /// Whatever the core refuses, with the element that is at fault.
    pub fn new(words: &[u32]) -> Result<Self, Fault> {
        let mut crc = Crc::new();
        crc.add(bytemuck::cast_slice(words));
        let mut words = Words::new(words);
        if words.integer()? != VERSION {
            return Err(Fault::new("the description is of another version"));
        }
        let asked = Bounds { min: words.vector()?, max: words.vector()? };
        let media = Media::read(&mut words)?;
        let surfaces = Surfaces::read(&mut words)?;
        let count = words.integer()? as usize;
        let lights: Vec<_> =
            (0..count).map(|n| light(&mut words).map_err(|fault| fault.of("light", n))).collect::<Result<_, _>>()?;
        if words.left() > 0 {
            return Err(Fault::new("the description goes on behind its end"));
        }
        let surfaces = surfaces.with_lights(&lights);
        let around = media.bounds().union(surfaces.bounds());
        let bounds = if asked.min.x.is_nan() { around } else { asked };
        let size = bounds.size();
        if !(bounds.min.is_finite() && size.is_finite() && size.min_element() >= 0.0) {
            return Err(Fault::new("the world needs a box: bounds, or a medium or surface with an end"));
        }
        let tree = if lights.len() >= MANY {
            Some(LightTree::new(&lights, Vec::new()).map_err(|_| Fault::new("there is no memory for so many lights"))?)
        } else {
            None
        };
        Ok(Self { media, surfaces, lights, tree, bounds, tag: crc.value(), outline: OnceCell::new() })
    }

    /// The box around what matters.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Tells this world from others, in saved bytes.
    #[must_use]
    pub fn tag(&self) -> u64 {
        self.tag
    }

    /// Does something with the world as the core knows it.
    pub(crate) fn with<T>(&self, work: impl FnOnce(&CoreWorld<'_>) -> T) -> T {
        let medium = self.media.overlap();
        let lights = match &self.tree {
            Some(tree) => Lights::with_tree(&self.lights, tree),
            None => Lights::from(&self.lights),
        };
        work(&World { medium: &medium, scene: &self.surfaces, lights })
    }

    /// What methods must know of it beforehand.
    #[must_use]
    pub fn outline(&self) -> Outline {
        *self.outline.get_or_init(|| self.with(|world| Outline::of(world, self.bounds)))
    }

    /// Path-traced radiance (W·m⁻²·sr⁻¹) of the pixels of a part of a picture: means over samples, of which the first has number `first`.
    ///
    /// # Errors
    /// No samples.
    pub fn path_trace(&self, view: &View, part: &Part) -> Result<Vec<Spectrum>, Fault> {
        let settings = path::Settings::default();
        self.with(|world| part.picture(view, |ray, rng| path::radiance(ray, world, &settings, rng).total()))
    }

    /// Path-traced radiance of rays, each a mean over `samples`.
    pub fn radiance(&self, rays: Rays<'_>, samples: u32, seed: u64) -> Vec<Spectrum> {
        let settings = path::Settings::default();
        self.with(|world| rays.radiance(samples, seed, |ray, rng| path::radiance(ray, world, &settings, rng).total()))
    }

    /// Radiance scattered at points towards directions, without the scattering coefficient: means over `samples` paths. The words of each:
    /// a point and a direction (unit).
    ///
    /// # Errors
    /// No whole number of points.
    pub fn in_scattered(&self, words: &[u32], samples: u32, seed: u64) -> Result<Vec<Spectrum>, Fault> {
        let settings = path::Settings::default();
        self.with(|world| {
            let of = |number: usize, mut words: Words<'_>| {
                let (point, to_eye) = (words.vector()?, words.vector()?);
                let phase = fogbow::host::Medium::properties(world.medium, point).phase;
                let mut sum = Spectrum::ZERO;
                for sample in 0..samples.max(1) {
                    let mut rng = Independent.start(seed, number as u64, sample);
                    let light = path::in_scattered(world, point, to_eye, &phase, &settings, &mut rng);
                    sum += light.single + light.multiple;
                }
                Ok(sum / samples.max(1) as f32)
            };
            words.chunks(6).enumerate().map(|(number, words)| of(number, Words::new(words))).collect()
        })
    }
}

const POINT: u32 = 0;
const SPOT: u32 = 1;
const SUN: u32 = 2;
const QUAD: u32 = 3;
const SPHERE: u32 = 4;
const CONSTANT: u32 = 5;

fn light(words: &mut Words<'_>) -> Result<Light<'static>, Fault> {
    let kind = words.integer()?;
    let light = words.colour()?;
    Ok(match kind {
        POINT => Light::Point(PointLight::new(words.vector()?, light)?),
        SPOT => {
            let (position, axis) = (words.vector()?, words.vector()?);
            let [beam, cutoff] = words.floats()?;
            Light::Spot(SpotLight::new(position, axis, beam, cutoff, light)?)
        }
        SUN => Light::Sun(Sun::new(words.vector()?, light)?),
        QUAD => Light::Quad(QuadLight::new(words.vector()?, words.vector()?, words.vector()?, light)?),
        SPHERE => Light::Sphere(SphereLight::new(words.vector()?, words.float()?, light)?),
        CONSTANT if light.is_valid() => Light::Constant(light),
        CONSTANT => return Err(fogbow::light::LightError::Emission.into()),
        _ => return Err(Fault::new("no such kind of light")),
    })
}
