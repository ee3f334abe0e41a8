//! Estimates for records, new ones and anew: how many samples each gets, and in how many jobs.

use super::{Filling, Round};
use crate::cache::asked::{Asked, Wanted};
use crate::cache::guide::{Guide, Guided, Looks};
use crate::cache::kind::{Kind, Pass, Step};
use crate::cache::memory::{Estimate, FilledRecords, FillingMemory};
use crate::cache::noise::{DARK, regions_in};
use crate::cache::presets::LEAST_SAMPLES;
use crate::cache::radius::Limits;
use crate::cache::slot::{learnt_around, learnt_near};
use crate::cache::{Effort, Record};
use crate::host::{Medium, Scene};
use crate::math::{Vec3, float};
use crate::sampling::Generator;
use crate::sampling::uniform::mix;
use crate::sh::Coefficient;
use crate::storage::Full;
use crate::world::World;

/// The first rounds of records of kinds on which all others stand get so many times the samples: what they have wrong nothing
/// averages out.
const FIRST: (u64, u32) = (100, 8);

/// Most samples of an estimate whose samples vary more than usual, as a multiple.
const MOST_SAMPLES: f32 = 8.0;

/// Jobs of an estimate at most.
pub(in crate::cache) const MOST_PARTS: usize = MOST_SAMPLES as usize;

/// Records of which nothing usual can be said.
const FEW: usize = 64;

/// Share of the samples of a record that is hardly seen at all. Less: it is too noisy to tell how far it reaches.
const LEAST_SEEN: f32 = 0.0625;

/// Brightness (over that of usual records) from which on least radii on the screen no longer shrink. Less: light of ledges two pixels wide lies
/// half a pixel off; more: records that no pixel resolves.
const BRIGHTEST: f32 = 3.0;

/// Samples that an estimate would get by what is known now, over those that it has, from which on it is in doubt: a sample has been met that hardly any
/// of the first ones had foretold. Less: time for chance; more: single records that a rare sample makes far too bright.
const DOUBT: f32 = 2.0;

/// The same of records on which all others stand, by what all around them have met. Less: time; more: single ones light all fog around them.
const DOUBT_OF_GROUND: f32 = 4.0;

/// Brightness (over that of usual records) below which noise counts as if a record were that bright, as a picture's does. Larger: noise in dark parts; smaller: time
/// for what no eye sees, which in dense fog is most of it, for there light is hardest to find.
const DIM: f32 = DARK as f32;

/// Records that reach less far than usual take a share of the samples down to this.
const LEAST_SHARE: f32 = 0.25;

/// Random numbers of a part of the samples of an estimate.
fn stream_of(part: u32) -> u64 {
    u64::from(part) << 40
}

/// The radius of the records that reach a point, in the mean over the points of a line: `Σ R²/Σ R` (m); 0 of few records.
pub(super) fn usual_radius(records: &[Record]) -> f32 {
    if records.len() < FEW {
        return 0.0;
    }
    let sums =
        |(sum, squares): (f32, f32), record: &Record| (sum + record.radius, squares + record.radius * record.radius);
    let (sum, squares) = records.iter().fold((0.0, 0.0), sums);
    squares / sum
}

/// Bounds of the radius of a record so many times as bright as usual, in a world whose own least radius is `least` (m): on the screen
/// it may reach as many times less far, because what a small bright thing has wrong is seen as far more than what a dark corner has wrong.
pub(super) fn where_bright(limits: Limits, least: f32, brightness: f32) -> Limits {
    // NaN, where there are no records yet or only black ones, is not bright.
    if brightness > 1.0 {
        Limits { min: (limits.min / brightness.min(BRIGHTEST)).max(least), ..limits }
    } else {
        limits
    }
}

/// The mean value that a picture is made of, about: `Σ R² L/Σ R²`.
pub(super) fn usual_value(records: &[Record]) -> f32 {
    let add = |(sum, weight): (f32, f32), record: &Record| {
        let area = record.radius * record.radius;
        (sum + area * record.value.mean(), weight + area)
    };
    let (sum, weight) = records.iter().fold((0.0, 0.0), add);
    sum / weight
}

