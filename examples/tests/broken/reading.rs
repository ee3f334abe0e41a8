//! Scenes as others write them: several files, parameters, references, old syntax, all that is wrong at once.

use fogbow_examples::filter::Filter;
use fogbow_examples::scene_file::{
    Emitter, Findings, FovAxis, Geometry, NoteKind, Projection, ReadOptions, SceneFile, fingerprint, fingerprint_with,
};
use fogbow_examples::transform::Transform;

use super::common::Folder;

const HEAD: &str = r#"<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/></sensor>"#;

fn read(folder: &Folder, text: &str, options: &ReadOptions) -> Findings {
    SceneFile::parse_with(&folder.path("scene.xml"), text, options)
}

fn scene(folder: &Folder, text: &str) -> SceneFile {
    read(folder, text, &ReadOptions::default()).into_scene().unwrap()
}

fn reasons(findings: &Findings) -> String {
    findings.errors.iter().map(|e| format!("{e}\n")).collect()
}

#[test]
fn files_parameters_folders_and_aliases_become_one_scene() {
    let folder = Folder::new("include");
    std::fs::create_dir_all(folder.path("parts/deep")).unwrap();
    folder.write(
        "parts/shapes.xml",
        br#"<scene version="3.0.0"><path value="deep"/><default name="radius" value="9"/><default name="colour" value="0.25"/>
        <bsdf type="diffuse" id="matt"><rgb name="reflectance" value="$colour"/></bsdf><alias id="matt" as="wall"/>
        <include filename="ball.xml"/></scene>"#,
    );
    folder.write(
        "parts/deep/ball.xml",
        br#"<shape version="3.0.0" type="sphere"><float name="radius" value="$radius"/><ref id="wall"/></shape>"#,
    );
    let text = format!(
        r#"{HEAD}<default name="radius" value="2"/><path value="parts"/><include filename="shapes.xml"/>
        <shape type="sphere"><float name="radius" value="$late"/><ref id="wall"/></shape><default name="late" value="3"/></scene>"#
    );
    let radii = |scene: &SceneFile| -> Vec<f64> {
        let radius = |g: &Geometry| if let Geometry::Sphere { radius, .. } = g { *radius } else { f64::NAN };
        scene.shapes.iter().map(|s| radius(&s.geometry)).collect()
    };
    let found = read(&folder, &text, &ReadOptions::default());
    assert!(found.notes.iter().any(|n| n.to_string().contains("further down")), "{:?}", found.notes);
    let plain = found.into_scene().unwrap();
    // The first default counts, as in Mitsuba.
    assert_eq!(radii(&plain), [2.0, 3.0]);
    assert_eq!(plain.shapes[0].material, plain.shapes[1].material);
    let options = ReadOptions { parameters: vec![("radius".to_owned(), "4".to_owned())], ..ReadOptions::default() };
    assert_eq!(radii(&read(&folder, &text, &options).into_scene().unwrap()), [4.0, 3.0]);
    // The same light or not.
    folder.write("scene.xml", text.as_bytes());
    let file = folder.path("scene.xml");
    let first = fingerprint(&file).unwrap();
    assert_ne!(fingerprint_with(&file, &options).unwrap(), first);
    folder.write("parts/deep/ball.xml", br#"<shape version="3.0.0" type="cube"><ref id="wall"/></shape>"#);
    assert_ne!(fingerprint(&file).unwrap(), first);
}

#[test]
fn everything_that_is_wrong_is_told_at_once() {
    let folder = Folder::new("at-once");
    let text = format!(
        r#"{HEAD}
<include filename="none.xml"/>
<bsdf type="mirage" id="odd"/>
<shape type="sphere"><ref id="odd"/><float name="radus" value="1"/><float name="x" value="1"/></shape>
<shape type="ball"/>
<shape type="cube"><ref id="gone"/></shape>
<emitter type="point"><rgb name="intensity" value="-1"/></emitter>
<surprise/>
</scene>"#
    );
    let found = read(&folder, &text, &ReadOptions::default());
    assert!(found.scene.is_none());
    let said = reasons(&found);
    for (line, mention) in [
        (2, "none.xml"),
        (3, "mirage"),
        (4, "\"radus\" (is \"radius\" meant?)"),
        (4, "\"x\""),
        (5, "unknown type \"ball\""),
        (6, "nothing has the id \"gone\""),
        (7, "negative"),
        (8, "<surprise>"),
    ] {
        let is_told = |l: &str| l.contains(&format!("scene.xml:{line}:")) && l.contains(mention);
        assert!(said.lines().any(is_told), "line {line}, {mention}:\n{said}");
    }
}

#[test]
fn circles_of_files_and_references_are_errors() {
    let folder = Folder::new("circles");
    folder.write("self.xml", br#"<scene version="3.0.0"><include filename="self.xml"/></scene>"#);
    let found = read(&folder, &format!(r#"{HEAD}<include filename="self.xml"/></scene>"#), &ReadOptions::default());
    assert!(reasons(&found).contains("more than 15 deep"), "{}", reasons(&found));
    let round = format!(
        r#"{HEAD}<bsdf type="twosided" id="a"><ref id="b"/></bsdf><bsdf type="twosided" id="b"><ref id="a"/></bsdf></scene>"#
    );
    let found = read(&folder, &round, &ReadOptions::default());
    assert!(reasons(&found).contains("leads back to itself"), "{}", reasons(&found));
}

#[test]
fn shadows_of_bumps_that_are_not_cast_are_told_of() {
    let folder = Folder::new("bumps");
    let notes = |inside: &str| {
        let text = format!(
            r#"{HEAD}<shape type="rectangle"><bsdf type="bumpmap">{inside}<texture type="checkerboard"/><bsdf type="diffuse"/></bsdf></shape></scene>"#
        );
        let found = read(&folder, &text, &ReadOptions::default());
        assert_eq!(reasons(&found), "");
        let about =
            |n: &&fogbow_examples::scene_file::Note| n.text.reason.contains("use_shadowing_function has no effect");
        found.notes.iter().filter(about).count()
    };
    assert_eq!(notes(""), 1);
    assert_eq!(notes(r#"<boolean name="use_shadowing_function" value="false"/>"#), 0);
}

#[test]
fn what_is_missing_is_replaced_by_leave_alone() {
    let folder = Folder::new("lenient");
    let text = format!(
        r#"{HEAD}<integrator type="oracle"/><emitter type="constant"><float name="warmth" value="3"/></emitter>
        <emitter type="sunsky"/></scene>"#
    );
    let strict = read(&folder, &text, &ReadOptions::default());
    assert_eq!(strict.errors.len(), 3, "{}", reasons(&strict));
    assert!(strict.errors.iter().all(|e| e.reason.contains("--lenient: ")), "{}", reasons(&strict));
    let lenient = read(&folder, &text, &ReadOptions { is_lenient: true, ..ReadOptions::default() });
    let replaced = lenient.notes.iter().filter(|n| n.kind == NoteKind::Replaced).count();
    assert_eq!((replaced, reasons(&lenient).as_str()), (3, ""));
    assert!(matches!(lenient.into_scene().unwrap().emitters[..], [Emitter::Constant { .. }]));
    let text = format!(
        r#"{HEAD}<emitter type="constant"/><shape type="blob"/><shape type="sphere"><bsdf type="velvet"/></shape></scene>"#
    );
    assert_eq!(read(&folder, &text, &ReadOptions::default()).errors.len(), 2);
    let lenient = read(&folder, &text, &ReadOptions { is_lenient: true, ..ReadOptions::default() });
    assert_eq!(lenient.notes.len(), 2, "{:?}", lenient.notes);
    assert_eq!(lenient.into_scene().unwrap().shapes.len(), 1);
}

#[test]
fn files_of_version_0_6_are_upgraded() {
    let folder = Folder::new("old");
    let text = r##"<scene version="0.6.0"><integrator type="volpath_simple"><integer name="maxDepth" value="7"/></integrator>
        <sensor type="perspective"><float name="fov" value="30"/><string name="fovAxis" value="smaller"/>
        <transform name="toWorld"><lookAt origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="ldrfilm"><integer name="width" value="32"/><rfilter type="tent"/></film></sensor>
        <shape type="rectangle"><bsdf type="diffuse"><srgb name="reflectance" value="#ffffff"/></bsdf>
        <transform name="toWorld"><translate z="1"/></transform></shape>
        <shape type="rectangle"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">
        <string name="filterType" value="trilinear"/><string name="filename" value="PATTERN"/></texture></bsdf>
        <emitter type="area"><spectrum name="radiance" value="1, 2, 3"/></emitter></shape></scene>"##;
    let pattern = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/shapes/pattern.png");
    let scene = scene(&folder, &text.replace("PATTERN", pattern));
    assert_eq!(scene.integrator.max_depth, Some(7));
    assert_eq!((scene.sensor.fov_axis, scene.sensor.width), (FovAxis::Smaller, 32));
    assert_eq!(scene.sensor.filter, Filter::Tent { radius: 1.0 });
    assert_eq!(scene.sensor.to_world.column(3), [0.0, 0.0, 4.0]);
    assert_eq!(scene.shapes.len(), 2);
}

#[test]
fn pointers_of_git_lfs_are_told_from_what_they_stand_for() {
    let folder = Folder::new("lfs");
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n";
    folder.write("far.obj", pointer.as_bytes());
    let text = r#"<scene version="3.0.0"><shape type="obj"><string name="filename" value="far.obj"/></shape></scene>"#;
    let findings = read(&folder, text, &ReadOptions::default());
    let error = findings.errors[0].to_string();
    assert!(error.contains("far.obj: is a pointer of Git LFS"), "{error}");
}

#[test]
fn sensors_are_chosen_and_stand_somewhere_where_there_is_none() {
    let folder = Folder::new("sensors");
    let text = r#"<scene version="3.0.0"><sensor type="perspective"/><sensor type="orthographic"><film type="hdrfilm">
        <integer name="width" value="40"/><integer name="crop_width" value="10"/><integer name="crop_offset_x" value="20"/></film></sensor></scene>"#;
    // Without an angle, that of 50 mm on the diagonal of 36 mm × 24 mm.
    let usual = scene(&folder, text).sensor;
    assert!((usual.fov - 46.793).abs() < 1e-3 && usual.fov_axis == FovAxis::Diagonal && usual.filter == Filter::USUAL);
    let second = read(&folder, text, &ReadOptions { sensor: 1, ..ReadOptions::default() }).into_scene().unwrap().sensor;
    assert_eq!((second.projection, second.width), (Projection::Parallel, 10));
    assert_eq!(second.window, [[0.5, 0.0], [0.75, 1.0]]);
    let found = read(&folder, text, &ReadOptions { sensor: 2, ..ReadOptions::default() });
    assert!(reasons(&found).contains("no sensor 2"), "{}", reasons(&found));
    // Mitsuba 3.9.1 stands there too: scene.sensors()[0].
    let around = scene(&folder, r#"<scene version="3.0.0"><shape type="sphere"/></scene>"#).sensor;
    let distance = 1.0 / 22.5_f64.to_radians().tan();
    assert!((around.to_world.column(3)[2] + 1.0 + distance).abs() < 1e-6);
    assert_eq!(around.to_world, Transform::translation(around.to_world.column(3)));
}

#[test]
fn what_looks_like_a_mistake_is_told() {
    let folder = Folder::new("suspicions");
    let notes = |body: &str| -> String {
        let found = read(&folder, &format!("{HEAD}{body}</scene>"), &ReadOptions::default());
        assert!(found.scene.is_some(), "{}", reasons(&found));
        found.notes.iter().map(|n| format!("{n}\n")).collect()
    };
    let lamp = r#"<emitter type="point"><point name="position" x="5" y="5" z="5"/></emitter>"#;
    assert!(notes(r#"<shape type="sphere"/>"#).contains("picture will be black"));
    assert_eq!(
        notes(&format!(
            r#"<shape type="cube"><transform name="to_world"><translate z="9"/></transform></shape>{lamp}"#
        )),
        ""
    );
    let hidden = r#"<shape type="sphere"><point name="center" x="5" y="5" z="5"/></shape>"#;
    assert!(notes(&format!("{hidden}{lamp}")).contains("inside the closed body"));
    let tiny = r#"<shape type="sphere"><float name="radius" value="0.00001"/></shape>"#;
    assert!(notes(&format!("{tiny}{lamp}")).contains("units wide"));
    let far = r#"<shape type="sphere"><point name="center" x="90000" y="0" z="0"/></shape>"#;
    assert!(
        read(
            &folder,
            &format!("{HEAD}{far}{lamp}</scene>"),
            &ReadOptions { is_lenient: true, ..ReadOptions::default() }
        )
        .notes
        .iter()
        .any(|n| n.to_string().contains("away from the origin"))
    );
    let fog = |sigma: &str| {
        format!(
            r#"<shape type="cube"><transform name="to_world"><translate z="9"/></transform><bsdf type="null"/>
            <medium name="interior" type="homogeneous"><float name="sigma_t" value="{sigma}"/><float name="albedo" value="1"/></medium></shape>{lamp}"#
        )
    };
    assert!(notes(&fog("1e-6")).contains("cannot be seen"));
    assert!(notes(&fog("1000")).contains("many thousand vertices"));
    assert_eq!(notes(&fog("1")), "");
}
