//! The page of `mateval baseline relight`: each room with a slider for each of its strongest lights.

use std::fmt::Write as _;

use mateval_image::jpeg_io::jpeg_bytes;
use mateval_image::{LinearRgb, Picture};

use super::super::possible_light::{LightSource, PossibleLight};
use crate::page_shell::{figure, page};

/// Mixes the pictures of the lights.
const MIX: &str = include_str!("mix_lights.js");
const QUALITY: u8 = 90;
/// The largest value that a picture of the page holds, times exposure; 1 is white. Brighter pixels stay white until their
/// light is dimmed to an eighth.
const BRIGHTEST: f32 = 8.0;

/// A scene on the page.
pub(super) struct Shown {
    pub(super) id: String,
    /// The size of the pictures in pixels.
    pub(super) size: [usize; 2],
    /// The lights with a slider.
    pub(super) lights: Vec<Slider>,
    /// The picture of what no slider changes.
    pub(super) rest: ScaledPicture,
}

/// One light's slider.
pub(super) struct Slider {
    pub(super) light: PossibleLight,
    /// Where it stands at first.
    pub(super) factor: f64,
    pub(super) picture: ScaledPicture,
}

/// A picture as a `data:` address, divided by a number.
pub(super) struct ScaledPicture {
    address: String,
    divisor: f32,
}

impl ScaledPicture {
    /// A linear picture, whose brightest value is stored as 1. It has 1 to 65,535 pixels a side.
    pub(super) fn new(picture: &Picture<LinearRgb>, exposure: f32) -> Self {
        let largest = picture.pixels().iter().flat_map(|pixel| pixel.0).fold(0.0, f32::max);
        let divisor = (largest * exposure).clamp(f32::MIN_POSITIVE, BRIGHTEST);
        let stored = picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (v * exposure / divisor).clamp(0.0, 1.0))));
        let bytes = stored.to_srgb().map(|pixel| pixel.0.map(|v| (v * 255.0).round() as u8));
        let jpeg = jpeg_bytes(&bytes, QUALITY).expect("pictures of views have 1 to 65,535 pixels a side");
        Self { address: format!("data:image/jpeg;base64,{}", base64::encode(jpeg)), divisor }
    }

    fn img(&self, role: &str) -> String {
        format!("<img hidden alt=\"\" data-{role}=\"{}\" src=\"{}\">", self.divisor, self.address)
    }
}

/// The page. Ids and names of lights contain no characters that are special in HTML.
pub(super) fn html(scenes: &[Shown]) -> String {
    let introduction = "Each slider multiplies the radiance of one light; 1 is as it was fitted.";
    let mut sections: String = scenes.iter().map(section).collect();
    writeln!(sections, "<script>{MIX}</script>").expect("writing to a String cannot fail");
    page("Rooms lit anew", introduction, &sections)
}

fn section(Shown { id, size: [width, height], lights, rest }: &Shown) -> String {
    let mut text = format!("<section class=\"room\"><h2>{id}</h2><div class=\"pictures pair\">\n");
    text.push_str(&figure(&format!("{id}/photo.png"), id, "The photo"));
    text.extend([
        format!(
            "<figure><canvas width=\"{width}\" height=\"{height}\" role=\"img\" aria-label=\"The room lit anew, {id}\">"
        ),
        format!("</canvas><noscript><img src=\"{id}/relit.png\" alt=\"The room lit anew, {id}\"></noscript>"),
        "<figcaption>The room lit anew</figcaption></figure></div>\n<div class=\"lights\">\n".to_owned(),
        rest.img("rest"),
    ]);
    text.extend(lights.iter().map(|Slider { light, factor, picture }| {
        let most = factor.max(2.0);
        let input = format!("<input type=\"range\" min=\"0\" max=\"{most}\" step=\"any\" value=\"{factor}\">");
        let label = label(light);
        format!("{}<label><span>{label}</span>{input}<output>{factor:.2}</output></label>\n", picture.img("light"))
    }));
    text.push_str("</div><button type=\"button\">All sliders to 1</button></section>\n");
    text
}

/// The light's name, and what shines where the name does not state it.
fn label(PossibleLight { name, source }: &PossibleLight) -> String {
    match source {
        LightSource::Instance { .. } | LightSource::Ceilings {} | LightSource::World {} => name.clone(),
        LightSource::Sky { azimuth_deg: [from, to], elevation_deg: [low, high] } => {
            format!("{name}: sky, azimuth {from}° to {to}°, elevation {low}° to {high}°")
        }
        LightSource::Quad { .. } => format!("{name}: light stage"),
    }
}
