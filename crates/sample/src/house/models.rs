//! The library of furniture models: their categories, textures and parts.

use glam::DVec3;

use super::shapes::{self, Parts};
use super::swatches::Swatch::{self, Fabric, Plain, Text, Wood};

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
            shapes::l_sofa(),
        ),
        Model::new(
            "coffee_table",
            ["Table", "Coffee Table", "Modern", "Lines", "Solid Wood"],
            &[OAK],
            shapes::coffee_table(),
        ),
        Model::new(
            "tv_stand",
            [CABINET, "TV Stand", "Nordic", "Smooth Net", "Composite Board"],
            &[WALNUT, BLACK, WHITE_WOOD],
            shapes::tv_stand(),
        ),
        Model::new(
            "dining_table",
            ["Table", "Dining Table", "Nordic", "Smooth Net", "Solid Wood"],
            &[WALNUT],
            shapes::dining_table(),
        ),
        Model::new(
            "dining_chair",
            ["Chair", "Dining Chair", "Nordic", "Smooth Net", "Wood"],
            &[WALNUT, GREEN],
            shapes::dining_chair(),
        ),
        Model {
            glass: Some(3),
            side: 128,
            ..Model::new(
                "pendant_lamp",
                ["Lighting", "Pendant Lamp", "Industrial", "Smooth Net", "Metal"],
                &[BRASS, BLACK, GLASS],
                shapes::pendant_lamp(),
            )
        },
        Model {
            side: 128,
            ..Model::new(
                "floor_lamp",
                ["Lighting", "Floor Lamp", "Modern", "", "Cloth"],
                &[SHADE, BRASS],
                shapes::floor_lamp(),
            )
        },
        Model { side: 512, ..Model::new("picture", ["Others", "", "", "", ""], &[print, BLACK], shapes::picture()) },
        Model::new(
            "bed",
            ["Bed", "King-size Bed", "Modern", "Smooth Net", "Cloth"],
            &[OAK, GREEN, LINEN, blanket],
            shapes::bed(),
        ),
        Model::new(
            "nightstand",
            [CABINET, "Nightstand", "Modern", "Wooden Vertical Texture", "Wood"],
            &[OAK, WHITE_WOOD, BRASS],
            shapes::nightstand(),
        ),
        Model::new(
            "wardrobe",
            [CABINET, "Wardrobe", "Minimalist", "Smooth Net", "Composite Board"],
            &[OAK, WHITE_WOOD, BLACK],
            shapes::wardrobe(),
        ),
        Model::new(
            "bed_end_stool",
            ["Pier/Stool", "Footstool / Sofastool / Bed End Stool / Stool", "Modern", "Smooth Net", "Cloth"],
            &[OCHRE, OAK],
            shapes::bed_end_stool(),
        ),
        Model {
            glass: Some(1),
            side: 128,
            ..Model::new(
                "ceiling_lamp",
                ["Lighting", "Ceiling Lamp", "Modern", "", "Glass"],
                &[BRASS, GLASS],
                shapes::ceiling_lamp(),
            )
        },
    ];
    models.iter_mut().zip(1..).for_each(|(model, number)| model.number = number);
    models
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
        let sofa = shapes::l_sofa();
        let reach = |side: f64| {
            let points = sofa.iter().flat_map(|(_, solid)| &solid.positions);
            points.filter(|p| p.x * side > 0.5).fold(f64::MIN, |most, p| most.max(p.z))
        };
        assert!(reach(1.0) > reach(-1.0) + 0.6);
    }
}
