//! `<transform>`: steps that act in the order written.

use super::element::Element;
use crate::error::SceneError;
use crate::transform::Transform;

/// The transform of an element; always one that can be undone.
pub(super) fn read(element: &Element<'_>) -> Result<Transform, SceneError> {
    element.allow(&["name"])?;
    let mut whole = Transform::IDENTITY;
    for step in element.children()? {
        step.no_children()?;
        whole = whole.then(&read_step(&step)?);
    }
    if !whole.is_regular() {
        return Err(element.error("the transform cannot be undone: it flattens space, or leaves the range of numbers"));
    }
    Ok(whole)
}

fn read_step(step: &Element<'_>) -> Result<Transform, SceneError> {
    const XYZ: [&str; 4] = ["x", "y", "z", "value"];
    match step.tag() {
        "translate" => {
            step.allow(&XYZ)?;
            Ok(Transform::translation(step.xyz(0.0, false)?))
        }
        "scale" => {
            step.allow(&XYZ)?;
            let factors = step.xyz(1.0, true)?;
            if factors.contains(&0.0) {
                return Err(step.error("a scale of 0 leaves nothing"));
            }
            Ok(Transform::scaling(factors))
        }
        "rotate" => {
            step.allow(&["x", "y", "z", "value", "angle"])?;
            let degrees = step.number("angle")?;
            Transform::rotation(step.xyz(0.0, false)?, degrees).ok_or_else(|| step.error("the axis has no length"))
        }
        "lookat" => {
            step.allow(&["origin", "target", "up"])?;
            let (origin, target) = (step.triple("origin")?, step.triple("target")?);
            let up = step.triple("up")?;
            Transform::look_at(origin, target, up)
                .ok_or_else(|| step.error("origin and target coincide, or up is parallel to the view"))
        }
        "matrix" => {
            step.allow(&["value"])?;
            let numbers = step.numbers("value")?;
            let at =
                |row: usize, column: usize, width: usize| numbers.get(row * width + column).copied().unwrap_or(0.0);
            match numbers.len() {
                9 => Ok(Transform { rows: [0, 1, 2].map(|r| [at(r, 0, 3), at(r, 1, 3), at(r, 2, 3), 0.0]) }),
                16 if numbers.ends_with(&[0.0, 0.0, 0.0, 1.0]) => {
                    Ok(Transform { rows: [0, 1, 2].map(|r| [0, 1, 2, 3].map(|c| at(r, c, 4))) })
                }
                16 => Err(step.attribute_error("value", "the last row must be 0 0 0 1")),
                other => Err(step.attribute_error("value", format!("{other} numbers where 9 or 16 are due"))),
            }
        }
        _ => Err(step.error("unknown element inside <transform>")),
    }
}
