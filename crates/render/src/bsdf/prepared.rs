//! What materials are prepared from, computed once for all shapes that share it: means of pictures, tables of rough coats.

use std::{collections::HashMap, sync::Arc};

use vdf_scene::{Microfacets, Pixels, Rgb, Texture, luminance};

use super::{microfacet::Facets, plastic::RoughCoat};

/// Prepared so far, for one scene: pictures are known by their addresses, so they must live as long.
#[derive(Default)]
pub(crate) struct Prepared {
    means: HashMap<*const Pixels, Rgb>,
    coats: HashMap<(u8, u64, u64), Arc<RoughCoat>>,
}

impl Prepared {
    /// The luminance of the mean of a texture.
    pub(super) fn mean_luminance(&mut self, texture: &Texture) -> f64 {
        let mean = match texture {
            Texture::Bitmap { image, .. } => *self.means.entry(Arc::as_ptr(image)).or_insert_with(|| texture.mean()),
            _ => texture.mean(),
        };
        f64::from(luminance(mean))
    }

    /// The probability with which a coat is sampled where it reflects half of the light, by what base and coat reflect at most.
    pub(super) fn coat_share(&mut self, diffuse: &Texture, specular: &Texture) -> f64 {
        let (base, coat) = (self.mean_luminance(diffuse), self.mean_luminance(specular));
        if base + coat > 0.0 { coat / (base + coat) } else { 0.5 }
    }

    /// The coat that is as rough as this in all directions, with this relative index of refraction.
    pub(super) fn rough_coat(&mut self, kind: Microfacets, alpha: f64, eta: f64) -> Arc<RoughCoat> {
        let key = (kind as u8, alpha.to_bits(), eta.to_bits());
        let new = || Arc::new(RoughCoat::new(&Facets { kind, alpha: [alpha; 2] }, eta));
        Arc::clone(self.coats.entry(key).or_insert_with(new))
    }
}

#[cfg(test)]
mod tests {
    use vdf_scene::{TextureFilter, UvTransform, Wrap};

    use super::*;

    /// What differs is not shared, and what is the same is.
    #[test]
    fn coats_and_means_are_those_asked_for() {
        let mut prepared = Prepared::default();
        let asked = [
            (Microfacets::Ggx, 0.1, 1.5),
            (Microfacets::Beckmann, 0.1, 1.5),
            (Microfacets::Ggx, 0.2, 1.5),
            (Microfacets::Ggx, 0.1, 1.3),
        ];
        let coats = asked.map(|(kind, alpha, eta)| prepared.rough_coat(kind, alpha, eta));
        for (i, &(kind, alpha, eta)) in asked.iter().enumerate() {
            let again = prepared.rough_coat(kind, alpha, eta);
            assert!((0..asked.len()).all(|j| Arc::ptr_eq(&again, &coats[j]) == (i == j)), "{i}");
        }
        let bitmap = |value| Texture::Bitmap {
            image: Arc::new(Pixels { width: 1, height: 1, rgb: vec![Rgb::splat(value)] }),
            filter: TextureFilter::Nearest,
            wrap: Wrap::Repeat,
            to_uv: UvTransform::default(),
        };
        let textures = [bitmap(0.25), bitmap(0.5), Texture::grey(0.75), Texture::grey(1.0)];
        for _ in 0..2 {
            let means = textures.each_ref().map(|texture| prepared.mean_luminance(texture));
            assert!(means.iter().zip([0.25, 0.5, 0.75, 1.0]).all(|(a, b)| (a - b).abs() < 1e-5), "{means:?}");
        }
    }
}
