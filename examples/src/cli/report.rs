//! What the user sees of a render: the bar, the summary, the file of statistics.

use core::cell::Cell;
use core::fmt::Write;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use fogbow::cache::{AuditedRegion, BiasMap, Deviation, Findings, Kind, MeanLight, Squared};
use fogbow_std::progress::Progress;
use fogbow_std::stats::{Seconds, Stopwatch};
use fogbow_std::tiles::{Outcome, Reason};
use indicatif::{ProgressBar, ProgressStyle};

use super::RenderArguments;
use super::choice::Choice;
use super::radiance_cache::Audited;
use super::vpl::Audit;
use crate::statistics::Statistics;

/// Steps of the progress bar.
const STEPS: u64 = 1000;

/// Seconds between two lines that say how far the work is, where there is no terminal to draw a bar on: often enough for a log.
const BETWEEN_LINES: f64 = 10.0;

/// Seconds between two words to other programs.
const BETWEEN_EVENTS: f64 = 0.5;

/// How a user sees progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Voice {
    /// Not at all.
    Quiet,
    /// A bar on a terminal, now and then a line elsewhere: on standard error.
    Bar,
    /// A JSON object per line, on standard output.
    Json,
}

impl Voice {
    pub(super) fn unless(quiet: bool) -> Self {
        if quiet { Self::Quiet } else { Self::Bar }
    }
}

/// The progress of a command, in every stage.
pub(super) struct Bar {
    voice: Voice,
    /// On a terminal.
    bar: Option<ProgressBar>,
    clock: Stopwatch,
    /// When something was said last (s).
    last: Cell<f64>,
}

impl Bar {
    pub(super) fn new(voice: Voice) -> Self {
        let has_bar = voice == Voice::Bar && std::io::stderr().is_terminal();
        let bar = has_bar.then(|| {
            let bar = ProgressBar::new(STEPS);
            // No wider than 40 columns, with the message.
            if let Ok(style) = ProgressStyle::with_template("{bar:10} {percent:>3} % {msg}") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar
        });
        Self { voice, bar, clock: Stopwatch::start(), last: Cell::new(0.0) }
    }

    /// Shows which share of a stage is done, and how long it may still take (s).
    fn say(&self, stage: &str, share: f64, left: Option<f64>, detail: &str) {
        if let Some(bar) = &self.bar {
            bar.set_position((share.clamp(0.0, 1.0) * STEPS as f64) as u64);
            let left =
                left.filter(|left| left.is_finite()).map_or_else(String::new, |left| format!("{} left", clock(left)));
            let what = if detail.is_empty() { stage } else { detail };
            bar.set_message(if left.is_empty() { what.to_owned() } else { format!("{what}, {left}") });
            return;
        }
        let every = match self.voice {
            Voice::Quiet => return,
            Voice::Bar => BETWEEN_LINES,
            Voice::Json => BETWEEN_EVENTS,
        };
        let elapsed = self.clock.elapsed().wall;
        if elapsed - self.last.get() < every {
            return;
        }
        self.last.set(elapsed);
        if self.voice == Voice::Json {
            let left =
                left.filter(|left| left.is_finite()).map_or_else(|| "null".to_owned(), |left| format!("{left:.1}"));
            let stage = quoted(stage);
            report!(
                "{{\"event\": \"progress\", \"stage\": {stage}, \"share\": {share:.3}, \"elapsed\": {elapsed:.1}, \"left\": {left}}}"
            );
        } else {
            let left =
                left.filter(|left| left.is_finite()).map_or_else(String::new, |left| format!(", {} left", clock(left)));
            let detail = if detail.is_empty() { String::new() } else { format!(", {detail}") };
            say!("{}: {stage} {:.0} %{detail}{left}", clock(elapsed), 100.0 * share);
        }
    }

    /// How far a picture is.
    pub(super) fn show(&self, progress: &Progress, pixels: u64) {
        let spp = progress.done as f64 / pixels.max(1) as f64;
        let left = progress.remaining().map(|left| left.as_secs_f64());
        self.say("render", progress.fraction(), left, &format!("{spp:.0} spp"));
    }

