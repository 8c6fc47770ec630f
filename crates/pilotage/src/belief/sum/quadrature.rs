//! Nodes and weights for expectations under a standard normal vector.

use crate::belief::gaussian::gauss_hermite;

/// Nodes, one after the other, with their weights, which sum to 1.
#[derive(Debug, Clone)]
pub(super) struct Rule {
    pub(super) nodes: Vec<Vec<f64>>,
    pub(super) weights: Vec<f64>,
    /// Logarithms of the weights over the density of the standard normal, but for a constant.
    logs: Vec<f64>,
}

/// Most coordinates in which rules are products of those on a line.
const PRODUCTS: usize = 2;

impl Rule {
    /// The Gauss-Hermite rule of so many points a variable in one and two dimensions, the cubature rule of third degree (I. Arasaratnam and
    /// S. Haykin, 2009) in more.
    pub(super) fn new(n: usize, points: usize) -> Self {
        match n > PRODUCTS {
            true => Self::cubature(n),
            false => Self::product(n, points),
        }
    }

    /// The Gauss-Hermite rule of so many points a variable.
    pub(super) fn product(n: usize, points: usize) -> Self {
        let line = gauss_hermite(points);
        let mut rule = (vec![Vec::new()], vec![1.0]);
        for _ in 0..n {
            let (mut nodes, mut weights) = (Vec::new(), Vec::new());
            for (node, weight) in rule.0.iter().zip(&rule.1) {
                for (x, share) in &line {
                    nodes.push(node.iter().copied().chain([*x]).collect());
                    weights.push(weight * share);
                }
            }
            rule = (nodes, weights);
        }
        Self::of(rule.0, rule.1)
    }

    /// The origin alone.
    pub(super) fn point(n: usize) -> Self {
        Self::of(vec![vec![0.0; n]], vec![1.0])
    }

    /// The cubature rule of third degree: two points a variable.
    pub(super) fn cubature(n: usize) -> Self {
        let far = (n as f64).sqrt();
        let along = |i: usize, x: f64| (0..n).map(|j| if i == j { x } else { 0.0 }).collect();
        let nodes: Vec<Vec<f64>> = (0..n)
            .flat_map(|i| [along(i, far), along(i, -far)])
            .collect();
        let weights = vec![0.5 / n as f64; nodes.len()];
        Self::of(nodes, weights)
    }

    fn of(nodes: Vec<Vec<f64>>, weights: Vec<f64>) -> Self {
        let log = |(node, weight): (&Vec<f64>, &f64)| {
            weight.ln() + 0.5 * node.iter().map(|z| z * z).sum::<f64>()
        };
        Self {
            logs: nodes.iter().zip(&weights).map(log).collect(),
            nodes,
            weights,
        }
    }

    /// Nodes with their weights.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&[f64], f64)> {
        self.nodes
            .iter()
            .map(Vec::as_slice)
            .zip(self.weights.iter().copied())
    }

    /// Nodes with logarithms of weights by which something is integrated rather than expected.
    pub(super) fn over_density(&self) -> impl Iterator<Item = (&[f64], f64)> {
        let nodes = self.nodes.iter().map(Vec::as_slice);
        nodes.zip(self.logs.iter().copied())
    }
}
