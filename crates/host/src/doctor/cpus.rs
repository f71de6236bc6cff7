//! Lists and masks of cores, as the kernel writes them.
//!
//! In:  text of files under /sys and /proc and of the kernel command line, which may be anything.
//! Out: a set of cores, or `None` where the text is no such list.

use std::collections::BTreeSet;
use std::fmt;

/// One more than the highest core number that any Linux knows (CONFIG_NR_CPUS); what is above is no core.
const CPU_COUNT_MAX: usize = 8192;

/// A set of cores.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cpus(BTreeSet<usize>);

impl Cpus {
    /// A list such as `0,2-3`; an empty one is a list of no cores.
    pub fn parse_list(text: &str) -> Option<Cpus> {
        Self::parse(text, &Cpus::default())
    }

    /// A list on the kernel command line: also `all`, `N` for the last core, and every `used` of each `group` cores of a
    /// range (`0-7:1/2`). Of the words of `isolcpus=` that come first it takes none.
    pub fn parse_boot_list(text: &str, possible: &Cpus) -> Option<Cpus> {
        match text {
            "all" => Some(possible.clone()),
            text => Self::parse(text, possible),
        }
    }

    fn parse(text: &str, possible: &Cpus) -> Option<Cpus> {
        let text = text.trim();
        let mut cpus = BTreeSet::new();
        for part in text.split(',').filter(|_| !text.is_empty()) {
            let (range, pattern) = match part.split_once(':') {
                Some((range, pattern)) => (range, pattern.split_once('/')?),
                None => (part, ("1", "1")),
            };
            let (used, group): (usize, usize) = (pattern.0.parse().ok()?, pattern.1.parse().ok()?);
            let (first, last) = range.split_once('-').unwrap_or((range, range));
            let (first, last) = (number(first, possible)?, number(last, possible)?);
            if first > last || group == 0 || used > group {
                return None;
            }
            cpus.extend((first..=last).filter(|cpu| (cpu - first) % group < used));
        }
        Some(Cpus(cpus))
    }

    /// A mask such as `ff` or `1,00000003`: hexadecimal, a comma every 32 bits.
    pub fn parse_mask(text: &str) -> Option<Cpus> {
        let digits: Vec<u32> = text
            .trim()
            .chars()
            .filter(|c| *c != ',')
            .map(|c| c.to_digit(16))
            .collect::<Option<_>>()?;
        if digits.is_empty() || digits.len() > CPU_COUNT_MAX / 4 {
            return None;
        }
        let bits = digits.iter().rev().enumerate();
        let cpus = bits.flat_map(|(at, digit)| {
            (0..4)
                .filter(move |bit| digit >> bit & 1 == 1)
                .map(move |bit| 4 * at + bit)
        });
        Some(Cpus(cpus.collect()))
    }

    /// Whether the core is one of them.
    pub fn contains(&self, cpu: usize) -> bool {
        self.0.contains(&cpu)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The last one.
    pub fn last(&self) -> Option<usize> {
        self.0.last().copied()
    }

    /// Each, ascending.
    pub fn iter(&self) -> impl Iterator<Item = usize> {
        self.0.iter().copied()
    }

    /// These and one more.
    pub fn with(mut self, cpu: usize) -> Cpus {
        self.0.insert(cpu);
        self
    }

    /// These without one.
    pub fn without(&self, cpu: usize) -> Cpus {
        Cpus(self.iter().filter(|other| *other != cpu).collect())
    }
}

fn number(text: &str, possible: &Cpus) -> Option<usize> {
    match text {
        "N" => possible.last(),
        text => text.parse().ok().filter(|cpu| *cpu < CPU_COUNT_MAX),
    }
}

impl fmt::Display for Cpus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut cpus = self.iter().peekable();
        let mut comma = "";
        while let Some(first) = cpus.next() {
            let mut last = first;
            while let Some(next) = cpus.next_if(|next| *next == last + 1) {
                last = next;
            }
            match last - first {
                0 => write!(f, "{comma}{first}")?,
                _ => write!(f, "{comma}{first}-{last}")?,
            }
            comma = ",";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn list(text: &str) -> Option<Vec<usize>> {
        Cpus::parse_list(text).map(|cpus| cpus.iter().collect())
    }

    #[test]
    fn lists_as_the_kernel_writes_them() {
        assert_eq!(list("0-1\n"), Some(vec![0, 1]));
        assert_eq!(list("0,2-4,7"), Some(vec![0, 2, 3, 4, 7]));
        assert_eq!(list("\n"), Some(vec![]));
        for wrong in [
            "x",
            "1-",
            "-1",
            "3-1",
            ",",
            "1,,2",
            "0-99999999999",
            "8192",
            "N",
            "0-3:1",
            "0-3:2/0",
        ] {
            assert_eq!(list(wrong), None, "{wrong}");
        }
        assert_eq!(Cpus::parse_list("7,1,2,3").unwrap().to_string(), "1-3,7");
        assert_eq!(Cpus::default().to_string(), "");
    }

    #[test]
    fn lists_on_the_command_line() {
        let possible = Cpus::parse_list("0-7").unwrap();
        let boot = |text| Cpus::parse_boot_list(text, &possible).map(|cpus| cpus.to_string());
        assert_eq!(boot("all").unwrap(), "0-7");
        assert_eq!(boot("1-N").unwrap(), "1-7");
        assert_eq!(boot("0-7:1/2").unwrap(), "0,2,4,6");
        assert_eq!(boot("0-7:3/4,7").unwrap(), "0-2,4-7");
        assert_eq!(boot("domain,1"), None);
    }

    #[test]
    fn masks_as_the_kernel_writes_them() {
        let mask = |text| Cpus::parse_mask(text).map(|cpus| cpus.to_string());
        assert_eq!(mask("f\n").unwrap(), "0-3");
        assert_eq!(mask("00000000,00000002").unwrap(), "1");
        assert_eq!(mask("1,00000001").unwrap(), "0,32");
        assert_eq!(mask("0").unwrap(), "");
        for wrong in ["", "0x3", "g", "-1"] {
            assert_eq!(mask(wrong), None, "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back(wanted in proptest::collection::btree_set(0..200usize, 0..20)) {
            let cpus = Cpus(wanted);
            prop_assert_eq!(Cpus::parse_list(&cpus.to_string()), Some(cpus));
        }

        #[test]
        fn any_text_is_a_list_or_none(text in "[0-9N,:/ f-]{0,20}") {
            let _ = Cpus::parse_list(&text);
            let _ = Cpus::parse_boot_list(&text, &Cpus::default());
            let _ = Cpus::parse_mask(&text);
        }
    }
}
