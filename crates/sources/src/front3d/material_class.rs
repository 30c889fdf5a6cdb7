//! The class of material of a model, of its groups, and of architecture, from what the data states; the table of
//! classes, with their ranges of roughness; and the classes over one surface, whose material is one for all of its
//! triangles.
//!
//! A model has one texture for all of its groups, and a surface has one material. Where groups have different classes,
//! roughness and metallic are a texture with a block of texels for each class, and the uv of the triangles of class k
//! move by a whole number, which leaves the lookup of the repeated base colour as it was.
//!
//! Abbreviated sources of the table:
//! - `Roblox`: the chart of PBR values in "Material references", create.roblox.com/docs/art/modeling/material-reference;
//! - `MaterialX`: `resources/Materials/Examples/StandardSurface` of github.com/AcademySoftwareFoundation/MaterialX.

use std::collections::BTreeMap;

use glam::Vec2;
use mateval_dataset::TriangleMesh;
use mateval_dataset::material::MaterialClass;
use mateval_dataset::material::UvTransform;
use mateval_files::untrusted::sha256_of_bytes;

/// How the roughness and metallic of a house are chosen, since the data states neither.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AppearanceRule {
    /// Roughness 0.5 and metallic 0 everywhere, as in BlenderProc.
    #[default]
    Constant,
    /// By the class of material that the data states, with a roughness drawn from the range of that class.
    Stated { seed: u64 },
}

/// The class of a model: that of its `material` in `model_info.json`, or else a usual one of its super-category, which
/// is our choice.
pub(super) fn class_of_model(material: Option<&str>, super_category: &str) -> MaterialClass {
    material.and_then(class_named).unwrap_or(match super_category {
        "Sofa" | "Bed" | "Pier/Stool" => MaterialClass::Cloth,
        "Chair" | "Table" => MaterialClass::Wood,
        "Cabinet/Shelf/Desk" => MaterialClass::Board,
        _ => MaterialClass::Plastic,
    })
}

/// The class of a model's group: that of its name, or else the model's.
pub(super) fn class_of_group(name: &str, model: MaterialClass) -> MaterialClass {
    class_named(name).unwrap_or(model)
}

/// The class of a mesh of the architecture: that of its material's content type, or else a usual one of its type and
/// room, which is our choice: floors are of wood, or of tiles where they become wet; fittings are lacquered; all else
/// is painted.
pub(super) fn class_of_architecture(content: Option<&str>, kind: &str, room: &str) -> MaterialClass {
    const WET: [&str; 3] = ["bathroom", "kitchen", "balcony"];
    const FITTINGS: [&str; 9] =
        ["baseboard", "door", "window", "cabinet", "pocket", "hole", "furniture", "wainscot", "lightband"];
    let (kind, room) = (kind.to_lowercase(), room.to_lowercase());
    let is_any = |text: &str, words: &[&str]| words.iter().any(|word| text.contains(word));
    content.and_then(class_named).unwrap_or(match () {
        () if kind.contains("floor") && is_any(&room, &WET) => MaterialClass::Tile,
        () if kind.contains("floor") => MaterialClass::Wood,
        () if is_any(&kind, &FITTINGS) => MaterialClass::Lacquer,
        () => MaterialClass::Paint,
    })
}

/// A class, lower-case words that select it where the data's name contains one of them, least and most perceptual
/// roughness, and metallic.
type ClassRow = (MaterialClass, &'static [&'static str], [f32; 2], f32);

