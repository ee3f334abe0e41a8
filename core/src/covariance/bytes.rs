//! Covariance grids as bytes.
//!
//! Little endian on every target, without gaps:
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | [`MAGIC`] |
//! | 8 | 4 | [`VERSION`] |
//! | 12 | 12 | cells along x, y, z |
//! | 24 | 24 | smallest and largest corner (m), as `f32` |
//! | 48 | 8 | tag: what the grid was made for, a number of the host's choice |
//! | 56 | 8 | number of photons |
//! | 64 | 8 | [`Crc`](crate::bytes::Crc) of bytes 0 to 64 and of all from 72 on |
//! | 72 | 28 n | voxels: `Σ I R S Rᵀ` (xx, xy, xz, yy, yz, zz), `Σ I`, as `f32` |

use core::fmt;

use super::grid::{CovarianceGrid, GridView};
use super::lattice::Lattice;
use super::metrics::Voxel;
use crate::bytes::{Damage, Format, Sink, element, elements, halves};
use crate::math::Bounds;
use crate::storage::{Full, List};

/// The first bytes: not text, and damaged by whatever changes ends of lines.
pub const MAGIC: [u8; 8] = *b"\x89FOGCOV\n";

/// Of the layout above.
pub const VERSION: u32 = 1;

/// Length of the header (bytes).
pub const HEADER_BYTES: usize = 72;

const FORMAT: Format = Format { magic: MAGIC, version: VERSION, header: HEADER_BYTES, what: "covariance grid" };

/// Why bytes are not the grid asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GridBytesError {
    /// No such bytes, or damaged ones, or made for something else.
    Damage(Damage),
    /// Bounds or numbers of cells that no grid has.
    Lattice,
    /// A voxel that no photons leave: negative or not finite.
    Voxel(usize),
    /// The storage does not have one element per cell.
    Storage,
}

impl From<Damage> for GridBytesError {
    fn from(damage: Damage) -> Self {
        Self::Damage(damage)
    }
}

impl fmt::Display for GridBytesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Damage(damage) => damage.fmt(f),
            Self::Lattice => f.write_str("has bounds or numbers of cells that no grid has"),
            Self::Voxel(index) => write!(f, "has a voxel that is not valid: number {index}"),
            Self::Storage => f.write_str("has more cells than there is memory for"),
        }
    }
}

impl core::error::Error for GridBytesError {}

/// What the first bytes of a grid say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridHeader {
    /// The cells.
    pub lattice: Lattice,
    /// How many photons filled them.
    pub paths: u64,
}

/// Number of bytes that [`write()`] gives.
///
/// ```
/// # use fogbow::{covariance::{Lattice, bytes}, math::{Bounds, Vec3}};
/// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [3, 2, 1])?;
/// assert_eq!(bytes::byte_count(&lattice), 72 + 6 * 28);   // a header, and seven `f32` for each cell
/// # Ok::<(), fogbow::covariance::LatticeError>(())
/// ```
#[must_use]
pub fn byte_count(lattice: &Lattice) -> usize {
    HEADER_BYTES + lattice.cell_count() * size_of::<Voxel>()
}

#[cfg(feature = "alloc")]
impl CovarianceGrid<'_> {
    /// The bytes that [`write()`] writes.
    ///
    /// ```
    /// use fogbow::covariance::{Fill, Settings, bytes};
    /// use fogbow::math::{Bounds, Vec3};
    /// use fogbow::storage::List;
    /// let empty = Fill::new(Settings::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }))?.finish();
    /// let all = empty.to_bytes(7);
    /// assert_eq!(bytes::read(&all, 7, List::default())?.view().paths(), 0);
    /// assert!(bytes::read(&all, 8, List::default()).is_err());
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn to_bytes(&self, tag: u64) -> alloc::vec::Vec<u8> {
        let mut all = alloc::vec::Vec::with_capacity(byte_count(self.view().lattice()));
        let Ok(()) = write(&self.view(), tag, |part| {
            all.extend_from_slice(part);
            Ok::<(), core::convert::Infallible>(())
        });
        all
    }
}

/// Writes a grid to `sink`, part by part.
///
/// # Errors
/// The sink's.
///
/// ```
/// # use fogbow::covariance::{GridView, Lattice, Voxel, bytes};
/// # use fogbow::math::{Bounds, Vec3};
/// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [2, 1, 1])?;
/// let voxels = [Voxel { weight: 1.0, ..Voxel::EMPTY }; 2];
/// let mut file = [0; 128];
/// let mut used = 0;
/// let Ok(()) = bytes::write(&GridView::new(lattice, &voxels, 100)?, 7, |part| {
///     file[used..][..part.len()].copy_from_slice(part);
///     used += part.len();
///     Ok::<_, core::convert::Infallible>(())
/// });
/// assert_eq!(used, bytes::byte_count(&lattice));
/// let mut copy = [Voxel::EMPTY; 2];
/// assert_eq!(bytes::header(&file, 7)?.lattice, lattice);
/// bytes::read_into(&file, 7, &mut copy)?;
/// assert_eq!(copy, voxels);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn write<F>(grid: &GridView<'_>, tag: u64, mut sink: impl FnMut(&[u8]) -> Result<(), F>) -> Result<(), F> {
    let (lattice, bounds) = (grid.lattice(), grid.lattice().bounds());
    let corners = [bounds.min, bounds.max].into_iter().flat_map(|corner| corner.to_array().map(f32::to_bits));
    let words = lattice.size().into_iter().chain(corners).chain(halves(tag)).chain(halves(grid.paths()));
    FORMAT.write(words, &|sink: Sink<'_, F>| elements(grid.voxels(), sink), &mut sink)
}

