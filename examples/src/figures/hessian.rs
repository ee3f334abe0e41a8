//! Fig. 10 of Belcour et al. 2014: second derivatives of the fluence, by covariances and by differences.
//!
//! A spot whose lobe is `cosⁿ`, about a Gaussian of `s = 1/√n`, shines along +z through even fog. Across the beam, on its
//! axis, its own light has
//!
//! ```text
//! F″ = −F ((n + 2)/z² + σₜ/z),      of which the lobe's part is −F/(s² z²)
//! ```
//!
//! Light scattered once adds `σₛ ∫ F″(x′) e^(−σₜ d)/(4π d²) dx′`; walks end there.

use core::sync::atomic::{AtomicUsize, Ordering};
use std::fmt::Write;
use std::sync::Mutex;

use fogbow::covariance::{FrequencyPhotons, GridView, Lattice, Voxel, hessian_bound};
use fogbow::host::Empty;
use fogbow::light::{Light, PhongLight, PointLight};
use fogbow::math::{Bounds, Vec3};
use fogbow::medium::Homogeneous;
use fogbow::path::Settings;
use fogbow::phase::Lobe;
use fogbow::photon;
use fogbow::spectrum::Spectrum;
use fogbow::world::World;
use fogbow_std::seed::independent;

use super::plot::{BLUE, GREEN, Line, ORANGE, Plot};
use super::{Plan, percent};
use crate::cli::Failure;
use crate::derivatives::{difference, filtered};

/// Standard deviation of the lobe (rad).
pub const LOBE: f32 = 0.1;
/// Both of the fog's coefficients (m⁻¹), as in B.
pub const FOG: f32 = 0.1;
/// Cells along each edge: odd, so that the axis runs through the middle of cells; B has 128.
pub const EDGE: u32 = 127;
/// Edge of the grid (m).
const SIZE: f32 = 2.0;
/// Where along the axis (m); moved to the middle of a cell.
const PLACES: [f32; 3] = [0.5, 1.0, 1.5];
/// Numbers of paths after which the estimates are asked.
const PATHS: [u64; 10] = [1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000];

/// Names of the estimates, in their order.
pub const ESTIMATES: [&str; 3] = ["4π²FΓ", "3-point differences", "filtered, 21³"];

/// How well three estimates do.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Where on the axis (m).
    pub places: [f32; 3],
    /// True second derivatives across the beam (W·m⁻⁴) for a spot of 1 W.
    pub truths: [f64; 3],
    /// By number of paths, place and estimate: root of the mean square of relative errors over seeds and both directions
    /// across the beam.
    pub errors: Vec<(u64, [[f64; 3]; 3])>,
    /// The same of the means over seeds: bias, but for the noise left in it.
    pub biases: Vec<(u64, [[f64; 3]; 3])>,
}

fn lattice() -> Lattice {
    let half = 0.5 * SIZE;
    let bounds = Bounds { min: Vec3::new(-half, -half, 0.0), max: Vec3::new(half, half, SIZE) };
    Lattice::new(bounds, [EDGE; 3]).expect("a cube has extent")
}

fn fog() -> Homogeneous {
    Homogeneous::new(Spectrum::splat(FOG), Spectrum::splat(FOG), Lobe::Isotropic).expect("positive coefficients")
}

/// The middle of the cell at `z` on the axis.
fn place(lattice: &Lattice, z: f32) -> Vec3 {
    lattice.index(Vec3::new(0.0, 0.0, z)).map_or(Vec3::ZERO, |index| lattice.centre(index))
}

/// `F″` (W·m⁻⁴) across the axis at `z` (m), of light scattered at most once.
#[must_use]
pub fn truth(z: f64) -> f64 {
    let own = 0.5 * laplacian_across(0.0, z);
    let (extinction, scattering) = (2.0 * f64::from(FOG), f64::from(FOG));
    // Rings at r = 4 w v² around the axis, w the beam's width, and at z ± u²: finest around the point, where 1/d².
    let (rings, slices) = (400, 1500);
    let width = f64::from(LOBE);
    let mut sum = 0.0;
    for (sign, end) in [(-1.0, z.sqrt()), (1.0, 6.0)] {
        for j in 0..slices {
            let du = end / f64::from(slices);
            let u = (f64::from(j) + 0.5) * du;
            let at = z + sign * u * u;
            for i in 0..rings {
                let dv = 1.5 / f64::from(rings);
                let v = (f64::from(i) + 0.5) * dv;
                let r = 4.0 * width * at * v * v;
                let (dr, dz) = (8.0 * width * at * v * dv, 2.0 * u * du);
                let d2 = r * r + u.powi(4);
                sum += 0.5 * laplacian_across(r, at) * (-extinction * d2.sqrt()).exp() / d2 * 0.5 * r * dr * dz;
            }
        }
    }
    own + scattering * sum
}

