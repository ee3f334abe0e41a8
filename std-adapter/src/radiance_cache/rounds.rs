//! Where records are needed, rounds of new ones, and better estimates for old ones.

use fogbow::cache::{
    Cache, Estimator, EyeSettings, Facing, Guide, Guided, Looks, Place, Reading, Record, SurfaceCache, VolumeCache,
    clamp_gradient, clearance, places,
};
use fogbow::host::{Medium, Scene};
use fogbow::math::{Ray, Vec3};
use fogbow::sampling::Generator;
use fogbow::sampling::uniform::mix;
use fogbow::sh::Coefficient;
use fogbow::single_scatter::Sums;
use fogbow::spectrum::{Gradient, Spectrum};
use rayon::iter::{IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};

use super::{Effort, RadianceCaches, Settings};
use crate::progress::Control;

/// Rays of the first batch; each next one has twice as many, up to [`LAST_BATCH`].
const FIRST_BATCH: u32 = 64;

/// See [`FIRST_BATCH`].
const LAST_BATCH: u32 = 4096;

/// Fills caches for what one camera sees.
pub(super) struct Filler<'a, M: ?Sized, S: ?Sized, F> {
    pub(super) settings: &'a Settings,
    pub(super) estimator: &'a Estimator<'a, M, S>,
    pub(super) eye: &'a EyeSettings,
    pub(super) pixel: f32,
    pub(super) control: &'a Control<'a>,
    pub(super) eye_ray: &'a F,
}

/// A place, and how far the eye is.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    pub(super) place: Place,
    distance: f32,
}

/// What a cache of either kind needs to be filled.
pub(super) trait Fill: Sync {
    /// What a record has besides.
    type Attached: Send;
    fn is_covered(&self, place: &Place, reading: &Reading) -> bool;
    fn guess(&self, place: &Place) -> Option<f32>;
    fn add(&mut self, record: Record, attached: Self::Attached) -> bool;
    fn count(&self) -> usize;
    fn finish(&mut self);
    fn record(&self, number: usize) -> (Place, f32);
    /// Calls `visit(number, weight)` for the records that reach `point`.
    fn visit_near(&self, point: Vec3, visit: impl FnMut(usize, f32));
    /// Value and gradient of a record.
    fn light(&self, number: usize) -> (Spectrum, Gradient);
    /// Mixes what a record has besides into `new`, of which the share `share` stays.
    fn mix_into(&self, number: usize, new: &mut Self::Attached, share: f32);
    fn replace(&mut self, number: usize, value: Spectrum, gradient: &Gradient, attached: &Self::Attached);
}

impl Fill for VolumeCache<'_> {
    type Attached = Vec<Coefficient>;
    fn is_covered(&self, place: &Place, reading: &Reading) -> bool {
        self.covers(place.point, reading)
    }
    fn guess(&self, place: &Place) -> Option<f32> {
        self.radius_near(place.point)
    }
    fn add(&mut self, record: Record, higher: Vec<Coefficient>) -> bool {
        // An estimate that is no number is left out; storage that grows is never full.
        self.insert(record, &higher).is_ok()
    }
    fn count(&self) -> usize {
        self.len()
    }
    fn finish(&mut self) {
        let _ = Cache::finish(self);
    }
    fn record(&self, number: usize) -> (Place, f32) {
        let record = &self.records()[number];
        (Place { point: record.position, normal: None, is_seen: true }, record.radius)
    }
    fn visit_near(&self, point: Vec3, mut visit: impl FnMut(usize, f32)) {
        self.visit(point, |number, _, share| visit(number as usize, 1.0 - share));
    }
    fn light(&self, number: usize) -> (Spectrum, Gradient) {
        (self.records()[number].value, self.records()[number].gradient)
    }
    fn mix_into(&self, number: usize, new: &mut Vec<Coefficient>, share: f32) {
        for (new, old) in new.iter_mut().zip(self.attached(number as u32)) {
            new.value = new.value * share + old.value * (1.0 - share);
            new.gradient = new.gradient * share + old.gradient * (1.0 - share);
        }
    }
    fn replace(&mut self, number: usize, value: Spectrum, gradient: &Gradient, higher: &Vec<Coefficient>) {
        // What is no number leaves the record as it was.
        let _ = self.revise(number as u32, value, gradient, higher);
    }
}

