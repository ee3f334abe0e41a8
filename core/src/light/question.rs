//! What is asked of lights: what one sends to a place, and about what those in a node of the tree send there.

use glam::Vec3;

use super::cut::{CHOICE, WALKS};
use super::tree::{Kind, LightNode};
use super::{Light, NearField};
use crate::math::{Ray, float};
use crate::phase::{Deflection, Phase};

/// What the lights of a node send, together.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Guess {
    /// In the unit of [`Question::light`]; 0 only if it is 0 for all of them.
    pub weight: f32,
    /// How much of it is uncertain.
    pub doubt: f32,
}

impl Guess {
    /// `ratio2` is the squared radius of the node over its squared distance.
    #[inline]
    fn new(weight: f32, ratio2: f32) -> Self {
        // Of 1/(1 − ρ)² − 1/(1 + ρ)², for the nearest and the farthest light there may be, as much as does not cancel.
        let clear = (1.0 - ratio2).max(0.1);
        Self { weight, doubt: weight * ratio2 * (4.0 / (clear * clear)) }
    }
}

impl core::ops::Mul<f32> for Guess {
    type Output = Self;
    fn mul(self, factor: f32) -> Self {
        Self { weight: self.weight * factor, doubt: self.doubt * factor }
    }
}

/// A measure of lights.
pub(crate) trait Question {
    /// Whether lights of this kind may have a weight.
    fn asks(&self, kind: Kind) -> bool;
    /// What one light sends, at most 10³⁰, so that a sum over all lights stays a number; 0 for those that take no part.
    fn light(&self, light: &Light<'_>) -> f32;
    /// The same for a node of the tree, about.
    fn node(&self, node: &LightNode) -> Guess;
    /// The same for a leaf: what is told by it alone, where that is all there is to know.
    fn leaf(&self, _: &LightNode, light: &Light<'_>) -> f32 {
        self.light(light)
    }
    /// Nodes of a cut at most.
    fn limit(&self) -> usize {
        CHOICE
    }
}

/// Smallest squared distance to the middle of a node over its squared radius: what is inside counts as if it were evenly spread. Larger:
/// nodes that are not opened around a place are chosen too seldom; smaller: too often.
const INSIDE: f32 = 1.0 / 6.0;

/// Lights whose near fields are left out at a point inside them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Except {
    /// None.
    Nothing,
    /// [`Light::near_field`].
    Near,
    /// [`Light::steep_field`].
    Steep,
}

/// Irradiance at a point, about: [`Light::importance`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct FromPoint {
    /// Where.
    pub point: Vec3,
    /// Near fields left out.
    pub except: Except,
    /// Whether a sky counts.
    pub sky: bool,
    /// Whether lamps without extent that shine elsewhere count as if they shone here.
    pub dark: bool,
}

impl FromPoint {
    pub(crate) fn all(point: Vec3) -> Self {
        Self { point, except: Except::Nothing, sky: true, dark: false }
    }
}

impl Question for FromPoint {
    fn asks(&self, kind: Kind) -> bool {
        match kind {
            Kind::Lamp => self.except == Except::Nothing,
            Kind::Body | Kind::Panel | Kind::Sun => true,
            Kind::Sky => self.sky,
        }
    }

    #[inline(never)]
    fn light(&self, light: &Light<'_>) -> f32 {
        let within = |field: Option<NearField>| field.is_some_and(|field| field.contains(self.point));
        let left_out = match self.except {
            Except::Nothing => false,
            Except::Near => within(light.near_field()),
            Except::Steep => within(light.steep_field()),
        };
        if left_out || (!self.sky && light.is_sky()) {
            return 0.0;
        }
        let mut sent = light.importance(self.point);
        if self.dark
            && sent <= 0.0
            && let Some(field) = light.near_field().filter(|field| field.radius().is_none())
        {
            sent = light.intensity() / field.centre().distance_squared(self.point).max(1e-30);
        }
        sent.min(1e30)
    }

