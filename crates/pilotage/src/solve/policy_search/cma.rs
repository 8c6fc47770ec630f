//! CMA-ES: minimising a function of which only values are known, noise and all.
//!
//! # References
//! N. Hansen, *The CMA Evolution Strategy: A Tutorial*, 2016 (with its default weights and rates).

use nalgebra::{DMatrix, DVector};

use crate::random::{Role, normal, stream};

/// A normal distribution over parameters that moves to where the function is small.
#[derive(Debug, Clone)]
pub(crate) struct Evolution {
    mean: DVector<f64>,
    /// Overall step size.
    step: f64,
    covariance: DMatrix<f64>,
    /// Paths of the mean, for the shape and for the step size.
    shape_path: DVector<f64>,
    step_path: DVector<f64>,
    generation: u64,
    seed: u64,
    population: usize,
    /// Weights of the better half, best first; they sum to 1.
    weights: Vec<f64>,
    rates: Rates,
    /// The generation asked for last: displacements in units of the step.
    asked: Vec<DVector<f64>>,
}

#[derive(Debug, Clone, Copy)]
struct Rates {
    /// Effective number of parents.
    parents: f64,
    shape_path: f64,
    step_path: f64,
    rank_one: f64,
    rank_many: f64,
    damping: f64,
}

impl Evolution {
    /// Starts at `mean` with standard deviation `step` in every direction. `population` is at least 2.
    pub(crate) fn new(mean: &[f64], step: f64, population: usize, seed: u64) -> Self {
        let n = mean.len();
        let half = population / 2;
        let raw = |rank: usize| (half as f64 + 0.5).ln() - ((rank + 1) as f64).ln();
        let total: f64 = (0..half).map(raw).sum();
        let weights: Vec<f64> = (0..half).map(|rank| raw(rank) / total).collect();
        let parents = 1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>();
        Self {
            mean: DVector::from_column_slice(mean),
            step,
            covariance: DMatrix::identity(n, n),
            shape_path: DVector::zeros(n),
            step_path: DVector::zeros(n),
            generation: 0,
            seed,
            population,
            weights,
            rates: Rates::new(n as f64, parents),
            asked: Vec::new(),
        }
    }

    /// The centre of the distribution: the best estimate of the minimum, which noise deceives less than any one candidate.
    pub(crate) fn mean(&self) -> &[f64] {
        self.mean.as_slice()
    }

    /// The candidates of the next generation.
    pub(crate) fn ask(&mut self) -> Vec<Vec<f64>> {
        let root = self.root(f64::sqrt);
        let mut rng = stream(self.seed, self.generation, Role::Planner);
        self.asked = (0..self.population)
            .map(|_| &root * DVector::from_fn(self.mean.len(), |_, _| normal(&mut rng)))
            .collect();
        let candidate = |displacement: &DVector<f64>| {
            (&self.mean + displacement * self.step).as_slice().to_vec()
        };
        self.asked.iter().map(candidate).collect()
    }

    /// Takes in the values of the candidates asked for, in their order.
    pub(crate) fn tell(&mut self, values: &[f64]) {
        let mut order: Vec<usize> = (0..self.asked.len()).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let n = self.mean.len() as f64;
        let best = || self.weights.iter().zip(&order);
        let zero = DVector::zeros(self.mean.len());
        let shift = best().fold(zero, |sum, (weight, &id)| sum + &self.asked[id] * *weight);
        let many = best().fold(self.covariance.clone() * 0.0, |sum, (weight, &id)| {
            sum + &self.asked[id] * self.asked[id].transpose() * *weight
        });
        let whitened = self.root(|value| 1.0 / value.sqrt()) * &shift;
        let rates = self.rates;

        self.mean += &shift * self.step;
        self.generation += 1;
        self.step_path = &self.step_path * (1.0 - rates.step_path)
            + whitened * (rates.step_path * (2.0 - rates.step_path) * rates.parents).sqrt();
        let settled = (1.0 - (1.0 - rates.step_path).powi(2 * self.generation as i32)).sqrt();
        let usual = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
        let moving = self.step_path.norm() / settled < (1.4 + 2.0 / (n + 1.0)) * usual;
        let gain = (rates.shape_path * (2.0 - rates.shape_path) * rates.parents).sqrt();
        self.shape_path *= 1.0 - rates.shape_path;
        if moving {
            self.shape_path += shift * gain;
        }
        let lost = if moving {
            0.0
        } else {
            rates.rank_one * rates.shape_path * (2.0 - rates.shape_path)
        };
        self.covariance = &self.covariance * (1.0 - rates.rank_one - rates.rank_many + lost)
            + &self.shape_path * self.shape_path.transpose() * rates.rank_one
            + many * rates.rank_many;
        self.step *=
            ((rates.step_path / rates.damping) * (self.step_path.norm() / usual - 1.0)).exp();
    }

    /// A function of the covariance through its eigenvalues, symmetric.
    fn root(&self, f: impl Fn(f64) -> f64) -> DMatrix<f64> {
        let eigen = self.covariance.clone().symmetric_eigen();
        let values = eigen.eigenvalues.map(|value| f(value.max(1e-20)));
        &eigen.eigenvectors * DMatrix::from_diagonal(&values) * eigen.eigenvectors.transpose()
    }
}

impl Rates {
    fn new(n: f64, parents: f64) -> Self {
        let rank_one = 2.0 / ((n + 1.3).powi(2) + parents);
        let step_path = (parents + 2.0) / (n + parents + 5.0);
        Self {
            parents,
            shape_path: (4.0 + parents / n) / (n + 4.0 + 2.0 * parents / n),
            step_path,
            rank_one,
            rank_many: (1.0 - rank_one)
                .min(2.0 * (parents - 2.0 + 1.0 / parents) / ((n + 2.0).powi(2) + parents)),
            damping: 1.0 + 2.0 * (((parents - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + step_path,
        }
    }
}

/// On functions with known minima.
#[cfg(test)]
mod tests {
    use super::Evolution;

    fn minimise(f: impl Fn(&[f64]) -> f64, start: &[f64], generations: usize) -> Vec<f64> {
        let mut evolution = Evolution::new(start, 0.5, 10, 1);
        for _ in 0..generations {
            let values: Vec<f64> = evolution.ask().iter().map(|x| f(x)).collect();
            evolution.tell(&values);
        }
        evolution.mean().to_vec()
    }

    #[test]
    fn a_stretched_bowl_is_followed_to_its_bottom() {
        let bowl =
            |x: &[f64]| (x[0] - 1.0).powi(2) + 1e4 * (x[1] + x[0] + 2.0).powi(2) + x[2].powi(2);
        let found = minimise(bowl, &[0.0; 3], 150);
        for (value, expected) in found.iter().zip([1.0, -3.0, 0.0]) {
            assert!((value - expected).abs() < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_bottom() {
        let rosenbrock = |x: &[f64]| 100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2);
        let found = minimise(rosenbrock, &[-1.0, 1.0], 250);
        assert!(
            (found[0] - 1.0).abs() < 1e-5 && (found[1] - 1.0).abs() < 1e-5,
            "{found:?}"
        );
    }

    #[test]
    fn the_order_of_values_is_all_that_counts() {
        let bowl = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>();
        let plain = minimise(bowl, &[1.0, 2.0], 30);
        let bent = minimise(|x| bowl(x).powi(3).ln_1p(), &[1.0, 2.0], 30);
        assert_eq!(plain, bent);
    }
}
