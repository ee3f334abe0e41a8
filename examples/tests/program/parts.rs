//! Pictures in parts: whatever the method, the number of parts, their order and what they are of, merged they are the bits of the whole; and nothing
//! that does not belong to a picture gets into it.

use super::{Folder, SCENE, said};

/// Options of each method, with passes that do not fit the parts; and whether there is something to fill.
const METHODS: [(&[&str], bool); 7] = [
    (&["--method", "path", "--spp", "7", "--aov"], false),
    (&["--method", "radiance-cache", "--error", "0.1", "--spp", "7", "--paths", "16"], true),
    (&["--method", "photon-beams", "--spp", "15", "--pass-samples", "4", "--beams", "500"], false),
    (
        &["--method", "photon-beams", "--spp", "7", "--kernel", "covariance", "--beams", "500", "--grid-paths", "2000"],
        true,
    ),
    (&["--method", "vpl", "--spp", "7", "--pass-samples", "2", "--lights", "32"], false),
    (&["--method", "march", "--spp", "7"], false),
    (&["--method", "march", "--spp", "7", "--step", "covariance", "--grid-paths", "2000"], true),
];

fn done(folder: &Folder, words: &[&str]) {
    let output = folder.run(words);
    assert_eq!(output.status.code(), Some(0), "{words:?}: {}", said(&output));
}

