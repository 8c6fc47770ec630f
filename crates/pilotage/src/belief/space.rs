//! The beliefs of a model, as far as those who run and compile policies must know them.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::{Belief, BeliefMdp, Codebook, StratumId, Updater};
use crate::model::Model;

/// Beliefs as policies read them: finitely many strata, each with a covariance, and what keeps them.
pub trait BeliefSpace: Send + Sync {
    /// The model.
    fn model(&self) -> &Model;

    /// Number of strata, at least 1.
    fn strata(&self) -> usize;

    /// Covariance of the beliefs of a stratum, `n x n`.
    fn covariance(&self, stratum: StratumId) -> &DMatrix<f64>;

    /// Whether an episode is over at a stratum.
    fn is_over(&self, stratum: StratumId) -> bool;

    /// The belief at the start.
    fn start(&self) -> &Belief;

    /// What keeps such beliefs.
    fn updater(&self) -> Updater;

    /// The stratum that repeats itself, where there is one.
    fn steady(&self) -> Option<StratumId> {
        None
    }

    /// The decision process on uncertainty levels, where these are its beliefs.
    fn as_mdp(&self) -> Option<&BeliefMdp> {
        None
    }

    /// The start of each hypothesis that has a belief of its own; empty where one belief holds all.
    fn hypotheses(&self) -> Vec<Belief>;
}

impl BeliefSpace for BeliefMdp {
    fn model(&self) -> &Model {
        self.model()
    }

    fn strata(&self) -> usize {
        self.strata()
    }

    fn covariance(&self, stratum: StratumId) -> &DMatrix<f64> {
        self.covariance(stratum)
    }

    fn is_over(&self, stratum: StratumId) -> bool {
        self.is_over(stratum)
    }

    fn start(&self) -> &Belief {
        self.start()
    }

    fn updater(&self) -> Updater {
        self.filter().into()
    }

    fn steady(&self) -> Option<StratumId> {
        self.levels().steady(self.start().stratum, 0)
    }

    fn as_mdp(&self) -> Option<&BeliefMdp> {
        Some(self)
    }

    fn hypotheses(&self) -> Vec<Belief> {
        match self.starts() {
            [_] => Vec::new(),
            starts => starts.iter().map(|(_, start)| start.clone()).collect(),
        }
    }
}

/// Beliefs that are kept in full, and read by a codebook.
#[derive(Debug, Clone)]
pub struct CodedSpace {
    model: Model,
    updater: Updater,
    covariances: Arc<Vec<DMatrix<f64>>>,
    start: Belief,
}

impl CodedSpace {
    /// The beliefs of a model that an updater keeps and its codebook reads.
    pub fn new(model: &Model, updater: Updater, codebook: &Codebook) -> Self {
        let n = model.state_dim();
        let covariance =
            |stratum| DMatrix::from_row_slice(n, n, &codebook.stratum(stratum).covariance);
        Self {
            model: model.clone(),
            start: updater.start().belief().clone(),
            covariances: Arc::new((0..codebook.len()).map(covariance).collect()),
            updater,
        }
    }
}

impl BeliefSpace for CodedSpace {
    fn model(&self) -> &Model {
        &self.model
    }

    fn strata(&self) -> usize {
        self.covariances.len()
    }

    fn covariance(&self, stratum: StratumId) -> &DMatrix<f64> {
        &self.covariances[stratum]
    }

    fn is_over(&self, _: StratumId) -> bool {
        false
    }

    fn start(&self) -> &Belief {
        &self.start
    }

    fn updater(&self) -> Updater {
        self.updater.clone()
    }

    fn hypotheses(&self) -> Vec<Belief> {
        Vec::new()
    }
}