/// Every class, below the source of its numbers. Words are compared row by row, so `rough cloth` is looked for before
/// `cloth`, and `plywood` before `wood`.
const TABLE: [ClassRow; 15] = [
    // Our choice: smooth but for what lets highlights of lamps be sampled; no chart that we read lists it.
    (MaterialClass::Glass, &["glass"], [0.05, 0.1], 0.0),
    // Roblox, Worn Metals: 0.2 to 0.4, metalness 1.
    (MaterialClass::Metal, &["metal", "steel", "chrome", "iron", "brass", "copper", "gold"], [0.2, 0.4], 1.0),
    // MaterialX, standard_surface_marble_solid: 0.1; Roblox, Marble: 0.375.
    (MaterialClass::Stone, &["marble", "stone", "granite"], [0.1, 0.375], 0.0),
    // Our choice: a glaze is glass, but less even; no chart that we may cite lists it.
    (MaterialClass::Tile, &["tile", "ceramic", "porcelain"], [0.1, 0.3], 0.0),
    // Roblox, Glossy Leather: 0.2 to 0.4.
    (MaterialClass::SmoothLeather, &["smooth leather"], [0.2, 0.4], 0.0),
    // Roblox, Worn Leather: 0.5 to 0.7.
    (MaterialClass::Leather, &["leather"], [0.5, 0.7], 0.0),
    // Roblox, Velvet, Suede: 0.6 to 0.8. Its metalness of 0.4 to 0.6 imitates sheen and is left out.
    (MaterialClass::Suede, &["suede", "velvet"], [0.6, 0.8], 0.0),
    // Roblox, Worn Wood: 0.7 to 0.9.
    (MaterialClass::Wicker, &["rattan", "bamboo", "wicker"], [0.7, 0.9], 0.0),
    // Roblox, Wool, Linen: 0.9 to 0.96.
    (MaterialClass::CoarseCloth, &["rough cloth", "carpet", "wool", "linen"], [0.9, 0.96], 0.0),
    // Roblox, Cotton, Canvas, Denim: 0.8 to 0.9.
    (MaterialClass::Cloth, &["cloth", "fabric", "cushion", "pillow"], [0.8, 0.9], 0.0),
    // Our choice: matt and silk emulsion, of which the charts above list none.
    (MaterialClass::Paint, &["paint", "wallpaper", "plaster"], [0.6, 0.9], 0.0),
    // Roblox, Painted Metal: 0.3. Our choice: up to 0.5 for satin.
    (MaterialClass::Lacquer, &["lacquer"], [0.3, 0.5], 0.0),
    // Roblox, plastic: 0.1 (glossy) to 0.4 (matte). Our choice: without the high gloss, since faces are melamine.
    (MaterialClass::Board, &["composite board", "plywood", "composition"], [0.2, 0.4], 0.0),
    // Roblox: from the end of Glossy Wood (0.2 to 0.3) to the start of Worn Wood (0.7 to 0.9).
    (MaterialClass::Wood, &["wood"], [0.3, 0.7], 0.0),
    // Roblox, Glossy Plastic: 0.1; Matte Plastic: 0.4.
    (MaterialClass::Plastic, &["plastic", "emissive"], [0.1, 0.4], 0.0),
];

/// The first class of the table with a word that `name` contains.
pub fn class_named(name: &str) -> Option<MaterialClass> {
    let name = name.to_lowercase();
    TABLE.iter().find(|(_, words, ..)| words.iter().any(|word| name.contains(word))).map(|(class, ..)| *class)
}

/// Roughness and metallic of the material `id` of a class. The roughness is drawn from the class's range: it is the
/// same for the same seed, id and class.
pub(super) fn drawn(class: MaterialClass, id: &str, seed: u64) -> [f32; 2] {
    let hash = sha256_of_bytes(format!("{seed}/{id}/{class}").as_bytes());
    let bits = u32::from_str_radix(&hash[..6], 16).expect("a hash is hexadecimal");
    let ([low, high], metallic) = finish_of(class);
    [low + (high - low) * (bits as f32 / (1 << 24) as f32), metallic]
}

/// Least and most roughness of a class, and its metallic.
pub fn finish_of(class: MaterialClass) -> ([f32; 2], f32) {
    let row = TABLE.iter().find(|(of, ..)| *of == class).expect("a test finds a row for every class");
    (row.2, row.3)
}

/// Texels of a class's block. Lookups stay in the middle half of the block, so that all four texels of a bilinear
/// lookup belong to it, also a little beyond a triangle's edge.
pub(super) const BLOCK: usize = 4;

/// The most units of u over which a model's uv may spread. Beyond them a shifted u would lose precision.
const MOST_SPREAD: f32 = 64.0;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Finish {
    /// The distinct classes; each has a block of the texture, in this order.
    pub(super) classes: Vec<MaterialClass>,
    /// The map from the surface's uv to that texture's.
    pub(super) uv: UvTransform,
    /// The class of each part; absent if its triangles belong to several.
    pub(super) of_parts: Vec<Option<MaterialClass>>,
}