/// `F_xx + F_yy` of light not yet scattered, at distance `r` from the axis.
fn laplacian_across(r: f64, z: f64) -> f64 {
    let (n, extinction) = (1.0 / f64::from(LOBE).powi(2), 2.0 * f64::from(FOG));
    let d2 = z * z + r * r;
    let d = d2.sqrt();
    let intensity = (n + 1.0) / (2.0 * core::f64::consts::PI);
    let fluence = intensity * (n * (z / d).ln() - extinction * d).exp() / d2;
    // Derivatives of ln F by r².
    let first = -(n + 2.0) / (2.0 * d2) - extinction / (2.0 * d);
    let second = (n + 2.0) / (2.0 * d2 * d2) + extinction / (4.0 * d2 * d);
    4.0 * fluence * (first + r * r * (first * first + second))
}

/// Sends photons from `lights` and calls `look` with the grid after each number of paths in `stops`.
fn fill(lights: &[Light<'_>], scatterings: u32, seed: u64, stops: &[u64], mut look: impl FnMut(&GridView<'_>)) {
    let (lattice, fog) = (lattice(), fog());
    let world = World { medium: &fog, scene: &Empty, lights: lights.into() };
    let settings = Settings { max_scatterings: scatterings, ..Settings::default() };
    let mut voxels = vec![Voxel::EMPTY; lattice.cell_count()];
    let mut photons = FrequencyPhotons::new(world, None, lattice);
    let mut sent = 0;
    for &stop in stops {
        while sent < stop {
            let mut rng = independent(seed, 0xb10, sent as u32);
            photon::trace(&world, &lattice.bounds(), &settings, &mut rng, &mut |event| {
                photons.visit(event, &mut voxels)
            });
            sent += 1;
        }
        if let Ok(grid) = GridView::new(lattice, &voxels, sent) {
            look(&grid);
        }
    }
}

/// Both second derivatives across the beam by each of [`ESTIMATES`], relative to the truth.
fn asked(grid: &GridView<'_>, point: Vec3, truth: f64) -> [[f64; 2]; 3] {
    let across = |upper: [f64; 6]| [upper[0] / truth, upper[3] / truth];
    let ours = grid.fluence(point).zip(grid.covariance(point)).map_or([0.0; 6], |(fluence, gamma)| {
        // On the axis the light has its maximum: the bound's sign is known.
        hessian_bound(fluence, &gamma).to_upper().map(|x| -f64::from(x))
    });
    [ours, difference(grid, point).unwrap_or_default(), filtered(grid, point).unwrap_or_default()].map(across)
}

/// Measures all with that many seeds, up to `most` paths.
#[must_use]
pub fn measure(seeds: u64, most: u64, threads: usize) -> Measured {
    let points = PLACES.map(|z| place(&lattice(), z));
    let truths = points.map(|p| truth(f64::from(p.z)));
    let spot = PhongLight::from_flux(Vec3::ZERO, Vec3::Z, 1.0 / (LOBE * LOBE), Spectrum::ONE).expect("a valid lobe");
    let lights = [Light::Phong(spot)];
    let stops: Vec<u64> = PATHS.into_iter().filter(|n| *n <= most).collect();
    // By seed, number of paths, place, estimate and direction.
    let all = Mutex::new(vec![Vec::new(); seeds as usize]);
    let next = AtomicUsize::new(0);
    let threads = if threads == 0 { std::thread::available_parallelism().map_or(1, Into::into) } else { threads };
    std::thread::scope(|scope| {
        for _ in 0..threads.min(seeds as usize) {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed as u64 >= seeds {
                        break;
                    }
                    let mut found = Vec::new();
                    fill(&lights, 2, seed as u64, &stops, |grid| {
                        found.push([0, 1, 2].map(|i| asked(grid, points[i], truths[i])));
                    });
                    if let Ok(mut all) = all.lock() {
                        all[seed] = found;
                    }
                }
            });
        }
    });
    let all = all.into_inner().unwrap_or_default();
    let over = |of: &dyn Fn(&[f64]) -> f64| -> Vec<(u64, [[f64; 3]; 3])> {
        let at = |stop: usize, place: usize, estimate: usize| -> Vec<f64> {
            all.iter().filter_map(|found| found.get(stop)).flat_map(|found| found[place][estimate]).collect()
        };
        let table = |stop| [0, 1, 2].map(|place| [0, 1, 2].map(|estimate| of(&at(stop, place, estimate))));
        stops.iter().enumerate().map(|(stop, &paths)| (paths, table(stop))).collect()
    };
    let mean = |values: &mut dyn Iterator<Item = f64>, count: usize| values.sum::<f64>() / count.max(1) as f64;
    Measured {
        places: points.map(|p| p.z),
        truths,
        errors: over(&|x| mean(&mut x.iter().map(|x| (x - 1.0).powi(2)), x.len()).sqrt()),
        biases: over(&|x| mean(&mut x.iter().copied(), x.len()) - 1.0),
    }
}

