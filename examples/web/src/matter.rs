//! The media of a world, and where they are.

use alloc::vec;
use alloc::vec::Vec;

use fogbow::host::{Medium, Properties};
use fogbow::math::{Affine3, Bounds};
use fogbow::medium::{
    Density, DensityGrid, FractalNoise, Homogeneous, MediumError, MinMax, Noise, Overlap, Placed, Region,
};
use fogbow::phase::{Lobe, Phase};
use self_cell::{MutBorrow, self_cell};

use super::words::{Fault, Words};

/// One medium in its place.
#[derive(Debug)]
pub(crate) enum Matter<'a> {
    Homogeneous(Placed<'a, Homogeneous>),
    /// A grid ends where its box does.
    Grid(DensityGrid<'a>),
    Noise(Placed<'a, Noise>),
}

impl Matter<'_> {
    fn phase(&self) -> Phase {
        match self {
            Self::Homogeneous(placed) => placed.medium().phase(),
            Self::Grid(grid) => grid.phase(),
            Self::Noise(placed) => placed.medium().phase(),
        }
    }
}

impl Medium for Matter<'_> {
    fogbow::host::delegate_medium!(self, [Homogeneous Grid Noise]);
}

pub(crate) type Matters<'a> = Vec<Matter<'a>>;

/// The words that describe media, and the tables that media need beside them.
struct Store {
    words: Vec<u32>,
    blocks: MutBorrow<Vec<MinMax>>,
}

self_cell!(
    struct Cell {
        owner: Store,
        #[covariant]
        dependent: Matters,
    }
);

/// The media of a world.
pub(crate) struct Media {
    cell: Cell,
    bounds: Bounds,
}

/// A medium as it was described; its cells by where they are among the words.
struct Description {
    properties: Properties,
    region: Region,
    bounds: Bounds,
    kind: Kind,
}

enum Kind {
    Homogeneous,
    Grid { size: [u32; 3], first: usize, is_bytes: bool, placement: Affine3 },
    Noise(FractalNoise),
}

const HOMOGENEOUS: u32 = 0;
const GRID: u32 = 1;
const GRID_OF_BYTES: u32 = 2;
const NOISE: u32 = 3;

impl Media {
    /// From words: how many, then each.
    pub(crate) fn read(words: &mut Words<'_>) -> Result<Self, Fault> {
        let before = *words;
        let descriptions = descriptions(words)?;
        let used = before.left() - words.left();
        let own = { before }.take(used)?.to_vec();
        let blocks = descriptions.iter().map(Description::block_count).sum();
        let store = Store { words: own, blocks: MutBorrow::new(vec![MinMax::default(); blocks]) };
        let bounds = descriptions.iter().fold(Bounds::EMPTY, |all, one| all.union(one.bounds));
        let cell = Cell::try_new(store, |store| matters(store, &descriptions))?;
        let media = Self { cell, bounds };
        // A mixture holds few different phase functions.
        media.checked()?;
        Ok(media)
    }

    fn checked(&self) -> Result<Overlap<'_, Matter<'_>>, MediumError> {
        Overlap::new(self.cell.borrow_dependent(), Matter::phase)
    }

    /// All of them, in the same space.
    pub(crate) fn overlap(&self) -> Overlap<'_, Matter<'_>> {
        self.checked().unwrap_or_default()
    }

    /// The smallest box around them.
    pub(crate) fn bounds(&self) -> Bounds {
        self.bounds
    }
}

impl core::fmt::Debug for Media {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_tuple("Media").field(self.cell.borrow_dependent()).finish()
    }
}

fn descriptions(words: &mut Words<'_>) -> Result<Vec<Description>, Fault> {
    let all = words.left();
    let count = words.integer()? as usize;
    (0..count).map(|number| description(words, all).map_err(|fault| fault.of("medium", number))).collect()
}

