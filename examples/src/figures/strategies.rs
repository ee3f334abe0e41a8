//! Strategies of compensation at equal time: Figs 6 and 7 of Engelhardt et al. 2012.

use std::fmt::Write;

use fogbow::host::Medium;
use fogbow::light::Lights;
use fogbow::math::Vec2;
use fogbow::medium::Pyramid;
use fogbow::path;
use fogbow::sampling::uniform2;
use fogbow::spectrum::Spectrum;
use fogbow::vpl::{self, Bound, Compensation, EyeSettings, Flights, Gatherer, Settings};
use fogbow::world::{Outline, World as LitWorld};
use fogbow_std::film::{Film, Image};
use fogbow_std::progress::Control;
use fogbow_std::seed::Sequence;
use fogbow_std::threads::{self, Threads};
use fogbow_std::tiles;

use super::engelhardt::{mean, strip};
use super::judged::Judges;
use super::plot::{BLACK, BLUE, GREEN, Line, ORANGE, PURPLE, Plot};
use super::{Plan, montage, percent, rendered};
use crate::cli::Failure;
use crate::cli::render::path_settings;
use crate::scene_file::SceneFile;
use crate::world::{Storage, WithMedium, World};

/// Clamps within this radius (m).
const RADIUS: f32 = 0.1;

/// Error at which strategies are compared.
const AIM: f64 = 0.1;

/// Name, colour in the plot, and how; two steps each.
const STRATEGIES: [(&str, &str, Compensation); 5] = [
    ("1-to-N", BLACK, Compensation { steps: 2, ..Compensation::FULL }),
    ("N-to-1", ORANGE, Compensation::N_TO_ONE),
    ("1-to-1", GREEN, Compensation::ONE_TO_ONE),
    ("1-to-1, locally even", PURPLE, Compensation { flights: Flights::LocallyHomogeneous, ..Compensation::ONE_TO_ONE }),
    ("abc, by fours", BLUE, Compensation::APPROXIMATE),
];

/// What is rendered: all samples see all of the same virtual lights, and no other.
struct Job<'a> {
    world: &'a World<'a>,
    lamps: Lights<'a>,
    paths: path::Settings,
    /// Virtual lights, about.
    wanted: u32,
    /// Seed of the virtual lights.
    run: u64,
    film: &'a mut Film,
    settings: &'a tiles::Settings,
    compensation: Compensation,
}

impl WithMedium for Job<'_> {
    type Output = Result<f64, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let paths = self.paths;
        let bounds = self.world.bounds();
        let bound = Bound::within(RADIUS).map_err(|e| e.to_string())?;
        let size = (bounds.size() * (2.0 / RADIUS)).to_array().map(|side| (side.ceil() as u32).clamp(1, 128));
        let mut means = vec![Spectrum::ZERO; Pyramid::<()>::cell_count(size)];
        let medium = Pyramid::new(medium, bounds, size, &mut means).map_err(|e| e.to_string())?;
        let lit = LitWorld { medium: &medium, scene: self.world, lights: self.lamps };
        let settings = Settings {
            walk: paths,
            lights: self.wanted,
            candidates: 1,
            seed: self.run,
            ..Settings::for_outline(&Outline::of(&lit, bounds))
        };
        let threads = Threads::new(0)?;
        let mut pilot = vpl::VplPass::pilot(&settings, Sequence::LowDiscrepancy);
        threads::run(&mut pilot, &lit, &threads, &Control::default(), None, |_| {});
        let mut pass = vpl::VplPass::new(&pilot.settings_for_lights(), 0, Sequence::LowDiscrepancy, &[]);
        threads::run(&mut pass, &lit, &threads, &Control::default(), None, |_| {});
        let lights = pass.finish()?;
        // The lamps are off: what comes straight from them is the same for all strategies.
        let world = LitWorld { lights: (&[]).into(), ..lit };
        let gatherer = Gatherer { world, bound, compensation: Some(self.compensation), has_mirrors: false };
        let eye = EyeSettings { single: 1, primary: 1, ..EyeSettings::new(paths) };
        let camera = self.world.camera_for(self.film.width(), self.film.height());
        let size = Vec2::new(self.film.width() as f32, self.film.height() as f32);
        let outcome = tiles::render(self.film, self.settings, &Control::default(), |sample, rng, layers| {
            let at = Vec2::new(sample.x as f32, sample.y as f32) + uniform2(rng);
            let seen = vpl::radiance(&camera.ray(at / size), &gatherer, lights.as_slice(), 1.0, &eye, rng);
            layers[0] = seen.compensated.into_iter().sum();
        })?;
        Ok(outcome.seconds.cpu.unwrap_or(outcome.seconds.wall))
    }
}

