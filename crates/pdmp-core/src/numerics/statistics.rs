//! Extremes and medians of numbers, and reproducible random numbers.

/// Returns the smallest and the largest of numbers.
pub(crate) fn extremes(numbers: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    numbers.into_iter().fold(none, |[low, high], x| [low.min(x), high.max(x)])
}

/// Returns the difference of the largest and the smallest of numbers.
pub(crate) fn range<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> f64 {
    let [low, high] = extremes(numbers.into_iter().copied());
    high - low
}

/// Returns the median, or 0 without numbers.
pub(crate) fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n == 0 { 0.0 } else { (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0 }
}

/// Returns the median, or the upper one of two.
pub(crate) fn upper_median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    let middle = numbers.len() / 2;
    *numbers.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Returns the next of reproducible random integers, whose sequence starts with a state of zero (SplitMix64; Steele, Lea,
/// Flood, OOPSLA 2014, doi:10.1145/2660193.2660195).
pub(crate) fn pseudo_random(state: &mut u64) -> i64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut bits = *state;
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (bits ^ (bits >> 31)) as i64
}
