//! A host with Bevy's vectors: how to cross is in `core/src/math/arrays.rs`.

use fogbow::math::{Ray, affine_from_columns, affine_to_columns};

macro_rules! crosses {
    ($bevy:ident) => {{
        use $bevy::{Mat4, Quat, Vec3};
        let (eye, forward) = (Vec3::new(0.0, 1.0, 5.0), Vec3::NEG_Z);
        let ray = Ray::new(eye.to_array().into(), forward.to_array().into());
        assert_eq!(Vec3::from_array(ray.at(2.0).into()), eye + 2.0 * forward);
        let (turn, place) = (Quat::from_rotation_y(0.3), Vec3::new(1.0, 2.0, 3.0));
        let placed = Mat4::from_scale_rotation_translation(Vec3::new(1.0, 2.0, 0.5), turn, place);
        let map = affine_from_columns(&placed.to_cols_array()).expect("no projection");
        let there = Vec3::from_array(map.transform_point3(ray.origin).into());
        assert!((there - placed.transform_point3(eye)).length() < 1e-6);
        assert_eq!(Mat4::from_cols_array(&affine_to_columns(&map)), placed);
        println!("{}: crossed", stringify!($bevy));
    }};
}

fn main() {
    crosses!(bevy_math_0_18);
    crosses!(bevy_math_0_19);
    crosses!(bevy_math_0_20);
    // The same glam: nothing to cross.
    let same: fogbow::math::Vec3 = bevy_math_0_20::Vec3::X;
    assert_eq!(Ray::new(same, same).at(1.0), 2.0 * bevy_math_0_20::Vec3::X);
}