impl Finish {
    /// One class for a surface; `parts` holds the part of each triangle.
    pub(super) fn uniform(class: MaterialClass, parts: &[usize]) -> Self {
        let of_parts = vec![Some(class); 1 + parts.iter().max().copied().unwrap_or(0)];
        Self { classes: vec![class], uv: UvTransform::default(), of_parts }
    }

    /// The class `of_triangle` of each triangle, whose part is `parts`. Moves the uv of the mesh as the texture needs,
    /// and duplicates vertices that triangles of different classes share. None, with the mesh unchanged, where the uv
    /// spread over more than [`MOST_SPREAD`] units.
    pub(super) fn laid_out(mesh: &mut TriangleMesh, of_triangle: &[MaterialClass], parts: &[usize]) -> Option<Self> {
        let mut classes = of_triangle.to_vec();
        classes.sort_unstable();
        classes.dedup();
        let mut of_parts = vec![None; parts.iter().max().map_or(0, |last| last + 1)];
        for (part, of_part) in of_parts.iter_mut().enumerate() {
            let mut own = parts.iter().zip(of_triangle).filter(|(of, _)| **of == part).map(|(_, class)| *class);
            let first = own.next();
            *of_part = first.filter(|class| own.all(|other| other == *class));
        }
        if classes.len() == 1 {
            return Some(Self { classes, uv: UvTransform::default(), of_parts });
        }
        // The range of u in whole units. Each class's is moved to the middle of its own range of twice that width.
        let uvs = mesh.uvs.get_or_insert_with(|| vec![Vec2::ZERO; mesh.positions.len()]);
        let low = uvs.iter().map(|uv| uv.x).fold(f32::INFINITY, f32::min).floor();
        let high = uvs.iter().map(|uv| uv.x).fold(f32::NEG_INFINITY, f32::max).ceil();
        let spread = (high - low).max(1.0);
        if spread > MOST_SPREAD {
            return None;
        }
        let blocks: Vec<usize> =
            of_triangle.iter().map(|class| classes.binary_search(class).expect("classes holds them all")).collect();
        shift(mesh, &blocks, 2.0 * spread);
        let scale = 1.0 / (2.0 * spread * classes.len() as f32);
        let offset = 0.25 / classes.len() as f32 - low * scale;
        Some(Self { classes, uv: UvTransform([[scale, 0.0, offset], [0.0, 1.0, 0.0]]), of_parts })
    }
}