impl Fill for SurfaceCache<'_> {
    type Attached = Facing;
    fn is_covered(&self, place: &Place, reading: &Reading) -> bool {
        place.normal.is_none_or(|normal| self.covers(place.point, normal, reading))
    }
    fn guess(&self, place: &Place) -> Option<f32> {
        self.radius_near(place.point)
    }
    fn add(&mut self, record: Record, facing: Facing) -> bool {
        self.insert(record, &[facing]).is_ok()
    }
    fn count(&self) -> usize {
        self.len()
    }
    fn finish(&mut self) {
        let _ = Cache::finish(self);
    }
    fn record(&self, number: usize) -> (Place, f32) {
        let record = &self.records()[number];
        let normal = self.attached(number as u32).first().map(|facing| facing.normal);
        (Place { point: record.position, normal, is_seen: false }, record.radius)
    }
    fn visit_near(&self, point: Vec3, mut visit: impl FnMut(usize, f32)) {
        self.visit(point, |number, _, share| visit(number as usize, 1.0 - share));
    }
    fn light(&self, number: usize) -> (Spectrum, Gradient) {
        (self.records()[number].value, self.records()[number].gradient)
    }
    fn mix_into(&self, number: usize, new: &mut Facing, share: f32) {
        if let Some(old) = self.attached(number as u32).first() {
            new.turn = new.turn * share + old.turn * (1.0 - share);
        }
    }
    fn replace(&mut self, number: usize, value: Spectrum, gradient: &Gradient, facing: &Facing) {
        let _ = self.revise(number as u32, value, gradient, &[*facing]);
    }
}

/// An estimate for a record, and what it learnt of where light comes from.
pub(super) struct Estimate<A> {
    sums: Sums,
    attached: A,
    learnt: Guide,
    /// How many times the samples of a usual one it took.
    effort: f32,
}

/// Mixes new estimates, of which the share `share` stays, or more where they took more samples, into the records from a
/// number on, and adds to what was learnt; how many.
pub(super) fn blend<C: Fill>(
    cache: &mut Option<C>,
    effort: Option<Effort>,
    from: usize,
    estimates: Vec<Estimate<C::Attached>>,
    guides: &mut [Guide],
    share: f32,
) -> u64 {
    let (Some(cache), Some(effort)) = (cache, effort) else { return 0 };
    let count = estimates.len() as u64;
    for (i, Estimate { sums, mut attached, learnt, effort: more }) in estimates.into_iter().enumerate() {
        // Within its radius a record changes by a factor of e to the tolerance at most.
        let number = from + i;
        let share = 1.0 - (1.0 - share) / more;
        let reach = cache.record(number).1 / effort.tolerance;
        let (value, gradient) = cache.light(number);
        let new = clamp_gradient(&sums.gradient, sums.value, reach);
        cache.mix_into(number, &mut attached, share);
        cache.replace(
            number,
            sums.value * share + value * (1.0 - share),
            &(new * share + gradient * (1.0 - share)),
            &attached,
        );
        if let Some(guide) = guides.get_mut(i) {
            guide.merge(&learnt, 1.0);
        }
    }
    count
}

/// Streams of random numbers of the caches that all others stand on.
pub(super) const COARSE: [u64; 2] = [4, 5];

/// Of those, so many first records get so many times the samples: what they have wrong nothing averages out.
const FIRST: (u64, u32) = (100, 8);

/// Most samples of an estimate whose samples vary more than usual, as a multiple.
const MOST_SAMPLES: f32 = 4.0;

/// Eye rays from whose points others are followed to what lights them. More find small things that are seen; light is
/// sums over all that is met, small things included.
const LIGHTING: u32 = 16384;

/// Records of which nothing usual can be said.
const FEW: usize = 64;

/// The radius of the records around a point of a line, in the mean: `Σ R²/Σ R` (m); none of few.
fn usual_radius<C: Fill>(cache: &C) -> f32 {
    if cache.count() < FEW {
        return 0.0;
    }
    let radii = (0..cache.count()).map(|number| cache.record(number).1);
    let (sum, squares) = radii.fold((0.0, 0.0), |(sum, squares), radius| (sum + radius, squares + radius * radius));
    squares / sum
}

