//! One covariance operator on one light field: a flight of d metres turns detail in space into detail in angle.
use fogbow::covariance::{LightField, Symmetric4};
use fogbow::math::{Symmetric2, Vec3};
fn main() {
    let (space, angle, d) = (4.0, 9.0, 3.0);
    let even = |variance: f32| Symmetric2::diagonal(variance, variance);
    let light = LightField::around(Vec3::Z, Symmetric4::separable(even(space), even(angle)));
    let far = light.travelled(d).covariance;
    let exact = angle + d * d * space;
    println!("angular covariance after {d} m: {} cycles²/rad²; P + d² X = {exact}", far.angular.xx);
    assert_eq!((far.spatial, far.angular), (even(space), even(exact)));
    assert_eq!(far.mixed, [-d * space, 0.0, 0.0, -d * space]);
}
