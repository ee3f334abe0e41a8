//! A small scene to break, and a folder to break it in.

use std::path::{Path, PathBuf};

use fogbow_examples::error::SceneError;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::world::{Storage, World};

/// A scene with a bit of everything.
pub(crate) const SCENE: &str = r#"<scene version="3.0.0">
  <default name="spp" value="4"/>
  <integrator type="volpath"><integer name="max_depth" value="8"/><integer name="rr_depth" value="6"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="36"/>
    <string name="fov_axis" value="x"/>
    <float name="near_clip" value="0.01"/>
    <float name="far_clip" value="1000"/>
    <transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/><rfilter type="box"/></film>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
  </sensor>
  <medium type="heterogeneous" id="smoke">
    <volume name="sigma_t" type="gridvolume">
      <string name="filename" value="grid.vol"/>
      <transform name="to_world"><translate x="-0.5" y="-0.5" z="-0.5"/><scale value="2"/></transform>
    </volume>
    <rgb name="albedo" value="0.9 0.8 0.7"/>
    <float name="scale" value="3.5"/>
    <phase type="hg"><float name="g" value="0.6"/></phase>
  </medium>
  <medium type="homogeneous" id="drink">
    <rgb name="sigma_a" value="0.1 0.2 0.3"/><rgb name="sigma_s" value="1 1 1"/>
    <phase type="blendphase"><float name="weight" value="0.3"/><phase type="isotropic"/><phase type="rayleigh"/></phase>
  </medium>
  <bsdf type="twosided" id="grey"><bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.5 0.5"/></bsdf></bsdf>
  <shape type="cube" id="container">
    <transform name="to_world"><scale value="1.001"/></transform>
    <bsdf type="null"/>
    <ref name="interior" id="smoke"/>
  </shape>
  <shape type="sphere">
    <point name="center" x="0.2" y="-0.4" z="0"/><float name="radius" value="0.3"/>
    <bsdf type="dielectric"><string name="int_ior" value="water"/><float name="ext_ior" value="1"/></bsdf>
    <ref name="interior" id="drink"/><ref name="exterior" id="smoke"/>
  </shape>
  <shape type="sphere">
    <point name="center" x="-0.5" y="-0.6" z="0.1"/><float name="radius" value="0.3"/>
    <bsdf type="conductor"><string name="material" value="none"/></bsdf>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform><ref id="grey"/>
  </shape>
  <shape type="ply"><string name="filename" value="mesh.ply"/><boolean name="face_normals" value="true"/><ref id="grey"/></shape>
  <shape type="obj"><string name="filename" value="mesh.obj"/><boolean name="face_normals" value="true"/></shape>
  <shape type="rectangle">
    <transform name="to_world"><scale x="0.3" y="0.3"/><rotate x="1" angle="90"/><translate y="0.99"/></transform>
    <emitter type="area"><rgb name="radiance" value="15 13 10"/></emitter>
  </shape>
  <emitter type="spot">
    <transform name="to_world"><lookat origin="0, 3, 0" target="0, 0, 0" up="0, 0, 1"/></transform>
    <rgb name="intensity" value="40 40 40"/><float name="cutoff_angle" value="30"/><float name="beam_width" value="20"/>
  </emitter>
  <emitter type="envmap"><string name="filename" value="sky.pfm"/><float name="scale" value="0.5"/></emitter>
</scene>
"#;

/// A PLY file of two triangles.
pub(crate) const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element face 2\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";

/// An OBJ file of a quad.
pub(crate) const OBJ: &str = "v 0 0 0\nv 0 0 1\nv 0 1 1\nv 0 1 0\nf 1 2 3 4\n";

/// A grid volume.
pub(crate) fn volume(size: [i32; 3], encoding: i32, channels: i32, body: &[u8]) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    for word in [encoding, size[0], size[1], size[2], channels] {
        bytes.extend(word.to_le_bytes());
    }
    for word in [0.0_f32, 0.0, 0.0, 1.0, 1.0, 1.0] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(body);
    bytes
}

/// Eight densities.
pub(crate) fn densities(values: [f32; 8]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// A picture of 4 × 2 pixels.
pub(crate) fn sky() -> Vec<u8> {
    let mut bytes = b"PF\n4 2\n-1.0\n".to_vec();
    bytes.extend((0..24).flat_map(|i| (0.1 * i as f32).to_le_bytes()));
    bytes
}

/// A folder of its own, gone when dropped.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    /// With all files the scene names.
    pub(crate) fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fogbow-test-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        let folder = Self(path);
        folder.write("grid.vol", &volume([2, 2, 2], 1, 1, &densities([0.5; 8])));
        folder.write("mesh.ply", PLY.as_bytes());
        folder.write("mesh.obj", OBJ.as_bytes());
        folder.write("sky.pfm", &sky());
        folder
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.0.join(name), bytes).unwrap();
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Reads a scene as if it lay in the folder, and builds its world.
    pub(crate) fn build(&self, text: &str) -> Result<(), SceneError> {
        build(&self.path("scene.xml"), text)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Reads a scene and builds its world.
pub(crate) fn build(file: &Path, text: &str) -> Result<(), SceneError> {
    let scene = SceneFile::parse(file, text)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    assert!(!world.lights().is_empty() || scene.emitters.is_empty());
    Ok(())
}
