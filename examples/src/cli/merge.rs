//! `fogbow merge`.

use std::path::{Path, PathBuf};

use clap::Args;
use fogbow::picture::bytes::{Described, described};
use fogbow::picture::{Settings, Tiles};
use fogbow_std::film::Film;
use fogbow_std::image::write_film;
use fogbow_std::seed::Sequence;
use serde::Serialize;

use super::bake::parts::{holds_probes, probe_bytes, probes};
use super::film_file::{About, FilmFile, Measured, Parts, Split, is_film, numbers};
use super::{Ending, Failure, output};

/// Puts parts of a picture or of a bake together: to the bits of the whole, in whatever order they are given.
///
/// Parts come from `fogbow render --part`, from `fogbow bake --part`, or from a merge of some of them. Nothing is written if one of them is damaged, of another picture, there twice or
/// missing; all that is wrong is told at once. Exit code 2 then.
#[derive(Debug, Args)]
pub struct MergeArguments {
    /// The parts; a folder stands for the .fogbow files in it.
    #[arg(required = true, value_name = "PART.fogbow")]
    pub parts: Vec<PathBuf>,
    /// Image to write: .png, .exr or .pfm, or .fogbow for sums that `fogbow render --checkpoint FILE --resume` goes on with; of a bake, .bake; may be
    /// repeated.
    #[arg(short, long, value_name = "FILE", required_unless_present = "check")]
    pub output: Vec<PathBuf>,
    /// Makes the picture or the bake of the parts that are there, and says which are not.
    #[arg(long)]
    pub allow_missing: bool,
    /// Stops by which PNG images are brightened.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = output::finite)]
    pub exposure: f32,
    /// Writes nothing but a JSON object on standard output: numbers of parts that are there and that are missing, files that cannot be used, and why.
    /// Exit code 1 if anything is missing.
    #[arg(long, conflicts_with = "output")]
    pub check: bool,
    /// Says nothing but what is wrong.
    #[arg(short, long)]
    pub quiet: bool,
}

/// A file that can be used.
struct Found {
    file: PathBuf,
    about: About,
    tag: u64,
    /// Of a bake, nothing.
    picture: Option<Described>,
    /// All of it, or read again when its turn comes: see [`MOST_HELD`].
    film: Option<FilmFile>,
}

/// Bytes of parts that are held in memory while all are looked at. More are read twice.
const MOST_HELD: usize = 1 << 30;

/// A file that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct Refused {
    file: String,
    why: String,
}

/// What is there.
struct Sorted {
    good: Vec<Found>,
    refused: Vec<Refused>,
    /// Of all that is good.
    parts: Option<Parts>,
}

#[derive(Serialize)]
struct Checked<'a> {
    split: Option<Split>,
    of: u32,
    there: Vec<u32>,
    missing: Vec<u32>,
    refused: &'a [Refused],
}

pub(super) fn run(arguments: &MergeArguments) -> Result<Ending, Failure> {
    let files = files(&arguments.parts)?;
    for file in &arguments.output {
        if is_film(file) || is_bake(file) { output::check_place(file) } else { output::check(file) }?;
    }
    let sorted = sorted(&files);
    let missing = sorted.parts.as_ref().map_or_else(Vec::new, Parts::missing);
    if arguments.check {
        let (split, of, there) = match (&sorted.parts, sorted.good.is_empty()) {
            (Some(parts), _) => (Some(parts.split), parts.of, parts.has.clone()),
            (None, is_empty) => (None, 1, if is_empty { Vec::new() } else { vec![1] }),
        };
        let missing = if sorted.good.is_empty() { vec![] } else { missing };
        let is_complete = missing.is_empty() && sorted.refused.is_empty();
        output::print(&serde_json::to_string(&Checked { split, of, there, missing, refused: &sorted.refused })?)?;
        return Ok(if is_complete { Ending::Done } else { Ending::Stopped });
    }
    let mut wrong: Vec<String> =
        sorted.refused.iter().map(|refused| format!("{}: {}", refused.file, refused.why)).collect();
    let (word, verb) = if missing.len() == 1 { ("part", "is") } else { ("parts", "are") };
    let of = sorted.parts.as_ref().map_or(1, |parts| parts.of);
    if !missing.is_empty() && !arguments.allow_missing {
        let hint = "; --allow-missing makes a picture of the others";
        wrong.push(format!("{word} {} of {of} {verb} missing{hint}", numbers(&missing)));
    }
    if !wrong.is_empty() || sorted.good.is_empty() {
        return Err(wrong.join("\n").into());
    }
    let is_of_bake = sorted.good.iter().all(|found| found.picture.is_none());
    if let Some(file) = arguments.output.iter().find(|file| !is_film(file) && is_bake(file) != is_of_bake) {
        let what = if is_of_bake {
            "these are parts of a bake, which make a .bake file; fogbow bake --from-file turns it into others"
        } else {
            "these are parts of a picture, and no bake"
        };
        return Err(format!("{}: {what}", file.display()).into());
    }
    let film = if is_of_bake { merged_probes(sorted) } else { merged(sorted) }?;
    let pictures = arguments.output.iter().filter(|file| !is_film(file) && !is_bake(file)).count();
    if let (Some(reason), true) = (&film.about.unfinished, pictures > 0) {
        return Err(format!(
            "sums alone do not make this picture: {reason}; merge into a .fogbow file, and finish it by fogbow render with the same options and \
             --checkpoint FILE.fogbow --resume"
        )
        .into());
    }
    let picture = if pictures > 0 { Some(developed(&film)?) } else { None };
    for file in &arguments.output {
        match &picture {
            Some(picture) if !is_film(file) && !is_bake(file) => write_film(file, picture, arguments.exposure)?,
            _ if is_bake(file) => fogbow_std::files::write(file, &film.picture).map_err(|error| error.to_string())?,
            _ => film.write(file)?,
        }
        if !arguments.quiet {
            report!("wrote {}", file.display());
        }
    }
    if !missing.is_empty() {
        let (missing, what) = (numbers(&missing), lack(&film));
        say!("fogbow: {word} {missing} of {of} {verb} missing: {what}");
        return Ok(Ending::Stopped);
    }
    Ok(Ending::Done)
}

