//! Slices of covariance grids: Fig. 8 of Belcour et al. 2014, and what their Fig. 17 shows.

use std::fmt::Write;

use fogbow::covariance::CovarianceGrid;
use fogbow::math::Vec3;
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;
use fogbow_std::progress::Control;

use super::{Plan, montage, percent, rendered};
use crate::cli::SceneArguments;
use crate::cli::covariance::GridJob;
use crate::cli::render::path_settings;
use crate::cli::{CovarianceArguments, Failure};
use crate::scene_file::SceneFile;
use crate::statistics::Statistics;
use crate::world::{Storage, World};

/// Cells along the longest side.
const EDGES: [u32; 2] = [32, 64];
/// Pixels along the longest side of a picture.
const PIXELS: u32 = 384;
/// Decades that the colours of the fluence span.
const DECADES: f32 = 3.0;

/// The same of `√tr Γ`.
const FREQUENCY_DECADES: f32 = 2.0;

/// Dark to bright, and as bright in grey.
const COLOURS: [[f32; 3]; 6] =
    [[0.0, 0.0, 0.02], [0.12, 0.02, 0.2], [0.45, 0.03, 0.15], [0.85, 0.16, 0.03], [0.98, 0.5, 0.03], [0.98, 0.97, 0.6]];

/// A colour for a number from 0 to 1.
pub(super) fn colour(share: f32) -> Spectrum {
    let place = share.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f32;
    let low = (place as usize).min(COLOURS.len() - 2);
    let [a, b] = [COLOURS[low], COLOURS[low + 1]].map(Spectrum);
    a + (b + a * -1.0) * (place - low as f32)
}

struct Filled {
    grid: CovarianceGrid<'static>,
    /// Processor time (s).
    cpu: f64,
}

fn fill(plan: &Plan, edge: u32, paths: u64, seed: u64) -> Result<Filled, Failure> {
    let file = rendered::scene_of(plan, "nave");
    let scene = SceneFile::read(&file)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    let arguments =
        CovarianceArguments { grid_paths: Some(paths), grid_cells: Some(edge), grid_in: None, grid_out: None };
    let mut statistics = Statistics::default();
    let grid = world.media().with(GridJob {
        arguments: &arguments,
        scene: &SceneArguments::plain(file),
        is_for_kernels: false,
        world: &world,
        lights: (&world.lights()).into(),
        paths: path_settings(&scene, Some(2)),
        threads: plan.threads,
        seed,
        control: &Control::default(),
        statistics: &mut statistics,
        keeper: None,
        is_fill: false,
    })?;
    let cpu = statistics.phases.iter().map(|(_, s)| s.cpu.unwrap_or(s.wall)).sum();
    Ok(Filled { grid, cpu })
}

/// Fluence and `√tr Γ` of a cell.
fn values(filled: &Filled, index: usize) -> Option<[f32; 2]> {
    let view = filled.grid.view();
    let voxel = view.voxels()[index];
    let cell = view.lattice().cell();
    let gamma = voxel.covariance()?;
    let fluence = voxel.weight / (cell.x * cell.y * cell.z * view.paths() as f32);
    Some([fluence, (gamma.xx + gamma.yy + gamma.zz).max(0.0).sqrt()])
}

/// Values on the slice along the nave, through its middle: across, then down, and what is there.
fn slice(filled: &Filled) -> [Vec<Option<f32>>; 2] {
    let view = filled.grid.view();
    let (lattice, [nx, ny, _]) = (view.lattice(), view.lattice().size());
    let (low, cell, size) = (lattice.bounds().min, lattice.cell(), lattice.bounds().size());
    let mut both = [Vec::new(), Vec::new()];
    for y in (0..ny).rev() {
        for x in 0..nx {
            // An even number of cells has no middle one: a little to the side.
            let half = Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 0.0) * cell;
            let point = low + half + Vec3::Z * (0.5 * size.z + 0.01 * cell.z);
            let found = lattice.index(point).and_then(|index| values(filled, index));
            both[0].push(found.map(|v| v[0]));
            both[1].push(found.map(|v| v[1]));
        }
    }
    both
}

fn greatest(values: &[Option<f32>]) -> f32 {
    let mut sorted: Vec<f32> = values.iter().flatten().copied().collect();
    sorted.sort_by(f32::total_cmp);
    sorted.get(sorted.len() * 99 / 100).copied().unwrap_or(1.0).max(1e-30)
}

fn picture(filled: &Filled, values: &[Option<f32>], share: impl Fn(f32) -> f32) -> Result<Image, Failure> {
    let [nx, ny, _] = filled.grid.view().lattice().size();
    let by = (PIXELS / nx).max(1);
    montage::made(nx * by, ny * by, |x, y| {
        let found = values.get((y / by * nx + x / by) as usize).copied().flatten();
        found.map_or(Spectrum::splat(0.12), |value| colour(share(value)))
    })
}

