//! The name that a misspelt name was probably meant to be.

/// Longest name that is compared, in characters.
const LONGEST: usize = 80;

/// A name in lower case, letters and digits only: `Base-Color` becomes `basecolor`.
pub(super) fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The candidate nearest to `name`, comparing letters and digits only. At most a third of its letters may differ.
pub(super) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = plain(name);
    let most = (wanted.chars().count() / 3).max(1);
    candidates
        .into_iter()
        .map(|candidate| (distance(&wanted, &plain(candidate)), candidate))
        .filter(|(distance, _)| *distance <= most)
        .min()
        .map(|(_, candidate)| candidate)
}

/// The number of letters to insert, delete, change or exchange with their neighbour (optimal string alignment).
pub(super) fn distance(a: &str, b: &str) -> usize {
    let [a, b] = [a, b].map(|text| text.chars().take(LONGEST).collect::<Vec<char>>());
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for (i, j) in (0..=a.len()).flat_map(|i| (0..=b.len()).map(move |j| (i, j))) {
        if i == 0 || j == 0 {
            rows[i][j] = i + j;
            continue;
        }
        let changed = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
        let mut least = changed.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
        if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
            least = least.min(rows[i - 2][j - 2] + 1);
        }
        rows[i][j] = least;
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_known_words() {
        for (a, b, expected) in [("kitten", "sitting", 3), ("", "abc", 3), ("ab", "ba", 1), ("same", "same", 0)] {
            assert_eq!((distance(a, b), distance(b, a)), (expected, expected), "{a} {b}");
        }
    }

    #[test]
    fn the_nearest_name_or_none() {
        let known = ["wall_paper", "table", "table-2", "rug"];
        assert_eq!(nearest("Wall-Paper", known), Some("wall_paper"));
        assert_eq!(nearest("tabel", known), Some("table"));
        assert_eq!(nearest("table2", known), Some("table-2"));
        assert_eq!(nearest("sofa", known), None);
    }
}
