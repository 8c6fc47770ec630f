//! Finding the nearest of many matrices without comparing all of them.

use std::collections::BTreeSet;

use nalgebra::DMatrix;

use super::kalman::distance;

/// An index over a list of matrices of one size that fall into groups, each in the order of a weighted mean of their entries: where entries differ by little, so
/// do the means. With weights that are like no other numbers, covariances that follow one another do not share a mean.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Nearby {
    /// Group, mean and place.
    order: BTreeSet<(usize, u64, usize)>,
}

impl Nearby {
    /// Takes in the matrix of a group at a place of the list. One that is not finite is near to nothing.
    pub(super) fn insert(&mut self, matrix: &DMatrix<f64>, group: usize, place: usize) {
        let mean = weighted_mean(matrix);
        if mean.is_finite() {
            self.order.insert((group, rising(mean), place));
        }
    }

    /// Of the matrices of a group no entry of which is farther off than the tolerance, the place of the nearest; the first of equals.
    pub(super) fn nearest(
        &self,
        list: &[DMatrix<f64>],
        to: &DMatrix<f64>,
        tolerance: f64,
        group: usize,
    ) -> Option<usize> {
        /// More than rounding can do to a weighted mean, as a share of the largest entry.
        const ROUNDING: f64 = 1e-11;
        let mean = weighted_mean(to);
        if !mean.is_finite() {
            return None;
        }
        // Outwards from the mean in both directions, as far as something nearer may lie.
        let (first, middle, last) = (
            (group, 0, 0),
            (group, rising(mean), 0),
            (group, u64::MAX, usize::MAX),
        );
        let mut below = self.order.range(first..middle).rev().peekable();
        let mut above = self.order.range(middle..=last).peekable();
        let apart = |key: Option<&&(usize, u64, usize)>| {
            key.map_or(f64::INFINITY, |key| (number(key.1) - mean).abs())
        };
        let mut best: Option<(f64, usize)> = None;
        loop {
            let (down, up) = (apart(below.peek()), apart(above.peek()));
            let within = best.map_or(tolerance, |(distance, _)| distance);
            let reach = within + ROUNDING * (to.amax() + within);
            if down.min(up) > reach {
                break;
            }
            let next = if down <= up {
                below.next()
            } else {
                above.next()
            };
            let Some(&(.., place)) = next else { break };
            let found = (distance(to, &list[place]), place);
            if found.0 <= within && best.is_none_or(|best| found < best) {
                best = Some(found);
            }
        }
        best.map(|(_, place)| place)
    }
}

/// A mean of the entries with weights of at most 1 over their number, by multiples of the golden ratio.
fn weighted_mean(matrix: &DMatrix<f64>) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let count = matrix.len() as f64;
    let entries = matrix.iter().enumerate();
    entries
        .map(|(k, entry)| (0.5 + 0.5 * (k as f64 * GOLDEN).fract()) * (entry / count))
        .sum()
}

/// Bits that rise with the number.
fn rising(number: f64) -> u64 {
    // The two zeros are one number.
    let bits = (number + 0.0).to_bits();
    let sign = 1 << 63;
    if bits & sign == 0 { bits | sign } else { !bits }
}

/// The number whose bits [`rising`] made these.
fn number(bits: u64) -> f64 {
    let sign = 1 << 63;
    f64::from_bits(if bits & sign == 0 { !bits } else { bits ^ sign })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Role, normal, stream};

    #[test]
    fn it_finds_what_a_search_of_the_whole_list_finds() {
        let mut rng = stream(3, 0, Role::Planner);
        let mut list: Vec<DMatrix<f64>> = Vec::new();
        let mut nearby = Nearby::default();
        let group = |place: usize| place % 3 / 2;
        // Steps much smaller and much larger than the tolerance, equals, and a matrix that is none.
        for place in 0..600 {
            let size = 10_f64.powi(place % 9 - 7);
            let matrix = match place % 50 {
                7 => list[place as usize / 2].clone(),
                8 => DMatrix::from_element(2, 2, f64::NAN),
                9 => DMatrix::from_element(2, 2, f64::MAX),
                10 => DMatrix::from_element(2, 2, -0.0),
                _ => DMatrix::from_fn(2, 2, |_, _| size * normal(&mut rng)),
            };
            nearby.insert(&matrix, group(place as usize), place as usize);
            list.push(matrix);
        }
        for tolerance in [0.0, 1e-9, 5e-7, 1e-2, 1.0, 1e300, f64::INFINITY] {
            for (k, to) in list.iter().enumerate() {
                let all = list.iter().enumerate();
                let finite = |matrix: &DMatrix<f64>| matrix.iter().all(|entry| entry.is_finite());
                let whole = all
                    .filter(|&(place, matrix)| {
                        group(place) == group(k) && finite(matrix) && finite(to)
                    })
                    .map(|(place, matrix)| (place, distance(to, matrix)))
                    .filter(|&(_, distance)| distance <= tolerance)
                    .min_by(|a, b| a.1.total_cmp(&b.1));
                assert_eq!(
                    nearby.nearest(&list, to, tolerance, group(k)),
                    whole.map(|(place, _)| place)
                );
            }
        }
    }
}
