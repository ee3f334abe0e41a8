//! Layer 4b: the world as light sees it.
//!
//! What a host brings is three things, a medium, surfaces and lights; whoever follows light needs all of them, so they
//! go together as one [`World`].
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`World`]: medium, surfaces and lights |
//! | `host/passing` | [`leave`], [`beyond`], [`nearest_surface`]: from surface to surface, past null interfaces |
//! | `rays` | [`shadow_ray`]: is a light hidden? |
//! | `near` | [`NearLight`]: rays close by a light, joined to it; few lights together, and where they are in shadow |
//! | `outline` | [`Outline`]: what methods must know beforehand |

mod near;
mod outline;
mod rays;

pub use crate::host::passing::{MAX_INTERFACES, beyond, leave, nearest_surface};
pub(crate) use near::NearLights;
pub use near::{Joint, NearLight};
pub use outline::{LightCounts, Outline};
pub use rays::{shadow_ray, short_of_end};

use crate::light::Lights;

/// What light travels through, and where it comes from.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::Vec3, medium::Homogeneous, phase::Phase};
/// # use fogbow::{spectrum::Spectrum, world::World};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.1), Phase::ISOTROPIC)?;
/// let lamps = [Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?)];
/// // Fog without end and a lamp, but no surfaces.
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// assert_eq!(world.lights.len(), 1);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[doc(alias = "scene")]
#[derive(Debug)]
pub struct World<'a, M: ?Sized, S: ?Sized> {
    /// The medium; [`Empty`](crate::host::Empty) for none.
    pub medium: &'a M,
    /// The surfaces; [`Empty`](crate::host::Empty) for none.
    pub scene: &'a S,
    /// The lights; [`Hit::light`](crate::host::Hit::light) counts in this order. A few are `(&lights).into()`; many have a
    /// [`LightTree`](crate::light::LightTree), few that shine from a point may have [`ShadowMap`](crate::light::ShadowMap)s.
    ///
    /// An area light (quad, sphere, mesh) is half of a lamp: the other half is its surface, which `scene` must find where the
    /// light says it is, with that number in `Hit::light`. Paths meet it by chance as well as by connections, and the weights of both
    /// add up to one; of a lamp that rays pass through, what chance would bring is missing, a quarter of its light or so. Nothing
    /// can tell: a ray that meets something else may well meet it before the lamp.
    pub lights: Lights<'a>,
}

impl<M: ?Sized, S: ?Sized> Clone for World<'_, M, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: ?Sized, S: ?Sized> Copy for World<'_, M, S> {}
