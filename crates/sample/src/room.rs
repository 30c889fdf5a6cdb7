//! The room as a Mitsuba scene: its objects, where they stand, their materials, and the XML.
//!
//! The room spans x 0..4, y 0..2.6, z 0..3.2 metres. The wallpaper and the mirror are at x = 0, the window at z = 0,
//! and the camera is in the opposite corner.

use std::fmt::Write as _;

use glam::{DVec2, DVec3};

use super::solid::{self, Solid, tile};

const WIDTH: f64 = 4.0;
const HEIGHT: f64 = 2.6;
const DEPTH: f64 = 3.2;

/// The window's lower left corner and size in the wall z = 0.
const WINDOW: (DVec2, DVec2) = (DVec2::new(1.25, 1.05), DVec2::new(1.3, 1.05));
/// The depth of the window's opening in the wall.
const REVEAL: f64 = 0.12;

/// One shape of the scene.
pub(super) struct Item {
    /// The shape's id and its file's name without ending.
    pub(super) name: &'static str,
    /// Its mesh, in object space.
    pub(super) solid: Solid,
    /// The id of its BSDF.
    material: &'static str,
    /// Rotation about +y in degrees, applied before the translation.
    turn_deg: f64,
    /// Translation in metres.
    at: DVec3,
    /// Emitted radiance, linear Rec. 709.
    radiance: Option<[f64; 3]>,
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

fn item(name: &'static str, material: &'static str, solid: Solid) -> Item {
    Item { name, solid, material, turn_deg: 0.0, at: DVec3::ZERO, radiance: None }
}

fn placed(name: &'static str, material: &'static str, solid: Solid, turn_deg: f64, at: DVec3) -> Item {
    Item { turn_deg, at, ..item(name, material, solid) }
}

/// Every shape that has a mesh file.
pub(super) fn items() -> Vec<Item> {
    let mut items = shell();
    items.extend(objects());
    items
}

/// Floor, ceiling, walls and window.
fn shell() -> Vec<Item> {
    let square = |size: f64| DVec2::splat(size);
    let (x, y, z) = (v(WIDTH, 0.0, 0.0), v(0.0, HEIGHT, 0.0), v(0.0, 0.0, DEPTH));
    let floor = Solid::default().rectangle(z, x, -z, square(tile::PLANKS));
    let ceiling = Solid::default().rectangle(y, x, z, square(tile::PLAIN));
    let paper = Solid::default().rectangle(z, -z, y, square(tile::WALLPAPER));
    let right = Solid::default().rectangle(x, z, y, square(tile::PLAIN));
    let near = Solid::default().rectangle(x + z, -x, y, square(tile::PLAIN));
    let (corner, size) = WINDOW;
    let pane = v(corner.x, corner.y, -REVEAL / 2.0);
    vec![
        item("floor", "planks", floor),
        item("ceiling", "white_paint", ceiling),
        item("wall_paper", "wallpaper", paper),
        item("wall_window", "wall_paint", window_wall()),
        item("wall_right", "wall_paint", right),
        item("wall_near", "wall_paint", near),
        placed("window_frame", "white_paint", window_frame(size), 0.0, v(corner.x, corner.y, 0.0)),
        placed("window_glass", "clear_glass", solid::pane(size), 0.0, pane),
    ]
}

/// The wall z = 0 with the window's opening and the opening's inner sides.
fn window_wall() -> Solid {
    let (low, size) = WINDOW;
    let high = low + size;
    let tile = DVec2::splat(tile::PLAIN);
    let flat = |wall: Solid, x0: f64, y0: f64, x1: f64, y1: f64| {
        wall.rectangle(v(x0, y0, 0.0), v(x1 - x0, 0.0, 0.0), v(0.0, y1 - y0, 0.0), tile)
    };
    let mut wall = flat(Solid::default(), 0.0, 0.0, low.x, HEIGHT);
    wall = flat(wall, high.x, 0.0, WIDTH, HEIGHT);
    wall = flat(wall, low.x, 0.0, high.x, low.y);
    wall = flat(wall, low.x, high.y, high.x, HEIGHT);
    let (right, up, back) = (v(size.x, 0.0, 0.0), v(0.0, size.y, 0.0), v(0.0, 0.0, -REVEAL));
    wall.rectangle(v(low.x, low.y, 0.0), right, back, tile)
        .rectangle(v(low.x, high.y, -REVEAL), right, -back, tile)
        .rectangle(v(low.x, low.y, 0.0), back, up, tile)
        .rectangle(v(high.x, low.y, -REVEAL), -back, up, tile)
}

/// A frame around the opening and a cross within it.
fn window_frame(size: DVec2) -> Solid {
    let bar = 0.05;
    let (back, front) = (-REVEAL / 2.0 - 0.02, -REVEAL / 2.0 + 0.02);
    solid::frame(size, 0.04, -0.002, 0.015)
        .boxed(v(size.x / 2.0 - bar / 2.0, 0.0, back), v(size.x / 2.0 + bar / 2.0, size.y, front), tile::PLAIN)
        .boxed(v(0.0, size.y * 0.62, back), v(size.x, size.y * 0.62 + bar, front), tile::PLAIN)
}

/// Furniture, mirror and lamp.
fn objects() -> Vec<Item> {
    let mirror = DVec2::new(0.7, 0.85);
    let mirror_at = |off: f64| v(off, 1.15, 1.65);
    // The shelf stands at x = 0 and faces +x, so its own x axis runs along the room's -z.
    let on_shelf = |along: f64, y: f64| v(0.2, y, 1.3 - along);
    let glow = |item: Item, radiance| Item { radiance: Some(radiance), ..item };
    vec![
        placed("rug", "wool", solid::rug(), 4.0, v(1.95, 0.0, 1.7)),
        placed("table", "table_wood", solid::table(), 4.0, v(1.95, 0.012, 1.7)),
        placed("bowl", "ceramic", solid::bowl(), 0.0, v(2.1, 0.432, 1.66)),
        placed("sofa", "fabric", solid::sofa(), 0.0, v(1.75, 0.0, 0.5)),
        placed("sofa_feet", "brass", solid::sofa_feet(), 0.0, v(1.75, 0.0, 0.5)),
        placed("shelf", "table_wood", solid::shelf(), 90.0, v(0.18, 0.0, 1.3)),
        placed("box_red", "red", solid::container(v(0.3, 0.24, 0.22)), 90.0, on_shelf(-0.3, 0.415)),
        placed("box_teal", "teal", solid::container(v(0.4, 0.28, 0.24)), 90.0, on_shelf(0.3, 0.415)),
        placed("box_yellow", "yellow", solid::container(v(0.42, 0.26, 0.24)), 90.0, on_shelf(-0.28, 0.055)),
        placed("box_small", "teal", solid::container(v(0.14, 0.18, 0.14)), 70.0, on_shelf(0.42, 0.8)),
        placed("box_top", "red", solid::container(v(0.22, 0.1, 0.16)), 100.0, on_shelf(-0.4, 0.8)),
        placed("mirror", "silver", solid::pane(mirror), 90.0, mirror_at(0.02)),
        placed("mirror_frame", "table_wood", solid::frame(mirror, 0.05, 0.0, 0.035), 90.0, mirror_at(0.0)),
        placed("lamp_stand", "brass", solid::lamp_stand(), 0.0, v(0.42, 0.0, 0.4)),
        glow(placed("lamp_shade", "shade", solid::lamp_shade(), 0.0, v(0.42, 0.0, 0.4)), [6.0, 4.2, 2.4]),
    ]
}

/// The materials as Mitsuba XML; every opaque one is two-sided.
fn materials() -> String {
    let float = |name: &str, value: f64| format!("<float name=\"{name}\" value=\"{value}\"/>");
    let rgb = |name: &str, value: &str| format!("<rgb name=\"{name}\" value=\"{value}\"/>");
    let string = |name: &str, value: &str| format!("<string name=\"{name}\" value=\"{value}\"/>");
    let ggx = |alpha: f64| [string("distribution", "ggx"), float("alpha", alpha)];
    let plastic = |alpha: f64| [&ggx(alpha)[..], &[float("int_ior", 1.5), float("ext_ior", 1.0)]].concat();
    let bitmap = |name: &str, file: &str, wrap: &[String]| {
        let file = string("filename", &format!("textures/{file}.png"));
        let lines = [&[file], wrap].concat().join("\n                ");
        format!("<texture name=\"{name}\" type=\"bitmap\">\n                {lines}\n            </texture>")
    };
    let two_sided = |id: &str, kind: &str, lines: &[String]| {
        let lines = lines.join("\n            ");
        let inner = format!("        <bsdf type=\"{kind}\">\n            {lines}\n        </bsdf>\n");
        format!("    <bsdf type=\"twosided\" id=\"{id}\">\n{inner}    </bsdf>\n")
    };
    let mut xml = String::from("\n");
    for (id, alpha, file) in [("planks", 0.15, "planks"), ("table_wood", 0.08, "wood")] {
        let nonlinear = "<boolean name=\"nonlinear\" value=\"true\"/>".to_owned();
        let base = [nonlinear, bitmap("diffuse_reflectance", file, &[])];
        xml += &two_sided(id, "roughplastic", &[&plastic(alpha)[..], &base].concat());
    }
    for (id, file, wrap) in [
        ("wallpaper", "wallpaper", &[][..]),
        ("fabric", "fabric", &[]),
        ("wool", "rug", &[string("wrap_mode", "clamp")]),
    ] {
        xml += &two_sided(id, "diffuse", &[bitmap("reflectance", file, wrap)]);
    }
    for (id, color) in
        [("white_paint", "0.82, 0.81, 0.78"), ("wall_paint", "0.72, 0.69, 0.6"), ("shade", "0.7, 0.66, 0.58")]
    {
        xml += &two_sided(id, "diffuse", &[rgb("reflectance", color)]);
    }
    let brass = [rgb("eta", "0.444, 0.527, 1.094"), rgb("k", "3.695, 2.765, 1.829")];
    xml += &two_sided("brass", "roughconductor", &[ggx(0.15), brass].concat());
    xml += &two_sided("silver", "conductor", &[string("material", "none")]);
    let glass = [float("int_ior", 1.5), float("ext_ior", 1.0)].join("\n        ");
    xml += &format!("    <bsdf type=\"thindielectric\" id=\"clear_glass\">\n        {glass}\n    </bsdf>\n");
    for (id, color) in [
        ("red", "0.55, 0.05, 0.04"),
        ("teal", "0.03, 0.28, 0.3"),
        ("yellow", "0.75, 0.5, 0.06"),
        ("ceramic", "0.78, 0.78, 0.74"),
    ] {
        xml += &two_sided(id, "roughplastic", &[&plastic(0.05)[..], &[rgb("diffuse_reflectance", color)]].concat());
    }
    xml
}

/// The scene as XML of Mitsuba 3.
pub(super) fn xml() -> String {
    let mut xml = String::from(HEAD);
    xml.push_str(&materials());
    for item in items() {
        push_item(&mut xml, &item);
    }
    xml.push_str(TAIL);
    xml
}

fn push_item(xml: &mut String, item: &Item) {
    // Writing to a String cannot fail.
    let _ = write!(
        xml,
        "    <shape type=\"obj\" id=\"{0}\">\n        <string name=\"filename\" value=\"models/{0}.obj\"/>\n",
        item.name
    );
    if item.turn_deg != 0.0 || item.at != DVec3::ZERO {
        xml.push_str("        <transform name=\"to_world\">\n");
        if item.turn_deg != 0.0 {
            let _ = writeln!(xml, "            <rotate y=\"1\" angle=\"{}\"/>", item.turn_deg);
        }
        let at = item.at;
        let _ = writeln!(xml, "            <translate x=\"{:.3}\" y=\"{:.3}\" z=\"{:.3}\"/>", at.x, at.y, at.z);
        xml.push_str("        </transform>\n");
    }
    let _ = writeln!(xml, "        <ref id=\"{}\"/>", item.material);
    if let Some([r, g, b]) = item.radiance {
        let _ = write!(
            xml,
            "        <emitter type=\"area\">\n            <rgb name=\"radiance\" value=\"{r}, {g}, {b}\"/>\n        </emitter>\n"
        );
    }
    xml.push_str("    </shape>\n");
}

const HEAD: &str = r#"<?xml version="1.0" encoding="utf-8"?>
<!-- A room made by MatEval, CC0 1.0. Metres, +y up. -->
<scene version="3.0.0">
    <integrator type="path">
        <integer name="max_depth" value="18"/>
    </integrator>
    <sensor type="perspective">
        <float name="fov" value="65"/>
        <transform name="to_world">
            <lookat origin="3.72, 1.5, 2.95" target="1.0, 0.8, 0.75" up="0, 1, 0"/>
        </transform>
        <sampler type="independent">
            <integer name="sample_count" value="256"/>
        </sampler>
        <film type="hdrfilm">
            <integer name="width" value="320"/>
            <integer name="height" value="240"/>
            <rfilter type="box"/>
        </film>
    </sensor>
"#;

const TAIL: &str = r#"    <shape type="rectangle" id="ceiling_light">
        <transform name="to_world">
            <scale x="0.5" y="0.3"/>
            <rotate x="1" angle="90"/>
            <translate x="2.1" y="2.59" z="1.7"/>
        </transform>
        <ref id="white_paint"/>
        <emitter type="area">
            <rgb name="radiance" value="17, 16, 14"/>
        </emitter>
    </shape>
    <emitter type="envmap">
        <string name="filename" value="textures/outside.png"/>
        <float name="scale" value="5"/>
    </emitter>
</scene>
"#;
