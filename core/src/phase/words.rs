//! Lobes as plain numbers: for flat memory that is uploaded, saved or sent as it is.

use super::Lobe;

/// Floats that a lobe is written as: what it is, and up to two parameters.
pub const LOBE_WORDS: usize = 3;

/// Writes both directions from one table, so that neither can know a lobe that the other does not: a lobe that is missing
/// here does not compile. Numbers stay with their lobes once they are saved.
macro_rules! lobes {
    ($($number:literal: $name:ident { $($a:ident $(, $b:ident)?)? },)+) => {
        impl Lobe {
            /// The lobe as numbers, which [`Lobe::from_words`] reads; parameters that it has not are 0.
            ///
            /// ```
            /// # use fogbow::phase::Lobe;
            /// let fog = Lobe::HenyeyGreenstein { g: 0.75 };
            /// assert_eq!(fog.to_words()[1], 0.75);
            /// assert_eq!(Lobe::from_words(fog.to_words()), Some(fog));
            /// ```
            #[inline]
            #[must_use]
            pub fn to_words(self) -> [f32; LOBE_WORDS] {
                match self {
                    $(Self::$name { $($a $(, $b)?)? } => words([$number as f32 $(, $a $(, $b)?)?]),)+
                }
            }

            /// The lobe that [`Lobe::to_words`] has written as `words`; `None` for numbers of no lobe. Parameters are
            /// taken as they are: see [`Lobe::check`].
            ///
            /// ```
            /// # use fogbow::phase::Lobe;
            /// assert_eq!(Lobe::from_words(Lobe::Rayleigh.to_words()), Some(Lobe::Rayleigh));
            /// assert_eq!(Lobe::from_words([-1.0, 0.0, 0.0]), None);
            /// ```
            #[inline]
            #[must_use]
            pub fn from_words(words: [f32; LOBE_WORDS]) -> Option<Self> {
                let [number, parameters @ ..] = words;
                $(if number == $number as f32 {
                    let [$($a, $($b,)?)? ..] = parameters;
                    return Some(Self::$name { $($a $(, $b)?)? });
                })+
                None
            }
        }

        #[cfg(test)]
        const NUMBERS: &[u32] = &[$($number),+];
    };
}

lobes! {
    0: Isotropic {},
    1: HenyeyGreenstein { g },
    2: Schlick { k },
    3: Rayleigh {},
    4: Draine { g, alpha },
}

/// Fills up with zeros.
#[inline]
fn words<const N: usize>(first: [f32; N]) -> [f32; LOBE_WORDS] {
    core::array::from_fn(|i| first.get(i).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lobe_goes_there_and_back() {
        for (i, &number) in NUMBERS.iter().enumerate() {
            assert!(!NUMBERS[..i].contains(&number), "{number} stands for two lobes");
            let lobe = Lobe::from_words([number as f32, 0.25, 0.5]).unwrap();
            let written = lobe.to_words();
            assert_eq!(Lobe::from_words(written), Some(lobe));
            assert_eq!(written[0], number as f32, "{lobe:?}");
            // A lobe's own parameters are kept, and nothing else.
            let kept = match lobe {
                Lobe::Isotropic | Lobe::Rayleigh => [0.0, 0.0],
                Lobe::HenyeyGreenstein { g: a } | Lobe::Schlick { k: a } => [a, 0.0],
                Lobe::Draine { g, alpha } => [g, alpha],
            };
            assert_eq!(written[1..], kept, "{lobe:?}");
            assert!(kept.iter().zip([0.25, 0.5]).all(|(&kept, given)| kept == 0.0 || kept == given), "{lobe:?}");
        }
    }

    #[test]
    fn what_stands_for_no_lobe_is_none() {
        let above = NUMBERS.iter().max().unwrap() + 1;
        for number in [above as f32, -1.0, 0.5, f32::NAN, f32::INFINITY] {
            assert_eq!(Lobe::from_words([number, 0.0, 0.0]), None, "{number}");
        }
    }
}
