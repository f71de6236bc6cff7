//! Elements of the window, found by place.
//!
//! In:  elements in program order.
//! Out: those close to another one.
//!
//! A uniform grid of cells of twice the radius: what is no further away than the radius is in the same cell or in one of the
//! eight around it. The memory is that of the elements, however long they are.

use std::collections::VecDeque;

use super::super::element::Element;
use super::super::geometry::{Point, add, length, scale, sub};

/// Elements that pass more cells than this stand beside the grid.
const CELLS_MAX: f64 = 128.0;

/// Cells are not smaller than this, mm.
const CELL_MIN_MM: f64 = 1e-3;

/// Number of lists to which the cells are spread; a power of two. Two cells in one list cost time, nothing else.
const LISTS: usize = 1 << 13;

/// See the [module](self).
#[derive(Clone, Debug)]
pub(super) struct Store<T> {
    reach_mm: f64,
    cell_mm: f64,
    /// Number of elements taken out at the front.
    gone: u64,
    items: VecDeque<Item<T>>,
    /// Keys of cells and numbers of elements in growing order, those that are gone among them.
    lists: Vec<VecDeque<(u64, u64)>>,
    beside: VecDeque<u64>,
    search: u64,
}

#[derive(Clone, Debug)]
struct Item<T> {
    circle: Circle,
    /// Last search that came by.
    search: u64,
    what: T,
}

/// A circle around an element.
#[derive(Clone, Copy, Debug)]
struct Circle {
    centre: Point,
    radius: f64,
}

impl Circle {
    fn around(element: &Element) -> Circle {
        match element.arc {
            Some(arc) if arc.sweep.abs() > std::f64::consts::PI => Circle {
                centre: arc.centre,
                radius: arc.radius,
            },
            Some(_) => {
                let centre = element.at(0.5);
                Circle {
                    centre,
                    radius: length(sub(element.at(0.0), centre)).max(length(sub(element.to, centre))),
                }
            }
            None => Circle {
                centre: scale(add(element.from, element.to), 0.5),
                radius: 0.5 * length(sub(element.to, element.from)),
            },
        }
    }
}

impl<T> Store<T> {
    /// For searches that reach so far.
    pub(super) fn new(reach_mm: f64) -> Store<T> {
        Store {
            reach_mm,
            cell_mm: (2.0 * reach_mm).max(CELL_MIN_MM),
            gone: 0,
            items: VecDeque::new(),
            lists: vec![VecDeque::new(); LISTS],
            beside: VecDeque::new(),
            search: 0,
        }
    }

    /// Number of elements that there were.
    pub(super) fn end(&self) -> u64 {
        self.gone + self.items.len() as u64
    }

    /// How far searches reach.
    pub(super) fn reach_mm(&self) -> f64 {
        self.reach_mm
    }

    /// Numbers of the elements that there are.
    pub(super) fn numbers(&self) -> std::ops::Range<u64> {
        self.gone..self.end()
    }

    pub(super) fn get(&self, number: u64) -> Option<&T> {
        let index = number.checked_sub(self.gone)?;
        self.items.get(index as usize).map(|item| &item.what)
    }

    pub(super) fn len(&self) -> usize {
        self.items.len()
    }

    pub(super) fn front(&self) -> Option<&T> {
        self.items.front().map(|item| &item.what)
    }

    pub(super) fn pop(&mut self) {
        self.gone += u64::from(self.items.pop_front().is_some());
    }

    pub(super) fn push(&mut self, element: &Element, what: T) {
        let number = self.end();
        match self.cells(element) {
            None => self.beside.push_back(number),
            Some(cells) => {
                for cell in cells {
                    let key = key_of(cell);
                    let list = &mut self.lists[list_of(key)];
                    while list.front().is_some_and(|(_, first)| *first < self.gone) {
                        list.pop_front();
                    }
                    if list.back() != Some(&(key, number)) {
                        list.push_back((key, number));
                    }
                }
            }
        }
        self.items.push_back(Item {
            circle: Circle::around(element),
            search: self.search,
            what,
        });
    }

