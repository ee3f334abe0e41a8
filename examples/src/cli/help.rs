//! Help that fits a screen, with more of it by topic; options that have no effect; pages of the manual and completions of shells.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{Args, Command, CommandFactory, FromArgMatches};

use super::{Arguments, Ending, Failure, Method, RenderArguments};

/// Topics of `fogbow render --help TOPIC`, and the heading of their options.
const TOPICS: [(&str, &str); 9] = [
    ("scene", "Scenes"),
    ("radiance-cache", "Radiance caching"),
    ("photon-beams", "Photon beams"),
    ("vpl", "Virtual lights"),
    ("march", "Ray marching"),
    ("grids", "Covariance grid"),
    ("sampling", "Adaptive sampling"),
    ("long", "Long renders"),
    ("parts", "Many machines"),
];

/// What most renders need.
const ESSENTIAL: [&str; 14] = [
    "scene",
    "method",
    "error",
    "spp",
    "noise",
    "time",
    "size",
    "camera",
    "output",
    "exposure",
    "lenient",
    "seed",
    "checkpoint",
    "resume",
];

const EXAMPLES: &str = "Examples:
  fogbow render box.xml                          box.png and box.exr, by radiance caching
  fogbow render box.xml --error 0.01 -o box.exr  finer
  fogbow render box.xml --method path --time 60  what a minute of path tracing gives
  fogbow render room.glb --fog mist.toml         a glTF scene, with fog from a file
  fogbow check box.xml                           what of a scene cannot be rendered, and why

--help TOPIC tells of one method or subject, --help all of everything:
  scene (fog of glTF files, cameras), radiance-cache, photon-beams, vpl, march, grids, sampling, long, parts, all";

/// What is said instead of doing something.
#[derive(Debug)]
pub enum Answer {
    /// Help that was asked for.
    Help(String),
    /// What is wrong.
    Wrong(String),
    /// What the parser says.
    Parser(clap::Error),
}

impl Answer {
    /// Says it, and ends the program.
    pub fn exit(self) -> ! {
        match self {
            Self::Help(text) => {
                let _ = super::output::print(text.trim_end());
                std::process::exit(0)
            }
            Self::Wrong(text) => {
                say!("fogbow: {text}");
                std::process::exit(2)
            }
            Self::Parser(error) => error.exit(),
        }
    }
}

/// The arguments of the program. What is no command, or asks for help, is answered here.
///
/// # Errors
/// The answer.
pub fn parse(words: impl IntoIterator<Item = OsString>) -> Result<Arguments, Answer> {
    let mut words: Vec<OsString> = words.into_iter().collect();
    if words.len() > 2 && words[1] == "plan" && words[2] == "bake" {
        words.splice(1..3, ["plan-bake".into()]);
    }
    if let Some(answer) = help_of_render(&words) {
        return Err(answer);
    }
    let matches = Arguments::command().try_get_matches_from(&words).map_err(|error| match words.get(1) {
        Some(word) if error.kind() == clap::error::ErrorKind::InvalidSubcommand && is_scene(Path::new(word)) => {
            Answer::Wrong(format!("to render a scene: fogbow render {}", word.display()))
        }
        _ => Answer::Parser(error),
    })?;
    let mut arguments = Arguments::from_arg_matches(&matches).map_err(Answer::Parser)?;
    let Some((name, given)) = matches.subcommand() else { return Ok(arguments) };
    let by_user = |id: &&clap::Id| given.value_source(id.as_str()) == Some(ValueSource::CommandLine);
    let ids = || given.ids().filter(by_user).map(|id| id.as_str().to_owned()).collect();
    match &mut arguments.command {
        super::Command::Render(render) | super::Command::Fill(render) => {
            (render.given, render.is_fill) = (ids(), name == "fill");
        }
        super::Command::PlanBake(plan) => {
            plan.words = words.iter().skip(2).map(|word| word.to_string_lossy().into_owned()).collect();
        }
        super::Command::Plan(plan) => {
            let words: Vec<String> = words.iter().skip(2).map(|word| word.to_string_lossy().into_owned()).collect();
            (plan.render.given, plan.words) = (ids(), super::plan::words_for_render(&words));
        }
        _ => {}
    }
    Ok(arguments)
}

