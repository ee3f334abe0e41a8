//! `fogbow render --method march`.

use fogbow::bake::{Orders, ProbeLevels, Quantity};
use fogbow::host::Medium;
use fogbow::light::Light;
use fogbow::march;
use fogbow::math::Ray;
use fogbow::path::{self, InScattered};
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::world::World as LitWorld;
use fogbow_std::film::Film;
use fogbow_std::progress::Control;
use fogbow_std::stats::{CountingMedium, CountingScene};
use fogbow_std::tiles::{self, Outcome};

use super::Failure;
use super::bake::{is_made_for, read};
use super::covariance::MarchArguments;
use super::render::{LAYERS, Shot, weigh, write_layers};
use super::scene::SceneArguments;
use crate::error::read_file;
use crate::world::{WithMedium, World};

/// A render by ray marching, to be done with a medium of any type.
pub(super) struct MarchJob<'a> {
    pub(super) shot: Shot<'a>,
    pub(super) control: &'a Control<'a>,
    pub(super) film: &'a mut Film,
    pub(super) arguments: &'a MarchArguments,
    /// Baked light of the medium.
    pub(super) baked: Option<ProbeLevels<'static>>,
}

/// The light of a bake, if there is to be any.
///
/// # Errors
/// A file that is no bake, or of another scene, or one that lacks light or a part of the medium.
pub(super) fn baked(
    arguments: &MarchArguments,
    scene: &SceneArguments,
    paths: &path::Settings,
    world: &World<'_>,
) -> Result<Option<ProbeLevels<'static>>, Failure> {
    let Some(file) = &arguments.bake else { return Ok(None) };
    let fail = |reason: &str| format!("{}: {reason}", file.display());
    let all = read_file(file)?;
    let (mut levels, tag) = read(&all).map_err(|error| fail(&error.to_string()))?;
    let grid = &levels.levels()[0];
    if !is_made_for(tag, scene, paths)? {
        return Err(fail("was made for another scene").into());
    }
    if grid.quantity() != Quantity::InScattered {
        return Err(fail("holds irradiance of surfaces; for fog, bake in-scattered radiance").into());
    }
    if grid.orders() == Orders::Multiple {
        return Err(fail("lacks light that surfaces send into the medium; bake all orders, or indirect").into());
    }
    let (held, around) = (grid.lattice().bounds(), world.medium_bounds());
    let slack = 1e-3 * held.size().max_element();
    let is_held = around
        .is_none_or(|around| (held.min - slack).cmple(around.min).all() && (held.max + slack).cmpge(around.max).all());
    if !is_held {
        return Err(fail("its box does not hold all of the medium").into());
    }
    levels.dilate();
    Ok(Some(levels))
}

impl WithMedium for MarchJob<'_> {
    type Output = Result<Outcome, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        if medium.is_emissive() {
            return Err("ray marching does not know light of glowing media: take another method".into());
        }
        let shot = self.shot;
        let (width, height) = (self.film.width(), self.film.height());
        let stride = self.arguments.stride(shot.world.bounds().size().length(), shot.grid);
        // An even sky is in indirect light.
        let lamps: Vec<Light<'_>> = shot.lights.iter().filter(|light| !light.is_sky()).copied().collect();
        let is_whole = self.baked.as_ref().is_some_and(|levels| levels.finest().orders() == Orders::All);
        let outcome = tiles::render(self.film, shot.settings, self.control, |sample, rng, layers| {
            let world = LitWorld {
                medium: &CountingMedium { medium, tally: sample.tally },
                scene: &CountingScene { scene: shot.world, tally: sample.tally },
                lights: shot.lights,
            };
            let (ray, weight) = shot.eye_ray(sample, (width, height), rng);
            let mut count = 0_u32;
            let seen =
                path::radiance_beyond(&ray, &world, &shot.paths, rng, |segment: &Ray, most, rng: &mut Generator| {
                    if !shot.is_computed(sample, width) {
                        return InScattered::default();
                    }
                    let settings = path::Settings { max_scatterings: most, ..shot.paths };
                    let mut light = InScattered::default();
                    let offset = uniform(rng);
                    march::steps(segment, world.medium, stride.steps(segment), offset, |at, properties, weight| {
                        count += 1;
                        let (point, to_eye) = (segment.at(at), -segment.direction);
                        let phase = &properties.phase;
                        let here = match &self.baked {
                            None => path::in_scattered(&world, point, to_eye, phase, &settings, rng),
                            Some(levels) if is_whole => {
                                InScattered { multiple: levels.value(point, to_eye), ..InScattered::default() }
                            }
                            Some(levels) => {
                                let (once, lit) = (
                                    path::Settings { max_scatterings: 1, ..settings },
                                    LitWorld { lights: (&lamps).into(), ..world },
                                );
                                let single = path::in_scattered(&lit, point, to_eye, phase, &once, rng).single;
                                InScattered { single, multiple: levels.value(point, to_eye) }
                            }
                        };
                        let factor: Spectrum = weight * properties.scattering;
                        light.single += factor * here.single;
                        light.multiple += factor * here.multiple;
                    });
                    light
                });
            sample.tally.collide(seen.collisions + count);
            write_layers(&seen, layers);
            if let Some(steps) = layers.get_mut(LAYERS.len()) {
                *steps = Spectrum::splat(count as f32);
            }
            weigh(layers, weight);
        })?;
        Ok(outcome)
    }
}
