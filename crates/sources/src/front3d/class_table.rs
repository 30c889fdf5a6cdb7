//! The table of classes of material: the words that select a class, its range of roughness, its metallic, and the
//! source of the numbers.
//!
//! Abbreviated sources:
//! - `Roblox`: the chart of PBR values in "Material references", create.roblox.com/docs/art/modeling/material-reference;
//! - `MaterialX`: `resources/Materials/Examples/StandardSurface` of github.com/AcademySoftwareFoundation/MaterialX.

use mateval_scene::manifest::sha256_of_bytes;
use mateval_scene::material_class::MaterialClass;

/// A row of the table.
pub(super) struct ClassRow {
    pub(super) class: MaterialClass,
    /// Lower-case words that select the class, where the data's name contains one of them.
    words: &'static [&'static str],
    /// Least and most perceptual roughness.
    pub(super) roughness: [f32; 2],
    pub(super) metallic: f32,
    /// Where the numbers come from.
    #[cfg_attr(not(test), expect(dead_code, reason = "it documents the row, and a test requires it"))]
    source: &'static str,
}

/// Every class. Words are compared row by row, so `rough cloth` is looked for before `cloth`, and `plywood` before
/// `wood`.
pub(super) const TABLE: [ClassRow; 15] = [
    ClassRow {
        class: MaterialClass::Glass,
        words: &["glass"],
        roughness: [0.05, 0.1],
        metallic: 0.0,
        source: "our choice: smooth but for what lets highlights of lamps be sampled; no chart that we read lists it",
    },
    ClassRow {
        class: MaterialClass::Metal,
        words: &["metal", "steel", "chrome", "iron", "brass", "copper", "gold"],
        roughness: [0.2, 0.4],
        metallic: 1.0,
        source: "Roblox, Worn Metals: 0.2 to 0.4, metalness 1",
    },
    ClassRow {
        class: MaterialClass::Stone,
        words: &["marble", "stone", "granite"],
        roughness: [0.1, 0.375],
        metallic: 0.0,
        source: "MaterialX, standard_surface_marble_solid: 0.1; Roblox, Marble: 0.375",
    },
    ClassRow {
        class: MaterialClass::Tile,
        words: &["tile", "ceramic", "porcelain"],
        roughness: [0.1, 0.3],
        metallic: 0.0,
        source: "our choice: a glaze is glass, but less even; no chart that we may cite lists it",
    },
    ClassRow {
        class: MaterialClass::SmoothLeather,
        words: &["smooth leather"],
        roughness: [0.2, 0.4],
        metallic: 0.0,
        source: "Roblox, Glossy Leather: 0.2 to 0.4",
    },
    ClassRow {
        class: MaterialClass::Leather,
        words: &["leather"],
        roughness: [0.5, 0.7],
        metallic: 0.0,
        source: "Roblox, Worn Leather: 0.5 to 0.7",
    },
    ClassRow {
        class: MaterialClass::Suede,
        words: &["suede", "velvet"],
        roughness: [0.6, 0.8],
        metallic: 0.0,
        source: "Roblox, Velvet, Suede: 0.6 to 0.8. Its metalness of 0.4 to 0.6 imitates sheen and is left out",
    },
    ClassRow {
        class: MaterialClass::Wicker,
        words: &["rattan", "bamboo", "wicker"],
        roughness: [0.7, 0.9],
        metallic: 0.0,
        source: "Roblox, Worn Wood: 0.7 to 0.9",
    },
    ClassRow {
        class: MaterialClass::CoarseCloth,
        words: &["rough cloth", "carpet", "wool", "linen"],
        roughness: [0.9, 0.96],
        metallic: 0.0,
        source: "Roblox, Wool, Linen: 0.9 to 0.96",
    },
    ClassRow {
        class: MaterialClass::Cloth,
        words: &["cloth", "fabric", "cushion", "pillow"],
        roughness: [0.8, 0.9],
        metallic: 0.0,
        source: "Roblox, Cotton, Canvas, Denim: 0.8 to 0.9",
    },
    ClassRow {
        class: MaterialClass::Paint,
        words: &["paint", "wallpaper", "plaster"],
        roughness: [0.6, 0.9],
        metallic: 0.0,
        source: "our choice: matt and silk emulsion, of which the charts above list none",
    },
    ClassRow {
        class: MaterialClass::Lacquer,
        words: &["lacquer"],
        roughness: [0.3, 0.5],
        metallic: 0.0,
        source: "Roblox, Painted Metal: 0.3. Our choice: up to 0.5 for satin",
    },
    ClassRow {
        class: MaterialClass::Board,
        words: &["composite board", "plywood", "composition"],
        roughness: [0.2, 0.4],
        metallic: 0.0,
        source: "Roblox, plastic: 0.1 (glossy) to 0.4 (matte). Our choice: without the high gloss, since faces are melamine",
    },
    ClassRow {
        class: MaterialClass::Wood,
        words: &["wood"],
        roughness: [0.3, 0.7],
        metallic: 0.0,
        source: "Roblox: from the end of Glossy Wood (0.2 to 0.3) to the start of Worn Wood (0.7 to 0.9)",
    },
    ClassRow {
        class: MaterialClass::Plastic,
        words: &["plastic", "emissive"],
        roughness: [0.1, 0.4],
        metallic: 0.0,
        source: "Roblox, Glossy Plastic: 0.1; Matte Plastic: 0.4",
    },
];

