//! Which of some known words was probably meant.
//!
//! In:  a word that is not known, and those that are.
//! Out: the nearest of them, if it is near enough to be worth a hint.

/// The candidate with the fewest changes (letters put in, left out, changed or swapped with their neighbour); at most
/// one change for a word of up to 4 letters, two for longer ones. Case does not count.
pub(crate) fn nearest<'c>(word: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<&'c str> {
    let word: Vec<char> = word.chars().flat_map(char::to_lowercase).collect();
    let most = if word.len() <= 4 { 1 } else { 2 };
    candidates
        .into_iter()
        .map(|candidate| (distance(&word, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= most && *distance < candidate.chars().count())
        .min() // of several the first by the alphabet, in whatever order they come
        .map(|(_, candidate)| candidate)
}

/// Changes that turn `word` into `candidate` (optimal string alignment).
pub(crate) fn distance(word: &[char], candidate: &str) -> usize {
    let candidate: Vec<char> = candidate.chars().flat_map(char::to_lowercase).collect();
    let width = candidate.len() + 1;
    let mut before_last: Vec<usize> = vec![0; width];
    let mut last: Vec<usize> = (0..width).collect();
    for row in 1..=word.len() {
        let mut now = vec![row; width];
        for column in 1..width {
            let changed = usize::from(word[row - 1] != candidate[column - 1]);
            now[column] = (last[column] + 1)
                .min(now[column - 1] + 1)
                .min(last[column - 1] + changed);
            let swapped = row > 1
                && column > 1
                && word[row - 1] == candidate[column - 2]
                && word[row - 2] == candidate[column - 1];
            if swapped {
                now[column] = now[column].min(before_last[column - 2] + 1);
            }
        }
        before_last = std::mem::replace(&mut last, now);
    }
    last[width - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_changes_are_a_near_miss() {
        let known = ["SQRT", "SIN", "ASIN", "ROUND", "_depth"];
        assert_eq!(nearest("sqr", known), Some("SQRT"));
        assert_eq!(nearest("SRQT", known), Some("SQRT"));
        assert_eq!(nearest("SINE", known), Some("SIN"));
        assert_eq!(nearest("depth", known), Some("_depth"));
        assert_eq!(nearest("rounding", known), None);
        assert_eq!(nearest("", known), None);
        assert_eq!(nearest("x", ["y"]), None);
    }
}
