//! What jobs of a fill leave, as bytes: for workers that share no memory.

use super::asked::Wanted;
use super::guide::Guide;
use super::memory::{Estimate, FilledRecords};
use super::noise::Glance;
use super::photons::PhotonDeposit;
use super::pilots::Pilots;
use super::places::Place;
use super::radius::Limits;
use super::record::Facing;
use crate::sent::{JobBytesError, Packed, Received, Sending, byte_count, packed};
use crate::sh::Coefficient;
use crate::single_scatter::Sums;

packed!(Place { point: glam::Vec3, normal: Option<glam::Vec3>, is_seen: bool, share: f32, to_eye: Option<glam::Vec3> });
packed!(Wanted { place: Place, distance: f32, ray: u32 });
packed!(Coefficient { value: crate::spectrum::Spectrum, gradient: crate::spectrum::Gradient });
packed!(Facing { normal: glam::Vec3, turn: crate::spectrum::Gradient });
packed!(Limits { min: f32, max: f32 });
packed!(Sums {
    value: crate::spectrum::Spectrum,
    gradient: crate::spectrum::Gradient,
    gradient_norms: crate::spectrum::Spectrum,
    unshadowed: crate::spectrum::Spectrum,
    unshadowed_gradient_norms: crate::spectrum::Spectrum,
});
packed!(Estimate {
    number: u32,
    place: Place,
    sums: Sums,
    facing: Facing,
    limits: Limits,
    learnt: Guide,
    effort: f32,
    mixed: u32,
});

/// Tells such jobs from others.
const KIND: u32 = 1;

/// What there is one of: estimate, paths, flights, pilots, glances, whether it is cut.
type Fixed = (Option<Estimate>, u32, u64, Pilots, [Glance; 16], bool);

const FIXED: usize =
    <Option<Estimate>>::WORDS + u32::WORDS + u64::WORDS + Pilots::WORDS + 16 * Glance::WORDS + bool::WORDS;

const EACH: [usize; 4] = [Wanted::WORDS, u32::WORDS, Coefficient::WORDS, PhotonDeposit::WORDS];

