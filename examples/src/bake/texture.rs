//! 3D textures: texels, and the layouts of engines.

use fogbow::bake::{ProbeBasis, ProbeState, Quantity};
use fogbow::math::float::PI;
use fogbow::spectrum::Spectrum;

use super::{Baked, Layout};

/// How a texel is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Texel {
    /// Four half floats.
    Rgba16F,
    /// Three numbers of 9 bits with a common exponent: no less than 0, and no validity beside.
    Rgb9E5,
    /// One float, the mean of the channels.
    R32F,
}

/// A 3D texture: x fastest, then y, then z.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// What it holds; the end of its file's name.
    pub name: String,
    /// Texels along x, y and z.
    pub size: [u32; 3],
    /// Red, green, blue, and what is beside them.
    pub texels: Vec<[f32; 4]>,
}

/// The textures of a bake.
///
/// # Errors
/// A layout that has no place for what was baked; what would have.
pub fn textures(baked: &Baked, layout: Layout) -> Result<Vec<Texture>, String> {
    match layout {
        Layout::Plain => Ok(plain(baked)),
        Layout::Bevy => bevy(baked).map(|texture| vec![texture]),
        Layout::Three => three(baked).map(|texture| vec![texture]),
    }
}

/// A texture for each number with validity in alpha; one for the medium: extinction (per metre, a mean over channels) in alpha, albedo in colour; and two for the
/// surfaces around probes, [`Probe::planes`](fogbow::bake::Probe::planes).
fn plain(baked: &Baked) -> Vec<Texture> {
    let grid = &baked.grid;
    let size = grid.lattice().size();
    let valid = |index: usize| if grid.probes()[index].state() == ProbeState::Valid { 1.0 } else { 0.0 };
    let of = |(number, name): (usize, String)| {
        let texel = |index: usize| rgba(grid.held(index)[number] * baked.scale, valid(index));
        Texture { name, size, texels: (0..grid.probes().len()).map(texel).collect() }
    };
    let mut all: Vec<Texture> = Baked::names(grid.basis()).into_iter().enumerate().map(of).collect();
    let medium = grid.probes().iter().map(|probe| rgba(probe.albedo, probe.extinction.mean())).collect();
    all.push(Texture { name: "medium".to_owned(), size, texels: medium });
    for (number, name) in WALLS.into_iter().enumerate() {
        let planes = grid.probes().iter().map(|probe| probe.planes()[number].extend(0.0).to_array()).collect();
        all.push(Texture { name: name.to_owned(), size, texels: planes });
    }
    all
}

/// Surfaces around probes: names of the textures, and of the arrays of plain numbers.
pub const WALLS: [&str; 2] = ["wall0", "wall1"];

fn rgba(colour: Spectrum, alpha: f32) -> [f32; 4] {
    [colour[0], colour[1], colour[2], alpha]
}

/// Bevy's irradiance volume, by its shader (`irradiance_volume.wesl`): `(Rx, 2Ry, 3Rz)` texels. Thirds in z are the axes x, y, z; the upper
/// half in y is where the normal's component is negative. Irradiance over π.
fn bevy(baked: &Baked) -> Result<Texture, String> {
    let grid = &baked.grid;
    if (grid.basis(), grid.quantity()) != (ProbeBasis::AmbientCube, Quantity::Irradiance) {
        return Err("an irradiance volume of Bevy takes an ambient cube of irradiance".to_owned());
    }
    let [nx, ny, nz] = grid.lattice().size();
    let size = [nx, 2 * ny, 3 * nz];
    let texel = |i: u32| {
        let [x, y, z] = [i % nx, i / nx % (2 * ny), i / (2 * nx * ny)];
        let face = 2 * (z / nz) + y / ny;
        let index = x + nx * (y % ny + ny * (z % nz));
        rgba(grid.held(index as usize)[face as usize] * (baked.scale / PI), 1.0)
    };
    let texels = (0..size.iter().product()).map(texel).collect();
    Ok(Texture { name: "bevy".to_owned(), size, texels })
}

/// Slices beside each of the volumes of [`three`], copies of its outermost.
const PADDING: u32 = 1;

/// The atlas of three.js' `LightProbeGrid` (of November 2026): the nine coefficients of *radiance*, each a colour, one after the other in seven RGBA
/// volumes that follow each other along z, each with a slice more at either end.
///
/// three.js' probes stand at the corners of its box: make it as large as the box around the outermost probes.
fn three(baked: &Baked) -> Result<Texture, String> {
    let grid = &baked.grid;
    if (grid.basis(), grid.quantity()) != (ProbeBasis::SphericalHarmonics { degree: 2 }, Quantity::Irradiance) {
        return Err("a LightProbeGrid of three.js takes irradiance in spherical harmonics of degree 2".to_owned());
    }
    // three.js makes irradiance of radiance itself.
    let cosine = [PI, 2.0 * PI / 3.0, 0.25 * PI];
    let degree = [0, 1, 1, 1, 2, 2, 2, 2, 2];
    let [nx, ny, nz] = grid.lattice().size();
    let slices = nz + 2 * PADDING;
    let size = [nx, ny, 7 * slices];
    let texel = |i: u32| {
        let [x, y, slice] = [i % nx, i / nx % ny, i / (nx * ny)];
        let (volume, z) = (slice / slices, (slice % slices).saturating_sub(PADDING).min(nz - 1));
        let held = grid.held((x + nx * (y + ny * z)) as usize);
        core::array::from_fn(|channel| {
            // Floats of nine colours in a row.
            let float = 4 * volume as usize + channel;
            held.get(float / 3).map_or(0.0, |colour| colour[float % 3] * baked.scale / cosine[degree[float / 3]])
        })
    };
    let texels = (0..size.iter().product()).map(texel).collect();
    Ok(Texture { name: "three".to_owned(), size, texels })
}

