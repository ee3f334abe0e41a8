//! What is computed, one function per module of the core.

use fogbow::host::{Medium, Properties};
use fogbow::light::{
    EnvironmentMap, Light, MeshLight, PhongLight, PointLight, QuadLight, SphereLight, SpotLight, Sun, Triangle,
};
use fogbow::math::{Bounds, Frame, Mat3, Ray, Vec2, Vec3, float, quadrature};
use fogbow::phase::{Deflection, Lobe, Phase, deflection};
use fogbow::sampling::uniform::uniform2;
use fogbow::sampling::{Generator, discrete, distance, mis, uniform, warp};
use fogbow::spectrum::{Gradient, Hessian, Spectrum};
use fogbow::storage::List;
use fogbow::surface::Surface;

use crate::{Digest, Section, estimates, lent, media, walks};

/// Every section, lowest layer first.
pub const SECTIONS: &[Section] = &[
    Section { name: "math", run: math },
    Section { name: "spectrum", run: spectrum },
    Section { name: "storage", run: storage },
    Section { name: "sampling", run: sampling },
    Section { name: "sh", run: estimates::spherical_harmonics },
    Section { name: "phase", run: phase },
    Section { name: "surface", run: surface },
    Section { name: "host", run: host },
    Section { name: "medium", run: media::medium },
    Section { name: "light", run: light },
    Section { name: "transmittance", run: media::transmittance },
    Section { name: "thickness", run: estimates::thickness },
    Section { name: "single_scatter", run: estimates::single_scatter },
    Section { name: "march", run: estimates::march },
    Section { name: "multiple_scatter", run: estimates::multiple_scatter },
    Section { name: "path", run: walks::path },
    Section { name: "cache", run: lent::caches },
    Section { name: "beams", run: lent::beams },
    Section { name: "vpl", run: lent::lights },
    Section { name: "picture", run: lent::picture },
];

/// Inputs of each section: enough to pass through every branch, few enough for a browser.
pub(crate) const ROUNDS: usize = 256;

/// A point within 4 m of the origin.
pub(crate) fn point(rng: &mut Generator) -> Vec3 {
    let p = uniform2(rng);
    (Vec3::new(p.x, p.y, uniform(rng)) - Vec3::splat(0.5)) * 8.0
}

pub(crate) fn direction(rng: &mut Generator) -> Vec3 {
    warp::uniform_sphere(uniform2(rng))
}

pub(crate) fn colour(rng: &mut Generator) -> Spectrum {
    let p = uniform2(rng);
    Spectrum::new(p.x, p.y, uniform(rng))
}

fn math(out: &mut Digest) {
    let mut rng = Generator::new(1);
    for _ in 0..ROUNDS {
        let x = (uniform(&mut rng) - 0.5) * 40.0;
        let y = uniform(&mut rng);
        let (sin, cos) = float::sin_cos(x);
        [sin, cos, float::exp(x), float::ln(y), float::exp_m1(x), float::ln_1p(y), float::sqrt(y)]
            .into_iter()
            .for_each(|v| out.float(v));
        [float::powf(y, x), float::tan(x), float::acos(y), float::asin(y), float::atan(x), float::atan2(x, y)]
            .into_iter()
            .for_each(|v| out.float(v));
        [float::atanh(y), float::cbrt(x), float::floor(x), float::difference_of_products(x, y, sin, cos)]
            .into_iter()
            .for_each(|v| out.float(v));
        out.int(u64::from(float::floor_i32(x).cast_unsigned()));

        let frame = Frame::around(direction(&mut rng));
        out.vec3(frame.to_world(point(&mut rng)));
        let ray = Ray::between(point(&mut rng), point(&mut rng));
        out.vec3(ray.at(0.5 * ray.length));
        let bounds = Bounds::of([point(&mut rng), point(&mut rng)]);
        out.option(bounds.intersect(&ray), |out, (near, far)| {
            out.float(near);
            out.float(far);
        });
        out.float(quadrature::integrate(0.0, y, |t| float::exp(-t * sin)));
    }
}

fn spectrum(out: &mut Digest) {
    let mut rng = Generator::new(2);
    for _ in 0..ROUNDS {
        let (a, b) = (colour(&mut rng), colour(&mut rng));
        let at = point(&mut rng);
        [a * b + a / 3.0, a.transmitted(), a.ratio(b), a.min(b), a.max(b), Spectrum::splat(at.x).transmitted()]
            .into_iter()
            .for_each(|v| out.spectrum(v));
        let gradient = Gradient::outer(a, at);
        out.gradient(&gradient);
        out.spectrum(gradient.norm());
        out.spectrum(gradient.along(direction(&mut rng)));
        let hessian = Hessian { xx: a, xy: b, xz: a + b, yy: b * b, yz: a - b, zz: a * a };
        out.spectrum(hessian.between(at, direction(&mut rng)));
    }
}

