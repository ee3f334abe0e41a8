//! The atrium with surfaces lit by a bake of fogbow. Not run by us: see README.md.

use bevy::light::{IrradianceVolume, LightProbe};
use bevy::prelude::*;

/// Corners of the box that was baked: `box` in volume.ktx2.json.
const BOX: [Vec3; 2] = [Vec3::new(-13.2, -0.1, -6.2), Vec3::new(13.2, 11.8, 6.2)];

/// Bevy divides light by what the camera's exposure makes of it: 2^ev100 · 1.2. With the exposure below, numbers of the bake show as they are.
const EV100: f32 = 0.0;

fn main() {
    App::new().add_plugins(DefaultPlugins).add_systems(Startup, setup).run();
}

fn setup(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((
        Camera3d::default(),
        bevy::camera::Exposure { ev100: EV100 },
        Transform::from_xyz(-9.0, 1.8, 0.4).looking_at(Vec3::new(0.0, 4.2, -0.4), Vec3::Y),
    ));
    // The atrium as glTF, by any converter of its PLY files.
    commands.spawn(SceneRoot(assets.load(GltfAssetLabel::Scene(0).from_asset("atrium.glb"))));
    let (centre, size) = (0.5 * (BOX[0] + BOX[1]), BOX[1] - BOX[0]);
    commands.spawn((
        LightProbe::default(),
        IrradianceVolume { voxels: assets.load("volume.ktx2"), intensity: 1.2 * EV100.exp2(), ..default() },
        Transform::from_translation(centre).with_scale(size),
    ));
}
