//! Pictures in parts: whatever the method, the number of parts, their order and what they are of, merged they are the bits of the whole; and nothing
//! that does not belong to a picture gets into it.

use fogbow::bake::{BakeMemory, bytes};
use fogbow::bytes::Crc;
use serde_json::{Value, json};

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
        ("seed.fogbow", "was made with another seed: 1, not 0"),
        ("spp.fogbow", "was made with another number of samples: 9, not 8"),
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
    let told: Value = serde_json::from_slice(&checked.stdout).unwrap();
    assert_eq!((&told["missing"], &told["there"]), (&json!([2]), &json!([1, 3, 4])));
    assert_eq!(told["refused"][0]["file"], "flipped.fogbow");
    done(&folder, &[&["merge", "-q", "-o", "merged.pfm"], &FOUR[..]].concat());
    assert_eq!(read(&folder, "merged.pfm"), read(&folder, "whole.pfm"));
}

/// A film file whose words and sums somebody else wrote: checksums are right.
fn rewritten(file: &[u8], about: impl Fn(&mut Value), picture: impl Fn(&mut [u8])) -> Vec<u8> {
    const HEADER: usize = 68;
    let length = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
    let (end, rest) = (HEADER + length(20), file.len() - length(44));
    let mut words: Value = serde_json::from_slice(&file[HEADER..end]).unwrap();
    about(&mut words);
    let mut sums = file[rest..].to_vec();
    picture(&mut sums);
    let words = serde_json::to_vec(&words).unwrap();
    let mut all = [&file[..HEADER], &words, &file[end..rest], &sums].concat();
    all[20..28].copy_from_slice(&(words.len() as u64).to_le_bytes());
    let crc = crc_of(&all, HEADER);
    all[HEADER - 8..HEADER].copy_from_slice(&crc);
    all
}

/// Checksum of all but the last eight bytes of a header.
fn crc_of(bytes: &[u8], header: usize) -> [u8; 8] {
    let mut crc = Crc::new();
    crc.add(&bytes[..header - 8]);
    crc.add(&bytes[header..]);
    crc.value().to_le_bytes()
}

#[test]
fn parts_of_another_version_and_unfinished_ones_are_refused() {
    let folder = Folder::new("parts-versions");
    four(&folder, &[]);
    let bytes = read(&folder, "p2.fogbow");
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.0.join(name), bytes).unwrap();
    write("same.fogbow", &rewritten(&bytes, |_| (), |_| ()));
    done(&folder, &["merge", "-q", "p1.fogbow", "same.fogbow", "p3.fogbow", "p4.fogbow", "-o", "same.pfm"]);
    assert_eq!(read(&folder, "same.pfm"), read(&folder, "whole.pfm"));
    write("version.fogbow", &rewritten(&bytes, |about| about["program"] = json!("0.0.9"), |_| ()));
    let left = |picture: &mut [u8]| {
        picture[52] &= !1; // not all samples
        let crc = crc_of(picture, 120);
        picture[112..120].copy_from_slice(&crc);
    };
    write("left.fogbow", &rewritten(&bytes, |_| (), left));
    for (file, words) in [
        ("version.fogbow", "was made by fogbow 0.0.9, not 0"),
        ("left.fogbow", "is not done yet (part 2 of 4 by tiles): go on with it by fogbow render --checkpoint"),
    ] {
        let output = folder.run(&["merge", "-o", "a.pfm", "--allow-missing", "p1.fogbow", "p3.fogbow", file]);
        assert_eq!(output.status.code(), Some(2), "{file}");
        assert!(said(&output).contains(file) && said(&output).contains(words), "{file}: {}", said(&output));
        assert!(!folder.0.join("a.pfm").exists());
    }
}

/// A bake of six bricks, of which some need more passes than others.
const BAKE: [&str; 8] = ["--counts", "9x8x4", "--error", "0.15", "--passes", "40", "--basis", "sh1"];

