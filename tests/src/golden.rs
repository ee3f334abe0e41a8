//! Golden vectors: any folder of files in the format of `tests/golden/README.md`.
//!
//! Nothing here knows ids or counts. A topic is a function from a case's inputs to named outputs;
//! each output is compared component by component with its own absolute tolerance. `null` means
//! "not defined" and is compared as such.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use fogbow::cache::{Blend, Extrapolation, Limits, exponent_limit, valid_radius, weight};
use fogbow::covariance::{self, ImageCovariance, LightField, Symmetric4, Voxel};
use fogbow::host::Properties;
use fogbow::light::{Falloff, Source};
use fogbow::math::{Frame, Ray, Symmetric2, Symmetric3, Vec3};
use fogbow::multiple_scatter::Weight;
use fogbow::phase::{self, Deflection, Lobe, Phase};
use fogbow::sampling::distance::truncated_exponential;
use fogbow::sh::{self, expansion, zonal};
use fogbow::single_scatter::{self, Contribution, Sums};
use fogbow::spectrum::{Gradient, Spectrum};
use fogbow::transmittance::thickness::{Marching, Steps, optical_thickness_with_gradients};
use fogbow::vpl::{self, Bound, Receiver, VirtualLight};

use crate::hosts::{Analytic, Field};

/// The folder named by `FOGBOW_GOLDEN_DIR`, else the repository's own. A relative name counts from
/// where the command was typed if that is this package or the repository's top.
#[must_use]
pub fn folder() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    match std::env::var_os("FOGBOW_GOLDEN_DIR").map(PathBuf::from) {
        None => package.join("golden"),
        Some(named) if named.is_dir() => named,
        Some(named) => package.join("..").join(named),
    }
}

/// A golden file.
#[derive(Debug, serde::Deserialize)]
pub struct File {
    /// What the vectors are about.
    pub topic: String,
    /// The vectors.
    pub cases: Vec<Case>,
}

/// One vector.
#[derive(Debug, serde::Deserialize)]
pub struct Case {
    /// Name, for messages only.
    pub id: String,
    /// Inputs.
    #[serde(rename = "in")]
    pub input: Map<String, Value>,
    /// Outputs expected.
    #[serde(rename = "out")]
    pub output: Map<String, Value>,
    /// Absolute tolerance per output.
    pub tol: Map<String, Value>,
}

/// Every golden file in `folder`, by name.
///
/// # Panics
/// Where the folder or a file in it cannot be read: a test must not pass for want of data.
#[must_use]
pub fn files(folder: &Path) -> Vec<(PathBuf, File)> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut paths: Vec<_> = entries.map(|e| e.unwrap().path()).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e == "json"));
    paths.sort();
    assert!(!paths.is_empty(), "no golden files in {}", folder.display());
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let file = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        (path, file)
    };
    paths.into_iter().map(read).collect()
}

/// What is wrong with a case: empty if all is well.
#[must_use]
pub fn failures(case: &Case, got: &Value) -> Vec<String> {
    let mut out = Vec::new();
    for (key, expected) in &case.output {
        let Some(value) = got.get(key) else {
            out.push(format!("{}: no output {key:?}", case.id));
            continue;
        };
        let tolerance = case.tol.get(key).and_then(Value::as_f64);
        compare(&format!("{}: {key}", case.id), expected, value, tolerance, &mut out);
    }
    out
}

fn compare(at: &str, expected: &Value, got: &Value, tolerance: Option<f64>, out: &mut Vec<String>) {
    match (expected, got) {
        (Value::Null, Value::Null) => {}
        (Value::Number(e), Value::Number(g)) => {
            let (e, g) = (e.as_f64().unwrap_or(f64::NAN), g.as_f64().unwrap_or(f64::NAN));
            let Some(tolerance) = tolerance else {
                out.push(format!("{at}: a number without a tolerance"));
                return;
            };
            // Written so that NaN fails.
            if !((e - g).abs() <= tolerance) {
                let excess = (e - g).abs() / tolerance;
                out.push(format!("{at}: expected {e:e}, got {g:e}: {excess:.2} tolerances off"));
            }
        }
        (Value::Array(e), Value::Array(g)) if e.len() == g.len() => {
            for (i, (e, g)) in e.iter().zip(g).enumerate() {
                compare(&format!("{at}[{i}]"), e, g, tolerance, out);
            }
        }
        (Value::Object(e), Value::Object(g)) => {
            for (key, e) in e {
                compare(&format!("{at}.{key}"), e, g.get(key).unwrap_or(&Value::Bool(false)), tolerance, out);
            }
        }
        _ => out.push(format!("{at}: expected {expected}, got {got}")),
    }
}