/// Samples for a record that reaches `radius` (m): what reaches less far than `usual` lights fewer pixels. If one sample is
/// as noisy everywhere, the noise of a picture whose records light areas `R²` is least, for a given sum of samples, where
/// these go as `R`. No fewer than a quarter, because dark corners are where that is not so; and of what all else stands on no fewer at all,
/// because records of a corner light each other. Of what is seen through fog or in mirrors a share is as good as all of it.
fn samples(kind: Kind, effort: &Effort, radius: f32, usual: f32, seen: f32) -> u32 {
    let share = if radius < usual && !kind.row().is_ground { (radius / usual).max(LEAST_SHARE) } else { 1.0 };
    ((effort.samples as f32 * share * seen) as u32).max(LEAST_SAMPLES)
}

impl<F> Filling<'_, F> {
    pub(super) fn make<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) {
        let (index, part) = (job / self.parts, job % self.parts);
        let (Some((step, effort)), Some(&(wanted, _))) =
            (self.at_hand(), self.memory.chosen.as_slice().get(index as usize))
        else {
            return;
        };
        let Wanted { place, distance, .. } = self.memory.wanted.as_slice()[wanted as usize];
        let settings = self.settings();
        let limits = match &self.asked {
            Asked::View { pixel, .. } => {
                let [least, most] = settings.pixels.map(|p| p * float::sqrt(settings.coarser[step.kind as usize]));
                effort.limits.on_screen(least, most, *pixel, distance)
            }
            Asked::Box(_) => effort.limits,
        };
        let limits = limits.within(self.reach((step.kind, &effort), &place, world));
        let number = self.first.wrapping_add(self.computed + u64::from(index));
        let seen = if step.kind == Kind::Irradiance { place.share.max(LEAST_SEEN) } else { 1.0 };
        let count = samples(step.kind, &effort, limits.max, self.usual, seen);
        let mut rng = Generator::new(mix(self.seed() ^ mix(step.kind.row().stream + 1)) ^ number ^ stream_of(part));
        let mut estimate = Estimate { number: index, place, limits, effort: 1.0, ..Estimate::default() };
        (estimate.learnt.seen, estimate.learnt.to_eye) = (seen, place.to_eye);
        let looks = Looks { count, guide: None, learnt: None, to_eye: place.to_eye };
        let is_made = self.estimate(step, world, looks, &mut estimate, &mut rng, output);
        output.estimate = is_made.then_some(estimate);
    }

    /// In how many jobs each record of the next round of new ones is estimated.
    pub(super) fn parts_of_new(&self, step: Step) -> u32 {
        let are_first = step.kind.row().is_ground && self.first == 0 && self.computed < FIRST.0;
        if are_first { FIRST.1 } else { 1 }
    }

    /// What is known around a record that is estimated anew, how many times the usual samples it is to have, and their number.
    fn anew(&self, (step, effort): (Step, Effort), number: usize, offset: usize) -> Option<(Guide, f32, u32)> {
        let (slot, guides) = (&self.caches.slots[step.kind], self.memory.guides[step.kind].as_slice());
        let record = slot.records().get(number)?;
        // Doubt of what all else stands on must make nothing darker in the mean.
        let are_alike = step.kind.row().is_ground && matches!(step.pass, Pass::More { .. });
        let learnt = if are_alike { learnt_around } else { learnt_near };
        let around = learnt(slot, guides, self.before[step.kind], record.position);
        // What varies as a whole decides how a picture looks where it is dark, what it varies by how far off the picture is.
        let varies = around.relative_variance() / step.kind.row().spread;
        let brightness = record.value.mean() / self.bright;
        // Written so that NaN, of black records alone, counts as bright.
        let shown = (brightness / DIM).min(1.0);
        // Of its variance.
        let shown = shown * shown;
        let varies = varies * shown;
        // More than in proportion: where samples vary most, few records light a whole dark corner, and nothing averages them out.
        let varies = varies * float::sqrt(varies);
        let more = varies.max(brightness * float::sqrt(varies)).clamp(1.0, MOST_SAMPLES);
        // By the first of them noise is measured, of which little would be seen if they counted less than blind ones.
        let guide = guides.get(offset);
        let more = match step.pass {
            Pass::More { .. } => more * shown.max(LEAST_SEEN),
            Pass::Anew { .. } => 0.5 * more,
            // As many as there are, because halves that count alike tell their noise.
            Pass::Again { .. } if step.kind.row().is_ground => guide.map_or(0.5, |guide| guide.held),
            _ => more,
        };
        let seen = guide.map_or(1.0, |guide| guide.seen);
        let count = samples(step.kind, &effort, record.radius, self.usual, seen) as f32 * more;
        Some((around, more, (count as u32).max(1)))
    }

    /// Whether a record is to be estimated once more: as often as the region asks for it that asks for most, and where samples around it have come to
    /// vary by much more than they did when their number was chosen. Not where memory is too small: what cannot be kept would be in doubt for ever.
    fn is_due(&self, kind: Kind, offset: usize, effort: f32) -> bool {
        let default = Guide::default();
        let guide = self.memory.guides[kind].as_slice().get(offset).unwrap_or(&default);
        let asked = regions_in(guide.film).map(|region| self.more[kind][region]).max().unwrap_or(0);
        let doubt = if kind.row().is_ground { DOUBT_OF_GROUND } else { DOUBT };
        asked >= self.again || !self.is_cut && effort > doubt * guide.held
    }

    /// Begins a round in which records from a number on are estimated anew, those with many samples by several jobs; whether there are any.
    pub(super) fn begin_again(&mut self, (step, effort): (Step, Effort), from: usize) -> bool {
        let records = self.caches.slots[step.kind].records();
        // Half as far again as usual reach those that most pixels see: they alone get all samples.
        self.usual = 1.5 * usual_radius(records);
        self.bright = usual_value(records);
        let is_more = matches!(step.pass, Pass::More { .. });
        self.memory.estimates.clear();
        self.memory.higher.clear();
        self.memory.open.clear();
        for offset in 0..records.len() - from {
            let Some((_, more, samples)) = self.anew((step, effort), from + offset, offset) else { continue };
            if is_more && !self.is_due(step.kind, offset, more) {
                continue;
            }
            for _ in 0..samples.div_ceil(effort.samples.max(1)).max(1) {
                self.is_cut |= self.memory.open.push(offset as u32).is_err();
            }
        }
        let jobs = self.memory.open.len() as u32;
        self.enter(Round::Again { from: from as u32 }, jobs);
        jobs > 0
    }

    pub(super) fn again<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        from: u32,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) {
        let Some((step, effort)) = self.at_hand() else { return };
        let stream = match step.pass {
            Pass::Anew { stream } | Pass::Again { stream } => stream,
            Pass::More { stream } => stream + u64::from(self.again),
            Pass::Make | Pass::Smooth => return,
        };
        let open = self.memory.open.as_slice();
        let Some(&offset) = open.get(job as usize) else { return };
        let is_same = |other: &&u32| **other == offset;
        let part = open[..job as usize].iter().rev().take_while(is_same).count() as u32;
        let parts = part + open[job as usize..].iter().take_while(is_same).count() as u32;
        let number = (from + offset) as usize;
        let slot = &self.caches.slots[step.kind];
        let (Some(place), Some((around, more, samples))) =
            (slot.place(number), self.anew((step, effort), number, offset as usize))
        else {
            return;
        };
        let guide = Guided::new(&around);
        let to_eye = self.memory.guides[step.kind]
            .as_slice()
            .get(offset as usize)
            .and_then(|guide| guide.to_eye)
            .or(place.to_eye);
        let count = samples / parts + u32::from(part < samples % parts);
        let mut rng = Generator::new(mix(self.seed() ^ mix(stream + 16)) ^ number as u64 ^ stream_of(part));
        let mut estimate = Estimate { number: offset, place, effort: more, ..Estimate::default() };
        let looks = Looks { count, guide: guide.as_ref(), learnt: None, to_eye };
        let is_made = self.estimate(step, world, looks, &mut estimate, &mut rng, output);
        output.estimate = is_made.then_some(estimate);
    }

    /// Keeps an estimate, or mixes it with the parts of the same that are there; whether there was room.
    pub(super) fn keep(&mut self, estimate: &Estimate, higher: &[Coefficient]) -> Result<(), Full> {
        let FillingMemory { estimates, higher: all, .. } = &mut self.memory;
        if let Some(last) = estimates.as_mut_slice().last_mut().filter(|last| last.number == estimate.number) {
            let share = last.merge(estimate);
            let of_last = all.len().saturating_sub(higher.len());
            for (sum, new) in all.as_mut_slice()[of_last..].iter_mut().zip(higher) {
                sum.value = sum.value * (1.0 - share) + new.value * share;
                sum.gradient = sum.gradient * (1.0 - share) + new.gradient * share;
            }
            return Ok(());
        }
        // Both or none, so that the coefficients of the others stay where they are looked for.
        if all.room() < higher.len() {
            return Err(Full);
        }
        estimates.push(*estimate)?;
        all.extend_from_slice(higher)
    }

    /// The light that a step's kind holds, at one place; `false` if there is no memory for it.
    pub(super) fn estimate<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        step: Step,
        world: &World<'_, M, S>,
        looks: Looks<'_>,
        estimate: &mut Estimate,
        rng: &mut Generator,
        output: &mut FilledRecords<'_>,
    ) -> bool {
        let estimator = self.estimator(world);
        let looks = Looks { learnt: Some(&mut estimate.learnt), ..looks };
        let point = estimate.place.point;
        if step.kind.is_on_surfaces() {
            let normal = estimate.place.normal.unwrap_or(Vec3::Z);
            (estimate.sums, estimate.facing) = estimator.irradiance(point, normal, looks, rng);
            return true;
        }
        if output.higher.reset(self.caches.slots[step.kind].stride(), Coefficient::ZERO).is_err() {
            output.is_cut = true;
            return false;
        }
        let (phase, higher) = (estimator.phase(point), output.higher.as_mut_slice());
        estimate.sums = match step.kind {
            Kind::Single => estimator.single(point, &phase, higher, rng),
            Kind::Surface => estimator.surface(point, &phase, looks, higher, rng),
            _ => estimator.multiple(point, &phase, looks, higher, rng),
        };
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_bright_may_reach_less_far_and_what_is_dark_no_farther() {
        let limits = Limits { min: 0.3, max: 2.0 };
        let least = |least, brightness| {
            let limits = where_bright(limits, least, brightness);
            assert_eq!(limits.max, 2.0);
            limits.min
        };
        assert_eq!([0.0, 0.2, 1.0, f32::NAN].map(|brightness| least(0.01, brightness)), [0.3; 4]);
        assert_eq!([2.0, 3.0, 75.0, f32::INFINITY].map(|brightness| least(0.01, brightness)), [0.15, 0.1, 0.1, 0.1]);
        // The world's bound wins.
        assert_eq!(least(0.2, 75.0), 0.2);
    }
}

