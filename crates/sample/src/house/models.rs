//! The library of furniture models: their categories, textures and parts.
//!
//! Shapes are in metres, +y up, fronts towards +z, with the origin on the floor in the middle of
//! the footprint.
//!
//! A shape is a list of parts: the number of a field of the model's texture, and the solid that it covers.

use glam::{DVec2, DVec3};

use super::materials::Swatch::{self, Fabric, Plain, Text, Wood};
use crate::solid::{self, Solid};

/// A model of the library.
pub struct Model {
    /// The name by which records refer to it.
    pub name: &'static str,
    /// The number in its id.
    pub number: u32,
    /// Super-category, category, style, theme and material. An empty text is written as null.
    pub info: [&'static str; 5],
    /// The fields of its texture.
    pub swatches: Vec<Swatch>,
    /// Width and height of its texture in texels.
    pub side: usize,
    pub parts: Parts,
    /// The index of the part that is glass.
    pub glass: Option<usize>,
}

impl Model {
    /// A model without glass, with a texture of 256 texels and the number 0.
    pub fn new(name: &'static str, info: [&'static str; 5], swatches: &[Swatch], parts: Parts) -> Self {
        Self { name, number: 0, info, swatches: swatches.to_vec(), side: 256, parts, glass: None }
    }

    /// Its id, which names its folder: made up, shaped as the data's.
    pub fn jid(&self) -> String {
        format!("cc0f0000-5a3b-4e00-8000-{:012}", self.number)
    }

    /// The least and the greatest corner of its parts.
    pub fn bounds(&self) -> [DVec3; 2] {
        let points = self.parts.iter().flat_map(|(_, solid)| &solid.positions);
        points.fold([DVec3::MAX, DVec3::MIN], |[low, high], p| [low.min(*p), high.max(*p)])
    }
}

pub const WALNUT: Swatch = Wood([0.46, 0.31, 0.21]);
pub const OAK: Swatch = Wood([0.74, 0.58, 0.40]);
pub const WHITE_WOOD: Swatch = Wood([0.86, 0.84, 0.80]);
pub const BLUE: Swatch = Fabric([0.32, 0.42, 0.56]);
pub const OCHRE: Swatch = Fabric([0.74, 0.56, 0.28]);
pub const LINEN: Swatch = Fabric([0.84, 0.81, 0.74]);
pub const GREEN: Swatch = Fabric([0.34, 0.46, 0.36]);
pub const BRASS: Swatch = Plain([0.72, 0.58, 0.34]);
pub const BLACK: Swatch = Plain([0.13, 0.13, 0.14]);
pub const SHADE: Swatch = Plain([0.93, 0.88, 0.78]);
pub const GLASS: Swatch = Plain([0.92, 0.95, 0.96]);

/// Dark letters on a ground of this colour, for a surface `aspect` times as wide as high.
pub const fn letters(lines: &'static [&'static str], ground: [f64; 3], aspect: f64) -> Swatch {
    Text { lines, ground, ink: [0.16, 0.2, 0.3], aspect }
}

