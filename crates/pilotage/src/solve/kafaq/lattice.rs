//! Neighbourhoods of belief means: the cells of a lattice over the world's outer bounds, and the boxes made of them.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::model::{Interval, Region as Place};

/// Equal cells that fill the bounds, numbered with the first variable fastest.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lattice {
    low: Vec<f64>,
    side: Vec<f64>,
    counts: Vec<usize>,
    /// Every box of cells, with its volume; made when first asked for.
    boxes: OnceLock<Vec<(CellBox, usize)>>,
}

/// A box of cells: first and last index along every variable, both included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct CellBox {
    pub low: Vec<usize>,
    pub high: Vec<usize>,
}

/// Number of cells of a lattice with sides of at most `side`, without making it.
pub(super) fn cells_needed(bounds: &[Interval], side: &[f64]) -> f64 {
    let along = bounds
        .iter()
        .zip(side)
        .map(|(bounds, side)| (bounds.width() / side).ceil().max(1.0));
    along.product()
}

/// Number of boxes of cells of a lattice with sides of at most `side`, without making it.
pub(super) fn boxes_needed(bounds: &[Interval], side: &[f64]) -> f64 {
    let along = bounds.iter().zip(side).map(|side| {
        let count = cells_needed(std::slice::from_ref(side.0), std::slice::from_ref(side.1));
        0.5 * count * (count + 1.0)
    });
    along.product()
}

impl Lattice {
    /// Cells of at most the given sides over finite bounds.
    pub(super) fn new(bounds: &[Interval], side: &[f64]) -> Self {
        let counts: Vec<usize> = bounds
            .iter()
            .zip(side)
            .map(|(bounds, side)| (bounds.width() / side).ceil().max(1.0) as usize)
            .collect();
        Self {
            low: bounds.iter().map(|bounds| bounds.low).collect(),
            side: bounds
                .iter()
                .zip(&counts)
                .map(|(bounds, &count)| bounds.width() / count as f64)
                .collect(),
            counts,
            boxes: OnceLock::new(),
        }
    }

    fn all_boxes(&self) -> Vec<(CellBox, usize)> {
        let mut boxes = vec![CellBox {
            low: Vec::new(),
            high: Vec::new(),
        }];
        for &count in &self.counts {
            let mut longer = Vec::with_capacity(boxes.len() * count * (count + 1) / 2);
            for known in &boxes {
                for low in 0..count {
                    for high in low..count {
                        let mut next = known.clone();
                        next.low.push(low);
                        next.high.push(high);
                        longer.push(next);
                    }
                }
            }
            boxes = longer;
        }
        boxes
            .into_iter()
            .map(|cells| {
                let volume = cells.volume();
                (cells, volume)
            })
            .collect()
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// Cells along a variable.
    pub(super) fn count(&self, variable: usize) -> usize {
        self.counts[variable]
    }

    /// Every box of cells, with its volume.
    pub(super) fn boxes(&self) -> &[(CellBox, usize)] {
        self.boxes.get_or_init(|| self.all_boxes())
    }

    /// The box of all cells.
    pub(super) fn whole(&self) -> CellBox {
        CellBox {
            low: vec![0; self.counts.len()],
            high: self.counts.iter().map(|count| count - 1).collect(),
        }
    }

    /// The cell of a mean; one outside the bounds belongs to the nearest.
    pub(super) fn cell(&self, mean: &[f64]) -> usize {
        (0..mean.len()).rev().fold(0, |cell, i| {
            // A negative quotient becomes 0.
            let index = ((mean[i] - self.low[i]) / self.side[i]) as usize;
            cell * self.counts[i] + index.min(self.counts[i] - 1)
        })
    }

    /// Index of a cell along every variable.
    pub(super) fn index(&self, mut cell: usize) -> Vec<usize> {
        self.counts
            .iter()
            .map(|count| {
                let index = cell % count;
                cell /= count;
                index
            })
            .collect()
    }

    /// Whether it is a box of cells of this lattice.
    pub(super) fn holds(&self, cells: &CellBox) -> bool {
        let n = self.counts.len();
        let side = |i: usize| cells.low[i] <= cells.high[i] && cells.high[i] < self.counts[i];
        cells.low.len() == n && cells.high.len() == n && (0..n).all(side)
    }

    /// The cells of a box.
    pub(super) fn cells<'a>(&'a self, cells: &'a CellBox) -> impl Iterator<Item = usize> + 'a {
        let mut index = Some(cells.low.clone());
        std::iter::from_fn(move || {
            let at = index.as_mut()?;
            let cell = (0..at.len())
                .rev()
                .fold(0, |cell, i| cell * self.counts[i] + at[i]);
            match (0..at.len()).find(|&i| at[i] < cells.high[i]) {
                Some(i) => {
                    at[i] += 1;
                    at[..i].copy_from_slice(&cells.low[..i]);
                }
                None => index = None,
            }
            Some(cell)
        })
    }

    /// Squared distance from a cell to a box, in units of state.
    pub(super) fn distance(&self, cell: usize, cells: &CellBox) -> f64 {
        let index = self.index(cell);
        (0..index.len())
            .map(|i| {
                let apart = cells.low[i]
                    .saturating_sub(index[i])
                    .max(index[i].saturating_sub(cells.high[i]));
                (apart as f64 * self.side[i]).powi(2)
            })
            .sum()
    }

    /// Corners of a box.
    pub(super) fn corners(&self, cells: &CellBox) -> (Vec<f64>, Vec<f64>) {
        let at = |i: usize, index: usize| self.low[i] + self.side[i] * index as f64;
        let along = 0..self.counts.len();
        (
            along.clone().map(|i| at(i, cells.low[i])).collect(),
            along.map(|i| at(i, cells.high[i] + 1)).collect(),
        )
    }

    /// The means whose cell lies in a box, those outside the bounds included.
    pub(super) fn place(&self, cells: &CellBox) -> Place {
        let (lower, upper) = self.corners(cells);
        let side = |i: usize| {
            let low = if cells.low[i] == 0 {
                f64::NEG_INFINITY
            } else {
                lower[i]
            };
            let high = if cells.high[i] + 1 == self.counts[i] {
                f64::INFINITY
            } else {
                upper[i]
            };
            (i, Interval::new(low, high))
        };
        Place::new((0..lower.len()).map(side).collect())
    }

    /// Sums over boxes of a number per cell.
    pub(super) fn sums(&self, value: impl Fn(usize) -> f64) -> Sums {
        let shape: Vec<usize> = self.counts.iter().map(|count| count + 1).collect();
        let mut table = vec![0.0; shape.iter().product()];
        let place = |index: &[usize]| {
            (0..shape.len())
                .rev()
                .fold(0, |at, i| at * shape[i] + index[i])
        };
        for cell in 0..self.len() {
            let index: Vec<usize> = self.index(cell).iter().map(|index| index + 1).collect();
            table[place(&index)] = value(cell);
        }
        let mut stride = 1;
        for &count in &shape {
            for at in 0..table.len() {
                if at / stride % count > 0 {
                    table[at] += table[at - stride];
                }
            }
            stride *= count;
        }
        Sums { shape, table }
    }
}

/// A summed-area table: the sum over any box in `2^n` look-ups (F. C. Crow, 1984).
#[derive(Debug)]
pub(super) struct Sums {
    shape: Vec<usize>,
    table: Vec<f64>,
}

impl Sums {
    /// Sum over a box.
    pub(super) fn over(&self, cells: &CellBox) -> f64 {
        let n = self.shape.len();
        (0..1_u32 << n)
            .map(|corner| {
                let below = |i: usize| corner >> i & 1 == 1;
                let at = (0..n).rev().fold(0, |at, i| {
                    at * self.shape[i]
                        + if below(i) {
                            cells.low[i]
                        } else {
                            cells.high[i] + 1
                        }
                });
                if corner.count_ones() % 2 == 0 {
                    self.table[at]
                } else {
                    -self.table[at]
                }
            })
            .sum()
    }
}

impl CellBox {
    /// Number of cells.
    pub(super) fn volume(&self) -> usize {
        self.low
            .iter()
            .zip(&self.high)
            .map(|(low, high)| high - low + 1)
            .product()
    }

