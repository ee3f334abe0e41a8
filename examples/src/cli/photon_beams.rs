//! `fogbow render --method photon-beams`.

use core::num::NonZero;

use clap::{Args, ValueEnum};
use fogbow::beams::kernel;
use fogbow::covariance::Radii;
use fogbow::host::Medium;
use fogbow::math::Vec3;
use fogbow_std::film::Film;
use fogbow_std::photon_beams::{self, Settings, View};
use fogbow_std::tiles::Outcome;

use super::render::{Shot, write_layers};
use super::{Failure, output};
use crate::world::{WithMedium, World};

/// Options of `--method photon-beams`.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Photon beams")]
pub struct BeamArguments {
    /// How wide beams are blurred.
    #[arg(long, value_enum, default_value_t = Kernel::Progressive)]
    pub kernel: Kernel,
    /// Paths sent from the lights in each pass [default: as many as leave four pieces of beams for every pixel].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub beams: Option<u32>,
    /// Samples per pixel in each pass, of virtual lights, too; beams are gathered by the first of them, virtual lights are
    /// dealt out among them [default: 8, for virtual lights 64].
    #[arg(long, value_name = "N")]
    pub pass_samples: Option<NonZero<u32>>,
    /// Radius of the blur in the first pass, in the scene's unit of length [default: 0.005 of the scene's diagonal].
    #[arg(long, value_name = "R", value_parser = output::positive)]
    pub radius: Option<f64>,
    /// Bias that `--kernel covariance` allows, as a part of the light itself.
    #[arg(long, value_name = "BETA", value_parser = output::positive, default_value_t = 0.02)]
    pub bias: f64,
    /// Greatest radius of `--kernel covariance` [default: 0.05 of the scene's diagonal].
    #[arg(long, value_name = "R", value_parser = output::positive)]
    pub radius_most: Option<f64>,
    /// How fast the blur narrows, in (0, 1]: after i passes its square has shrunk by about i^(alpha-1).
    #[arg(long, value_name = "ALPHA", value_parser = alpha, default_value_t = 0.6)]
    pub alpha: f32,
}

/// How wide beams are blurred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Kernel {
    /// The same everywhere, narrower from pass to pass.
    Progressive,
    /// Wider where light is smooth, by its covariances.
    Covariance,
}

fn alpha(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 && value <= 1.0 => Ok(value),
        _ => Err("must be a number greater than 0, at most 1".to_owned()),
    }
}

impl BeamArguments {
    fn settings(&self, world: &World<'_>) -> Settings {
        let usual = Settings::new(&world.bounds());
        Settings {
            paths: self.beams.unwrap_or(usual.paths),
            samples: self.pass_samples.unwrap_or(usual.samples),
            radius: self.radius.map_or(usual.radius, |r| r as f32),
            alpha: self.alpha,
            ..usual
        }
    }
}

/// A render by photon beams, to be done with a medium of any type.
pub(super) struct BeamJob<'a> {
    pub(super) shot: Shot<'a>,
    pub(super) film: &'a mut Film,
    pub(super) arguments: &'a BeamArguments,
}

impl WithMedium for BeamJob<'_> {
    type Output = Result<Outcome, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let shot = self.shot;
        let (width, height) = (self.film.width(), self.film.height());
        let view = View {
            world: fogbow::world::World { medium, scene: shot.world, lights: shot.lights },
            bounds: shot.world.bounds(),
            paths: shot.paths,
        };
        let mut settings = self.arguments.settings(shot.world);
        if self.arguments.beams.is_none() {
            let pieces = (u64::from(width) * u64::from(height) * 4).clamp(1 << 14, 1 << 22) as u32;
            settings.paths = photon_beams::paths_for(&view, &settings, pieces, shot.settings.seed)?;
        }
        let grid = shot.grid.filter(|_| self.arguments.kernel == Kernel::Covariance);
        let mut storage = vec![0.0; grid.map_or(0, |grid| grid.lattice().cell_count())];
        let most = self.arguments.radius_most.map_or(0.05 * shot.world.bounds().size().length(), |r| r as f32);
        let bias = self.arguments.bias as f32;
        let radii = match grid {
            Some(grid) => Some(Radii::new(grid, bias, kernel::SECOND_MOMENT, most, &mut storage)?),
            None => None,
        };
        let radius = |point: Vec3, pass: f32| radii.map_or(pass, |radii| radii.at(point).max(pass));
        let outcome = photon_beams::render(
            self.film,
            shot.settings,
            &settings,
            shot.control,
            &view,
            |sample, rng| shot.eye_ray(sample, (width, height), rng),
            |sample| shot.is_computed(sample, width),
            radius,
            write_layers,
        )?;
        Ok(outcome)
    }
}
