//! What covariances are used for in `fogbow render`, and the grid they come from.

use std::path::PathBuf;

use clap::{Arg, Args, ValueEnum};
use fogbow::bytes::{Crc, Damage};
use fogbow::covariance::bytes::{self, GridBytesError};
use fogbow::covariance::{
    AdaptiveSteps, CovarianceGrid, EVEN_STEP, Fill, GridView, LEAST_STEP, LONGEST_STEP, Rule, STEP_COUNT, Settings,
};
use fogbow::host::Medium;
use fogbow::light::Lights;
use fogbow::math::Ray;
use fogbow::path;
use fogbow::storage::List;
use fogbow_std::files::{Problem, load, write};
use fogbow_std::progress::Control;
use fogbow_std::threads::{self, Ending, Threads};

use super::defaults::{unit_outline, with_default};
use super::keep::Keeper;
use super::scene::SceneArguments;
use super::{Failure, output};
use crate::statistics::Statistics;
use crate::world::{WithMedium, World};

/// Options of covariance grids.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Covariance grid", mut_args(told_of_grids))]
pub struct CovarianceArguments {
    /// Photons that fill the covariance grid.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1 << 32))]
    pub grid_paths: Option<u64>,
    /// Cells of the covariance grid along its longest side.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=512))]
    pub grid_cells: Option<u32>,
    /// Takes the covariance grid from a file instead of filling it.
    #[arg(long, value_name = "FILE")]
    pub grid_in: Option<PathBuf>,
    /// Writes the covariance grid to a file.
    #[arg(long, value_name = "FILE")]
    pub grid_out: Option<PathBuf>,
}

/// Options of ray marching.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Ray marching", mut_args(told_of_steps))]
pub struct MarchArguments {
    /// How the steps along eye rays are chosen.
    #[arg(long, value_enum, default_value_t = Step::Uniform)]
    pub step: Step,
    /// Length of uniform steps; with covariances the longest one.
    #[arg(long, value_name = "LENGTH", value_parser = output::positive)]
    pub step_length: Option<f64>,
    /// How fine `--step covariance` is: about the number of steps where light fills a ray.
    #[arg(long, value_name = "N", value_parser = steps, default_value_t = STEP_COUNT)]
    pub step_count: f32,
    /// Shortest step with covariances.
    #[arg(long, value_name = "LENGTH", value_parser = output::positive)]
    pub step_least: Option<f64>,
    /// Takes the medium's light from a file that `fogbow bake` wrote for the same scene: of all orders, or indirect and then with connections
    /// to the lights at every step.
    #[arg(long, value_name = "FILE.bake")]
    pub bake: Option<PathBuf>,
}

/// An option with the default of [`Settings::for_outline`].
fn told_of_grids(option: Arg) -> Arg {
    let usual = Settings::for_outline(&unit_outline());
    match option.get_id().as_str() {
        "grid_paths" => {
            let for_kernels = usual.for_kernels().photons;
            with_default(option, format!("{}, for kernels of photon beams {for_kernels}", usual.photons))
        }
        "grid_cells" => with_default(option, usual.edge),
        _ => option,
    }
}

/// An option with its default, which [`MarchArguments::stride`] takes.
fn told_of_steps(option: Arg) -> Arg {
    match option.get_id().as_str() {
        "step_length" => {
            let [even, longest] = [EVEN_STEP, LONGEST_STEP].map(f32::recip);
            with_default(option, format!("1/{even} of the scene's diagonal, with covariances 1/{longest}"))
        }
        "step_least" => with_default(option, format!("{LEAST_STEP} of the grid's cell")),
        _ => option,
    }
}

fn steps(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if (0.1..=1e4).contains(&value) => Ok(value),
        _ => Err("must be a number from 0.1 to 10000".to_owned()),
    }
}

/// How steps along eye rays are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Step {
    /// All of one length.
    Uniform,
    /// Short where light varies along the ray, by its covariance, and where it is bright: for least error.
    Covariance,
    /// Half a cycle of what varies most, by its covariance, bright or not (Belcour et al. 2014, Alg. 1).
    Frequency,
}

/// The host stopped a fill, of what is named.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stopped(pub(crate) &'static str);

impl core::fmt::Display for Stopped {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "stopped before the {} had been filled", self.0)
    }
}

impl core::error::Error for Stopped {}

/// Tag of grids in film files, which know themselves what they are of.
const KEPT: u64 = 0;

/// Fills or reads a grid, with a medium of any type.
pub(crate) struct GridJob<'a> {
    pub(crate) arguments: &'a CovarianceArguments,
    pub(crate) scene: &'a SceneArguments,
    /// Whether nothing but kernels of photon beams come from it.
    pub(crate) is_for_kernels: bool,
    pub(crate) world: &'a World<'a>,
    pub(crate) lights: Lights<'a>,
    pub(crate) paths: path::Settings,
    pub(crate) threads: usize,
    pub(crate) seed: u64,
    pub(crate) control: &'a Control<'a>,
    pub(crate) statistics: &'a mut Statistics,
    /// What keeps the grid, and may have one.
    pub(crate) keeper: Option<&'a Keeper<'a>>,
    /// Whether the grid is all that is wanted.
    pub(crate) is_fill: bool,
}

