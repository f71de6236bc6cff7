//! Keeps the journal from being filled by one thing that happens again and again: what else is there is evidence.
//!
//! In:  entries as they come. Out: whether each is told, and how many were not.

/// Entries of one kind that are told in a window; more of them are counted.
const TOLD_MAX: u32 = 30;
/// Length of a window, s.
const WINDOW_S: f64 = 60.0;
/// Kinds that are known at a time; all others are one.
const KINDS_MAX: usize = 256;

/// Entries of one kind in one window.
#[derive(Debug)]
struct Burst {
    kind: String,
    since_s: f64,
    told: u32,
    more: u32,
}

/// What came lately.
#[derive(Debug, Default)]
pub(super) struct Bursts(Vec<Burst>);

/// What entries of one kind have in common: all of their text; of overrides, not where they stand.
fn kind(text: &str) -> &str {
    match text.strip_suffix(" %") {
        Some(override_at) => override_at.trim_end_matches(|letter: char| !letter.is_alphabetic()),
        None => text,
    }
}

impl Bursts {
    /// Whether an entry is told; else it is counted.
    pub(super) fn tells(&mut self, time_s: f64, text: &str) -> bool {
        let kind = kind(text);
        let at = self.0.iter().position(|burst| burst.kind == kind).or_else(|| {
            let is_full = self.0.len() >= KINDS_MAX;
            is_full.then_some(KINDS_MAX - 1)
        });
        let burst = match at {
            Some(at) => &mut self.0[at],
            None => {
                self.0.push(Burst {
                    kind: kind.to_owned(),
                    since_s: time_s,
                    told: 0,
                    more: 0,
                });
                let last = self.0.len() - 1;
                &mut self.0[last]
            }
        };
        let is_told = burst.told < TOLD_MAX;
        *(if is_told { &mut burst.told } else { &mut burst.more }) += 1;
        is_told
    }

    /// What was counted in windows that are over.
    pub(super) fn counted(&mut self, time_s: f64) -> Vec<String> {
        let is_over = |burst: &Burst| time_s - burst.since_s >= WINDOW_S;
        if !self.0.iter().any(is_over) {
            return Vec::new();
        }
        let (over, under_way) = std::mem::take(&mut self.0).into_iter().partition(is_over);
        self.0 = under_way;
        let over: Vec<Burst> = over;
        let counted = over.into_iter().filter(|burst| burst.more > 0);
        counted
            .map(|burst| format!("{}: {} more times within {WINDOW_S} s", burst.kind, burst.more))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_counted_and_all_else_is_told() {
        let mut bursts = Bursts::default();
        let mut told = 0;
        for number in 0..127_300 {
            told += u32::from(bursts.tells(f64::from(number) * 4e-4, "order: stop"));
            told += u32::from(bursts.tells(0.0, &format!("feed override {}.{number} %", 100 - number / 2000)));
        }
        assert_eq!(told, 2 * TOLD_MAX);
        assert!(bursts.tells(59.0, "order: hold"));
        assert_eq!(bursts.counted(59.9), Vec::<String>::new());
        let counted = bursts.counted(60.0);
        assert_eq!(
            counted,
            [
                "order: stop: 127270 more times within 60 s",
                "feed override: 127270 more times within 60 s"
            ]
        );
        assert!(bursts.tells(61.0, "order: stop"), "a new window");
        // As many kinds as anybody can think of.
        for number in 0..100_000 {
            bursts.tells(61.0, &format!("order: {number}"));
        }
        assert_eq!(bursts.0.len(), KINDS_MAX);
    }
}
