//! Numbers in words.

/// A share as a percentage of two places, which is what the thesis prints.
pub(super) fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

/// Three significant digits without an exponent.
pub(super) fn short(x: f64) -> String {
    let digits = if x == 0.0 || !x.is_finite() { 0 } else { (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize };
    format!("{x:.digits$}")
}

/// Seconds, or milliseconds where they are few.
pub(super) fn seconds(t: f64) -> String {
    if t.abs() < 0.1 { format!("{} ms", short(1e3 * t)) } else { format!("{} s", short(t)) }
}

/// Voxels along x, y and z.
pub(super) fn grid(resolution: [u32; 3]) -> String {
    resolution.map(|n| n.to_string()).join("×")
}

/// A figure that there is none of.
pub(super) fn dash() -> String {
    "–".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_words() {
        assert_eq!(
            [0.0, 0.012_34, 1.0, 12.34, 123.4, 12_345.6, -0.5].map(short),
            ["0", "0.0123", "1.00", "12.3", "123", "12346", "-0.500"]
        );
        assert_eq!(
            (seconds(0.0123), seconds(1.5), seconds(-0.02)),
            ("12.3 ms".to_owned(), "1.50 s".to_owned(), "-20.0 ms".to_owned())
        );
        assert_eq!(short(f64::INFINITY), "inf");
    }
}
