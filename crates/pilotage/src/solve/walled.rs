//! Averages over a Gaussian whose steps are stopped by walls: `W(x) = E V(stop(x, x + e))`, `e ~ N(0, covariance)`.
//!
//! A belief that knows of walls does not count on its next observation to carry it through one. Where a step ends does not
//! depend on the values, so it is found once for each point of the grid and node of the quadrature.

use nalgebra::{DMatrix, DVector};

use super::grid::Grid;
use crate::belief::BeliefMdp;
use crate::belief::gaussian::normal_density;
use crate::belief::kalman::square_root;
use crate::parallel;

/// Nodes of the quadrature along each direction: half a standard deviation apart, up to three.
const HALF: i32 = 6;
const STEP: f64 = 0.5;

/// Where the steps from every point of a grid end.
#[derive(Debug, Clone)]
pub(crate) struct WalledSmoother {
    weights: Vec<f64>,
    /// By grid point, then node: coordinates of the end.
    ends: Vec<Vec<f64>>,
}

impl WalledSmoother {
    /// Bytes it takes for a grid of so many points in `n` variables.
    pub(crate) fn bytes(points: u64, n: usize) -> u64 {
        let nodes = (2 * HALF as u64 + 1).saturating_pow(n as u32);
        points.saturating_mul(nodes).saturating_mul(8 * n as u64)
    }

    /// The average over N(0, covariance), `n x n`, with the walls that the belief knows of.
    pub(crate) fn new(mdp: &BeliefMdp, grid: &Grid, covariance: &DMatrix<f64>) -> Self {
        let (offsets, weights) = quadrature(&square_root(covariance));
        let ends = parallel::map(grid.len(), |point| {
            let from = mdp.confine(grid.point(point).into());
            let end = |offset: &DVector<f64>| mdp.stop(from.as_slice(), &from + offset);
            offsets
                .iter()
                .flat_map(|offset| end(offset).as_slice().to_vec())
                .collect()
        });
        Self { weights, ends }
    }

    /// Applies the average to `values`, which has [`Grid::len`] entries.
    pub(crate) fn apply(&self, grid: &Grid, values: &[f64]) -> Vec<f64> {
        let n = grid.axes().len();
        parallel::map(grid.len(), |point| {
            self.ends[point]
                .chunks_exact(n)
                .zip(&self.weights)
                .map(|(end, weight)| weight * grid.interpolate(values, end))
                .sum()
        })
    }
}

/// All combinations of nodes along the columns of a square root of the covariance, with weights that sum to 1.
fn quadrature(directions: &DMatrix<f64>) -> (Vec<DVector<f64>>, Vec<f64>) {
    let nodes: Vec<f64> = (-HALF..=HALF).map(|k| f64::from(k) * STEP).collect();
    let total: f64 = nodes.iter().map(|&x| normal_density(x)).sum();
    let mut rule = vec![(DVector::zeros(directions.nrows()), 1.0)];
    for direction in directions.column_iter() {
        rule = rule
            .iter()
            .flat_map(|(offset, weight)| {
                nodes
                    .iter()
                    .map(move |&x| (offset + direction * x, weight * normal_density(x) / total))
            })
            .collect();
    }
    rule.into_iter().unzip()
}
