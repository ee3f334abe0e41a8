//! `fogbow probe`: numbers instead of pictures.

use core::fmt::Write;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use fogbow::covariance::{GridView, hessian_bound};
use fogbow::math::{Bounds, Symmetric3, Vec3};
use fogbow_std::progress::Control;

use super::covariance::{CovarianceArguments, GridJob};
use super::render::path_settings;
use super::scene::SceneArguments;
use super::{Ending, Failure, output};
use crate::derivatives::{Upper, difference, filtered};
use crate::statistics::Statistics;
use crate::world::{Storage, World};

/// Most points of one run.
const MAX_POINTS: u64 = 4_000_000;

/// Says in numbers what is in a scene.
#[derive(Debug, Args)]
pub struct ProbeArguments {
    /// What to ask for.
    #[command(subcommand)]
    pub what: Probe,
}

/// What to ask for.
#[derive(Debug, Subcommand)]
pub enum Probe {
    /// Second derivatives of the fluence: the bound by its covariance, beside differences (Belcour et al. 2014, § 6.2).
    Hessian(Box<HessianArguments>),
}

/// Second derivatives of the fluence: the bound by its covariance, beside differences (Belcour et al. 2014, § 6.2).
///
/// A table of comma-separated values, a row per point: x, y, z (m); fluence (W·m⁻²); then, as xx, xy, xz, yy, yz, zz
/// (W·m⁻⁴), the bound 4π²FΓ of the absolute Hessian with its eigenvalues, the differences of neighbouring cells, and
/// the fluence filtered with second derivatives of a Gaussian over 21³ cells. What is not known stays empty.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("where").required(true))]
pub struct HessianArguments {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneArguments,
    /// A point; may be repeated.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, group = "where")]
    pub at: Vec<Vec3>,
    /// Points from one to another.
    #[arg(long, value_name = "FROM TO", value_parser = line, allow_hyphen_values = true, group = "where")]
    pub line: Option<[Vec3; 2]>,
    /// Points on the line, its ends among them.
    #[arg(long, value_name = "N", default_value_t = 65, value_parser = clap::value_parser!(u32).range(2..=1_000_000), conflicts_with_all = ["at", "grid"])]
    pub samples: u32,
    /// Points all over the covariance grid: the centres of as many equal boxes.
    #[arg(long, value_name = "NxNxN", value_parser = counts, group = "where")]
    pub grid: Option<[u32; 3]>,
    /// As in `render`.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_depth: Option<u32>,
    /// Threads; 0 is one per processor.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Chooses other random numbers.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// File to write [default: standard output].
    #[arg(short, long, value_name = "FILE.csv")]
    pub output: Option<PathBuf>,
    /// No summary.
    #[arg(short, long)]
    pub quiet: bool,
    /// Of covariance grids.
    #[command(flatten)]
    pub covariance: CovarianceArguments,
}

fn point(text: &str) -> Result<Vec3, String> {
    let number = |text: &str| text.trim().parse().ok().filter(|v: &f32| v.is_finite());
    let numbers: Option<Vec<f32>> = text.split(',').map(number).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(Vec3::new(x, y, z)),
        _ => Err("must look like \"0,1.8,4\"".to_owned()),
    }
}

fn line(text: &str) -> Result<[Vec3; 2], String> {
    let ends: Option<Vec<Vec3>> = text.split_whitespace().map(|text| point(text).ok()).collect();
    match ends.as_deref() {
        Some(&[from, to]) if from != to => Ok([from, to]),
        Some(&[_, _]) => Err("the line has no length".to_owned()),
        _ => Err("must look like \"0,1.8,4 0,1,0\": a point, a space, another point".to_owned()),
    }
}

fn counts(text: &str) -> Result<[u32; 3], String> {
    let numbers: Option<Vec<u32>> = text.split('x').map(|n| n.parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if [x, y, z].map(u128::from).iter().product::<u128>() > u128::from(MAX_POINTS) => {
            Err(format!("there may be at most {MAX_POINTS} points"))
        }
        Some(&[x, y, z]) if x.min(y).min(z) > 0 => Ok([x, y, z]),
        _ => Err("must look like 16x16x16".to_owned()),
    }
}

pub(super) fn run(arguments: &ProbeArguments) -> Result<Ending, Failure> {
    match &arguments.what {
        Probe::Hessian(arguments) => hessian(arguments),
    }
}

fn hessian(arguments: &HessianArguments) -> Result<Ending, Failure> {
    if let Some(file) = &arguments.output {
        output::check_place(file)?;
    }
    arguments.covariance.check()?;
    let scene = arguments.scene.read(arguments.quiet)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    if world.media().glow() {
        return Err("glowing media send no photons: the fluence of their light cannot be probed".into());
    }
    let lights = world.lights();
    if lights.is_empty() {
        return Err("the scene has no lights: there is no fluence to probe".into());
    }
    let mut statistics = Statistics::default();
    let filled = world.media().with(GridJob {
        arguments: &arguments.covariance,
        scene: &arguments.scene,
        is_for_kernels: false,
        world: &world,
        lights: (&lights).into(),
        paths: path_settings(&scene, arguments.max_depth),
        threads: arguments.threads,
        seed: arguments.seed,
        control: &Control::default(),
        statistics: &mut statistics,
        keeper: None,
        is_fill: false,
    })?;
    let grid = filled.view();
    let points = points(arguments, &grid)?;
    let table = table(&grid, &points);
    match &arguments.output {
        Some(file) => std::fs::write(file, table).map_err(|e| format!("{}: cannot be written: {e}", file.display()))?,
        None => output::print(table.trim_end())?,
    }
    if !arguments.quiet {
        let [x, y, z] = grid.lattice().size();
        let count = points.len();
        let s = if count == 1 { "" } else { "s" };
        say!("{count} point{s}, in a grid of {x} x {y} x {z} cells filled by {} photons", grid.paths());
    }
    Ok(Ending::Done)
}