fn storage(out: &mut Digest) {
    let mut slots = [0.0_f32; 24];
    let mut list = List::from(&mut slots[..]);
    let mut rng = Generator::new(3);
    for _ in 0..32 {
        out.int(u64::from(list.push(uniform(&mut rng)).is_ok()));
    }
    list.as_slice().iter().for_each(|&v| out.float(v));
}

fn sampling(out: &mut Digest) {
    let mut rng = Generator::new(4);
    for _ in 0..ROUNDS {
        let u = uniform2(&mut rng);
        let x = uniform(&mut rng) * 3.0;
        out.vec3(warp::uniform_sphere(u));
        out.vec3(warp::cosine_hemisphere(u));
        out.vec3(warp::cosine_power(u, 5.0 * x));
        out.float(warp::cosine_power_pdf(u.x, 5.0 * x));
        out.vec3(warp::uniform_cone(u, 0.3 * x));
        out.vec2(warp::uniform_triangle(u));
        out.float(distance::exponential(u.x, x));
        out.float(distance::exponential_pdf(u.x, x));
        let truncated = distance::truncated_exponential(u.x, x, 2.0);
        out.float(truncated.distance);
        out.float(truncated.pdf);
        let equiangular =
            distance::Equiangular::new(point(&mut rng), direction(&mut rng), point(&mut rng), 0.1, 1.0 + x);
        out.option(equiangular, |out, law| {
            let at = law.sample(u.y);
            out.float(at);
            out.float(law.pdf(at));
        });
        out.float(mis::balance(u.x, u.y));
        out.float(mis::power(u.x, u.y));
        let weights = colour(&mut rng).0;
        out.option(discrete::choose(weights.map(|w| (w, ())), u.x), |out, ((), choice)| {
            out.int(choice.index as u64);
            out.float(choice.probability);
            out.float(choice.remainder);
        });
    }
}

/// A phase function of every kind.
fn phases() -> [Phase; 8] {
    let lobe = Phase::from;
    let overlap = Phase::mix([
        (Spectrum::new(0.2, 0.4, 0.8), lobe(Lobe::Rayleigh)),
        (Spectrum::new(0.9, 0.5, 0.1), lobe(Lobe::HenyeyGreenstein { g: 0.8 })),
    ]);
    [
        Phase::ISOTROPIC,
        lobe(Lobe::HenyeyGreenstein { g: -0.4 }),
        lobe(Lobe::HenyeyGreenstein { g: 0.95 }),
        lobe(Lobe::Schlick { k: 0.7 }),
        lobe(Lobe::Rayleigh),
        lobe(Lobe::Draine { g: 0.6, alpha: 12.0 }),
        Phase::droplets(20.0).unwrap_or(Phase::ISOTROPIC),
        overlap.unwrap_or(Phase::ISOTROPIC),
    ]
}

fn phase(out: &mut Digest) {
    let mut rng = Generator::new(5);
    for phase in phases() {
        for degree in 0..12 {
            out.spectrum(phase.moment(degree));
        }
        for _ in 0..ROUNDS {
            let to_eye = direction(&mut rng);
            let sample = phase.sample(to_eye, uniform2(&mut rng));
            out.vec3(sample.to_light);
            out.spectrum(sample.weight);
            out.float(sample.pdf);
            let turn = deflection(direction(&mut rng), to_eye);
            out.spectrum(phase.value(turn));
            out.spectrum(phase.derivative(turn));
            out.gradient(&phase.gradient(sample.to_light, to_eye, 0.5 + uniform(&mut rng)));
            out.float(phase.pdf(Deflection::from_cos(turn.cos)));
        }
    }
}

fn surface(out: &mut Digest) {
    let mut rng = Generator::new(6);
    for _ in 0..ROUNDS {
        let half = colour(&mut rng) * 0.5;
        let surfaces = [
            Surface::Lambert { reflectance: half },
            Surface::Phong { diffuse: half, specular: half, exponent: 40.0 * uniform(&mut rng) },
            Surface::Mirror { reflectance: half },
            Surface::Dielectric { eta: 1.5, reflectance: Spectrum::ONE, transmittance: half },
            Surface::Dielectric { eta: 0.7, reflectance: half, transmittance: Spectrum::ONE },
            Surface::Null,
        ];
        for surface in surfaces {
            let (normal, to_eye, to_light) = (direction(&mut rng), direction(&mut rng), direction(&mut rng));
            out.spectrum(surface.value(normal, to_eye, to_light));
            out.float(surface.pdf(normal, to_eye, to_light));
            let sample = surface.sample(normal, to_eye, uniform(&mut rng), uniform2(&mut rng));
            out.option(sample, |out, sample| {
                out.vec3(sample.to_light);
                out.spectrum(sample.weight);
                out.float(sample.pdf);
            });
        }
    }
}

