//! What a medium's constructor refuses.

use crate::phase::LobeError;

/// A value of a medium outside its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MediumError {
    /// Coefficients must be finite and not negative.
    Coefficients,
    /// Emission must be finite and not negative.
    Emission,
    /// A phase function's parameter.
    Phase(LobeError),
    /// A placement must be finite and invertible.
    Placement,
    /// A size of zero, or values that do not fill it.
    Size,
    /// Room lent for block bounds that is not of [`DensityGrid::block_count`](super::DensityGrid::block_count).
    Blocks,
    /// Room lent for means that is not of [`Pyramid::cell_count`](super::Pyramid::cell_count).
    Means,
    /// Densities must be finite and not negative.
    Density,
    /// Outermost cells of a sparse grid that are not empty.
    Border,
    /// A node of a sparse grid that is not there, beside a cell that is not empty.
    Nodes,
    /// A parameter of procedural noise out of its range.
    Noise,
    /// Overlapping media with too many different lobes.
    TooManyLobes,
}

impl core::fmt::Display for MediumError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Coefficients => "absorption and scattering must be finite and not negative",
            Self::Emission => "emission must be finite and not negative",
            Self::Phase(error) => return error.fmt(f),
            Self::Placement => "the placement must be finite and invertible",
            Self::Size => "the grid's size is zero or its values do not fill it",
            Self::Blocks => "the room lent for block bounds is not of the size `DensityGrid::block_count` states",
            Self::Means => "the room lent for means is not of the size `Pyramid::cell_count` states",
            Self::Density => "densities must be finite and not negative",
            Self::Border => "the outermost cells of a sparse grid must be empty",
            Self::Nodes => "a node of the sparse grid is not there, but a cell beside it is not empty",
            Self::Noise => "a parameter of the noise is out of range",
            Self::TooManyLobes => "overlapping media have too many different phase functions",
        })
    }
}

impl core::error::Error for MediumError {}

impl From<LobeError> for MediumError {
    fn from(error: LobeError) -> Self {
        Self::Phase(error)
    }
}
