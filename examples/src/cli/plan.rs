//! `fogbow plan`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::arguments::RenderArguments;
use super::choice::Choice;
use super::film_file::{Split, is_film};
use super::render::path_settings;
use super::{Ending, Failure, Method, output};
use crate::world::{Storage, World};

/// Prints as JSON which commands render a scene on many machines, and which of them wait for which.
///
/// `fill` is made once, if the method has something to fill; then all parts may run anywhere, in any order and at once; `merge` puts them together. All steps
/// share one folder. A step that was stopped goes on where it was when it is run again; one that is run twice writes the same file twice.
///
/// `fogbow plan bake SCENE` does the same for `fogbow bake`.
#[derive(Debug, Args)]
pub struct PlanArguments {
    /// What to render, with all options of `fogbow render`.
    #[command(flatten)]
    pub render: Box<RenderArguments>,
    /// Parts of each picture.
    #[arg(long = "parts", id = "part_count", value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..))]
    pub parts: u32,
    /// Where parts and fills are put, on a disk that all machines share.
    #[arg(long, value_name = "FOLDER", default_value = "parts")]
    pub folder: PathBuf,
    /// An animation: a camera per line of this file, as --camera takes it. Pictures are numbered.
    #[arg(long, value_name = "FILE")]
    pub cameras: Option<PathBuf>,
    /// Frames of an animation whose caches begin where those of the frame before ended, so each group is filled in order; the world has to stand
    /// still.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub group: u32,
    /// Words of the command line that are not for this command but for `fogbow render`, if [`super::parse`] has read them.
    #[arg(skip)]
    pub words: Vec<String>,
}

/// A command, and what it waits for.
#[derive(Debug, Clone, Serialize, PartialEq, Eq)]
pub(super) struct Step {
    pub(super) id: String,
    pub(super) kind: &'static str,
    /// Words behind `fogbow`.
    pub(super) run: Vec<String>,
    /// Steps that have to be done before.
    pub(super) after: Vec<String>,
    pub(super) writes: Vec<String>,
}

#[derive(Debug, Serialize)]
pub(super) struct Graph {
    pub(super) version: u32,
    pub(super) scene: String,
    pub(super) method: &'static str,
    pub(super) split: Option<Split>,
    pub(super) parts: u32,
    pub(super) frames: usize,
    pub(super) folder: String,
    pub(super) steps: Vec<Step>,
}

/// Options of this command with a value: all others are for `fogbow render`, but for the pictures, which are for `fogbow merge`.
const OWN: [&str; 6] = ["--parts", "--folder", "--cameras", "--group", "--output", "--split"];

/// Words for `fogbow render`, of those behind `fogbow plan`.
pub(super) fn words_for_render(words: &[String]) -> Vec<String> {
    without(words, &OWN)
}

/// Words without these options, their values and -o.
pub(super) fn without(words: &[String], options: &[&str]) -> Vec<String> {
    let mut kept = Vec::new();
    let mut words = words.iter();
    while let Some(word) = words.next() {
        let has_value = |own: &&str| word.starts_with(&format!("{own}="));
        if options.contains(&word.as_str()) || word == "-o" {
            words.next();
        } else if word.starts_with("-o") || options.iter().any(has_value) {
            // Option and value in one word.
        } else {
            kept.push(word.clone());
        }
    }
    kept
}

pub(super) fn run(arguments: &PlanArguments) -> Result<Ending, Failure> {
    let graph = graph(arguments)?;
    output::print(&serde_json::to_string_pretty(&graph)?)?;
    Ok(Ending::Done)
}

fn graph(arguments: &PlanArguments) -> Result<Graph, Failure> {
    let render = &arguments.render;
    if render.parts.part.is_some() || render.parts.fill.is_some() || render.keep.checkpoint.is_some() {
        return Err("--part, --fill and --checkpoint: the plan says them for every step; leave them out".into());
    }
    if render.aov && render.needs_grid() || !render.sampling.is_uniform() {
        return Err("layers that are drawn and pixels that are filled in come after a merge: fogbow render --resume makes them, see --help".into());
    }
    let scene = render.scene.read(true)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    let paths = path_settings(&scene, render.max_depth);
    let method = Choice::of(render, &paths, &world)?.method;
    render.check_given(method, None)?;
    let (width, height) = render.size.unwrap_or((scene.sensor.width, scene.sensor.height));
    let (samples, _) = render.samples(method, scene.sensor.samples);
    let split = render.parts.split_for(method, arguments.parts, samples, [width, height]);
    if render.noise.is_some() || render.time.is_some() {
        return Err("--noise and --time: no part has the noise of the whole picture, or its time; use --spp".into());
    }
    render.check_parts(method, (arguments.parts, split), samples, [width, height])?;
    let has_fill = method == Method::RadianceCache || render.needs_grid();
    let cameras = arguments.cameras.as_deref().map(cameras).transpose()?;
    if arguments.group > 1 && (cameras.is_none() || method != Method::RadianceCache) {
        return Err("--group: frames pass caches on in an animation (--cameras) by radiance caching alone".into());
    }
    let frames: Vec<Option<String>> = cameras.map_or_else(|| vec![None], |all| all.into_iter().map(Some).collect());
    let count = frames.len();
    let pictures = pictures(render)?;
    let mut steps = Vec::new();
    for (index, camera) in frames.iter().enumerate() {
        let frame = camera.as_ref().map(|camera| (index, camera.as_str()));
        let planned = Planned { arguments, split, has_fill, pictures: &pictures, frame };
        steps.extend(planned.steps());
    }
    Ok(Graph {
        version: 1,
        scene: render.scene.file.display().to_string(),
        method: method.name(),
        split: (arguments.parts > 1).then_some(split),
        parts: arguments.parts,
        frames: count,
        folder: arguments.folder.display().to_string(),
        steps,
    })
}

