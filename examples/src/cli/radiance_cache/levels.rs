//! Radiance caching where time is limited: levels of caches, each from the one before, and a picture that gains from all of them.

use std::time::Duration;

use fogbow::cache::{self, CachedRadiance, Caches, LevelPicture, RadianceCaches, Refinement};
use fogbow::host::Medium;
use fogbow::spectrum::Spectrum;
use fogbow_std::film::{Film, Image};
use fogbow_std::stats::Stopwatch;
use fogbow_std::threads::Ending;
use fogbow_std::tiles::{self, Outcome, Reason};

use super::super::covariance::Stopped;
use super::{Audited, Done, Failure, Filled, Measured, Spent, Stages};

/// Layers of a picture on its way where nobody asks for parts: all light, and that of caches.
pub(super) const LAYERS: [&str; 2] = ["total", "cached"];

/// The finest error for which expansions are long enough from the first level on, because they keep their degree. Smaller: coarse levels take longer;
/// larger: what finer ones cannot mend.
const DEGREE_ERROR: f32 = 0.01;

/// Part of the time of a level that a sample of each pixel may take on the way. More: samples from caches that are soon better; less: nobody sees how it goes on.
const ON_THE_WAY: f64 = 0.25;

/// The light that comes from caches.
pub(super) fn cached(seen: &CachedRadiance, caches: &Caches<'_>) -> Spectrum {
    let parts = [
        (caches.irradiance.is_some(), seen.surface_indirect),
        (caches.single.is_some(), seen.medium_single),
        (caches.surface.is_some(), seen.medium_surface),
        (caches.multiple.is_some(), seen.medium_multiple),
    ];
    parts.into_iter().filter(|(is_cached, _)| *is_cached).map(|(_, light)| light).sum()
}

/// A picture on its way: what does not come from caches is the mean of all samples, what does of those from the finest caches.
struct Growing {
    film: Film,
    /// As it was before the caches at hand were read.
    before: Film,
    /// Which layers come from caches.
    cached: Vec<bool>,
    /// What all samples took.
    outcome: Option<Outcome>,
    /// Of one sample of a pixel, once there are two.
    noise: Option<f32>,
}

impl Growing {
    fn new(film: &Film, reader: &Caches<'_>) -> Result<Self, Failure> {
        let has_parts = film.layers().len() > 1;
        let empty = || match has_parts {
            true => Film::new(film.width(), film.height(), film.layers()),
            false => Film::new(film.width(), film.height(), &LAYERS),
        };
        let cached = match has_parts {
            // As parts are written.
            true => vec![
                false,
                false,
                false,
                reader.irradiance.is_some(),
                reader.single.is_some(),
                reader.surface.is_some(),
                reader.multiple.is_some(),
            ],
            false => vec![false, true],
        };
        Ok(Self { film: empty()?, before: empty()?, cached, outcome: None, noise: None })
    }

    /// Adds samples, of which this is what they took.
    fn add(&mut self, more: Outcome) -> Reason {
        let (counters, seconds) = match &self.outcome {
            Some(before) => (before.counters + more.counters, before.seconds + more.seconds),
            None => (more.counters, more.seconds),
        };
        self.outcome = Some(Outcome { counters, seconds, ..more });
        more.reason
    }

    /// The picture.
    fn picture(&self, like: &Film) -> Result<Film, Failure> {
        let (width, height) = (like.width(), like.height());
        let means = |film: &Film| (0..film.layers().len()).filter_map(|layer| film.mean(layer)).collect::<Vec<_>>();
        let (all, before) = (means(&self.film), means(&self.before));
        let mut picture = Film::new(width, height, like.layers())?;
        let mut colours = vec![Spectrum::ZERO; like.layers().len()];
        for (at, y, x) in
            (0..height).flat_map(|y| (0..width).map(move |x| (y, x))).zip(0_usize..).map(|((y, x), at)| (at, y, x))
        {
            let [count, earlier] = [&self.film, &self.before].map(|film| film.count(x, y));
            if count == 0 {
                continue;
            }
            // Of a layer the mean of those samples that count.
            let mean = |layer: usize| {
                let all = all[layer].pixels[at];
                if !self.cached[layer] || count == earlier {
                    return all;
                }
                let [count, earlier] = [f64::from(count), f64::from(earlier)];
                let (kept, gone) = ((count / (count - earlier)) as f32, (earlier / (count - earlier)) as f32);
                all * kept - before[layer].pixels[at] * gone
            };
            let mut total = all[0].pixels[at];
            for layer in 1..self.cached.len() {
                let light = mean(layer);
                total += light - all[layer].pixels[at];
                if let Some(colour) = colours.get_mut(layer) {
                    *colour = light;
                }
            }
            // Differences may round to less than nothing.
            colours[0] = total.max(Spectrum::ZERO);
            picture.add(x, y, &colours);
        }
        Ok(picture)
    }
}

/// Relative noise of one sample of a pixel, of the mean of one and that of two.
fn noise_between(one: &Image, two: &Image) -> f32 {
    let mean = two.pixels.iter().map(|pixel| f64::from(pixel.mean())).sum::<f64>() / two.pixels.len() as f64;
    // Fireflies say nothing of the others.
    let square = |(one, two): (&Spectrum, &Spectrum)| {
        let [one, two] = [one, two].map(|pixel| f64::from(pixel.mean()));
        let light = two * two + 0.01 * mean * mean;
        if light > 0.0 { (2.0 * (two - one) * (two - one) / light).min(4.0) } else { 0.0 }
    };
    let sum: f64 = one.pixels.iter().zip(&two.pixels).map(square).sum();
    (sum / two.pixels.len() as f64).sqrt() as f32
}

