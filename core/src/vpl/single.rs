//! Light that the medium scatters once, from points of an eye ray as dense as it comes from there.

use glam::{Vec2, Vec3};

use crate::host::{MajorantSegment, Medium, Scene};
use crate::light::{Falloff, Light, Source};
use crate::math::{Ray, float};
use crate::phase::deflection;
use crate::sampling::distance::Equiangular;
use crate::sampling::{Generator, discrete, mis, uniform, uniform2};
use crate::spectrum::Spectrum;
use crate::transmittance::{marching_segments, transmittance};
use crate::world::{World, nearest_surface, short_of_end};

/// Parts of an eye ray in which its medium is looked at: 768 bytes of stack. More: points follow thin veils of smoke better, and every
/// ray takes longer.
const PARTS: usize = 64;

/// Parts for a free path of even fog. More: transmittance changes less within a part, of which there are more to look through.
const PER_FREE_PATH: f32 = 2.0;

/// Parts of a segment without end.
const ENDLESS: u32 = 16;

/// Looks at borders of segments are moved inwards by this share of a part.
const BORDER: f32 = 0.05;

/// A part is taken to scatter at least this share of what its bound allows: what a single look into it missed is found, too, though with
/// up to the inverse of it as weight. Larger: more points in clear air; smaller: heavier weights.
const LEAST_SHARE: f32 = 0.05;

/// Up to this number, a light is chosen by what it sends to every part of the ray; of more, by what it sends to all of it in clear air. More:
/// longer, by a look through the parts for each.
const FEW: usize = 16;

/// A part beside a flat light weighs at least this share of one straight before it. Larger: more points where it hardly shines; smaller: heavier
/// weights where a wide light is seen although its middle is beside.
const LEAST_COSINE: f32 = 0.2;

/// Mean cosine (absolute) of phase functions that look for wide lights themselves. Larger: outliers where light comes straight on through the smoke
/// before a lamp; smaller: a ray more for every connection.
const PEAKED: f32 = 0.2;

/// `tan` up to which an angle is as long as its tangent, in sums from which a part is drawn: within 2 %.
const SMALL: f32 = 0.25;

/// A part of an eye ray.
#[derive(Debug, Clone, Copy)]
struct Part {
    from: f32,
    until: f32,
    /// About `σₛ T` there (m⁻¹).
    scattered: f32,
}

type Parts = heapless::Vec<Part, PARTS>;