/// The models of the built-in house; their positions, from 1, are their numbers.
pub(super) fn all() -> Vec<Model> {
    const CABINET: &str = "Cabinet/Shelf/Desk";
    let cushion = letters(&["SIT", "^ UP"], [0.86, 0.74, 0.46], 0.35 / 0.3);
    let blanket = letters(&["SLEEP", "WELL ^"], [0.62, 0.70, 0.66], 1.2 / 0.8);
    let print = letters(&["MATEVAL", "^ TOP"], [0.93, 0.91, 0.84], 0.8 / 0.55);
    let mut models = vec![
        Model::new(
            "l_sofa",
            ["Sofa", "L-shaped Sofa", "Modern", "Smooth Net", "Rough Cloth"],
            &[BLUE, BLACK, OCHRE, cushion],
            l_sofa(),
        ),
        Model::new("coffee_table", ["Table", "Coffee Table", "Modern", "Lines", "Solid Wood"], &[OAK], coffee_table()),
        Model::new(
            "tv_stand",
            [CABINET, "TV Stand", "Nordic", "Smooth Net", "Composite Board"],
            &[WALNUT, BLACK, WHITE_WOOD],
            tv_stand(),
        ),
        Model::new(
            "dining_table",
            ["Table", "Dining Table", "Nordic", "Smooth Net", "Solid Wood"],
            &[WALNUT],
            dining_table(),
        ),
        Model::new(
            "dining_chair",
            ["Chair", "Dining Chair", "Nordic", "Smooth Net", "Wood"],
            &[WALNUT, GREEN],
            dining_chair(),
        ),
        Model {
            glass: Some(3),
            side: 128,
            ..Model::new(
                "pendant_lamp",
                ["Lighting", "Pendant Lamp", "Industrial", "Smooth Net", "Metal"],
                &[BRASS, BLACK, GLASS],
                pendant_lamp(),
            )
        },
        Model {
            side: 128,
            ..Model::new("floor_lamp", ["Lighting", "Floor Lamp", "Modern", "", "Cloth"], &[SHADE, BRASS], floor_lamp())
        },
        Model { side: 512, ..Model::new("picture", ["Others", "", "", "", ""], &[print, BLACK], picture()) },
        Model::new(
            "bed",
            ["Bed", "King-size Bed", "Modern", "Smooth Net", "Cloth"],
            &[OAK, GREEN, LINEN, blanket],
            bed(),
        ),
        Model::new(
            "nightstand",
            [CABINET, "Nightstand", "Modern", "Wooden Vertical Texture", "Wood"],
            &[OAK, WHITE_WOOD, BRASS],
            nightstand(),
        ),
        Model::new(
            "wardrobe",
            [CABINET, "Wardrobe", "Minimalist", "Smooth Net", "Composite Board"],
            &[OAK, WHITE_WOOD, BLACK],
            wardrobe(),
        ),
        Model::new(
            "bed_end_stool",
            ["Pier/Stool", "Footstool / Sofastool / Bed End Stool / Stool", "Modern", "Smooth Net", "Cloth"],
            &[OCHRE, OAK],
            bed_end_stool(),
        ),
        Model {
            glass: Some(1),
            side: 128,
            ..Model::new(
                "ceiling_lamp",
                ["Lighting", "Ceiling Lamp", "Modern", "", "Glass"],
                &[BRASS, GLASS],
                ceiling_lamp(),
            )
        },
    ];
    models.iter_mut().zip(1..).for_each(|(model, number)| model.number = number);
    models
}

/// Texture fields and the solids that they cover.
pub type Parts = Vec<(usize, Solid)>;

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A box between two corners.
pub fn boxed(low: DVec3, high: DVec3) -> Solid {
    Solid::default().boxed(low, high, 1.0)
}

/// A box whose edges are rounded by `radius`.
pub fn cushion(low: DVec3, high: DVec3, radius: f64) -> Solid {
    Solid::default().cushion(low, high, radius, 1.0)
}

/// The surface of revolution of a profile of (radius, height) about the vertical axis through the origin.
pub fn turned(profile: &[(f64, f64)]) -> Solid {
    Solid::default().turned(DVec3::ZERO, profile, 20, 1.0)
}

/// A rectangle that shows a whole field of letters.
pub fn label(corner: DVec3, right: DVec3, up: DVec3) -> Solid {
    Solid::default().rectangle(corner, right, up, DVec2::new(right.length(), up.length()))
}

/// Four square legs `wide` metres across and `top` metres high, in the corners of a footprint of half size `x`, `z`.
pub fn legs(x: f64, z: f64, wide: f64, top: f64) -> Solid {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].into_iter().fold(Solid::default(), |legs, (sx, sz)| {
        let middle = v(sx * (x - wide / 2.0), top / 2.0, sz * (z - wide / 2.0));
        let half = v(wide / 2.0, top / 2.0, wide / 2.0);
        legs.boxed(middle - half, middle + half, 1.0)
    })
}

/// An L-shaped sofa, 2.4 m wide, with its long seat on the side of +x.
pub(super) fn l_sofa() -> Parts {
    let feet = [(-1.15, -0.72), (1.15, -0.72), (1.15, 0.72), (0.35, 0.72), (-1.15, 0.07)];
    let feet = feet
        .into_iter()
        .fold(Solid::default(), |feet, (x, z)| feet.boxed(v(x - 0.03, 0.0, z - 0.03), v(x + 0.03, 0.1, z + 0.03), 1.0));
    let base = boxed(v(-1.19, 0.1, -0.765), v(0.3, 0.26, 0.115)).boxed(v(0.3, 0.1, -0.765), v(1.19, 0.26, 0.765), 1.0);
    vec![
        (1, feet),
        (0, base),
        (0, cushion(v(-1.2, 0.1, -0.775), v(-1.02, 0.6, 0.125), 0.05)),
        (0, cushion(v(-1.02, 0.1, -0.775), v(1.2, 0.8, -0.55), 0.07)),
        (0, cushion(v(-1.015, 0.25, -0.55), v(-0.36, 0.44, 0.12), 0.05)),
        (0, cushion(v(-0.355, 0.25, -0.55), v(0.3, 0.44, 0.12), 0.05)),
        (0, cushion(v(0.305, 0.25, -0.55), v(1.195, 0.44, 0.775), 0.05)),
        (2, cushion(v(-0.9, 0.44, -0.55), v(-0.45, 0.84, -0.42), 0.05)),
        (3, label(v(-0.85, 0.49, -0.418), v(0.35, 0.0, 0.0), v(0.0, 0.3, 0.0))),
    ]
}