    #[inline(never)]
    fn leaf(&self, node: &LightNode, light: &Light<'_>) -> f32 {
        if !node.is_even() || node.reach == 0.0 {
            return self.light(light);
        }
        let distance2 = self.point.distance_squared(node.centre);
        let left_out = self.except != Except::Nothing && !(distance2 >= node.reach * node.reach);
        if left_out { 0.0 } else { (node.strength / distance2.max(1e-12)).min(1e30) }
    }

    #[inline(never)]
    fn node(&self, node: &LightNode) -> Guess {
        // At infinity all are the same from everywhere.
        if node.reach == 0.0 {
            return Guess { weight: node.strength, doubt: 0.0 };
        }
        let offset = self.point - node.centre;
        let (distance2, radius2) = (offset.length_squared(), node.radius2);
        if !self.dark && !node.shines_to(offset, distance2) {
            return Guess::default();
        }
        // Lamps on one another have no radius.
        let inverse2 = 1.0 / distance2.max(INSIDE * radius2).max(1e-12);
        Guess::new((node.strength * inverse2).min(1e30), radius2 * inverse2)
    }
}

/// What is sent to a point and from there on by a lobe, about.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lobed<F> {
    /// What is sent to the point.
    pub to: FromPoint,
    /// Around which direction (unit).
    pub axis: Vec3,
    /// Where light comes from at such a cosine from the axis, how much of it leaves in the direction in question, over the mean of all directions. Never 0
    /// where any may: lamps are wider than their middle.
    pub value: F,
}

/// Lights are chosen by the light that is scattered from them, over that of isotropic scattering, but by this at least: lamps are wider than their middle,
/// and lobes may be narrower. Larger: lights are chosen that hardly matter; smaller: bright dots.
const DIMMEST: f32 = 0.1;

/// What lights send to a point of a medium that scatters it `to_eye`, about.
pub(crate) fn scattered<'p>(to: FromPoint, to_eye: Vec3, phase: &'p Phase) -> Lobed<impl Fn(f32) -> f32 + 'p> {
    let is_even = phase.is_isotropic();
    let value = move |cosine| {
        if is_even { 1.0 } else { (4.0 * float::PI * phase.value(Deflection::from_cos(cosine)).mean()).max(DIMMEST) }
    };
    Lobed { to, axis: -to_eye, value }
}

impl<F: Fn(f32) -> f32> Lobed<F> {
    /// In the middle of a ball at an offset from the point with a squared radius, and by how much more there may be at its rim.
    #[inline]
    fn weight(&self, offset: Vec3, radius2: f32) -> [f32; 2] {
        let distance2 = offset.length_squared();
        if !(distance2 > radius2) {
            return [1.0, 1.0];
        }
        let cosine = self.axis.dot(offset) / float::sqrt(distance2);
        let middle = (self.value)(cosine);
        if radius2 <= 0.0 {
            return [middle, 0.0];
        }
        let sine2 = radius2 / distance2;
        let (sine, rest) = (float::sqrt(sine2), float::sqrt(1.0 - sine2));
        let nearest = if cosine >= rest { 1.0 } else { cosine * rest + float::safe_sqrt(1.0 - cosine * cosine) * sine };
        let nearest = (self.value)(nearest);
        [0.5 * (middle + nearest), (nearest - middle).abs()]
    }
}

impl<F: Fn(f32) -> f32> Question for Lobed<F> {
    fn asks(&self, kind: Kind) -> bool {
        self.to.asks(kind)
    }

    #[inline]
    fn light(&self, light: &Light<'_>) -> f32 {
        let sent = self.to.light(light);
        match light.near_field() {
            Some(field) if sent > 0.0 => (sent * self.weight(field.centre() - self.to.point, 0.0)[0]).min(1e30),
            _ => sent,
        }
    }

    #[inline]
    fn leaf(&self, node: &LightNode, light: &Light<'_>) -> f32 {
        let sent = self.to.leaf(node, light);
        if node.reach == 0.0 || sent <= 0.0 {
            return sent;
        }
        (sent * self.weight(node.centre - self.to.point, 0.0)[0]).min(1e30)
    }

