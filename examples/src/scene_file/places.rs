//! Which medium is where: containers and holes.
//!
//! Mitsuba tells media apart by the surfaces a path crosses, this renderer by where a point lies.
//! Both agree as long as every boundary names what is on both sides; what would not agree is an
//! error here.

use std::collections::HashMap;

use super::description::{Container, Field, Matter, MediumDescription, Place, SceneFile, Sensor};
use super::element::Element;
use super::media;
use super::shapes::ShapeElement;
use super::tree::NodeId;
use crate::error::SceneError;
use crate::transform::{Transform, to_array};
use crate::world::bounds_of;

/// A container with the media at its sides.
struct Boundary<'a, 's> {
    source: &'s ShapeElement<'a>,
    container: Container,
    /// Index of the medium inside.
    interior: Option<usize>,
    /// Index of the medium around.
    exterior: Option<usize>,
}

/// All media with their places.
pub(super) fn read<'a>(
    declared: &[Element<'a>],
    shapes: &[ShapeElement<'a>],
    sensor: &Sensor,
    sensor_element: &Element<'a>,
    sensor_medium: Option<Element<'a>>,
) -> Result<Vec<MediumDescription>, SceneError> {
    let mut found = Found { media: Vec::new(), index: HashMap::new() };
    for element in declared {
        found.index_of(element)?;
    }
    let mut boundaries = Vec::new();
    for source in shapes {
        let is_clear = source.shape.as_ref().is_none_or(|s| s.material.transmits());
        if !is_clear {
            if source.interior.is_some() {
                source.element.suspicious("light never reaches the medium inside an opaque shape");
            }
            continue;
        }
        let mut side = |element: &Option<Element<'a>>| element.map(|e| found.index_of(&e)).transpose();
        let (interior, exterior) = (side(&source.interior)?, side(&source.exterior)?);
        if interior.is_none() && exterior.is_none() {
            continue;
        }
        let Some(container) = source.container.clone() else {
            return Err(source.element.error("only a closed shape can hold a medium"));
        };
        let (interior, exterior) = if source.is_inside_out { (exterior, interior) } else { (interior, exterior) };
        boundaries.push(Boundary { source, container, interior, exterior });
    }
    check_overlaps(&boundaries)?;
    // The smallest other container around this one's middle is what it lies in.
    let numbered = boundaries.iter().enumerate();
    let around: Vec<Option<usize>> =
        numbered.map(|(number, b)| surrounding(&boundaries, b.container.centre(), Some(number))).collect();
    // What fills the rest of space.
    let said = sensor_medium.map(|m| found.index_of(&m)).transpose()?;
    let camera_in = surrounding(&boundaries, sensor.to_world.column(3), None);
    let outermost = boundaries.iter().zip(&around).filter(|(_, around)| around.is_none()).map(|(b, _)| b);
    let rest = match camera_in {
        None => said,
        Some(_) => outermost.clone().find_map(|b| b.exterior),
    };
    if let Some(medium) = rest {
        let holes = outermost.map(|b| b.container.clone()).collect();
        found.media[medium].places.push(Place { container: Container::Everywhere, holes });
    }
    for boundary in &boundaries {
        if let Some(medium) = boundary.interior {
            found.media[medium].places.push(Place { container: boundary.container.clone(), holes: Vec::new() });
        }
    }
    for (boundary, around) in boundaries.iter().zip(&around) {
        check_exterior(&found, boundary, around.map_or(rest, |i| boundaries[i].interior))?;
        if let (Some(outer), Some(medium)) = (*around, boundary.exterior) {
            let container = &boundaries[outer].container;
            let places = &mut found.media[medium].places;
            for place in places.iter_mut().filter(|p| p.container == *container) {
                place.holes.push(boundary.container.clone());
            }
        }
    }
    let is = camera_in.map_or(rest, |i| boundaries[i].interior);
    if said != is {
        let (said, is) = (found.name(said), found.name(is));
        return Err(sensor_element.error(format!("its \"medium\" is {said}, but the camera stands in {is}")));
    }
    for (medium, element) in found.media.iter().zip(&found.elements()) {
        if medium.places.is_empty() {
            element.suspicious("no shape that light can enter has this medium as its interior: it is nowhere");
        }
    }
    for medium in &mut found.media {
        // What reaches nowhere beyond need not be cut.
        let Some([low, high]) = medium.limits else { continue };
        let reach = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max) * 1e-4;
        let is_within = |place: &Place| {
            let [from, to] = place.container.bounds();
            (0..3).all(|i| from[i] >= low[i] - reach && to[i] <= high[i] + reach)
        };
        if medium.places.iter().all(is_within) {
            medium.limits = None;
        }
    }
    Ok(found.media.into_iter().map(|m| m.description).filter(|m| !m.places.is_empty()).collect())
}

/// # Errors
/// Containers that overlap in part: which medium is there would depend on the way that light takes.
fn check_overlaps(boundaries: &[Boundary<'_, '_>]) -> Result<(), SceneError> {
    for (number, one) in boundaries.iter().enumerate() {
        for other in boundaries.iter().take(number) {
            let [a, b] = [one.container.bounds(), other.container.bounds()];
            if (0..3).any(|i| a[1][i] < b[0][i] || b[1][i] < a[0][i]) {
                continue;
            }
            // How many of the points just inside of one the other has, and of how many.
            let shared = |one: &Container, other: &Container| {
                let probes = one.probes();
                (probes.iter().filter(|p| other.contains(**p)).count(), probes.len())
            };
            let (a, b) = (shared(&one.container, &other.container), shared(&other.container, &one.container));
            if a.0 < a.1 && b.0 < b.1 && a.0 + b.0 > 0 {
                let line = other.source.element.line();
                return Err(one.source.element.error(format!(
                    "overlaps in part with the container of a medium at line {line}: which medium is there would depend on \
                     where light comes from; let one hold the other, or set them apart"
                )));
            }
        }
    }
    Ok(())
}

