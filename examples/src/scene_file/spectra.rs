//! `<spectrum>`: light by wavelength, as the red, green and blue that everything here computes with.
//!
//! What Mitsuba 3 does in its RGB mode: the spectrum, times that of D65 where it says how much of light comes back or is
//! scattered, is weighed with the CIE 1931 colour-matching functions and turned into linear sRGB. A number by itself is grey
//! where light is reflected; as light it is an even spectrum, which is redder than white: (1.205, 0.948, 0.909). Spectra that
//! Mitsuba evaluates in its spectral mode only (`blackbody`, `regular`, `irregular`) are weighed in the same way.

use fogbow::spectrum::Spectrum;

use super::cie::{FIRST, STEP, SUM, TABLE};
use super::element::Element;
use super::plugin::Plugin;
use crate::error::{DataError, SceneError, read_file};

/// What a spectrum says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// How much light there is.
    Light,
    /// How much of the light comes back, or is scattered or absorbed.
    Coefficient,
}

/// The colour of a `<spectrum>`.
pub(super) fn read(element: &Element<'_>, role: Role) -> Result<Spectrum, SceneError> {
    if element.node.has_attribute("type") {
        return read_plugin(element, role);
    }
    element.allow(&["name", "value", "filename"])?;
    element.no_children()?;
    match (element.optional("value"), element.optional("filename")) {
        (Some(_), Some(_)) => Err(element.attribute_error("filename", "cannot stand beside \"value\"")),
        (Some(value), None) if value.contains(':') => Ok(colour(&pairs(element, &value)?, role)),
        (Some(_), None) => Ok(even(element.number("value")?, role)),
        (None, Some(name)) => {
            let file = element.resolve(&name);
            let samples = from_file(&file).map_err(|e| element.attribute_error("filename", e))?;
            Ok(colour(&samples, role))
        }
        (None, None) => Err(element.attribute_error("value", "is missing")),
    }
}

/// `<spectrum type="blackbody">` and its kin.
fn read_plugin(element: &Element<'_>, role: Role) -> Result<Spectrum, SceneError> {
    let plugin = Plugin::new(*element)?;
    let numbers = |name: &str| -> Result<Vec<f64>, SceneError> {
        let (_, source) =
            plugin.string(name)?.ok_or_else(|| element.error(format!("<string name=\"{name}\"> is missing")))?;
        source.numbers("value")
    };
    let scale = plugin.number_in("scale", 1.0, 0.0..=1e30)? as f32;
    let value = match plugin.kind.as_str() {
        // Grey in either role.
        "uniform" => {
            plugin.skip(&["wavelength_min", "wavelength_max"]);
            Spectrum::splat(plugin.number_in("value", 1.0, 0.0..=1e30)? as f32)
        }
        // D65 is the white of sRGB.
        "d65" => {
            let tint = plugin.colour("color")?.map_or(Spectrum::ONE, |(tint, _)| tint);
            tint * plugin.number_in("value", 1.0, 0.0..=1e30)? as f32
        }
        "srgb" => plugin.colour("color")?.map_or(Spectrum::ZERO, |(value, _)| value),
        "blackbody" => {
            let temperature = plugin.number("temperature")?;
            let (kelvin, source) =
                temperature.ok_or_else(|| element.error("<float name=\"temperature\"> is missing"))?;
            if !(1.0..=1e6).contains(&kelvin) {
                return Err(source.attribute_error("value", format!("{kelvin} K is outside [1, 1000000]")));
            }
            plugin.skip(&["wavelength_min", "wavelength_max"]);
            let samples = (0..=470).map(|i| FIRST + f64::from(i)).map(|w| (w, planck(w, kelvin)));
            colour(&samples.collect::<Vec<_>>(), role)
        }
        "regular" => {
            let edge = |name: &str, usual: f64| plugin.number_in(name, usual, 1.0..=1e5);
            let (low, high) = (edge("wavelength_min", FIRST)?, edge("wavelength_max", last())?);
            let values = numbers("values")?;
            let step = (high - low) / (values.len().max(2) - 1) as f64;
            let samples = values.iter().enumerate().map(|(i, value)| (low + step * i as f64, *value)).collect();
            colour(&checked(samples).map_err(|reason| element.error(reason))?, role)
        }
        "irregular" => {
            let (wavelengths, values) = (numbers("wavelengths")?, numbers("values")?);
            if wavelengths.len() != values.len() {
                let reason = format!("{} wavelengths but {} values", wavelengths.len(), values.len());
                return Err(element.error(reason));
            }
            let samples = wavelengths.into_iter().zip(values).collect();
            colour(&checked(samples).map_err(|reason| element.error(reason))?, role)
        }
        _ => return Err(plugin.unknown_type("uniform, d65, srgb, blackbody, regular, irregular")),
    };
    plugin.finish()?;
    let value = value * scale;
    if value.is_finite() { Ok(value) } else { Err(element.error("its colour is not finite")) }
}

