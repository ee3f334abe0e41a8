//! Media and where they are.

use std::sync::Arc;

use fogbow::host::{Medium, Properties};
use fogbow::math::Affine3;
use fogbow::medium::{
    AnyMedium, Density, DensityGrid, Homogeneous, MediumError, MinMax, NodeBounds, Overlap, Placed, Region, SparseGrid,
};

use fogbow::phase::Phase;
use fogbow::spectrum::Spectrum;

use super::coloured::{Coloured, Stuff};
use super::contained::{Contained, Solid};
use super::glowing::Glowing;
use super::rotated::{Padded, shows_border};
use crate::error::SceneError;
use crate::scene_file::{Container, Matter, MediumDescription, Place, SceneFile};
use crate::transform::{Transform, to_vec3};
use crate::vdb::BrickStorage;
use crate::volume::Values;

/// Tables a medium borrows.
#[derive(Debug, Default)]
pub(super) struct MediumTable {
    /// Bounds of density per block of the grid.
    blocks: Vec<MinMax>,
    /// The same per node of a sparse grid.
    nodes: Vec<NodeBounds>,
    /// The grid with its border repeated, where that shows.
    padded: Option<Padded>,
    /// Those of a grid of temperatures.
    heat: Vec<NodeBounds>,
    /// For each place of the medium, its holes.
    holes: Vec<Vec<Region>>,
}

impl MediumTable {
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.blocks)
            + size_of_val(&*self.nodes)
            + size_of_val(&*self.heat)
            + self.padded.as_ref().map_or(0, |padded| padded.volume.bytes())
    }
}

pub(super) fn tables(scene: &SceneFile) -> Vec<MediumTable> {
    let table = |medium: &MediumDescription| match &medium.matter {
        Matter::Homogeneous { .. } | Matter::Coloured { .. } => MediumTable::default(),
        Matter::Sparse { bricks, .. } => MediumTable { nodes: nodes_of(bricks), ..MediumTable::default() },
        Matter::Grid { volume, to_world, .. } => {
            let padded = shows_border(volume, to_world, &medium.places)
                .then(|| Padded::new(volume, to_world, &medium.places))
                .flatten();
            let size = padded.as_ref().map_or(volume.size, |padded| padded.volume.size);
            MediumTable {
                blocks: vec![MinMax::default(); DensityGrid::block_count(size)],
                padded,
                ..MediumTable::default()
            }
        }
    };
    let heated = |medium: &MediumDescription| MediumTable {
        heat: medium.heat.as_ref().map_or(vec![], |heat| nodes_of(&heat.bricks)),
        ..table(medium)
    };
    scene.media.iter().map(heated).collect()
}

/// Room for the bounds of a sparse grid.
fn nodes_of(bricks: &BrickStorage) -> Vec<NodeBounds> {
    vec![NodeBounds::EMPTY; bricks.bricks().slots.len() / NodeBounds::SLOTS]
}