/// What a picture lacks of which parts are missing.
fn lack(film: &FilmFile) -> &'static str {
    match &film.about.parts {
        Some(Parts { split: Split::Tiles, .. }) => "their tiles are black",
        Some(Parts { split: Split::Bricks, .. }) => "their probes are dark until fogbow bake --resume bakes them",
        _ => "all pixels have fewer samples",
    }
}

fn is_bake(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("bake"))
}

/// All files, those of folders by name.
fn files(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut all = Vec::new();
    for path in given {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let mut inside: Vec<PathBuf> =
            entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|file| is_film(file)).collect();
        inside.sort();
        all.extend(inside);
    }
    if all.is_empty() {
        return Err("there are no .fogbow files to merge".into());
    }
    Ok(all)
}

fn found(file: &Path, held: &mut usize) -> Result<Found, String> {
    let prefix = format!("{}: ", file.display());
    let film = FilmFile::read(file).map_err(|error| {
        let text = error.to_string();
        text.strip_prefix(&prefix).map_or(text.clone(), str::to_owned)
    })?;
    if film.picture.is_empty() {
        return Err("has no samples: it is a fill, for fogbow render --fill".to_owned());
    }
    let is_single = film.about.parts.as_ref().is_none_or(|parts| parts.has.len() == 1);
    let (picture, is_done, command) = if holds_probes(&film) {
        (None, film.about.unfinished.is_none(), "bake --resume with the same options")
    } else {
        let picture = described(&film.picture).map_err(|error| format!("its picture {error}"))?;
        (Some(picture), picture.is_done, "render --checkpoint FILE --resume")
    };
    if is_single && !is_done {
        return Err(format!("is not done yet ({}): go on with it by fogbow {command}", film.about.name()));
    }
    *held = held.saturating_add(film.picture.len());
    let (about, tag) = (film.about.clone(), film.tag);
    Ok(Found { file: file.to_owned(), about, tag, picture, film: (*held <= MOST_HELD).then_some(film) })
}

/// Which files belong together: those of the picture that most of them are of.
fn sorted(files: &[PathBuf]) -> Sorted {
    let (mut all, mut refused, mut held) = (Vec::new(), Vec::new(), 0);
    let refuse = |file: &Path, why: String| Refused { file: file.display().to_string(), why };
    for file in files {
        match found(file, &mut held) {
            Ok(found) => all.push(found),
            Err(why) => refused.push(refuse(file, why)),
        }
    }
    let kind = |found: &Found| {
        let parts = found.about.parts.as_ref().map(|parts| (parts.split, parts.of));
        (found.tag, found.about.program.clone(), found.about.samples, parts)
    };
    let count = |one: &Found| all.iter().filter(|other| kind(other) == kind(one)).count();
    let Some(most) = all.iter().map(count).max() else {
        return Sorted { good: Vec::new(), refused, parts: None };
    };
    let usual = all.iter().find(|one| count(one) == most).map(|one| (kind(one), one.about.clone()));
    let Some((usual, about)) = usual else { return Sorted { good: Vec::new(), refused, parts: None } };
    let mut good: Vec<Found> = Vec::new();
    for found in all {
        let twice = |other: &Found| match (&other.about.parts, &found.about.parts) {
            (Some(there), Some(here)) => here.has.iter().copied().find(|number| there.has.contains(number)),
            _ => Some(1),
        };
        let why = if kind(&found) != usual {
            about.difference(&found.about, false).unwrap_or_else(|| format!("is {}, not of these", found.about.name()))
        } else if let Some((other, number)) = good.iter().find_map(|other| Some((other, twice(other)?))) {
            let what =
                if found.about.parts.is_some() { format!("part {number}") } else { "the whole picture".to_owned() };
            format!("has {what}, which {} has, too", other.file.display())
        } else {
            good.push(found);
            continue;
        };
        refused.push(refuse(&found.file, why));
    }
    let parts = about.parts.map(|parts| {
        let mut has: Vec<u32> =
            good.iter().flat_map(|found| found.about.parts.iter().flat_map(|p| p.has.clone())).collect();
        has.sort_unstable();
        Parts { has, ..parts }
    });
    Sorted { good, refused, parts }
}

