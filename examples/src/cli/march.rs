//! `fogbow render --method march`.

use fogbow::covariance::Grid;
use fogbow::host::Medium;
use fogbow::light::Light;
use fogbow::march;
use fogbow::math::Vec2;
use fogbow::path::{self, InScattered, World as PathWorld};
use fogbow::sampling::{uniform, uniform2};
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Film;
use fogbow_std::progress::Control;
use fogbow_std::stats::{CountingMedium, CountingScene};
use fogbow_std::tiles::{self, Outcome};

use super::Failure;
use super::covariance::MarchArguments;
use super::render::write_layers;
use crate::camera::Camera;
use crate::world::{WithMedium, World};

/// A render by ray marching, to be done with a medium of any type.
pub(super) struct MarchJob<'a> {
    pub(super) world: &'a World<'a>,
    pub(super) lights: &'a [Light<'a>],
    pub(super) camera: Camera,
    pub(super) paths: path::Settings,
    pub(super) film: &'a mut Film,
    pub(super) settings: &'a tiles::Settings,
    pub(super) control: &'a Control<'a>,
    pub(super) arguments: &'a MarchArguments,
    pub(super) grid: Option<&'a Grid<'a>>,
}

impl WithMedium for MarchJob<'_> {
    type Output = Result<Outcome, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        if medium.is_emissive() {
            return Err("ray marching does not know light of glowing media: take another method".into());
        }
        let (width, height) = (self.film.width() as f32, self.film.height() as f32);
        let steps = self.arguments.steps(self.world.bounds().size().length(), self.grid);
        let outcome = tiles::render(self.film, self.settings, self.control, |sample, rng, layers| {
            let world = PathWorld {
                medium: &CountingMedium { medium, tally: sample.tally },
                scene: &CountingScene { scene: self.world, tally: sample.tally },
                lights: self.lights,
            };
            let jitter = uniform2(rng);
            let film = Vec2::new((sample.x as f32 + jitter.x) / width, (sample.y as f32 + jitter.y) / height);
            let ray = self.camera.ray(film);
            let seen = path::radiance_beyond(&ray, &world, &self.paths, rng, |segment, most, rng| {
                let settings = path::Settings { max_scatterings: most, ..self.paths };
                let mut light = InScattered::default();
                let offset = uniform(rng);
                march::steps(
                    segment,
                    world.medium,
                    |at| steps.at(segment, at),
                    offset,
                    |at, properties, weight| {
                        sample.tally.collide(1);
                        let (point, to_eye) = (segment.at(at), -segment.direction);
                        let here = path::in_scattered(&world, point, to_eye, &properties.phase, &settings, rng);
                        let factor: Spectrum = weight * properties.scattering;
                        light.single += factor * here.single;
                        light.multiple += factor * here.multiple;
                    },
                );
                light
            });
            sample.tally.collide(seen.collisions);
            write_layers(&seen, layers);
        })?;
        Ok(outcome)
    }
}
