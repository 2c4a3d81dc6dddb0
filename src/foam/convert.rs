//! Counts and whole numbers, to `f64` and back.

/// A count as a number.
#[expect(clippy::cast_precision_loss, reason = "counts lie far below 2^53")]
pub(crate) const fn as_f64(count: usize) -> f64 {
    count as f64
}

/// A whole `f64` as an integer; it saturates.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the value is whole, and saturation is what the callers want"
)]
pub(crate) const fn whole(value: f64) -> i32 {
    value as i32
}