    /// Shows a share of work that is done after so many seconds.
    pub(super) fn share(&self, share: f32, elapsed: f64) {
        self.say("bake", f64::from(share), Some(elapsed * f64::from((1.0 - share) / share)), "");
    }

    /// Says what is done before there is anything to show, and which share of the jobs of this stage.
    pub(super) fn tell(&self, stage: &'static str, share: f32) {
        self.say(stage, f64::from(share), None, "");
    }

    /// Tells other programs of a file that was written.
    pub(super) fn wrote(&self, file: &Path) {
        if self.voice == Voice::Json {
            report!("{{\"event\": \"wrote\", \"file\": {}}}", quoted(&file.display().to_string()));
        }
    }

    /// Tells other programs how the command ended.
    pub(super) fn ended(&self, how: Reason) {
        if self.voice == Voice::Json {
            report!("{{\"event\": \"end\", \"ended\": \"{}\"}}", reason_word(how));
        }
    }

    pub(super) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn reason_word(reason: Reason) -> &'static str {
    match reason {
        Reason::Done => "done",
        Reason::TimeUp => "time",
        Reason::Cancelled => "cancelled",
    }
}

/// Seconds as people read them.
fn clock(seconds: f64) -> String {
    if seconds < 100.0 {
        return format!("{seconds:.1} s");
    }
    let whole = seconds.round() as u64;
    if whole < 3600 {
        format!("{}:{:02} min", whole / 60, whole % 60)
    } else {
        format!("{}:{:02} h", whole / 3600, whole / 60 % 60)
    }
}

/// What a render did.
pub(super) struct Report<'a> {
    pub(super) arguments: &'a RenderArguments,
    pub(super) choice: &'a Choice,
    pub(super) outputs: &'a [PathBuf],
    pub(super) outcome: &'a Outcome,
    pub(super) statistics: &'a Statistics,
    pub(super) size: (u32, u32),
    pub(super) audit: Option<Audit>,
    pub(super) audited: Option<&'a Audited>,
}

