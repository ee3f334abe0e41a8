//! Directions towards lamps without extent.
//!
//! A ray that passes such a lamp at the distance `D` collects light in proportion to `1/D`, however the point on it is
//! drawn: a walk that happens to go straight for one has no bound. So a part of the directions is drawn like `1/D`, too.

use glam::Vec3;

use crate::light::{FromPoint, Guess, Kind, Light, LightNode, Lights, Question, Strong};
use crate::math::{Frame, float};
use crate::phase::{Phase, PhaseSample, deflection};
use crate::sampling::discrete::choose;
use crate::sampling::warp::{steep_cone, steep_cone_pdf};
use crate::sampling::{Generator, uniform, uniform2};

/// Part of the directions of a walk that goes to lamps, where nothing dims them. Larger: walks learn less of everything else; smaller: the
/// bound of a sample, which goes like one over it, is higher. With every vertex the variance of a walk grows by about this part:
/// so from where fog hides the lamps next to none goes there.
const SHARE: f32 = 0.25;

/// Part of what a lamp has of directions that it has where it shines elsewhere: rays that pass it closely see it from before, all others do not. Larger:
/// samples for what is rarely lit; smaller: the bound of what is.
pub(crate) const DARK: f32 = 0.25;

/// Half angle of the cone around a lamp (rad). Farther from it nothing is steep.
const WIDEST: f32 = 0.5;

/// Nodes of the cut through many lights, of which single lamps are aimed at. More: weaker lamps are, too, and what passes them has a bound;
/// fewer: a vertex takes less time.
const CUT: usize = 8;

/// `I/r`, what rays about a lamp collect together.
struct Glare {
    point: Vec3,
}

impl Glare {
    /// Lamps that shine past the point count, too: what passes them closely sees them from before.
    fn sent(&self) -> FromPoint {
        FromPoint { dark: true, ..FromPoint::all(self.point) }
    }
}

impl Question for Glare {
    fn asks(&self, kind: Kind) -> bool {
        kind == Kind::Lamp
    }

    fn light(&self, light: &Light<'_>) -> f32 {
        let Some(field) = light.near_field().filter(|field| field.radius().is_none()) else { return 0.0 };
        (self.sent().light(light) * field.centre().distance(self.point)).min(1e30)
    }

    fn node(&self, node: &LightNode) -> Guess {
        self.sent().node(node) * node.away(self.point)
    }

    fn limit(&self) -> usize {
        CUT
    }
}

/// A lamp as a vertex sees it.
struct Aim {
    /// Unit direction to it.
    axis: Vec3,
    /// In proportion to `I/r`, what rays about it collect together without fog; of lamps that shine elsewhere [`DARK`] of it.
    weight: f32,
    /// `e^{−σₜ r}`, as if the medium were the same all the way.
    clear: f32,
    /// Whether it shines there.
    is_lit: bool,
}

fn aims<'a>(
    point: Vec3,
    strong: &'a Strong,
    lights: &'a Lights<'_>,
    extinction: f32,
) -> impl Iterator<Item = Aim> + 'a {
    strong.lights(lights).filter_map(move |light| {
        let field = light.steep_field().filter(|field| field.radius().is_none())?;
        let offset = field.centre() - point;
        let distance = offset.length();
        let is_lit = light.importance(point) > 0.0;
        let weight = Glare { point }.light(light) * if is_lit { 1.0 } else { DARK };
        let clear = float::exp(-extinction * distance);
        // Written so that NaN fails, too.
        let is_valid = weight > 0.0 && weight < f32::INFINITY && distance > 0.0 && clear > 0.0;
        is_valid.then(|| Aim { axis: offset / distance, weight, clear, is_lit })
    })
}

