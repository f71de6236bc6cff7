//! Fewer points that show the same: the least and the greatest value of each stretch, so that no peak is lost.
//!
//! In:  samples in their order. Out: columns; a value that is no number counts only where there is no other.

/// Some cycles in a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Of its first cycle, ns on the time of the record.
    pub time_ns: i64,
    /// Cycles in it.
    pub samples: u64,
    /// Least and greatest value of each channel; NaN where there was no number.
    pub ranges: Vec<[f64; 2]>,
}

impl Column {
    fn new(time_ns: i64, values: impl Iterator<Item = f64>) -> Column {
        Column {
            time_ns,
            samples: 1,
            ranges: values.map(|value| [value; 2]).collect(),
        }
    }

    fn merge(&mut self, samples: u64, ranges: impl Iterator<Item = [f64; 2]>) {
        self.samples += samples;
        for (own, [least, greatest]) in self.ranges.iter_mut().zip(ranges) {
            // Both give the other one where one is no number.
            *own = [own[0].min(least), own[1].max(greatest)];
        }
    }
}

/// Columns of so many cycles each.
#[derive(Debug)]
pub struct Thinner {
    per_column: u64,
    open: Option<Column>,
}

impl Thinner {
    /// `per_column`: cycles in a column, from 1 on.
    pub fn new(per_column: u64) -> Thinner {
        Thinner {
            per_column: per_column.max(1),
            open: None,
        }
    }

    /// Takes a cycle; gives the column that it makes whole.
    pub fn push(&mut self, time_ns: i64, values: impl Iterator<Item = f64>) -> Option<Column> {
        match &mut self.open {
            None => self.open = Some(Column::new(time_ns, values)),
            Some(open) => open.merge(1, values.map(|value| [value; 2])),
        }
        self.open.take_if(|open| open.samples >= self.per_column)
    }

    /// What has come of a column that is not whole.
    pub fn finish(&mut self) -> Option<Column> {
        self.open.take()
    }
}

/// A whole record of any length in a bounded number of columns.
#[derive(Debug)]
pub struct Fitted {
    most: usize,
    columns: Vec<Column>,
    thinner: Thinner,
}

impl Fitted {
    /// `most`: columns at the most, from 2 on.
    pub fn new(most: usize) -> Fitted {
        Fitted {
            most: most.max(2),
            columns: Vec::new(),
            thinner: Thinner::new(1),
        }
    }

    /// Takes a cycle.
    pub fn push(&mut self, time_ns: i64, values: impl Iterator<Item = f64>) {
        let Some(column) = self.thinner.push(time_ns, values) else {
            return;
        };
        self.columns.push(column);
        if self.columns.len() >= self.most {
            // Two become one, and so on from here.
            self.thinner.per_column *= 2;
            let old = std::mem::take(&mut self.columns);
            let mut old = old.into_iter();
            while let Some(mut column) = old.next() {
                if let Some(next) = old.next() {
                    column.merge(next.samples, next.ranges.into_iter());
                    self.columns.push(column);
                } else {
                    self.thinner.open = Some(column);
                }
            }
        }
    }

    /// All columns so far.
    pub fn columns(&self) -> impl Iterator<Item = &Column> {
        self.columns.iter().chain(&self.thinner.open)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn extremes(values: &[f64]) -> [f64; 2] {
        let fold = |pick: fn(f64, f64) -> f64| values.iter().copied().fold(f64::NAN, pick);
        [fold(f64::min), fold(f64::max)]
    }

    fn same(a: [f64; 2], b: [f64; 2]) -> bool {
        a.iter()
            .zip(b)
            .all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan() || *a == b)
    }

    proptest! {
        #[test]
        fn every_column_has_the_extremes_of_its_cycles(
            values in prop::collection::vec(prop_oneof![9 => -1e3f64..1e3, 1 => Just(f64::NAN)], 0..200), per_column in 0u64..20,
        ) {
            let mut thinner = Thinner::new(per_column);
            let pushed = values.iter().enumerate().filter_map(|(at, value)| thinner.push(at as i64, [*value, -value].into_iter()));
            let mut columns: Vec<Column> = pushed.collect();
            columns.extend(thinner.finish());
            let chunks: Vec<&[f64]> = values.chunks(per_column.max(1) as usize).collect();
            prop_assert_eq!(columns.len(), chunks.len());
            let mut at = 0;
            for (column, chunk) in columns.iter().zip(chunks) {
                prop_assert_eq!((column.time_ns, column.samples), (at, chunk.len() as u64));
                at += chunk.len() as i64;
                let [least, greatest] = extremes(chunk);
                prop_assert!(same(column.ranges[0], [least, greatest]), "{:?} {:?}", column, chunk);
                prop_assert!(same(column.ranges[1], [-greatest, -least]));
            }
        }

        #[test]
        fn a_record_of_any_length_keeps_its_extremes_in_a_bounded_number_of_columns(
            values in prop::collection::vec(-1e3f64..1e3, 0..600), most in 0usize..40,
        ) {
            let mut fitted = Fitted::new(most);
            for (at, value) in values.iter().enumerate() {
                fitted.push(at as i64, [*value].into_iter());
                prop_assert!(fitted.columns().count() <= most.max(2));
            }
            let mut at = 0;
            for column in fitted.columns() {
                let chunk = &values[at..at + column.samples as usize];
                prop_assert_eq!(column.time_ns, at as i64);
                prop_assert!(same(column.ranges[0], extremes(chunk)));
                at += chunk.len();
            }
            prop_assert_eq!(at, values.len(), "each cycle is in one column");
        }
    }
}
