//! `fogbow plume`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{Ending, Failure};
use crate::plume::{self, Plume};

/// Writes an animation: a plume of smoke, a volume and a scene per frame.
#[derive(Debug, Args)]
pub struct PlumeArguments {
    /// Frames, twelve a second.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub frames: u32,
    /// Cells along each side of the room.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(8..=256))]
    pub resolution: u32,
    /// Folder for plume-00.vol, plume-00.xml and so on; made if it is not there.
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// No list of what was written.
    #[arg(short, long)]
    pub quiet: bool,
}

pub(super) fn run(arguments: &PlumeArguments) -> Result<Ending, Failure> {
    let folder = &arguments.output;
    let fail = |path: &Path, e: std::io::Error| format!("{}: cannot be written: {e}", path.display());
    std::fs::create_dir_all(folder).map_err(|e| fail(folder, e))?;
    let digits = (arguments.frames - 1).to_string().len().max(2);
    let mut plume = Plume::new(arguments.resolution);
    for frame in 0..arguments.frames {
        let name = format!("plume-{frame:0digits$}");
        let volume = format!("{name}.vol");
        plume.next_frame().write(&folder.join(&volume))?;
        let scene = folder.join(format!("{name}.xml"));
        std::fs::write(&scene, plume::scene(&volume)).map_err(|e| fail(&scene, e))?;
        if !arguments.quiet {
            say!("wrote {}", scene.display());
        }
    }
    Ok(Ending::Done)
}
