//! Which graphs are likely on which things: weak odds, so that what is seen decides.

/// How much a graph is preferred for a category, in log-odds from -1 to 1; 0 for categories that are not in the table.
pub(super) fn log_odds(category: Option<&str>, graph: &str) -> f64 {
    let Some(category) = category else { return 0.0 };
    let category = category.to_lowercase();
    let row = TABLE.iter().find(|row| row.words.iter().any(|word| category.contains(word)));
    row.map_or(0.0, |row| match graph {
        _ if row.likely.contains(&graph) => 1.0,
        _ if row.unlikely.contains(&graph) => -1.0,
        _ => 0.0,
    })
}

/// Things of one kind.
struct Row {
    /// Words of which a category has one.
    words: &'static [&'static str],
    likely: &'static [&'static str],
    unlikely: &'static [&'static str],
}

const FABRICS: &[&str] = &["stripes", "plaid", "houndstooth", "weave", "corduroy", "leather"];
const STONES: &[&str] = &["roughcast", "concrete", "terrazzo", "granite", "travertine", "brick"];

/// The first row that has a word of the category counts.
const TABLE: [Row; 7] = [
    Row {
        words: &["table", "desk", "cabinet", "shelf", "wardrobe", "drawer", "door", "stool"],
        likely: &["paint", "veneer", "marble"],
        unlikely: &["brick", "roughcast", "carpet", "concrete"],
    },
    Row {
        words: &["rug", "carpet"],
        likely: &["carpet", "stripes", "trellis", "checks", "weave"],
        unlikely: &["brick", "metal", "plank", "granite", "concrete"],
    },
    Row {
        words: &["floor"],
        likely: &["plank", "strip_parquet", "herringbone", "basket_parquet", "tile", "carpet"],
        unlikely: &["houndstooth", "corduroy", "plaid", "leather", "metal", "roughcast"],
    },
    Row {
        words: &["ceiling"],
        likely: &["paint", "plaster"],
        unlikely: &["carpet", "leather", "houndstooth", "corduroy", "granite"],
    },
    Row {
        words: &["wall"],
        likely: &["paint", "plaster", "brick", "roughcast", "tile"],
        unlikely: &["carpet", "leather", "houndstooth", "corduroy", "metal"],
    },
    Row {
        words: &["sofa", "couch", "chair", "bed", "pillow", "cushion", "curtain"],
        likely: FABRICS,
        unlikely: STONES,
    },
    Row {
        words: &["lamp", "sink", "faucet", "refrigerator"],
        likely: &["paint", "metal"],
        unlikely: &["carpet", "brick"],
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::entry;

    #[test]
    fn known_words_prefer_graphs_and_unknown_ones_do_not() {
        assert_eq!(log_odds(Some("Floor"), "plank"), 1.0);
        assert_eq!(log_odds(Some("Corner Sofa"), "granite"), -1.0);
        assert_eq!(log_odds(Some("Bedside Table"), "veneer"), 1.0);
        assert_eq!(log_odds(Some("gizmo"), "plank"), 0.0);
        assert_eq!(log_odds(None, "plank"), 0.0);
    }

    #[test]
    fn every_graph_of_the_table_exists() {
        for name in TABLE.iter().flat_map(|row| row.likely.iter().chain(row.unlikely)) {
            assert!(entry(name).is_some(), "{name}");
        }
    }
}
