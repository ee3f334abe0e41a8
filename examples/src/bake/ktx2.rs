//! KTX2 files of 3D textures.

use ktx2::dfd::{Basic, Block};
use ktx2::{Format, Header, Index, LevelIndex, Reader};

use super::texture::{Texel, Texture};

impl Texel {
    fn format(self) -> Format {
        match self {
            Self::Rgba16F => Format::R16G16B16A16_SFLOAT,
            Self::Rgb9E5 => Format::E5B9G9R9_UFLOAT_PACK32,
            Self::R32F => Format::R32_SFLOAT,
        }
    }
}

/// The bytes of a file with one level, and `about` as pairs of keys and values beside the orientation: x to the right, y up, z out of the picture,
/// as in the world.
///
/// # Errors
/// Numbers that texels do not hold.
pub fn encode(texture: &Texture, texel: Texel, about: &[(&str, &str)]) -> Result<Vec<u8>, String> {
    let data = texel.encode(texture)?;
    let (basic, type_size) = Basic::from_format(texel.format()).map_err(|error| error.to_string())?;
    let block = Block::Basic(basic).to_vec();
    let mut pairs: Vec<(&str, &str)> = [("KTXorientation", "ruo"), ("KTXwriter", "fogbow")].into();
    pairs.extend(about);
    // As the format wants them.
    pairs.sort_unstable();
    let mut values = Vec::new();
    for (key, value) in pairs {
        let length = key.len() + value.len() + 2;
        values.extend((length as u32).to_le_bytes());
        values.extend([key.as_bytes(), &[0], value.as_bytes(), &[0]].concat());
        values.resize(values.len().next_multiple_of(4), 0);
    }
    let dfd_at = Header::LENGTH + LevelIndex::LENGTH;
    let kvd_at = dfd_at + 4 + block.len();
    // Levels begin at multiples of texels and of 4.
    let data_at = (kvd_at + values.len()).next_multiple_of(texel.bytes());
    let [pixel_width, pixel_height, pixel_depth] = texture.size;
    let header = Header {
        format: Some(texel.format()),
        type_size,
        pixel_width,
        pixel_height,
        pixel_depth,
        layer_count: 0,
        face_count: 1,
        level_count: 1,
        supercompression_scheme: None,
        index: Index {
            dfd_byte_offset: dfd_at as u32,
            dfd_byte_length: 4 + block.len() as u32,
            kvd_byte_offset: kvd_at as u32,
            kvd_byte_length: values.len() as u32,
            sgd_byte_offset: 0,
            sgd_byte_length: 0,
        },
    };
    let length = data.len() as u64;
    let level = LevelIndex { byte_offset: data_at as u64, byte_length: length, uncompressed_byte_length: length };
    let mut file = Vec::with_capacity(data_at + data.len());
    file.extend(header.as_bytes());
    file.extend(level.as_bytes());
    file.extend((4 + block.len() as u32).to_le_bytes());
    file.extend(block);
    file.extend(values);
    file.resize(data_at, 0);
    file.extend(data);
    Ok(file)
}

/// Reads what [`encode`] wrote: the texture, without a name.
///
/// # Errors
/// What is no 3D texture of one of these texels.
pub fn decode(bytes: &[u8]) -> Result<(Texture, Texel), String> {
    let reader = Reader::new(bytes).map_err(|error| format!("is no KTX2 file: {error}"))?;
    let header = reader.header();
    let texels = [Texel::Rgba16F, Texel::Rgb9E5, Texel::R32F];
    let texel = texels.into_iter().find(|texel| Some(texel.format()) == header.format);
    let texel = texel.ok_or("has texels that are none of rgba16f, rgb9e5, r32f")?;
    let size = [header.pixel_width, header.pixel_height, header.pixel_depth];
    let level = reader.levels().next().ok_or("has no level")?;
    let count = size.iter().try_fold(texel.bytes(), |product, n| product.checked_mul(*n as usize));
    if count != Some(level.data.len()) || header.supercompression_scheme.is_some() {
        return Err("has another number of texels than its size says".to_owned());
    }
    let texels = level.data.chunks_exact(texel.bytes()).map(|bytes| texel.decode(bytes)).collect();
    Ok((Texture { name: String::new(), size, texels }, texel))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_back_bit_for_bit_by_who_did_not_write_them() {
        let texels = (0..24).map(|i| [i as f32, 0.5, 0.25 * i as f32, 1.0]).collect();
        let texture = Texture { name: String::new(), size: [4, 3, 2], texels };
        for texel in [Texel::Rgba16F, Texel::Rgb9E5, Texel::R32F] {
            let file = encode(&texture, texel, &[("fogbow.box", "0,0,0 1,1,1"), ("A", "b")]).unwrap();
            let reader = Reader::new(&file[..]).unwrap();
            assert_eq!((reader.header().format, reader.header().pixel_depth), (Some(texel.format()), 2));
            assert_eq!(reader.levels().next().unwrap().data, texel.encode(&texture).unwrap());
            assert_eq!(reader.basic_dfd().unwrap(), &Basic::from_format(texel.format()).unwrap().0);
            let keys: Vec<_> = reader.key_value_data().map(|(key, value)| (key, value.to_vec())).collect();
            let due = [("A", "b"), ("KTXorientation", "ruo"), ("KTXwriter", "fogbow"), ("fogbow.box", "0,0,0 1,1,1")];
            assert_eq!(keys, due.map(|(key, value)| (key, [value.as_bytes(), &[0]].concat())));
            let (copy, found) = decode(&file).unwrap();
            assert_eq!(found, texel);
            if texel == Texel::Rgba16F {
                assert_eq!(copy, texture, "these numbers are halves");
            }
            for length in [0, 60, file.len() - 1] {
                assert!(decode(&file[..length]).is_err(), "{length}");
            }
        }
    }
}