struct Medium<'a> {
    description: MediumDescription,
    element: Element<'a>,
}

impl core::ops::Deref for Medium<'_> {
    type Target = MediumDescription;
    fn deref(&self) -> &MediumDescription {
        &self.description
    }
}

impl core::ops::DerefMut for Medium<'_> {
    fn deref_mut(&mut self) -> &mut MediumDescription {
        &mut self.description
    }
}

struct Found<'a> {
    media: Vec<Medium<'a>>,
    index: HashMap<NodeId, usize>,
}

impl<'a> Found<'a> {
    fn index_of(&mut self, element: &Element<'a>) -> Result<usize, SceneError> {
        if let Some(index) = self.index.get(&element.node.id()) {
            return Ok(*index);
        }
        let media::Read { matter, limits, glow, heat } = media::read(element)?;
        let id = element.optional("id").unwrap_or_else(|| format!("medium at line {}", element.line()));
        let index = self.media.len();
        let description = MediumDescription { id, matter, places: Vec::new(), limits, glow, heat };
        self.media.push(Medium { description, element: *element });
        self.index.insert(element.node.id(), index);
        Ok(index)
    }

    fn elements(&self) -> Vec<Element<'a>> {
        self.media.iter().map(|m| m.element).collect()
    }

    fn name(&self, index: Option<usize>) -> String {
        index.map_or_else(|| "no medium".to_owned(), |i| format!("medium \"{}\"", self.media[i].id))
    }
}

/// The smallest container, other than `except`, around `point`.
fn surrounding(boundaries: &[Boundary<'_, '_>], point: [f64; 3], except: Option<usize>) -> Option<usize> {
    let volume = |b: &Boundary<'_, '_>| {
        let [low, high] = b.container.bounds();
        (0..3).map(|i| high[i] - low[i]).product::<f64>()
    };
    let limit = except.map_or(f64::INFINITY, |e| volume(&boundaries[e]));
    boundaries
        .iter()
        .enumerate()
        .filter(|(i, b)| Some(*i) != except && volume(b) > 0.0 && volume(b) < f64::INFINITY)
        // Of two containers around one middle the larger is the outer one.
        .filter(|(_, b)| except.is_none() || volume(b) > limit)
        .filter(|(_, b)| b.container.contains(point))
        .min_by(|a, b| volume(a.1).total_cmp(&volume(b.1)))
        .map(|(i, _)| i)
}

fn check_exterior(
    found: &Found<'_>,
    boundary: &Boundary<'_, '_>,
    surrounded_by: Option<usize>,
) -> Result<(), SceneError> {
    if boundary.exterior == surrounded_by {
        return Ok(());
    }
    let (said, is) = (found.name(boundary.exterior), found.name(surrounded_by));
    Err(boundary.source.element.error(format!("its \"exterior\" is {said}, but around it is {is}")))
}

/// # Errors
/// A far plane that would cut something off.
pub(super) fn check_far_plane(scene: &SceneFile, sensor: &Element<'_>) -> Result<(), SceneError> {
    far_plane(scene).map_err(|reason| sensor.error(reason))
}

/// # Errors
/// A far plane that would cut something off.
fn far_plane(scene: &SceneFile) -> Result<(), String> {
    let eye = scene.sensor.to_world.column(3);
    let mut corners: Vec<[f64; 3]> = Vec::new();
    for shape in &scene.shapes {
        let bounds = bounds_of(&shape.geometry);
        corners.extend([to_array(bounds.min), to_array(bounds.max)]);
    }
    for medium in &scene.media {
        let containers = medium.places.iter().map(|p| &p.container).filter(|c| !matches!(c, Container::Everywhere));
        corners.extend(containers.flat_map(Container::bounds));
    }
    let reach = |axis: usize| corners.iter().map(|c| (c[axis] - eye[axis]).abs()).fold(0.0, f64::max);
    let farthest = (reach(0).powi(2) + reach(1).powi(2) + reach(2).powi(2)).sqrt();
    let far = scene.sensor.far;
    if far < farthest {
        Err(format!("far_clip {far} would cut the scene, which reaches {farthest:.3} away"))
    } else {
        Ok(())
    }
}

impl SceneFile {
    /// The same scene, seen from `origin` towards `target`, +y up. Whether the camera stands in a
    /// medium is found from where it stands.
    ///
    /// # Errors
    /// In words: a camera that looks nowhere or straight up or down, or stands where the far plane
    /// would cut something off.
    pub fn seen_from(mut self, origin: [f64; 3], target: [f64; 3]) -> Result<Self, String> {
        self.sensor.to_world = Transform::look_at(origin, target, [0.0, 1.0, 0.0])
            .ok_or("the target must lie apart from the origin, and not straight above or below it")?;
        far_plane(&self)?;
        Ok(self)
    }
}

impl MediumDescription {
    /// Bytes of its densities.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.matter {
            Matter::Homogeneous { .. } => 0,
            Matter::Coloured { extinction, albedo, .. } => {
                let of = |field: &Field| match field {
                    Field::Constant(_) => 0,
                    Field::Grid { colours, .. } => size_of_val(&*colours.values),
                };
                of(extinction) + of(albedo)
            }
            Matter::Grid { volume, .. } => volume.bytes(),
            Matter::Sparse { bricks, .. } => bricks.bytes(),
        }
    }
}
