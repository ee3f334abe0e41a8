//! `fogbow plan bake`: a bake on many machines.

use std::path::PathBuf;

use clap::Args;

use super::bake::{BakeArguments, Source, cells_of, check_count};
use super::film_file::Split;
use super::plan::{Graph, Step, without};
use super::scene::SceneArguments;
use super::{Ending, Failure, output};

/// Prints as JSON which commands bake a scene on many machines, and which of them wait for which: `fogbow plan bake`.
///
/// A coarse bake tells the mean light, which errors are in proportion to; then all parts may run anywhere, in any order and at once; `merge` puts them together. All
/// steps share one folder. A step that was stopped goes on where it was when it is run again.
#[derive(Debug, Args)]
pub struct PlanBakeArguments {
    /// What to bake, with all options of `fogbow bake`.
    #[command(flatten)]
    pub bake: Box<BakeArguments>,
    /// Parts of the bake.
    #[arg(long = "parts", id = "part_count", value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..))]
    pub parts: u32,
    /// Where parts are put, on a disk that all machines share.
    #[arg(long, value_name = "FOLDER", default_value = "parts")]
    pub folder: PathBuf,
    /// Words of the command line, if [`super::parse`] has read them.
    #[arg(skip)]
    pub words: Vec<String>,
}

/// Options of this command with a value.
const OWN: [&str; 3] = ["--parts", "--folder", "--output"];

/// Options of a bake that the coarse one has its own of.
const OF_LEVEL: [&str; 5] = ["--counts", "--spacing", "--basis", "--error", "--passes"];

/// Standard error of the coarse bake's probes: their mean is known much better.
const ERROR_OF_LEVEL: &str = "0.05";

pub(super) fn run(arguments: &PlanBakeArguments) -> Result<Ending, Failure> {
    output::print(&serde_json::to_string_pretty(&graph(arguments)?)?)?;
    Ok(Ending::Done)
}

fn graph(arguments: &PlanBakeArguments) -> Result<Graph, Failure> {
    let PlanBakeArguments { bake, parts, folder, words } = arguments;
    let scene = match bake.scene.as_slice() {
        [scene] => scene,
        [] => return Err("--from-file: there is nothing to bake".into()),
        _ => return Err("parts are of one scene".into()),
    };
    if bake.many.part.is_some() || bake.many.level.is_some() || bake.resume {
        return Err("--part, --level and --resume: the plan says them for every step; leave them out".into());
    }
    if bake.per_light || bake.method != Source::Path {
        return Err(
            "--per-light and --method: parts are baked by paths, for all lights at once; bake others in one piece"
                .into(),
        );
    }
    let [to] = bake.output.as_slice() else { return Err("--output: parts make one .bake file".into()) };
    if !to.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("bake")) {
        let what = "parts make a .bake file; fogbow bake --from-file turns it into others";
        return Err(format!("{}: {what}", to.display()).into());
    }
    let counts = cells_of(bake, &SceneArguments { file: scene.clone(), reading: bake.reading.clone() })?;
    check_count(*parts, counts)?;
    let file = |name: String| folder.join(name).display().to_string();
    let own = without(words, &OWN);
    let step = |id: String, kind, words: Vec<&str>, after: Vec<String>, to: &str| Step {
        id,
        kind,
        run: words.into_iter().map(str::to_owned).collect(),
        after,
        writes: vec![to.to_owned()],
    };
    let level = file("level.bake".to_owned());
    let of_level = without(&own, &OF_LEVEL);
    let [x, y, z] = counts.map(|n| n.div_ceil(4));
    let coarse = format!("{x}x{y}x{z}");
    let mut run: Vec<&str> = vec!["bake"];
    run.extend(of_level.iter().map(String::as_str));
    run.extend(["--counts", &coarse, "--basis", "fluence", "--error", ERROR_OF_LEVEL, "--resume", "-q", "-o", &level]);
    let mut steps = vec![step("level".to_owned(), "fill", run, Vec::new(), &level)];
    let digits = parts.to_string().len();
    let mut written = Vec::new();
    for part in 1..=*parts {
        let (id, of) = (format!("part-{part:0digits$}"), format!("{part}/{parts}"));
        let file = file(format!("{id}.fogbow"));
        let mut run: Vec<&str> = vec!["bake"];
        run.extend(own.iter().map(String::as_str));
        run.extend(["--level", &level, "--part", &of, "--resume", "-q", "-o", &file]);
        steps.push(step(id, "part", run, vec!["level".to_owned()], &file));
        written.push(file);
    }
    let after = steps.iter().filter(|step| step.kind == "part").map(|step| step.id.clone()).collect();
    let to = to.display().to_string();
    let mut run: Vec<&str> = vec!["merge", "-q"];
    run.extend(written.iter().map(String::as_str));
    run.extend(["-o", &to]);
    steps.push(step("merge".to_owned(), "merge", run, after, &to));
    Ok(Graph {
        version: 1,
        scene: scene.display().to_string(),
        method: "path",
        split: (*parts > 1).then_some(Split::Bricks),
        parts: *parts,
        frames: 1,
        folder: folder.display().to_string(),
        steps,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Command, parse};

    fn planned(more: &[&str]) -> Result<Vec<Step>, String> {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/lantern.xml");
        let words =
            ["fogbow", "plan", "bake", scene].into_iter().chain(more.iter().copied()).map(std::ffi::OsString::from);
        let Command::PlanBake(arguments) = parse(words).unwrap().command else { panic!() };
        graph(&arguments).map(|graph| graph.steps).map_err(|error| error.to_string())
    }

    #[test]
    fn a_bake_is_a_coarse_one_and_parts_that_merge() {
        let steps = planned(&[
            "--counts=9x4x4",
            "--error",
            "0.2",
            "--basis",
            "sh1",
            "--parts",
            "3",
            "--folder",
            "f",
            "-o",
            "a.bake",
        ])
        .unwrap();
        assert_eq!(steps.iter().map(|step| step.kind).collect::<Vec<_>>(), ["fill", "part", "part", "part", "merge"]);
        for step in &steps {
            let words = std::iter::once("fogbow").chain(step.run.iter().map(String::as_str));
            parse(words.map(std::ffi::OsString::from)).unwrap_or_else(|_| panic!("{step:?}"));
            let reads = steps.iter().filter(|other| other.id != step.id && step.run.contains(&other.writes[0]));
            assert_eq!(reads.map(|other| other.id.clone()).collect::<Vec<_>>(), step.after, "{step:?}");
        }
        assert!(
            steps[0].run.contains(&"3x1x1".to_owned())
                && !steps[0].run.iter().any(|word| word.starts_with("--counts="))
        );
        assert!(steps[2].run.contains(&"--counts=9x4x4".to_owned()));
    }

    #[test]
    fn bakes_that_have_no_parts_are_refused() {
        for (more, word) in [
            (&["-o", "a.json"][..], "a.json: parts make a .bake file"),
            (&["-o", "a.bake", "--method", "photons"], "--method"),
            (&["-o", "a.bake", "--per-light"], "--per-light"),
            (&["-o", "a.bake", "--resume"], "--resume"),
            (&["-o", "a.bake", "--counts", "8x4x4", "--parts", "3"], "3 parts of 2 bricks"),
        ] {
            let error = planned(more).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }
}
