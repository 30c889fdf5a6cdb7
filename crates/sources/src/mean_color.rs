//! The mean colour of a texture.

use mateval_image::Texture;

/// The mean colour of a texture's texels, summed in f64.
pub(crate) fn mean_color(texture: &Texture) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for y in 0..texture.height() {
        for x in 0..texture.width() {
            let texel = texture.texel(x, y);
            sum.iter_mut().zip(texel).for_each(|(s, v)| *s += f64::from(v));
        }
    }
    sum.map(|s| s / (texture.width() * texture.height()) as f64)
}
