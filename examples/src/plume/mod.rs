//! An animation: a plume of smoke that rises in a hazy room.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`Plume`]: the source, the frames |
//! | `fluid` | the solver |
//! | `room.xml` | the scene around a frame |

mod fluid;

use fogbow::math::Vec3;
use fogbow::medium::FractalNoise;

use crate::volume::{Values, Volume};
use fluid::{Fluid, Forces};

/// Frames per second.
const RATE: u32 = 12;
/// Steps of the solver per frame: fewer tear the smoke, more blur it.
const STEPS: u32 = 4;
/// Seconds before the first frame, in which the plume rises to half the height of the room.
const BEFORE: f32 = 1.5;

/// The source: a disc on the floor.
const SOURCE_RADIUS: f32 = 0.1;
/// Its height above the floor, and its thickness to either side.
const SOURCE_HEIGHT: f32 = 0.06;
const SOURCE_THICKNESS: f32 = 0.03;

/// Least density: the room is full of haze.
const HAZE: f32 = 0.02;

/// The source flickers, which makes the plume turbulent.
const FLICKER: FractalNoise = FractalNoise {
    frequency: 9.0,
    octaves: 2,
    lacunarity: 2.0,
    gain: 0.6,
    offset: 0.55,
    amplitude: 1.1,
    max_density: 1.0,
    seed: 7,
};

const FORCES: Forces = Forces { buoyancy: 3.2, confinement: 0.35, decay: 0.12 };

/// The scene around the first frame.
const ROOM: &str = include_str!("room.xml");
const FIRST: &str = "plume-00.vol";

/// A plume, a frame of an animation at a time: twelve a second.
///
/// The same bits come from the same number of cells, on every machine.
///
/// ```
/// # use fogbow_examples::plume::Plume;
/// let mut plume = Plume::new(8);
/// let (first, second) = (plume.next_frame(), plume.next_frame());
/// assert_eq!(first.size, [8, 8, 8]);
/// assert!(first != second && first.max() > 0.0);
/// ```
#[derive(Debug, Clone)]
pub struct Plume {
    fluid: Fluid,
    cells: u32,
    /// Steps done.
    steps: u32,
}

impl Plume {
    /// Before the first frame, in a cube of `cells`³ cells, 4 to 512 (others are taken for the nearest of these).
    #[must_use]
    pub fn new(cells: u32) -> Self {
        let cells = cells.clamp(4, 512);
        Self { fluid: Fluid::new(cells as usize), cells, steps: 0 }
    }

    /// Densities of the next frame, in [0, 1].
    #[must_use]
    pub fn next_frame(&mut self) -> Volume {
        let until = if self.steps == 0 { (BEFORE * (RATE * STEPS) as f32) as u32 } else { self.steps + STEPS };
        while self.steps < until {
            self.step();
        }
        let in_haze = |density: &f32| HAZE + (1.0 - HAZE) * density;
        Volume { size: [self.cells; 3], values: Values::F32(self.fluid.density.iter().map(in_haze).collect()) }
    }

    fn step(&mut self) {
        let step = 1.0 / (RATE * STEPS) as f32;
        let time = self.steps as f32 * step;
        let fade = |distance: f32, end: f32| (4.0 * (1.0 - distance / end)).clamp(0.0, 1.0);
        // A coarse grid still catches the source.
        let thickness = SOURCE_THICKNESS.max(1.5 / self.cells as f32);
        let radius = SOURCE_RADIUS.max(1.5 / self.cells as f32);
        for ([x, y, z], density) in self.fluid.sources() {
            let (across, along) = ((x - 0.5) * (x - 0.5) + (z - 0.5) * (z - 0.5), (y - SOURCE_HEIGHT).abs());
            let share = fade(across.sqrt(), radius) * fade(along, thickness);
            if share > 0.0 {
                let flicker = FLICKER.density(Vec3::new(x, y - 0.4 * time, z + 0.1 * time));
                *density = density.max(share * flicker);
            }
        }
        self.fluid.advance(step, &FORCES);
        self.steps += 1;
    }
}

/// The scene of the frame whose densities lie in the file `volume`, beside the scene.
#[must_use]
pub fn scene(volume: &str) -> String {
    ROOM.replace(FIRST, volume)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(cells: u32, count: usize) -> Vec<Vec<f32>> {
        let mut plume = Plume::new(cells);
        let values = |volume: Volume| match volume.values {
            Values::F32(values) => values,
            Values::U8(_) => Vec::new(),
        };
        (0..count).map(|_| values(plume.next_frame())).collect()
    }

    #[test]
    fn densities_lie_between_0_and_1() {
        for cells in [4, 7, 24] {
            for frame in frames(cells, 6) {
                assert_eq!(frame.len(), (cells * cells * cells) as usize);
                assert!(frame.iter().all(|d| (0.0..=1.0).contains(d)), "{cells} cells");
                assert!(frame.iter().any(|d| *d > 0.2), "{cells} cells");
            }
        }
    }

    #[test]
    fn frames_differ_a_little_and_smoothly() {
        let frames = frames(32, 12);
        let changes: Vec<f32> = frames
            .windows(2)
            .map(|pair| {
                let smoke: f32 = pair[0].iter().map(|density| density - HAZE).sum();
                pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()).sum::<f32>() / smoke
            })
            .collect();
        // As a share of all smoke: visible, but most of it stays where it was.
        assert!(changes.iter().all(|c| (0.02..0.6).contains(c)), "{changes:?}");
        for pair in changes.windows(2) {
            assert!((pair[1] / pair[0] - 1.0).abs() < 0.3, "{changes:?}");
        }
    }

    #[test]
    fn the_same_frames_come_twice() {
        assert!(frames(16, 3) == frames(16, 3));
    }

    #[test]
    fn every_frame_has_its_scene() {
        assert_eq!(ROOM.matches(FIRST).count(), 1);
        assert!(scene("plume-07.vol").contains("\"plume-07.vol\""));
    }
}