/// What the bound says 1 m from an unoccluded isotropic point light, over the true largest second derivative, 6 F/z²
/// and what the fog adds.
#[must_use]
pub fn fall_off(paths: u64) -> f64 {
    let lamp = PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).expect("a valid lamp");
    let mut ratio = f64::NAN;
    fill(&[Light::Point(lamp)], 1, 0, &[paths], |grid| {
        let point = place(grid.lattice(), 1.0);
        if let (Some(fluence), Some(gamma)) = (grid.fluence(point), grid.covariance(point)) {
            let (z, sigma) = (f64::from(point.z), 2.0 * f64::from(FOG));
            let true_over_fluence = 6.0 / (z * z) + 4.0 * sigma / z + sigma * sigma;
            ratio = f64::from(hessian_bound(fluence, &gamma).eigen().values[0] / fluence) / true_over_fluence;
        }
    });
    ratio
}

/// The section of the page.
pub(super) fn section(plan: &Plan) -> Result<String, Failure> {
    let (seeds, most) = if plan.quick { (6, 50_000) } else { (16, 1_000_000) };
    let measured = measure(seeds, most, plan.threads);
    plan.write("fig-10-hessian.svg", &plot(&measured).svg_over_decades())?;
    let mut page = format!(
        "## Fig. 10: second derivatives of the fluence\n\n\
         A spot with a lobe cosⁿ, n = {n:.0}, about a Gaussian of {LOBE} rad, shines through even fog (σₐ = σₛ = {FOG} m⁻¹, isotropic, \
         light scattered at most once); {EDGE}³ cells in a cube of {SIZE} m. On the axis, 1 m from the spot: the relative error of \
         the second derivative across the beam, over {seeds} seeds and both directions, against the true value (closed form for \
         light not scattered, a quadrature for light scattered once), by the number of paths. All estimates come from the \
         same cells: 4π²FΓ of the one cell there (B's Eq. 2), differences of its neighbours, and the fluence filtered with \
         second derivatives of a Gaussian of {width} cells over 21³ cells.\n\n![error by number of paths](fig-10-hessian.svg)\n\n",
        n = 1.0 / (LOBE * LOBE),
        width = crate::derivatives::WIDTH,
    );
    page += "Nearer and farther along the axis the beam is as wide as fewer or more cells, which makes the filter's bias \
             larger or smaller. Errors, in that order of estimates:\n\n| paths |";
    for z in measured.places {
        // Writing to a string cannot fail.
        let _ = write!(page, " {z:.2} m: beam of {:.1} cells |", LOBE * z * EDGE as f32 / SIZE);
    }
    page += "\n|---|---|---|---|\n";
    for (paths, errors) in &measured.errors {
        let _ = write!(page, "| {paths} |");
        for errors in errors {
            let [ours, near, far] = errors.map(percent);
            let _ = write!(page, " {ours}, {near}, {far} |");
        }
        page.push('\n');
    }
    if let Some((paths, biases)) = measured.biases.last() {
        page += "\nOurs is the most accurate ";
        for (i, z) in measured.places.iter().enumerate() {
            let (comma, from) = (if i == 0 { "" } else { ", " }, best_from(&measured, i));
            let from = from.map_or("nowhere here".to_owned(), |from| format!("from {from} paths on"));
            let _ = write!(page, "{comma}at {z:.2} m {from}");
        }
        let [ours, _, far] = biases[1].map(percent);
        let _ = write!(
            page,
            ". Its noise is that of F, of the photons in one cell; Γ is the same for all of them. What remains with {paths} paths is \
             bias: at 1 m {ours} for ours, from the fog and the width of the cell; \
             {far} for the filter, because it is about half as wide as the beam. One made for this beam would do better; it would have to \
             be told how wide the beam is, which is what Γ says.\n\n"
        );
    }
    let blind = fall_off(if plan.quick { 200_000 } else { 500_000 });
    let _ = write!(
        page,
        "**Where the model is blind:** an unoccluded isotropic point light varies by 6F/r² along its rays, from 1/r² alone, and the \
         spectrum of its light field has nothing across them: a traced covariance says 0 there. Photons that come straight from a \
         light therefore add its fall-off (`covariance::divergence`); with it 4π²FΓ is {} of the true largest second derivative, and what is \
         missing is the fog's own exponential. Behind glass and mirrors nothing is added.\n\n",
        percent(blind)
    );
    Ok(page)
}

/// The number of paths from which on the first estimate is the best at the place with this index.
#[must_use]
pub fn best_from(measured: &Measured, place: usize) -> Option<u64> {
    let is_best = |errors: &[f64; 3]| errors[0] < errors[1] && errors[0] < errors[2];
    let best = measured.errors.iter().rev().take_while(|(_, errors)| errors.get(place).is_some_and(is_best));
    best.last().map(|(paths, _)| *paths)
}

fn plot(measured: &Measured) -> Plot<'static> {
    let line = |i: usize, colour| {
        let points = measured.errors.iter().map(|(paths, errors)| [*paths as f64, errors[1][i]]).collect();
        Line { name: ESTIMATES[i], colour, width: 1.6, points }
    };
    let most = measured.errors.last().map_or(1e4, |last| last.0 as f64);
    Plot {
        across: "paths",
        upwards: "relative error",
        x: [1000.0, most],
        y: [0.01, 100.0],
        lines: vec![line(0, BLUE), line(1, ORANGE), line(2, GREEN)],
    }
}