/// What is said about a grid.
struct Said {
    /// Volume of cells with more than a tenth of the greatest fluence (m³), and the mean of `√tr Γ` there, by flux.
    volume: f64,
    frequency: f64,
}

fn said(filled: &Filled, most: f32) -> Said {
    let view = filled.grid.view();
    let cell = view.lattice().cell();
    let one = f64::from(cell.x * cell.y * cell.z);
    let (mut volume, mut flux, mut sum) = (0.0, 0.0, 0.0);
    for [fluence, frequency] in (0..view.voxels().len()).filter_map(|i| values(filled, i)) {
        if fluence > 0.1 * most {
            volume += one;
        }
        flux += f64::from(fluence);
        sum += f64::from(fluence * frequency);
    }
    Said { volume, frequency: sum / flux.max(f64::MIN_POSITIVE) }
}

/// How much `√tr Γ` differs between two seeds where both know it, by flux.
fn noise(a: &Filled, b: &Filled) -> f64 {
    let (mut flux, mut sum) = (0.0, 0.0);
    for i in 0..a.grid.view().voxels().len() {
        if let (Some([fluence, x]), Some([_, y])) = (values(a, i), values(b, i)) {
            flux += f64::from(fluence);
            sum += f64::from(fluence) * f64::from((x - y) / (0.5 * (x + y)).max(f32::MIN_POSITIVE)).powi(2);
        }
    }
    // Each of the two has half of the difference's variance.
    (0.5 * sum / flux.max(f64::MIN_POSITIVE)).sqrt()
}

/// The section of the page.
pub(super) fn section(plan: &Plan) -> Result<String, Failure> {
    let paths = if plan.quick { 200_000 } else { 1_000_000 };
    let (mut rows, mut table) = (Vec::new(), String::new());
    let mut both = Vec::new();
    for edge in EDGES {
        both.push((fill(plan, edge, paths, 0)?, fill(plan, edge, paths, 1)?));
    }
    // The same colours for both grids: those of the finer one.
    let [fluences, frequencies] = match both.last() {
        Some((finest, _)) => slice(finest),
        None => return Err("no grids".into()),
    };
    let [most, highest] = [greatest(&fluences), greatest(&frequencies)];
    for (filled, other) in &both {
        let [fluences, frequencies] = slice(filled);
        rows.push(montage::beside(&[
            picture(filled, &fluences, |f| 1.0 + (f / most).log10() / DECADES)?,
            picture(filled, &frequencies, |f| 1.0 + (f / highest).log10() / FREQUENCY_DECADES)?,
        ])?);
        let Said { volume, frequency } = said(filled, most);
        let [x, y, z] = filled.grid.view().lattice().size();
        let cell = filled.grid.view().lattice().cell();
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "| {x} × {y} × {z} | {:.2} m | {volume:.0} m³ | {frequency:.2} m⁻¹ | {} | {:.1} s |",
            cell.x,
            percent(noise(filled, other)),
            filled.cpu,
        );
    }
    montage::save(&plan.output.join("fig-08-slices.png"), &montage::above(&rows)?, 0.0)?;
    Ok(format!(
        "## Fig. 8: a covariance grid\n\n![fluence and frequencies](fig-08-slices.png)\n\nThe nave (`nave.xml`, light scattered at \
         most once), cut along its middle: left the fluence, in {DECADES} decades up to {most:.3} W·m⁻²; right √tr Γ, the \
         bandwidth of that light in space, in {FREQUENCY_DECADES} decades up to {highest:.2} cycles per metre. Above {} cells along the longest side, \
         below {}, with the same colours; {paths} photons each. Grey cells have seen none. The sun falls in from the right; the \
         squares are beams of sky light that cross the nave, the strip above is the sky's light on the outside of the vault. Frequencies are \
         high along the edges of beams and low inside of them, where the fluence is as high.\n\n\
         | cells | width | volume brighter than a tenth of that | mean √tr Γ, by flux | noise of √tr Γ | processor time |\n\
         |---|---|---|---|---|---|\n{table}\n\
         **What a grid cannot show** (B's Fig. 17): nothing within a cell. Light that fills part of one is spread over all of \
         it, with its frequencies, so that the lit volume depends on the width of cells, and an edge that lies in a cell \
         marks the whole of it. Smaller cells show more and see fewer photons each: noise is the relative standard \
         deviation of √tr Γ in a cell, between two fills, by flux.\n\n",
        EDGES[0], EDGES[1],
    ))
}