/// The outputs of `topic` for `input`; `None` if the topic is unknown.
#[must_use]
pub fn outputs(topic: &str, input: &Map<String, Value>) -> Option<Value> {
    let input = Input(input);
    Some(match topic {
        "phase" => phase_value(&input),
        "phase_sampling" => phase_sampling(&input),
        "phase_gradient" => phase_gradient(&input),
        "geometry_gradients" => geometry_gradients(&input),
        "transmittance_gradients" => transmittance_gradients(&input),
        "single_scattering" => single_scattering(&input),
        "multiple_scattering_gradient" => multiple_scattering(&input),
        "sh_basis" => sh_basis(&input),
        "sh_phase" => sh_phase(&input),
        "truncated_exponential" => truncated(&input),
        "valid_radius" => radius(&input),
        "extrapolation" => extrapolation(&input),
        "covariance_ops" => covariance_operator(&input),
        "hg_covariance" => phase_hessians(&input),
        "image_covariance" => image_covariance(&input),
        "sampling_metrics" => sampling_metrics(&input),
        "scattering_covariance" => scattering_covariance(&input),
        "volumetric_covariance" => volumetric_covariance(&input),
        "bias_compensation" => bias_compensation(&input),
        "vpl" => virtual_light(&input),
        _ => return None,
    })
}

/// Reads inputs; all of them are exact in binary32.
struct Input<'a>(&'a Map<String, Value>);

impl<'a> Input<'a> {
    fn get(&self, key: &str) -> &'a Value {
        self.0.get(key).unwrap_or_else(|| panic!("no input {key:?} in {:?}", self.0))
    }
    fn number(&self, key: &str) -> f32 {
        self.get(key).as_f64().unwrap_or_else(|| panic!("{key:?} is no number")) as f32
    }
    fn count(&self, key: &str) -> usize {
        self.get(key).as_u64().unwrap_or_else(|| panic!("{key:?} is no count")) as usize
    }
    fn text(&self, key: &str) -> &'a str {
        self.get(key).as_str().unwrap_or_else(|| panic!("{key:?} is no text"))
    }
    fn object(&self, key: &str) -> Input<'a> {
        Input(self.get(key).as_object().unwrap_or_else(|| panic!("{key:?} is no object")))
    }
    fn objects(&self, key: &str) -> impl Iterator<Item = Input<'a>> {
        let list = self.get(key).as_array().unwrap_or_else(|| panic!("{key:?} is no list"));
        list.iter().map(|v| Input(v.as_object().expect("an object")))
    }
    fn doubles(&self, key: &str) -> [f64; 3] {
        let list = self.get(key).as_array().unwrap_or_else(|| panic!("{key:?} is no list"));
        assert_eq!(list.len(), 3, "{key:?} is no vector");
        [0, 1, 2].map(|i| list[i].as_f64().expect("a number"))
    }
    fn array<const N: usize>(&self, key: &str) -> [f32; N] {
        let list = self.get(key).as_array().unwrap_or_else(|| panic!("{key:?} is no list"));
        assert_eq!(list.len(), N, "{key:?} has another length");
        core::array::from_fn(|i| list[i].as_f64().expect("a number") as f32)
    }
    fn symmetric2(&self, key: &str) -> Symmetric2 {
        let [xx, xy, yy] = self.array(key);
        Symmetric2 { xx, xy, yy }
    }
    fn symmetric3(&self, key: &str) -> Symmetric3 {
        Symmetric3::from_upper(self.array(key))
    }
    fn symmetric4(&self, key: &str) -> Symmetric4 {
        Symmetric4::from_upper(self.array(key))
    }
    /// A frame from its third axis and, made orthogonal to it, its first.
    fn frame(&self) -> Frame {
        let w = self.direction("w");
        let u = self.direction("u");
        let u = (u - w * u.dot(w)).normalize();
        Frame { u, v: w.cross(u), w }
    }
    fn vector(&self, key: &str) -> Vec3 {
        Vec3::from(self.doubles(key).map(|c| c as f32))
    }
    fn colour(&self, key: &str) -> Spectrum {
        Spectrum(self.doubles(key).map(|c| c as f32))
    }
    /// A vector per channel.
    fn slope(&self, key: &str) -> Gradient {
        let list = self.get(key).as_array().unwrap_or_else(|| panic!("{key:?} is no list"));
        let channel = |c: usize| {
            let component = |i: usize| list[c][i].as_f64().expect("a number") as f32;
            Vec3::new(component(0), component(1), component(2))
        };
        Gradient::from_channels(channel(0), channel(1), channel(2))
    }
    /// Normalised on input, once, in `f64`.
    fn direction(&self, key: &str) -> Vec3 {
        let v = self.doubles(key);
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        Vec3::from(v.map(|c| (c / length) as f32))
    }
    fn lobe(&self) -> Lobe {
        let g = self.number("g");
        match self.text("model") {
            "hg" => Lobe::HenyeyGreenstein { g },
            "schlick" => Lobe::Schlick { k: g },
            model => panic!("unknown phase function {model:?}"),
        }
    }
    fn field(&self) -> Field {
        let a = self.number("a");
        match self.text("type") {
            "homogeneous" => Field::Homogeneous { a },
            "linear" => Field::Linear { a, b: self.vector("b") },
            "exponential" => Field::Exponential { a, b: self.vector("b") },
            "gaussian" => Field::Gaussian { a, k: self.number("k"), c: self.vector("c"), s: self.number("s") },
            kind => panic!("unknown medium {kind:?}"),
        }
    }
    fn source(&self) -> Source {
        let value = self.number("value");
        let (weight, falloff) = match self.text("type") {
            "uniform" => (value, Falloff::Uniform),
            "phong" => (value, Falloff::Phong { exponent: self.number("s") }),
            "area" => (value / self.number("pdf"), Falloff::Area),
            kind => panic!("unknown light {kind:?}"),
        };
        let normal = if falloff == Falloff::Uniform { Vec3::Z } else { self.direction("n") };
        Source { position: self.vector("pos"), normal, weight: Spectrum::splat(weight), falloff }
    }
}

