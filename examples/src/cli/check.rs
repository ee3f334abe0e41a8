//! `fogbow check`.

use clap::Args;

use super::scene::{SceneArguments, said};
use super::{Ending, Failure};
use crate::scene_file::{Findings, NoteKind};
use crate::world::{Storage, World};

/// Says all at once what of a scene cannot be rendered, has no effect, or looks like a mistake.
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
    errors.iter().for_each(|error| println!("error: {error}"));
    said(&notes).iter().for_each(|line| println!("{line}"));
    let file = arguments.scene.file.display();
    if !errors.is_empty() {
        return Err(format!("{file}: cannot be rendered; {}", counted(errors.len(), "error")).into());
    }
    let replaced = notes.iter().filter(|note| note.kind == NoteKind::Replaced).count();
    match replaced {
        0 => println!("{file}: can be rendered"),
        _ => println!("{file}: can be rendered with --lenient; {} replaced", counted(replaced, "thing")),
    }
    Ok(Ending::Done)
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
