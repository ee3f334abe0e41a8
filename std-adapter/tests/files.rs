//! Picture files of any format: errors.

use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;
use fogbow_std::image::{ImageError, Layer, READABLE, read, write};

#[test]
fn errors_name_the_file_and_nothing_is_left_behind() {
    let folder = std::env::temp_dir().join(format!("fogbow-image-{}", std::process::id()));
    let image = Image::new(2, 2, Spectrum::ONE).unwrap();
    let smaller = Image::new(1, 2, Spectrum::ONE).unwrap();
    let layers = [Layer { name: "total", image: &image }];
    let said = |result: Result<(), ImageError>| result.unwrap_err().to_string();
    let missing = folder.join("x.pfm");
    assert!(said(write(&missing, &layers, 0.0)).contains("x.pfm: "));
    assert!(read(&missing).unwrap_err().to_string().contains("x.pfm: "));
    std::fs::create_dir_all(&folder).unwrap();
    for name in ["x.tiff", "x", "pfm"] {
        assert!(said(write(folder.join(name), &layers, 0.0)).contains("the extension is none of png, pfm"));
    }
    assert!(said(write(folder.join("x.png"), &[], 0.0)).contains("no layers"));
    let uneven = [layers[0], Layer { name: "other", image: &smaller }];
    assert!(said(write(folder.join("x.png"), &uneven, 0.0)).contains("differ in size"));
    let lying = Image { pixels: Vec::new(), ..image.clone() };
    assert!(said(write(folder.join("x.PNG"), &[Layer { name: "", image: &lying }], 0.0)).contains("no layers"));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
    for name in READABLE.iter().map(|extension| format!("x.{extension}")) {
        write(folder.join(&name), &layers, 1.0).unwrap();
        assert_eq!(read(folder.join(&name)).unwrap(), image, "{name}");
    }
    // Over what is there; and nothing stays beside it.
    write(folder.join("x.pfm"), &[Layer { name: "total", image: &smaller }], 0.0).unwrap();
    assert_eq!(read(folder.join("x.pfm")).unwrap(), smaller);
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), READABLE.len());
    std::fs::create_dir(folder.join("folder.pfm")).unwrap();
    assert!(read(folder.join("folder.pfm")).unwrap_err().to_string().ends_with("folder.pfm: is not a file"));
    std::fs::remove_dir_all(&folder).unwrap();
}