fn is_scene(file: &Path) -> bool {
    let known = ["xml", "gltf", "glb", "pbrt"];
    file.extension().is_some_and(|extension| known.iter().any(|known| extension.eq_ignore_ascii_case(known)))
        || file.is_file()
}

/// The help that `fogbow render … --help [TOPIC]` asks for.
fn help_of_render(words: &[OsString]) -> Option<Answer> {
    let is_render = words.get(1).is_some_and(|word| word == "render");
    let at = words.iter().position(|word| word == "--help" || word == "-h").filter(|_| is_render)?;
    let topic = words.get(at + 1).map(|word| word.to_string_lossy().into_owned());
    Some(match help(topic.as_deref()) {
        Ok(text) => Answer::Help(text),
        Err(topic) => {
            let known: Vec<_> = TOPICS.iter().map(|(name, _)| *name).collect();
            Answer::Wrong(format!("--help: \"{topic}\" is no topic; there are {} and all", known.join(", ")))
        }
    })
}

/// The first sentence.
fn first_sentence(text: &str) -> String {
    let end = ["; ", ". ", ": ", " ["].iter().filter_map(|mark| text.find(mark)).min().unwrap_or(text.len());
    text[..end].trim_end_matches('.').to_owned()
}

/// Help for `fogbow render`: what most renders need, or all of a topic.
///
/// # Errors
/// The topic, if there is none of that name.
pub(super) fn help(topic: Option<&str>) -> Result<String, String> {
    let mut all = Arguments::command();
    all.build();
    let mut render = all.find_subcommand("render").cloned().unwrap_or_default().bin_name("fogbow render");
    let heading = match topic {
        Some("all") => return Ok(render.render_help().to_string()),
        Some("path") => None,
        Some(topic) if topic.starts_with('-') => None,
        Some(topic) => Some(TOPICS.iter().find(|(name, _)| *name == topic).ok_or_else(|| topic.to_owned())?.1),
        None => None,
    };
    if let Some(heading) = heading {
        render = render.mut_args(|option| {
            let is_hidden = option.get_help_heading() != Some(heading);
            option.hide(is_hidden)
        });
        return Ok(render.render_help().to_string());
    }
    render = render.after_help(EXAMPLES).mut_args(|option| {
        let is_hidden = !ESSENTIAL.contains(&option.get_id().as_str());
        let text = option.get_help().map(|text| first_sentence(&text.to_string())).unwrap_or_default();
        let is_choice = option.get_id() == "method";
        option
            .hide(is_hidden)
            .help(text)
            .help_heading("Options")
            .hide_possible_values(!is_choice)
            .hide_default_value(true)
    });
    Ok(render.render_help().to_string())
}

impl RenderArguments {
    /// # Errors
    /// An option that `method` does not know; `because` it is taken although nobody named it.
    pub(super) fn check_given(&self, method: Method, because: Option<&str>) -> Result<(), Failure> {
        let command = Arguments::command();
        let Some(render) = command.find_subcommand("render") else { return Ok(()) };
        for option in render.get_arguments().filter(|option| self.given.iter().any(|id| id == option.get_id().as_str()))
        {
            let due = match (option.get_id().as_str(), option.get_help_heading()) {
                ("pass_samples", _) => &[Method::PhotonBeams, Method::Vpl][..],
                (_, Some("Radiance caching")) => &[Method::RadianceCache],
                (_, Some("Photon beams")) => &[Method::PhotonBeams],
                (_, Some("Virtual lights")) => &[Method::Vpl],
                (_, Some("Ray marching")) => &[Method::March],
                _ => continue,
            };
            if !due.contains(&method) {
                let (option, owner) = (option.get_long().unwrap_or_default(), due[0].name());
                let taken = because.map_or_else(String::new, |because| format!(" (taken because {because})"));
                return Err(format!(
                    "--{option} has no effect with --method {}{taken}; it belongs to --method {owner}",
                    method.name()
                )
                .into());
            }
        }
        let grid = ["grid_paths", "grid_cells", "grid_in", "grid_out", "image_share"];
        let is_idle = |id: &str| match id {
            "image_share" => self.sampling.is_uniform(),
            _ => !self.needs_grid(),
        };
        if let Some(id) = grid.into_iter().find(|id| self.given.iter().any(|given| given == id) && is_idle(id)) {
            return Err(format!(
                "--{} has no effect without something that uses covariances: --kernel, --step or --image-sampling covariance",
                id.replace('_', "-")
            )
            .into());
        }
        Ok(())
    }
}

