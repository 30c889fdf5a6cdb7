//! The library of furniture models: their categories, textures and parts, and the faults planted in their files.

use super::shapes::{self, Parts};
use super::swatches::Swatch::{self, Fabric, Plain, Text, Wood};
use super::uids;

/// A fault planted in the files of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quirk {
    /// Coordinates are in centimetres.
    Centimetres,
    /// The OBJ has quads, doubled blanks, three texture coordinates, CRLF, and no material names.
    OtherDialect,
    /// `model.mtl` describes a black, transmitting and emitting material.
    MisleadingMtl,
    /// The last part is a painted shadow.
    Shadow,
    /// The last part is a painted shadow whose group is named like all others.
    DropShadow,
    /// The texture's file ends in the middle.
    TruncatedTexture,
    /// The texture is grey with opacity.
    GreyTexture,
    /// The texture's opacity is 0 everywhere.
    ClearTexture,
    /// The texture is missing.
    NoTexture,
}

/// A model of the library.
pub(super) struct Model {
    /// The name by which records refer to it.
    pub(super) name: &'static str,
    /// The number in its id.
    number: u32,
    /// Super-category, category, style, theme and material. An empty text is written as null; a model without a
    /// super-category is left out of `model_info.json`.
    pub(super) info: [&'static str; 5],
    /// The fields of its texture.
    pub(super) swatches: Vec<Swatch>,
    /// Width and height of its texture in texels.
    pub(super) side: usize,
    pub(super) parts: Parts,
    /// The index of the part that is glass.
    pub(super) glass: Option<usize>,
    pub(super) quirk: Option<Quirk>,
}

impl Model {
    /// Its id, which names its folder.
    pub(super) fn jid(&self) -> String {
        uids::model(self.number)
    }
}

const WALNUT: Swatch = Wood([0.46, 0.31, 0.21]);
const OAK: Swatch = Wood([0.74, 0.58, 0.40]);
const WHITE_WOOD: Swatch = Wood([0.86, 0.84, 0.80]);
const BLUE: Swatch = Fabric([0.32, 0.42, 0.56]);
const OCHRE: Swatch = Fabric([0.74, 0.56, 0.28]);
const LINEN: Swatch = Fabric([0.84, 0.81, 0.74]);
const GREEN: Swatch = Fabric([0.34, 0.46, 0.36]);
const BRASS: Swatch = Plain([0.72, 0.58, 0.34]);
const BLACK: Swatch = Plain([0.13, 0.13, 0.14]);
const SHADE: Swatch = Plain([0.93, 0.88, 0.78]);
const GLASS: Swatch = Plain([0.92, 0.95, 0.96]);

const fn letters(lines: &'static [&'static str], ground: [f64; 3], aspect: f64) -> Swatch {
    Text { lines, ground, ink: [0.16, 0.2, 0.3], aspect }
}

/// A model without a fault or glass. Its number follows from its position in [`all`].
fn model(name: &'static str, info: [&'static str; 5], swatches: &[Swatch], parts: Parts) -> Model {
    Model { name, number: 0, info, swatches: swatches.to_vec(), side: 256, parts, glass: None, quirk: None }
}

/// Every model; the first thirteen are sound.
pub(super) fn all() -> Vec<Model> {
    let mut models = sound();
    models.extend(faulty());
    for (model, number) in models.iter_mut().zip(1..) {
        model.number = number;
    }
    models
}

fn sound() -> Vec<Model> {
    const CABINET: &str = "Cabinet/Shelf/Desk";
    let cushion = letters(&["SIT", "^ UP"], [0.86, 0.74, 0.46], 0.35 / 0.3);
    let blanket = letters(&["SLEEP", "WELL ^"], [0.62, 0.70, 0.66], 1.2 / 0.8);
    let print = letters(&["MATEVAL", "^ TOP"], [0.93, 0.91, 0.84], 0.8 / 0.55);
    vec![
        model(
            "l_sofa",
            ["Sofa", "L-shaped Sofa", "Modern", "Smooth Net", "Rough Cloth"],
            &[BLUE, BLACK, OCHRE, cushion],
            shapes::l_sofa(),
        ),
        model(
            "coffee_table",
            ["Table", "Coffee Table", "Modern", "Lines", "Solid Wood"],
            &[OAK],
            shapes::coffee_table(),
        ),
        model(
            "tv_stand",
            [CABINET, "TV Stand", "Nordic", "Smooth Net", "Composite Board"],
            &[WALNUT, BLACK, WHITE_WOOD],
            shapes::tv_stand(),
        ),
        model(
            "dining_table",
            ["Table", "Dining Table", "Nordic", "Smooth Net", "Solid Wood"],
            &[WALNUT],
            shapes::dining_table(),
        ),
        model(
            "dining_chair",
            ["Chair", "Dining Chair", "Nordic", "Smooth Net", "Wood"],
            &[WALNUT, GREEN],
            shapes::dining_chair(),
        ),
        Model {
            glass: Some(3),
            side: 128,
            ..model(
                "pendant_lamp",
                ["Lighting", "Pendant Lamp", "Industrial", "Smooth Net", "Metal"],
                &[BRASS, BLACK, GLASS],
                shapes::pendant_lamp(),
            )
        },
        Model {
            side: 128,
            ..model(
                "floor_lamp",
                ["Lighting", "Floor Lamp", "Modern", "", "Cloth"],
                &[SHADE, BRASS],
                shapes::floor_lamp(),
            )
        },
        Model { side: 512, ..model("picture", ["Others", "", "", "", ""], &[print, BLACK], shapes::picture()) },
        model(
            "bed",
            ["Bed", "King-size Bed", "Modern", "Smooth Net", "Cloth"],
            &[OAK, GREEN, LINEN, blanket],
            shapes::bed(),
        ),
        model(
            "nightstand",
            [CABINET, "Nightstand", "Modern", "Wooden Vertical Texture", "Wood"],
            &[OAK, WHITE_WOOD, BRASS],
            shapes::nightstand(),
        ),
        model(
            "wardrobe",
            [CABINET, "Wardrobe", "Minimalist", "Smooth Net", "Composite Board"],
            &[OAK, WHITE_WOOD, BLACK],
            shapes::wardrobe(),
        ),
        model(
            "bed_end_stool",
            ["Pier/Stool", "Footstool / Sofastool / Bed End Stool / Stool", "Modern", "Smooth Net", "Cloth"],
            &[OCHRE, OAK],
            shapes::bed_end_stool(),
        ),
        Model {
            glass: Some(1),
            side: 128,
            ..model(
                "ceiling_lamp",
                ["Lighting", "Ceiling Lamp", "Modern", "", "Glass"],
                &[BRASS, GLASS],
                shapes::ceiling_lamp(),
            )
        },
    ]
}

