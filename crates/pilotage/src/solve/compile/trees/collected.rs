//! Beliefs with what every action costs there: what trees are grown on.

use super::cuts::{Cut, Pair, add};
use crate::belief::{Belief, BeliefSpace};
use crate::policy::{Asked, Automaton, Feature, StratumFeatures};
use crate::solve::rollout::Judged;

/// Beliefs with what actions cost there.
pub(super) struct Collected {
    /// What is known of each belief.
    pub(super) features: Vec<Feature>,
    /// Those that a test may ask for together.
    pub(super) pairs: Vec<Pair>,
    pub(super) actions: usize,
    pub(super) beliefs: Vec<Belief>,
    /// By feature and belief.
    pub(super) columns: Vec<Vec<f64>>,
    /// By belief and action: what is lost by the action, times how much the belief counts.
    pub(super) costs: Vec<f64>,
    /// How much each belief counts: its discount, divided by the number of episodes.
    pub(super) counts: Vec<f64>,
    /// What is expected from each belief, where it is known.
    pub(super) values: Vec<Option<f64>>,
    strata: Vec<StratumFeatures>,
}

/// Beliefs of a set that share a leaf or a test, in the order of each feature.
pub(super) type Members = Vec<Vec<u32>>;

impl Collected {
    pub(super) fn new(space: &dyn BeliefSpace, automaton: &Automaton) -> Self {
        let features = features(space, automaton);
        Self {
            columns: vec![Vec::new(); features.len()],
            pairs: pairs(&features),
            features,
            actions: space.model().actions.len(),
            beliefs: Vec::new(),
            costs: Vec::new(),
            counts: Vec::new(),
            values: Vec::new(),
            strata: (0..space.strata())
                .map(|stratum| StratumFeatures::of(automaton, stratum))
                .collect(),
        }
    }

    /// Adds beliefs that were judged.
    pub(super) fn extend(&mut self, judged: impl IntoIterator<Item = Judged>) {
        for judged in judged {
            let stratum = &self.strata[judged.belief.stratum];
            for (feature, column) in self.features.iter().zip(&mut self.columns) {
                column.push(match &judged.moments {
                    Some(moments) => moments.feature(*feature),
                    None => (stratum, &judged.belief).feature(*feature),
                });
            }
            let best = judged
                .values
                .iter()
                .copied()
                .fold(f64::NEG_INFINITY, f64::max);
            let costs = judged
                .values
                .iter()
                .map(|value| judged.counts * (best - value));
            self.costs.extend(costs);
            self.beliefs.push(judged.belief);
            self.counts.push(judged.counts);
            self.values.push(judged.value);
        }
    }

    /// All beliefs.
    pub(super) fn all(&self) -> Members {
        let order = |column: &Vec<f64>| {
            let mut order: Vec<u32> = (0..column.len() as u32).collect();
            let value = |member: u32| column[member as usize];
            order.sort_by(|&a, &b| value(a).total_cmp(&value(b)).then(a.cmp(&b)));
            order
        };
        self.columns.iter().map(order).collect()
    }

    /// What the actions cost at a belief.
    pub(super) fn costs_of(&self, member: u32) -> &[f64] {
        &self.costs[member as usize * self.actions..][..self.actions]
    }

    /// What each action costs at all members together.
    pub(super) fn sums(&self, members: &[u32]) -> Vec<f64> {
        let mut sums = vec![0.0; self.actions];
        for member in members {
            add(&mut sums, self.costs_of(*member));
        }
        sums
    }

    /// How much members count.
    pub(super) fn counted(&self, members: &[u32]) -> f64 {
        let counts = members.iter().map(|member| self.counts[*member as usize]);
        counts.sum()
    }

    /// Whether a feature is the probability of a mode.
    pub(super) fn is_probability(&self, feature: usize) -> bool {
        matches!(self.features[feature], Feature::Mode(_))
    }

    /// Standard deviation of a feature among members.
    pub(super) fn spread(&self, feature: usize, members: &[u32]) -> f64 {
        let column = &self.columns[feature];
        let values = || members.iter().map(|member| column[*member as usize]);
        let count = members.len().max(1) as f64;
        let mean = values().sum::<f64>() / count;
        let squares = values().map(|value| (value - mean).powi(2));
        (squares.sum::<f64>() / count).sqrt()
    }

    /// Members on either side of a test, in the same orders.
    pub(super) fn parted(&self, members: Members, cut: Cut) -> [Members; 2] {
        let below = |member: &u32| cut.is_below(self, *member);
        let parted = members
            .into_iter()
            .map(|order| order.into_iter().partition(below));
        let (yes, no) = parted.unzip();
        [yes, no]
    }
}

/// What the tree may ask: means, deviations where they differ, modes where there are several, and the step where the model changes with it.
fn features(space: &dyn BeliefSpace, automaton: &Automaton) -> Vec<Feature> {
    let n = space.model().state_dim();
    let means = (0..n).map(Feature::Mean);
    let deviations = (0..n).map(Feature::Deviation);
    let modes = match automaton.modes.len() {
        0 | 1 => 0..0,
        2 => 1..2,
        modes => 0..modes,
    };
    means
        .chain(deviations)
        .chain(modes.map(Feature::Mode))
        .chain((space.model().clock() > 0).then_some(Feature::Step))
        .collect()
}

/// What the tree may ask for together: two means, two probabilities of modes.
fn pairs(features: &[Feature]) -> Vec<Pair> {
    let numbered = || features.iter().enumerate();
    let of = |(i, first): (usize, &Feature)| -> Vec<Pair> {
        let later = numbered().skip(i + 1);
        let pair = |(j, second): (usize, &Feature)| match (first, second) {
            (Feature::Mean(_), Feature::Mean(_)) | (Feature::Mode(_), Feature::Mode(_)) => {
                Some([i, j])
            }
            _ => None,
        };
        later.filter_map(pair).collect()
    };
    numbered().flat_map(of).collect()
}