/// The header of a grid that [`write()`] gave, after all checks but those of its voxels' values.
///
/// # Errors
/// The first check that fails.
///
/// ```
/// # use fogbow::{bytes::Damage, covariance::bytes};
/// assert_eq!(bytes::header(&[], 7), Err(Damage::NoHeader { found: 0, due: 72 }.into()));
/// assert_eq!(bytes::header(b"P6", 7), Err(Damage::Magic { due: "covariance grid" }.into()));
/// ```
pub fn header(bytes: &[u8], tag: u64) -> Result<GridHeader, GridBytesError> {
    let header = FORMAT.header(bytes)?;
    let size = [12, 16, 20].map(|at| header.word(at));
    let bounds = Bounds { min: header.numbers(24).into(), max: header.numbers(36).into() };
    let lattice = Lattice::new(bounds, size).map_err(|_| GridBytesError::Lattice)?;
    Damage::unless_length(bytes.len(), byte_count(&lattice) as u64)?;
    header.check(&bytes[HEADER_BYTES..])?;
    Damage::unless_tag(header.long(48), tag)?;
    Ok(GridHeader { lattice, paths: header.long(56) })
}

/// Reads a grid's voxels, one per cell of the lattice that [`header`] names. `voxels` is only changed if all is well.
///
/// # Errors
/// The first check that fails.
///
/// ```
/// # use fogbow::{bytes::Damage, covariance::{GridView, Lattice, Voxel, bytes}};
/// # use fogbow::math::{Bounds, Vec3};
/// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [1, 1, 1])?;
/// let mut file = Vec::new();
/// let Ok(()) = bytes::write(&GridView::new(lattice, &[Voxel::EMPTY], 1)?, 7, |part| {
///     file.extend_from_slice(part);
///     Ok::<_, core::convert::Infallible>(())
/// });
/// let mut voxels = [Voxel { weight: 1.0, ..Voxel::EMPTY }];
/// assert_eq!(bytes::read_into(&file, 8, &mut voxels), Err(Damage::Tag { found: 7, due: 8 }.into()));
/// *file.last_mut().unwrap() ^= 1;
/// assert_eq!(bytes::read_into(&file, 7, &mut voxels), Err(Damage::Checksum.into()));
/// assert_eq!(voxels[0].weight, 1.0);   // as before
/// # Ok::<(), fogbow::covariance::LatticeError>(())
/// ```
pub fn read_into(bytes: &[u8], tag: u64, voxels: &mut [Voxel]) -> Result<(), GridBytesError> {
    let lattice = header(bytes, tag)?.lattice;
    if voxels.len() != lattice.cell_count() {
        return Err(GridBytesError::Storage);
    }
    let all = || bytes[HEADER_BYTES..].chunks_exact(size_of::<Voxel>()).map(element::<Voxel>);
    let is_valid = |voxel: &Voxel| {
        let Voxel { sum, weight } = voxel;
        let diagonal = [sum.xx, sum.yy, sum.zz];
        // Where light varies in other directions alone, a sum of variances of 0 keeps a rounding error.
        let rounding = diagonal.iter().map(|x| x.abs()).sum::<f32>() * f32::EPSILON + f32::MIN_POSITIVE;
        let is_finite = weight.is_finite() && sum.to_upper().iter().all(|x| x.is_finite());
        is_finite && *weight >= 0.0 && diagonal.iter().all(|&x| x >= -rounding)
    };
    if let Some(index) = all().position(|voxel| !is_valid(&voxel)) {
        return Err(GridBytesError::Voxel(index));
    }
    for (voxel, read) in voxels.iter_mut().zip(all()) {
        *voxel = read;
    }
    Ok(())
}

/// Reads a grid into memory that grows (`List::default()`) or is lent.
///
/// # Errors
/// The first check that fails.
///
/// ```
/// # use fogbow::covariance::{GridView, Lattice, Voxel, bytes};
/// # use fogbow::math::{Bounds, Vec3};
/// # let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [2, 1, 1])?;
/// # let voxels = [Voxel { weight: 1.0, ..Voxel::EMPTY }; 2];
/// # let mut file = Vec::new();
/// # let Ok(()) = bytes::write(&GridView::new(lattice, &voxels, 100)?, 7, |part| {
/// #     file.extend_from_slice(part);
/// #     Ok::<_, core::convert::Infallible>(())
/// # });
/// let mut storage = [Voxel::EMPTY; 2];
/// let grid = bytes::read(&file, 7, &mut storage[..])?;
/// assert_eq!((grid.view().voxels(), grid.view().paths()), (&voxels[..], 100));
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn read<'s>(
    bytes: &[u8],
    tag: u64,
    storage: impl Into<List<'s, Voxel>>,
) -> Result<CovarianceGrid<'s>, GridBytesError> {
    let GridHeader { lattice, paths } = header(bytes, tag)?;
    let mut voxels = storage.into();
    voxels.reset(lattice.cell_count(), Voxel::EMPTY).map_err(|Full| GridBytesError::Storage)?;
    read_into(bytes, tag, voxels.as_mut_slice())?;
    Ok(CovarianceGrid::new(lattice, voxels, paths))
}