    /// Shows the elements that may be closer to `element` than the reach, each once, in an order that depends on nothing but
    /// the elements, until `visit` finds something.
    pub(super) fn near<R>(&mut self, element: &Element, mut visit: impl FnMut(&T) -> Option<R>) -> Option<R> {
        let circle = Circle::around(element);
        let reach = self.reach_mm;
        let close = |other: &Circle| {
            let apart = sub(circle.centre, other.centre);
            let sum = circle.radius + other.radius + reach;
            let square = apart[0] * apart[0] + apart[1] * apart[1];
            square <= sum * sum || square.is_nan()
        };
        let Some(cells) = self.cells(element) else {
            let mut items = self.items.iter().filter(|item| close(&item.circle));
            return items.find_map(|item| visit(&item.what));
        };
        self.search += 1;
        while self.beside.front().is_some_and(|first| *first < self.gone) {
            self.beside.pop_front();
        }
        let mut last = None;
        for [x, y] in cells {
            if last == Some([x, y]) {
                continue;
            }
            last = Some([x, y]);
            for (dx, dy) in AROUND {
                let key = key_of([x + dx, y + dy]);
                for (of, number) in self.lists[list_of(key)].iter().rev() {
                    if *of != key {
                        continue;
                    }
                    let Some(index) = number.checked_sub(self.gone) else {
                        break;
                    };
                    let item = &mut self.items[index as usize];
                    if item.search == self.search {
                        continue;
                    }
                    item.search = self.search;
                    if close(&item.circle)
                        && let Some(found) = visit(&item.what)
                    {
                        return Some(found);
                    }
                }
            }
        }
        for number in &self.beside {
            let item = &self.items[(number - self.gone) as usize];
            if close(&item.circle)
                && let Some(found) = visit(&item.what)
            {
                return Some(found);
            }
        }
        None
    }

    /// Cells along an element, close enough to each other that every point of it is within a quarter of a cell of a point
    /// looked at; `None` for an element that passes too many.
    fn cells(&self, element: &Element) -> Option<impl Iterator<Item = [i64; 2]> + use<T>> {
        let steps = (element.length() / (0.5 * self.cell_mm)).ceil().max(1.0);
        if steps > CELLS_MAX || steps.is_nan() {
            return None;
        }
        let (element, cell_mm) = (*element, self.cell_mm);
        Some((0..steps as u32).map(move |step| {
            let at = element.at((f64::from(step) + 0.5) / steps);
            // Coordinates are below 1e9 mm; the bound is that of what a number of a cell can be.
            at.map(|x| (x / cell_mm).floor().clamp(-1e15, 1e15) as i64)
        }))
    }
}

const AROUND: [(i64, i64); 9] = [
    (0, 0),
    (-1, 0),
    (1, 0),
    (0, -1),
    (0, 1),
    (-1, -1),
    (1, -1),
    (-1, 1),
    (1, 1),
];

/// A number for a cell. Two cells with the same one cost time, nothing else.
fn key_of([x, y]: [i64; 2]) -> u64 {
    let mixed = (x as u64)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add((y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f));
    mixed ^ (mixed >> 32)
}

fn list_of(key: u64) -> usize {
    (key >> 16) as usize & (LISTS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(store: &mut Store<u32>, from: Point, to: Point) -> Vec<u32> {
        let mut found = Vec::new();
        store.near(&Element::line(from, to), |what| {
            found.push(*what);
            None::<()>
        });
        found.sort_unstable();
        found
    }

    #[test]
    fn what_is_near_is_found_and_what_is_far_is_not() {
        let mut store = Store::new(1.0);
        for i in 0..50 {
            let x = 3.0 * f64::from(i);
            store.push(&Element::line([x, 0.0], [x, 0.5]), i);
        }
        // Longer than the grid takes.
        store.push(&Element::line([0.0, 700.0], [1000.0, 700.0]), 99);
        assert_eq!(found(&mut store, [30.5, 1.0], [30.5, 1.2]), [10]);
        assert_eq!(found(&mut store, [-5.0, 0.5], [200.0, 0.5]).len(), 50);
        assert_eq!(found(&mut store, [900.0, 699.0], [900.0, 699.5]), [99]);
        assert!(found(&mut store, [500.0, -4.0], [500.0, -3.0]).is_empty());
        for _ in 0..11 {
            store.pop();
        }
        assert!(found(&mut store, [30.5, 1.0], [30.5, 1.2]).is_empty());
        assert_eq!(found(&mut store, [33.5, 1.0], [33.5, 1.2]), [11]);
        assert_eq!((store.len(), store.end()), (40, 51));
        assert_eq!(store.front(), Some(&11));
    }
}
