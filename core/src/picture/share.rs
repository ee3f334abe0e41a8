//! What of a picture is taken, where several machines share it out.

/// The part of a picture that [`Tiles`](super::Tiles) take.
///
/// Parts of tiles have all samples of some of the pixels, parts of samples some of the samples of all pixels; either way every sample of the
/// picture is in one part, and sums of parts merged ([`Tiles::merge`](super::Tiles::merge)) are those of the whole, to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Share {
    /// All of it.
    #[default]
    Whole,
    /// Number `part`, from 0, of so many parts of the tiles, which are spread evenly over the picture.
    Tiles {
        /// Which.
        part: u32,
        /// Of how many.
        of: u32,
    },
    /// Number `part`, from 0, of so many parts of the samples of every pixel, each a run of them.
    Samples {
        /// Which.
        part: u32,
        /// Of how many.
        of: u32,
    },
}

impl Share {
    /// Indices of the first of its samples of a pixel, and of the one behind its last, if there are to be so many in passes of this length.
    /// Passes stay whole where there are enough of them for all parts: what their samples share is then made once.
    ///
    /// ```
    /// use fogbow::picture::Share;
    /// let ranges = |samples, pass| [0, 1, 2].map(|part| Share::Samples { part, of: 3 }.samples(samples, pass));
    /// assert_eq!(ranges(16, 1), [[0, 5], [5, 10], [10, 16]]);
    /// assert_eq!(ranges(30, 8), [[0, 8], [8, 16], [16, 30]]);
    /// assert_eq!(ranges(16, 8), ranges(16, 1));
    /// assert_eq!(Share::Tiles { part: 1, of: 3 }.samples(16, 1), [0, 16]);
    /// ```
    #[must_use]
    pub fn samples(self, samples: u32, pass: u32) -> [u32; 2] {
        let Self::Samples { part, of } = self else { return [0, samples] };
        let (pass, of) = (pass.max(1), of.max(1));
        let length = if samples.div_ceil(pass) >= of { pass } else { 1 };
        let runs = u64::from(samples.div_ceil(length));
        [part, part.saturating_add(1)].map(|end| {
            let run = runs * u64::from(end.min(of)) / u64::from(of);
            (run * u64::from(length)).min(u64::from(samples)) as u32
        })
    }

    /// Whether it has the tile of this column and row.
    ///
    /// ```
    /// use fogbow::picture::Share;
    /// // Neighbours in a row, and in a column, belong to different parts.
    /// let has = |x, y| Share::Tiles { part: 0, of: 4 }.has([x, y]);
    /// assert!(has(0, 0) && !has(1, 0) && !has(0, 1) && has(4, 0));
    /// assert!(Share::Whole.has([3, 3]));
    /// ```
    #[must_use]
    pub fn has(self, [column, row]: [u32; 2]) -> bool {
        let Self::Tiles { part, of } = self else { return true };
        // Rows begin by the golden ratio of a period later each, so that no part is a few columns.
        let of = u64::from(of.max(1));
        let later = (of * 618 / 1000).max(1);
        (u64::from(column) + later * u64::from(row)) % of == u64::from(part)
    }
}