fn faulty() -> Vec<Model> {
    const CABINET: &str = "Cabinet/Shelf/Desk";
    let drawer = letters(&["TOP ^ DRAWER"], [0.90, 0.86, 0.74], 0.6 / 0.14);
    let with = |quirk, model: Model| Model { quirk: Some(quirk), ..model };
    vec![
        with(
            Quirk::ClearTexture,
            model(
                "bookcase",
                [CABINET, "Bookcase / jewelry Armoire", "Modern", "Lines", "Wood"],
                &[WALNUT, Plain([0.62, 0.24, 0.20]), Plain([0.20, 0.34, 0.44])],
                shapes::bookcase(),
            ),
        ),
        with(
            Quirk::TruncatedTexture,
            model(
                "chest",
                [CABINET, "Drawer Chest / Corner cabinet", "Korean", "Lines", "Wood"],
                &[OAK, WHITE_WOOD, drawer],
                shapes::chest(),
            ),
        ),
        with(
            Quirk::Shadow,
            model("shelf", [CABINET, "Shelf", "Modern", "", "Wood"], &[WALNUT, Plain([0.05; 3])], shapes::shelf()),
        ),
        with(
            Quirk::MisleadingMtl,
            model(
                "armchair",
                ["Sofa", "armchair", "Vintage/Retro", "Smooth Net", "Leather"],
                &[Fabric([0.52, 0.22, 0.18]), BLACK],
                shapes::armchair(),
            ),
        ),
        with(
            Quirk::OtherDialect,
            model(
                "side_table",
                ["Table", "Round End Table", "Modern", "Granite Texture", "Marble"],
                &[WHITE_WOOD, BLACK],
                shapes::side_table(),
            ),
        ),
        with(
            Quirk::GreyTexture,
            model(
                "lounge_chair",
                ["Chair", "Lounge Chair / Cafe Chair / Office Chair", "Modern", "Smooth Net", "Suede"],
                &[Fabric([0.62; 3]), Plain([0.3; 3])],
                shapes::lounge_chair(),
            ),
        ),
        with(
            Quirk::Centimetres,
            model(
                "stool",
                ["Pier/Stool", "Footstool / Sofastool / Bed End Stool / Stool", "Modern", "", "Cloth"],
                &[GREEN, OAK],
                shapes::stool(),
            ),
        ),
        with(Quirk::NoTexture, model("crate", [""; 5], &[OAK], shapes::crate_box())),
        with(
            Quirk::DropShadow,
            model("basket", ["Others", "", "", "", ""], &[OCHRE, Swatch::DropShadow], shapes::basket()),
        ),
        model("mat", ["Others", "", "", "", ""], &[Plain([0.0; 3])], shapes::mat()),
        model("sculpture", ["Others", "", "", "", ""], &[WHITE_WOOD, Plain([0.02; 3])], shapes::sculpture()),
    ]
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// As in the data, the origin is on the floor in the middle of the footprint, painted shadows aside.
    #[test]
    fn models_stand_on_their_origin() {
        for model in all() {
            let has_shadow = matches!(model.quirk, Some(Quirk::Shadow | Quirk::DropShadow));
            let parts = model.parts.len() - usize::from(has_shadow);
            let points = || model.parts[..parts].iter().flat_map(|(_, solid)| &solid.positions);
            let low = points().fold(DVec3::MAX, |low, p| low.min(*p));
            let middle = (low + points().fold(DVec3::MIN, |high, p| high.max(*p))) / 2.0;
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
        let sofa = shapes::l_sofa();
        let reach = |side: f64| {
            let points = sofa.iter().flat_map(|(_, solid)| &solid.positions);
            points.filter(|p| p.x * side > 0.5).fold(f64::MIN, |most, p| most.max(p.z))
        };
        assert!(reach(1.0) > reach(-1.0) + 0.6);
    }
}
