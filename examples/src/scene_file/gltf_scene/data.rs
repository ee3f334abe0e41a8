//! Buffers, accessors and pictures of glTF files. Every number of a file is checked before it is used.

use std::path::PathBuf;

use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::Source as BufferSource;
use ::gltf::image::Source as ImageSource;
use ::gltf::{Accessor, Document};
use base64::Engine as _;

use super::{Source, label};
use crate::error::{SceneError, read_file};
use crate::picture::Picture;

/// What of a picture is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Channel {
    Colour,
    /// Colours as they are.
    Numbers,
    /// How opaque it is.
    Opacity,
}

/// All bytes of a document.
pub(super) struct Data {
    buffers: Vec<Vec<u8>>,
    /// Of files that buffers and pictures came from.
    files: Vec<PathBuf>,
}

/// The bytes of an address.
struct Resolved {
    bytes: Vec<u8>,
    /// The kind of data, if the address says so.
    kind: Option<String>,
    /// The file they came from.
    file: Option<PathBuf>,
}

/// Reads `data:…` or a file beside the scene.
fn resolve(source: &Source<'_>, element: &str, uri: &str) -> Result<Resolved, SceneError> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let parts = rest.split_once(";base64,");
        let (kind, text) = parts.ok_or_else(|| source.error(element, "holds data that are not base64"))?;
        let bytes = base64::engine::general_purpose::STANDARD
            .decode(text)
            .map_err(|e| source.error(element, format!("holds data that are not base64: {e}")))?;
        return Ok(Resolved { bytes, kind: Some(kind.to_owned()), file: None });
    }
    if uri.contains("://") {
        return Err(source.error(element, format!("\"{uri}\" does not lie beside the scene")));
    }
    let path = source.file.parent().unwrap_or("".as_ref()).join(unescaped(uri));
    let bytes = read_file(&path).map_err(|e| source.error(element, e.to_string()))?;
    Ok(Resolved { bytes, kind: None, file: Some(path) })
}