impl Texel {
    /// Bytes of a texel.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::Rgba16F => 8,
            Self::Rgb9E5 | Self::R32F => 4,
        }
    }

    /// The bytes of a texture.
    ///
    /// # Errors
    /// What it cannot hold: numbers below 0 in RGB9E5, numbers that are too large.
    pub fn encode(self, texture: &Texture) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::with_capacity(texture.texels.len() * self.bytes());
        let most = match self {
            Self::Rgba16F => half::f16::MAX.to_f32(),
            Self::Rgb9E5 => LARGEST,
            Self::R32F => f32::MAX,
        };
        for texel in &texture.texels {
            let beyond = texel.iter().find(|number| number.abs() > most);
            if let Some(number) = beyond {
                return Err(format!(
                    "{}: {number} is more than texels hold, {most}: give a smaller --scale",
                    texture.name
                ));
            }
            match self {
                Self::Rgba16F => {
                    bytes.extend(texel.iter().flat_map(|number| half::f16::from_f32(*number).to_le_bytes()));
                }
                Self::Rgb9E5 => {
                    if texel[..3].iter().any(|number| *number < 0.0) {
                        return Err(format!("{}: rgb9e5 holds nothing below 0: take rgba16f", texture.name));
                    }
                    bytes.extend(rgb9e5([texel[0], texel[1], texel[2]]).to_le_bytes());
                }
                Self::R32F => bytes.extend(Spectrum::new(texel[0], texel[1], texel[2]).mean().to_le_bytes()),
            }
        }
        Ok(bytes)
    }

    /// What is in the bytes of a texel: alpha 1 where none is stored, and one number in all channels.
    ///
    /// ```
    /// use fogbow_examples::bake::texture::{Texel, Texture};
    /// let texels = vec![[0.5, 0.25, 3.0, 1.0]];
    /// let texture = Texture { name: "sh0".to_owned(), size: [1, 1, 1], texels };
    /// for texel in [Texel::Rgba16F, Texel::Rgb9E5] {
    ///     assert_eq!(texel.decode(&texel.encode(&texture)?), texture.texels[0]);
    /// }
    /// # Ok::<(), String>(())
    /// ```
    ///
    /// # Panics
    /// If there are not as many bytes as [`Texel::bytes`] says.
    #[must_use]
    pub fn decode(self, bytes: &[u8]) -> [f32; 4] {
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        match self {
            Self::Rgba16F => {
                core::array::from_fn(|i| half::f16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]).to_f32())
            }
            Self::Rgb9E5 => {
                let word = word(0);
                let unit = 2.0_f32.powi((word >> 27) as i32 - EXPONENT_BIAS - MANTISSA_BITS);
                let channel = |i: u32| (word >> (9 * i) & 0x1ff) as f32 * unit;
                [channel(0), channel(1), channel(2), 1.0]
            }
            Self::R32F => {
                let value = f32::from_bits(word(0));
                [value, value, value, 1.0]
            }
        }
    }
}

const EXPONENT_BIAS: i32 = 15;
const MANTISSA_BITS: i32 = 9;

/// The largest number of RGB9E5: 511/512 · 2¹⁶.
const LARGEST: f32 = 65408.0;

/// Three numbers from 0 to [`LARGEST`] with a common exponent, as the Khronos Data Format Specification has it.
fn rgb9e5(colour: [f32; 3]) -> u32 {
    let largest = colour[0].max(colour[1]).max(colour[2]);
    // Of the largest, without rounding: of a normal number, the bits say it.
    let log2 = (largest.to_bits() >> 23) as i32 - 127;
    let mut exponent = log2.max(-EXPONENT_BIAS - 1) + 1 + EXPONENT_BIAS;
    let unit = |exponent: i32| 2.0_f32.powi(exponent - EXPONENT_BIAS - MANTISSA_BITS);
    if (largest / unit(exponent) + 0.5).floor() as u32 == 1 << MANTISSA_BITS {
        exponent += 1;
    }
    let mantissa = |number: f32| (number / unit(exponent) + 0.5).floor() as u32;
    mantissa(colour[0]) | mantissa(colour[1]) << 9 | mantissa(colour[2]) << 18 | (exponent as u32) << 27
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_exponents_leave_a_part_in_five_hundred() {
        for colour in
            [[0.0; 3], [1.0, 0.0, 0.5], [511.5, 3.0, 511.7], [LARGEST; 3], [1e-5, 3e-6, 0.0], [0.999, 0.998, 1.001]]
        {
            let word = rgb9e5(colour).to_le_bytes();
            let found = Texel::Rgb9E5.decode(&word);
            let largest = colour.into_iter().fold(0.0, f32::max);
            for (found, due) in found.iter().zip(colour) {
                // Half of a unit, of which the largest has 255.5 at least; and the smallest exponent.
                let most = (largest / 511.0).max(2.0_f32.powi(-25));
                assert!((found - due).abs() <= most, "{found} for {due} in {colour:?}");
            }
        }
    }

    #[test]
    fn texels_that_do_not_fit_are_told() {
        let of =
            |number: f32| Texture { name: "sh1".to_owned(), size: [1, 1, 1], texels: vec![[0.0, number, 0.0, 1.0]] };
        assert!(Texel::Rgb9E5.encode(&of(-0.1)).unwrap_err().starts_with("sh1: rgb9e5 holds nothing below 0"));
        for (texel, number) in [(Texel::Rgba16F, -7e4), (Texel::Rgb9E5, 7e4)] {
            assert!(texel.encode(&of(number)).unwrap_err().contains("--scale"));
        }
        assert_eq!(Texel::R32F.decode(&Texel::R32F.encode(&of(3e5)).unwrap())[0], 1e5);
    }
}