/// A coffee table of 1.1 m by 0.6 m.
pub(super) fn coffee_table() -> Parts {
    vec![(0, solid::table())]
}

/// A TV stand, 1.6 m wide, with three doors.
pub(super) fn tv_stand() -> Parts {
    let mut doors = Solid::default();
    for x in [-0.78, -0.25, 0.28] {
        doors = doors.boxed(v(x, 0.12, 0.18), v(x + 0.5, 0.42, 0.2), 1.0);
    }
    vec![
        (1, legs(0.76, 0.16, 0.04, 0.1)),
        (0, boxed(v(-0.8, 0.1, -0.2), v(0.8, 0.44, 0.18))),
        (0, boxed(v(-0.8, 0.44, -0.2), v(0.8, 0.47, 0.2))),
        (2, doors),
    ]
}

/// A dining table of 1.6 m by 0.9 m.
pub(super) fn dining_table() -> Parts {
    let apron = boxed(v(-0.74, 0.64, -0.39), v(0.74, 0.71, 0.39));
    vec![(0, boxed(v(-0.8, 0.71, -0.45), v(0.8, 0.75, 0.45))), (0, apron), (0, legs(0.76, 0.41, 0.07, 0.71))]
}

/// A dining chair, 0.45 m wide.
pub(super) fn dining_chair() -> Parts {
    let back =
        boxed(v(-0.22, 0.46, -0.25), v(-0.18, 0.92, -0.21)).boxed(v(0.18, 0.46, -0.25), v(0.22, 0.92, -0.21), 1.0);
    vec![
        (0, legs(0.225, 0.25, 0.04, 0.43)),
        (0, back.boxed(v(-0.18, 0.72, -0.245), v(0.18, 0.9, -0.215), 1.0)),
        (1, cushion(v(-0.225, 0.42, -0.25), v(0.225, 0.48, 0.25), 0.025)),
    ]
}

/// A pendant lamp, 0.95 m high with its rod.
pub(super) fn pendant_lamp() -> Parts {
    let shade = [(0.26, 0.0), (0.24, 0.08), (0.16, 0.18), (0.04, 0.24), (0.0, 0.24)];
    let bulb = [(0.0, 0.06), (0.03, 0.07), (0.045, 0.1), (0.03, 0.14), (0.0, 0.15)];
    vec![
        (0, turned(&shade)),
        (1, turned(&[(0.0, 0.93), (0.06, 0.93), (0.06, 0.95), (0.0, 0.95)])),
        (1, boxed(v(-0.004, 0.24, -0.004), v(0.004, 0.93, 0.004))),
        (2, turned(&bulb)),
    ]
}

/// A floor lamp, 1.64 m high.
pub(super) fn floor_lamp() -> Parts {
    vec![(1, solid::lamp_stand()), (0, solid::lamp_shade())]
}

/// A ceiling lamp: a base with a dome of glass below it, 0.15 m high.
pub(super) fn ceiling_lamp() -> Parts {
    let dome = [(0.0, 0.0), (0.12, 0.01), (0.22, 0.04), (0.28, 0.09), (0.28, 0.12)];
    vec![(0, turned(&[(0.0, 0.11), (0.3, 0.11), (0.3, 0.15), (0.0, 0.15)])), (1, turned(&dome))]
}

/// A framed picture of 0.9 m by 0.65 m with its back at z = -0.02.
pub(super) fn picture() -> Parts {
    let mut bars = solid::frame(DVec2::new(0.8, 0.55), 0.05, -0.02, 0.02);
    bars.positions.iter_mut().for_each(|p| *p += v(-0.4, 0.05, 0.0));
    vec![
        (1, bars),
        (1, boxed(v(-0.4, 0.05, -0.02), v(0.4, 0.6, 0.0))),
        (0, label(v(-0.4, 0.05, 0.004), v(0.8, 0.0, 0.0), v(0.0, 0.55, 0.0))),
    ]
}