impl<M: Medium + Sync> Stages<'_, '_, M> {
    /// Settings of a level.
    fn level(&self, error: f32) -> cache::Settings {
        let mut settings = self.job.settings(&self.outline, error);
        let finer = self.job.settings(&self.outline, error.min(DEGREE_ERROR));
        for kind in cache::Kind::FINAL {
            if let (Some(effort), Some(finer)) = (settings.effort_mut(kind), finer.effort(kind)) {
                effort.degree = finer.degree;
            }
        }
        settings
    }

    /// Takes every pixel to so many samples, or as many as time allows.
    fn sample(
        &self,
        growing: &mut Growing,
        caches: &RadianceCaches<'static>,
        samples: u32,
        time: Duration,
    ) -> Result<Reason, Failure> {
        let one = (growing.film.min_count() == 1).then(|| growing.film.mean(0)).flatten();
        let settings = tiles::Settings { samples, goal: None, time: Some(time), ..*self.job.settings };
        let more = self.picture(&mut growing.film, caches, &settings)?;
        if let (Some(one), Some(two)) = (one, growing.film.mean(0).filter(|_| growing.film.min_count() == 2)) {
            growing.noise = Some(noise_between(&one, &two));
        }
        Ok(growing.add(more))
    }

    /// Levels of caches, each finer than the one before and made from it, and samples of pixels, until the time granted is up or the error asked for is
    /// reached. All time counts.
    pub(super) fn timed(&self, time: Duration, spent: &mut Spent) -> Result<Done, Failure> {
        let (job, clock) = (self.job, Stopwatch::start());
        let left = || time.saturating_sub(Duration::from_secs_f64(clock.elapsed().wall));
        let mut refinement = Refinement::new(job.arguments.error.unwrap_or(cache::ERROR_BOUNDS[0]));
        let mut filling = RadianceCaches::new(self.level(refinement.error())).fill(self.asked());
        let mut growing = Growing::new(job.film, &filling.caches().reader())?;
        let (mut error, mut took_in_all) = (refinement.error(), Duration::ZERO);
        loop {
            let began = left();
            let ending = self.run(&mut filling, Some(refinement.granted(began)), spent);
            if ending != Ending::Done && growing.outcome.is_none() {
                return Err(Stopped("caches").into());
            }
            let took = began.saturating_sub(left());
            took_in_all += took;
            if ending != Ending::Done {
                break;
            }
            error = refinement.error();
            growing.before = growing.film.clone();
            let count = growing.film.min_count();
            let sample = |growing: &Growing| {
                growing.outcome.map_or(0.0, |outcome| outcome.seconds.wall) / f64::from(count.max(1))
            };
            if count == 0 || sample(&growing) <= ON_THE_WAY * took.as_secs_f64() {
                let reason = self.sample(&mut growing, filling.caches(), count + 1, left())?;
                if reason == Reason::Cancelled {
                    break;
                }
            }
            let count = growing.film.min_count();
            let taken = growing.outcome.map_or(0.0, |outcome| outcome.seconds.wall);
            let picture = LevelPicture {
                samples: count - growing.before.min_count(),
                time: Duration::from_secs_f64(taken / f64::from(count.max(1))),
                noise: growing.noise,
                record_noise: filling.record_noise(),
            };
            if !refinement.advance(took, left(), &picture) {
                break;
            }
            filling.refine(self.level(refinement.error()));
        }
        let measured = Measured {
            noise: filling.noise_goal(error, job.film.width() * job.film.height()),
            audit_rays: job.arguments.audit.unwrap_or_else(|| filling.audit_rays()),
        };
        let caches = filling.finish();
        let is_audited = !job.control.is_cancelled() && measured.audit_rays > 0 && job.paths.max_scatterings > 0;
        let time = Refinement::audit_time(took_in_all).min(left());
        let found = is_audited.then(|| self.audit(&caches, measured.audit_rays, Some(time), spent)).flatten();
        let audited = found.map(|(findings, map)| Audited { error, findings, map, repaired: Vec::new() });
        let filled = Filled::new(caches, (Ending::Done, measured), audited);
        // Nothing is as good a use of the rest as less noise; down to the error asked for, if that is what caches are filled for.
        let is_due = job.arguments.error.is_some_and(|due| error <= due);
        let usual = is_due.then(|| filled.usual_goal());
        let samples = job.settings.samples.min(if is_due { cache::MOST_SAMPLES } else { u32::MAX });
        let mut render = growing.outcome;
        if !job.control.is_cancelled() && !left().is_zero() {
            let goal = job.settings.goal.or(usual);
            let settings = tiles::Settings { samples, goal, time: Some(left()), ..*job.settings };
            let more = self.picture(&mut growing.film, &filled.caches, &settings)?;
            growing.add(more);
            render = growing.outcome;
        } else if let Some(render) = &mut render {
            render.reason = if job.control.is_cancelled() { Reason::Cancelled } else { Reason::TimeUp };
        }
        let render = render.ok_or(Stopped("caches"))?;
        Ok(Done { film: growing.picture(job.film)?, filled, render })
    }
}
