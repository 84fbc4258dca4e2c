//! What reports measure with: processors, medians, and images that have to be the same.

use vdf_image::Image;

/// The most threads that a report takes.
pub const MAX_THREADS: usize = 1024;

/// How many processors there are, as far as this program may use them.
pub(super) fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The median; 0 of no values.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n == 0 { 0.0 } else { 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]) }
}

/// Whether the images are the same, bit for bit.
pub(super) fn same_bits(a: &Image, b: &Image) -> bool {
    (a.width, a.height, a.origin) == (b.width, b.height, b.origin) && has_pixels(a, b)
}

/// Whether the pixels of a part of the film are the same in the image, bit for bit.
pub(super) fn has_pixels(image: &Image, part: &Image) -> bool {
    let offset = |i: usize| usize::try_from(i64::from(part.origin[i]) - i64::from(image.origin[i])).ok();
    let (Some(dx), Some(dy)) = (offset(0), offset(1)) else { return false };
    let (width, part_width) = (image.width as usize, part.width as usize);
    let bits = |p: &vdf_image::Rgb| p.to_array().map(f32::to_bits);
    part.pixels.chunks(part_width.max(1)).enumerate().all(|(y, row)| {
        let first = (y + dy) * width + dx;
        let there = image.pixels.get(first..first + row.len()).unwrap_or_default();
        dx + part_width <= width && row.iter().map(bits).eq(there.iter().map(bits))
    })
}

#[cfg(test)]
mod tests {
    use vdf_image::Rgb;

    use super::*;

    #[test]
    fn images_are_compared_bit_by_bit() {
        let mut a = Image::new(4, 3);
        for (i, p) in a.pixels.iter_mut().enumerate() {
            *p = Rgb::splat(i as f32);
        }
        assert!(same_bits(&a, &a.clone()));
        for (at, value) in [(0, -0.0), (5, 5.000_001), (11, f32::NAN)] {
            let mut b = a.clone();
            b.pixels[at].z = value;
            assert!(!same_bits(&a, &b) && !same_bits(&b, &a), "{at}");
        }
        assert!(!same_bits(&a, &Image::new(3, 4)));
        let mut shorter = a.clone();
        shorter.height = 2;
        shorter.pixels.truncate(8);
        assert!(!same_bits(&a, &shorter) && !same_bits(&shorter, &a));
    }

    #[test]
    fn a_part_lies_where_it_lies() {
        let cropped = |[x0, y0, x1, y1]: [u32; 4]| Image::cropped([20, 20], [x0, y0], [x1 - x0, y1 - y0]);
        let mut image = cropped([10, 5, 14, 8]);
        for (i, p) in image.pixels.iter_mut().enumerate() {
            *p = Rgb::splat(i as f32);
        }
        let part = |x0, y0, x1, y1| {
            let mut part = cropped([x0, y0, x1, y1]);
            for (i, p) in part.pixels.iter_mut().enumerate() {
                let (x, y) = (i as u32 % part.width + x0 - 10, i as u32 / part.width + y0 - 5);
                *p = Rgb::splat((4 * y + x) as f32);
            }
            part
        };
        assert!(has_pixels(&image, &part(10, 5, 14, 8)) && has_pixels(&image, &part(11, 6, 13, 8)));
        let mut moved = part(11, 6, 13, 8);
        moved.origin = [12, 6];
        assert!(!has_pixels(&image, &moved));
        moved.origin = [9, 6];
        assert!(!has_pixels(&image, &moved));
        // Rows that run over the edge are not the next row.
        assert!(!has_pixels(&image, &part(13, 5, 15, 6)) && !has_pixels(&image, &part(10, 7, 12, 9)));
        let mut other = part(11, 6, 13, 8);
        other.pixels[3].y += 1.0;
        assert!(!has_pixels(&image, &other));
    }
}