/// Composite Gauss–Legendre quadrature: what a golden "exact" is compared with.
const EXACT: Marching = Marching { steps: Steps::Gauss(16), offset: 0.0 };

fn vector(v: Vec3) -> Value {
    json!([v.x, v.y, v.z])
}

fn gradient(g: &Gradient) -> Value {
    vector(g.channel(0))
}

fn phase_value(input: &Input<'_>) -> Value {
    let deflection = Deflection::from_cos(input.number("cos"));
    let lobe = input.lobe();
    json!({ "p": lobe.value(deflection), "dp_dcos": lobe.derivative(deflection) })
}

fn phase_sampling(input: &Input<'_>) -> Value {
    let sample = input.lobe().sample(input.number("xi"));
    json!({ "cos": sample.deflection.cos, "pdf": sample.pdf })
}

fn phase_gradient(input: &Input<'_>) -> Value {
    let (phase, to_eye) = (Phase::from(input.lobe()), input.direction("w"));
    let ray = Ray::between(input.vector("x"), input.vector("xp"));
    let deflection = phase::deflection(ray.direction, to_eye);
    json!({
        "cos": deflection.cos,
        "grad_cos": vector(phase::deflection_gradient(ray.direction, to_eye, ray.length)),
        "p": phase.value(deflection)[0],
        "grad_p": gradient(&phase.gradient(ray.direction, to_eye, ray.length)),
    })
}

fn geometry_gradients(input: &Input<'_>) -> Value {
    let (x, exponent) = (input.vector("x"), input.number("s"));
    let (position, normal) = (input.vector("xp"), input.direction("n"));
    let [uniform, area, phong] = [Falloff::Uniform, Falloff::Area, Falloff::Phong { exponent }].map(|falloff| {
        let source = Source { position, normal, weight: Spectrum::ONE, falloff };
        source.geometry(x).map_or((Value::Null, Value::Null), |h| (json!(h.value), vector(h.gradient)))
    });
    json!({
        "h_uniform": uniform.0, "grad_uniform": uniform.1,
        "h_area": area.0, "grad_area": area.1,
        "h_phong": phong.0, "grad_phong": phong.1,
    })
}

