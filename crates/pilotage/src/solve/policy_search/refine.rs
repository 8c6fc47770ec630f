//! Policy search: moving the switching planes of an automaton to where a measured cost is least.

use nalgebra::DMatrix;

use super::cma::Evolution;

/// A stretch of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Phase {
    /// Standard deviation of the first candidates, relative to the length of each plane's normal.
    pub step: f64,
    /// Generations.
    pub generations: usize,
    /// Seed of the candidates.
    pub seed: u64,
}

/// Candidates of a generation.
pub(crate) const POPULATION: usize = 10;

/// Moves the gains (each `p x n`, not 0) to where `cost` is least. Within a phase `cost` should use the same random numbers for
/// all candidates, so that they are compared on equal terms. `progress` hears of every generation done.
pub(crate) fn refine(
    gains: &mut [DMatrix<f64>],
    phase: Phase,
    cost: impl Fn(&[DMatrix<f64>]) -> f64,
    progress: impl Fn(u64),
) {
    let lengths: Vec<f64> = gains.iter().map(|gain| gain.norm()).collect();
    let from_numbers = |numbers: &[f64]| -> Vec<DMatrix<f64>> {
        let mut rest = numbers;
        let take = |(gain, length): (&DMatrix<f64>, &f64)| {
            let (own, others) = rest.split_at(gain.len());
            rest = others;
            DMatrix::from_column_slice(gain.nrows(), gain.ncols(), own) * *length
        };
        gains.iter().zip(&lengths).map(take).collect()
    };
    let numbers: Vec<f64> = gains
        .iter()
        .zip(&lengths)
        .flat_map(|(gain, length)| gain.iter().map(move |entry| entry / length))
        .collect();
    let mut evolution = Evolution::new(&numbers, phase.step, POPULATION, phase.seed);
    for generation in 0..phase.generations {
        let values: Vec<f64> = evolution
            .ask()
            .iter()
            .map(|candidate| cost(&from_numbers(candidate)))
            .collect();
        evolution.tell(&values);
        progress(generation as u64 + 1);
    }
    let found = from_numbers(evolution.mean());
    gains.clone_from_slice(&found);
}
