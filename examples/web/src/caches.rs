//! Radiance caches: filled job by job, read, saved.

use alloc::boxed::Box;
use alloc::vec::Vec;

use fogbow::cache::{Asked, FilledRecords, Filling, Kind, RadianceCaches, Settings};
use fogbow::math::{Bounds, Ray};
use fogbow::sampling::{GeneratorSource, Independent};
use fogbow::spectrum::Spectrum;
use fogbow::work::Rounds;

use super::view::{Part, Rays, View};
use super::words::{Fault, Words};
use super::world::{CoreWorld, WebWorld};

type Eye = Box<dyn Fn([f32; 2]) -> Ray>;

#[derive(Debug)]
enum State {
    Filling(Box<FillingBox>),
    Full(Box<RadianceCaches<'static>>),
    /// Only while one becomes the other.
    Between,
}

/// [`Filling`] with a name for its closure.
struct FillingBox(Filling<'static, Eye>);

impl core::fmt::Debug for FillingBox {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.0.caches().fmt(f)
    }
}

/// Caches of a world, while they are filled and after.
#[derive(Debug)]
pub struct WebCaches {
    state: State,
    output: FilledRecords<'static>,
    /// Names the world in saved bytes.
    tag: u64,
}

const ANYWHERE: u32 = 0;
const VIEW: u32 = 1;

/// Where light is asked for, and how many pixels see it.
fn asked(words: &mut Words<'_>) -> Result<(Asked<Eye>, Option<u32>), Fault> {
    match words.integer()? {
        ANYWHERE => {
            let bounds = Bounds { min: words.vector()?, max: words.vector()? };
            if !(bounds.min.is_finite() && bounds.max.is_finite() && bounds.size().min_element() >= 0.0) {
                return Err(Fault::new("a box needs finite corners, the lower one first"));
            }
            Ok((Asked::Box(bounds), None))
        }
        VIEW => {
            let view = View::read(words)?;
            Ok((Asked::View { ray: Box::new(move |at| view.ray(at)), pixel: view.pixel() }, Some(view.pixels())))
        }
        _ => Err(Fault::new("light is asked for in a box or in a view")),
    }
}

impl WebCaches {
    /// Empty caches, to be filled. From words: the relative error, walks of a record (0: by the error), eye rays that look for places (0: by the
    /// pixels), seed, whether light straight from lamps is cached, and where light is asked for.
    ///
    /// # Errors
    /// An error that is not above 0; a box or view that is none.
    pub fn new(world: &WebWorld, words: &[u32]) -> Result<Self, Fault> {
        let mut words = Words::new(words);
        let error = words.float()?;
        if !(error > 0.0) {
            return Err(Fault::new("the error asked for must be above 0"));
        }
        let [walks, rays, seed, single] = [(); 4].map(|()| words.integer());
        let (walks, rays, seed, single) = (walks?, rays?, seed?, single?);
        let (asked, pixels) = asked(&mut words)?;
        let outline = world.outline();
        let mut settings = Settings { seed: u64::from(seed), ..Settings::for_outline(&outline, error) };
        if let Some(pixels) = pixels {
            settings = settings.for_pixels(pixels);
        }
        if single != 0 {
            settings = settings.with_single_cached(&outline);
        }
        if walks > 0 {
            settings = settings.with_walks(walks);
        }
        if rays > 0 {
            settings.rays = rays;
        }
        let filling = RadianceCaches::new(settings).fill(asked);
        Ok(Self {
            state: State::Filling(Box::new(FillingBox(filling))),
            output: FilledRecords::default(),
            tag: world.tag(),
        })
    }

    /// Goes on for another view or box; what is there stays.
    ///
    /// # Errors
    /// A box or view that is none.
    pub fn ask(&mut self, words: &[u32]) -> Result<(), Fault> {
        let (asked, _) = asked(&mut Words::new(words))?;
        self.stop();
        if let State::Full(caches) = core::mem::replace(&mut self.state, State::Between) {
            self.state = State::Filling(Box::new(FillingBox(caches.fill(asked))));
        }
        Ok(())
    }

    /// Numbers of the jobs that may run now; none once all is done.
    #[must_use]
    pub fn jobs(&self) -> [u32; 2] {
        let State::Filling(filling) = &self.state else { return [0, 0] };
        let jobs = Rounds::<CoreWorld<'static>>::jobs(&filling.0);
        [jobs.start, jobs.end]
    }

    /// What is being done, in a word or two.
    #[must_use]
    pub fn stage(&self) -> &'static str {
        let State::Filling(filling) = &self.state else { return "" };
        Rounds::<CoreWorld<'static>>::stage(&filling.0)
    }