impl Method {
    /// As on the command line.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::RadianceCache => "radiance-cache",
            Self::PhotonBeams => "photon-beams",
            Self::March => "march",
            Self::Vpl => "vpl",
        }
    }
}

/// Writes the completions of a shell to standard output.
#[derive(Debug, Args)]
pub struct CompletionsArguments {
    /// The shell.
    pub shell: clap_complete::Shell,
}

pub(super) fn completions(arguments: &CompletionsArguments) -> Result<Ending, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Arguments::command(), "fogbow", &mut script);
    super::output::print(&String::from_utf8_lossy(&script))?;
    Ok(Ending::Done)
}

/// Writes the pages of the manual into a folder.
#[derive(Debug, Args)]
pub struct ManArguments {
    /// The folder, which must exist.
    pub folder: PathBuf,
}

pub(super) fn man(arguments: &ManArguments) -> Result<Ending, Failure> {
    fn page(command: &Command, name: &str, folder: &Path) -> Result<(), Failure> {
        let mut bytes = Vec::new();
        clap_mangen::Man::new(command.clone()).render(&mut bytes)?;
        let file = folder.join(format!("{name}.1"));
        fogbow_std::files::write(&file, &bytes)?;
        Ok(())
    }
    let mut command = Arguments::command();
    command.build();
    page(&command, "fogbow", &arguments.folder)?;
    for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help") {
        page(sub, &format!("fogbow-{}", sub.get_name()), &arguments.folder)?;
    }
    Ok(Ending::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_is_one_screen_and_topics_have_the_rest() {
        let short = help(None).unwrap();
        assert!(short.lines().count() <= 40, "{}\n{short}", short.lines().count());
        assert!(short.contains("fogbow check box.xml") && short.contains("--error <E>"), "{short}");
        let all = help(Some("all")).unwrap();
        for (topic, heading) in TOPICS {
            let text = help(Some(topic)).unwrap();
            assert!(text.contains(heading) && !text.contains("--spp"), "{text}");
            assert!(short.contains(topic) && all.contains(heading));
        }
        assert_eq!(help(Some("fish")).unwrap_err(), "fish");
    }

    #[test]
    fn every_option_of_a_method_is_refused_by_all_others() {
        let command = Arguments::command();
        let render = command.find_subcommand("render").unwrap();
        let mut count = 0;
        for option in render.get_arguments().filter(|option| option.get_help_heading().is_some()) {
            let heading = option.get_help_heading().unwrap();
            let Some(owner) = ["Radiance caching", "Photon beams", "Virtual lights", "Ray marching"]
                .iter()
                .position(|known| *known == heading)
            else {
                continue;
            };
            let methods = [Method::RadianceCache, Method::PhotonBeams, Method::Vpl, Method::March, Method::Path];
            let super::super::Command::Render(mut arguments) =
                parse(["fogbow", "render", "a.xml"].map(OsString::from)).unwrap().command
            else {
                panic!()
            };
            arguments.given = vec![option.get_id().as_str().to_owned()];
            for (index, method) in methods.into_iter().enumerate() {
                let is_shared = option.get_id() == "pass_samples" && method == Method::Vpl;
                let result = arguments.check_given(method, None);
                assert_eq!(result.is_ok(), index == owner || is_shared, "{} {method:?}", option.get_id());
                count += 1;
            }
        }
        assert!(count > 100, "{count}");
    }
}