/// Means over the runs: relative errors against the same lights' converged 1-to-N.
struct Point {
    samples: u32,
    cpu: f64,
    squared: f64,
    /// Of the first run.
    image: Image,
}

/// `floor + noise/t`: what a strategy's squared error does over time. Locally homogeneous ones have a floor.
struct Law {
    floor: f64,
    noise: f64,
}

impl Law {
    /// Through `points`, above a floor that is known.
    fn fitted(points: &[Point], floor: f64) -> Self {
        let noise =
            points.iter().map(|p| p.cpu * (p.squared - floor).max(0.0)).sum::<f64>() / points.len().max(1) as f64;
        Self { floor, noise }
    }

    fn error(&self, time: f64) -> f64 {
        (self.floor + self.noise / time).sqrt()
    }

    /// Time for this error; none is enough for one below the floor.
    fn time(&self, error: f64) -> Option<f64> {
        let rest = error * error - self.floor;
        (rest > 0.0).then(|| self.noise / rest)
    }
}

/// All there is to tell of one.
struct Strategy {
    name: &'static str,
    colour: &'static str,
    points: Vec<Point>,
    law: Law,
    /// Bias of the converged picture.
    brighter: f64,
}

/// The section of the page.
pub(super) fn section(plan: &Plan) -> Result<String, Failure> {
    let (edge, lights, judging) = (32, 128, 32);
    let (runs, counts): (u64, &[u32]) = if plan.quick { (1, &[1, 2, 4]) } else { (10, &[1, 2, 4, 8]) };
    let scene = SceneFile::read(&rendered::scene_of(plan, "smoke"))?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    let lamps = world.lights();
    let render = |compensation: Compensation, run: u64, samples: u32, seed: u64| -> Result<(Image, f64), Failure> {
        let mut film = Film::new(edge, edge, &["compensation"])?;
        let settings = tiles::Settings { samples, seed, threads: plan.threads, ..tiles::Settings::default() };
        let paths = path_settings(&scene, None);
        let job = Job {
            world: &world,
            lamps: (&lamps).into(),
            paths,
            wanted: lights,
            run,
            film: &mut film,
            settings: &settings,
            compensation,
        };
        let cpu = world.media().with(job)?;
        Ok((film.mean(0).ok_or("no picture")?, cpu))
    };
    let reference = STRATEGIES[0].2;
    let judges = (0..runs).map(|run| {
        plan.say(&format!("figure 6, the truth of run {run}"));
        Ok(Judges::new([render(reference, run, judging, 101)?.0, render(reference, run, judging, 102)?.0]))
    });
    let judges: Vec<Judges> = judges.collect::<Result<_, Failure>>()?;
    let first = judges.first().ok_or("no runs")?;
    let share = 1.0 / runs as f64;
    let mut all = Vec::new();
    for (name, colour, compensation) in STRATEGIES {
        plan.say(&format!("figure 6, {name}"));
        let mut points = Vec::new();
        for samples in counts {
            let (mut cpu, mut squared, mut images) = (0.0, 0.0, Vec::new());
            for (run, judges) in (0..).zip(&judges) {
                let (image, spent) = render(compensation, run, *samples, 1)?;
                cpu += spent * share;
                squared += judges.rel_mse(&image) * share;
                images.push(image);
            }
            points.push(Point { samples: *samples, cpu, squared, image: images.swap_remove(0) });
        }
        let (mut floor, mut brighter) = (0.0, 0.0);
        // All others converge to the same.
        if compensation.flights == Flights::LocallyHomogeneous {
            for (run, judges) in (0..).zip(&judges) {
                let long = [render(compensation, run, judging, 201)?.0, render(compensation, run, judging, 202)?.0];
                floor += judges.common([&long[0], &long[1]]) * share;
                brighter += long.iter().map(|image| 0.5 * judges.bias(image)).sum::<f64>() * share;
            }
        }
        let law = Law::fitted(&points, floor.max(0.0));
        all.push(Strategy { name, colour, points, law, brighter });
    }
    // Those nearest in time to the first strategy's.
    let target = all[0].points[counts.len() / 2].cpu;
    let apart = |p: &Point| (p.cpu / target).ln().abs();
    let chosen = all.iter().filter_map(|one: &Strategy| one.points.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))));
    let mut images: Vec<Image> = chosen.map(|point| point.image.clone()).collect();
    let truth = first.mean();
    let gain = 0.6 * rendered::gain(&truth);
    images.push(truth);
    montage::save(&plan.output.join("fig-06-strategies.png"), &strip(4, &images, gain)?, 0.0)?;
    let reached = all[0].law.time(AIM).ok_or("1-to-N never gets there")?;
    let mut table = format!(
        "| strategy | time per sample | relRMSE after {target:.2} s | after {reached:.0} s | time for {} | never below | brighter than 1-to-N \
         |\n|---|---|---|---|---|---|---|\n",
        percent(AIM)
    );
    for Strategy { name, points, law, brighter, .. } in &all {
        let Some(last) = points.last() else { continue };
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "| {name} | {:.3} s | {} | {} | {} | {} | {} |",
            last.cpu / f64::from(last.samples),
            percent(law.error(target)),
            percent(law.error(reached)),
            law.time(AIM).map_or("never".to_owned(), |time| format!("{time:.1} s")),
            percent(law.floor.sqrt()),
            percent(*brighter),
        );
    }
    let points = || all.iter().flat_map(|one| &one.points);
    let range = |of: fn(&Point) -> f64| {
        [points().map(of).fold(f64::INFINITY, f64::min) / 1.15, points().map(of).fold(0.0, f64::max) * 1.15]
    };
    let line = |one: &Strategy| Line {
        name: one.name,
        colour: one.colour,
        width: 1.6,
        points: one.points.iter().map(|p| [p.cpu, p.squared.sqrt()]).collect(),
    };
    let plot = Plot {
        across: "processor time (s)",
        upwards: "relRMSE",
        x: range(|p| p.cpu),
        y: range(|p| p.squared.sqrt()),
        lines: all.iter().map(line).collect(),
    };
    plan.write("fig-07-errors.svg", &plot.svg_over_decades())?;
    Ok(format!(
        "## Figs 6 and 7: strategies of compensation\n\n![compensation](fig-06-strategies.png)\n\nWhat two steps of compensation add for \
         about {lights} virtual lights in smoke (`smoke.xml`, {edge} × {edge} pixels), with about {target:.2} s of processor time, as near as \
         measured numbers of samples get; light that comes straight from the lamps left out. From left to right: 1-to-N, one path for all \
         lights; N-to-1, a path for each from one point; 1-to-1, a point and a path for each; the same in media taken as even around each \
         point; the same by fours, as `--compensation abc` does it; and the mean of two converged 1-to-N, {judging} samples per pixel \
         each, of the same virtual lights, which stand in for the truth such that their noise cancels. Each sample here sees all lights; \
         the program deals them out to the samples of a pass. Clamped light is gathered at the same points and is in the \
         times. Errors are means of {runs} {}, each with virtual lights of its own.\n\n{table}\nTimes and errors that were not measured \
         follow from `error² = floor² + noise/t` through those that were; 1-to-N has {} after {reached:.0} s. Floors are estimated from two \
         pictures of {judging} samples in each run, and rough where there is one run.\n\n![error by \
         time](fig-07-errors.svg)\n\nrelRMSE by processor time, with {} samples per pixel. The mean of the truth is {:.3} \
         W·m⁻²·sr⁻¹.\n\n",
        if runs == 1 { "run" } else { "runs" },
        percent(AIM),
        counts.iter().map(u32::to_string).collect::<Vec<_>>().join(", "),
        mean(&first.mean()),
    ))
}