/// The same at all wavelengths.
fn even(value: f64, role: Role) -> Spectrum {
    match role {
        Role::Coefficient => Spectrum::splat(value as f32),
        Role::Light => to_rgb([value; 3]),
    }
}

/// The colour of light with these samples: wavelengths (nm) and values.
///
/// # Errors
/// In words: too few, not finite, or wavelengths that do not increase.
pub(super) fn of_light(samples: Vec<(f64, f64)>) -> Result<Spectrum, String> {
    Ok(colour(&checked(samples)?, Role::Light))
}

/// The colour of a black body, with its radiance (W·m⁻²·sr⁻¹·nm⁻¹).
pub(super) fn of_black_body(kelvin: f64) -> Spectrum {
    let samples = (0..=470).map(|i| FIRST + f64::from(i)).map(|w| (w, planck(w, kelvin)));
    colour(&samples.collect::<Vec<_>>(), Role::Light)
}

/// The same, over its greatest radiance at any wavelength: as bright as an even spectrum of 1 at most.
pub(super) fn of_normalized_black_body(kelvin: f64) -> Spectrum {
    /// Wien's displacement (nm·K).
    const PEAK: f64 = 2.897_771_955e6;
    of_black_body(kelvin) * (1.0 / planck(PEAK / kelvin, kelvin)) as f32
}

/// `wavelength:value` pairs.
fn pairs(element: &Element<'_>, text: &str) -> Result<Vec<(f64, f64)>, SceneError> {
    let fail = |reason: String| element.attribute_error("value", reason);
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    let pair = |word: &str| -> Option<(f64, f64)> {
        let (wavelength, value) = word.split_once(':')?;
        Some((wavelength.trim().parse().ok()?, value.trim().parse().ok()?))
    };
    let samples: Result<_, _> =
        words.map(|word| pair(word).ok_or_else(|| fail(format!("\"{word}\" is no pair such as 550:0.3")))).collect();
    checked(samples?).map_err(fail)
}

/// A file of lines with a wavelength (nm) and a value each; `#` starts a comment.
fn from_file(file: &std::path::Path) -> Result<Vec<(f64, f64)>, DataError> {
    let bytes = read_file(file)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut samples = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let mut words = line.split_whitespace().map(|word| word.parse::<f64>().ok());
        match (words.next().flatten(), words.next().flatten(), words.next()) {
            (Some(wavelength), Some(value), None) => samples.push((wavelength, value)),
            _ => return Err(DataError::new(file, format!("line {}", number + 1), "is not a wavelength and a value")),
        }
    }
    checked(samples).map_err(|reason| DataError::new(file, "", reason))
}

fn checked(samples: Vec<(f64, f64)>) -> Result<Vec<(f64, f64)>, String> {
    if samples.len() < 2 {
        return Err("at least two wavelengths are needed".to_owned());
    }
    if let Some((w, v)) = samples.iter().find(|(w, v)| !(w.is_finite() && v.is_finite() && v.abs() < 1e30)) {
        return Err(format!("{w}:{v} is not finite"));
    }
    match samples.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
        Some(pair) => Err(format!("wavelength {} stands after {}: they must increase", pair[1].0, pair[0].0)),
        None => Ok(samples),
    }
}

fn last() -> f64 {
    FIRST + STEP * (TABLE.len() - 1) as f64
}

/// Spectral radiance of a black body (W·m⁻²·sr⁻¹·nm⁻¹) at a wavelength (nm), by Planck's law.
fn planck(wavelength: f64, kelvin: f64) -> f64 {
    const LIGHT: f64 = 2.997_924_58e8;
    const PLANCK: f64 = 6.626_070_15e-34;
    const BOLTZMANN: f64 = 1.380_649e-23;
    let metres = wavelength * 1e-9;
    let exponent = (PLANCK * LIGHT / (metres * BOLTZMANN * kelvin)).exp() - 1.0;
    1e-9 * 2.0 * PLANCK * LIGHT * LIGHT / (metres.powi(5) * exponent)
}