fn read(folder: &Folder, file: &str) -> Vec<u8> {
    std::fs::read(folder.0.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// Renders a part, with more words.
fn part(folder: &Folder, part: &str, file: &str, options: &[&str]) {
    done(folder, &[&["render", SCENE, "--size", "20x12", "-q", "--part", part, "-o", file], options].concat());
}

const FOUR: [&str; 4] = ["p1.fogbow", "p2.fogbow", "p3.fogbow", "p4.fogbow"];

/// Four parts of a small picture by path tracing, and the whole.
fn four(folder: &Folder, options: &[&str]) {
    let path = [&["--method", "path", "--spp", "8"], options].concat();
    let all = ["render", SCENE, "--size", "20x12", "-q", "-o", "whole.pfm", "-o", "whole.fogbow"];
    let whole = path.iter().copied().filter(|word| !["--split", "tiles"].contains(word));
    done(folder, &all.into_iter().chain(whole).collect::<Vec<_>>());
    for (index, file) in FOUR.iter().enumerate() {
        part(folder, &format!("{}/4", index + 1), file, &path);
    }
}

#[test]
fn parts_merge_to_the_bits_of_the_whole_by_every_method() {
    for (options, has_fill) in METHODS {
        let folder = Folder::new("parts-methods");
        let whole = ["render", SCENE, "--size", "20x12", "-q", "-o", "whole.exr", "-o", "whole.fogbow"];
        done(&folder, &[&whole[..], options].concat());
        let mut options = options.to_vec();
        if has_fill {
            let fill = ["fill", SCENE, "--size", "20x12", "-q", "-o", "fill.fogbow"];
            done(&folder, &[&fill[..], &options].concat());
            options.extend(["--fill", "fill.fogbow"]);
        } else {
            let none = folder.run(&[&["fill", SCENE, "-q", "-o", "fill.fogbow"], &options[..]].concat());
            assert!(said(&none).contains("fills nothing"), "{}", said(&none));
        }
        for split in ["samples", "tiles"] {
            let files = ["a.fogbow", "b.fogbow", "c.fogbow"];
            for (index, file) in files.iter().enumerate() {
                let all = [&options[..], &["--split", split, "--threads", "1"]].concat();
                part(&folder, &format!("{}/3", index + 1), file, &all);
            }
            // In another order, and some of them merged before.
            for order in [&["c.fogbow", "a.fogbow", "b.fogbow"][..], &["b.fogbow", "ca.fogbow"]] {
                if order.len() == 2 {
                    let some =
                        folder.run(&["merge", "-q", "c.fogbow", "a.fogbow", "--allow-missing", "-o", "ca.fogbow"]);
                    assert_eq!(some.status.code(), Some(1), "{}", said(&some));
                    assert!(said(&some).contains("part 2 of 3 is missing"), "{}", said(&some));
                }
                done(&folder, &[&["merge", "-q", "-o", "merged.exr", "-o", "merged.fogbow"], order].concat());
                for kind in ["exr", "fogbow"] {
                    let [merged, whole] = ["merged", "whole"].map(|name| read(&folder, &format!("{name}.{kind}")));
                    assert!(merged == whole, "{options:?} {split} {order:?} {kind}");
                }
            }
        }
    }
}

#[test]
fn a_merged_film_is_gone_on_with() {
    let folder = Folder::new("parts-more");
    four(&folder, &[]);
    done(&folder, &[&["merge", "-q", "-o", "kept.fogbow"], &FOUR[..]].concat());
    let render = |file: &str, more: &[&str]| {
        let all = ["render", SCENE, "--size", "20x12", "--method", "path", "--spp", "13", "-q", "-o", file];
        done(&folder, &[&all[..], more].concat());
        read(&folder, file)
    };
    let refined = render("refined.pfm", &["--checkpoint", "kept.fogbow", "--resume"]);
    assert_eq!(refined, render("due.pfm", &[]));
}

/// What is refused, and by which words; then nothing is written, and the others can be merged.
#[test]
fn what_does_not_belong_to_a_picture_is_refused_by_name() {
    let folder = Folder::new("parts-refused");
    four(&folder, &["--split", "tiles"]);
    let other = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/lantern.xml");
    let options = ["--split", "tiles", "--method", "path", "--spp", "8"];
    part(&folder, "2/4", "seed.fogbow", &[&options[..], &["--seed", "1"]].concat());
    part(&folder, "2/4", "spp.fogbow", &["--split", "tiles", "--method", "path", "--spp", "9"]);
    part(&folder, "2/5", "fifth.fogbow", &options);
    part(&folder, "2/4", "samples.fogbow", &["--split", "samples", "--method", "path", "--spp", "8"]);
    let lantern = ["render", other, "--size", "20x12", "-q", "--part", "2/4", "-o", "lantern.fogbow"];
    done(&folder, &[&lantern[..], &options].concat());
    std::fs::copy(folder.0.join("p1.fogbow"), folder.0.join("again.fogbow")).unwrap();
    let bytes = read(&folder, "p2.fogbow");
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.0.join(name), bytes).unwrap();
    write("short.fogbow", &bytes[..bytes.len() - 1]);
    write("head.fogbow", &bytes[..20]);
    write(
        "flipped.fogbow",
        &bytes.iter().enumerate().map(|(i, byte)| byte ^ u8::from(i == bytes.len() / 2)).collect::<Vec<_>>(),
    );
    write(
        "version.fogbow",
        &bytes.iter().enumerate().map(|(i, byte)| if i == 8 { 99 } else { *byte }).collect::<Vec<_>>(),
    );
    write("text.fogbow", b"not a film");
    let three = ["p1.fogbow", "p3.fogbow", "p4.fogbow"];
    for (file, words) in [
        ("seed.fogbow", "was rendered with another seed: 1, not 0"),
        ("spp.fogbow", "was rendered with another number of samples: 9, not 8"),
        ("fifth.fogbow", "is part 2 of 5 by tiles"),
        ("samples.fogbow", "is part 2 of 4 by samples"),
        ("lantern.fogbow", "is of another scene: lantern.xml"),
        ("again.fogbow", "has part 1, which p1.fogbow has, too"),
        ("short.fogbow", "is cut off"),
        ("head.fogbow", "is no film file"),
        ("flipped.fogbow", "is damaged"),
        ("version.fogbow", "has version 99"),
        ("text.fogbow", "is no film file"),
        ("nowhere.fogbow", "nowhere.fogbow"),
    ] {
        let output = folder.run(&[&["merge", "-o", "merged.pfm", "--allow-missing"], &three[..], &[file]].concat());
        assert_eq!(output.status.code(), Some(2), "{file}");
        assert!(said(&output).contains(file) && said(&output).contains(words), "{file}: {}", said(&output));
        assert!(!folder.0.join("merged.pfm").exists());
    }
    let missing = folder.run(&[&["merge", "-o", "merged.pfm"], &three[..]].concat());
    assert_eq!(missing.status.code(), Some(2));
    assert!(said(&missing).contains("part 2 of 4 is missing"), "{}", said(&missing));
    let checked = folder.run(&[&["merge", "--check", "flipped.fogbow"], &three[..]].concat());
    assert_eq!(checked.status.code(), Some(1));
    let told: serde_json::Value = serde_json::from_slice(&checked.stdout).unwrap();
    assert_eq!((&told["missing"], &told["there"]), (&serde_json::json!([2]), &serde_json::json!([1, 3, 4])));
    assert_eq!(told["refused"][0]["file"], "flipped.fogbow");
    done(&folder, &[&["merge", "-q", "-o", "merged.pfm"], &FOUR[..]].concat());
    assert_eq!(read(&folder, "merged.pfm"), read(&folder, "whole.pfm"));
}

#[test]
fn parts_that_would_not_add_up_are_refused() {
    let folder = Folder::new("parts-options");
    for (options, words) in [
        (&["--part", "1/2", "-o", "a.exr"][..], "-o PART.fogbow"),
        (&["--part", "3/2", "-o", "a.fogbow"], "from 1 to N"),
        (&["--part", "1/2", "-o", "a.fogbow", "--noise", "0.1", "--method", "path"], "--noise"),
        (&["--part", "1/2", "-o", "a.fogbow", "--time", "1", "--method", "path"], "--time"),
        (&["--part", "1/2", "-o", "a.fogbow", "--method", "radiance-cache"], "use --spp"),
        (
            &["--part", "1/9", "-o", "a.fogbow", "--method", "path", "--spp", "8", "--split", "samples"],
            "9 parts of 8 samples",
        ),
        (&["--split", "tiles", "-o", "a.fogbow"], "--split has no effect"),
    ] {
        let output = folder.run(&[&["render", SCENE, "-q"], options].concat());
        assert_eq!(output.status.code(), Some(2), "{options:?}");
        assert!(said(&output).contains(words), "{options:?}: {}", said(&output));
    }
    let fill = folder.run(&["fill", SCENE, "-q", "--part", "1/2", "-o", "a.fogbow"]);
    assert!(said(&fill).contains("a fill is made once"), "{}", said(&fill));
    assert!(std::fs::read_dir(&folder.0).unwrap().next().is_none());
}