/// Adds `blocks[triangle] * step` to the u of every triangle's corners.
fn shift(mesh: &mut TriangleMesh, blocks: &[usize], step: f32) {
    // The first block that uses a vertex keeps it, others get a copy.
    let mut owner: Vec<Option<usize>> = vec![None; mesh.positions.len()];
    let mut copies: BTreeMap<(u32, usize), u32> = BTreeMap::new();
    for (triangle, &block) in blocks.iter().enumerate() {
        for corner in 0..3 {
            let vertex = mesh.triangles[triangle][corner];
            if *owner[vertex as usize].get_or_insert(block) != block {
                mesh.triangles[triangle][corner] = *copies.entry((vertex, block)).or_insert_with(|| {
                    owner.push(Some(block));
                    mesh.copy_vertex(vertex)
                });
            }
        }
    }
    for (uv, block) in mesh.uvs.iter_mut().flatten().zip(owner) {
        uv.x += step * block.unwrap_or(0) as f32;
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_testkit::scenes::quad;

    use super::*;

    #[test]
    fn every_class_has_one_row_and_a_range() {
        let mut classes: Vec<MaterialClass> = TABLE.iter().map(|(class, ..)| *class).collect();
        classes.sort_unstable();
        assert_eq!(classes, MaterialClass::ALL);
        for (class, _, [low, high], metallic) in TABLE {
            assert!(0.0 < low && low < high && high <= 1.0, "{class}");
            assert!(metallic == 0.0 || metallic == 1.0, "{class}");
        }
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

    #[test]
    fn what_the_data_states_counts_before_what_is_usual() {
        assert_eq!(class_of_model(Some("Metal"), "Sofa"), MaterialClass::Metal);
        assert_eq!(class_of_model(Some("Others"), "Sofa"), MaterialClass::Cloth);
        assert_eq!(class_of_model(None, "Lighting"), MaterialClass::Plastic);
        assert_eq!(class_of_group("glass_002", MaterialClass::Wood), MaterialClass::Glass);
        assert_eq!(class_of_group("solid_002", MaterialClass::Wood), MaterialClass::Wood);
        assert_eq!(class_of_architecture(Some("material carpet"), "Floor", "Bathroom"), MaterialClass::CoarseCloth);
        assert_eq!(class_of_architecture(Some("material"), "Floor", "MasterBathroom"), MaterialClass::Tile);
        assert_eq!(class_of_architecture(None, "Floor", "MasterBedroom"), MaterialClass::Wood);
        assert_eq!(class_of_architecture(None, "Baseboard", "MasterBedroom"), MaterialClass::Lacquer);
        assert_eq!(class_of_architecture(None, "WallInner", "MasterBedroom"), MaterialClass::Paint);
    }

    /// Two triangles that share an edge.
    fn square(uvs: Option<Vec<Vec2>>) -> TriangleMesh {
        TriangleMesh { normals: Some(vec![Vec3::Z; 4]), uvs, ..quad(Vec3::ZERO, Vec3::X, Vec3::Y) }
    }

    fn corner_uvs() -> Vec<Vec2> {
        vec![Vec2::new(-0.5, 0.0), Vec2::new(1.0, 0.0), Vec2::ONE, Vec2::new(0.25, 1.0)]
    }

    /// Corners stay where they are, the base colour's lookup moves by whole numbers, and each class stays inside the
    /// middle half of its block.
    #[test]
    fn every_class_is_looked_up_in_its_block() {
        for uvs in [Some(corner_uvs()), None] {
            let mut mesh = square(uvs);
            let before = mesh.clone();
            let finish = Finish::laid_out(&mut mesh, &[MaterialClass::Metal, MaterialClass::Glass], &[1, 0]).unwrap();
            assert_eq!(finish.classes, [MaterialClass::Glass, MaterialClass::Metal]);
            assert_eq!(finish.of_parts, [Some(MaterialClass::Glass), Some(MaterialClass::Metal)]);
            assert_eq!(mesh.positions.len(), 6);
            assert_eq!(mesh.normals.as_ref().unwrap().len(), 6);
            for (triangle, block) in [(0, 1.0), (1, 0.0)] {
                assert_eq!(mesh.corners(triangle), before.corners(triangle));
                for corner in 0..3 {
                    let now = mesh.uvs.as_ref().unwrap()[mesh.triangles[triangle][corner] as usize];
                    let old = before.triangles[triangle][corner] as usize;
                    let old = before.uvs.as_ref().map_or(Vec2::ZERO, |uvs| uvs[old]);
                    assert_eq!((now - old).y, 0.0);
                    assert_eq!((now - old).x.fract(), 0.0);
                    let place = finish.uv.apply(now).x * 2.0 - block;
                    assert!((0.25..=0.75).contains(&place), "{place}");
                }
            }
        }
    }

    #[test]
    fn one_class_leaves_the_mesh_alone() {
        let mut mesh = square(None);
        let finish = Finish::laid_out(&mut mesh, &[MaterialClass::Wood; 2], &[0, 0]).unwrap();
        assert_eq!(finish, Finish::uniform(MaterialClass::Wood, &[0]));
        assert_eq!(mesh, square(None));
    }

    #[test]
    fn a_part_of_two_classes_has_none() {
        let mut mesh = square(None);
        let finish = Finish::laid_out(&mut mesh, &[MaterialClass::Wood, MaterialClass::Glass], &[0, 0]).unwrap();
        assert_eq!(finish.of_parts, [None]);
    }

    #[test]
    fn uv_that_spread_too_far_are_refused() {
        let mut mesh = square(Some(corner_uvs().into_iter().map(|uv| uv * 1e6).collect()));
        let before = mesh.clone();
        assert_eq!(Finish::laid_out(&mut mesh, &[MaterialClass::Wood, MaterialClass::Glass], &[0, 0]), None);
        assert_eq!(mesh, before);
    }
}
