//! The benchmark's super-categories of furniture.

/// 3D-FUTURE's eight super-categories, those with the most models first.
pub const SUPER_CATEGORIES: [&str; 8] =
    ["Cabinet/Shelf/Desk", "Sofa", "Lighting", "Chair", "Others", "Bed", "Table", "Pier/Stool"];
