//! What neighbourhoods are laid along.
//!
//! Where motion only adds to the state (`A` is diagonal) these are the state variables. Otherwise they are the modes of the motion
//! that do not die out by themselves: the left eigenvectors of `A` with eigenvalues of at least 1. The agent decides about these; what
//! dies out by itself needs no deciding. In these coordinates `z' = lambda z + w B u`, each on its own.

use nalgebra::{DMatrix, DVector};

use crate::model::{Interval, Model};
use crate::policy::{Coordinates, MOST_COORDINATES};

/// Eigenvalues this close are one.
const ALIKE: f64 = 1e-6;

/// The axes of a model; `None` for the state variables themselves.
pub(super) fn axes(model: &Model) -> Option<Coordinates> {
    let a = &model.motion.a;
    let n = a.nrows();
    let is_diagonal = (0..n).all(|i| (0..n).all(|j| i == j || a[(i, j)] == 0.0));
    if is_diagonal {
        return None;
    }
    let mut kept: Vec<f64> = Vec::new();
    for value in a.complex_eigenvalues().iter() {
        if value.norm() < 1.0 - ALIKE {
            continue;
        }
        let known = kept.iter().any(|other| (other - value.re).abs() < ALIKE);
        if value.im != 0.0 || known {
            return None;
        }
        kept.push(value.re);
    }
    if kept.is_empty() || kept.len() > MOST_COORDINATES {
        return None;
    }
    kept.sort_by(|a, b| b.total_cmp(a));
    let rows: Vec<Vec<f64>> = kept
        .iter()
        .map(|&value| left_eigenvector(a, value))
        .collect::<Option<_>>()?;
    let names = kept.iter().map(|value| format!("mode {value:.3}"));
    Some(Coordinates {
        names: names.collect(),
        rows,
    })
}

/// The unit `w` with `w A = value w`, its largest entry positive.
fn left_eigenvector(a: &DMatrix<f64>, value: f64) -> Option<Vec<f64>> {
    let n = a.nrows();
    let shifted = a.transpose() - DMatrix::identity(n, n) * value;
    // No decomposition of a matrix that is not finite comes to an end.
    if shifted.iter().any(|entry| !entry.is_finite()) {
        return None;
    }
    let decomposition = shifted.svd(false, true);
    let vectors = decomposition.v_t?;
    let row = vectors.row(decomposition.singular_values.imin());
    let largest = row.iter().fold(
        0.0,
        |largest: f64, w| {
            if w.abs() > largest.abs() { *w } else { largest }
        },
    );
    Some(row.iter().map(|w| largest.signum() * w).collect())
}

/// An axis as a lattice needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    /// What the world's outer bounds leave of it.
    pub bounds: Interval,
    /// Standard deviation of the steady level along it.
    pub deviation: f64,
    /// Half the distance between the largest displacements of two actions along it.
    pub stride: f64,
}

/// The extent of every axis.
pub(super) fn extents(
    model: &Model,
    coordinates: Option<&Coordinates>,
    covariance: &DMatrix<f64>,
) -> Vec<Extent> {
    let n = model.state_dim();
    let unit = |i: usize| (0..n).map(|j| f64::from(i == j)).collect();
    let own: Vec<Vec<f64>> = (0..n).map(unit).collect();
    let rows = coordinates.map_or(&own, |coordinates| &coordinates.rows);
    rows.iter()
        .map(|row| {
            let w = DVector::from_column_slice(row);
            let ends = |low: bool| {
                let along = model.state.iter().zip(row).filter(|(_, w)| **w != 0.0);
                along
                    .map(|(variable, w)| {
                        let bounds = variable.bounds;
                        w * if (*w > 0.0) == low {
                            bounds.low
                        } else {
                            bounds.high
                        }
                    })
                    .sum::<f64>()
            };
            let moves =
                (0..model.actions.len()).map(|action| model.displacement(action, 0).dot(&w));
            let (least, most) = moves.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            Extent {
                bounds: Interval::new(ends(true), ends(false)),
                deviation: w.dot(&(covariance * &w)).max(0.0).sqrt(),
                stride: 0.5 * (most - least),
            }
        })
        .collect()
}