type Sums = Tiles<'static, Sequence, ()>;

fn sums(settings: Settings, film: &FilmFile) -> Result<Sums, Failure> {
    Ok(Tiles::read(settings, Sequence::default(), film.tag, &film.picture)?)
}

/// The sum of all parts.
fn merged(sorted: Sorted) -> Result<FilmFile, Failure> {
    let Sorted { good, parts, .. } = sorted;
    let Some(first) = good.first() else { return Err("there is nothing to merge".into()) };
    let mut whole = first.empty();
    let Some(parts) = parts else {
        let film = good.into_iter().next().map(Found::film).transpose()?;
        return Ok(film.map_or(whole, |film| FilmFile { caches: Vec::new(), grid: Vec::new(), ..film }));
    };
    let settings: Vec<Settings> = good.iter().filter_map(|found| Some(found.picture?.settings)).collect();
    let Some(of_first) = settings.first() else { return Err("there is nothing to merge".into()) };
    let samples = match parts.split {
        Split::Samples => settings.iter().map(|settings| settings.samples).sum(),
        Split::Tiles | Split::Bricks => of_first.samples,
    };
    let mut sum: Sums = Tiles::new(Settings { samples, ..*of_first }, Sequence::default());
    let mut unfinished = None;
    for (found, settings) in good.into_iter().zip(settings) {
        let film = found.film()?;
        sum.merge(&sums(settings, &film)?);
        unfinished = unfinished.or(film.about.unfinished);
    }
    whole.about.unfinished = unfinished;
    whole.picture = sum.to_bytes(whole.tag);
    whole.about.parts = (!parts.missing().is_empty()).then_some(parts);
    Ok(whole)
}

/// All probes of all parts.
fn merged_probes(sorted: Sorted) -> Result<FilmFile, Failure> {
    let Sorted { good, parts, .. } = sorted;
    let Some(first) = good.first() else { return Err("there is nothing to merge".into()) };
    let mut whole = first.empty();
    let mut all = None;
    for found in good {
        let (file, film) = (found.file.clone(), found.film()?);
        let read = || probes(&film).map_err(|error| format!("{}: its grid {error}", file.display()));
        if all.is_none() {
            all = Some(read()?);
        }
        // The first adds nothing to itself, but what it lacks is due from then on.
        if let Some((sum, _)) = &mut all {
            sum.merge(&read()?.0).map_err(|error| format!("{}: {error}", file.display()))?;
        }
    }
    whole.picture = all.map_or_else(Vec::new, |(grid, tag)| probe_bytes(&grid, tag));
    whole.about.parts = parts.filter(|parts| !parts.missing().is_empty());
    Ok(whole)
}

impl Found {
    /// What it is of, without what is in it.
    fn empty(&self) -> FilmFile {
        let (caches, grid, picture) = (Vec::new(), Vec::new(), Vec::new());
        let about = About { unfinished: None, ..self.about.clone() };
        FilmFile { tag: self.tag, about, measured: Measured::default(), caches, grid, picture }
    }

    /// All of it.
    fn film(self) -> Result<FilmFile, Failure> {
        let film = self.film.map_or_else(|| FilmFile::read(&self.file), Ok)?;
        // Changed since it was looked at.
        if (film.tag, &film.about.parts) != (self.tag, &self.about.parts) {
            return Err(format!("{}: is being written", self.file.display()).into());
        }
        Ok(film)
    }
}

/// The picture that sums make.
fn developed(film: &FilmFile) -> Result<Film, Failure> {
    let settings = described(&film.picture)?.settings;
    let [width, height] = settings.size;
    let mut picture = Film::new(width, height, &film.about.layers)?;
    if film.about.layers.len() != settings.layers as usize {
        return Err("the file names other layers than it has".into());
    }
    picture.replace(sums(settings, film)?.into_sums());
    Ok(if film.about.has_layers { picture } else { picture.first(1)? })
}