/// Whether all light comes from where there are lights: then [`single`] knows it all.
pub(super) fn is_local(lights: &[Light<'_>]) -> bool {
    lights.iter().all(|light| light.near_field().is_some())
}

/// Light (W·m⁻²·sr⁻¹) that comes straight from the lights, none of which lies at infinity, and that the medium scatters towards the origin of
/// `segment`: an unbiased estimate from `count` connections.
///
/// ```text
/// L ≈ 1/n Σ T(t) σₛ(t) p L_e(t)/(P(l) p(t)),   p(t) = wⱼ/Σw · equiangular within part j,   wⱼ = (σₛT)ⱼ ∫ⱼ dt/r²
/// ```
///
/// Points lie where smoke is *and* light is near: the product of what the two strategies that are usual, by
/// collisions and equiangular (Kulla and Fajardo 2012), draw by. `1/r²` cancels, and no ray through thin smoke comes back without light.
pub(super) fn single<M: Medium + ?Sized, S: Scene + ?Sized>(
    segment: &Ray,
    world: &World<'_, M, S>,
    count: u32,
    rng: &mut Generator,
) -> Spectrum {
    let parts = parts_of(segment, world.medium);
    if parts.is_empty() {
        return Spectrum::ZERO;
    }
    let mut sent = heapless::Vec::<f32, FEW>::new();
    if world.lights.len() <= FEW {
        sent.extend(world.lights.iter().map(|light| sent_to(light, segment, &parts)));
    }
    let sent = |(i, light): (usize, &Light<'_>)| match sent.get(i) {
        Some(sent) => *sent,
        None => light.sent_along(segment, (0.0, segment.length)),
    };
    let mut sum = Spectrum::ZERO;
    for i in 0..count {
        let u = (i as f32 + uniform(rng)) / count as f32;
        let random = (uniform(rng), uniform2(rng));
        let weighted = world.lights.iter().enumerate().map(|entry| (sent(entry), entry.1));
        let Some((light, chosen)) = discrete::choose(weighted, u) else { continue };
        if let Some(found) =
            connection(segment, world, &parts, (chosen.index as u32, light), (chosen.remainder, random), rng)
        {
            sum += found * (1.0 / chosen.probability);
        }
    }
    sum * (1.0 / count as f32)
}

/// Where along `segment` the medium scatters how much.
fn parts_of(segment: &Ray, medium: &(impl Medium + ?Sized)) -> Parts {
    let mut parts = Parts::new();
    // What there is to look at, and how finely that can be done.
    let matter = |bounds: &MajorantSegment| bounds.majorant.mean() > 0.0;
    let lengths = marching_segments(medium, segment).filter(|(_, bounds)| matter(bounds));
    let extent: f32 = lengths.map(|(from, bounds)| bounds.until - from).filter(|length| length.is_finite()).sum();
    let resolution = Some(medium.resolution()).filter(|r| *r > 0.0).unwrap_or(0.0);
    let least = extent / (PARTS / 2) as f32;
    let mut thickness = 0.0_f32;
    for (start, bounds) in marching_segments(medium, segment).filter(|(_, bounds)| matter(bounds)) {
        let bound = bounds.majorant.mean();
        let even = 1.0 / (PER_FREE_PATH * bound);
        let step = least.max(if bounds.is_constant() { even } else { resolution });
        let length = bounds.until - start;
        // The last part of a ray without end has none either.
        let count = if length.is_finite() { (length / step) as u32 + 1 } else { ENDLESS };
        let width = if length.is_finite() { length / count as f32 } else { step.max(even) };
        // Just within: at borders media may say what is beyond.
        let look = |i: u32| {
            let at = (i as f32).clamp(BORDER, count as f32 - BORDER);
            let properties = medium.properties(segment.at(start + width * at));
            (properties.extinction().mean(), properties.scattering.mean())
        };
        let mut before = look(0);
        for i in 0..count {
            let after = if bounds.is_constant() { before } else { look(i + 1) };
            let until = if i + 1 == count { bounds.until } else { start + width * (i + 1) as f32 };
            let through = 0.5 * (before.0 + after.0) * width;
            let passed = float::exp(-(thickness + 0.5 * through));
            let scattering = before.1.max(after.1).max(LEAST_SHARE * bound);
            thickness += through;
            before = after;
            // Never 0: what is hidden behind much smoke is still there.
            let scattered = (scattering * passed).max(f32::MIN_POSITIVE);
            // What finds no room is within the last one.
            if parts.push(Part { from: start + width * i as f32, until, scattered }).is_err()
                && let Some(last) = parts.last_mut()
            {
                (last.until, last.scattered) = (until, last.scattered.max(scattered));
            }
        }
    }
    parts
}

/// About what a light sends to the eye by way of the parts (W·m⁻²·sr⁻¹, but for the phase function), in clear air.
fn sent_to(light: &Light<'_>, segment: &Ray, parts: &Parts) -> f32 {
    let Some(view) = View::of_middle(light, segment) else { return 0.0 };
    let sum: f32 = parts.iter().map(|part| view.weight(part)).sum();
    // Capped, so that a sum over all lights stays a number.
    (light.intensity() * sum).min(1e30)
}

/// How a ray runs past a light, or past one of its points.
struct View {
    /// Distance (m) along the ray where it is closest, and how far away it is there.
    closest: f32,
    height: f32,
    /// From where to where (m) the light can shine on the ray.
    near: f32,
    far: f32,
    /// Middle, normal and radius of a flat light, which shines on nothing behind it and on little beside it.
    flat: Option<(Vec3, Vec3, f32)>,
    origin: Vec3,
    direction: Vec3,
}

impl View {
    /// `height` is at least `least` (m). `None` if the light shines on no part of the ray.
    fn new(light: &Light<'_>, segment: &Ray, pivot: Vec3, least: f32, normal: Option<Vec3>) -> Option<Self> {
        let (mut near, mut far) = match light {
            // All of space is its near field, and only its cone is reached.
            Light::Spot(_) => light.near_interval(segment, 0.0, segment.length)?,
            _ => (0.0, segment.length),
        };
        let (origin, direction) = (segment.origin, segment.direction);
        if let Some(normal) = normal {
            let slope = normal.dot(direction);
            let crossing = normal.dot(pivot - origin) / slope;
            if slope > 0.0 {
                near = near.max(crossing);
            } else if slope < 0.0 {
                far = far.min(crossing);
            }
        }
        let closest = direction.dot(pivot - origin);
        let height = float::hypot(segment.at(closest).distance(pivot), least);
        let height = height.max(1e-6 * closest.abs()).max(1e-20);
        let flat = normal.map(|normal| (pivot, normal, least));
        (far > near).then_some(Self { closest, height, near, far, flat, origin, direction })
    }

    /// Of the light as a whole. Before a disc of radius R, irradiance goes like `1/(r² + R²)`.
    fn of_middle(light: &Light<'_>, segment: &Ray) -> Option<Self> {
        let centre = light.near_field()?.centre();
        match light {
            Light::Quad(quad) => {
                let (_, source) = light.anchor(Vec2::splat(0.5))?;
                let radius = float::sqrt(quad.area() / float::PI);
                Self::new(light, segment, centre, radius, source.map(|source| source.normal))
            }
            _ => Self::new(light, segment, centre, 0.0, None),
        }
    }

    /// About `(σₛT) ∫ dt/r²` over what is lit of `part` (m⁻²).
    #[inline]
    fn weight(&self, part: &Part) -> f32 {
        let (from, to) = (part.from.max(self.near), part.until.min(self.far));
        if !(to > from) {
            return 0.0;
        }
        let height = self.height;
        let (a, b) = (from - self.closest, to - self.closest);
        let angle = if b.is_finite() {
            // tan(β − α)
            let (y, x) = ((to - from) * height, height * height + a * b);
            if y < SMALL * x { y / x } else { float::atan2(y, x) }
        } else {
            float::atan2(height, a)
        };
        let cosine = match self.flat {
            Some((centre, normal, radius)) if b.is_finite() => {
                let offset = self.origin + self.direction * (0.5 * (from + to)) - centre;
                // Close before a wide light some of it is straight above.
                let above = normal.dot(offset).max(0.0) + radius;
                (above / float::hypot(offset.length(), radius).max(1e-20)).clamp(LEAST_COSINE, 1.0)
            }
            _ => 1.0,
        };
        part.scattered * cosine * angle / height
    }

    /// A point (m) that is as far away from the ray as this view has it.
    fn pivot(&self) -> Vec3 {
        let across = self.direction.any_orthonormal_vector();
        self.origin + self.direction * self.closest + across * self.height
    }
}

/// What `light` sends to a point of the segment, over the point's density.
fn connection<M: Medium + ?Sized, S: Scene + ?Sized>(
    segment: &Ray,
    world: &World<'_, M, S>,
    parts: &Parts,
    (index, light): (u32, &Light<'_>),
    (u_part, (u_within, on_light)): (f32, (f32, Vec2)),
    rng: &mut Generator,
) -> Option<Spectrum> {
    // What a rectangle sends has a bound, so that its points may be drawn from where it is seen; of other lights, `1/r²` must cancel.
    let (view, anchor) = match light {
        Light::Quad(_) => (View::of_middle(light, segment)?, None),
        _ => {
            let (pivot, anchor) = light.anchor(on_light)?;
            let is_flat = |source: &Source| matches!(source.falloff, Falloff::Area | Falloff::Phong { .. });
            let normal = anchor.filter(is_flat).map(|source| source.normal);
            (View::new(light, segment, pivot, 0.0, normal)?, anchor)
        }
    };
    let total: f32 = parts.iter().map(|part| view.weight(part)).sum();
    if !(total > 0.0 && total < f32::INFINITY) {
        return None;
    }
    let mut left = u_part * total;
    let (mut part, mut own) = (parts.first()?, 0.0);
    for next in parts {
        let here = view.weight(next);
        if here > 0.0 {
            (part, own) = (next, here);
            if left < here {
                break;
            }
            left -= here;
        }
    }
    let (from, to) = (part.from.max(view.near), part.until.min(view.far));
    let law = Equiangular::new(segment.origin, segment.direction, view.pivot(), from, to)?;
    let distance = law.sample(u_within).clamp(from, to);
    let pdf = law.pdf(distance) * (own / total);
    let point = segment.at(distance);
    let properties = world.medium.properties(point);
    let to_eye = -segment.direction;
    let (incident, light_pdf) = match anchor {
        Some(source) => (source.incident(point), 0.0),
        None => match light.sample(point, on_light) {
            Some(sample) => (Some(sample.incident), sample.pdf),
            None => (None, 0.0),
        },
    };
    // Of a wide light, what a peaked phase function makes bright may be a small part only, which the phase function finds.
    let peak = properties.phase.mean_cosine().map(f32::abs).max_element();
    let is_peaked = light_pdf > 0.0 && peak > PEAKED;
    let mut arriving = Spectrum::ZERO;
    if let Some(incident) = incident {
        let deflection = deflection(incident.to_light, to_eye);
        let weight = if is_peaked { mis::power(light_pdf, properties.phase.pdf(deflection)) } else { 1.0 };
        let sent = properties.phase.value(deflection) * incident.irradiance * weight;
        let way = Ray { origin: point, direction: incident.to_light, length: incident.distance };
        if !sent.is_black() && !world.scene.is_blocked(&short_of_end(&way)) {
            arriving += sent * transmittance(world.medium, &way, rng);
        }
    }
    if is_peaked {
        let sample = properties.phase.sample(to_eye, uniform2(rng));
        let way = Ray::new(point, sample.to_light);
        if let Some(hit) = nearest_surface(&way, world.scene)
            && hit.light == Some(index)
        {
            let found = light.pdf(point, sample.to_light, hit.distance, hit.normal);
            let sent =
                light.radiance(way.at(hit.distance), hit.normal, -sample.to_light) * mis::power(sample.pdf, found);
            if !sent.is_black() {
                let reach = transmittance(world.medium, &way.with_length(hit.distance), rng);
                arriving += sample.weight * sent * reach;
            }
        }
    }
    let scattered = properties.scattering * arriving;
    if scattered.is_black() {
        return None;
    }
    let seen = transmittance(world.medium, &segment.with_length(distance), rng);
    Some(scattered * seen * (1.0 / pdf))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Hit;
    use crate::light::{PointLight, QuadLight, SpotLight};
    use crate::math::Bounds;
    use crate::medium::{Homogeneous, Overlap, Placed, Region};
    use crate::path::{self, Settings};
    use crate::phase::{Lobe, Phase};
    use crate::surface::Surface;

    const BOUNDS: Bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };

    /// The first light's own rectangle, as far as it is there.
    struct Panel;

    impl Scene for Panel {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let distance = (1.0 - ray.origin.y) / ray.direction.y;
            let point = ray.at(distance);
            let hits = distance > 0.0 && distance < ray.length && point.x.abs() < 0.4 && point.z.abs() < 0.4;
            hits.then_some(Hit {
                distance,
                normal: Vec3::NEG_Y,
                shading: Vec3::NEG_Y,
                surface: Surface::BLACK,
                light: (ray.direction.y > 0.0).then_some(0),
            })
        }
    }

    /// Mean and variance of the mean of `samples` values.
    fn estimate(samples: u32, mut of: impl FnMut(&mut Generator) -> Spectrum) -> (f64, f64) {
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..samples {
            let light = of(&mut Generator::new(u64::from(i) + 9));
            assert!(light.is_finite());
            let light = f64::from(light.mean());
            sum += light;
            squares += light * light;
        }
        let n = f64::from(samples);
        let mean = sum / n;
        (mean, (squares / n - mean * mean) / n)
    }

    fn by_paths(ray: &Ray, world: &World<'_, impl Medium + ?Sized, impl Scene>, samples: u32) -> (f64, f64) {
        let once = Settings { max_scatterings: 1, ..Settings::default() };
        estimate(samples, |rng| path::radiance(ray, world, &once, rng).medium_single)
    }

    #[test]
    fn light_scattered_once_is_that_of_paths() {
        let panel = Light::Quad(
            QuadLight::new(Vec3::new(-0.4, 1.0, -0.4), 0.8 * Vec3::X, 0.8 * Vec3::Z, Spectrum::splat(4.0)).unwrap(),
        );
        let bulb = |at: Vec3| Light::Point(PointLight::from_flux(at, Spectrum::splat(3.0)).unwrap());
        let down = Vec3::new(-0.6, -0.8, 0.0);
        let spot = Light::Spot(SpotLight::new(Vec3::new(0.2, 0.9, 0.1), down, 0.3, 0.5, Spectrum::splat(9.0)).unwrap());
        let many: [Light<'_>; 18] = core::array::from_fn(|i| match i {
            0 => panel,
            1 => spot,
            _ => bulb(Vec3::new(0.1 * i as f32 - 0.9, 0.3 - 0.05 * i as f32, 0.3)),
        });
        let few = [panel, spot, bulb(Vec3::new(-0.3, -0.2, 0.1)), bulb(Vec3::new(0.0, 3.0, -2.0))];
        let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.4 });
        let even =
            |scattering: f32| Homogeneous::new(Spectrum::splat(0.2), Spectrum::splat(scattering), phase).unwrap();
        // Smoke in a box and denser smoke in a ball within.
        let (thin, dense) = (even(0.4), even(4.0));
        let parts = [
            Placed::new(thin, Region::bounds(BOUNDS).unwrap()),
            Placed::new(dense, Region::sphere(Vec3::new(-0.2, 0.5, 0.1), 0.4).unwrap()),
        ];
        let smoke = Overlap::new(&parts, |_| phase).unwrap();
        let media: [(&str, &dyn Medium); 2] = [("smoke", &smoke), ("fog without end", &thin)];
        let eye = Vec3::new(0.5, 0.2, 4.0);
        // Past the lamps, into the panel, and below it.
        let targets = [Vec3::new(-0.3, -0.15, 0.0), Vec3::new(0.1, 1.0, 0.1), Vec3::new(0.0, 0.8, 0.0)];
        for (name, medium) in media {
            for lights in [&few[..1], &few[..], &many[..]] {
                let world = World { medium, scene: &Panel, lights: lights.into() };
                for target in targets {
                    let ray = Ray::between(eye, target).with_length(f32::INFINITY);
                    let truth = by_paths(&ray, &world, 200_000);
                    let clear = Panel.closest_hit(&ray).map_or(ray.length, |hit| hit.distance);
                    let segment = short_of_end(&ray.with_length(clear));
                    for count in [1, 4] {
                        let found = estimate(40_000, |rng| single(&segment, &world, count, rng));
                        let error = libm::sqrt(found.1 + truth.1);
                        let n = lights.len();
                        let off = (found.0 - truth.0).abs() / error;
                        assert!(
                            error < 0.03 * truth.0,
                            "{name}, {n} lights, to {target}, {count} samples: too noisy to tell"
                        );
                        assert!(
                            off < 4.5,
                            "{name}, {n} lights, to {target}, {count} samples: {} instead of {}, {off} standard errors",
                            found.0,
                            truth.0
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_lamp_in_thin_smoke_has_little_noise() {
        let fog = Homogeneous::new(Spectrum::splat(0.01), Spectrum::splat(0.1), Phase::ISOTROPIC).unwrap();
        let cloud = Placed::new(fog, Region::bounds(BOUNDS).unwrap());
        let lamps = [Light::Point(PointLight::from_flux(Vec3::new(-0.3, 0.1, 0.0), Spectrum::ONE).unwrap())];
        let world = World { medium: &cloud, scene: &crate::host::Empty, lights: (&lamps).into() };
        let ray = Ray::between(Vec3::new(0.0, 0.0, 4.0), Vec3::new(0.1, 0.0, -1.0));
        let (found, paths) = (estimate(2000, |rng| single(&ray, &world, 1, rng)), by_paths(&ray, &world, 20_000));
        // What is left is transmittance from the lamp, half a metre to a metre away from all but the ray's ends: e^(−0.11 · 0.5).
        let spread = libm::sqrt(2000.0 * found.1) / found.0;
        assert!(spread < 0.055, "{spread} of the light");
        // Paths see what lies before their next collision alone.
        let gain = 10.0 * paths.1 / found.1.max(1e-30);
        assert!(gain > 20.0, "{gain} times less variance");
    }
}
