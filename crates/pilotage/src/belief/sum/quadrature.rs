//! Nodes and weights for expectations under a standard normal vector.

use nalgebra::DMatrix;

/// Nodes, one after the other, with their weights, which sum to 1.
#[derive(Debug, Clone)]
pub(super) struct Rule {
    pub(super) nodes: Vec<Vec<f64>>,
    pub(super) weights: Vec<f64>,
}

impl Rule {
    /// The Gauss-Hermite rule of so many points a variable in one and two dimensions, the cubature rule of third degree (I. Arasaratnam and
    /// S. Haykin, 2009) in more.
    pub(super) fn new(n: usize, points: usize) -> Self {
        if n > 2 {
            return Self::cubature(n);
        }
        let line = hermite(points);
        let mut rule = Self {
            nodes: vec![Vec::new()],
            weights: vec![1.0],
        };
        for _ in 0..n {
            let (mut nodes, mut weights) = (Vec::new(), Vec::new());
            for (node, weight) in rule.nodes.iter().zip(&rule.weights) {
                for (x, share) in &line {
                    nodes.push(node.iter().copied().chain([*x]).collect());
                    weights.push(weight * share);
                }
            }
            rule = Self { nodes, weights };
        }
        rule
    }

    fn cubature(n: usize) -> Self {
        let far = (n as f64).sqrt();
        let along = |i: usize, x: f64| (0..n).map(|j| if i == j { x } else { 0.0 }).collect();
        let nodes: Vec<Vec<f64>> = (0..n)
            .flat_map(|i| [along(i, far), along(i, -far)])
            .collect();
        Self {
            weights: vec![0.5 / n as f64; nodes.len()],
            nodes,
        }
    }

    /// Nodes with their weights.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&[f64], f64)> {
        self.nodes
            .iter()
            .map(Vec::as_slice)
            .zip(self.weights.iter().copied())
    }
}

/// Nodes and weights of the Gauss-Hermite rule for N(0, 1): eigenvalues of its Jacobi matrix (G. Golub and J. Welsch, 1969).
fn hermite(points: usize) -> Vec<(f64, f64)> {
    let jacobi = DMatrix::from_fn(points, points, |i, j| match i.abs_diff(j) {
        1 => (i.max(j) as f64).sqrt(),
        _ => 0.0,
    });
    let eigen = jacobi.symmetric_eigen();
    let weight = |k: usize| eigen.eigenvectors[(0, k)] * eigen.eigenvectors[(0, k)];
    let mut rule: Vec<(f64, f64)> = (0..points)
        .map(|k| (eigen.eigenvalues[k], weight(k)))
        .collect();
    rule.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = rule.iter().map(|(_, weight)| weight).sum();
    rule.into_iter()
        .map(|(x, weight)| (x, weight / total))
        .collect()
}