#[test]
fn parts_of_a_bake_merge_to_the_bits_of_the_whole() {
    let folder = Folder::new("parts-bake");
    done(
        &folder,
        &["bake", SCENE, "-q", "--counts", "3x2x1", "--basis", "fluence", "--error", "0.1", "-o", "level.bake"],
    );
    let bake =
        |more: &[&str]| done(&folder, &[&["bake", SCENE, "-q", "--level", "level.bake"], &BAKE[..], more].concat());
    bake(&["-o", "whole.bake"]);
    let whole = read(&folder, "whole.bake");
    let grid = bytes::read(&whole, bytes::tag(&whole).unwrap(), BakeMemory::default()).unwrap();
    // A level of another basis is the same light, and errors are in proportion to it.
    assert!((0.05..0.2).contains(&grid.relative_error()), "{}", grid.relative_error());
    for part in ["1", "2", "3"] {
        bake(&["--part", &format!("{part}/3"), "--threads", "1", "-o", &format!("{part}.fogbow")]);
    }
    let again = read(&folder, "2.fogbow");
    bake(&["--part", "2/3", "--resume", "-o", "2.fogbow"]);
    assert!(read(&folder, "2.fogbow") == again, "what is done is done");
    done(&folder, &["merge", "-q", "3.fogbow", "1.fogbow", "2.fogbow", "-o", "merged.bake"]);
    assert!(read(&folder, "merged.bake") == read(&folder, "whole.bake"));

    // Some of them, and then the others; or baked on in one piece.
    let some =
        folder.run(&["merge", "-q", "3.fogbow", "1.fogbow", "--allow-missing", "-o", "31.fogbow", "-o", "31.bake"]);
    assert_eq!(some.status.code(), Some(1), "{}", said(&some));
    assert!(said(&some).contains("part 2 of 3 is missing: their probes are dark"), "{}", said(&some));
    done(&folder, &["merge", "-q", "2.fogbow", "31.fogbow", "-o", "two.bake"]);
    assert!(read(&folder, "two.bake") == read(&folder, "whole.bake"));
    bake(&["--resume", "-o", "31.bake"]);
    assert!(read(&folder, "31.bake") == read(&folder, "whole.bake"));

    // A part that was left, and one of another program.
    let file = read(&folder, "2.fogbow");
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.0.join(name), bytes).unwrap();
    write("left.fogbow", &rewritten(&file, |about| about["unfinished"] = json!("bricks are"), |_| ()));
    write("version.fogbow", &rewritten(&file, |about| about["program"] = json!("0.0.9"), |_| ()));
    let flipped = |(i, byte): (usize, &u8)| byte ^ u8::from(i == file.len() / 2);
    write("flipped.fogbow", &file.iter().enumerate().map(flipped).collect::<Vec<_>>());
    write("again.fogbow", &read(&folder, "1.fogbow"));
    write("short.fogbow", &file[..file.len() / 2]);
    bake(&["--part", "2/3", "--seed", "1", "-o", "seed.fogbow"]);
    part(&folder, "2/3", "picture.fogbow", &["--method", "path", "--spp", "3"]);
    for (more, words) in [
        ("left.fogbow", "is not done yet (part 2 of 3 by bricks): go on with it by fogbow bake --resume"),
        ("version.fogbow", "was made by fogbow 0.0.9"),
        ("flipped.fogbow", "is damaged"),
        ("again.fogbow", "has part 1, which 1.fogbow has, too"),
        ("short.fogbow", "is cut off"),
        ("seed.fogbow", "was made with another seed: 1, not 0"),
        ("picture.fogbow", "was made with another"),
    ] {
        let output = folder.run(&["merge", "-o", "a.bake", "--allow-missing", "1.fogbow", "3.fogbow", more]);
        assert_eq!(output.status.code(), Some(2), "{more}: {}", said(&output));
        assert!(said(&output).contains(more) && said(&output).contains(words), "{more}: {}", said(&output));
    }
    for (words, why) in [
        (&["merge", "1.fogbow", "3.fogbow", "-o", "a.bake"][..], "part 2 of 3 is missing"),
        (&["merge", "1.fogbow", "2.fogbow", "3.fogbow", "-o", "a.exr"], "these are parts of a bake"),
        (&["merge", "picture.fogbow", "--allow-missing", "-o", "a.bake"], "these are parts of a picture"),
        (&["bake", SCENE, "--part", "1/2", "-o", "a.fogbow"], "--level"),
        (&["bake", SCENE, "--part", "1/2", "--level", "level.bake", "-o", "a.bake"], "-o PART.fogbow"),
        (&["bake", SCENE, "--level", "level.bake", "--method", "photons", "-o", "a.bake"], "photons serve all probes"),
        (&["bake", SCENE, "--level", "2.fogbow", "-o", "a.bake"], "is no grid of probes"),
        (
            &["bake", SCENE, "--level", "level.bake", "--orders", "indirect", "-o", "a.bake"],
            "holds other light: --quantity and --orders",
        ),
        (
            &["bake", SCENE, "--counts", "4x4x4", "--part", "1/2", "--level", "level.bake", "-o", "a.fogbow"],
            "2 parts of 1 bricks",
        ),
    ] {
        let output = folder.run(words);
        assert_eq!(output.status.code(), Some(2), "{words:?}: {}", said(&output));
        assert!(said(&output).contains(why), "{words:?}: {}", said(&output));
        assert!(!folder.0.join("a.bake").exists());
    }
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
