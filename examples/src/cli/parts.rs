//! Parts of a picture, for several machines: `--part K/N`.

use std::path::PathBuf;

use clap::Args;
use fogbow_std::tiles;

use super::film_file::{Parts, Split, is_film};
use super::{Failure, Method, RenderArguments};

/// Of renders that several machines share out.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Many machines")]
pub struct PartArguments {
    /// Renders part K of N of the picture, into a .fogbow file for `fogbow merge`; without it, such a file has the whole picture.
    #[arg(long, value_name = "K/N", value_parser = part)]
    pub part: Option<(u32, u32)>,
    /// What parts are of: of the tiles, which reads and writes less, or of the samples of all pixels [default: tiles; samples for photon beams and virtual
    /// lights, whose passes serve the whole picture].
    #[arg(long, value_enum)]
    pub split: Option<Split>,
    /// Takes the caches or the covariance grid that `fogbow fill` has left in this file.
    #[arg(long, value_name = "FILE.fogbow")]
    pub fill: Option<PathBuf>,
}

/// `K/N`.
pub(super) fn part(text: &str) -> Result<(u32, u32), String> {
    let parsed = text.split_once('/').and_then(|(part, of)| Some((part.parse().ok()?, of.parse().ok()?)));
    match parsed {
        Some((part, of)) if part >= 1 && part <= of => Ok((part, of)),
        Some(_) => Err("parts are counted from 1 to N".to_owned()),
        None => Err("must look like 3/16".to_owned()),
    }
}

impl PartArguments {
    /// Which part of a picture by this method, with so many samples; `None` for all.
    pub(super) fn parts(&self, method: Method, samples: u32, size: [u32; 2]) -> Option<Parts> {
        self.part.map(|(part, of)| Parts { split: self.split_for(method, of, samples, size), of, has: vec![part] })
    }

    /// By what so many parts are split.
    pub(super) fn split_for(&self, method: Method, of: u32, samples: u32, size: [u32; 2]) -> Split {
        let has_passes = matches!(method, Method::PhotonBeams | Method::Vpl);
        let (fewer_tiles, fewer_samples) = (u64::from(of) > tile_count(size), of > samples);
        let usual = match has_passes {
            true if fewer_samples => Split::Tiles,
            false if !fewer_tiles || fewer_samples => Split::Tiles,
            _ => Split::Samples,
        };
        self.split.unwrap_or(usual)
    }
}

fn tile_count(size: [u32; 2]) -> u64 {
    let side = tiles::Settings::default().tile;
    size.map(|length| u64::from(length.div_ceil(side))).iter().product()
}

impl RenderArguments {
    /// # Errors
    /// Parts that would not add up to the whole, or would have nowhere to go.
    pub(super) fn check_part(&self) -> Result<(), Failure> {
        if self.parts.part.is_none() {
            let is_idle = self.parts.split.is_some();
            return if is_idle { Err("--split has no effect without --part".into()) } else { Ok(()) };
        }
        if self.is_fill {
            return Err("--part: a fill is made once, and all parts read it; leave --part out".into());
        }
        if self.output.is_empty() || !self.output.iter().all(|file| is_film(file)) {
            return Err("--part: a part is no picture; -o PART.fogbow takes it, for fogbow merge".into());
        }
        if self.time.is_some() {
            return Err("--part: with --time, machines would take as many samples as they can; use --spp".into());
        }
        if self.noise.is_some() {
            return Err(
                "--part: with --noise, tiles are judged by the noise of the whole picture, which no part has; use --spp"
                    .into(),
            );
        }
        Ok(())
    }

    /// The same, where the method is known.
    ///
    /// # Errors
    /// Nothing for some of the parts to do, or no number of samples.
    pub(super) fn check_part_of(&self, method: Method, samples: u32, size: [u32; 2]) -> Result<(), Failure> {
        match self.parts.part {
            None => Ok(()),
            Some((_, of)) => {
                self.check_parts(method, (of, self.parts.split_for(method, of, samples, size)), samples, size)
            }
        }
    }

    /// The same for all of so many parts.
    ///
    /// # Errors
    /// As [`Self::check_part_of`].
    pub(super) fn check_parts(
        &self,
        method: Method,
        (of, split): (u32, Split),
        samples: u32,
        size: [u32; 2],
    ) -> Result<(), Failure> {
        if method == Method::RadianceCache && self.spp.is_none() {
            return Err(
                "--part: without --spp, radiance caching samples until little noise of the whole picture is left, which no part has; use --spp"
                    .into(),
            );
        }
        let (most, what, other) = match split {
            Split::Samples => (u64::from(samples), "samples per pixel", "tiles"),
            // Bricks are of bakes.
            Split::Tiles | Split::Bricks => (tile_count(size), "tiles", "samples"),
        };
        if u64::from(of) > most {
            return Err(format!("--part: {of} parts of {most} {what}; take fewer, or --split {other}").into());
        }
        Ok(())
    }
}
