//! Radiance caching where time is limited: levels of caches, each from the one before, and a picture that gains from all of them.

use std::time::Duration;

use fogbow::cache::{self, Audit, CachedRadiance, Caches, LevelPicture, RadianceCaches, Refinement};
use fogbow::host::Medium;
use fogbow::spectrum::Spectrum;
use fogbow_std::film::{Film, Image};
use fogbow_std::stats::Stopwatch;
use fogbow_std::threads::Ending;
use fogbow_std::tiles::{self, Outcome, Reason};

use super::super::covariance::Stopped;
use super::{Done, Failure, Filled, Measured, Spent, Stages};

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

/// A picture on its way: what does not come from caches is the mean of all samples. What does is that of samples from the finest caches, and as far as these are few
/// of what was known before.
struct Growing {
    film: Film,
    /// As it was before the caches at hand were read.
    before: Film,
    /// What was known then.
    earlier: Option<Earlier>,
    /// Which layers come from caches.
    cached: Vec<bool>,
    /// What all samples took.
    outcome: Option<Outcome>,
    /// Of one sample of a pixel, once there are two.
    noise: Option<f32>,
}

/// Light as it was known before the caches at hand.
struct Earlier {
    /// Of the layers that come from caches.
    layers: Vec<Option<Image>>,
    /// Variance that samples leave in it, over that of one sample of a pixel.
    variance: f64,
}

/// How much what the caches at hand tell counts beside what was known before: as both together have the least error. In the records that both come from they differ by
/// more than in those that they share.
///
/// ```text
/// share = (l + s² v)/(l + s² v + s²/m)     l = ⟨difference of records²⟩, s² variance of a sample, v what is left of it before, m samples
/// ```
///
/// Of what both differ by, neighbouring pixels share what is due to records, which reach over many, and do not share what is due to samples.
#[derive(Debug, Clone, Copy)]
struct Shares {
    /// `l`.
    records: f64,
    /// `s²`.
    sample: f64,
    /// `v`.
    before: f64,
}

impl Shares {
    /// From what both differ by in pixels with so many samples, relative to their light. Without any difference only the finest caches count.
    fn of(apart: &[f64], samples: &[u32], width: usize, before: f64) -> Self {
        let is_known = |at: usize| samples[at] > 0;
        let (mut all, mut between) = ([0.0; 2], [0.0; 2]);
        for at in (0..apart.len()).filter(|&at| is_known(at)) {
            all = [all[0] + apart[at] * apart[at], all[1] + 1.0];
            if (at + 1) % width != 0 && at + 1 < apart.len() && is_known(at + 1) {
                let step = apart[at + 1] - apart[at];
                let samples = [at, at + 1].map(|at| 1.0 / f64::from(samples[at]) + before);
                between = [between[0] + step * step, between[1] + samples[0] + samples[1]];
            }
        }
        let sample = if between[1] > 0.0 { between[0] / between[1] } else { 0.0 };
        let known = (0..apart.len()).filter(|&at| is_known(at));
        let of_samples: f64 = known.map(|at| sample * (1.0 / f64::from(samples[at]) + before)).sum();
        let records = if all[1] > 0.0 { f64::max(all[0] - of_samples, 0.0) / all[1] } else { 0.0 };
        Self { records, sample, before }
    }

    /// Of the finest caches, where a pixel has so many samples from them.
    fn newest(&self, samples: u32) -> f64 {
        if samples == 0 {
            return 0.0;
        }
        let (old, new) = (self.records + self.sample * self.before, self.sample / f64::from(samples));
        if new > 0.0 { old / (old + new) } else { 1.0 }
    }

    /// Variance that samples leave, over that of one.
    fn variance(&self, samples: u32) -> f64 {
        let newest = self.newest(samples);
        let new = if samples > 0 { newest * newest / f64::from(samples) } else { 0.0 };
        new + (1.0 - newest) * (1.0 - newest) * self.before
    }
}