/// The media of a scene, in the simplest form that holds them all: tracking is compiled for each.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one per scene")]
pub enum Media<'a> {
    /// One that is the same everywhere inside its container.
    Homogeneous(Placed<'a, Homogeneous>),
    /// One grid.
    Grid(Placed<'a, DensityGrid<'a>>),
    /// Several, or none.
    Several(Vec<Placed<'a, AnyMedium<'a>>>),
    /// In containers of any form.
    Contained(Vec<Contained<'a>>),
}

/// Work to be done with the medium of a scene, whatever its type: see [`Media::with`].
pub trait WithMedium {
    /// What the work gives.
    type Output;

    /// Does the work.
    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output;
}

/// Whether a medium emits light.
struct Glow;

impl WithMedium for Glow {
    type Output = bool;

    fn with<M: Medium + Sync>(self, medium: &M) -> bool {
        medium.is_emissive()
    }
}

impl<'a> Media<'a> {
    pub(super) fn new(scene: &'a SceneFile, tables: &'a mut [MediumTable]) -> Result<Self, SceneError> {
        // A rotated grid may fill a part of its container only.
        let is_cut = |(medium, table): (&MediumDescription, &MediumTable)| {
            let is_refused = |padded: &Padded| medium.places.iter().any(|p| padded.region(&p.container).is_err());
            table.padded.as_ref().is_some_and(is_refused)
        };
        let is_limited = |medium: &MediumDescription| {
            medium.limits.is_some() || medium.heat.is_some() || matches!(medium.matter, Matter::Coloured { .. })
        };
        let has_cuts = scene.media.iter().zip(&*tables).any(is_cut) || scene.media.iter().any(is_limited);
        if has_cuts || scene.media.iter().flat_map(|m| &m.places).any(needs_solids) {
            return Self::contained(scene, tables);
        }
        let (mut placed, mut all_holes) = (Vec::new(), Vec::new());
        for (medium, table) in scene.media.iter().zip(tables) {
            let fail = |reason: String| SceneError {
                file: scene.file.clone(),
                line: None,
                element: format!("<medium id=\"{}\">", medium.id),
                attribute: None,
                reason,
            };
            for (one, holes) in place(medium, table).map_err(|e| fail(e.to_string()))? {
                placed.push(one);
                all_holes.push(holes);
            }
        }
        // A mixture holds few different phase functions.
        Overlap::new(&placed, |p| p.medium().phase()).map_err(|e| SceneError {
            file: scene.file.clone(),
            line: None,
            element: "<medium>".to_owned(),
            attribute: None,
            reason: e.to_string(),
        })?;
        Ok(match (&placed[..], &all_holes[..]) {
            ([one], [holes]) => match *one.medium() {
                AnyMedium::Homogeneous(fog) => Self::Homogeneous(moved(one, holes, fog)),
                AnyMedium::Grid(grid) => Self::Grid(moved(one, holes, grid)),
                AnyMedium::Sparse(_) | AnyMedium::Noise(_) => Self::Several(placed),
            },
            _ => Self::Several(placed),
        })
    }

    /// Media of which one at least has a container that is no box and no ball.
    fn contained(scene: &'a SceneFile, tables: &'a mut [MediumTable]) -> Result<Self, SceneError> {
        let fail = |element: String, reason: String| SceneError {
            file: scene.file.clone(),
            line: None,
            element,
            attribute: None,
            reason,
        };
        let mut media = Vec::new();
        for (description, table) in scene.media.iter().zip(tables) {
            let refused = |e: Refusal| fail(format!("<medium id=\"{}\">", description.id), e.to_string());
            let MediumTable { blocks, nodes, padded, heat, .. } = table;
            let padded = padded.as_ref();
            let medium = match &description.matter {
                Matter::Coloured { extinction, albedo, scale, phase } => {
                    let coloured = Coloured::new(extinction, albedo, *scale, *phase);
                    Stuff::Coloured(coloured.ok_or_else(|| refused(MediumError::Coefficients.into()))?)
                }
                _ => {
                    let medium = matter(description, padded, (blocks, nodes)).map_err(refused)?;
                    match &description.heat {
                        Some(hot) => Stuff::Glowing(Glowing::new(medium, hot, heat).map_err(|e| refused(e.into()))?),
                        None => Stuff::Core(medium),
                    }
                }
            };
            for place in &description.places {
                let solids = |containers: &[Container]| containers.iter().map(solid).collect::<Result<Vec<_>, _>>();
                let own = match &place.container {
                    Container::Cube(_) | Container::Sphere { .. } if padded.is_none() => {
                        region_of(description, place).map(Solid::Region)
                    }
                    other => solid(other),
                };
                let mut within = vec![own.map_err(|e| refused(e.into()))?];
                if let Some(padded) = padded {
                    within.push(Solid::Region(padded.around().map_err(|e| refused(e.into()))?));
                }
                if let Some([low, high]) = description.limits {
                    within.push(Solid::Region(straight(low, high).map_err(|e| refused(e.into()))?));
                }
                let holes = solids(&place.holes).map_err(|e| refused(e.into()))?;
                media.push(Contained { medium, within, holes });
            }
        }
        Overlap::new(&media, |p| p.medium().phase()).map_err(|e| fail("<medium>".to_owned(), e.to_string()))?;
        Ok(Self::Contained(media))
    }

    /// Whether there is at most one medium, the same everywhere in its container.
    #[must_use]
    pub fn is_homogeneous(&self) -> bool {
        match self {
            Self::Homogeneous(_) => true,
            Self::Grid(_) => false,
            Self::Several(media) => media.is_empty(),
            Self::Contained(_) => false,
        }
    }

    /// Whether any of them emits light.
    #[must_use]
    pub fn glow(&self) -> bool {
        self.with(Glow)
    }

    /// The phase functions there are.
    #[must_use]
    pub fn phases(&self) -> Vec<Phase> {
        match self {
            Self::Homogeneous(fog) => vec![fog.medium().phase()],
            Self::Grid(grid) => vec![grid.medium().phase()],
            Self::Several(media) => media.iter().map(|p| p.medium().phase()).collect(),
            Self::Contained(media) => media.iter().map(|p| p.medium().phase()).collect(),
        }
    }

    /// Does `work` with the medium. It is compiled for each of the simple forms, and once for all others, which take so long themselves that a call by
    /// pointer hardly shows.
    pub fn with<W: WithMedium>(&self, work: W) -> W::Output {
        match self {
            Self::Homogeneous(fog) => with_simple(work, fog),
            Self::Grid(grid) => with_simple(work, grid),
            // The number of lobes was checked when the list was made.
            Self::Several(media) => with_any(work, &Overlap::new(media, |p| p.medium().phase()).unwrap_or_default()),
            Self::Contained(media) => match &media[..] {
                [one] => with_any(work, one),
                several => with_any(work, &Overlap::new(several, |p| p.medium().phase()).unwrap_or_default()),
            },
        }
    }
}

/// Does `work` with a medium of a type that it is compiled for; in this crate's unit tests, which need no speed, as with any other.
fn with_simple<W: WithMedium, M: Medium + Sync>(work: W, medium: &M) -> W::Output {
    if cfg!(test) { with_any(work, medium) } else { work.with(medium) }
}

/// Does `work` with a medium of a type that it need not be compiled for.
fn with_any<W: WithMedium>(work: W, medium: &(dyn Medium + Sync)) -> W::Output {
    work.with(&medium)
}

/// `medium` in the place of another.
fn moved<'a, N>(place: &Placed<'_, AnyMedium<'_>>, holes: &'a [Region], medium: N) -> Placed<'a, N> {
    Placed::new(medium, *place.region()).with_holes(holes)
}

