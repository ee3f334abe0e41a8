//! Weights for multiple importance sampling (Veach 1997).

/// Balance heuristic: weight of the strategy with density `pdf` beside one with density `other`.
/// 0 when both are 0.
///
/// ```
/// # use fogbow::sampling::mis::balance;
/// assert!((balance(3.0, 1.0) - 0.75).abs() < 1e-6);
/// assert!((balance(3.0, 1.0) + balance(1.0, 3.0) - 1.0).abs() < 1e-6);   // nothing counts twice
/// ```
#[inline]
#[must_use]
pub fn balance(pdf: f32, other: f32) -> f32 {
    if pdf <= 0.0 { 0.0 } else { 1.0 / (1.0 + other / pdf) }
}

/// Power heuristic with exponent 2; better than [`balance`] where one strategy is nearly perfect.
///
/// ```
/// # use fogbow::sampling::mis::power;
/// assert_eq!(power(3.0, 1.0), 0.9);
/// assert_eq!(power(3.0, 1.0) + power(1.0, 3.0), 1.0);
/// ```
#[inline]
#[must_use]
pub fn power(pdf: f32, other: f32) -> f32 {
    if pdf <= 0.0 {
        return 0.0;
    }
    let ratio = other / pdf;
    1.0 / (1.0 + ratio * ratio)
}
