//! Where random walks start towards: the surroundings of lights, from which most scattered light comes.

use glam::{Vec2, Vec3};

use crate::host::Scene;
use crate::light::{FromPoint, Light, Lights, Question};
use crate::math::{Frame, Ray, float};
use crate::multiple_scatter::DARK;
use crate::sampling::discrete::choose;
use crate::sampling::warp;

/// Lights aimed at, the strongest there are at a point: more spread the samples too thin to matter.
const MOST: usize = 16;

/// Radius of the ball aimed at, over that of a light's near field; fog around a light is brightest there.
const BALL: f32 = 2.0;

/// The same over the distance, for lights without extent.
const SHARE: f32 = 0.3;

/// A ball around a light that does not hold the point is seen under a cone of at most this sine.
const WIDEST: f32 = 0.9;

/// A mixture of cones towards lights: a density of directions to be mixed with a uniform one.
#[derive(Debug, Clone)]
pub(super) struct Aims {
    cones: heapless::Vec<Cone, MOST>,
    total: f32,
    /// Whether all shine elsewhere.
    is_dark: bool,
}

#[derive(Debug, Clone, Copy)]
struct Cone {
    axis: Vec3,
    /// 1 − cos of half the opening angle.
    height: f32,
    /// Half the opening angle (rad), for lamps without extent: directions are the denser the closer they pass.
    steep: Option<f32>,
    weight: f32,
}

impl Aims {
    /// Those that `is_aim` and whose surroundings are seen from `point`.
    pub(super) fn new(
        point: Vec3,
        lights: &Lights<'_>,
        scene: &(impl Scene + ?Sized),
        is_aim: impl Fn(&Light<'_>) -> bool,
    ) -> Self {
        let (mut cones, mut is_dark) = (heapless::Vec::new(), true);
        let sent = FromPoint { sky: false, dark: true, ..FromPoint::all(point) };
        let strong = lights.strong(&sent);
        for light in strong.lights(lights) {
            let Some(field) = light.near_field().filter(|_| is_aim(light)) else { continue };
            let offset = field.centre() - point;
            let distance = offset.length();
            let radius = match (light, field.radius()) {
                (_, None) => SHARE * distance,
                // Wide already.
                (Light::Sphere(_), Some(r)) => r,
                (_, Some(r)) => BALL * r,
            };
            let (weight, sine) = (sent.light(light), radius / distance);
            // Written so that NaN fails, too.
            if !(weight > 0.0 && weight < f32::INFINITY && sine < WIDEST) {
                continue;
            }
            let is_lit = light.importance(point) > 0.0;
            let weight = if is_lit { weight } else { DARK * weight };
            let axis = offset / distance;
            if scene.is_blocked(&Ray { origin: point, direction: axis, length: distance - radius }) {
                continue;
            }
            is_dark &= !is_lit;
            let cosine = float::safe_sqrt(1.0 - sine * sine);
            let steep = field.radius().is_none().then(|| libm::atan2f(sine, cosine));
            let cone = Cone { axis, height: 1.0 - cosine, steep, weight };
            if let Err(cone) = cones.push(cone)
                && let Some(weakest) = cones.iter_mut().min_by(|a, b| a.weight.total_cmp(&b.weight))
                && weakest.weight < cone.weight
            {
                *weakest = cone;
            }
        }
        let total = cones.iter().map(|cone| cone.weight).sum();
        Self { cones, total, is_dark }
    }

    /// Of so many samples, how many are for these directions.
    pub(super) fn of(&self, samples: u32) -> u32 {
        if self.is_dark { (samples as f32 * DARK) as u32 } else { samples }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.cones.is_empty()
    }

    /// A direction (unit); the first coordinate of `u` also chooses the cone.
    pub(super) fn sample(&self, u: Vec2) -> Vec3 {
        let Some((cone, choice)) = choose(self.cones.iter().map(|cone| (cone.weight, cone)), u.x) else {
            return Vec3::Z;
        };
        let u = Vec2::new(choice.remainder, u.y);
        let local = cone.steep.map_or_else(|| warp::uniform_cone(u, cone.height), |widest| warp::steep_cone(u, widest));
        Frame::around(cone.axis).to_world(local)
    }

    /// Its density (sr⁻¹).
    pub(super) fn pdf(&self, direction: Vec3) -> f32 {
        let of = |cone: &Cone| match cone.steep {
            Some(widest) => warp::steep_cone_pdf(cone.axis.cross(direction).length(), cone.axis.dot(direction), widest),
            None if 0.5 * cone.axis.distance_squared(direction) <= cone.height => warp::uniform_cone_pdf(cone.height),
            None => 0.0,
        };
        let sum: f32 = self.cones.iter().map(|cone| cone.weight * of(cone)).sum();
        if self.total > 0.0 { sum / self.total } else { 0.0 }
    }
}
