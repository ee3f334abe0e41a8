//! What beams scatter to an eye.

use super::kernel;
use super::thickness::Thickness;
use super::tree;
use super::{BeamNode, Piece};
use crate::host::{Medium, Rng};
use crate::math::float::{self, PI};
use crate::math::{Bounds, Ray};
use crate::path::InScattered;
use crate::phase::deflection;
use crate::spectrum::Spectrum;
use crate::storage::{Full, List};

/// `sin²` of the angle to a beam below which the eye ray counts as parallel to it: below, directions in
/// `f32` say nothing of the angle.
const PARALLEL: f32 = 1e-10;

/// A chord is looked at in parts no longer than this many radii, so that attenuation and phase function are
/// taken where the light is. Shorter costs more look-ups; at 4, a crossing at more than 30° is one part.
const PART: f32 = 4.0;

/// Parts of a chord at most.
const MAX_PARTS: f32 = 32.0;

/// Photon beams, in storage lent or growing.
///
/// ```
/// # use fogbow::{beams::{BeamNode, Beams, Piece}, math::*, medium::Homogeneous, phase::Lobe};
/// # use fogbow::{sampling::Generator, spectrum::Spectrum};
/// // One beam of 1 W along +z in thin fog, seen from the side.
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(1e-3), Lobe::Isotropic)?;
/// let (mut pieces, mut nodes) = ([Piece::default(); 1], [BeamNode::default(); 2]);
/// let mut beams = Beams::new(&mut pieces[..], &mut nodes[..]);
/// let (power, radius) = (Spectrum::ONE, 0.1);
/// beams.push(Piece { origin: Vec3::NEG_Z, length: 2.0, direction: Vec3::Z, power, radius, ..Piece::default() })?;
/// beams.build(1)?;
/// let eye = Ray::between(Vec3::new(-1.0, 0.0, 0.0), Vec3::X);
/// let seen = beams.gather(&eye, &fog, u32::MAX, &mut Generator::new(1));
/// // Across the middle of a disc, the kernel integrates to 16/(5 π r).
/// let expected = 1e-3 / (4.0 * core::f32::consts::PI) * 3.2 / (core::f32::consts::PI * 0.1);
/// assert!((seen.light.single[0] / expected - 1.0).abs() < 2e-3);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Beams<'s> {
    pieces: List<'s, Piece>,
    nodes: List<'s, BeamNode>,
    scale: f32,
}

/// What [`Beams::gather`] found.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GatheredBeams {
    /// Radiance (W·m⁻²·sr⁻¹) scattered into the eye ray.
    pub light: InScattered,
    /// Pieces that contributed: what it cost, not what is seen.
    pub pieces: u32,
}

impl<'s> Beams<'s> {
    /// None so far. For `n` pieces lend `n` of `pieces` and `n + 1` of `nodes`, which always suffices.
    ///
    /// ```
    /// # use fogbow::{beams::{BeamNode, Beams, Piece}, spectrum::Spectrum};
    /// let (mut pieces, mut nodes) = ([Piece::default(); 1], [BeamNode::default(); 2]);
    /// let mut beams = Beams::new(&mut pieces[..], &mut nodes[..]);
    /// let piece = Piece { length: 1.0, radius: 0.1, power: Spectrum::ONE, ..Piece::default() };
    /// assert!(beams.push(piece).is_ok() && beams.push(piece).is_err());
    /// ```
    pub fn new(pieces: impl Into<List<'s, Piece>>, nodes: impl Into<List<'s, BeamNode>>) -> Self {
        Self { pieces: pieces.into(), nodes: nodes.into(), scale: 0.0 }
    }

    /// Keeps a piece. Pieces without length, radius or power, or that are not finite, are left out. It is seen
    /// after the next [`Beams::build`].
    ///
    /// # Errors
    /// [`Full`] when lent storage has no room left.
    pub fn push(&mut self, piece: Piece) -> Result<(), Full> {
        let is_finite = piece.origin.is_finite() && piece.end().is_finite() && piece.direction.is_finite();
        let shines = piece.power.is_finite() && !piece.power.is_black();
        // Also false for NaN.
        let has_size = piece.length > 0.0 && piece.radius > 0.0 && piece.radius.is_finite();
        if is_finite && shines && has_size { self.pieces.push(piece) } else { Ok(()) }
    }

    /// Makes the tree over all pieces, which are all the light of `paths` paths. Sorts the pieces; takes
    /// `O(n log n)` time.
    ///
    /// # Errors
    /// [`Full`] when lent storage has no room left; nothing is gathered then.
    pub fn build(&mut self, paths: u32) -> Result<(), Full> {
        let built = tree::build(self.pieces.as_mut_slice(), &mut self.nodes);
        self.scale = if paths > 0 { 1.0 / paths as f32 } else { 0.0 };
        if built.is_err() {
            self.nodes.clear();
        }
        built
    }

