//! What `--help` says about options that are not given: the numbers of the core's presets.

use core::fmt::Display;

use clap::Arg;
use fogbow::host::Empty;
use fogbow::math::{Bounds, Vec3};
use fogbow::world::{Outline, World};

/// A world without anything in it whose diagonal is 1: lengths of its presets are shares of the diagonal.
pub(super) fn unit_outline() -> Outline {
    // Asked for by every option, at every start.
    thread_local! {
        static OUTLINE: Outline = {
            let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
            Outline::of(&world, Bounds { min: Vec3::ZERO, max: Vec3::X })
        };
    }
    OUTLINE.with(|outline| *outline)
}

/// The option with its default at the end of its help.
pub(super) fn with_default(option: Arg, default: impl Display) -> Arg {
    with_remark(option, format!("default: {default}"))
}

/// The option with a remark at the end of its help.
pub(super) fn with_remark(option: Arg, remark: impl Display) -> Arg {
    let help = option.get_help().map(ToString::to_string).unwrap_or_default();
    option.help(format!("{help} [{remark}]"))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use crate::cli::Arguments;

    #[test]
    fn help_names_the_defaults_of_presets() {
        let mut command = Arguments::command();
        command.build();
        let render = command.find_subcommand("render").unwrap();
        let help = |id: &str| render.get_arguments().find(|option| option.get_id() == id).unwrap().get_help().unwrap();
        let due = [
            ("radius", "in the scene's unit of length [default: 0.005 of the scene's diagonal]"),
            ("bias", "it shrinks with further ones [default: 0.1]"),
            ("beams", "[default: as many as leave 4 pieces of beams for every pixel]"),
            ("pass_samples", "[default: 8, for virtual lights 64]"),
            ("share", "[default: 1, for abc 4]"),
            ("grid_paths", "[default: 100000, for kernels of photon beams 10000]"),
            ("step_length", "[default: 1/32 of the scene's diagonal, with covariances 1/8]"),
            ("image_share", "[from 0.05 to 1]"),
            ("paths", "[default: 128]"),
            ("noise", "[at least 8 samples, without --spp at most 65536]"),
        ];
        for (id, end) in due {
            let help = help(id).to_string();
            assert!(help.ends_with(end), "{id}: {help}");
            assert_eq!(help.matches('[').count(), 1, "{id}: {help}");
        }
        let tolerance = help("tolerance").to_string();
        for part in ["0.2 for single, 2 for surface,", "0.8 for multiple, 0.35 for irradiance]"] {
            assert!(tolerance.contains(part), "{tolerance}");
        }
    }
}
