//! Media that ask others.

/// All questions of a [`Medium`](crate::host::Medium), handed on: the body of an `impl` block. To the medium in whichever variant of an enum is
/// there, `[Fog Smoke]`, or to that in an expression, `(self.inner)`. Defaults are handed on as well, so nothing that the medium
/// itself answers faster or more precisely is lost.
///
/// ```
/// use fogbow::{host::Medium, math::Vec3, medium::{Homogeneous, Placed}, phase::Phase, spectrum::Spectrum};
///
/// enum Matter<'a> {
///     Everywhere(Homogeneous),
///     Somewhere(Placed<'a, Homogeneous>),
/// }
///
/// impl Medium for Matter<'_> {
///     fogbow::host::delegate_medium!(self, [Everywhere Somewhere]);
/// }
///
/// struct Named<M> {
///     name: &'static str,
///     medium: M,
/// }
///
/// impl<M: Medium> Medium for Named<M> {
///     fogbow::host::delegate_medium!(self, (self.medium));
/// }
///
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let named = Named { name: "fog", medium: Matter::Everywhere(fog) };
/// assert_eq!(named.extinction(Vec3::ZERO), Spectrum::ONE);
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
#[macro_export]
macro_rules! delegate_medium {
    (@to $self:ident, [$($variant:ident)+], $medium:ident => $answer:expr) => {
        match $self {
            $(Self::$variant($medium) => $answer,)+
        }
    };
    (@to $self:ident, ($inner:expr), $medium:ident => $answer:expr) => {{
        let $medium = &$inner;
        $answer
    }};
    ($self:ident, $to:tt) => {
        #[inline]
        fn properties(&$self, point: $crate::math::Vec3) -> $crate::host::Properties {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.properties(point))
        }
        #[inline]
        fn majorant_segment(&$self, ray: &$crate::math::Ray, from: f32) -> $crate::host::MajorantSegment {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.majorant_segment(ray, from))
        }
        #[inline]
        fn marching_segment(&$self, ray: &$crate::math::Ray, from: f32) -> $crate::host::MajorantSegment {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.marching_segment(ray, from))
        }
        #[inline]
        fn extinction(&$self, point: $crate::math::Vec3) -> $crate::spectrum::Spectrum {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.extinction(point))
        }
        #[inline]
        fn extinction_with_gradient(
            &$self,
            point: $crate::math::Vec3,
        ) -> ($crate::spectrum::Spectrum, $crate::spectrum::Gradient) {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.extinction_with_gradient(point))
        }
        fn resolution(&$self) -> f32 {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.resolution())
        }
        fn gradients(&$self, point: $crate::math::Vec3) -> $crate::host::Gradients {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.gradients(point))
        }
        fn extinction_hessian(&$self, point: $crate::math::Vec3) -> $crate::spectrum::Hessian {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.extinction_hessian(point))
        }
        fn mean_extinction(&$self, centre: $crate::math::Vec3, radius: f32) -> $crate::spectrum::Spectrum {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.mean_extinction(centre, radius))
        }
        fn faces(&$self, ray: &$crate::math::Ray, visit: &mut dyn FnMut($crate::host::Face)) {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.faces(ray, visit))
        }
        fn is_grey(&$self) -> bool {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.is_grey())
        }
        fn is_emissive(&$self) -> bool {
            $crate::host::delegate_medium!(@to $self, $to, medium => medium.is_emissive())
        }
    };
}

#[doc(inline)]
pub use delegate_medium;