/// A placed medium and, once more, its holes.
type PlacedHoles<'a> = (Placed<'a, AnyMedium<'a>>, &'a [Region]);

fn place<'a>(medium: &'a MediumDescription, table: &'a mut MediumTable) -> Result<Vec<PlacedHoles<'a>>, Refusal> {
    let MediumTable { blocks, nodes, padded, holes, .. } = table;
    let padded = padded.as_ref();
    let any = matter(medium, padded, (blocks, nodes))?;
    for place in &medium.places {
        holes.push(place.holes.iter().map(region).collect::<Result<_, _>>()?);
    }
    let mut placed = Vec::new();
    for (place, holes) in medium.places.iter().zip(&*holes) {
        let region = match padded {
            Some(padded) => padded.region(&place.container)?,
            None => region_of(medium, place)?,
        };
        placed.push((Placed::new(any, region).with_holes(holes), holes.as_slice()));
    }
    Ok(placed)
}

/// Whether a place is more than a box or ball with such holes.
fn needs_solids(place: &Place) -> bool {
    let is_special = |c: &Container| matches!(c, Container::Body(_) | Container::Everywhere);
    is_special(&place.container) || place.holes.iter().any(is_special)
}

fn solid(container: &Container) -> Result<Solid, MediumError> {
    match container {
        Container::Body(body) => Ok(Solid::Body(Arc::clone(body))),
        other => region(other).map(Solid::Region),
    }
}

