//! 3D textures: texels, and the layouts of engines.

use fogbow::bake::{Probe, ProbeBasis, ProbeGrid, ProbeState, Quantity};
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
        Layout::Plain => plain(baked),
        Layout::Bevy => bevy(baked).map(|texture| vec![texture]),
        Layout::Three => three(baked).map(|texture| vec![texture]),
    }
}

/// A texture for each number with validity in alpha; one for the medium: extinction (per metre, a mean over channels) in alpha, albedo in colour; and two for the
/// surfaces around probes, [`Probe::planes`](fogbow::bake::Probe::planes). With finer levels, all of these are atlases, and one more says where bricks are: see [`Atlas`].
fn plain(baked: &Baked) -> Result<Vec<Texture>, String> {
    let atlas = Atlas::of(baked)?;
    let texture = |name: &str, of: &dyn Fn(&ProbeGrid<'_>, usize) -> [f32; 4]| Texture {
        name: name.to_owned(),
        size: atlas.size,
        texels: atlas.texels(baked, of),
    };
    let valid = |probe: &Probe| if probe.state() == ProbeState::Valid { 1.0 } else { 0.0 };
    let mut all: Vec<Texture> = Vec::new();
    for (number, name) in Baked::names(baked.grid().basis()).iter().enumerate() {
        all.push(texture(name, &|grid, index| {
            rgba(grid.held(index)[number] * baked.scale, valid(&grid.probes()[index]))
        }));
    }
    all.push(texture("medium", &|grid, index| {
        let probe = &grid.probes()[index];
        rgba(probe.albedo, probe.extinction.mean())
    }));
    for (number, name) in WALLS.into_iter().enumerate() {
        all.push(texture(name, &|grid, index| {
            let probe = &grid.probes()[index];
            let inner = if number == 0 && probe.is_inner() { 1.0 } else { 0.0 };
            probe.planes()[number].extend(inner).to_array()
        }));
    }
    if !baked.finer().is_empty() {
        all.push(atlas.index(baked));
    }
    Ok(all)
}

/// Where levels lie in textures: the probes of all cells at the origin, x, y and z as in the box; above them in z layers of bricks, 4 × 4 × 4 texels each, level after
/// level, x first.
#[derive(Debug, Clone, PartialEq)]
pub struct Atlas {
    /// Texels along x, y and z.
    pub size: [u32; 3],
    /// Where bricks begin in z.
    first: u32,
}

/// Texels along a side of a brick.
const BRICK: u32 = 4;

/// Most texels along a side: what graphics processors hold of three-dimensional textures, and half floats exactly.
const MOST_TEXELS: u32 = 2048;

impl Atlas {
    /// # Errors
    /// More bricks than a texture holds.
    pub fn of(baked: &Baked) -> Result<Self, String> {
        let [nx, ny, nz] = baked.grid().lattice().size();
        let bricks: usize = baked.finer().iter().map(|grid| grid.places().len()).sum();
        if bricks == 0 {
            return Ok(Self { size: [nx, ny, nz], first: nz });
        }
        // About a cube of them.
        let mut side = 1;
        while (side * side * side) < bricks {
            side += 1;
        }
        let side = side as u32 * BRICK;
        let (x, y) = (nx.next_multiple_of(BRICK).max(side), ny.next_multiple_of(BRICK).max(side));
        let in_layer = (x / BRICK * (y / BRICK)) as usize;
        let z = nz + bricks.div_ceil(in_layer) as u32 * BRICK;
        if x.max(y).max(z) > MOST_TEXELS {
            return Err(format!(
                "{bricks} bricks make a texture of {x} x {y} x {z} texels, and there may be {MOST_TEXELS} along a side: refine less"
            ));
        }
        Ok(Self { size: [x, y, z], first: nz })
    }

    /// Where brick number `brick` of all finer levels begins.
    fn corner(&self, brick: usize) -> [u32; 3] {
        let [across, up] = [self.size[0], self.size[1]].map(|n| (n / BRICK) as usize);
        let [x, y, z] = [brick % across, brick / across % up, brick / (across * up)].map(|n| n as u32 * BRICK);
        [x, y, z + self.first]
    }

    fn texels(&self, baked: &Baked, of: &dyn Fn(&ProbeGrid<'_>, usize) -> [f32; 4]) -> Vec<[f32; 4]> {
        let [x, y, z] = self.size.map(|n| n as usize);
        let mut texels = vec![[0.0; 4]; x * y * z];
        let mut put = |at: [u32; 3], texel| {
            let [i, j, k] = at.map(|n| n as usize);
            texels[i + x * (j + y * k)] = texel;
        };
        let [nx, ny, _] = baked.grid().lattice().size();
        for index in 0..baked.grid().probes().len() {
            let i = index as u32;
            put([i % nx, i / nx % ny, i / (nx * ny)], of(baked.grid(), index));
        }
        let mut first = 0;
        for grid in baked.finer() {
            for index in 0..grid.probes().len() {
                let corner = self.corner(first + index / 64);
                let local = (index % 64) as u32;
                let within = [local % BRICK, local / BRICK % BRICK, local / (BRICK * BRICK)];
                put(core::array::from_fn(|axis| corner[axis] + within[axis]), of(grid, index));
            }
            first += grid.places().len();
        }
        texels
    }

    /// For each brick of 4 × 4 × 4 probes of each finer level the texel at which it begins, with 1 in alpha where it is there; level after level along z.
    fn index(&self, baked: &Baked) -> Texture {
        let places = |grid: &ProbeGrid<'_>| grid.lattice().size().map(|n| n.div_ceil(BRICK));
        let [x, y] = [0, 1].map(|axis| baked.finer().iter().map(|grid| places(grid)[axis]).max().unwrap_or(1));
        let z = baked.finer().iter().map(|grid| places(grid)[2]).sum();
        let mut texels = vec![[0.0; 4]; (x * y * z) as usize];
        let (mut first, mut layer) = (0, 0);
        for grid in baked.finer() {
            let [px, py, pz] = places(grid);
            for (brick, place) in grid.places().iter().enumerate() {
                let [i, j, k] = [place % px, place / px % py, place / (px * py)];
                let [a, b, c] = self.corner(first + brick).map(|n| n as f32);
                texels[(i + x * (j + y * (k + layer))) as usize] = [a, b, c, 1.0];
            }
            first += grid.places().len();
            layer += pz;
        }
        Texture { name: INDEX.to_owned(), size: [x, y, z], texels }
    }
}

/// Where bricks of finer levels are: name of the texture.
pub const INDEX: &str = "index";

/// Surfaces around probes: names of the textures, and of the arrays of plain numbers.
pub const WALLS: [&str; 2] = ["wall0", "wall1"];

fn rgba(colour: Spectrum, alpha: f32) -> [f32; 4] {
    [colour[0], colour[1], colour[2], alpha]
}

/// Bevy's irradiance volume, by its shader (`irradiance_volume.wesl`): `(Rx, 2Ry, 3Rz)` texels. Thirds in z are the axes x, y, z; the upper
/// half in y is where the normal's component is negative. Irradiance over π.
fn bevy(baked: &Baked) -> Result<Texture, String> {
    baked.is_even("an irradiance volume of Bevy")?;
    let grid = baked.grid();
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
    baked.is_even("a LightProbeGrid of three.js")?;
    let grid = baked.grid();
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