impl Report<'_> {
    /// The mean, to a tenth: tiles with little noise have fewer.
    fn samples_per_pixel(&self) -> f64 {
        let pixels = f64::from(self.size.0) * f64::from(self.size.1);
        (self.outcome.counters.samples as f64 / pixels * 10.0).round() / 10.0
    }

    /// The summary, on standard error: standard output stays free for scripts.
    pub(super) fn print(&self) {
        let Seconds { wall, cpu } = self.outcome.seconds;
        let (width, height) = self.size;
        let counters = &self.outcome.counters;
        let ending = match self.outcome.reason {
            Reason::Done => "",
            Reason::TimeUp => " (time is up)",
            Reason::Cancelled => " (stopped early; the image so far is kept)",
        };
        say!("{width} x {height} pixels, {} samples per pixel{ending}", self.samples_per_pixel());
        let cpu = cpu.map_or_else(String::new, |c| format!(" and {} of processor time", clock(c)));
        let all: f64 = self.statistics.phases.iter().map(|(_, seconds)| seconds.wall).sum();
        let rays = self.rays_per_second() * 1e-6;
        say!("{} in all; {}{cpu} for samples, {rays:.2} million rays per second", clock(all.max(wall)), clock(wall));
        if let Some(Audited { error: most, findings, map, repaired, may_be_hidden }) = self.audited {
            let most = *most;
            let per_cent = (1e4 * most).round() / 100.0;
            // More time helps as long as what was asked for is not reached.
            let may_improve = self.is_timed() && self.arguments.cache.error.is_none_or(|due| most > due);
            let due = format!("{per_cent} % {}", if may_improve { "it was made for" } else { "of --error" });
            if self.is_timed() {
                let hint = if may_improve { "; more --time makes it smaller" } else { "" };
                say!("made for an error of {per_cent} %{hint}");
            }
            let in_places = |map: &BiasMap| {
                map.worst(f64::from(most)).map(|region| {
                    let [columns, rows] = pixels(region, self.size);
                    format!("in places, most in columns {columns} and rows {rows}: {}", percent(&region.cached))
                })
            };
            for (found, map) in repaired {
                let places = in_places(map).map_or_else(String::new, |places| format!("; {places}"));
                let error = rooted(&found.squared);
                let misled =
                    misled(found).map_or_else(String::new, |kinds| format!("; gradients of {kinds} led the wrong way"));
                say!(
                    "repaired: bias was {} of what is cached{}, error {error}{misled}{places}",
                    percent(&found.cached),
                    blamed(found)
                );
            }
            let is_unknown = findings.cached.is_unknown() && !findings.cached.exceeds(f64::from(most));
            if is_unknown {
                say!(
                    "warning: how far the picture is off is not known: what paths bring along {} eye rays varies too much to be compared with; take more --audit rays",
                    findings.rays
                );
            } else {
                let all = if findings.all.is_unknown() { "not known".to_owned() } else { percent(&findings.all) };
                say!(
                    "bias {} of what is cached{}, error {}; {all} of all light, by path tracing along {} eye rays",
                    percent(&findings.cached),
                    blamed(findings),
                    rooted(&findings.squared),
                    findings.rays,
                );
            }
            if findings.all.exceeds(f64::from(most)) || findings.cached.exceeds(f64::from(most)) {
                say!("warning: the picture is off by more than the {due}");
            } else if findings.squared.exceeds(f64::from(most)) {
                say!(
                    "warning: what is cached has an error of more than the {due}, in blotches that are too bright and too dark"
                );
            }
            let noise = self.statistics.record_noise.filter(|noise| *noise > NOISY * most);
            if let Some(noise) = noise {
                say!("warning: what is cached has {:.1} % of noise in the picture, more than the {due}", 100.0 * noise);
            }
            let colours =
                COLOURS.into_iter().zip(&findings.channels).filter(|(_, found)| found.exceeds(f64::from(most)));
            let colours: Vec<String> = colours.map(|(name, found)| format!("{name} {}", percent(found))).collect();
            if !colours.is_empty() {
                say!("warning: colours are off by more than the {due}: {} of the mean light", colours.join(", "));
            }
            if let Some(kinds) = misled(findings) {
                say!("warning: gradients of {kinds} lead the wrong way, so that light between records is wrong");
            }
            if let Some(places) = in_places(map) {
                say!("warning: off by more than the {due} {places}");
            }
            if *may_be_hidden {
                say!(
                    "note: mirrors or glass send on light of lamps without extent. Photons bring it, but no path finds it: what is too bright may be that light"
                );
            }
        }
        if counters.non_finite > 0 {
            say!("warning: {} samples were no finite numbers and count as black", counters.non_finite);
        }
        for file in self.outputs.iter().chain(&self.arguments.cache.cache_out) {
            say!("wrote {}", file.display());
        }
    }

    /// Whether time decided what error caches were filled for.
    fn is_timed(&self) -> bool {
        self.arguments.time.is_some() && !self.arguments.cache.has_files()
    }

    fn rays_per_second(&self) -> f64 {
        let counters = &self.outcome.counters;
        (counters.rays + counters.shadow_rays) as f64 / self.outcome.seconds.wall.max(1e-9)
    }

    /// The file of statistics.
    pub(super) fn json(&self) -> String {
        let counters = &self.outcome.counters;
        let reason = reason_word(self.outcome.reason);
        let mut phases = String::new();
        for (index, (name, seconds)) in self.statistics.phases.iter().enumerate() {
            let cpu = seconds.cpu.map_or_else(|| "null".to_owned(), |c| format!("{c:.6}"));
            let comma = if index == 0 { "" } else { "," };
            // Writing to a string cannot fail.
            let _ = write!(phases, "{comma}\n    {}: {{\"wall\": {:.6}, \"cpu\": {cpu}}}", quoted(name), seconds.wall);
        }
        let listed = |counts: &[(String, u64)]| {
            let entries: Vec<String> =
                counts.iter().map(|(name, count)| format!("{}: {count}", quoted(name))).collect();
            entries.join(", ")
        };
        let energy = self.audit.map_or_else(String::new, |audit| {
            let recovered: Vec<String> = audit.recovered.iter().map(|part| format!("{part:.6e}")).collect();
            let left = audit.left.map_or_else(|| "null".to_owned(), |left| format!("{left:.6e}"));
            let bound = if audit.bound.is_finite() { format!("{:.6e}", audit.bound) } else { "null".to_owned() };
            let lost = audit.left.map_or_else(
                || "null".to_owned(),
                |left| format!("{:.6e}", left + audit.recovered.iter().sum::<f64>()),
            );
            format!(
                "\"energy\": {{\"bound\": {bound}, \"clamped_layer\": {:.6e}, \"clamped_away\": {lost}, \"recovered\": [{}], \"left\": {left}}},\n  ",
                audit.clamped,
                recovered.join(", "),
            )
        });
        let findings = self.audited.map_or_else(String::new, |Audited { error: made_for, findings, map, repaired, .. }| {
            let number = |x: f64| if x.is_finite() { format!("{x:.6e}") } else { "null".to_owned() };
            let entry = |name: &str, found: &Deviation| {
                format!("{}: {{\"bias\": {}, \"error\": {}}}", quoted(name), number(found.bias), number(found.error))
            };
            let square = |found: &Squared| {
                let Squared { mean, error } = *found;
                format!("\"squared\": {{\"mean\": {}, \"error\": {}}}", number(mean), number(error))
            };
            let entries = |findings: &Findings| {
                let parts = Kind::FINAL.into_iter().filter_map(|kind| Some(entry(kind.name(), &findings.of(kind)?)));
                let all = [entry("all", &findings.all), entry("cached", &findings.cached), square(&findings.squared)];
                let gradients = Kind::FINAL.into_iter().filter_map(|kind| Some(entry(kind.name(), &findings.gradients(kind)?)));
                let gradients = format!("\"gradients\": {{{}}}", gradients.collect::<Vec<_>>().join(", "));
                let channels = COLOURS.into_iter().zip(&findings.channels).map(|(name, found)| entry(name, found));
                let channels = format!("\"channels\": {{{}}}", channels.collect::<Vec<_>>().join(", "));
                all.into_iter().chain([channels]).chain(parts).chain([gradients]).collect::<Vec<_>>().join(", ")
            };
            let repaired: Vec<String> = repaired.iter().map(|(found, _)| format!("{{{}}}", entries(found))).collect();
            let regions = map.regions().iter().map(|region| {
                let light = |name: &str, light: &MeanLight| {
                    format!("\"{name}\": {{\"mean\": {}, \"error\": {}}}", number(light.mean), number(light.error))
                };
                let parts = [
                    light("told", &region.told),
                    light("traced", &region.traced),
                    entry("all", &region.all),
                    entry("cached", &region.cached),
                    square(&region.squared),
                ];
                format!("{{\"rays\": {}, {}}}", region.rays, parts.join(", "))
            });
            let regions: Vec<String> = regions.collect();
            let map = format!("{{\"side\": {}, \"by_row\": [{}]}}", map.side(), regions.join(", "));
            let (rays, all, repaired) = (findings.rays, entries(findings), repaired.join(", "));
            format!("\"audit\": {{\"made_for\": {made_for}, \"rays\": {rays}, {all}, \"repaired\": [{repaired}], \"regions\": {map}}},\n  ")
        });
        let (bytes, records) = (listed(&self.statistics.bytes), listed(&self.statistics.records));
        let noise =
            self.statistics.record_noise.map_or_else(String::new, |noise| format!("\"record_noise\": {noise},\n  "));
        let coarser = self.statistics.coarser.iter().map(|(kind, factor)| format!("{}: {factor}", quoted(kind)));
        let coarser = coarser.collect::<Vec<_>>().join(", ");
        let noise = if coarser.is_empty() { noise } else { format!("{noise}\"coarser\": {{{coarser}}},\n  ") };
        let instead = self.choice.instead.as_ref();
        let instead = instead.map_or_else(String::new, |reason| format!("\"why_path\": {},\n  ", quoted(reason)));
        format!(
            "{{\n  \"scene\": {},\n  \"method\": \"{}\",\n  {instead}\"width\": {},\n  \"height\": {},\n  \
             \"samples_per_pixel\": {},\n  \"seed\": {},\n  \"ended\": \"{reason}\",\n  \
             \"seconds\": {{{phases}\n  }},\n  \"counts\": {{\"samples\": {}, \"rays\": {}, \"shadow_rays\": {}, \
             \"collisions\": {}, \"medium_lookups\": {}, \"medium_segments\": {}, \"cache_lookups\": {}, \"cache_misses\": {}, \"non_finite\": {}}},\n  \
             {energy}{findings}{noise}\"records\": {{{records}}},\n  \"bytes\": {{{bytes}}}\n}}\n",
            quoted(&self.arguments.scene.file.display().to_string()),
            self.choice.method.name(),
            self.size.0,
            self.size.1,
            self.samples_per_pixel(),
            self.arguments.seed,
            counters.samples,
            counters.rays,
            counters.shadow_rays,
            counters.collisions,
            counters.lookups,
            counters.segments,
            counters.cache_lookups,
            counters.cache_misses,
            counters.non_finite,
        )
    }
}

