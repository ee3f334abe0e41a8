//! What jobs of a bake leave, as bytes: for workers that share no memory.

use glam::Vec3;

use super::fill::BakedProbes;
use super::flights::PhotonFlight;
use super::probe::Probe;
use crate::sent::{JobBytesError, Packed, Received, Sending, byte_count, packed};
use crate::spectrum::Spectrum;

packed!(PhotonFlight { origin: Vec3, direction: Vec3, length: f32, power: Spectrum });
packed!(Probe {
    extinction: Spectrum,
    albedo: Spectrum,
    near: Vec3,
    other: Vec3,
    third: Vec3,
    fourth: Vec3,
    open: f32,
    state: u32,
});

/// Tells such jobs from others.
const KIND: u32 = 2;

const EACH: [usize; 4] = [Spectrum::WORDS, Probe::WORDS, PhotonFlight::WORDS, 0];

impl BakedProbes<'_> {
    /// Number of bytes that [`BakedProbes::write`] writes.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")]
    /// assert!(fogbow::bake::BakedProbes::default().byte_count() < 100);
    /// ```
    #[must_use]
    pub fn byte_count(&self) -> usize {
        let flights = self.flights.len() * PhotonFlight::WORDS;
        byte_count(bool::WORDS + self.values.len() * Spectrum::WORDS + self.probes.len() * Probe::WORDS + flights)
    }

    /// Hands what a job has left to `sink` in little-endian bytes, with a checksum: for workers that share no memory, as
    /// [`FilledRecords::write`](crate::cache::FilledRecords::write).
    ///
    /// # Errors
    /// Those of `sink`.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::bake::BakedProbes;
    /// let (output, mut bytes) = (BakedProbes::default(), Vec::new());
    /// output.write(|part| Ok::<(), ()>(bytes.extend_from_slice(part))).unwrap();
    /// assert_eq!(bytes, output.to_bytes());
    /// # }
    /// ```
    pub fn write<F>(&self, sink: impl FnMut(&[u8]) -> Result<(), F>) -> Result<(), F> {
        let mut sending = Sending::new(sink, KIND, [self.values.len(), self.probes.len(), self.flights.len(), 0])?;
        sending.put(&self.is_cut)?;
        sending.list(self.values.as_slice())?;
        sending.list(self.probes.as_slice())?;
        sending.list(self.flights.as_slice())?;
        sending.finish()
    }

    /// [`BakedProbes::write`] into memory that grows.
    ///
    /// ```
    /// # use fogbow::bake::BakedProbes;
    /// let nothing = BakedProbes::default();
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

    /// Takes what [`BakedProbes::write`] has written; what was there is lost.
    ///
    /// # Errors
    /// Other bytes, damaged ones, or lent memory that is too small.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::{bake::BakedProbes, cache::FilledRecords, sent::JobBytesError};
    /// let mut output = BakedProbes::default();
    /// assert_eq!(output.read(&output.to_bytes()), Ok(()));
    /// assert_eq!(output.read(&FilledRecords::default().to_bytes()), Err(JobBytesError::Kind));
    /// # }
    /// ```
    pub fn read(&mut self, bytes: &[u8]) -> Result<(), JobBytesError> {
        let mut received = Received::new(bytes, KIND, bool::WORDS, EACH)?;
        self.is_cut = received.take();
        received.list(&mut self.values)?;
        received.list(&mut self.probes)?;
        received.list(&mut self.flights)
    }
}