impl FilledRecords<'_> {
    fn lengths(&self) -> [usize; 4] {
        [self.wanted.len(), self.open.len(), self.higher.len(), self.deposits.len()]
    }

    /// Number of bytes that [`FilledRecords::write`] writes.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")]
    /// assert!(fogbow::cache::FilledRecords::default().byte_count() < 2000);
    /// ```
    #[must_use]
    pub fn byte_count(&self) -> usize {
        let lists: usize = self.lengths().iter().zip(EACH).map(|(length, each)| length * each).sum();
        byte_count(FIXED + lists)
    }

    /// Hands what a job has left to `sink` in little-endian bytes, with a checksum: for a worker without this memory (another process, a worker of
    /// a page), where [`FilledRecords::read`] takes it. Workers that accept all results in order stay the same, bit by bit.
    ///
    /// # Errors
    /// Those of `sink`.
    ///
    /// ```
    /// # use fogbow::cache::{Asked, FilledRecords, RadianceCaches, Settings};
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work::Rounds, world::{Outline, World}};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// # let settings = Settings { rays: 20, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(16) };
    /// let fill = || RadianceCaches::new(settings).fill(Asked::anywhere_in(bounds));
    /// // Two workers with caches of their own. Each runs every other job, and sends the other what it has left.
    /// let (mut workers, mut sent, mut received) = ([fill(), fill()], FilledRecords::default(), FilledRecords::default());
    /// while let Some(job) = Rounds::<World<'_, Homogeneous, Empty>>::jobs(&workers[0]).next() {
    ///     workers[job as usize % 2].run(job, &world, &mut sent);
    ///     let mut bytes = Vec::new();
    ///     sent.write(|part| Ok::<(), ()>(bytes.extend_from_slice(part))).unwrap();
    ///     received.read(&bytes)?;
    ///     workers.iter_mut().for_each(|worker| Rounds::<World<'_, Homogeneous, Empty>>::accept(worker, &received));
    /// #   assert_eq!((bytes.len(), &bytes), (sent.byte_count(), &sent.to_bytes()));
    /// }
    /// let [a, b] = workers.map(|worker| worker.finish().to_bytes(0));
    /// assert_eq!(a, b);
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn write<F>(&self, sink: impl FnMut(&[u8]) -> Result<(), F>) -> Result<(), F> {
        let Self { wanted, open, estimate, higher, deposits, paths, flights, pilots, glances, is_cut } = self;
        let mut sending = Sending::new(sink, KIND, self.lengths())?;
        sending.put(estimate)?;
        sending.put(paths)?;
        sending.put(flights)?;
        sending.put(pilots)?;
        sending.put(glances)?;
        sending.put(is_cut)?;
        sending.list(wanted.as_slice())?;
        sending.list(open.as_slice())?;
        sending.list(higher.as_slice())?;
        sending.list(deposits.as_slice())?;
        sending.finish()
    }

    /// [`FilledRecords::write`] into memory that grows.
    ///
    /// ```
    /// # use fogbow::cache::FilledRecords;
    /// let nothing = FilledRecords::default();
    /// assert_eq!(nothing.to_bytes().len(), nothing.byte_count());
    /// ```
    #[cfg(feature = "alloc")]
    #[must_use]
    pub fn to_bytes(&self) -> alloc::vec::Vec<u8> {
        let mut all = alloc::vec::Vec::with_capacity(self.byte_count());
        let Ok(()) = self.write(|part| {
            all.extend_from_slice(part);
            Ok::<(), core::convert::Infallible>(())
        });
        all
    }

    /// Takes what [`FilledRecords::write`] has written; what was there is lost.
    ///
    /// # Errors
    /// Other bytes, damaged ones, or lent memory that is too small.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{cache::FilledRecords, sent::JobBytesError};
    /// let mut output = FilledRecords::default();
    /// let mut bytes = output.to_bytes();
    /// assert_eq!(output.read(&bytes), Ok(()));
    /// bytes[40] ^= 1;
    /// assert_eq!(output.read(&bytes), Err(JobBytesError::Checksum));
    /// assert_eq!(output.read(&bytes[1..]), Err(JobBytesError::Kind));
    /// # }
    /// ```
    pub fn read(&mut self, bytes: &[u8]) -> Result<(), JobBytesError> {
        let mut received = Received::new(bytes, KIND, FIXED, EACH)?;
        let fixed: Fixed =
            (received.take(), received.take(), received.take(), received.take(), received.take(), received.take());
        (self.estimate, self.paths, self.flights, self.pilots, self.glances, self.is_cut) = fixed;
        received.list(&mut self.wanted)?;
        received.list(&mut self.open)?;
        received.list(&mut self.higher)?;
        received.list(&mut self.deposits)
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use glam::Vec3;

    fn left() -> FilledRecords<'static> {
        let mut output = FilledRecords { paths: 7, flights: 1 << 40, is_cut: true, ..FilledRecords::default() };
        let place = Place { point: Vec3::new(1.0, 2.0, 3.0), normal: Some(Vec3::Y), to_eye: None, ..Place::default() };
        output.estimate = Some(Estimate { number: 3, place, effort: 0.5, ..Estimate::default() });
        output.wanted.push(Wanted { place, distance: f32::INFINITY, ray: 9 }).unwrap();
        output.open.extend_from_slice(&[1, 2, 3]).unwrap();
        output.higher.push(Coefficient::ZERO).unwrap();
        output.deposits.push(PhotonDeposit::default()).unwrap();
        output
    }

    #[test]
    fn all_comes_back() {
        let (output, mut read) = (left(), FilledRecords::default());
        assert_eq!(read.read(&output.to_bytes()), Ok(()));
        assert_eq!(read.to_bytes(), output.to_bytes());
        assert_eq!(alloc::format!("{read:?}"), alloc::format!("{output:?}"));
    }

    #[test]
    fn damage_is_an_error() {
        let bytes = left().to_bytes();
        let mut read = FilledRecords::default();
        for length in 0..bytes.len() {
            assert!(read.read(&bytes[..length]).is_err(), "{length} bytes");
        }
        for at in 0..bytes.len() {
            let mut damaged: Vec<u8> = bytes.clone();
            damaged[at] ^= 0x10;
            assert!(read.read(&damaged).is_err(), "byte {at}");
        }
        let mut longer = bytes;
        longer.push(0);
        assert_eq!(read.read(&longer), Err(JobBytesError::Length));
    }

    #[test]
    fn lent_memory_may_be_too_small() {
        let bytes = left().to_bytes();
        let (mut wanted, mut open, mut higher, mut deposits) =
            ([Wanted::default(); 1], [0; 2], [Coefficient::ZERO; 1], [PhotonDeposit::default(); 1]);
        let mut read = FilledRecords::lent(&mut wanted, &mut open, &mut higher, &mut deposits);
        assert_eq!(read.read(&bytes), Err(JobBytesError::Full));
    }
}