    /// Forgets all pieces and keeps the memory.
    ///
    /// ```
    /// # use fogbow::{beams::{BeamNode, Beams, Piece}, math::Bounds, spectrum::Spectrum};
    /// let (mut pieces, mut nodes) = ([Piece::default(); 1], [BeamNode::default(); 2]);
    /// let mut beams = Beams::new(&mut pieces[..], &mut nodes[..]);
    /// let piece = Piece { length: 1.0, radius: 0.1, power: Spectrum::ONE, ..Piece::default() };
    /// beams.push(piece)?;
    /// beams.build(1)?;
    /// beams.clear();
    /// assert_eq!((beams.pieces().len(), beams.bounds()), (0, Bounds::EMPTY));
    /// assert!(beams.push(piece).is_ok());   // there is room for the next pass
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    pub fn clear(&mut self) {
        self.pieces.clear();
        self.nodes.clear();
    }

    /// The pieces, in the order of the tree.
    ///
    /// ```
    /// # use fogbow::{beams::{BeamNode, Beams, Piece}, spectrum::Spectrum};
    /// let (mut pieces, mut nodes) = ([Piece::default(); 2], [BeamNode::default(); 3]);
    /// let mut beams = Beams::new(&mut pieces[..], &mut nodes[..]);
    /// let piece = Piece { length: 1.0, radius: 0.1, power: Spectrum::ONE, ..Piece::default() };
    /// beams.push(piece)?;
    /// beams.push(Piece { power: Spectrum::ZERO, ..piece })?;   // without power: left out
    /// assert_eq!(beams.pieces(), [piece]);
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    #[must_use]
    pub fn pieces(&self) -> &[Piece] {
        self.pieces.as_slice()
    }

    /// Memory in use (bytes), without what a `Vec` or a lent slice holds in reserve.
    ///
    /// ```
    /// # use fogbow::{beams::{BeamNode, Beams, Piece}, spectrum::Spectrum};
    /// let (mut pieces, mut nodes) = ([Piece::default(); 8], [BeamNode::default(); 9]);
    /// let mut beams = Beams::new(&mut pieces[..], &mut nodes[..]);
    /// beams.push(Piece { length: 1.0, radius: 0.1, power: Spectrum::ONE, ..Piece::default() })?;
    /// beams.build(1)?;
    /// assert_eq!(beams.bytes(), 64 + 32);   // a piece and the box around it
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.pieces.as_slice()) + size_of_val(self.nodes.as_slice())
    }

    /// Light that beams scatter into `ray`, which is traced from the eye, along its length.
    ///
    /// Light that was scattered more than `most` times, this one included, is left out.
    ///
    /// The blur is integrated in closed form along the chord, in parts of a few radii; transmittances,
    /// coefficients and phase function are taken at the middle of each part. The eye ray's own
    /// transmittance is exact in constant media and marched, with jitter from `rng`, in others.
    /// Without beams the cost is that of the tree's root.
    pub fn gather<M: Medium + ?Sized>(
        &self,
        ray: &Ray,
        medium: &M,
        most: u32,
        rng: &mut (impl Rng + ?Sized),
    ) -> GatheredBeams {
        let (nodes, pieces) = (self.nodes.as_slice(), self.pieces.as_slice());
        let mut found = GatheredBeams::default();
        let mut thickness = None;
        tree::visit(nodes, pieces, ray, |piece| {
            if piece.scatterings >= most {
                return;
            }
            let Some(passing) = Passing::new(piece, ray) else { return };
            let thickness = thickness.get_or_insert_with(|| Thickness::new(medium, ray, rng));
            let Some(light) = passing.light(piece, ray, medium, thickness) else { return };
            found.pieces += 1;
            if piece.scatterings == 0 {
                found.light.single += light;
            } else {
                found.light.multiple += light;
            }
        });
        found.light.single *= self.scale;
        found.light.multiple *= self.scale;
        found
    }

    /// The box around all pieces; empty before [`Beams::build`] and without pieces.
    ///
    /// ```
    /// # use fogbow::{beams::{BeamNode, Beams, Piece}, math::Vec3, spectrum::Spectrum};
    /// let (mut pieces, mut nodes) = ([Piece::default(); 1], [BeamNode::default(); 2]);
    /// let mut beams = Beams::new(&mut pieces[..], &mut nodes[..]);
    /// beams.push(Piece { length: 2.0, direction: Vec3::Z, radius: 0.5, power: Spectrum::ONE, ..Piece::default() })?;
    /// beams.build(1)?;
    /// assert_eq!(beams.bounds().size(), Vec3::new(1.0, 1.0, 3.0));   // with the blur around it
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.nodes.as_slice().first().map_or(Bounds::EMPTY, BeamNode::bounds)
    }
}

