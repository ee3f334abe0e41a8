//! Bakes of the frames of an animation, each of which keeps what has not changed since the one before.

use std::path::{Path, PathBuf};

use fogbow::bake::ProbeLevels;
use fogbow::bytes::Crc;

use super::super::scene::SceneArguments;
use super::super::{Ending, Failure, output};
use super::{BakeArguments, Frame, bake, finish, read, unless_stopped, write};
use crate::error::read_file;

/// The bake of the frame before.
pub(super) struct Earlier {
    pub(super) levels: ProbeLevels<'static>,
    /// Of its bytes: another one makes another bake.
    pub(super) crc: u64,
}

impl Earlier {
    fn of(bytes: &[u8]) -> Result<Self, String> {
        let (levels, _) = read(bytes).map_err(|error| error.to_string())?;
        let mut crc = Crc::new();
        crc.add(bytes);
        Ok(Self { levels, crc: crc.value() })
    }
}

/// What `--after` names.
///
/// # Errors
/// A file that is not there, damaged, or no bake.
pub(super) fn earlier(arguments: &BakeArguments) -> Result<Option<Earlier>, Failure> {
    let Some(file) = &arguments.after else { return Ok(None) };
    let earlier = Earlier::of(&read_file(file)?).map_err(|error| format!("--after {}: {error}", file.display()))?;
    Ok(Some(earlier))
}

/// Bakes all frames, one after the other.
///
/// # Errors
/// Options that are for one scene, scenes of the same name or that are not there, and what stands in the way of a frame.
pub(super) fn run(arguments: &BakeArguments, scenes: &[PathBuf]) -> Result<Ending, Failure> {
    let option = [
        ("--per-light", arguments.per_light),
        ("--part", arguments.many.part.is_some()),
        ("--level", arguments.many.level.is_some()),
    ];
    if let Some((option, _)) = option.into_iter().find(|(_, is_given)| *is_given) {
        return Err(format!("{option} is for one scene, and there are {}", scenes.len()).into());
    }
    let names: Vec<String> = scenes.iter().map(|scene| name(scene)).collect();
    if let Some(twice) = names.iter().enumerate().find_map(|(i, name)| names[..i].contains(name).then_some(name)) {
        return Err(format!("two scenes are called {twice}, and would have the same files").into());
    }
    // A name that is mistyped is told before hours go into the frames before it.
    for scene in scenes {
        read_file(scene)?;
    }
    let mut earlier = earlier(arguments)?;
    for (scene, name) in scenes.iter().zip(&names) {
        let frame = Frame { name: Some(name), earlier: earlier.as_ref(), ..Frame::default() };
        let files: Vec<_> = arguments.output.iter().map(|file| frame.file(file)).collect();
        for file in &files {
            output::check_place(file)?;
        }
        let scene = SceneArguments { file: scene.clone(), reading: arguments.reading.clone() };
        let made = bake(arguments, &scene, &frame).map_err(|error| {
            // Of which frame.
            if error.is::<super::super::covariance::Stopped>() {
                error
            } else {
                format!("{}: {error}", scene.file.display()).into()
            }
        });
        let Some((made, ending)) = unless_stopped(made)? else { return Ok(Ending::Stopped) };
        let bytes = write::all_to_bytes(made.baked.levels.levels(), made.tag);
        if finish(arguments, made, ending, &files)? == Ending::Stopped {
            return Ok(Ending::Stopped);
        }
        earlier = Some(Earlier::of(&bytes)?);
    }
    Ok(Ending::Done)
}

/// The name of a scene's file without its extension.
fn name(scene: &Path) -> String {
    scene.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
