//! What the cells know: the light that they scatter.

use super::PhotonGrid;
use crate::cache::lookup::TurningBasis;
use crate::cache::resolved::{self, MAX_DEGREE};
use crate::host::Properties;
use crate::math::Vec3;
use crate::phase::Phase;
use crate::single_scatter::Contribution;
use crate::spectrum::{Gradient, Spectrum};

impl PhotonGrid<'_> {
    /// The coefficients of a cell where walks may end, and how many photons have brought them.
    fn trusted(&self, [x, y, z]: [u32; 3]) -> Option<(&[Spectrum], u32)> {
        // Beyond the first cell numbers wrap around.
        let [nx, ny, nz] = self.counts;
        if x >= nx || y >= ny || z >= nz {
            return None;
        }
        let (number, stride) = (self.number([x, y, z]) as usize, self.stride());
        let cell = self.cells.as_slice().get(number).filter(|cell| cell.is_whole)?;
        let paths = self.brought().saturating_sub(cell.missed);
        self.moments.as_slice().get(number * stride..(number + 1) * stride).filter(|_| paths > 0).zip(Some(paths))
    }

    /// Whether walks may end at a point.
    pub(in crate::cache) fn knows(&self, point: Vec3) -> bool {
        self.cell_of(point).and_then(|index| self.trusted(index)).is_some()
    }

    /// All light but that straight from the lights walks connect to, scattered towards `to_eye` at `point`, without the part `f` of it that counts as going
    /// straight on, with its gradients as the point moves and as `to_eye` turns; `None` where cells do not know: outside, where few photons came, and where a surface cuts them.
    ///
    /// Radiance is an expansion in the direction of travel, a mean over the cell with the slope to its neighbours:
    /// `Σ (p_l − f) L_lm Y_lm`, `L_lm = Σ power · length · Y_lm / (volume · paths)`, where `f = p_{L+1}` of a phase function with a forward peak, and 0 of one
    /// without: what degrees above that of the cells leave out of the peak (decision 92). It is exact but for `p_l − f` of these degrees.
    ///
    /// ```
    /// # use fogbow::{cache::{PhotonEffort, PhotonGrid}, host::{Empty, Medium}, math::{Bounds, Vec3}, medium::Homogeneous};
    /// # use fogbow::{path, phase::Phase, spectrum::Spectrum, world::World};
    /// // Without lights nothing is known.
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// let effort = PhotonEffort { bounds, cells: 2, degree: 0, paths: 10, flights: 100, enough: 1 };
    /// let cells = PhotonGrid::lit(&world, &effort, &path::Settings::default(), 1);
    /// assert!(cells.scattered(Vec3::ZERO, Vec3::Z, &fog.properties(Vec3::ZERO)).is_none());
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn scattered(&self, point: Vec3, to_eye: Vec3, properties: &Properties) -> Option<(Contribution, Gradient)> {
        let index = self.cell_of(point)?;
        let cell = self.trusted(index)?;
        let basis = TurningBasis::new(to_eye, self.degree);
        let volume = self.side.element_product();
        let straight = Spectrum::splat(self.straight(&properties.phase));
        let moments: [Spectrum; MAX_DEGREE + 1] = core::array::from_fn(|l| properties.phase.moment(l) - straight);
        let of_degree = |l: usize| l * l..(l + 1) * (l + 1);
        let scale = |paths: u32| 1.0 / (paths as f32 * volume);
        let light = |(cell, paths): (&[Spectrum], u32)| -> Spectrum {
            let of = |l: usize| of_degree(l).map(|k| cell[k] * basis.value(k)).sum::<Spectrum>() * moments[l];
            (0..=self.degree).map(of).sum::<Spectrum>() * scale(paths)
        };
        let here = light(cell);
        let (cell, own) = (cell.0, scale(cell.1));
        let mut gradient = Gradient::ZERO;
        let mut radiance = here;
        let middle = self.first + (Vec3::from(index.map(|i| i as f32)) + Vec3::splat(0.5)) * self.side;
        for axis in 0..3 {
            let beside = |step: u32| {
                let mut index = index;
                index[axis] = index[axis].wrapping_add(step);
                self.trusted(index).map(light)
            };
            let slope = match (beside(u32::MAX), beside(1)) {
                (Some(before), Some(after)) => (after - before) * (0.5 / self.side[axis]),
                (Some(before), None) => (here - before) / self.side[axis],
                (None, Some(after)) => (after - here) / self.side[axis],
                (None, None) => Spectrum::ZERO,
            };
            gradient += Gradient::outer(slope, Vec3::AXES[axis]);
            radiance += slope * (point[axis] - middle[axis]);
        }
        let turned = (1..=self.degree).fold(Gradient::ZERO, |sum, l| {
            of_degree(l).fold(sum, |sum, k| sum + Gradient::outer(cell[k] * (moments[l] * own), basis.slope(k)))
        });
        Some((Contribution { radiance, gradient }, turned))
    }

    /// Part of what is scattered that counts as going straight on: see [`resolved::straight`].
    pub(in crate::cache) fn straight(&self, phase: &Phase) -> f32 {
        resolved::straight(phase, self.degree)
    }

    /// How much a scattering leaves of what cells do not resolve, in [0, 1].
    pub(in crate::cache) fn unresolved(&self, phase: &Phase) -> f32 {
        resolved::unresolved(phase, self.degree)
    }
}
