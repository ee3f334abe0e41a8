//! `fogbow render --method photon-beams`.

use core::num::NonZero;

use clap::{Arg, Args, ValueEnum};
use fogbow::beams::{self, Settings, kernel};
use fogbow::covariance::Radii;
use fogbow::host::Medium;
use fogbow::math::Vec3;
use fogbow::vpl;
use fogbow::world::{Outline, World as LitWorld};
use fogbow_std::film::Film;
use fogbow_std::progress::Control;
use fogbow_std::progressive;
use fogbow_std::stats::{CountingMedium, CountingScene};
use fogbow_std::threads::{self, Threads};
use fogbow_std::tiles::{Outcome, Passes};

use super::defaults::{unit_outline, with_default};
use super::render::{Shot, weigh, write_layers};
use super::{Failure, output};
use crate::world::WithMedium;

/// Options of `--method photon-beams`.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Photon beams", mut_args(told))]
pub struct BeamArguments {
    /// How wide beams are blurred.
    #[arg(long, value_enum, default_value_t = Kernel::Progressive)]
    pub kernel: Kernel,
    /// Paths sent from the lights in each pass.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub beams: Option<u32>,
    /// Samples per pixel in each pass, of virtual lights, too; beams are gathered by the first of them, virtual lights are
    /// dealt out among them.
    #[arg(long, value_name = "N")]
    pub pass_samples: Option<NonZero<u32>>,
    /// Radius of the blur in the first pass, in the scene's unit of length.
    #[arg(long, value_name = "R", value_parser = output::positive)]
    pub radius: Option<f64>,
    /// Bias that `--kernel covariance` allows in the first pass, as a part of the light itself; it shrinks with further ones.
    #[arg(long, value_name = "BETA", value_parser = output::positive)]
    pub bias: Option<f64>,
    /// Greatest radius of `--kernel covariance` in the first pass.
    #[arg(long, value_name = "R", value_parser = output::positive)]
    pub radius_most: Option<f64>,
    /// How fast the blur narrows, in (0, 1]: after i passes its square has shrunk by about i^(alpha-1).
    #[arg(long, value_name = "ALPHA", value_parser = alpha)]
    pub alpha: Option<f32>,
}

/// How wide beams are blurred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Kernel {
    /// The same everywhere, narrower from pass to pass.
    Progressive,
    /// Wider where light is smooth, by its covariances.
    Covariance,
}

/// An option with the default of [`Settings::for_outline`].
fn told(option: Arg) -> Arg {
    /// Pixels of a picture of middle size, whose pieces are neither the least nor the most.
    const PIXELS: u64 = 1 << 16;
    let usual = Settings::for_outline(&unit_outline());
    match option.get_id().as_str() {
        "beams" => {
            let pieces = u64::from(usual.for_pixels(PIXELS).pieces) / PIXELS;
            with_default(option, format!("as many as leave {pieces} pieces of beams for every pixel"))
        }
        "pass_samples" => with_default(option, format!("{}, for virtual lights {}", usual.samples, vpl::SAMPLES)),
        "radius" => with_default(option, format!("{} of the scene's diagonal", usual.radius)),
        "bias" => with_default(option, usual.bias),
        "radius_most" => with_default(option, format!("{} of the scene's diagonal", usual.widest)),
        "alpha" => with_default(option, usual.alpha),
        _ => option,
    }
}

fn alpha(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 && value <= 1.0 => Ok(value),
        _ => Err("must be a number greater than 0, at most 1".to_owned()),
    }
}

impl BeamArguments {
    fn settings(&self, outline: &Outline, pixels: u64, shot: &Shot<'_>) -> Settings {
        let usual = Settings::for_outline(outline).for_pixels(pixels);
        Settings {
            walk: shot.paths,
            paths: self.beams.unwrap_or(usual.paths),
            samples: self.pass_samples.map_or(usual.samples, NonZero::get),
            radius: self.radius.map_or(usual.radius, |r| r as f32),
            alpha: self.alpha.unwrap_or(usual.alpha),
            bias: self.bias.map_or(usual.bias, |bias| bias as f32),
            widest: self.radius_most.map_or(usual.widest, |r| r as f32),
            seed: shot.settings.seed,
            ..usual
        }
    }
}

/// A render by photon beams, to be done with a medium of any type.
pub(super) struct BeamJob<'a> {
    pub(super) shot: Shot<'a>,
    pub(super) control: &'a Control<'a>,
    pub(super) film: &'a mut Film,
    pub(super) arguments: &'a BeamArguments,
}

impl WithMedium for BeamJob<'_> {
    type Output = Result<Outcome, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let shot = self.shot;
        let (width, height) = (self.film.width(), self.film.height());
        let world = LitWorld { medium, scene: shot.world, lights: shot.lights };
        let pixels = u64::from(width) * u64::from(height);
        let mut settings = self.arguments.settings(&shot.world.outline(&world), pixels, &shot);
        if self.arguments.beams.is_none() {
            let mut pilot = beams::BeamPass::pilot(&settings);
            let threads = Threads::new(shot.settings.threads)?;
            threads::run(&mut pilot, &world, &threads, self.control, None, |_| {});
            settings = pilot.settings_for_pieces();
        }
        let grid = shot.grid.filter(|_| self.arguments.kernel == Kernel::Covariance);
        let mut storage = vec![0.0; grid.map_or(0, |grid| grid.lattice().cell_count())];
        let power: f32 = shot.lights.iter().map(|light| light.power(&settings.bounds).mean()).sum();
        let Settings { bias, widest, .. } = settings;
        let radii = match grid {
            Some(grid) => {
                let noise = settings.noise(power);
                Some(Radii::balanced(grid, noise, bias, kernel::SECOND_MOMENT, widest, &mut storage)?)
            }
            None => None,
        };
        let radius = |point: Vec3, pass: f32| radii.map_or(pass, |radii| settings.widened(radii.at(point), pass));
        let length = NonZero::new(settings.samples).unwrap_or(NonZero::<u32>::MIN);
        let outcome = progressive::render(
            self.film,
            shot.settings,
            self.control,
            Passes { length, may_break: false },
            |pass, runner| {
                let mut pass = beams::BeamPass::new(&settings, pass, radius);
                runner.run(&mut pass, &world);
                pass.finish()
            },
            |beams, sample, rng, layers| {
                let world = LitWorld {
                    medium: &CountingMedium { medium, tally: sample.tally },
                    scene: &CountingScene { scene: shot.world, tally: sample.tally },
                    lights: shot.lights,
                };
                let (ray, weight) = shot.eye_ray(sample, (width, height), rng);
                let share = if shot.is_computed(sample, width) { settings.share(sample.index) } else { 0.0 };
                let seen = beams.radiance(&ray, &world, &settings.walk, share, rng);
                sample.tally.collide(seen.collisions);
                write_layers(&seen, layers);
                weigh(layers, weight);
            },
        )?;
        Ok(outcome)
    }
}
