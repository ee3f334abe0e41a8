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
//! | 64 | 8 | [`Crc`] of bytes 0 to 64 and of all from 72 on |
//! | 72 | 28 n | voxels: `Σ I R S Rᵀ` (xx, xy, xz, yy, yz, zz), `Σ I`, as `f32` |

use core::fmt;

use glam::Vec3;

use super::grid::{CovarianceGrid, GridView};
use super::lattice::Lattice;
use super::metrics::Voxel;
use crate::bytes::{Crc, element, elements};
use crate::math::Bounds;
use crate::storage::{Full, List};

/// The first bytes: not text, and damaged by whatever changes ends of lines.
pub const MAGIC: [u8; 8] = *b"\x89FOGCOV\n";

/// Of the layout above.
pub const VERSION: u32 = 1;

/// Length of the header (bytes).
pub const HEADER_BYTES: usize = 72;

/// Why bytes are not the grid asked for, in the order of the checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GridBytesError {
    /// Fewer bytes than a header.
    NoHeader {
        /// How many there are.
        found: usize,
    },
    /// Other first bytes: something else altogether.
    Magic,
    /// Of another version than [`VERSION`].
    Version(u32),
    /// Bounds or numbers of cells that no grid has.
    Lattice,
    /// Not as many bytes as the header says.
    Length {
        /// How many there are.
        found: usize,
        /// How many the header says.
        due: usize,
    },
    /// Damaged.
    Checksum,
    /// Made for something else.
    Tag {
        /// What it was made for.
        found: u64,
        /// What was asked for.
        due: u64,
    },
    /// A voxel that no photons leave: negative or not finite.
    Voxel(usize),
    /// The storage does not have one element per cell.
    Storage,
}

impl fmt::Display for GridBytesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoHeader { found } => {
                write!(f, "{found} bytes are no covariance grid: its header has {HEADER_BYTES}")
            }
            Self::Magic => f.write_str("this is no covariance grid"),
            Self::Version(version) => write!(f, "version {version} of the format is not known, only {VERSION}"),
            Self::Lattice => f.write_str("the grid's bounds or numbers of cells are impossible"),
            Self::Length { found, due } => write!(f, "there are {found} bytes, and the header speaks of {due}"),
            Self::Checksum => f.write_str("the bytes are damaged"),
            Self::Tag { found, due } => write!(f, "made for something else (tag {found:016x}, not {due:016x})"),
            Self::Voxel(index) => write!(f, "voxel {index} is impossible"),
            Self::Storage => f.write_str("there is no memory for one element per cell"),
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
    let mut header = [0; HEADER_BYTES];
    let lattice = grid.lattice();
    let corners = [lattice.bounds().min, lattice.bounds().max];
    header[..8].copy_from_slice(&MAGIC);
    header[8..12].copy_from_slice(&VERSION.to_le_bytes());
    for (i, n) in lattice.size().iter().enumerate() {
        header[12 + 4 * i..][..4].copy_from_slice(&n.to_le_bytes());
    }
    for (i, c) in corners.iter().flat_map(|corner| corner.to_array()).enumerate() {
        header[24 + 4 * i..][..4].copy_from_slice(&c.to_le_bytes());
    }
    header[48..56].copy_from_slice(&tag.to_le_bytes());
    header[56..64].copy_from_slice(&grid.paths().to_le_bytes());
    let mut crc = Crc::new();
    crc.add(&header[..64]);
    let Ok(()) = elements(grid.voxels(), &mut |part: &[u8]| {
        crc.add(part);
        Ok::<_, core::convert::Infallible>(())
    });
    header[64..].copy_from_slice(&crc.value().to_le_bytes());
    sink(&header)?;
    elements(grid.voxels(), &mut sink)
}

fn word<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut out = [0; N];
    out.copy_from_slice(&bytes[at..at + N]);
    out
}

/// The header of a grid that [`write()`] gave, after all checks but those of its voxels' values.
///
/// # Errors
/// The first check that fails.
///
/// ```
/// # use fogbow::covariance::bytes::{self, GridBytesError};
/// assert_eq!(bytes::header(b"P6", 7), Err(GridBytesError::NoHeader { found: 2 }));
/// assert_eq!(bytes::header(&[0; 200], 7), Err(GridBytesError::Magic));   // long enough, but no grid
/// ```
pub fn header(bytes: &[u8], tag: u64) -> Result<GridHeader, GridBytesError> {
    if bytes.len() < HEADER_BYTES {
        return Err(GridBytesError::NoHeader { found: bytes.len() });
    }
    if bytes[..8] != MAGIC {
        return Err(GridBytesError::Magic);
    }
    let version = u32::from_le_bytes(word(bytes, 8));
    if version != VERSION {
        return Err(GridBytesError::Version(version));
    }
    let size = [12, 16, 20].map(|at| u32::from_le_bytes(word(bytes, at)));
    let corner = |at: usize| Vec3::from([0, 4, 8].map(|i| f32::from_le_bytes(word(bytes, at + i))));
    let bounds = Bounds { min: corner(24), max: corner(36) };
    let lattice = Lattice::new(bounds, size).map_err(|_| GridBytesError::Lattice)?;
    let due = byte_count(&lattice);
    if bytes.len() != due {
        return Err(GridBytesError::Length { found: bytes.len(), due });
    }
    let mut crc = Crc::new();
    crc.add(&bytes[..64]);
    crc.add(&bytes[HEADER_BYTES..]);
    if crc.value() != u64::from_le_bytes(word(bytes, 64)) {
        return Err(GridBytesError::Checksum);
    }
    let found = u64::from_le_bytes(word(bytes, 48));
    if found != tag {
        return Err(GridBytesError::Tag { found, due: tag });
    }
    Ok(GridHeader { lattice, paths: u64::from_le_bytes(word(bytes, 56)) })
}

/// Reads a grid's voxels, one per cell of the lattice that [`header`] names. `voxels` is only changed if all is well.
///
/// # Errors
/// The first check that fails.
///
/// ```
/// # use fogbow::covariance::{GridView, Lattice, Voxel, bytes::{self, GridBytesError}};
/// # use fogbow::math::{Bounds, Vec3};
/// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [1, 1, 1])?;
/// let mut file = Vec::new();
/// let Ok(()) = bytes::write(&GridView::new(lattice, &[Voxel::EMPTY], 1)?, 7, |part| {
///     file.extend_from_slice(part);
///     Ok::<_, core::convert::Infallible>(())
/// });
/// let mut voxels = [Voxel { weight: 1.0, ..Voxel::EMPTY }];
/// assert_eq!(bytes::read_into(&file, 8, &mut voxels), Err(GridBytesError::Tag { found: 7, due: 8 }));
/// *file.last_mut().unwrap() ^= 1;
/// assert_eq!(bytes::read_into(&file, 7, &mut voxels), Err(GridBytesError::Checksum));
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
