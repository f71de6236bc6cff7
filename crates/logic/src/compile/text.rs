//! The texts of a program: a value of a STRING is the number of one.

use crate::code::Op;
use crate::diagnostic::{Diagnostics, Kind, Span};
use std::collections::{BTreeMap, BTreeSet};

/// Octets of all texts that are cut, at most.
const CUTS_MAX: usize = 1 << 24;
/// All texts, each once.
pub(super) struct Texts {
    all: Vec<String>,
    by_content: BTreeMap<String, i64>,
}

impl Texts {
    pub(super) fn new() -> Texts {
        // The text of a STRING that is given none.
        Texts {
            all: vec![String::new()],
            by_content: BTreeMap::from([(String::new(), 0)]),
        }
    }

    pub(super) fn get(&self, number: usize) -> Option<&String> {
        self.all.get(number)
    }

    /// The number of a text.
    pub(super) fn number(&mut self, text: &str) -> i64 {
        if let Some(number) = self.by_content.get(text) {
            return *number;
        }
        let number = self.all.len() as i64;
        self.all.push(text.to_owned());
        self.by_content.insert(text.to_owned(), number);
        number
    }

    /// Every text of the program, cut to every length that it may be cut to: length, text, what is left of it.
    pub(super) fn cuts(&mut self, code: &[Op], told: &mut Diagnostics<'_>) -> Vec<(u32, u32, u32)> {
        let lengths: BTreeSet<u32> = code
            .iter()
            .filter_map(|op| if let Op::Cut(length) = op { Some(*length) } else { None })
            .collect();
        let (mut cuts, mut octets, mut number) = (Vec::new(), 0, 0);
        // What is left of a text may be cut again.
        while let Some(text) = self.get(number).filter(|_| !lengths.is_empty()).cloned() {
            let mut lengths = lengths.iter().peekable();
            for (length, (end, _)) in text.char_indices().enumerate() {
                if lengths.next_if(|wanted| **wanted as usize == length).is_some() {
                    octets += end;
                    if octets > CUTS_MAX {
                        told.error(Span::default(), Kind::Texts { most: CUTS_MAX });
                        return Vec::new();
                    }
                    let short = self.number(&text[..end]) as u32;
                    cuts.push((length as u32, number as u32, short));
                }
            }
            number += 1;
        }
        cuts.sort_unstable();
        cuts
    }

    /// Of each text its place in the order of all, by the codes of their characters.
    pub(super) fn ranks(&self, code: &[Op]) -> Vec<u32> {
        if !code.contains(&Op::Rank) {
            return Vec::new();
        }
        let mut sorted: Vec<usize> = (0..self.all.len()).collect();
        sorted.sort_unstable_by_key(|text| &self.all[*text]);
        let mut ranks = vec![0; sorted.len()];
        for (rank, text) in sorted.into_iter().enumerate() {
            ranks[text] = rank as u32;
        }
        ranks
    }

    pub(super) fn into_all(self) -> Box<[String]> {
        self.all.into()
    }
}
