//! A bake with a medium of any type.

use core::cell::Cell;
use std::path::PathBuf;

use fogbow::bake::{
    Bake, BakeError, BakeMemory, BakeSettings, FlightMemory, OneLight, ProbeBasis, ProbeDeviation, ProbeGrid,
    ProbeLevels,
};
use fogbow::cache::{Asked, ERROR_BOUNDS, Kind, RadianceCaches, Settings, USUAL_ERROR};
use fogbow::host::{Medium, Scene};
use fogbow::light::Lights;
use fogbow::math::Bounds;
use fogbow::path;
use fogbow::work::Rounds;
use fogbow::world::{LightCounts, Outline, World as LitWorld};
use fogbow_std::progress::Control;
use fogbow_std::stats::Stopwatch;
use fogbow_std::threads::{self, Threads};

use super::super::covariance::Stopped;
use super::super::render::stop_flag;
use super::super::report::{Bar, Voice};
use super::super::{Ending, Failure};
use super::parts::PartOf;
use super::sequence::Earlier;
use super::{BakeArguments, Source, begun, write};
use crate::world::{WithMedium, World};

/// # Errors
/// Caches of light that they cannot hold.
pub(super) fn check(method: Source, paths: &path::Settings, world: &World<'_>) -> Result<(), Failure> {
    if method == Source::Path {
        return Ok(());
    }
    if world.media().glow() {
        let (name, place) = match method {
            Source::Photons => ("photons", "sends no photons"),
            _ => ("radiance-cache", "is not in caches"),
        };
        return Err(format!("--method {name}: light that a medium emits {place}; take --method path").into());
    }
    if method == Source::RadianceCache && paths.max_scatterings != u32::MAX {
        return Err("--method radiance-cache: caches hold light of paths of any depth, and the scene limits it; \
                    take --method path"
            .into());
    }
    Ok(())
}

/// Bricks of 64 probes that are path traced to tell how far caches are off, at least, and at most. More: a surer word, for more time.
const LEAST_COMPARED: u64 = 4;

/// See [`LEAST_COMPARED`].
const MOST_COMPARED: u64 = 32;

/// A bake, to be done with a medium of any type.
pub(super) struct BakeJob<'a> {
    pub(super) arguments: &'a BakeArguments,
    pub(super) world: &'a World<'a>,
    pub(super) lights: Lights<'a>,
    pub(super) paths: path::Settings,
    pub(super) bounds: Bounds,
    pub(super) counts: [u32; 3],
    pub(super) method: Source,
    pub(super) tag: u64,
    /// The one light that shines; `None` for all.
    pub(super) light: Option<u32>,
    /// The frame before.
    pub(super) earlier: Option<&'a Earlier>,
    /// The mean that errors are in proportion to, if it is given.
    pub(super) level: Option<f32>,
    /// What a part is of.
    pub(super) part: Option<&'a PartOf>,
    /// Where the grid is kept, to be gone on with.
    pub(super) kept: Option<PathBuf>,
    /// Set when it has been.
    pub(super) has_kept: &'a Cell<bool>,
}

impl BakeJob<'_> {
    fn settings(&self, outline: &Outline) -> BakeSettings {
        let usual = BakeSettings::for_outline(outline, self.counts);
        BakeSettings {
            bounds: self.bounds,
            basis: self.arguments.basis(),
            quantity: self.arguments.quantity(),
            orders: self.arguments.orders(),
            error: self.arguments.error.unwrap_or(usual.error),
            most_passes: self.arguments.passes.unwrap_or(usual.most_passes),
            paths: self.paths,
            level: self.level,
            seed: self.arguments.seed,
            ..usual
        }
    }

    fn caches(&self, outline: &Outline) -> RadianceCaches<'static> {
        let [least, most] = ERROR_BOUNDS;
        let error = self.arguments.error.unwrap_or(USUAL_ERROR).clamp(least, most);
        let mut settings = Settings::for_outline(outline, error);
        if let ProbeBasis::SphericalHarmonics { degree } = self.arguments.basis()
            && !outline.phase.is_isotropic()
        {
            // What probes hold must be there to be read.
            for kind in [Kind::Surface, Kind::Multiple] {
                if let Some(effort) = settings.effort_mut(kind) {
                    effort.degree = effort.degree.max(degree as usize);
                }
            }
        }
        RadianceCaches::new(Settings { seed: self.arguments.seed, paths: self.paths, ..settings })
    }
}