/// `%20` is a space.
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let code = tail.get(..2).and_then(|two| core::str::from_utf8(two).ok());
        match code.and_then(|two| u8::from_str_radix(two, 16).ok()) {
            Some(byte) if *first == b'%' => {
                bytes.push(byte);
                rest = tail.get(2..).unwrap_or_default();
            }
            _ => {
                bytes.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

impl Data {
    pub(super) fn read(source: &Source<'_>, document: &Document, blob: Option<Vec<u8>>) -> Result<Self, SceneError> {
        let mut blob = blob;
        let mut data = Self { buffers: Vec::new(), files: Vec::new() };
        for buffer in document.buffers() {
            let element = label("buffer", buffer.index(), None);
            let mut bytes = match buffer.source() {
                BufferSource::Bin => blob.take().ok_or_else(|| source.error(&element, "is not in the file"))?,
                BufferSource::Uri(uri) => {
                    let found = resolve(source, &element, uri)?;
                    data.files.extend(found.file);
                    found.bytes
                }
            };
            if bytes.len() < buffer.length() {
                let reason = format!("holds {} bytes where {} are due", bytes.len(), buffer.length());
                return Err(source.error(&element, reason));
            }
            bytes.truncate(buffer.length());
            data.buffers.push(bytes);
        }
        for image in document.images() {
            if let ImageSource::Uri { uri, .. } = image.source()
                && !uri.starts_with("data:")
            {
                data.files.push(source.file.parent().unwrap_or("".as_ref()).join(unescaped(uri)));
            }
        }
        Ok(data)
    }

    /// Hands out the bytes of all files beside the scene; those that cannot be read are left out.
    pub(super) fn each_file(&self, each: &mut impl FnMut(&[u8])) {
        self.files.iter().filter_map(|file| read_file(file).ok()).for_each(|bytes| each(&bytes));
    }

    fn view(&self, view: &::gltf::buffer::View<'_>) -> Option<&[u8]> {
        let bytes = self.buffers.get(view.buffer().index())?;
        bytes.get(view.offset()..)?.get(..view.length())
    }

    /// The picture of a texture.
    pub(super) fn picture(
        &self,
        source: &Source<'_>,
        image: &::gltf::Image<'_>,
        channel: Channel,
    ) -> Result<Picture, SceneError> {
        let element = label("image", image.index(), image.name());
        let (bytes, kind) = match image.source() {
            ImageSource::View { view, mime_type } => {
                let bytes = self.view(&view).ok_or_else(|| source.error(&element, "lies beyond its buffer"))?;
                (bytes.to_vec(), Some(mime_type.to_owned()))
            }
            ImageSource::Uri { uri, mime_type } => {
                let found = resolve(source, &element, uri)?;
                (found.bytes, mime_type.map(str::to_owned).or(found.kind))
            }
        };
        let extension = match bytes.get(..4) {
            Some([0x89, b'P', b'N', b'G']) => "png",
            Some([0xff, 0xd8, ..]) => "jpg",
            _ => return Err(source.error(&element, format!("is neither PNG nor JPEG ({})", kind.unwrap_or_default()))),
        };
        let picture = match channel {
            Channel::Colour => Picture::from_bytes(source.file, extension, &bytes),
            Channel::Numbers => Picture::from_raw_bytes(source.file, extension, &bytes),
            Channel::Opacity if extension == "png" => Picture::opacity_from_png(source.file, &bytes),
            Channel::Opacity => Ok(Picture { width: 1, height: 1, pixels: vec![[1.0; 3]] }),
        };
        picture.map_err(|e| source.error(&element, e.reason))
    }

    /// The elements of an accessor, as `N` numbers each; whole numbers as shares of the largest where they are normalised.
    pub(super) fn numbers<const N: usize>(&self, accessor: &Accessor<'_>) -> Result<Vec<[f32; N]>, String> {
        let wanted = [Dimensions::Scalar, Dimensions::Vec2, Dimensions::Vec3, Dimensions::Vec4];
        if accessor.dimensions().multiplicity() != N || !wanted.contains(&accessor.dimensions()) {
            return Err(format!("holds {:?} where {N} numbers are due", accessor.dimensions()));
        }
        let (kind, is_share) = (accessor.data_type(), accessor.normalized());
        if kind == DataType::U32 {
            return Err("holds indices where numbers are due".to_owned());
        }
        let mut all = Vec::new();
        self.each(accessor, |bytes| {
            let mut element = [0.0; N];
            for (number, bytes) in element.iter_mut().zip(bytes.chunks_exact(kind.size())) {
                *number = number_of(kind, bytes, is_share);
            }
            all.push(element);
        })?;
        Ok(all)
    }

    /// The elements of an accessor, as whole numbers.
    pub(super) fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, String> {
        let kind = accessor.data_type();
        let is_whole = matches!(kind, DataType::U8 | DataType::U16 | DataType::U32);
        if accessor.dimensions() != Dimensions::Scalar || !is_whole {
            return Err(format!("holds {:?} of {kind:?} where indices are due", accessor.dimensions()));
        }
        let mut all = Vec::new();
        self.each(accessor, |bytes| {
            all.push(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte)));
        })?;
        Ok(all)
    }

    /// Hands out the bytes of each element.
    fn each(&self, accessor: &Accessor<'_>, mut each: impl FnMut(&[u8])) -> Result<(), String> {
        if accessor.sparse().is_some() {
            return Err("is sparse, which is not supported".to_owned());
        }
        let view = accessor.view().ok_or("holds no data")?;
        let bytes = self.view(&view).ok_or("lies beyond its buffer")?;
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size);
        if accessor.count() == 0 {
            return Ok(());
        }
        let end = (accessor.count() - 1)
            .checked_mul(stride)
            .and_then(|last| last.checked_add(accessor.offset())?.checked_add(size))
            .filter(|end| *end <= bytes.len() && stride >= size);
        if end.is_none() {
            return Err(format!(
                "{} elements lie beyond the end of its view of {} bytes",
                accessor.count(),
                bytes.len()
            ));
        }
        for index in 0..accessor.count() {
            each(bytes.get(accessor.offset() + index * stride..).and_then(|rest| rest.get(..size)).unwrap_or_default());
        }
        Ok(())
    }
}

fn number_of(kind: DataType, bytes: &[u8], is_share: bool) -> f32 {
    let word = bytes.iter().rev().fold(0_u32, |sum, byte| sum << 8 | u32::from(*byte));
    let share = |value: f32, most: f32| if is_share { (value / most).max(-1.0) } else { value };
    match kind {
        DataType::I8 => share(f32::from(word as u8 as i8), 127.0),
        DataType::U8 => share(f32::from(word as u8), 255.0),
        DataType::I16 => share(f32::from(word as u16 as i16), 32_767.0),
        DataType::U16 => share(f32::from(word as u16), 65_535.0),
        DataType::U32 | DataType::F32 => f32::from_bits(word),
    }
}