/// Samples for a record that reaches `radius` (m): what reaches less far than `usual` lights fewer pixels. If one sample is
/// as noisy everywhere, the noise of a picture whose records light areas `R²` is least, for a given sum of samples, where
/// these go as `R`. No fewer than a quarter, because dark corners are where that is not so.
fn samples(effort: &Effort, radius: f32, usual: f32) -> u32 {
    let share = if radius < usual { (radius / usual).max(0.25) } else { 1.0 };
    ((effort.samples as f32 * share) as u32).max(16)
}

impl<M, S, F> Filler<'_, M, S, F>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
    F: Fn([f32; 2]) -> Ray + Sync,
{
    /// Estimates for all records from a number on, each guided by what those around it have learnt; with more samples
    /// where these have a relative variance above `spread`.
    pub(super) fn estimates<C: Fill>(
        &self,
        cache: &Option<C>,
        effort: Option<Effort>,
        from: usize,
        stream: u64,
        spread: f32,
        guides: &[Guide],
        compute: impl Fn(&C, Looks<'_>, &Place, &mut Generator) -> (Sums, C::Attached) + Sync,
    ) -> Vec<Estimate<C::Attached>> {
        let (Some(cache), Some(effort)) = (cache, effort) else { return Vec::new() };
        if self.control.is_cancelled() {
            return Vec::new();
        }
        let seed = mix(self.settings.seed ^ mix(stream + 16));
        let usual = 1.5 * usual_radius(cache);
        let estimate = |number: usize| {
            let (place, radius) = cache.record(number);
            let mut around = Guide::default();
            cache.visit_near(place.point, |other, weight| {
                if let Some(guide) = other.checked_sub(from).and_then(|i| guides.get(i)) {
                    around.merge(guide, weight);
                }
            });
            let (guide, mut learnt) = (Guided::new(&around), Guide::default());
            let more = (around.relative_variance() / spread).clamp(1.0, MOST_SAMPLES);
            let count = (samples(&effort, radius, usual) as f32 * more) as u32;
            let looks = Looks { count, guide: guide.as_ref(), learnt: Some(&mut learnt) };
            let (sums, attached) = compute(cache, looks, &place, &mut Generator::new(seed ^ number as u64));
            Estimate { sums, attached, learnt, effort: more }
        };
        (from..cache.count()).into_par_iter().map(estimate).collect()
    }

    /// Every place that eye rays ask for and `caches` do not cover, in batches from coarse to fine.
    pub(super) fn all_places(&self, caches: &RadianceCaches) -> Vec<Vec<Wanted>> {
        let (mut batches, mut from, mut size) = (Vec::new(), 0, FIRST_BATCH);
        while from < self.settings.rays {
            let until = self.settings.rays.min(from + size);
            let found: Vec<Vec<Wanted>> =
                (from..until).into_par_iter().map(|number| self.places_of(number, caches)).collect();
            batches.push(found.concat());
            from = until;
            size = LAST_BATCH.min(size * 2);
        }
        batches
    }

    fn places_of(&self, number: u32, caches: &RadianceCaches) -> Vec<Wanted> {
        // The plane filled evenly by multiples of the plastic number (Roberts 2018).
        let turn = |step: f64| {
            let x = 0.5 + step * f64::from(number + 1);
            (x - x.floor()) as f32
        };
        let ray = (self.eye_ray)([turn(0.754_877_666_246_692_8), turn(0.569_840_290_998_053_3)]);
        let mut rng = Generator::new(mix(self.settings.seed ^ 0x70_1a_ce) ^ u64::from(number));
        let mut found = Vec::new();
        // Surfaces that light a place come right after it, and are of no use if nothing is made there.
        let mut is_open = false;
        places(&ray, &self.estimator.world, self.eye, &mut rng, |place| {
            if place.is_seen {
                is_open = !self.is_covered(caches, &place);
            }
            if !is_open || (!place.is_seen && number >= LIGHTING) {
                return;
            }
            found.push(Wanted { place, distance: place.point.distance(ray.origin) });
        });
        found
    }

    /// Covers all places, round by round; how many records were computed.
    pub(super) fn rounds<C: Fill>(
        &self,
        cache: &mut C,
        effort: &Effort,
        stream: u64,
        batches: &[Vec<Wanted>],
        is_for: impl Fn(&Place) -> bool,
        guides: &mut Vec<Guide>,
        compute: impl Fn(&C, Looks<'_>, &Place, &mut Generator) -> (Sums, C::Attached) + Sync,
    ) -> u64 {
        let reading = Reading { margin: self.settings.margin, ..self.settings.reading(effort) };
        // Records added later must not share the random numbers of the first.
        let start = if cache.count() == 0 { 0 } else { mix(cache.count() as u64) };
        let mut computed = 0_u64;
        for batch in batches {
            let mut open: Vec<Wanted> = batch.iter().filter(|wanted| is_for(&wanted.place)).copied().collect();
            loop {
                let frozen = &*cache;
                open = open.into_par_iter().filter(|wanted| !frozen.is_covered(&wanted.place, &reading)).collect();
                if open.is_empty() || self.control.is_cancelled() {
                    break;
                }
                let chosen = self.choose(frozen, effort, &open);
                // Of a new record only the bound of its radius is known: twice as strict with it as with radii.
                let usual = 3.0 * usual_radius(frozen);
                let numbered: Vec<(u64, Wanted)> =
                    chosen.into_iter().enumerate().map(|(i, w)| (start.wrapping_add(computed + i as u64), w)).collect();
                computed += numbered.len() as u64;
                let records: Vec<(Place, Option<Record>, C::Attached, Guide)> = numbered
                    .par_iter()
                    .map(|(number, Wanted { place, distance })| {
                        let (least, most) = self.settings.pixels;
                        let limits = effort
                            .limits
                            .on_screen(least, most, self.pixel, *distance)
                            .within(self.reach(effort, place));
                        let is_first = COARSE.contains(&stream) && start == 0 && *number < FIRST.0;
                        let count = samples(effort, limits.max, usual) * if is_first { FIRST.1 } else { 1 };
                        let mut learnt = Guide::default();
                        let looks = Looks { count, guide: None, learnt: Some(&mut learnt) };
                        let seed = mix(self.settings.seed ^ mix(stream + 1)) ^ number;
                        let (sums, attached) = compute(frozen, looks, place, &mut Generator::new(seed));
                        (*place, Record::new(place.point, &sums, effort.tolerance, limits), attached, learnt)
                    })
                    .collect();
                let mut added = 0;
                for (place, record, attached, learnt) in records {
                    if let Some(record) = record
                        && !cache.is_covered(&place, &reading)
                        && cache.add(record, attached)
                    {
                        guides.push(learnt);
                        added += 1;
                    }
                }
                // Places where nothing can be stored must not be asked for again and again.
                if added == 0 {
                    break;
                }
            }
        }
        cache.finish();
        computed
    }

    /// How far a record may reach because of surfaces near it.
    fn reach(&self, effort: &Effort, place: &Place) -> f32 {
        if effort.clearance == f32::INFINITY {
            return f32::INFINITY;
        }
        let distance = clearance(place.point, place.normal, self.estimator.world.scene);
        (effort.clearance * distance).max(self.estimator.finest)
    }

    /// The places of one round: the first open ones that are not too close to each other.
    fn choose<C: Fill>(&self, cache: &C, effort: &Effort, open: &[Wanted]) -> Vec<Wanted> {
        let mut chosen: Vec<(Wanted, f32)> = Vec::new();
        for wanted in open {
            if chosen.len() >= self.settings.round as usize {
                break;
            }
            let near = |(other, radius): &(Wanted, f32)| {
                let same_side = match (wanted.place.normal, other.place.normal) {
                    (Some(a), Some(b)) => a.dot(b) > 0.7,
                    _ => true,
                };
                same_side && other.place.point.distance_squared(wanted.place.point) < radius * radius
            };
            if chosen.iter().any(near) {
                continue;
            }
            let guess = cache.guess(&wanted.place).unwrap_or(0.5 * effort.limits.max);
            chosen.push((*wanted, guess * (1.0 - self.settings.margin)));
        }
        chosen.into_iter().map(|(wanted, _)| wanted).collect()
    }
}