/// How an eye ray passes a piece.
struct Passing {
    /// Distances (m) along the eye ray between which it is beside the piece.
    interval: (f32, f32),
    /// Distance (m) along the eye ray's line where it is closest to the beam's axis.
    centre: f32,
    /// Squared distance (m²) there.
    distance2: f32,
    /// Squared sine of the angle between both; 0 for parallel ones.
    sine2: f32,
    cosine: f32,
}

impl Passing {
    /// `None` where the eye ray stays farther away than the piece's radius.
    #[inline]
    fn new(piece: &Piece, ray: &Ray) -> Option<Self> {
        let (d, b) = (ray.direction, piece.direction);
        let from = ray.origin - piece.origin;
        let (cosine, along) = (d.dot(b), from.dot(b));
        // Components across the beam.
        let (slope, start) = (d - b * cosine, from - b * along);
        let sine2 = slope.length_squared();
        let is_parallel = sine2 < PARALLEL;
        let centre = if is_parallel { 0.0 } else { -start.dot(slope) / sine2 };
        let distance2 = (start + slope * centre).length_squared();
        let radius2 = piece.radius * piece.radius;
        if !(is_parallel || distance2 < radius2) {
            return None;
        }
        // Beside the piece: 0 ≤ along + t cosine ≤ length.
        let (mut near, mut far) = (0.0_f32, ray.length);
        if cosine.abs() > 1e-12 {
            let inverse = 1.0 / cosine;
            let (a, b) = (-along * inverse, (piece.length - along) * inverse);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        } else if along < 0.0 || along > piece.length {
            return None;
        }
        if is_parallel {
            let middle = 0.5 * (near + far);
            let distance2 = (start + slope * middle).length_squared();
            // Also false for NaN, which an endless eye ray across a beam would make.
            let passes = far > near && far.is_finite() && distance2 < radius2;
            return passes.then_some(Self { interval: (near, far), centre: middle, distance2, sine2: 0.0, cosine });
        }
        let half = float::sqrt((radius2 - distance2) / sine2);
        near = near.max(centre - half);
        far = far.min(centre + half);
        // Also false for NaN; `clamp` takes no empty interval.
        if !(far > near) {
            return None;
        }
        Some(Self { interval: (near, far), centre, distance2, sine2, cosine })
    }

    /// Radiance (W·m⁻²·sr⁻¹) from the piece; `None` where it is too far away.
    #[inline]
    fn light<M: Medium + ?Sized>(
        &self,
        piece: &Piece,
        ray: &Ray,
        medium: &M,
        thickness: &Thickness,
    ) -> Option<Spectrum> {
        let radius = piece.radius;
        let w2 = 1.0 - self.distance2 / (radius * radius);
        // Also false for NaN.
        if !(w2 > 0.0) {
            return None;
        }
        let scale = 3.0 / (PI * radius * radius);
        let (mut near, mut far) = self.interval;
        // Radii across the beam per metre along the eye ray.
        let rate = float::sqrt(self.sine2) / radius;
        if rate > 0.0 {
            let half = float::sqrt(w2) / rate;
            near = near.max(self.centre - half);
            far = far.min(self.centre + half);
            if !(far > near) {
                return None;
            }
        }
        let along = (ray.origin - piece.origin).dot(piece.direction);
        let angle = deflection(-piece.direction, -ray.direction);
        let parts = ((far - near) / (PART * radius)).min(MAX_PARTS - 1.0) as u32 + 1;
        let width = (far - near) / parts as f32;
        let mut light = Spectrum::ZERO;
        for i in 0..parts {
            let from = near + i as f32 * width;
            let to = from + width;
            let kernel = if rate > 0.0 {
                kernel::chord(w2, (from - self.centre) * rate, (to - self.centre) * rate) / rate
            } else {
                w2 * w2 * width
            };
            let at = 0.5 * (from + to);
            let properties = medium.properties(ray.at(at));
            if properties.scattering.is_black() {
                continue;
            }
            let passed = (along + at * self.cosine).clamp(0.0, piece.length);
            let attenuation = (thickness.at(at) + piece.rate * passed).transmitted();
            light += properties.scattering * properties.phase.value(angle) * attenuation * (kernel * scale);
        }
        Some(light * piece.power)
    }
}