impl WithMedium for BakeJob<'_> {
    type Output = Result<Done, Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let all = LitWorld { medium, scene: self.world, lights: self.lights };
        let outline = self.world.outline(&all);
        let Some(number) = self.light else { return self.bake(&all, &outline) };
        let Some(light) = self.lights.get(number as usize) else { return Err("there is no such light".into()) };
        let scene = OneLight { scene: self.world, number };
        let one = LitWorld { medium, scene: &scene, lights: core::slice::from_ref(light).into() };
        let outline = Outline { lights: LightCounts::of(&one.lights), ..outline };
        self.bake(&one, &outline)
    }
}

/// What a bake leaves.
pub(super) struct Done {
    pub(super) levels: ProbeLevels<'static>,
    /// Of the phase function.
    pub(super) mean_cosine: f32,
    /// How far caches are off.
    pub(super) deviation: Option<ProbeDeviation>,
    /// How many bricks are those of the frame before, and how many there are.
    pub(super) kept: Option<[usize; 2]>,
    pub(super) ending: Ending,
}

impl BakeJob<'_> {
    fn bake<M: Medium + Sync, S: Scene + Sync>(
        &self,
        world: &LitWorld<'_, M, S>,
        outline: &Outline,
    ) -> Result<Done, Failure> {
        let pool = Threads::new(self.arguments.threads)?;
        let control = Control { cancel: Some(stop_flag()), ..Control::default() };
        let bar = Bar::new(Voice::unless(self.arguments.quiet));
        let mut caches = None;
        if self.method == Source::RadianceCache {
            let mut filling = self.caches(outline).fill(Asked::anywhere_in(self.bounds));
            let tell = |filling: &_| bar.tell(Rounds::<LitWorld<'_, M, S>>::stage(filling), 0.0);
            let ran = threads::run(&mut filling, world, &pool, &control, None, tell);
            if ran.ending != threads::Ending::Done {
                bar.finish();
                return Err(Stopped("caches").into());
            }
            let mut filled = filling.finish();
            filled.forget_photons();
            caches = Some(filled);
        }
        let settings = self.settings(outline);
        let mut begun = self.begun()?.into_iter();
        let bake = match begun.next() {
            Some(grid) => Bake::resume(grid, settings)
                .map_err(|_| "--resume: the file is of other probes: of another --box, --counts, --basis, --quantity or --orders")?,
            None => match self.arguments.many.part {
                Some((part, of)) => Bake::new(settings)?.of_part(part - 1, of),
                None => Bake::new(settings)?,
            },
        };
        let with_light = |bake: Bake<'static, 'static>| match &caches {
            Some(caches) => bake.with_caches(caches),
            None if self.method == Source::Photons => bake.with_photons(FlightMemory::default(), outline.bounds),
            None => bake,
        };
        let (clock, mut written, mut trouble) = (Stopwatch::start(), 0.0, None);
        let earlier = self.earlier.map_or(&[][..], |earlier| earlier.levels.levels());
        let mut kept = self.earlier.map(|_| [0, 0]);
        // A level, after those that are done.
        let mut bake_level = |bake: Bake<'static, 'static>, done: &[ProbeGrid<'static>]| {
            let mut bake = with_light(bake);
            if let Some(earlier) = earlier.get(done.len()) {
                bake = bake.after(earlier)?;
            }
            let ran = threads::run(&mut bake, world, &pool, &control, None, |bake| {
                let elapsed = clock.elapsed().wall;
                bar.share(bake.share(), elapsed);
                if let Some(file) = self.kept.as_ref().filter(|_| elapsed - written > self.arguments.checkpoint_every) {
                    written = elapsed;
                    self.has_kept.set(true);
                    let kept = match self.part {
                        Some(part) => part.write(file, bake.grid(), self.tag, false),
                        None => write::keep(file, done.iter().chain([bake.grid()]), self.tag),
                    };
                    trouble = trouble.take().or(kept.err());
                }
            });
            if let Some([of_earlier, all]) = &mut kept {
                (*of_earlier, *all) = (*of_earlier + bake.kept(), *all + bake.grid().brick_count());
            }
            Ok::<_, BakeError>((bake.finish(), ran.ending == threads::Ending::Done))
        };
        let (grid, mut is_done) = bake_level(bake, &[]).map_err(|_| {
            "--after: the frame before has other probes: of another --box, --counts, --basis, --quantity or --orders"
        })?;
        let mut deviation = None;
        if caches.is_some() && is_done {
            bar.tell("compare", 0.0);
            let bricks: Vec<usize> = compared(self.counts).collect();
            let mut unbiased = Bake::new(settings)?.only(|brick| bricks.contains(&brick));
            let ran = threads::run(&mut unbiased, world, &pool, &control, None, |_| ());
            deviation = (ran.ending == threads::Ending::Done).then(|| grid.deviation(unbiased.grid()));
        }
        let mut levels = ProbeLevels::new(grid);
        let mean = settings.level.map_or_else(|| levels.finest().level(), f64::from);
        let mut settings = BakeSettings { level: Some(mean as f32), ..settings };
        while let Some(error) = self.arguments.refine.filter(|_| is_done) {
            if levels.levels().len() > self.arguments.levels as usize {
                break;
            }
            let finer = levels.finest().finer(mean, error, BakeMemory::default()).map_err(|error| {
                // What is done is kept.
                let kept = self.kept.as_ref().map(|file| write::keep(file, levels.levels(), self.tag));
                let trouble = kept.and_then(Result::err).map_or_else(String::new, |trouble| format!("; {trouble}"));
                format!("--refine: {error}; ask for less, or for fewer --levels{trouble}")
            })?;
            let Some(mut finer) = finer else { break };
            // What is known of it, whichever bricks were chosen before.
            if let Some(left) = begun.next() {
                finer.merge(&left)?;
            }
            settings.counts = settings.counts.map(|n| 2 * n);
            let finer = Bake::resume(finer, settings)?;
            let (finer, done) = bake_level(finer, levels.levels())?;
            is_done = done;
            levels.push(finer)?;
        }
        bar.finish();
        if let Some(trouble) = trouble {
            say!("fogbow: {trouble}");
        }
        let ending = if is_done { Ending::Done } else { Ending::Stopped };
        Ok(Done { levels, mean_cosine: outline.phase.mean_cosine().mean(), deviation, kept, ending })
    }

    /// The levels that are to be gone on with, if there are any.
    fn begun(&self) -> Result<Vec<ProbeGrid<'static>>, Failure> {
        let Some(file) = self.kept.as_ref().filter(|_| self.arguments.resume) else { return Ok(Vec::new()) };
        let begun = self.part.map_or_else(|| begun(file, self.tag), |part| part.begun(file, self.tag))?;
        let asked = self.arguments.refine.map_or(0, |_| self.arguments.levels as usize);
        if begun.len() > 1 + asked {
            let levels = begun.len() - 1;
            return Err(format!(
                "{}: has {levels} finer levels, which would be lost: give --refine and --levels {levels}",
                file.display()
            )
            .into());
        }
        Ok(begun)
    }
}

/// Bricks that are path traced to tell how far caches are off: a sixteenth, within bounds, all over the grid.
fn compared(counts: [u32; 3]) -> impl Iterator<Item = usize> {
    let all = counts.map(|n| u64::from(n.div_ceil(4))).iter().product::<u64>();
    let wanted = (all / 16).clamp(LEAST_COMPARED.min(all), MOST_COMPARED);
    // The golden ratio spreads them whatever their number.
    (0..wanted).map(move |i| ((i * 0x9e37_79b9 % (1 << 32) * all) >> 32) as usize)
}