/// Cameras of an animation, checked.
fn cameras(file: &Path) -> Result<Vec<String>, Failure> {
    let text = std::fs::read_to_string(file).map_err(|error| format!("{}: {error}", file.display()))?;
    let mut all = Vec::new();
    for (line, number) in text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty()) {
        output::camera(line).map_err(|error| format!("{}:{number}: {error}", file.display()))?;
        all.push(line.trim().to_owned());
    }
    if all.is_empty() {
        return Err(format!("{}: there is no camera in it", file.display()).into());
    }
    Ok(all)
}

/// Pictures that are asked for.
fn pictures(render: &RenderArguments) -> Result<Vec<PathBuf>, Failure> {
    let stem = PathBuf::from(render.scene.file.file_stem().ok_or("the scene has no name")?);
    let asked = &render.output;
    let all =
        if asked.is_empty() { ["png", "exr"].map(|kind| stem.with_extension(kind)).into() } else { asked.clone() };
    all.iter().filter(|file| !is_film(file)).try_for_each(|file| {
        let is_known = fogbow_std::image::is_writable(file);
        if is_known {
            Ok(())
        } else {
            Err(format!("{}: the extension is none of png, pfm, exr, fogbow", file.display()))
        }
    })?;
    Ok(all)
}

/// The steps of a picture.
struct Planned<'a> {
    arguments: &'a PlanArguments,
    split: Split,
    has_fill: bool,
    pictures: &'a [PathBuf],
    /// Number, from 0, and camera of a frame.
    frame: Option<(usize, &'a str)>,
}