#[cfg(all(test, feature = "alloc"))]
pub(super) mod doubted {
    use super::*;
    use crate::cache::kind::{TURNS, Turn};
    use crate::cache::{RadianceCaches, Settings};
    use crate::host::{Hit, Scene};
    use crate::light::Light;
    use crate::math::{Bounds, Ray};
    use crate::medium::{Homogeneous, Placed, Region};
    use crate::phase::Phase;
    use crate::spectrum::Spectrum;
    use crate::surface::Surface;
    use crate::work;
    use crate::world::Outline;

    /// A grey ball around the world, with a window to the sky.
    pub(in crate::cache::fill) struct Shell;

    impl Scene for Shell {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let along = ray.origin.dot(ray.direction);
            let distance = (along * along + 4.0 - ray.origin.length_squared()).sqrt() - along;
            let normal = -ray.at(distance).normalize();
            let is_closed = normal.y > -0.7 && distance < ray.length;
            let surface = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
            is_closed.then_some(Hit { distance, normal, shading: normal, surface, light: None })
        }
    }

    const BRIGHT: f32 = 40.0;
    const SAMPLES: u32 = 64;

    /// By random numbers of a seed, the value of a record of a kind, how many were computed, and how many there are, where its second estimate `is_spoiled` by one sample, and memory too small.
    fn filled(seed: u64, kind: Kind, is_spoiled: bool, is_cut: bool) -> (f32, u64, u64) {
        let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::splat(1.8), Phase::ISOTROPIC).unwrap();
        let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
        let sky = [Light::Constant(Spectrum::ONE)];
        let world = World { medium: &ball, scene: &Shell, lights: (&sky).into() };
        let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
        let settings = Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(SAMPLES);
        let settings = Settings { seed, rays: 256, error: 0.0, photons: None, ..settings };
        let of_kind = |turn: &Turn| matches!(turn, Turn::Of(step) if step.kind == kind);
        let [_, again, more] = core::array::from_fn(|pass| {
            // Second estimates in halves: the second of them.
            let pass = pass + usize::from(kind.row().is_ground);
            TURNS.iter().enumerate().filter(|(_, turn)| of_kind(turn)).nth(pass).unwrap().0
        });
        let mut filling = RadianceCaches::new(settings).fill(Asked::anywhere_in(bounds));
        let mut output = FilledRecords::default();
        while filling.step < again || filling.taken + 1 < filling.jobs {
            assert!(work::step(&mut filling, &world, &mut output));
        }
        if is_spoiled {
            // Of two halves one is spoiled for both.
            let bright = if kind.row().is_ground { 2.0 * BRIGHT - 1.0 } else { BRIGHT };
            let first = &mut filling.memory.estimates.as_mut_slice()[0];
            let value = first.sums.value.mean() * bright * SAMPLES as f32;
            first.sums.value *= bright;
            first.learnt.add(Vec3::Z, value, 1.0, SAMPLES);
        }
        filling.is_cut |= is_cut;
        while filling.step <= more && work::step(&mut filling, &world, &mut output) {}
        let records = filling.caches.slots[kind].records();
        (records[0].value.mean(), filling.computed(kind), records.len() as u64)
    }

    /// An estimate forty times too bright by one of its samples, which no other has foretold, keeps its part of what is estimated anew there, and around it.
    #[test]
    fn what_a_rare_sample_made_bright_is_estimated_once_more() {
        for kind in [Kind::Multiple, Kind::CoarseIrradiance] {
            // One estimate alone may be half as bright again by its own noise.
            let [mut right, mut bright, mut too_bright] = [0.0; 3];
            for seed in 0..4 {
                let all = [(false, false), (true, false), (true, true)];
                let [first, second, third] = all.map(|(spoiled, cut)| filled(seed, kind, spoiled, cut));
                let ((_, usual, records), (_, computed, _), (_, with_little_memory, _)) = (first, second, third);
                let once_more = computed - usual;
                assert!(once_more > 0 && once_more < records / 2, "{kind:?}: {once_more} of {records}");
                assert_eq!(with_little_memory, usual, "{kind:?}");
                (right, bright, too_bright) = (right + first.0, bright + second.0, too_bright + third.0);
            }
            assert!(too_bright > 0.6 * BRIGHT * right, "{kind:?}: {too_bright} {right}");
            assert!(bright > 2.0 * right && bright < 0.25 * BRIGHT * right, "{kind:?}: {bright} {right}");
        }
    }
}
