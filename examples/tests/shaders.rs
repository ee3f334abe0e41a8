//! Shaders that read bakes, and descriptions of bakes, are what they say of each other.

use std::path::PathBuf;

use serde_json::Value;

fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("shaders").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(file(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// What Godot's shading language says otherwise than GLSL: a uniform in each statement, and how it is read.
fn godot(glsl: &str) -> String {
    let (_, rest) = glsl.split_once("#version 300 es").unwrap();
    let (_, rest) = rest.split_once("\n\n").unwrap();
    let mut out = "\
// Light in fog, from what `fogbow bake SCENE.xml --basis sh0|sh1|sh2 -o NAME.exr|NAME.ktx2` writes: fog.glsl in the shading language of Godot 4, written by a test of
// the program (`FOGBOW_WRITE_SHADERS=1 cargo test -p fogbow-examples --test all -- shaders`); change fog.glsl. Godot itself has not been run on it.
//
//     #include \"fog.gdshaderinc\"
//
// With FOG_FILTERED, hardware mixes the probes: a fifth of the time, right where all around are valid and no wall stands between them.

#ifdef FOG_FILTERED
#define FOG_FILTER filter_linear
#else
#define FOG_FILTER filter_nearest
#endif

"
    .to_owned();
    for line in rest.lines() {
        if let Some(names) = line.strip_prefix("uniform sampler3D ") {
            for name in names.trim_end_matches(';').split(", ") {
                out += &format!("uniform sampler3D {name} : FOG_FILTER, repeat_disable;\n");
            }
        } else {
            out += line;
            out += "\n";
        }
    }
    out
}

#[test]
fn godots_shader_is_the_one_for_webgl() {
    let due = godot(&text("fog.glsl"));
    if std::env::var_os("FOGBOW_WRITE_SHADERS").is_some() {
        std::fs::write(file("fog.gdshaderinc"), &due).unwrap();
    }
    assert!(
        text("fog.gdshaderinc") == due,
        "fog.gdshaderinc is not what fog.glsl makes: FOGBOW_WRITE_SHADERS=1 writes it"
    );
    // What Godot has not.
    for word in ["#version", "precision ", "layout(", "gl_"] {
        assert!(!due.contains(word), "{word}");
    }
}

#[test]
fn both_shaders_have_the_same_numbers() {
    // Constants of spherical harmonics and of planes, in the order of their first use.
    let numbers = |source: &str| {
        let code: String = source.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
        let mut all: Vec<String> = code
            .split(|c: char| !(c.is_ascii_digit() || c == '.'))
            .filter(|word| word.contains('.') && word.len() > 5)
            .map(str::to_owned)
            .collect();
        all.sort();
        all.dedup();
        all
    };
    let [wgsl, glsl] = ["fog.wgsl", "fog.glsl"].map(|name| numbers(&text(name)));
    assert!(wgsl.len() >= 5 && wgsl == glsl, "{wgsl:?} {glsl:?}");
}

/// Whether a value is what a schema says, of the words that bake.schema.json has.
///
/// # Panics
/// At words that it has not.
pub(super) fn check(schema: &Value, value: &Value, place: &str) {
    for (word, rule) in schema.as_object().unwrap() {
        match word.as_str() {
            "$schema" | "$id" | "title" | "description" => {}
            "type" => {
                let is = |kind: &str| match kind {
                    "null" => value.is_null(),
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "integer" => value.is_u64() || value.is_i64(),
                    "number" => value.is_number(),
                    other => panic!("{place}: type {other}"),
                };
                let kinds = rule.as_array().cloned().unwrap_or_else(|| vec![rule.clone()]);
                assert!(kinds.iter().any(|kind| is(kind.as_str().unwrap())), "{place}: {value} is no {rule}");
            }
            "const" => assert_eq!(value, rule, "{place}"),
            "enum" => assert!(rule.as_array().unwrap().contains(value), "{place}: {value} is none of {rule}"),
            "required" => {
                for name in rule.as_array().unwrap() {
                    assert!(value.get(name.as_str().unwrap()).is_some() || !value.is_object(), "{place}: no {name}");
                }
            }
            "properties" => {
                for (name, value) in value.as_object().into_iter().flatten() {
                    let rule = rule.get(name).unwrap_or_else(|| panic!("{place}: {name} is not in the schema"));
                    check(rule, value, &format!("{place}/{name}"));
                }
            }
            // That of `properties` above says so.
            "additionalProperties" => assert_eq!(rule, &Value::Bool(false)),
            "items" => value.as_array().into_iter().flatten().for_each(|value| check(rule, value, place)),
            "minItems" => assert!(value.as_array().unwrap().len() as u64 >= rule.as_u64().unwrap(), "{place}"),
            "maxItems" => assert!(value.as_array().unwrap().len() as u64 <= rule.as_u64().unwrap(), "{place}"),
            "minimum" => assert!(value.as_f64().unwrap_or(f64::MAX) >= rule.as_f64().unwrap(), "{place}: {value}"),
            other => panic!("{place}: nobody knows {other}"),
        }
    }
}

/// The schema of descriptions of bakes.
pub(super) fn schema() -> Value {
    serde_json::from_str(&text("bake.schema.json")).unwrap()
}
