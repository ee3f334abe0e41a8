//! One probe: what has become of it, what lies beside its light, and which surfaces it sees.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::spectrum::Spectrum;

/// One over the share of the way to a surface within which a probe's part falls to nothing. Larger: light jumps where a surface ends in the open. Smaller: probes
/// near a surface have a part in less.
const SOFT: f32 = 10.0;

/// What part a probe keeps behind a surface. Larger: light leaks. Smaller: nothing is gained.
const HIDDEN: f32 = 1e-6;

/// What becomes of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProbeState {
    /// Nothing is known of it yet.
    Unknown,
    /// It holds light.
    Valid,
    /// It stands in a wall: it has no part in look-ups.
    InWall,
    /// No medium is near: it has no part in look-ups, and where it stands none is needed.
    Empty,
}

/// What lies beside the light of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Probe {
    /// Mean extinction (m⁻¹) of the medium within half a cell.
    pub extinction: Spectrum,
    /// Single-scattering albedo of the medium at the probe; 0 without a medium.
    pub albedo: Spectrum,
    /// See [`Probe::planes`]; while light is baked, two more of them.
    pub(super) near: Vec3,
    pub(super) other: Vec3,
    pub(super) third: Vec3,
    pub(super) fourth: Vec3,
    /// What share of its cell photons count in.
    pub(super) open: f32,
    /// A [`ProbeState`] by its number, in [`STATE`]; [`INNER`]; in [`WALLS`], bits for x, y and z where a surface stands before the next probe; [`BY_PATHS`]. Above that, marks of a dilation
    /// under way.
    pub(super) state: u32,
}

/// Bits of a state.
pub(super) const STATE: u32 = 7;

/// The bit of a probe of some bricks alone that has probes all around.
pub(super) const INNER: u32 = 8;

/// Bits of surfaces towards the next probes.
pub(super) const WALLS: u32 = 7 << WALLS_AT;

pub(super) const WALLS_AT: u32 = 4;

/// The bit of a probe whose light is found by paths, in a bake by photons.
pub(super) const BY_PATHS: u32 = 1 << 7;

impl Probe {
    /// What has become of it.
    ///
    /// ```
    /// # use fogbow::bake::{Probe, ProbeState};
    /// assert_eq!(Probe::default().state(), ProbeState::Unknown);
    /// ```
    #[must_use]
    pub fn state(&self) -> ProbeState {
        match self.state & STATE {
            1 => ProbeState::Valid,
            2 => ProbeState::InWall,
            3 => ProbeState::Empty,
            _ => ProbeState::Unknown,
        }
    }

    /// Whether a surface stands between this probe and the next one along x, y and z: there, light is mixed across it.
    ///
    /// ```
    /// # use fogbow::bake::Probe;
    /// assert_eq!(Probe::default().walls(), [false; 3]);
    /// ```
    #[must_use]
    pub fn walls(&self) -> [bool; 3] {
        [0, 1, 2].map(|axis| self.state >> (WALLS_AT + axis) & 1 == 1)
    }

    /// Planes of surfaces around the probe, up to two: what lies at an offset `o` (in cells) is behind one of them where `o · plane > 1`; zeros where there is
    /// none.
    ///
    /// ```
    /// # use fogbow::{bake::Probe, math::Vec3};
    /// assert_eq!(Probe::default().planes(), [Vec3::ZERO; 2]);
    /// ```
    #[must_use]
    pub fn planes(&self) -> [Vec3; 2] {
        [self.near, self.other]
    }

    /// How much of a part the probe has in the light at an offset `o` (in cells): 1 before surfaces, next to none behind one. Between them it falls
    /// within a tenth of the way to the surface, so that light does not jump where surfaces end in the open.
    ///
    /// ```text
    /// min(max(10 (1 − s), 0), 1) + 10⁻⁶ max(s, 1)⁻⁸      s = max(o · plane₁, o · plane₂)
    /// ```
    ///
    /// ```
    /// # use fogbow::{bake::Probe, math::Vec3};
    /// assert_eq!(Probe::default().sees(Vec3::splat(0.9)), 1.0 + 1e-6);
    /// ```
    #[must_use]
    #[inline]
    pub fn sees(&self, offset: Vec3) -> f32 {
        let s = offset.dot(self.near).max(offset.dot(self.other));
        // Where all probes are behind surfaces, as in a corner, the one that is least so counts.
        let far = s.max(1.0);
        let square = far * far;
        let fourth = square * square;
        ((1.0 - s) * SOFT).clamp(0.0, 1.0) + HIDDEN / (fourth * fourth)
    }

    /// Whether a bake by photons has found its light by paths, since surfaces beside it hide other light from it than from most of its cell.
    ///
    /// ```
    /// # use fogbow::bake::Probe;
    /// assert!(!Probe::default().is_by_paths());
    /// ```
    #[must_use]
    pub fn is_by_paths(&self) -> bool {
        self.state & BY_PATHS != 0
    }

    /// Whether a probe of a level that has some bricks alone has neighbours of that level on all sides: within a cell of probes that have not, look-ups go over into the coarser level.
    ///
    /// ```
    /// # use fogbow::bake::Probe;
    /// assert!(!Probe::default().is_inner());
    /// ```
    #[must_use]
    pub fn is_inner(&self) -> bool {
        self.state & INNER != 0
    }

    pub(super) fn all_planes(&self) -> [Vec3; 4] {
        [self.near, self.other, self.third, self.fourth]
    }

    pub(super) fn is_valid(&self) -> bool {
        self.state & STATE == ProbeState::Valid as u32
    }
}
