//! What an automaton's nodes have to tell: where they are reached from, what is sensed there, how often they are used.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use crate::belief::BeliefSpace;
use crate::policy::{Automaton, NodeId, Observed};
use crate::simulate::{Agent, TrackingAgent};
use crate::solve::rollout;

/// Runs the automaton in the model and writes predecessors, observations and visits into its nodes.
pub fn annotate(automaton: &mut Automaton, space: &dyn BeliefSpace, episodes: usize, seed: u64) {
    let model = space.model();
    let m = model.observation_dim();
    let at = |agent: &TrackingAgent<'_>| agent.node(automaton);
    let runs = rollout::recorded(
        space,
        (&automaton.updater, automaton),
        (episodes, model.episode.length),
        seed,
        &at,
    );
    let mut sums = vec![Sums::new(m); automaton.nodes.len()];
    let mut steps = 0.0;
    for run in &runs {
        let mut before: Option<NodeId> = None;
        for decision in run {
            let Some(id) = decision.at else {
                continue;
            };
            steps += 1.0;
            sums[id].visits += 1.0;
            if !decision.observation.is_empty() {
                sums[id].sense(&decision.observation);
                if let Some(before) = before {
                    *sums[id].from.entry(before).or_insert(0.0) += 1.0;
                }
            }
            before = Some(id);
        }
    }
    for (node, sums) in automaton.nodes.iter_mut().zip(sums) {
        node.visits = if steps > 0.0 {
            sums.visits / steps
        } else {
            0.0
        };
        node.observed = sums.observed();
        node.predecessors = sums.from.into_iter().collect();
        node.predecessors
            .sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    }
}

#[derive(Clone)]
struct Sums {
    visits: f64,
    sensed: f64,
    mean: DVector<f64>,
    squares: DMatrix<f64>,
    from: BTreeMap<NodeId, f64>,
}

impl Sums {
    fn new(m: usize) -> Self {
        Self {
            visits: 0.0,
            sensed: 0.0,
            mean: DVector::zeros(m),
            squares: DMatrix::zeros(m, m),
            from: BTreeMap::new(),
        }
    }

    /// Welford's update of mean and squares.
    fn sense(&mut self, observation: &[f64]) {
        let observation = DVector::from_column_slice(observation);
        self.sensed += 1.0;
        let before = &observation - &self.mean;
        self.mean += &before / self.sensed;
        self.squares += before * (observation - &self.mean).transpose();
    }

    fn observed(&self) -> Option<Observed> {
        (self.sensed > 0.0).then(|| Observed {
            mean: self.mean.as_slice().to_vec(),
            covariance: (&self.squares / self.sensed).as_slice().to_vec(),
        })
    }
}