/// The first class of the table with a word that `name` contains.
pub(super) fn class_named(name: &str) -> Option<MaterialClass> {
    let name = name.to_lowercase();
    TABLE.iter().find(|row| row.words.iter().any(|word| name.contains(word))).map(|row| row.class)
}

/// Roughness and metallic of the material `id` of a class. The roughness is drawn from the class's range: it is the
/// same for the same seed, id and class.
pub(super) fn drawn(class: MaterialClass, id: &str, seed: u64) -> [f32; 2] {
    let row = TABLE.iter().find(|row| row.class == class).expect("a test finds a row for every class");
    let hash = sha256_of_bytes(format!("{seed}/{id}/{class}").as_bytes());
    let bits = u32::from_str_radix(&hash[..6], 16).expect("a hash is hexadecimal");
    let [low, high] = row.roughness;
    [low + (high - low) * (bits as f32 / (1 << 24) as f32), row.metallic]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_class_has_one_row_with_a_source_and_a_range() {
        for class in MaterialClass::ALL {
            let rows: Vec<&ClassRow> = TABLE.iter().filter(|row| row.class == class).collect();
            let [row] = rows[..] else { panic!("{class}: {} rows", rows.len()) };
            let is_cited = ["Roblox", "MaterialX"].iter().any(|name| row.source.contains(name));
            assert!(is_cited || row.source.starts_with("our choice: "), "{class}: {}", row.source);
            let [low, high] = row.roughness;
            assert!(0.0 < low && low < high && high <= 1.0, "{class}");
            assert!(row.metallic == 0.0 || row.metallic == 1.0, "{class}");
        }
        assert_eq!(TABLE.len(), MaterialClass::ALL.len());
    }

    /// The materials of `model_info.json`, names of groups and content types of all known files.
    #[test]
    fn the_words_of_the_data_select_their_class() {
        for (name, class) in [
            ("Composition", MaterialClass::Board),
            ("Composite Board", MaterialClass::Board),
            ("Plywood", MaterialClass::Board),
            ("Wood", MaterialClass::Wood),
            ("Solid Wood", MaterialClass::Wood),
            ("Rough Cloth", MaterialClass::CoarseCloth),
            ("Cloth", MaterialClass::Cloth),
            ("Leather", MaterialClass::Leather),
            ("Smooth Leather", MaterialClass::SmoothLeather),
            ("Suede", MaterialClass::Suede),
            ("Metal", MaterialClass::Metal),
            ("Marble", MaterialClass::Stone),
            ("Stone", MaterialClass::Stone),
            ("Glass", MaterialClass::Glass),
            ("Bamboo Rattan", MaterialClass::Wicker),
            ("glass_001", MaterialClass::Glass),
            ("material flooring - hardwood", MaterialClass::Wood),
            ("material wallpaper", MaterialClass::Paint),
            ("material paint", MaterialClass::Paint),
            ("material antique tiles", MaterialClass::Tile),
            ("material marble tiles", MaterialClass::Stone),
            ("material glass - clear", MaterialClass::Glass),
            ("material metal - glossy", MaterialClass::Metal),
            ("material emissive", MaterialClass::Plastic),
        ] {
            assert_eq!(class_named(name), Some(class), "{name}");
        }
        for name in ["Others", "solid_001", "material", ""] {
            assert_eq!(class_named(name), None, "{name}");
        }
    }

    /// Draws stay in the range, fill it, and depend on seed, id and class.
    #[test]
    fn draws_fill_the_range_and_are_reproducible() {
        let roughness = |id: usize, seed| drawn(MaterialClass::Wood, &format!("model{id}"), seed)[0];
        let all: Vec<f32> = (0..1_000).map(|id| roughness(id, 0)).collect();
        assert!(all.iter().all(|v| (0.3..=0.7).contains(v)));
        let mean = all.iter().sum::<f32>() / 1_000.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        assert!(all.iter().any(|v| *v < 0.31) && all.iter().any(|v| *v > 0.69));
        assert_eq!(roughness(7, 0), roughness(7, 0));
        assert_ne!(roughness(7, 0), roughness(7, 1));
        assert_eq!(drawn(MaterialClass::Metal, "m", 3)[1], 1.0);
    }
}