    #[inline]
    fn node(&self, node: &LightNode) -> Guess {
        let guess = self.to.node(node);
        if node.reach == 0.0 || guess.weight <= 0.0 {
            return guess;
        }
        let [weight, more] = self.weight(node.centre - self.to.point, node.radius2);
        Guess { weight: (guess.weight * weight).min(1e30), doubt: guess.doubt * weight + guess.weight * more }
    }
}

/// What is sent to a part of a ray: [`Light::sent_along`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct FromRay {
    /// The ray.
    pub ray: Ray,
    /// From here (m), …
    pub near: f32,
    /// … to here; may be infinite.
    pub far: f32,
    /// Whether [`Light::steep_field`] counts, rather than [`Light::near_field`].
    pub steep: bool,
    /// Where an endless part ends for a light, over its distance from the ray's origin, but for lights nearer than the length given.
    pub until: Option<(f32, f32)>,
}

impl FromRay {
    /// The part of the ray (m) that lies in a light's near field, and that it reaches.
    pub(crate) fn part(&self, light: &Light<'_>) -> Option<(f32, f32)> {
        let field = if self.steep { light.steep_field()? } else { light.near_field()? };
        let far = match self.until {
            Some((distances, least)) => self.far.min(distances * self.ray.origin.distance(field.centre()).max(least)),
            None => self.far,
        };
        light.near_interval(&self.ray, self.near, far)
    }
}

impl Question for FromRay {
    fn asks(&self, kind: Kind) -> bool {
        match kind {
            Kind::Lamp | Kind::Body => true,
            Kind::Panel => !self.steep,
            Kind::Sun | Kind::Sky => false,
        }
    }

    #[inline]
    fn light(&self, light: &Light<'_>) -> f32 {
        self.part(light).map_or(0.0, |part| light.sent_along(&self.ray, part))
    }

    fn limit(&self) -> usize {
        if self.until.is_some() { WALKS } else { CHOICE }
    }

    #[inline]
    fn leaf(&self, node: &LightNode, light: &Light<'_>) -> f32 {
        if !node.is_even() || self.far.is_infinite() {
            return self.light(light);
        }
        let closest = self.ray.direction.dot(node.centre - self.ray.origin);
        let height2 = self.ray.at(closest).distance_squared(node.centre);
        let half2 = node.reach * node.reach - height2;
        if !(half2 > 0.0) {
            return 0.0;
        }
        let half = float::sqrt(half2);
        let (near, far) = (self.near.max(closest - half), self.far.min(closest + half));
        if far > near { self.sent(node.strength, height2.max(1e-12), closest, (near, far)) } else { 0.0 }
    }

    #[inline]
    fn node(&self, node: &LightNode) -> Guess {
        let (centre, radius2) = (node.centre, node.radius2);
        let closest = self.ray.direction.dot(centre - self.ray.origin);
        let within = float::sqrt(radius2) + node.reach;
        let around = NearField { centre, radius2: within * within };
        let Some((from, to)) = around.interval(&self.ray, self.near, self.far) else { return Guess::default() };
        if node.spread < float::PI && !self.may_be_lit(node, centre, radius2) {
            return Guess::default();
        }
        if node.reach * node.reach < radius2 {
            return self.far_apart(node, to - from);
        }
        let distance2 = self.ray.at(closest.max(self.near).min(self.far)).distance_squared(centre);
        let height2 = self.ray.at(closest).distance_squared(centre).max(INSIDE * radius2).max(1e-12);
        Guess::new(
            self.sent(node.strength, height2, closest, (self.near, self.far)),
            radius2 / distance2.max(INSIDE * radius2).max(1e-12),
        )
    }
}

impl FromRay {
    /// `∫ I/r² dt` over a part, from a height (m, squared) above the ray's point at `closest` (m): about, and never 0.
    #[inline]
    fn sent(&self, strength: f32, height2: f32, closest: f32, (near, far): (f32, f32)) -> f32 {
        let height = float::sqrt(height2);
        let (before, after) = (near - closest, far - closest);
        let angle = if after.is_finite() {
            quick_angle(height * (after - before), height2 + before * after)
        } else {
            quick_angle(height, before)
        };
        // Written so that NaN counts as little.
        (strength * (angle / height).max(1e-30)).clamp(f32::MIN_POSITIVE, 1e30)
    }

