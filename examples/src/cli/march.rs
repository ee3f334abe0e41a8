//! `fogbow render --method march`.

use fogbow::host::Medium;
use fogbow::march;
use fogbow::math::Ray;
use fogbow::path::{self, InScattered};
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::world::World as LitWorld;
use fogbow_std::film::Film;
use fogbow_std::stats::{CountingMedium, CountingScene};
use fogbow_std::tiles::{self, Outcome};

use super::Failure;
use super::covariance::MarchArguments;
use super::render::{LAYERS, Shot, write_layers};
use crate::world::WithMedium;

/// A render by ray marching, to be done with a medium of any type.
pub(super) struct MarchJob<'a> {
    pub(super) shot: Shot<'a>,
    pub(super) film: &'a mut Film,
    pub(super) arguments: &'a MarchArguments,
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
        let outcome = tiles::render(self.film, shot.settings, shot.control, |sample, rng, layers| {
            let world = LitWorld {
                medium: &CountingMedium { medium, tally: sample.tally },
                scene: &CountingScene { scene: shot.world, tally: sample.tally },
                lights: shot.lights,
            };
            let ray = shot.eye_ray(sample, (width, height), rng);
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
                        let here = path::in_scattered(&world, point, to_eye, &properties.phase, &settings, rng);
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
        })?;
        Ok(outcome)
    }
}
