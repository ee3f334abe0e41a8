//! `<transform>`: steps that act in the order written.

use super::element::Element;
use crate::error::SceneError;
use crate::transform::{Transform, cross, dot};

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
            let axis = step.xyz(0.0, true)?;
            let length = dot(axis, axis).sqrt();
            if length == 0.0 {
                return Err(step.error("the axis has no length"));
            }
            // A third of a percent is what axes written with two figures are off.
            if (length - 1.0).abs() > 3e-3 {
                step.suspicious(format!("an axis of length {length:.4} also scales and shears, here as in Mitsuba 3"));
            }
            Ok(Transform::rotation_about(axis, degrees))
        }
        "lookat" => {
            step.allow(&["origin", "target", "up"])?;
            let (origin, target) = (step.triple("origin")?, step.triple("target")?);
            let up = if step.node.has_attribute("up") { step.triple("up")? } else { [0.0; 3] };
            let up = if up == [0.0; 3] { any_up([0, 1, 2].map(|i| target[i] - origin[i])) } else { up };
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

/// Some direction across another, where a camera does not say which way is up.
fn any_up(forward: [f64; 3]) -> [f64; 3] {
    let axis = if forward[0].abs() > forward[2].abs() { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    cross(forward, axis)
}
