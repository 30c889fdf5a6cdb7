//! The columns of the board that hold no scores: what is known about a method besides its numbers.
//!
//! A new column is one entry of [`FACTS`].

use mateval_eval::result::ProtocolResult;
use serde::Serialize;

use super::file::LeaderboardMethod;

/// The columns, from left to right, behind those of scores.
pub(super) const FACTS: [FactColumn; 2] = [
    FactColumn { key: "cost", title: "Seconds a scene", is_word: false, of: cost },
    FactColumn { key: "licence", title: "Licence", is_word: true, of: licence },
];

/// The most characters of a text that a cell shows.
const MOST_CHARACTERS: usize = 60;

/// One column.
#[derive(Clone, Copy, Serialize)]
pub(super) struct FactColumn {
    /// Its name in links to a sorted board.
    key: &'static str,
    /// Its head.
    title: &'static str,
    /// Whether its cells hold words, which are aligned to the left.
    is_word: bool,
    /// Its cell for a method; none if the method does not state it.
    #[serde(skip)]
    of: fn(&LeaderboardMethod, &ProtocolResult) -> Option<Fact>,
}

/// One cell.
#[derive(Serialize)]
pub(super) struct Fact {
    /// What the column is sorted by: a number with all digits, or a word.
    value: String,
    /// The text of the cell.
    text: String,
    /// Small print below the text.
    note: String,
}

/// A method's cells, one for each of [`FACTS`].
pub(super) fn facts(method: &LeaderboardMethod, scores: &ProtocolResult) -> Vec<Option<Fact>> {
    FACTS.iter().map(|column| (column.of)(method, scores)).collect()
}

fn cost(method: &LeaderboardMethod, _: &ProtocolResult) -> Option<Fact> {
    let cost = method.cost.as_ref()?;
    let value = cost.seconds_a_scene.to_string();
    Some(Fact { value, text: seconds(cost.seconds_a_scene), note: shortened(&cost.hardware) })
}

fn licence(method: &LeaderboardMethod, _: &ProtocolResult) -> Option<Fact> {
    let licence = method.licence.as_ref().filter(|licence| !licence.is_empty())?;
    Some(Fact { value: licence.clone(), text: shortened(licence), note: String::new() })
}

/// Seconds, rounded. Submissions state any number, and a column has a limited width.
pub(super) fn seconds(seconds: f64) -> String {
    match seconds {
        1e7.. => format!("{seconds:.1e}"),
        100.0.. => format!("{seconds:.0}"),
        _ => format!("{seconds:.1}"),
    }
}

/// The text, cut after [`MOST_CHARACTERS`].
fn shortened(text: &str) -> String {
    let cut = text.char_indices().nth(MOST_CHARACTERS);
    cut.map_or_else(|| text.to_owned(), |(end, _)| format!("{}…", &text[..end]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_stay_short() {
        assert_eq!(
            [0.04, 12.34, 99.96, 123.4, 9_999_999.0, 1e300].map(seconds),
            ["0.0", "12.3", "100.0", "123", "9999999", "1.0e300"]
        );
        assert_eq!(shortened("MIT"), "MIT");
        assert_eq!(shortened(&"é".repeat(60)), "é".repeat(60));
        assert_eq!(shortened(&"é".repeat(61)), format!("{}…", "é".repeat(60)));
    }
}
