//! OpenEXR: 32-bit floats, layers as groups of channels in one part.

use std::io::Cursor;

use ::exr::meta::MetaData;
use ::exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image as ExrImage, Layer as Part, LayerAttributes,
    ReadChannels, ReadLayers, WritableImage, read,
};
use fogbow::spectrum::Spectrum;

use crate::film::{Image, SizeError, pixel_count};
use crate::image::{ErrorKind, Layer};

/// The bytes of an OpenEXR file: the first layer as `R`, `G`, `B`, the others as `name.R`, `name.G`, `name.B`.
///
/// # Errors
/// No layers or different sizes; what the encoder says, as of two layers of one name.
pub fn encode(layers: &[Layer<'_>]) -> Result<Vec<u8>, ErrorKind> {
    let Some(size) = layers.first().map(|l| (l.image.width as usize, l.image.height as usize)) else {
        return Err(ErrorKind::Layers);
    };
    let channels = layers.iter().enumerate().flat_map(|(i, layer)| {
        ["R", "G", "B"].into_iter().enumerate().map(move |(c, letter)| {
            let name = if i == 0 { letter.to_owned() } else { format!("{}.{letter}", layer.name) };
            let samples = layer.image.pixels.iter().map(|pixel| pixel[c]).collect();
            AnyChannel::new(name.as_str(), FlatSamples::F32(samples))
        })
    });
    let channels = AnyChannels::sort(channels.collect());
    let part = Part::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    let mut bytes = Cursor::new(Vec::new());
    let image = ExrImage::from_layer(part);
    image.write().non_parallel().to_buffered(&mut bytes).map_err(format)?;
    Ok(bytes.into_inner())
}

/// Reads the bytes of an OpenEXR file: channels `R`, `G`, `B` of its first part, or `Y` alone.
///
/// # Errors
/// What is wrong with the bytes.
pub fn decode(bytes: &[u8]) -> Result<Image, ErrorKind> {
    plausible(bytes)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(format)?;
    let part = image.layer_data;
    let side = |n: usize| u32::try_from(n).map_err(|_| ErrorKind::Size(SizeError::TooLarge));
    let (width, height) = (side(part.size.width())?, side(part.size.height())?);
    let count = pixel_count(width, height)?;
    let channel = |name: &str| {
        let samples = &part.channel_data.list.iter().find(|channel| channel.name == *name)?.sample_data;
        (samples.len() == count).then(|| samples.values_as_f32())
    };
    let pixels = match (channel("R"), channel("G"), channel("B"), channel("Y")) {
        (Some(r), Some(g), Some(b), _) => r.zip(g).zip(b).map(|((r, g), b)| Spectrum::new(r, g, b)).collect(),
        (None, None, None, Some(y)) => y.map(Spectrum::splat).collect(),
        _ => return Err(ErrorKind::Format("the file has no full-size channels R, G and B, nor Y alone".to_owned())),
    };
    Ok(Image { width, height, pixels })
}

/// Refuses sizes that the bytes cannot hold, before anything of that size is allocated.
fn plausible(bytes: &[u8]) -> Result<(), ErrorKind> {
    /// A part (64 MiB) that may as well be tried.
    const SMALL: u64 = 1 << 26;
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(format)?;
    for header in &meta.headers {
        let side = |n: usize| u32::try_from(n).map_err(|_| ErrorKind::Size(SizeError::TooLarge));
        let count = pixel_count(side(header.layer_size.width())?, side(header.layer_size.height())?)?;
        let size = (count as u64).saturating_mul(header.channels.bytes_per_pixel as u64);
        // How many bytes one byte of the file may stand for.
        let densest = match header.compression {
            Compression::Uncompressed => 1,
            Compression::RLE => 64,
            // Deflate takes at least a bit for 129 bytes.
            Compression::ZIP1 | Compression::ZIP16 | Compression::PXR24 => 1100,
            // Constant pictures in blocks.
            _ => 1 << 16,
        };
        if size > SMALL.max((bytes.len() as u64).saturating_mul(densest)) {
            return Err(ErrorKind::Format(format!("the file is too short for {count} pixels")));
        }
    }
    Ok(())
}

fn format(error: ::exr::error::Error) -> ErrorKind {
    ErrorKind::Format(format!("OpenEXR: {error}"))
}