fn transmittance_gradients(input: &Input<'_>) -> Value {
    let medium = Analytic::grey(input.object("medium").field(), 1.0);
    let ray = Ray::between(input.vector("x"), input.vector("xp"));
    let steps = Steps::Count(input.count("steps") as u32);
    let mut out = Map::new();
    for (name, marching) in [("exact", EXACT), ("march", Marching { steps, offset: input.number("xi") })] {
        let tau = optical_thickness_with_gradients(&ray, &medium, marching);
        let t = tau.transmittance();
        for (key, value) in [
            ("tau", json!(tau.value[0])),
            ("grad_tau_fixed", gradient(&tau.gradient_fixed)),
            ("grad_tau_joint", gradient(&tau.gradient_joint)),
            ("T", json!(t.value[0])),
            ("grad_T_fixed", gradient(&t.gradient_fixed)),
            ("grad_T_joint", gradient(&t.gradient_joint)),
        ] {
            out.insert(format!("{key}_{name}"), value);
        }
    }
    Value::Object(out)
}

/// Sums over the lights of a case at `x` towards `to_eye`.
fn lights(input: &Input<'_>, medium: &Analytic, phase: &Phase, x: Vec3, to_eye: Vec3) -> Sums {
    let mut sums = Sums::default();
    for light in input.objects("lights") {
        let contribution = single_scatter::connect(x, to_eye, phase, medium, &light.source(), EXACT);
        sums.add(&contribution, light.get("visible").as_bool().expect("true or false"));
    }
    sums
}

fn single_scattering(input: &Input<'_>) -> Value {
    let medium = Analytic::grey(input.object("medium").field(), 1.0);
    let phase = Phase::from(input.lobe());
    let sums = lights(input, &medium, &phase, input.vector("x"), input.direction("w"));
    json!({
        "L": sums.value[0],
        "grad": gradient(&sums.gradient),
        "sum_grad_norm": sums.gradient_norms[0],
        "L_unshadowed": sums.unshadowed[0],
        "sum_grad_norm_unshadowed": sums.unshadowed_gradient_norms[0],
    })
}

fn multiple_scattering(input: &Input<'_>) -> Value {
    use fogbow::host::Medium;
    let medium = Analytic::grey(input.object("medium").field(), input.number("albedo"));
    let phase = Phase::from(input.lobe());
    let (x, mut to_eye) = (input.vector("x"), input.direction("w"));
    let (mut previous, mut weight) = (x, Weight::ONE);
    let (mut total, mut vertices) = (Contribution::ZERO, Vec::new());
    for step in input.objects("path") {
        let vertex = x + step.vector("offset");
        let ray = Ray::between(previous, vertex);
        let kappa = phase.value(phase::deflection(ray.direction, to_eye)) * step.number("inv_pdf");
        let tau = optical_thickness_with_gradients(&ray, &medium, EXACT);
        let scattering = medium.properties(vertex).scattering;
        let slope = medium.gradients(vertex).scattering;
        weight = weight.advance(kappa, tau.value.transmitted(), &tau.gradient_joint, scattering, &slope);
        to_eye = -ray.direction;
        let sums = lights(input, &medium, &phase, vertex, to_eye);
        total += weight.carry(&Contribution { radiance: sums.value, gradient: sums.gradient });
        vertices.push(json!({
            "throughput": weight.value[0],
            "grad_throughput": gradient(&weight.gradient),
            "L_s": sums.value[0],
            "grad_L_s": gradient(&sums.gradient),
        }));
        previous = vertex;
    }
    json!({ "value": total.radiance[0], "grad": gradient(&total.gradient), "vertices": vertices })
}

fn sh_basis(input: &Input<'_>) -> Value {
    // The format fixes degree 4.
    let (mut y, mut slopes) = ([0.0; 25], [Vec3::ZERO; 25]);
    sh::evaluate_with_gradients(input.direction("dir"), 4, &mut y, &mut slopes);
    let mut plain = [0.0; 25];
    sh::evaluate(input.direction("dir"), 4, &mut plain);
    assert_eq!(plain, y, "values differ between the two evaluations");
    json!({ "y": y.to_vec(), "surface_gradient": slopes.map(vector).to_vec() })
}

