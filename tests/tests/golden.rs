//! Golden vectors, from `tests/golden` or the folder named by `FOGBOW_GOLDEN_DIR`.

use fogbow_tests::golden;

#[test]
fn golden_vectors_hold() {
    let folder = golden::folder();
    let mut failures = Vec::new();
    for (path, file) in golden::files(&folder) {
        let topic = file.topic.as_str();
        let before = failures.len();
        for case in &file.cases {
            match golden::outputs(topic, &case.input) {
                Some(got) => failures.extend(golden::failures(case, &got)),
                None => {
                    failures.push(format!("{}: unknown topic {topic:?}", path.display()));
                    break;
                }
            }
        }
        println!("{topic}: {} cases, {} mismatches", file.cases.len(), failures.len() - before);
    }
    assert!(failures.is_empty(), "{} golden mismatches:\n{}", failures.len(), failures.join("\n"));
}

/// The comparison itself: every output of every topic, moved by three tolerances, must
/// be noticed.
#[test]
fn golden_comparison_notices_a_wrong_output() {
    for (_, file) in golden::files(&golden::folder()) {
        let Some(case) = file.cases.first() else { continue };
        let Some(got) = golden::outputs(&file.topic, &case.input) else { continue };
        for key in case.output.keys() {
            let Some(tolerance) = case.tol.get(key).and_then(|t| t.as_f64()) else { continue };
            let mut wrong = got.clone();
            shift(&mut wrong[key], 3.0 * tolerance);
            assert!(!golden::failures(case, &wrong).is_empty(), "{}: {key} may be anything", case.id);
        }
    }
}

/// Adds `by` to the first number.
fn shift(value: &mut serde_json::Value, by: f64) -> bool {
    use serde_json::Value;
    match value {
        Value::Number(n) => {
            *value = Value::from(n.as_f64().unwrap() + by);
            true
        }
        Value::Array(list) => list.iter_mut().any(|v| shift(v, by)),
        Value::Object(map) => map.values_mut().any(|v| shift(v, by)),
        _ => false,
    }
}