/// The next direction of a walk at `point`, where the extinction (m⁻¹) is about `extinction`: by the phase function, and a part of them
/// towards lamps.
pub(super) fn turn(
    (point, to_eye): (Vec3, Vec3),
    phase: &Phase,
    extinction: f32,
    lights: &Lights<'_>,
    rng: &mut Generator,
) -> PhaseSample {
    let mut turn = phase.sample(to_eye, uniform2(rng));
    let strong = lights.strong(&Glare { point });
    let aims = || aims(point, &strong, lights, extinction);
    let (mut all, mut seen, mut most) = (strong.others, 0.0, DARK);
    for aim in aims() {
        all += aim.weight;
        seen += aim.weight * aim.clear;
        if aim.is_lit {
            most = 1.0;
        }
    }
    if !(seen > 0.0 && all < f32::INFINITY) {
        return turn;
    }
    let share = SHARE * most * (seen / all);
    let (aimed, choice, on_cone) = (uniform(rng), uniform(rng), uniform2(rng));
    let to_lamps = aims().map(|aim| (aim.weight * aim.clear, aim.axis));
    if aimed < share
        && let Some((axis, _)) = choose(to_lamps, choice)
    {
        turn.to_light = Frame::around(axis).to_world(steep_cone(on_cone, WIDEST)).normalize();
    }
    let steep = |aim: Aim| {
        let (across, along) = (aim.axis.cross(turn.to_light).length(), aim.axis.dot(turn.to_light));
        aim.weight * aim.clear * steep_cone_pdf(across, along, WIDEST)
    };
    let pdf = aims().map(steep).sum::<f32>() / seen;
    let deflected = deflection(turn.to_light, to_eye);
    turn.pdf = (1.0 - share) * phase.pdf(deflected) + share * pdf;
    turn.weight = phase.value(deflected) / turn.pdf;
    turn
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{Light, PointLight, SpotLight, Sun};
    use crate::phase::Lobe;
    use crate::spectrum::Spectrum;

    fn lamp(at: Vec3) -> Light<'static> {
        Light::Point(PointLight::new(at, Spectrum::ONE).unwrap())
    }

    /// What a ray collects from a lamp that it passes goes like `1/sin θ`: times the weight it has a bound, whatever the directions, and
    /// means are what they are without lamps.
    #[test]
    fn light_collected_past_a_lamp_has_a_bound_and_no_bias() {
        // What shines the other way is lit where rays pass it closely, too, but gets fewer directions.
        let away = SpotLight::new(Vec3::Z, Vec3::Z, 0.2, 0.5, Spectrum::ONE).unwrap();
        assert_eq!(Light::Spot(away).importance(Vec3::ZERO), 0.0);
        let behind = Light::Spot(away);
        let lobes = [Lobe::Isotropic, Lobe::HenyeyGreenstein { g: 0.8 }, Lobe::HenyeyGreenstein { g: -0.6 }];
        let lit = lobes.map(|lobe| (lobe, lamp(Vec3::Z), 40.0));
        let dark = lobes.map(|lobe| (lobe, behind, 40.0 / DARK));
        for (lobe, first, bound) in lit.into_iter().chain(dark) {
            let phase = Phase::from(lobe);
            let lights = [first, lamp(Vec3::new(0.5, -1.0, 0.2))];
            let (rng, to_eye, count) = (&mut Generator::new(5), Vec3::new(0.6, 0.0, -0.8), 200_000);
            let (mut most, mut sum, mut squares) = (0.0_f32, [0.0_f64; 2], [0.0_f64; 2]);
            for _ in 0..count {
                let turn = turn((Vec3::ZERO, to_eye), &phase, 0.2, &(&lights).into(), rng);
                assert!((turn.to_light.length() - 1.0).abs() < 1e-5 && turn.pdf > 0.0);
                let collected = |light: &Light<'_>| {
                    let axis = light.steep_field().unwrap().centre().normalize();
                    let across = axis.cross(turn.to_light).length().max(f32::MIN_POSITIVE);
                    // Rays that go the other way do not pass it.
                    if axis.dot(turn.to_light) > 0.0 { 1.0 / across } else { 1.0 }
                };
                most = most.max(turn.weight[0] * lights.iter().map(collected).sum::<f32>());
                for (i, f) in [1.0, turn.to_light.dot(to_eye)].into_iter().enumerate() {
                    let value = f64::from(turn.weight[0] * f);
                    sum[i] += value;
                    squares[i] += value * value;
                }
            }
            assert!(most < bound, "{lobe:?}: {most}");
            let expected = [1.0, -f64::from(phase.mean_cosine()[0])];
            for i in 0..2 {
                let n = f64::from(count);
                let (mean, error) = (sum[i] / n, libm::sqrt((squares[i] / n - (sum[i] / n) * (sum[i] / n)) / n));
                assert!((mean - expected[i]).abs() < 4.0 * error + 1e-6, "{lobe:?}: {mean} {} {error}", expected[i]);
            }
        }
    }

    #[test]
    fn lamps_that_fog_hides_and_the_sun_change_next_to_nothing() {
        let sample = |lights: &[Light<'_>], extinction| {
            turn((Vec3::ZERO, Vec3::X), &Phase::ISOTROPIC, extinction, &lights.into(), &mut Generator::new(2))
        };
        let plain = Phase::ISOTROPIC.sample(Vec3::X, uniform2(&mut Generator::new(2)));
        assert_eq!(sample(&[Light::Sun(Sun::new(Vec3::Z, Spectrum::ONE).unwrap())], 1.0), plain);
        let hidden = sample(&[lamp(Vec3::Z)], 20.0);
        assert_eq!(hidden.to_light, plain.to_light);
        assert!((hidden.weight[0] - 1.0).abs() < 1e-6);
    }
}