fn sh_phase(input: &Input<'_>) -> Value {
    let degree = input.count("lmax");
    let moments = single_scatter::moments(&Phase::from(input.lobe()), degree);
    let moments = &moments[..=degree];
    let ray = Ray::between(input.vector("x"), input.vector("xp"));
    let to_eye = input.direction("w");
    let mut coefficients = vec![sh::Coefficient::ZERO; sh::coefficient_count(degree)];
    zonal::coefficients_with_gradients(moments, -ray.direction, ray.length, |k, value, gradient| {
        coefficients[k] = sh::Coefficient { value, gradient };
    });
    let (value, slope) = expansion::value_with_gradient(&coefficients, to_eye);
    json!({
        "f": moments.iter().map(|f| f[0]).collect::<Vec<_>>(),
        "coeff": coefficients.iter().map(|c| c.value[0]).collect::<Vec<_>>(),
        "grad_coeff": coefficients.iter().map(|c| gradient(&c.gradient)).collect::<Vec<_>>(),
        "p_truncated": value[0],
        "grad_p_truncated": gradient(&slope),
    })
}

fn truncated(input: &Input<'_>) -> Value {
    let sample = truncated_exponential(input.number("xi"), input.number("sigma"), input.number("d"));
    json!({ "t": sample.distance, "pdf": sample.pdf, "weight": sample.weight })
}

fn bias_compensation(input: &Input<'_>) -> Value {
    let bound = Bound::new(input.number("bound")).expect("a positive bound");
    let (r, extinction) = (input.number("r"), input.number("sigma_t"));
    let cosines = input.number("cos_x").max(0.0) * input.number("cos_y").max(0.0);
    let geometry = vpl::geometry(r * r, cosines);
    json!({
        "G": geometry,
        "G_clamped": bound.clamped(geometry),
        "B": bound.missing(r * r, cosines),
        "d": bound.radius(),
        "kappa_B": vpl::contraction(extinction, input.number("albedo"), bound.radius()),
    })
}

fn virtual_light(input: &Input<'_>) -> Value {
    let bound = Bound::new(input.number("bound")).expect("a positive bound");
    let (extinction, scattering) = (input.number("sigma_t"), input.number("sigma_s"));
    let phase = Phase::from(Lobe::HenyeyGreenstein { g: input.number("g") });
    let flux = Spectrum::splat(input.number("beta")) * scattering;
    let light = VirtualLight::in_medium(input.vector("v"), input.direction("w_in"), flux, 1, &phase);
    let properties = Properties { scattering: Spectrum::splat(scattering), phase, ..Properties::VACUUM };
    let receiver = Receiver::in_medium(input.vector("y"), input.direction("w"), &properties);
    let connection = receiver.and_then(|receiver| light.connect(&receiver));
    let seen = |bound: Bound| {
        connection.map_or(0.0, |c| c.radiance(bound, Spectrum::splat(extinction * c.way.length).transmitted())[0])
    };
    let distance = input.number("t");
    let missing = connection.map_or(0.0, |c| bound.missing(c.way.length * c.way.length, 1.0));
    json!({
        "unclamped": seen(Bound::NONE),
        "clamped": seen(bound),
        "missing": seen(Bound::NONE) * missing,
        "weight": scattering
            * truncated_exponential(0.0, extinction, bound.radius()).weight
            * bound.missing(distance * distance, 1.0),
    })
}

fn radius(input: &Input<'_>) -> Value {
    let mut sums = Sums::default();
    for sample in input.objects("samples") {
        let contribution = Contribution { radiance: sample.colour("L"), gradient: sample.slope("grad") };
        sums.add(&contribution, sample.get("visible").as_bool().expect("true or false"));
    }
    let raw = valid_radius(&sums, input.number("eps"));
    let limits = Limits { min: input.number("r_min"), max: input.number("r_max") };
    json!({ "raw": raw, "radius": limits.clamp(raw) })
}