/// `−0.3 ± 0.4 %`.
fn percent(found: &Deviation) -> String {
    if !found.error.is_finite() {
        return "unknown".to_owned();
    }
    format!("{:+.1} ± {:.1} %", 100.0 * found.bias, 100.0 * found.error).replace('-', "−")
}

/// An error by its square, with what it may be within a standard error: at most, where that says no more.
fn rooted(found: &Squared) -> String {
    if !found.error.is_finite() {
        return "unknown".to_owned();
    }
    let [least, most] = found.range();
    if least > 0.0 {
        format!("{:.1} % ({:.1} to {:.1} %)", 100.0 * found.root(), 100.0 * least, 100.0 * most)
    } else {
        format!("{:.1} % at most", 100.0 * (found.mean.max(0.0) + found.error).sqrt())
    }
}

/// Names of the kinds whose gradients lead the wrong way.
fn misled(findings: &Findings) -> Option<String> {
    let names: Vec<&str> = Kind::FINAL.into_iter().filter(|kind| findings.is_misled(*kind)).map(Kind::name).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// Columns and rows of a region, as `0-31`, from the upper left pixel on.
fn pixels(region: &AuditedRegion, (width, height): (u32, u32)) -> [String; 2] {
    let [low, high] = region.corners;
    [0, 1].map(|axis| {
        let size = [width, height][axis] as f32;
        let first = (low[axis] * size) as u32;
        let last = ((high[axis] * size).ceil() as u32).saturating_sub(1).max(first);
        format!("{first}-{last}")
    })
}

/// The caches that are certainly off, if the picture may be.
fn blamed(findings: &Findings) -> String {
    let parts = Kind::FINAL.into_iter().filter_map(|kind| Some((kind.name(), findings.of(kind)?)));
    let names: Vec<String> = parts
        .filter(|(_, found)| found.exceeds(0.0) && found.bias.abs() >= LITTLE)
        .map(|(name, found)| format!("{name} {}", percent(&found)))
        .collect();
    if names.is_empty() { String::new() } else { format!(" (by cache: {})", names.join(", ")) }
}

/// Noise of caches over the error they are made for, from which on there is a warning. Photons, surfaces and records that all have what they may come to 1.0.
const NOISY: f32 = 1.5;

/// What the channels are called.
const COLOURS: [&str; 3] = ["red", "green", "blue"];

/// Bias of a single cache, as a part of all light, that is worth a word.
const LITTLE: f64 = 0.005;

/// A string of JSON.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            c if c < ' ' => quoted.push_str(&format!("\\u{:04x}", c as u32)),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_are_escaped() {
        assert_eq!(quoted("a\"b\\\n"), "\"a\\\"b\\\\\\u000a\"");
    }

    #[test]
    fn times_read_well() {
        assert_eq!(clock(3.25), "3.2 s");
        assert_eq!(clock(125.0), "2:05 min");
        assert_eq!(clock(7260.0), "2:01 h");
    }
}