/// The box between two corners (m).
pub(super) fn straight(low: [f64; 3], high: [f64; 3]) -> Result<Region, MediumError> {
    let size = [0, 1, 2].map(|i| high[i] - low[i]);
    Region::unit_cube(Transform::scaling(size).then(&Transform::translation(low)).to_affine())
}

/// The medium without its place.
fn matter<'a>(
    medium: &'a MediumDescription,
    padded: Option<&'a Padded>,
    (blocks, nodes): (&'a mut [MinMax], &'a mut [NodeBounds]),
) -> Result<AnyMedium<'a>, Refusal> {
    Ok(match &medium.matter {
        // Of the host: see `Media::contained`.
        Matter::Coloured { .. } => AnyMedium::from(Homogeneous::new(Spectrum::ZERO, Spectrum::ZERO, Phase::ISOTROPIC)?),
        Matter::Homogeneous { absorption, scattering, phase } => {
            let fog = Homogeneous::new(*absorption, *scattering, *phase)?;
            let glow = *absorption * medium.glow;
            AnyMedium::from(if glow.is_black() { fog } else { fog.with_emission(glow)? })
        }
        Matter::Grid { volume, to_world, absorption, scattering, phase } => {
            if padded.is_none() && shows_border(volume, to_world, &medium.places) {
                return Err(Refusal::Border);
            }
            let (volume, to_world) = padded.map_or((&**volume, to_world), |padded| (&padded.volume, &padded.to_world));
            let density = match &volume.values {
                Values::F32(values) => Density::F32(values),
                Values::U8(values) => Density::U8(values),
            };
            let placement = to_world.to_affine();
            let (absorption, scattering, phase) = (*absorption, *scattering, *phase);
            let properties = Properties { absorption, scattering, phase, emission: absorption * medium.glow };
            AnyMedium::from(DensityGrid::new(volume.size, density, &properties, placement, blocks)?)
        }
        Matter::Sparse { bricks, to_world, absorption, scattering, phase } => {
            let (absorption, scattering, phase) = (*absorption, *scattering, *phase);
            let properties = Properties { absorption, scattering, phase, emission: absorption * medium.glow };
            AnyMedium::from(SparseGrid::new(bricks.bricks(), &properties, to_world.to_affine(), nodes)?)
        }
    })
}

/// Why a medium cannot be built.
pub(super) enum Refusal {
    Medium(MediumError),
    Border,
}

impl From<MediumError> for Refusal {
    fn from(error: MediumError) -> Self {
        Self::Medium(error)
    }
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Medium(error) => error.fmt(f),
            Self::Border => f.write_str(
                "the container of a rotated grid must lie in the axis-aligned box around it, or that box in the container, \
                 or the cells along its border must be empty",
            ),
        }
    }
}

pub(super) fn region(container: &Container) -> Result<Region, MediumError> {
    match container {
        // Bodies are no regions of the core: see `solid`.
        Container::Everywhere | Container::Body(_) => Ok(Region::Everywhere),
        Container::Cube(to_world) => {
            let centred = Transform::translation([-0.5; 3]).then(&Transform::scaling([2.0; 3]));
            let placement: Affine3 = centred.then(to_world).to_affine();
            Region::unit_cube(placement)
        }
        Container::Sphere { centre, radius } => Region::sphere(to_vec3(*centre), *radius as f32),
    }
}

/// The container; all of space for a grid that lies inside it, because a grid ends by itself.
fn region_of(medium: &MediumDescription, place: &Place) -> Result<Region, MediumError> {
    if let Matter::Grid { to_world, .. } | Matter::Sparse { to_world, .. } = &medium.matter {
        let corner = |i: u32| [1, 2, 4].map(|bit| if i & bit == 0 { 0.0 } else { 1.0 });
        if (0..8).all(|i| place.container.contains(to_world.point(corner(i)))) {
            return Ok(Region::Everywhere);
        }
    }
    region(&place.container)
}
