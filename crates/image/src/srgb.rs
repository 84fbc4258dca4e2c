//! The transfer curve of sRGB (IEC 61966-2-1), between linear values and those that a display takes.

/// The encoded value of a linear one. Values outside [0, 1] are clamped, NaN becomes 0.
pub(crate) fn encode(linear: f32) -> f32 {
    let linear = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear value of an encoded one in [0, 1].
pub(crate) fn decode(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoding_undoes_encoding() {
        for byte in 0..=u8::MAX {
            let value = f32::from(byte) / 255.0;
            assert!((encode(decode(value)) - value).abs() < 1e-6, "{byte}");
        }
        assert!((decode(0.5) - 0.214_041_14).abs() < 1e-7);
        assert!((encode(0.5) - 0.735_357).abs() < 1e-6);
    }
}