fn description(words: &mut Words<'_>, all: usize) -> Result<Description, Fault> {
    let kind = words.integer()?;
    let (absorption, scattering, emission) = (words.colour()?, words.colour()?, words.colour()?);
    let lobe = Lobe::from_words(words.floats()?).ok_or_else(|| Fault::new("no such phase function"))?;
    let properties = Properties { absorption, scattering, emission, phase: lobe.check()?.into() };
    let (region, bounds) = place(words)?;
    let kind = match kind {
        HOMOGENEOUS => Kind::Homogeneous,
        GRID | GRID_OF_BYTES => {
            let size = [words.integer()?, words.integer()?, words.integer()?];
            if DensityGrid::block_count(size) == 0 || size.contains(&0) {
                return Err(MediumError::Size.into());
            }
            let is_bytes = kind == GRID_OF_BYTES;
            let cells = size.iter().map(|n| *n as usize).product::<usize>();
            let first = all - words.left();
            words.take(if is_bytes { cells.div_ceil(4) } else { cells })?;
            let extent = bounds.size();
            let placement = Affine3::from_scale_rotation_translation(extent, fogbow::glam::Quat::IDENTITY, bounds.min);
            Kind::Grid { size, first, is_bytes, placement }
        }
        NOISE => {
            let (frequency, octaves) = (words.float()?, words.integer()?);
            let [lacunarity, gain, offset, amplitude, max_density] = words.floats()?;
            let seed = words.integer()?;
            Kind::Noise(FractalNoise { frequency, octaves, lacunarity, gain, offset, amplitude, max_density, seed })
        }
        _ => return Err(Fault::new("no such kind of medium")),
    };
    Ok(Description { properties, region, bounds, kind })
}

const BOX: u32 = 0;
const SPHERE: u32 = 1;

fn place(words: &mut Words<'_>) -> Result<(Region, Bounds), Fault> {
    match words.integer()? {
        BOX => {
            let bounds = Bounds { min: words.vector()?, max: words.vector()? };
            Ok((Region::bounds(bounds)?, bounds))
        }
        SPHERE => {
            let (centre, radius) = (words.vector()?, words.float()?);
            let bounds = Bounds { min: centre - radius, max: centre + radius };
            Ok((Region::sphere(centre, radius)?, bounds))
        }
        _ => Err(Fault::new("no such region")),
    }
}

impl Description {
    fn block_count(&self) -> usize {
        if let Kind::Grid { size, .. } = self.kind { DensityGrid::block_count(size) } else { 0 }
    }

    fn matter<'a>(&self, words: &'a [u32], blocks: &'a mut [MinMax]) -> Result<Matter<'a>, MediumError> {
        let Properties { absorption, scattering, emission, phase } = self.properties;
        Ok(match self.kind {
            Kind::Homogeneous => {
                let fog = Homogeneous::new(absorption, scattering, phase)?.with_emission(emission)?;
                Matter::Homogeneous(Placed::new(fog, self.region))
            }
            Kind::Noise(shape) => {
                let noise = Noise::new(shape, absorption, scattering, phase)?.with_emission(emission)?;
                Matter::Noise(Placed::new(noise, self.region))
            }
            Kind::Grid { size, first, is_bytes, placement } => {
                let cells = size.iter().map(|n| *n as usize).product::<usize>();
                let density = if is_bytes {
                    Density::U8(&bytemuck::cast_slice(&words[first..first + cells.div_ceil(4)])[..cells])
                } else {
                    Density::F32(bytemuck::cast_slice(&words[first..first + cells]))
                };
                Matter::Grid(DensityGrid::new(size, density, &self.properties, placement, blocks)?)
            }
        })
    }
}

fn matters<'a>(store: &'a Store, descriptions: &[Description]) -> Result<Matters<'a>, Fault> {
    let mut blocks = store.blocks.borrow_mut().as_mut_slice();
    let mut all = Vec::with_capacity(descriptions.len());
    for (number, description) in descriptions.iter().enumerate() {
        let (own, rest) = core::mem::take(&mut blocks).split_at_mut(description.block_count());
        blocks = rest;
        let matter = description.matter(&store.words, own);
        all.push(matter.map_err(|error| Fault::from(error).of("medium", number))?);
    }
    Ok(all)
}