/// The points asked for, all of them within the grid.
fn points(arguments: &HessianArguments, grid: &GridView<'_>) -> Result<Vec<Vec3>, String> {
    let bounds = grid.lattice().bounds();
    let mut points = arguments.at.clone();
    if let Some([from, to]) = arguments.line {
        let last = arguments.samples - 1;
        // Both ends exactly.
        points.extend((0..=last).map(|i| {
            let t = i as f32 / last as f32;
            from * (1.0 - t) + to * t
        }));
    }
    if let Some(counts) = arguments.grid {
        points.extend(centres(&bounds, counts));
    }
    match points.iter().find(|p| !bounds.contains(**p)) {
        Some(Vec3 { x, y, z }) => {
            let (low, high) = (bounds.min, bounds.max);
            Err(format!(
                "{x},{y},{z} lies outside of the grid, which reaches from {},{},{} to {},{},{}",
                low.x, low.y, low.z, high.x, high.y, high.z
            ))
        }
        None => Ok(points),
    }
}

fn centres(bounds: &Bounds, [nx, ny, nz]: [u32; 3]) -> impl Iterator<Item = Vec3> {
    let step = bounds.size() / Vec3::new(nx as f32, ny as f32, nz as f32);
    let low = bounds.min;
    (0..nz).flat_map(move |k| {
        (0..ny).flat_map(move |j| (0..nx).map(move |i| low + (Vec3::new(i as f32, j as f32, k as f32) + 0.5) * step))
    })
}

/// Names of a matrix's entries.
const ENTRIES: [&str; 6] = ["xx", "xy", "xz", "yy", "yz", "zz"];

fn table(grid: &GridView<'_>, points: &[Vec3]) -> String {
    let mut text = "x,y,z,fluence".to_owned();
    let names = |what: &'static str| ENTRIES.iter().map(move |entry| format!("{what}_{entry}"));
    let eigenvalues = (1..=3).map(|i| format!("bound_{i}"));
    for name in names("bound").chain(eigenvalues).chain(names("difference")).chain(names("filtered")) {
        text.push(',');
        text += &name;
    }
    text.push('\n');
    for point in points {
        // Writing to a string cannot fail.
        let _ = write!(text, "{},{},{}", point.x, point.y, point.z);
        let fluence = grid.fluence(*point);
        let bound = fluence.zip(grid.covariance(*point)).map(|(fluence, gamma)| hessian_bound(fluence, &gamma));
        column(&mut text, fluence.map(|f| [f.into()]));
        column(&mut text, bound.map(|bound| bound.to_upper().map(f64::from)));
        column(&mut text, bound.map(|bound: Symmetric3| bound.eigen().values.map(f64::from)));
        column::<6>(&mut text, difference(grid, *point));
        let around: Option<Upper> = filtered(grid, *point);
        column(&mut text, around);
        text.push('\n');
    }
    text
}

/// Values, each behind a comma; commas alone if there are none.
fn column<const N: usize>(text: &mut String, values: Option<[f64; N]>) {
    match values {
        Some(values) => values.iter().for_each(|value| {
            let _ = write!(text, ",{:e}", *value as f32);
        }),
        None => text.push_str(&",".repeat(N)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_or_refused_with_an_example() {
        assert_eq!(point("-1, 2.5,3e-1"), Ok(Vec3::new(-1.0, 2.5, 0.3)));
        for text in ["", "1,2", "1,2,3,4", "1,2,nan", "1,2,inf", "a,b,c", "1;2;3"] {
            assert!(point(text).unwrap_err().contains("0,1.8,4"), "{text}");
        }
        assert_eq!(line("0,0,0  1,2,3"), Ok([Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)]));
        for text in ["", "1,2,3", "1,2,3 4,5", "1,2,3 1,2,3", "1,2,3 4,5,6 7,8,9"] {
            assert!(line(text).is_err(), "{text}");
        }
        assert_eq!(counts("2x3x4"), Ok([2, 3, 4]));
        for text in ["", "2x3", "2x3x0", "-1x2x3", "2x3x4x5", "1000x1000x1000", "4294967295x4294967295x4294967295"] {
            assert!(counts(text).is_err(), "{text}");
        }
    }

    #[test]
    fn points_of_a_grid_are_the_centres_of_boxes_x_first() {
        let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(4.0, 2.0, 1.0) };
        let all: Vec<Vec3> = centres(&bounds, [2, 1, 2]).collect();
        let due = [[1.0, 1.0, 0.25], [3.0, 1.0, 0.25], [1.0, 1.0, 0.75], [3.0, 1.0, 0.75]];
        assert_eq!(all, due.map(Vec3::from));
    }
}