    /// About what lights send (W·m⁻¹·sr⁻¹) whose near fields are smaller than their node, of intensities `Σ I` in all: those count whose field the ray crosses, each by
    /// `I ∫ dt/r² = I 2 acos(h/reach)/h`, from within its field. If all did, they would send `4/reach Σ I`; in the mean, where they lie evenly in a ball of the node's radius through which runs a chord (m), this share of it,
    /// exactly but for rims:
    ///
    /// ```text
    /// 1/V · chord · ∫₀^reach 2 acos(h/reach)/h 2πh dh = 4/reach · share      share = 3/4 · reach² chord/radius³
    /// ```
    ///
    /// As it is all or nothing for each, the root of the mean square counts (`√share`), by which choices have the least variance.
    fn far_apart(&self, node: &LightNode, chord: f32) -> Guess {
        let most = 4.0 * node.strength / node.reach;
        let share = 0.75 * (node.reach * node.reach) * chord / (node.radius2 * float::sqrt(node.radius2));
        Guess { weight: (most * float::sqrt(share.min(1.0))).clamp(f32::MIN_POSITIVE, 1e30), doubt: most.min(1e30) }
    }

    /// Whether light of a node may come to any point of the part. Where it is dark behind lights is convex, so both ends tell.
    fn may_be_lit(&self, node: &LightNode, centre: Vec3, radius2: f32) -> bool {
        if node.spread > 0.5 * float::PI + 0.1 || !self.far.is_finite() {
            return true;
        }
        // cos(π/2 + 0.1) is above −0.1, also for a light at the rim.
        let slack = 1.1 * float::sqrt(radius2);
        let ahead = |t: f32| {
            let offset = self.ray.at(t) - centre;
            node.axis.dot(offset) + 0.1 * offset.length() + slack >= 0.0
        };
        ahead(self.near) || ahead(self.far)
    }
}

/// Angle (rad) of the vector `(x, y)`, `y ≥ 0`, to some thousandths.
#[inline]
fn quick_angle(y: f32, x: f32) -> f32 {
    let (low, high) = if y < x.abs() { (y, x.abs()) } else { (x.abs(), y) };
    let z = low / high.max(f32::MIN_POSITIVE);
    let steep = z * (0.25 * float::PI + 0.273 * (1.0 - z));
    let angle = if y < x.abs() { steep } else { 0.5 * float::PI - steep };
    if x < 0.0 { float::PI - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::SphereLight;
    use crate::sampling::{Generator, uniform, uniform2, warp};
    use crate::spectrum::Spectrum;

    #[test]
    fn lamps_that_are_far_apart_send_what_a_ball_of_them_does_in_the_mean() {
        let (radius, rng) = (2.0, &mut Generator::new(3));
        let lamp = |centre| Light::Sphere(SphereLight::new(centre, 0.01, Spectrum::ONE).unwrap());
        let (reach, strength) =
            (lamp(Vec3::ZERO).steep_field().unwrap().radius().unwrap(), lamp(Vec3::ZERO).intensity());
        let node = LightNode { radius2: radius * radius, strength, reach, ..LightNode::EMPTY };
        let ray = Ray::between(Vec3::new(-5.0, 0.3, 0.2), Vec3::new(5.0, 0.1, -0.4));
        let question = FromRay { ray, near: 0.0, far: ray.length, steep: true, until: None };
        // Of lamps, not of where their fields are: the chord of the ball itself.
        let height2 = ray.direction.cross(ray.origin).length_squared();
        let Guess { weight, doubt } = question.far_apart(&node, 2.0 * float::sqrt(radius * radius - height2));
        const LAMPS: u32 = 2_000_000;
        let mut sum = 0.0;
        for _ in 0..LAMPS {
            let at = radius * libm::cbrtf(uniform(rng)) * warp::uniform_sphere(uniform2(rng));
            sum += f64::from(Question::light(&question, &lamp(at)));
        }
        let (mean, told) = (sum / f64::from(LAMPS), f64::from(weight * weight / doubt));
        assert!((told / mean - 1.0).abs() < 0.05, "{told} instead of {mean}");
    }
}
