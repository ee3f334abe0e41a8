//! Numbers in files, and errors that say where.

/// What is wrong with a file, and where in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Fault {
    pub(super) place: String,
    pub(super) reason: String,
}

impl Fault {
    pub(super) fn new(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { place: place.into(), reason: reason.into() }
    }
}

/// Bytes that are read one after the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    /// What is being read: `grid "density"`.
    pub(super) place: &'a str,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8], place: &'a str) -> Self {
        Self { bytes, at: 0, place }
    }

    /// The same bytes, read from another position.
    pub(super) fn at(&self, at: u64, place: &'a str) -> Result<Self, Fault> {
        let at = usize::try_from(at).ok().filter(|at| *at <= self.bytes.len());
        let at = at.ok_or_else(|| Fault::new(place, "lies beyond the end of the file"))?;
        Ok(Self { bytes: self.bytes, at, place })
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.at >= self.bytes.len()
    }

    pub(super) fn position(&self) -> usize {
        self.at
    }

    pub(super) fn fault(&self, reason: impl Into<String>) -> Fault {
        Fault::new(self.place, reason)
    }

    pub(super) fn take(&mut self, count: u64) -> Result<&'a [u8], Fault> {
        let found = usize::try_from(count).ok().and_then(|count| {
            let end = self.at.checked_add(count)?;
            let found = self.bytes.get(self.at..end)?;
            self.at = end;
            Some(found)
        });
        let left = self.bytes.len() - self.at.min(self.bytes.len());
        found.ok_or_else(|| {
            self.fault(format!("the file ends here: {count} bytes are due at byte {}, {left} follow", self.at))
        })
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let bytes = self.take(N as u64)?;
        bytes.try_into().map_err(|_| self.fault("the file ends here"))
    }

    pub(super) fn u8(&mut self) -> Result<u8, Fault> {
        self.array::<1>().map(|b| b[0])
    }
    pub(super) fn u16(&mut self) -> Result<u16, Fault> {
        self.array().map(u16::from_le_bytes)
    }
    pub(super) fn u32(&mut self) -> Result<u32, Fault> {
        self.array().map(u32::from_le_bytes)
    }
    pub(super) fn i32(&mut self) -> Result<i32, Fault> {
        self.array().map(i32::from_le_bytes)
    }
    pub(super) fn i64(&mut self) -> Result<i64, Fault> {
        self.array().map(i64::from_le_bytes)
    }
    pub(super) fn u64(&mut self) -> Result<u64, Fault> {
        self.array().map(u64::from_le_bytes)
    }
    pub(super) fn f32(&mut self) -> Result<f32, Fault> {
        self.array().map(f32::from_le_bytes)
    }
    pub(super) fn f64(&mut self) -> Result<f64, Fault> {
        self.array().map(f64::from_le_bytes)
    }
    pub(super) fn coordinates(&mut self) -> Result<[i32; 3], Fault> {
        Ok([self.i32()?, self.i32()?, self.i32()?])
    }

    /// A text with its length before it.
    pub(super) fn text(&mut self) -> Result<String, Fault> {
        let length = self.u32()?;
        Ok(String::from_utf8_lossy(self.take(u64::from(length))?).into_owned())
    }

    /// A mask of `N` words.
    pub(super) fn mask<const N: usize>(&mut self) -> Result<[u64; N], Fault> {
        let mut mask = [0; N];
        for word in &mut mask {
            *word = self.u64()?;
        }
        Ok(mask)
    }
}

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    Half,
    Float,
    Double,
}

impl Number {
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Half => 2,
            Self::Float => 4,
            Self::Double => 8,
        }
    }

    pub(super) fn read(self, cursor: &mut Cursor<'_>) -> Result<f32, Fault> {
        Ok(match self {
            Self::Half => half::f16::from_bits(cursor.u16()?).to_f32(),
            Self::Float => cursor.f32()?,
            Self::Double => cursor.f64()? as f32,
        })
    }

    /// Numbers one after the other.
    pub(super) fn all(self, bytes: &[u8], mut each: impl FnMut(f32)) {
        match self {
            Self::Half => bytes.as_chunks::<2>().0.iter().for_each(|b| each(half::f16::from_le_bytes(*b).to_f32())),
            Self::Float => bytes.as_chunks::<4>().0.iter().for_each(|b| each(f32::from_le_bytes(*b))),
            Self::Double => bytes.as_chunks::<8>().0.iter().for_each(|b| each(f64::from_le_bytes(*b) as f32)),
        }
    }
}

/// Whether a bit of a mask is set.
pub(super) fn is_set(mask: &[u64], index: usize) -> bool {
    mask.get(index / 64).is_some_and(|word| word >> (index % 64) & 1 == 1)
}

/// The place of a child of a node, `(x n + y) n + z` of `n = 2^log`, in children.
pub(super) fn child_place(index: usize, log: u32) -> [i32; 3] {
    let mask = (1 << log) - 1;
    [index >> (2 * log), index >> log & mask, index & mask].map(|c| c as i32)
}