/// Fog that thins with height: it answers the indispensable questions and leaves the rest to the
/// trait's defaults.
struct Haze;

impl Medium for Haze {
    fn properties(&self, point: Vec3) -> Properties {
        let density = float::exp(-0.5 * point.y * point.y) * (1.0 + 0.1 * point.x);
        let scattering = Spectrum::new(0.3, 0.4, 0.5) * density.max(0.0);
        Properties { absorption: scattering * 0.1, scattering, ..Properties::VACUUM }
    }
    fn majorant_segment(&self, _: &Ray, _: f32) -> fogbow::host::MajorantSegment {
        fogbow::host::MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ZERO, majorant: Spectrum::splat(1.0) }
    }
}

pub(crate) fn questions(out: &mut Digest, medium: &dyn Medium, rng: &mut Generator) {
    let at = point(rng);
    let properties = medium.properties(at);
    [properties.absorption, properties.scattering, properties.emission, properties.albedo(), medium.extinction(at)]
        .into_iter()
        .for_each(|v| out.spectrum(v));
    let gradients = medium.gradients(at);
    out.gradient(&gradients.extinction);
    out.gradient(&gradients.scattering);
    out.spectrum(medium.extinction_hessian(at).between(direction(rng), direction(rng)));
    out.spectrum(medium.mean_extinction(at, uniform(rng)));
    let ray = Ray::between(at, point(rng));
    let segment = medium.majorant_segment(&ray, 0.5 * ray.length);
    out.float(segment.until);
    out.spectrum(segment.minorant);
    out.spectrum(segment.majorant);
    medium.faces(&ray, &mut |face| {
        out.float(face.distance);
        out.vec3(face.normal);
        out.spectrum(face.jump);
    });
}

fn host(out: &mut Digest) {
    let mut rng = Generator::new(7);
    for _ in 0..ROUNDS {
        questions(out, &Haze, &mut rng);
    }
}

fn light(out: &mut Digest) {
    let mut rng = Generator::new(9);
    let triangles = [
        Triangle { corners: [Vec3::ZERO, Vec3::X, Vec3::Y] },
        Triangle { corners: [Vec3::X, Vec3::new(1.0, 1.0, 0.5), Vec3::Y] },
    ];
    let mut areas = [0.0; 2];
    let mut texels = [Spectrum::ZERO; 8 * 4];
    texels.iter_mut().for_each(|texel| *texel = colour(&mut rng));
    let (mut weights, mut column) = ([0.0; 8 * 4], [0.0; 4]);
    let sky = EnvironmentMap::new(8, 4, &texels, &mut weights, &mut column, Mat3::from_rotation_y(0.3));

    let white = Spectrum::new(3.0, 2.0, 1.0);
    let (at, axis) = (Vec3::new(0.5, 2.0, -1.0), Vec3::new(0.3, -1.0, 0.2));
    let lights = [
        PointLight::new(at, white).map(Light::Point),
        PhongLight::new(at, axis, 6.0, white).map(Light::Phong),
        SpotLight::new(at, axis, 0.3, 0.9, white).map(Light::Spot),
        QuadLight::new(at, Vec3::X, Vec3::Z, white).map(Light::Quad),
        QuadLight::new(at, Vec3::X, Vec3::new(0.5, 0.1, 1.0), white).map(Light::Quad),
        SphereLight::new(at, 0.4, white).map(Light::Sphere),
        MeshLight::new(&triangles, &mut areas, white).map(Light::Mesh),
        Sun::new(axis, white).map(Light::Sun),
        Ok(Light::Constant(white)),
    ];
    let sky = sky.as_ref().map(Light::Environment).map_err(|&error| error);
    let world = Bounds { min: Vec3::splat(-4.0), max: Vec3::splat(4.0) };
    for light in lights.into_iter().chain([sky]) {
        let Ok(light) = light else {
            out.int(u64::MAX);
            continue;
        };
        out.spectrum(light.power(&world));
        for _ in 0..ROUNDS {
            let from = point(&mut rng);
            out.float(light.importance(from));
            let sample = light.sample(from, Vec2::new(uniform(&mut rng), uniform(&mut rng)));
            out.option(sample, |out, sample| {
                out.vec3(sample.incident.to_light);
                out.float(sample.incident.distance);
                out.spectrum(sample.incident.irradiance);
                out.float(sample.pdf);
                out.float(light.pdf(from, sample.incident.to_light, sample.incident.distance, sample.source.normal));
                out.option(sample.source.irradiance(from + Vec3::splat(0.01)), |out, (irradiance, gradient)| {
                    out.spectrum(irradiance);
                    out.gradient(&gradient);
                });
            });
            let to_light = direction(&mut rng);
            out.spectrum(light.background(to_light));
            out.spectrum(light.radiance(from, to_light, axis));
        }
    }
}