    /// The smallest box that holds both.
    pub(super) fn hull(&self, other: &Self) -> Self {
        Self {
            low: self
                .low
                .iter()
                .zip(&other.low)
                .map(|(a, b)| *a.min(b))
                .collect(),
            high: self
                .high
                .iter()
                .zip(&other.high)
                .map(|(a, b)| *a.max(b))
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice() -> Lattice {
        Lattice::new(
            &[Interval::new(0.0, 3.0), Interval::new(-1.0, 1.0)],
            &[1.0, 0.6],
        )
    }

    #[test]
    fn cells_fill_the_bounds_and_no_side_is_longer_than_asked() {
        let lattice = lattice();
        assert_eq!(
            (lattice.count(0), lattice.count(1), lattice.len()),
            (3, 4, 12)
        );
        assert_eq!(
            lattice.corners(&lattice.whole()),
            (vec![0.0, -1.0], vec![3.0, 1.0])
        );
        assert_eq!(
            lattice.cells(&lattice.whole()).collect::<Vec<_>>(),
            (0..12).collect::<Vec<_>>()
        );
        assert_eq!(lattice.boxes().len(), 6 * 10);
    }

    #[test]
    fn a_mean_finds_the_cell_whose_corners_hold_it() {
        let lattice = lattice();
        for cell in 0..lattice.len() {
            let index = lattice.index(cell);
            let only = CellBox {
                low: index.clone(),
                high: index,
            };
            let (lower, upper) = lattice.corners(&only);
            assert_eq!(lattice.cell(&lower), cell);
            assert_eq!(
                lattice.cell(&[0.5 * (lower[0] + upper[0]), 0.5 * (lower[1] + upper[1])]),
                cell
            );
            assert_eq!(lattice.cells(&only).collect::<Vec<_>>(), [cell]);
        }
        assert_eq!(lattice.cell(&[-7.0, -7.0]), 0);
        assert_eq!(lattice.cell(&[7.0, 7.0]), 11);
    }

    #[test]
    fn summed_areas_are_sums_over_cells() {
        let lattice = lattice();
        let value = |cell: usize| ((cell * 7 + 3) % 5) as f64;
        let sums = lattice.sums(value);
        for (cells, volume) in lattice.boxes() {
            assert_eq!(lattice.cells(cells).count(), *volume);
            assert_eq!(
                sums.over(cells),
                lattice.cells(cells).map(value).sum::<f64>()
            );
        }
    }
}
