//! `smoke`: a plume that rises and spreads, as a grid of extinction.
//!
//! The density at a point is that of a column whose axis bends and whose radius grows with height, displaced by sums of value noise of
//! octaves; beyond the column it is exactly zero, so that most of the grid is empty, as smoke from simulations is.

use std::io::{self, Write};

use super::{Recipe, Size, random::Random};

pub(super) static RECIPE: Recipe = Recipe {
    name: "smoke",
    default_size: Size::Voxels(96 * 96 * 96),
    scene: ("smoke.xml", include_str!("smoke.xml")),
    meshes: &[],
    volumes: &[("volumes/smoke.vol", plume)],
};

/// Octaves of noise.
const OCTAVES: u32 = 5;

/// Values along each axis of a cube of about so many.
pub(super) fn side(voxels: u32) -> u32 {
    let mut side = 1;
    while (side + 1_u64).pow(3) <= u64::from(voxels) {
        side += 1;
    }
    side as u32
}

/// Writes the `.vol` file of a cube of about so many values, row by row.
fn plume(voxels: u32, out: &mut dyn Write) -> io::Result<()> {
    let n = side(voxels);
    out.write_all(b"VOL\x03")?;
    for number in [1, n, n, n, 1] {
        out.write_all(&number.to_le_bytes())?;
    }
    for corner in [-1.0_f32, 0.0, -1.0, 1.0, 2.0, 1.0] {
        out.write_all(&corner.to_le_bytes())?;
    }
    let place = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                #[allow(clippy::cast_possible_truncation, reason = "rounded to single precision")]
                let value = density([place(i), place(j), place(k)]) as f32;
                out.write_all(&value.to_le_bytes())?;
            }
        }
    }
    Ok(())
}

/// The density at a point of the unit cube, in [0, 1]; the second coordinate is the height.
fn density([x, height, z]: [f64; 3]) -> f64 {
    let to_a_side = [x, 1.0 - x, z, 1.0 - z].into_iter().fold(1.0, f64::min);
    // The axis bends more the higher it is.
    let bend = |salt: u64| (noise(salt, [3.0 * height, 0.5, 0.5]) - 0.5) * 0.5 * height;
    let (x, z) = (x - 0.5 - bend(1), z - 0.5 - bend(2));
    let radius = 0.05 + 0.2 * height;
    let distance = (x * x + z * z).sqrt() / radius;
    // Noise hardly ever displaces the surface by more than this.
    if distance > 2.2 {
        return 0.0;
    }
    let billows = fractal([x * 6.0, height * 6.0, z * 6.0]);
    let inside = 1.0 - distance + 4.0 * (billows - 0.5);
    // It fades out towards the top and the sides, and begins above the bottom.
    let ends = ramp((0.97 - height) * 2.2) * ramp((height - 0.02) * 20.0) * ramp((to_a_side - 0.03) * 12.0);
    ramp(inside * 1.6) * (0.35 + 0.65 * (1.0 - height)) * ends
}

/// 0 below 0, 1 above 1, smooth in between.
fn ramp(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// A sum of octaves, each half as high, about twice as fine, and turned, so that no axis is seen; in [0, 1], around ½.
fn fractal(mut at: [f64; 3]) -> f64 {
    let (mut sum, mut height, mut all) = (0.0, 1.0, 0.0);
    for octave in 0..OCTAVES {
        sum += height * noise(10 + u64::from(octave), at);
        all += height;
        height *= 0.5;
        let [x, y, z] = at;
        // Fractions of Pythagorean triples: a rotation without a sine.
        let turned = [0.6 * x + 0.8 * y, 0.48 * y - 0.64 * x + 0.6 * z, 0.48 * x - 0.36 * y + 0.8 * z];
        at = turned.map(|x| 2.03 * x + 0.37);
    }
    sum / all
}

/// Smooth noise in [0, 1): random values at whole places, and what lies between them.
fn noise(salt: u64, at: [f64; 3]) -> f64 {
    let low = at.map(f64::floor);
    let share: [f64; 3] = std::array::from_fn(|a| {
        let x = at[a] - low[a];
        x * x * x * (x * (6.0 * x - 15.0) + 10.0)
    });
    let value = |corner: [f64; 3]| {
        // Whole places of either sign, far below 2²⁰.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small whole numbers")]
        let [x, y, z] = corner.map(|c| (c + 1_048_576.0) as u64);
        Random::new(salt, x << 42 | y << 21 | z).unit()
    };
    let mix = |a: f64, b: f64, share: f64| a + (b - a) * share;
    let along_x = |y: f64, z: f64| {
        mix(value([low[0], low[1] + y, low[2] + z]), value([low[0] + 1.0, low[1] + y, low[2] + z]), share[0])
    };
    let in_plane = |z: f64| mix(along_x(0.0, z), along_x(1.0, z), share[1]);
    mix(in_plane(0.0), in_plane(1.0), share[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_has_about_so_many_voxels() {
        for (voxels, n) in [(1, 1), (7, 1), (8, 2), (32_768, 32), (32_767, 31), (100_000_000, 464)] {
            assert_eq!(side(voxels), n);
        }
    }

    /// It is in the middle, and empty at the faces of its box and in most of it.
    #[test]
    fn the_plume_is_inside_of_its_box() {
        let n = 40_u32;
        let place = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        let (mut positive, mut most) = (0, 0.0_f64);
        for (i, j, k) in (0..n).flat_map(|i| (0..n).flat_map(move |j| (0..n).map(move |k| (i, j, k)))) {
            let d = density([place(i), place(j), place(k)]);
            assert!((0.0..=1.0).contains(&d));
            positive += u32::from(d > 0.0);
            most = most.max(d);
            let outside = [i, j, k].iter().any(|&c| c == 0 || c == n - 1);
            assert!(d == 0.0 || !outside, "{i} {j} {k}: {d}");
        }
        let share = f64::from(positive) / f64::from(n * n * n);
        assert!(most > 0.6 && (0.05..0.25).contains(&share), "{most}, {share}");
    }
}