impl WithMedium for GridJob<'_> {
    type Output = Result<CovarianceGrid<'static>, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let (arguments, statistics) = (self.arguments, self.statistics);
        let tag = arguments.tag(self.scene, &self.paths)?;
        let kept = self.keeper.and_then(Keeper::grid);
        let grid = if let Some(bytes) = kept {
            bytes::read(bytes, KEPT, List::default())
                .map_err(|error| format!("the covariance grid of the fill {error}"))?
        } else if let Some(file) = &arguments.grid_in {
            statistics.time("read grid", || load(file, |all| bytes::read(all, tag, List::default()))).map_err(
                |error| match error.problem {
                    Problem::Content(GridBytesError::Damage(Damage::Tag { .. })) => {
                        format!("{}: was made for another scene, or with another --max-depth", file.display())
                    }
                    _ => error.to_string(),
                },
            )?
        } else {
            let world = fogbow::world::World { medium, scene: self.world, lights: self.lights };
            let preset = Settings::for_outline(&self.world.outline(&world));
            let preset = if self.is_for_kernels { preset.for_kernels() } else { preset };
            let settings = Settings {
                photons: arguments.grid_paths.unwrap_or(preset.photons),
                edge: arguments.grid_cells.unwrap_or(preset.edge),
                paths: self.paths,
                seed: self.seed,
                ..preset
            };
            let mut fill = Fill::new(settings)?;
            let ran = threads::run(&mut fill, &world, &Threads::new(self.threads)?, self.control, None, |_| {});
            ran.stages.iter().for_each(|(stage, seconds)| statistics.add(stage, *seconds));
            if ran.ending != Ending::Done {
                return Err(Stopped("covariance grid").into());
            }
            fill.finish()
        };
        if let Some(file) = &arguments.grid_out {
            statistics.time("write grid", || write(file, &grid.to_bytes(tag)))?;
        }
        if let Some(keeper) = self.keeper.filter(|keeper| keeper.wants_filled(self.is_fill)) {
            keeper.keep_grid(grid.to_bytes(KEPT));
        }
        statistics.bytes.push(("covariance grid".to_owned(), grid.bytes() as u64));
        Ok(grid)
    }
}

impl CovarianceArguments {
    /// What a grid is for: the scene, and how long paths may grow.
    fn tag(&self, scene: &SceneArguments, paths: &path::Settings) -> Result<u64, Failure> {
        if !self.is_named() {
            return Ok(0);
        }
        let mut crc = Crc::new();
        crc.add(&scene.fingerprint()?.to_le_bytes());
        for number in [paths.max_scatterings, paths.roulette_after] {
            crc.add(&number.to_le_bytes());
        }
        Ok(crc.value())
    }

    /// # Errors
    /// Places that cannot be written to.
    pub(super) fn check(&self) -> Result<(), String> {
        self.grid_out.iter().try_for_each(|file| output::check_place(file))
    }

    /// Whether a grid is named.
    pub(super) fn is_named(&self) -> bool {
        self.grid_in.is_some() || self.grid_out.is_some()
    }
}

impl MarchArguments {
    /// Steps in a world of this diagonal, along rays through `grid` if there is one.
    pub(super) fn stride<'a>(&self, size: f32, grid: Option<&'a GridView<'a>>) -> Stride<'a> {
        let given = |length: Option<f64>| length.map(|l| l as f32);
        let grid = grid.filter(|_| self.step != Step::Uniform);
        let longest =
            given(self.step_length).unwrap_or(if grid.is_some() { LONGEST_STEP * size } else { EVEN_STEP * size });
        let least = grid.map_or(longest, |grid| LEAST_STEP * grid.lattice().cell().min_element());
        let least = given(self.step_least).unwrap_or(least).min(longest);
        let rule = match self.step {
            Step::Uniform => None,
            Step::Covariance => Some(Rule::Error { count: self.step_count }),
            Step::Frequency => Some(Rule::Frequency),
        };
        Stride { along: grid.zip(rule), limits: (least, longest) }
    }
}

/// How long steps along eye rays are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stride<'a> {
    along: Option<(&'a GridView<'a>, Rule)>,
    limits: (f32, f32),
}

impl<'a> Stride<'a> {
    /// Lengths (m) of the steps along `ray` by where they start (m), asked in order.
    pub(super) fn steps(&self, ray: &Ray) -> impl FnMut(f32) -> f32 + use<'a> {
        let longest = self.limits.1;
        let mut steps = self.along.map(|(grid, rule)| AdaptiveSteps::new(grid, ray, rule, self.limits));
        move |from| steps.as_mut().map_or(longest, |steps| steps.after(from))
    }
}
