//! The kinds of caches: what each holds, where it has records, what lights it, and in which order they are made.

use super::places::Place;

/// What a cache holds. A further kind is a variant, a row of the table of kinds and the steps that make it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Kind {
    /// Light of the lights, scattered once.
    Single,
    /// Light of surfaces and of a sky, scattered once.
    Surface,
    /// Light scattered more than once.
    Multiple,
    /// Indirect irradiance on surfaces that eye rays see.
    Irradiance,
    /// Indirect irradiance on all surfaces, coarsely: lights all other kinds.
    CoarseIrradiance,
}

impl Kind {
    /// How many there are.
    pub const COUNT: usize = 5;

    /// All, in the order of their numbers.
    pub const ALL: [Self; Self::COUNT] =
        [Self::Single, Self::Surface, Self::Multiple, Self::Irradiance, Self::CoarseIrradiance];

    /// Those that pictures are made from; the others serve their making.
    pub const FINAL: [Self; 4] = [Self::Single, Self::Surface, Self::Multiple, Self::Irradiance];

    /// In words.
    ///
    /// ```
    /// # use fogbow::cache::Kind;
    /// assert_eq!(Kind::CoarseIrradiance.name(), "coarse irradiance");
    /// ```
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.row().name
    }

    /// Whether its records lie on surfaces; if not, in the medium.
    ///
    /// ```
    /// # use fogbow::cache::Kind;
    /// assert!(Kind::Irradiance.is_on_surfaces() && !Kind::Multiple.is_on_surfaces());
    /// ```
    #[must_use]
    pub const fn is_on_surfaces(self) -> bool {
        !matches!(self.row().places, Places::InMedium)
    }

    pub(super) const fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }
}

/// Where a kind has records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Places {
    InMedium,
    /// On surfaces that eye rays see.
    InSight,
    /// On surfaces that eye rays see or that light what they see.
    OnSurfaces,
}

impl Places {
    /// Whether a place is one of them.
    pub(super) fn hold(self, place: &Place) -> bool {
        match self {
            Self::InMedium => place.normal.is_none(),
            Self::OnSurfaces => place.normal.is_some(),
            Self::InSight => place.normal.is_some() && place.is_seen,
        }
    }
}

/// What is known of a kind beforehand.
#[derive(Debug)]
pub(super) struct Row {
    name: &'static str,
    pub(super) places: Places,
    /// Stream of random numbers of new records. Of estimates anew: [`Pass::Anew`], [`Pass::Again`].
    pub(super) stream: u64,
    /// Relative variance of samples ([`Guide::relative_variance`](super::Guide::relative_variance)) up to which the usual
    /// number of them will do. Where fog fills a room the means are about 1 for light of surfaces, 5 for multiple scattering
    /// and 2 for irradiance; where light falls through windows ten times that. Smaller: more samples everywhere; larger: noise where light is hard to find.
    pub(super) spread: f32,
    /// Whether all other records stand on these, so that the first of them get more samples, and their noise is told by what others read of them.
    pub(super) is_ground: bool,
}

const TABLE: [Row; Kind::COUNT] = {
    use Places::{InMedium, InSight, OnSurfaces};
    [
        Row { name: "single", places: InMedium, stream: 0, spread: f32::INFINITY, is_ground: false },
        Row { name: "surface", places: InMedium, stream: 1, spread: 3.0, is_ground: false },
        Row { name: "multiple", places: InMedium, stream: 2, spread: 12.0, is_ground: false },
        Row { name: "irradiance", places: InSight, stream: 3, spread: 6.0, is_ground: false },
        Row { name: "coarse irradiance", places: OnSurfaces, stream: 4, spread: 6.0, is_ground: true },
    ]
};

/// What a step does to a kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pass {
    /// New records wherever they are missing.
    Make,
    /// All records of this fill estimated anew, with their radii held and random numbers of `stream`. Nothing stays of what they were, lit by records that were not all there yet.
    Anew { stream: u64 },
    /// As [`Pass::Anew`], mixed with what they were.
    Again { stream: u64 },
    /// As [`Pass::Again`], as often as the noise of the picture asks for, and where estimates are in doubt.
    More { stream: u64 },
    /// All records of this fill, on surfaces, averaged with their neighbours.
    Smooth,
}

/// A step of a fill, or eye rays that read what there is by then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Turn {
    Of(Step),
    /// Records are read by one half of the photons and by the other.
    Doubt,
    /// Light at some places is estimated by what surfaces are known to send by then.
    Ground {
        /// After that has been estimated again.
        is_second: bool,
    },
    Glances {
        /// After records have been estimated anew.
        is_second: bool,
    },
}

/// One step of a fill. All steps are lit by photons and by coarse irradiance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    pub(super) kind: Kind,
    pub(super) pass: Pass,
}

/// What the first estimate of a record counts beside a usual one. From it the radius comes, and it had to draw its samples
/// blindly: smaller, and it is wasted; larger, and its noise, which has a say in the radius, makes light too dark.
pub(super) const FIRST_COUNTS: f32 = 0.5;

/// Steps in their order: first coarse irradiance, by which surfaces light everything else, once more, in halves, from what it was revised to, and again as often as
/// others need it and where it is in doubt; then the final kinds, none of which needs another. What is to be averaged comes last.
pub(super) const TURNS: [Turn; 21] = {
    use Kind::{CoarseIrradiance, Irradiance, Multiple, Single, Surface};
    const fn make(kind: Kind) -> Turn {
        Turn::Of(Step { kind, pass: Pass::Make })
    }
    const fn smooth(kind: Kind) -> Turn {
        Turn::Of(Step { kind, pass: Pass::Smooth })
    }
    const fn anew(kind: Kind, stream: u64) -> Turn {
        Turn::Of(Step { kind, pass: Pass::Anew { stream } })
    }
    const fn again(kind: Kind, stream: u64) -> Turn {
        Turn::Of(Step { kind, pass: Pass::Again { stream } })
    }
    const fn more(kind: Kind, stream: u64) -> Turn {
        Turn::Of(Step { kind, pass: Pass::More { stream } })
    }
    [
        make(CoarseIrradiance),
        Turn::Doubt,
        anew(CoarseIrradiance, 0),
        Turn::Ground { is_second: false },
        again(CoarseIrradiance, 102),
        Turn::Ground { is_second: true },
        more(CoarseIrradiance, 4000),
        smooth(CoarseIrradiance),
        make(Surface),
        make(Single),
        make(Multiple),
        make(Irradiance),
        Turn::Glances { is_second: false },
        again(Surface, 1),
        again(Multiple, 100),
        again(Irradiance, 101),
        Turn::Glances { is_second: true },
        more(Surface, 1000),
        more(Multiple, 2000),
        more(Irradiance, 3000),
        smooth(Irradiance),
    ]
};