/// A double bed, 1.9 m wide and 2.15 m long, its head towards -z.
pub(super) fn bed() -> Parts {
    vec![
        (0, boxed(v(-0.95, 0.0, -1.075), v(0.95, 1.1, -0.995))),
        (0, legs(0.9, 1.06, 0.06, 0.1)),
        (0, boxed(v(-0.92, 0.1, -0.995), v(0.92, 0.3, 1.075))),
        (2, cushion(v(-0.9, 0.3, -0.99), v(0.9, 0.52, 1.05), 0.05)),
        (1, cushion(v(-0.95, 0.36, -0.35), v(0.95, 0.56, 1.07), 0.04)),
        (2, cushion(v(-0.8, 0.51, -0.96), v(-0.1, 0.66, -0.5), 0.07)),
        (2, cushion(v(0.1, 0.51, -0.96), v(0.8, 0.66, -0.5), 0.07)),
        (3, label(v(-0.6, 0.562, 0.85), v(1.2, 0.0, 0.0), v(0.0, 0.0, -0.8))),
    ]
}

/// A nightstand, 0.5 m wide, with two drawers.
pub(super) fn nightstand() -> Parts {
    let drawer = |y: f64| boxed(v(-0.22, y, 0.18), v(0.22, y + 0.17, 0.195));
    vec![
        (0, legs(0.24, 0.18, 0.03, 0.1)),
        (0, boxed(v(-0.25, 0.1, -0.2), v(0.25, 0.5, 0.18))),
        (1, drawer(0.12)),
        (1, drawer(0.31)),
        (2, boxed(v(-0.05, 0.195, 0.195), v(0.05, 0.21, 0.2)).boxed(v(-0.05, 0.385, 0.195), v(0.05, 0.4, 0.2), 1.0)),
    ]
}

/// A wardrobe, 1.8 m wide and 2.2 m high, with three doors.
pub(super) fn wardrobe() -> Parts {
    let (mut doors, mut handles) = (Solid::default(), Solid::default());
    for x in [-0.895, -0.295, 0.305] {
        doors = doors.boxed(v(x, 0.1, 0.27), v(x + 0.59, 2.18, 0.29), 1.0);
        handles = handles.boxed(v(x + 0.5, 0.95, 0.29), v(x + 0.52, 1.2, 0.3), 1.0);
    }
    vec![(0, boxed(v(-0.9, 0.0, -0.3), v(0.9, 2.2, 0.27))), (1, doors), (2, handles)]
}

/// A stool for the end of a bed, 1.2 m wide, with a cushion.
pub(super) fn bed_end_stool() -> Parts {
    vec![
        (1, legs(0.58, 0.18, 0.05, 0.3)),
        (1, boxed(v(-0.59, 0.28, -0.19), v(0.59, 0.33, 0.19))),
        (0, cushion(v(-0.6, 0.32, -0.2), v(0.6, 0.45, 0.2), 0.05)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As in the data, the origin is on the floor in the middle of the footprint.
    #[test]
    fn models_stand_on_their_origin() {
        for model in all() {
            let [low, high] = model.bounds();
            let middle = (low + high) / 2.0;
            assert!(low.y.abs() < 1e-9, "{} {low}", model.name);
            assert!(middle.x.abs() < 0.004 && middle.z.abs() < 0.004, "{} {middle}", model.name);
        }
    }

    #[test]
    fn every_super_category_is_used() {
        let mut found: Vec<&str> = all().iter().map(|model| model.info[0]).filter(|name| !name.is_empty()).collect();
        found.sort_unstable();
        found.dedup();
        let all = ["Bed", "Cabinet/Shelf/Desk", "Chair", "Lighting", "Others", "Pier/Stool", "Sofa", "Table"];
        assert_eq!(found, all);
    }

    /// The long seat of the sofa is on one side only, so that a mirrored sofa can be recognised.
    #[test]
    fn the_sofa_is_not_its_own_mirror_image() {
        let sofa = l_sofa();
        let reach = |side: f64| {
            let points = sofa.iter().flat_map(|(_, solid)| &solid.positions);
            points.filter(|p| p.x * side > 0.5).fold(f64::MIN, |most, p| most.max(p.z))
        };
        assert!(reach(1.0) > reach(-1.0) + 0.6);
    }
}
