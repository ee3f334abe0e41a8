//! What can be rendered and is probably not meant: told as notes.

use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;

use super::description::{Container, Emitter, Geometry, Matter, MediumDescription, SceneFile};
use super::element::Element;
use super::shapes::ShapeElement;
use crate::world::bounds_of;

/// Looks a scene over. `emitters` are the elements of [`SceneFile::emitters`].
pub(super) fn look(root: &Element<'_>, scene: &SceneFile, shapes: &[ShapeElement<'_>], emitters: &[Element<'_>]) {
    let has_light = !scene.emitters.is_empty() || shapes.iter().any(|s| s.element.is_emitter());
    if !has_light {
        root.suspicious("nothing sends out light: the picture will be black; add an <emitter>");
    }
    scale(root, scene, shapes);
    hidden_lights(scene, shapes, emitters);
    media(root, scene);
}

/// Sizes at which single precision no longer tells a surface from what lies beside it.
fn scale(root: &Element<'_>, scene: &SceneFile, shapes: &[ShapeElement<'_>]) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let corners = shapes.iter().filter_map(|source| source.shape.as_ref()).map(|shape| {
        let bounds = bounds_of(&shape.geometry);
        [bounds.min, bounds.max].map(crate::transform::to_array)
    });
    let of_media = scene.media.iter().flat_map(|m| &m.places).map(|place| place.container.bounds());
    for corner in corners.chain(of_media).flatten() {
        for axis in 0..3 {
            low[axis] = low[axis].min(corner[axis]);
            high[axis] = high[axis].max(corner[axis]);
        }
    }
    let size = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    let far = low.iter().chain(&high).fold(0.0_f64, |far, c| far.max(c.abs()));
    if size > 0.0 && !(1e-3..=1e6).contains(&size) {
        root.suspicious(format!("the scene is {size:.2e} units wide: scale it to between 0.001 and 1000000"));
    }
    if far.is_finite() && far > 1e4 * size {
        root.suspicious(format!("the scene is {size:.2e} wide and {far:.2e} away from the origin: move it there"));
    }
}

/// Lights inside a closed body that lets no light through.
fn hidden_lights(scene: &SceneFile, shapes: &[ShapeElement<'_>], emitters: &[Element<'_>]) {
    let bodies: Vec<(&Element<'_>, Container)> = shapes
        .iter()
        .filter_map(|source| {
            let shape = source.shape.as_ref()?;
            let is_opaque = matches!(
                shape.material.surface,
                Surface::Lambert { .. } | Surface::Phong { .. } | Surface::Mirror { .. }
            );
            let body = match &shape.geometry {
                Geometry::Cube(to_world) => Container::Cube(*to_world),
                Geometry::Sphere { centre, radius, .. } => Container::Sphere { centre: *centre, radius: *radius },
                _ => return None,
            };
            (is_opaque && !shape.is_flipped).then_some((&source.element, body))
        })
        .collect();
    let lamps = scene.emitters.iter().zip(emitters).filter_map(|(emitter, element)| match emitter {
        Emitter::Point { position, .. } | Emitter::Spot { position, .. } => Some((element, *position)),
        Emitter::Projector { to_world, .. } => Some((element, to_world.column(3))),
        _ => None,
    });
    let areas = shapes.iter().filter(|s| s.element.is_emitter()).filter_map(|source| {
        let bounds = bounds_of(&source.shape.as_ref()?.geometry);
        Some((&source.element, crate::transform::to_array(0.5 * (bounds.min + bounds.max))))
    });
    let eye = scene.sensor.to_world.column(3);
    for (element, position) in lamps.chain(areas) {
        let around = bodies.iter().find(|(body, container)| {
            // Who stands in the same room sees it.
            body.node.id() != element.node.id() && container.contains(position) && !container.contains(eye)
        });
        if let Some((body, _)) = around {
            element.suspicious(format!(
                "lies inside the closed body of line {}, which its light cannot leave",
                body.line()
            ));
        }
    }
}

/// Media that take forever, or cannot be seen.
fn media(root: &Element<'_>, scene: &SceneFile) {
    for medium in &scene.media {
        of_medium(medium).into_iter().for_each(|reason| root.suspicious(reason));
    }
}

/// Free paths across a cloud from which on radiance caching may be blotchy: its cells of light, of which at most 64 are across, then hold more than two.
const BLOTCHY: f64 = 128.0;

/// What is odd about a medium.
pub(super) fn of_medium(medium: &MediumDescription) -> Option<String> {
    let (name, depth) = (&medium.id, medium.thickness());
    if depth < 1e-2 {
        let seen = if depth < 1e-4 { "cannot" } else { "can hardly" };
        return Some(format!(
            "medium \"{name}\" is at most {depth:.1e} free paths across: it {seen} be seen; mind its size and its extinction"
        ));
    }
    let Matter::Homogeneous { absorption, scattering, .. } = &medium.matter else {
        return (depth > BLOTCHY).then(|| {
            format!(
                "medium \"{name}\" is up to {depth:.0} free paths across: radiance caching may leave blotches in its densest parts; compare with --method path"
            )
        });
    };
    let extinction: Spectrum = *absorption + *scattering;
    let is_white = |i: usize| scattering.0[i] > 0.9995 * extinction.0[i] && extinction.0[i] > 0.0;
    (depth.is_finite() && depth > 300.0 && (0..3).any(is_white)).then(|| {
        format!("medium \"{name}\" is {depth:.0} free paths thick and absorbs next to nothing: paths in it have many thousand vertices")
    })
}