/// The colour of samples at increasing wavelengths, linear between them and 0 beyond.
fn colour(samples: &[(f64, f64)], role: Role) -> Spectrum {
    /// As many as Mitsuba takes: its sums are reproduced to the last figures.
    const STEPS: u32 = 1000;
    let span = last() - FIRST;
    let mut xyz = [0.0; 3];
    let (first, end) = (samples.first().map_or(0.0, |s| s.0), samples.last().map_or(0.0, |s| s.0));
    for step in 0..STEPS {
        let wavelength = FIRST + f64::from(step) / f64::from(STEPS - 1) * span;
        if !(first..=end).contains(&wavelength) {
            continue;
        }
        let after = samples.partition_point(|(w, _)| *w <= wavelength).clamp(1, samples.len() - 1);
        let ((w0, v0), (w1, v1)) = (samples[after - 1], samples[after]);
        let mut value = v0 + (v1 - v0) * (wavelength - w0) / (w1 - w0);
        let place = (wavelength - FIRST) / STEP;
        let row = (place as usize).min(TABLE.len() - 2);
        let between = |column: usize| {
            let (low, high) = (TABLE[row][column], TABLE[row + 1][column]);
            low + (high - low) * (place - row as f64)
        };
        if role == Role::Coefficient {
            value *= between(3);
        }
        for (axis, sum) in xyz.iter_mut().enumerate() {
            *sum += value * between(axis) / SUM * span / f64::from(STEPS);
        }
    }
    to_rgb(xyz)
}

/// Linear sRGB of a colour of the CIE; what lies outside of it is cut off at 0.
fn to_rgb(xyz: [f64; 3]) -> Spectrum {
    const ROWS: [[f64; 3]; 3] =
        [[3.240_479, -1.537_150, -0.498_535], [-0.969_256, 1.875_991, 0.041_556], [0.055_648, -0.204_043, 1.057_311]];
    Spectrum(ROWS.map(|row| (row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]).max(0.0) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(value: Spectrum, due: [f64; 3]) {
        for (value, due) in value.0.iter().zip(due) {
            // Six figures are given, the last of them rounded.
            assert!((f64::from(*value) - due).abs() < 5e-6 * due.abs().max(1.0), "{value} and not {due}");
        }
    }

    /// Values of Mitsuba 3.9.1, `scalar_rgb`: `intensity` of a point light, `reflectance` of a diffuse surface.
    #[test]
    fn colours_are_those_of_mitsuba() {
        let ramp = [(400.0, 0.0), (500.0, 8.0), (600.0, 15.6), (700.0, 18.4)];
        let red = [(400.0, 0.04), (500.0, 0.1), (600.0, 0.287), (700.0, 0.642)];
        close(even(1.0, Role::Light), [1.204_79, 0.948_291, 0.908_916]);
        close(even(0.4, Role::Coefficient), [0.4; 3]);
        close(colour(&ramp, Role::Light), [20.7108, 10.8546, 2.771_15]);
        close(colour(&ramp, Role::Coefficient), [17.7147, 11.3544, 3.304_51]);
        close(colour(&red, Role::Coefficient), [0.403_376, 0.172_761, 0.054_826_5]);
        close(colour(&[(400.0, 1.0), (700.0, 1.0)], Role::Coefficient), [0.995_342, 0.999_756, 0.994_909]);
        close(colour(&[(360.0, 1.0), (830.0, 1.0)], Role::Coefficient), [0.998_985, 0.998_874, 0.998_802]);
    }

    /// Mitsuba's `blackbody` of `scalar_spectral` at 560 nm, and its values every 2 nm weighed in the same way, in Python.
    #[test]
    fn black_bodies_glow_as_in_mitsuba() {
        for (kelvin, at_560, due) in [
            (2800.0, 223.872_18, [425.3109, 185.5590, 49.5527]),
            (5000.0, 12_762.176, [15_262.98, 12_082.49, 9_592.47]),
        ] {
            assert!((planck(560.0, kelvin) / at_560 - 1.0).abs() < 1e-5, "{}", planck(560.0, kelvin));
            let samples: Vec<_> = (360..=830).map(f64::from).map(|w| (w, planck(w, kelvin))).collect();
            for (value, due) in colour(&samples, Role::Light).0.iter().zip(due) {
                assert!((f64::from(*value) / due - 1.0).abs() < 1e-4, "{value} and not {due}");
            }
        }
    }
}