impl Planned<'_> {
    /// The name of a step of a frame.
    fn named(frame: Option<usize>, name: &str) -> String {
        frame.map_or_else(|| name.to_owned(), |frame| format!("frame-{:04}-{name}", frame + 1))
    }

    fn id(&self, name: &str) -> String {
        Self::named(self.frame.map(|(index, _)| index), name)
    }

    fn file(&self, name: &str) -> String {
        self.arguments.folder.join(name).display().to_string()
    }

    /// The words of the user, and these.
    fn words(&self, command: &str, more: &[&str]) -> Vec<String> {
        let camera = self.frame.iter().flat_map(|(_, camera)| ["--camera".to_owned(), (*camera).to_owned()]);
        let own = [command].into_iter().map(str::to_owned).chain(self.arguments.words.iter().cloned());
        own.chain(camera).chain(more.iter().map(|word| (*word).to_owned())).collect()
    }

    fn steps(&self) -> Vec<Step> {
        let PlanArguments { parts, group, .. } = *self.arguments;
        let mut steps = Vec::new();
        let filled = self.file(&format!("{}.fogbow", self.id("fill")));
        if self.has_fill {
            let index = self.frame.map_or(0, |(index, _)| index);
            // The first frame of a group starts afresh, whether or not the frame before it has been filled: the same bits in any order.
            let (before, after) = (!index.is_multiple_of(group as usize), !(index + 1).is_multiple_of(group as usize));
            let cache = |index: usize| self.file(&Self::named(Some(index), "caches"));
            let mut words = vec!["-q".to_owned(), "-o".to_owned(), filled.clone()];
            let (mut writes, mut needs) = (vec![filled.clone()], Vec::new());
            if before {
                words.extend(["--cache-in".to_owned(), cache(index - 1)]);
                needs.push(Self::named(Some(index - 1), "fill"));
            }
            if after {
                words.extend(["--cache-out".to_owned(), cache(index)]);
                writes.push(cache(index));
            }
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            steps.push(Step {
                id: self.id("fill"),
                kind: "fill",
                run: self.words("fill", &words),
                after: needs,
                writes,
            });
        }
        let split = self.split.name();
        let digits = parts.to_string().len();
        let mut written = Vec::new();
        for part in 1..=parts {
            let id = self.id(&format!("part-{part:0digits$}"));
            let (file, kept) = (self.file(&format!("{id}.fogbow")), self.file(&format!("{id}.kept")));
            let of = format!("{part}/{parts}");
            let mut words = vec!["-q", "--part", &of, "--split", split, "--checkpoint", &kept, "--resume", "-o", &file];
            let after = if self.has_fill { vec![self.id("fill")] } else { Vec::new() };
            if self.has_fill {
                words.extend(["--fill", &filled]);
            }
            let run = self.words("render", &words);
            steps.push(Step { id, kind: "part", run, after, writes: vec![file.clone()] });
            written.push(file);
        }
        let after = steps.iter().filter(|step| step.kind == "part").map(|step| step.id.clone()).collect();
        let numbered = |file: &PathBuf| match self.frame {
            None => file.display().to_string(),
            Some((index, _)) => {
                let stem = file.file_stem().unwrap_or_default().to_string_lossy();
                let kind = file.extension().unwrap_or_default().to_string_lossy();
                file.with_file_name(format!("{stem}-{:04}.{kind}", index + 1)).display().to_string()
            }
        };
        let writes: Vec<String> = self.pictures.iter().map(numbered).collect();
        let outputs = writes.iter().flat_map(|file| ["-o".to_owned(), file.clone()]);
        let exposure = match self.arguments.render.exposure {
            0.0 => None,
            stops => Some(format!("--exposure={stops}")),
        };
        let quiet = ["merge".to_owned(), "-q".to_owned()].into_iter();
        let run = quiet.chain(written).chain(outputs).chain(exposure).collect();
        steps.push(Step { id: self.id("merge"), kind: "merge", run, after, writes });
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Command, parse};

    fn planned(more: &[&str]) -> Result<Vec<Step>, String> {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/lantern.xml");
        let words = ["fogbow", "plan", scene].into_iter().chain(more.iter().copied()).map(std::ffi::OsString::from);
        let Command::Plan(arguments) = parse(words).unwrap().command else { panic!() };
        graph(&arguments).map(|graph| graph.steps).map_err(|error| error.to_string())
    }

    #[test]
    fn every_step_waits_for_what_it_reads_and_parses() {
        let walk = std::env::temp_dir().join(format!("fogbow-walk-{}", std::process::id()));
        std::fs::write(&walk, "0,0,3 0,0,0\n\n0,0,2 0,0,0\n0,0,1 0,0,0\n").unwrap();
        let cached = ["--method", "radiance-cache", "--spp=8", "--folder", "f", "-o", "a.exr", "--parts", "3"];
        let frames = ["--cameras", walk.to_str().unwrap(), "--group", "2"];
        for (more, count) in [
            (vec!["--method", "path", "--spp", "8", "--parts=3", "-oa.exr", "--seed", "3"], 4),
            (cached.to_vec(), 5),
            ([&cached[..], &frames[..]].concat(), 15),
        ] {
            let steps = planned(&more).unwrap();
            assert_eq!(steps.len(), count, "{steps:#?}");
            let mut written: Vec<(&str, &str)> = Vec::new();
            for step in &steps {
                let words = std::iter::once("fogbow").chain(step.run.iter().map(String::as_str));
                parse(words.map(std::ffi::OsString::from)).unwrap_or_else(|_| panic!("{step:?}"));
                for (id, file) in written.iter().filter(|(_, file)| step.run.iter().any(|word| word == file)) {
                    assert!(step.after.iter().any(|after| after == id), "{} reads {file}", step.id);
                }
                written.extend(step.writes.iter().map(|file| (step.id.as_str(), file.as_str())));
            }
        }
        // Third frame: the first of a group.
        let steps = planned(&[&cached[..], &frames[..]].concat()).unwrap();
        let of = |id: &str| &steps.iter().find(|step| step.id == id).unwrap().after;
        assert_eq!(of("frame-0002-fill"), &["frame-0001-fill"]);
        assert!(of("frame-0003-fill").is_empty());
        std::fs::remove_file(walk).unwrap();
    }

    #[test]
    fn what_parts_cannot_do_is_refused() {
        for (more, word) in [
            (&["--noise", "0.1"][..], "--noise"),
            (&["--method", "path", "--part", "1/2"], "--part"),
            (&["--method", "radiance-cache"], "--spp"),
            (&["--method", "path", "--spp", "4", "--size", "8x8", "--parts", "9", "--split", "tiles"], "tiles"),
            (&["--method", "path", "--group", "2"], "--group"),
        ] {
            let error = planned(more).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }
}