impl Growing {
    fn new(film: &Film, reader: &Caches<'_>) -> Result<Self, Failure> {
        let has_parts = film.layers().len() > 1;
        let empty = || match has_parts {
            true => Film::new(film.width(), film.height(), film.layers()),
            false => Film::new(film.width(), film.height(), &LAYERS),
        };
        let is_cached = |layer: &String| match layer.as_str() {
            "cached" => true,
            "surface_indirect" => reader.irradiance.is_some(),
            "medium_single" => reader.single.is_some(),
            "medium_surface" => reader.surface.is_some(),
            "medium_multiple" => reader.multiple.is_some(),
            _ => false,
        };
        let film_of_levels = empty()?;
        let cached = film_of_levels.layers().iter().map(is_cached).collect();
        Ok(Self { film: film_of_levels, before: empty()?, earlier: None, cached, outcome: None, noise: None })
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

    /// Finer caches follow.
    fn go_on(&mut self) {
        if self.film.min_count() > 0 {
            let (shares, count) = (self.shares(), self.film.height() * self.film.width());
            let variance = (0..count).map(|at| self.variance(shares.as_ref(), at)).sum::<f64>() / f64::from(count);
            let layers = 0..self.cached.len();
            let layers = layers.map(|layer| Some(self.layer(layer, shares.as_ref())?.1).filter(|_| self.cached[layer]));
            self.earlier = Some(Earlier { layers: layers.collect(), variance });
        }
        self.before = self.film.clone();
    }

    fn variance(&self, shares: Option<&Shares>, at: u32) -> f64 {
        let samples = self.newest(at);
        shares.map_or(1.0 / f64::from(samples.max(1)), |shares| shares.variance(samples))
    }

    /// Samples of a pixel from the finest caches.
    fn newest(&self, at: u32) -> u32 {
        let (x, y) = (at % self.film.width(), at / self.film.width());
        self.film.count(x, y) - self.before.count(x, y)
    }

    /// The picture.
    fn picture(&self, like: &Film) -> Result<Film, Failure> {
        let shares = self.shares();
        let layers = (0..self.film.layers().len()).filter_map(|layer| self.layer(layer, shares.as_ref()));
        let layers: Vec<_> = layers.collect();
        let mut picture = Film::new(like.width(), like.height(), like.layers())?;
        let mut colours = vec![Spectrum::ZERO; like.layers().len()];
        let pixels = (0..like.height()).flat_map(|y| (0..like.width()).map(move |x| (x, y)));
        for (at, (x, y)) in pixels.enumerate().filter(|&(_, (x, y))| self.film.count(x, y) > 0) {
            let moved = |(all, counted): &(Image, Image)| counted.pixels[at] - all.pixels[at];
            let total = layers[0].0.pixels[at] + layers[1..].iter().map(moved).sum::<Spectrum>();
            for (colour, (_, counted)) in colours.iter_mut().zip(&layers) {
                *colour = counted.pixels[at];
            }
            // Differences may round to less than nothing.
            colours[0] = total.max(Spectrum::ZERO);
            picture.add(x, y, &colours);
        }
        Ok(picture)
    }

    /// Means of a layer: of all samples, and of those that count.
    fn layer(&self, layer: usize, shares: Option<&Shares>) -> Option<(Image, Image)> {
        let all = self.film.mean(layer)?;
        if !self.cached[layer] {
            return Some((all.clone(), all));
        }
        let mut counted = self.finest(layer)?;
        let earlier = self.earlier.as_ref().and_then(|earlier| earlier.layers[layer].as_ref());
        if let Some((earlier, shares)) = earlier.zip(shares) {
            for (at, (pixel, earlier)) in (0..).zip(counted.pixels.iter_mut().zip(&earlier.pixels)) {
                let newest = shares.newest(self.newest(at)) as f32;
                *pixel = *pixel * newest + *earlier * (1.0 - newest);
            }
        }
        Some((all, counted))
    }

    /// The mean of a layer, of samples from the finest caches; where there are none, of all.
    fn finest(&self, layer: usize) -> Option<Image> {
        let (mut counted, before) = (self.film.mean(layer)?, self.before.mean(layer)?);
        for (at, (pixel, before)) in (0..).zip(counted.pixels.iter_mut().zip(&before.pixels)) {
            let newest = self.newest(at);
            if newest > 0 {
                let (x, y) = (at % self.film.width(), at / self.film.width());
                let [kept, gone] =
                    [&self.film, &self.before].map(|film| f64::from(film.count(x, y)) / f64::from(newest));
                *pixel = *pixel * kept as f32 - *before * gone as f32;
            }
        }
        Some(counted)
    }

    /// How much the finest caches count, if there were others.
    fn shares(&self) -> Option<Shares> {
        let earlier = self.earlier.as_ref()?;
        let mut apart = vec![0.0; self.film.mean(0)?.pixels.len()];
        for layer in (0..self.cached.len()).filter(|&layer| self.cached[layer]) {
            let (finest, earlier) = (self.finest(layer)?, earlier.layers[layer].as_ref()?);
            let pixels = finest.pixels.iter().zip(&earlier.pixels);
            let step = |(finest, earlier): (&Spectrum, &Spectrum)| f64::from((*finest - *earlier).mean());
            apart.iter_mut().zip(pixels.map(step)).for_each(|(sum, step)| *sum += step);
        }
        let (_, light) = self.sampled()?;
        let width = self.film.width() as usize;
        // Fireflies say nothing of the others.
        let around = squares_around(&light, width);
        let relative = |at: usize| (apart[at] / around(at).sqrt()).clamp(-1.0, 1.0);
        let apart: Vec<f64> = (0..light.len()).map(|at| if apart[at] == 0.0 { 0.0 } else { relative(at) }).collect();
        let samples: Vec<u32> = (0..).take(light.len()).map(|at| self.newest(at)).collect();
        Some(Shares::of(&apart, &samples, width, earlier.variance))
    }

    /// The light of all samples that does not come from caches, and all light.
    fn sampled(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let light = |layer| Some(self.film.mean(layer)?.pixels.iter().map(|pixel| f64::from(pixel.mean())).collect());
        let all: Vec<f64> = light(0)?;
        let mut sampled = all.clone();
        for layer in (0..self.cached.len()).filter(|&layer| self.cached[layer]) {
            sampled.iter_mut().zip(light(layer)?).for_each(|(sum, cached): (&mut f64, f64)| *sum -= cached);
        }
        Some((sampled, all))
    }
}

/// Light around each pixel, in square, with a part of that of the whole picture.
fn squares_around(light: &[f64], width: usize) -> impl Fn(usize) -> f64 {
    /// Pixels to either side over which light is averaged.
    const AROUND: usize = 2;
    let (height, mean) = (light.len() / width, light.iter().sum::<f64>() / light.len() as f64);
    move |at| {
        let (x, y) = (at % width, at / width);
        let rows = y.saturating_sub(AROUND)..(y + AROUND + 1).min(height);
        let columns = x.saturating_sub(AROUND)..(x + AROUND + 1).min(width);
        let count = (rows.len() * columns.len()) as f64;
        let around = rows.flat_map(|y| &light[y * width + columns.start..y * width + columns.end]).sum::<f64>() / count;
        around * around + 0.01 * mean * mean
    }
}

/// Relative noise of one sample of a pixel, of what was sampled by one and by two, and all light.
fn noise_between(one: &[f64], two: &[f64], light: &[f64], width: usize) -> f32 {
    let around = squares_around(light, width);
    let square = |at: usize| {
        let (apart, light) = (two[at] - one[at], around(at));
        // Fireflies say nothing of the others.
        if light > 0.0 { (2.0 * apart * apart / light).min(1.0) } else { 0.0 }
    };
    ((0..light.len()).map(square).sum::<f64>() / light.len() as f64).sqrt() as f32
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
        let one = (growing.film.min_count() == 1).then(|| growing.sampled()).flatten();
        let settings = tiles::Settings { samples, goal: None, time: Some(time), ..*self.job.settings };
        let more = self.picture(&mut growing.film, caches, &settings)?;
        let two = (growing.film.min_count() == 2).then(|| growing.sampled()).flatten();
        if let Some(((one, _), (two, light))) = one.zip(two) {
            growing.noise = Some(noise_between(&one, &two, &light, growing.film.width() as usize));
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
            growing.go_on();
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
        // Time is limited, and nothing is dropped: one look is enough.
        let audit = || Audit::new(&caches, self.rays(), measured.audit_rays);
        let found = is_audited.then(|| self.audit(audit(), Some(time), spent)).flatten();
        let audited = found.map(|found| self.audited(error, found, Vec::new()));
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

#[cfg(test)]
mod tests {
    use fogbow::sampling::{Generator, uniform};

    use super::*;

    fn grey(light: &[f32]) -> Vec<Spectrum> {
        light.iter().map(|&light| Spectrum::splat(light)).collect()
    }

    #[test]
    fn what_is_sampled_is_of_all_samples_and_what_is_cached_of_the_last_caches() {
        let none = Caches { single: None, surface: None, multiple: None, irradiance: None };
        let film = Film::new(2, 1, &["total"]).unwrap();
        let mut growing = Growing::new(&film, &none).unwrap();
        growing.film.add(0, 0, &grey(&[10.0, 4.0]));
        growing.film.add(1, 0, &grey(&[10.0, 4.0]));
        growing.before = growing.film.clone();
        growing.film.add(0, 0, &grey(&[9.0, 1.0]));
        // Of 6 and 8 sampled the mean, and of 4 and 1 cached the last; where there is no other, the first.
        assert_eq!(growing.picture(&film).unwrap().mean(0).unwrap().pixels, grey(&[8.0, 10.0]));
        let (sampled, all) = growing.sampled().unwrap();
        assert_eq!((sampled, all), (vec![7.0, 6.0], vec![9.5, 10.0]));
    }

    /// What two sets of caches and their samples tell of a light of 1: records that reach over a row of pixels, and samples that no pixels share. The mixture has the least error
    /// that any has, and each alone counts where the other is much worse.
    #[test]
    fn caches_and_samples_before_and_now_are_mixed_to_the_least_error() {
        const WIDTH: usize = 256;
        let rng = &mut Generator::new(3);
        let mut even = |deviation: f64| (f64::from(uniform(rng)) - 0.5) * deviation * 12.0_f64.sqrt();
        for (records, sample, before, now) in
            [(0.1, 0.2, 16, 4), (0.02, 0.2, 16, 4), (0.1, 0.02, 1, 1), (0.001, 0.2, 99, 1)]
        {
            // Those of the finest caches are better in what both differ by.
            let of_records: Vec<f64> = (0..WIDTH).map(|_| even(records)).collect();
            let mut of_samples = |count: u32| even(sample / f64::from(count).sqrt());
            let pixels = (0..WIDTH * WIDTH).map(|at| [of_records[at / WIDTH] + of_samples(before), of_samples(now)]);
            let pixels: Vec<_> = pixels.collect();
            let apart: Vec<f64> = pixels.iter().map(|[old, new]| new - old).collect();
            let shares = Shares::of(&apart, &vec![now; apart.len()], WIDTH, 1.0 / f64::from(before));
            let error = |newest: f64| {
                let of = |[old, new]: &[f64; 2]| (newest * new + (1.0 - newest) * old).powi(2);
                pixels.iter().map(of).sum::<f64>() / pixels.len() as f64
            };
            let least = (0..=100).map(|i| error(f64::from(i) / 100.0)).fold(f64::INFINITY, f64::min);
            let share = shares.newest(now);
            assert!(error(share) < 1.05 * least, "{share}: {} instead of {least}", error(share));
            let left = shares.variance(now) * shares.sample + (1.0 - share).powi(2) * shares.records;
            assert!((left / error(share) - 1.0).abs() < 0.1, "{left} told of {}", error(share));
        }
        let same = Shares::of(&[0.0; 8], &[1; 8], 4, 1.0);
        assert_eq!((same.newest(1), same.newest(0)), (1.0, 0.0));
    }

    #[test]
    fn noise_of_a_sample_is_that_between_two() {
        // Means of two samples that differ by 0.2 either way lie 0.1 from the first.
        let apart = |at: usize| if at.is_multiple_of(2) { 0.1 } else { -0.1 };
        let light = vec![1.0; 12];
        let one: Vec<f64> = (0..12).map(|at| 1.0 + apart(at)).collect();
        let noise = noise_between(&one, &light, &light, 4);
        assert!((f64::from(noise) - (0.02_f64 / 1.01).sqrt()).abs() < 1e-6, "{noise}");
        assert_eq!(noise_between(&[0.0; 4], &[0.0; 4], &[0.0; 4], 2), 0.0);
    }
}
