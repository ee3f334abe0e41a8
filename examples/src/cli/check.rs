//! `fogbow check`.

use clap::Args;
use fogbow::math::Bounds;

use super::scene::{SceneArguments, said};
use super::{Ending, Failure, output};
use crate::scene_file::{Findings, NoteKind, SceneFile, Sensor};
use crate::transform::{normalized, to_array, to_vec3};
use crate::world::{Storage, World, bounds_of};

/// Says all at once what of a scene cannot be rendered, has no effect, or looks like a mistake, and how large and thick its media are.
///
/// A line each, with file, line and what to do; the last line is the verdict. Exit code 2 if `fogbow render` would refuse the scene.
#[derive(Debug, Args)]
pub struct CheckArguments {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneArguments,
}

pub(super) fn run(arguments: &CheckArguments) -> Result<Ending, Failure> {
    let Findings { scene, mut errors, notes } = arguments.scene.findings();
    if let Some(scene) = &scene {
        let mut storage = Storage::new(scene);
        errors.extend(World::new(scene, &mut storage).err());
    }
    let found = errors.iter().map(|error| format!("error: {error}"));
    let lines: Vec<_> = scene.iter().flat_map(inventory).chain(found).chain(said(&notes)).collect();
    lines.iter().try_for_each(|line| output::print(line))?;
    let file = arguments.scene.file.display();
    if !errors.is_empty() {
        return Err(format!("{file}: cannot be rendered; {}", counted(errors.len(), "error")).into());
    }
    let replaced = notes.iter().filter(|note| note.kind == NoteKind::Replaced).count();
    match replaced {
        0 => output::print(&format!("{file}: can be rendered"))?,
        _ => {
            output::print(&format!("{file}: can be rendered with --lenient; {} replaced", counted(replaced, "thing")))?
        }
    }
    Ok(Ending::Done)
}

/// Where surfaces and media are, and how thick.
fn inventory(scene: &SceneFile) -> Vec<String> {
    let shapes = scene.shapes.iter().map(|shape| bounds_of(&shape.geometry)).fold(Bounds::EMPTY, Bounds::union);
    let surfaces =
        (!scene.shapes.is_empty()).then(|| format!("surfaces: {}", extent([shapes.min, shapes.max].map(to_array))));
    let media = scene.media.iter().map(|medium| {
        let (most, across) = (medium.matter.densest(), medium.thickness());
        let place = extent(medium.bounds());
        format!("medium \"{}\": {place}; extinction up to {most:.3} per m: {across:.2} free paths across", medium.id)
    });
    surfaces.into_iter().chain(media).chain(camera(scene)).collect()
}

/// Where the camera stands, as an option that may be changed.
fn camera(scene: &SceneFile) -> Option<String> {
    let Sensor { to_world, width, height, .. } = &scene.sensor;
    let (origin, axis) = (to_world.column(3), normalized(to_world.column(2))?);
    let shapes = scene.shapes.iter().map(|shape| bounds_of(&shape.geometry)).fold(Bounds::EMPTY, Bounds::union);
    let media = scene.media.iter().map(|medium| medium.bounds().map(to_vec3));
    let all = media.fold(shapes, |all, [min, max]| all.union(Bounds { min, max }));
    // What it looks at: before the middle of all there is.
    let middle = to_array(all.centre());
    let ahead = (0..3).map(|i| (middle[i] - origin[i]) * axis[i]).sum::<f64>();
    let ahead = if ahead > 0.0 && ahead.is_finite() { ahead } else { 1.0 };
    let target = [0, 1, 2].map(|i| origin[i] + ahead * axis[i]);
    let point = |at: [f64; 3]| at.map(|c| (c as f32).to_string()).join(",");
    Some(format!("camera: {width} x {height} pixels, --camera \"{} {}\"", point(origin), point(target)))
}

/// A box in words.
fn extent([low, high]: [[f64; 3]; 2]) -> String {
    if !low.iter().chain(&high).all(|c| c.is_finite()) {
        return "without end".to_owned();
    }
    let [x, y, z] = [0, 1, 2].map(|i| high[i] - low[i]);
    let point = |[x, y, z]: [f64; 3]| format!("({x:.2}, {y:.2}, {z:.2})");
    format!("{x:.2} x {y:.2} x {z:.2} m, from {} to {}", point(low), point(high))
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::output;
    use crate::scene_file::ReadOptions;
    use crate::transform::{Transform, dot};

    /// What is told may be given back, and the camera stands and looks as before.
    #[test]
    fn the_camera_that_is_told_is_that_of_the_scene() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/room.glb");
        let scene = SceneFile::read_with(file.as_ref(), &ReadOptions::default()).into_scene().unwrap();
        let told = camera(&scene).unwrap();
        let option = told.split('"').nth(1).unwrap();
        let [origin, target] = output::camera(option).unwrap();
        let again = Transform::look_at(origin, target, [0.0, 1.0, 0.0]).unwrap();
        let (due, found) = (&scene.sensor.to_world, &again);
        assert!((0..3).all(|i| (due.column(3)[i] - found.column(3)[i]).abs() < 1e-5), "{told}");
        let [a, b] = [due, found].map(|to_world| normalized(to_world.column(2)).unwrap());
        assert!(dot(a, b) > 1.0 - 1e-9, "{told}");
    }
}