fn extrapolation(input: &Input<'_>) -> Value {
    let x = input.vector("x");
    // The vectors stay below the least limit of exponents.
    let mut blend = Blend::new(Extrapolation::Exponential, exponent_limit(0.0));
    for entry in input.objects("entries") {
        let offset = x - entry.vector("x");
        let d = 1.0 - offset.length() / entry.number("r");
        if d > 0.0 {
            blend.add(weight(d), entry.colour("L"), &entry.slope("grad"), offset);
        }
    }
    json!({ "weight": blend.weight(), "L": blend.value().map(|l| l.0) })
}

fn covariance_operator(input: &Input<'_>) -> Value {
    let sigma = input.symmetric4("sigma");
    let out = match input.text("op") {
        "travel" => sigma.travelled(input.number("d")),
        "occlude" => sigma.masked(&input.symmetric2("o")),
        "brdf" => sigma.reflected_in_lobe(&input.symmetric2("b")),
        "rotate" => {
            let (sin, cos) = f64::from(input.number("phi")).sin_cos();
            sigma.rotated(cos as f32, sin as f32)
        }
        "scale" => sigma.scaled(input.array("lambda")),
        "project_in" => sigma.projected(input.number("cos")),
        "project_out" => sigma.unprojected(input.number("cos")),
        "curvature" => sigma.curved(&input.symmetric2("k"), input.number("cos")),
        "attenuate" => sigma.attenuated(&input.symmetric2("hessian"), input.number("dt")),
        "combine" => sigma.combined(input.number("i1"), &input.symmetric4("sigma2"), input.number("i2")),
        "slice_spatial" => {
            let s = sigma.slice();
            return json!({ "cov2": [s.xx, s.xy, s.yy] });
        }
        op => panic!("unknown operator {op:?}"),
    };
    json!({ "sigma_out": out.to_upper() })
}

fn phase_hessians(input: &Input<'_>) -> Value {
    let phase = Phase::from(input.lobe());
    let deflection = Deflection::from_cos(input.number("cos_alpha"));
    let (h11, h22) = covariance::phase_hessian(&phase, deflection);
    let sigma = covariance::phase_covariance(&phase, deflection);
    json!({ "h11": h11, "h22": h22, "sigma_rho": [sigma.xx, sigma.xy, sigma.yy] })
}

fn scattering_covariance(input: &Input<'_>) -> Value {
    let out = input.symmetric4("sigma").scattered(input.number("cos_alpha"), &input.symmetric2("sigma_rho"));
    json!({ "sigma_out": out.to_upper() })
}

fn volumetric_covariance(input: &Input<'_>) -> Value {
    let mut voxel = Voxel::EMPTY;
    for ray in input.objects("rays") {
        voxel.add(&LightField { covariance: ray.symmetric4("sigma"), frame: ray.frame() }, ray.number("intensity"));
    }
    json!({ "gamma": voxel.covariance().map(Symmetric3::to_upper), "weight": voxel.weight })
}

fn sampling_metrics(input: &Input<'_>) -> Value {
    let (gamma, w) = (input.symmetric3("gamma"), input.direction("w"));
    let trace = gamma.trace();
    json!({
        "v": gamma.along(w),
        "trace": trace,
        "step": covariance::step(&gamma, w, input.number("step_min"), input.number("step_max")),
        "r_sigma": covariance::kernel_radius(
            trace,
            input.number("rel_bias"),
            input.number("kernel_a"),
            input.number("r_max"),
        ),
    })
}

fn image_covariance(input: &Input<'_>) -> Value {
    let mut image = ImageCovariance::new(input.frame());
    let frame = input.frame();
    for segment in input.objects("segments") {
        // The vectors give the Hessian across the ray.
        let hessian = Symmetric3::embedded(&segment.symmetric2("hessian"), frame.u, frame.v);
        let (t, dt, k) = (segment.number("t"), segment.number("dt"), segment.number("k"));
        image.add(t, dt, k, &segment.symmetric3("gamma"), Some(&hessian));
    }
    let angular = image.angular();
    json!({
        "sigma": image.value().map(Symmetric4::to_upper),
        "sqrt_det_angular": angular.map(|p| covariance::sample_density(&p)),
        "filter": angular.map(|p| {
            let filter = covariance::filter_precision(&p);
            [filter.xx, filter.xy, filter.yy]
        }),
    })
}