    /// Runs a job of this round; what it leaves, as bytes.
    pub fn run(&mut self, world: &WebWorld, job: u32) -> Vec<u8> {
        if let State::Filling(filling) = &self.state {
            world.with(|world| filling.0.run(job, world, &mut self.output));
        }
        self.output.to_bytes()
    }

    /// Takes what the next job has left, here or elsewhere.
    ///
    /// # Errors
    /// Bytes that are not what a job leaves.
    pub fn accept(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        self.output.read(bytes)?;
        if let State::Filling(filling) = &mut self.state {
            Rounds::<CoreWorld<'static>>::accept(&mut filling.0, &self.output);
        }
        self.close_if_done();
        Ok(())
    }

    /// Runs so many jobs, one by one; whether more are due.
    pub fn fill(&mut self, world: &WebWorld, jobs: u32) -> bool {
        if let State::Filling(filling) = &mut self.state {
            let output = &mut self.output;
            world.with(|world| (0..jobs).all(|_| fogbow::work::step(&mut filling.0, world, output)));
        }
        self.close_if_done()
    }

    fn close_if_done(&mut self) -> bool {
        let [start, end] = self.jobs();
        if start == end {
            self.stop();
        }
        start < end
    }

    /// Ends a fill where it is. What was made counts; the next fill goes on from there.
    pub fn stop(&mut self) {
        self.state = match core::mem::replace(&mut self.state, State::Between) {
            State::Filling(filling) => State::Full(Box::new(filling.0.finish())),
            other => other,
        };
    }

    /// The caches, as they are.
    #[must_use]
    pub fn caches(&self) -> Option<&RadianceCaches<'static>> {
        match &self.state {
            State::Filling(filling) => Some(filling.0.caches()),
            State::Full(caches) => Some(caches),
            State::Between => None,
        }
    }

    fn there(&self) -> Result<&RadianceCaches<'static>, Fault> {
        self.caches().ok_or_else(|| Fault::new("there are no caches"))
    }

    /// Radiance (W·m⁻²·sr⁻¹) of a part of a picture, from the caches.
    ///
    /// # Errors
    /// None but of memory.
    pub fn picture(&self, world: &WebWorld, view: &View, part: &Part) -> Result<Vec<Spectrum>, Fault> {
        let caches = self.there()?;
        world.with(|world| part.picture(view, |ray, rng| caches.radiance(ray, world, rng).total()))
    }

    /// Radiance of rays, each a mean over `samples`.
    ///
    /// # Errors
    /// None but of memory.
    pub fn radiance(&self, world: &WebWorld, rays: Rays<'_>, samples: u32, seed: u64) -> Result<Vec<Spectrum>, Fault> {
        let caches = self.there()?;
        Ok(world.with(|world| rays.radiance(samples, seed, |ray, rng| caches.radiance(ray, world, rng).total())))
    }

    /// Radiance scattered at points towards directions (unit), without the scattering coefficient. The words of each: a point and a direction.
    ///
    /// # Errors
    /// No whole number of points.
    pub fn in_scattered(&self, world: &WebWorld, words: &[u32], seed: u64) -> Result<Vec<Spectrum>, Fault> {
        let caches = self.there()?;
        world.with(|world| {
            let of = |(number, words): (usize, &[u32])| {
                let mut words = Words::new(words);
                let (point, to_eye) = (words.vector()?, words.vector()?);
                let mut rng = Independent.start(seed, number as u64, 0);
                Ok(caches.in_scattered(point, to_eye, world, &mut rng).total())
            };
            words.chunks(6).enumerate().map(of).collect()
        })
    }

    /// Records of a kind: position, radius, value, gradient along x, y and z; 16 numbers each.
    ///
    /// # Errors
    /// No such kind.
    pub fn records(&self, kind: u32) -> Result<&[u8], Fault> {
        let kind = Kind::ALL.get(kind as usize).ok_or_else(|| Fault::new("no such kind of cache"))?;
        Ok(bytemuck::cast_slice(self.there()?.records(*kind)))
    }

    /// As bytes.
    ///
    /// # Errors
    /// None but of memory.
    pub fn save(&self) -> Result<Vec<u8>, Fault> {
        Ok(self.there()?.to_bytes(self.tag))
    }

    /// From bytes; what was there is lost.
    ///
    /// # Errors
    /// Damage, other settings, another world.
    pub fn load(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        self.stop();
        match &mut self.state {
            State::Full(caches) => Ok(caches.read(bytes, self.tag)?),
            _ => Err(Fault::new("there are no caches")),
        }
    }
}
