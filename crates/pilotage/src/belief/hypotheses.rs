//! A belief made of weighted hypotheses, each with its own mode, level and mean (thesis 5.6, Eq. 5.15 and 5.16).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::filter::{Belief, Filter};
use super::mdp::BeliefMdp;
use super::reading::Reading;
use super::tracker::Tracker;
use crate::error::{Error, Result};
use crate::model::ActionId;

/// One hypothesis.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// Probability; those of all hypotheses sum to 1.
    pub weight: f64,
    /// What is believed if it is true.
    pub belief: Belief,
    /// Index of the start hypothesis it has grown from.
    pub origin: usize,
}

/// When two hypotheses at the same level and in the same mode become one. The heavier takes over the weight of the lighter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Merge {
    /// Never.
    Never,
    /// When their means are less than so many standard deviations apart (Mahalanobis, covariance of the level).
    Coincide(f64),
    /// When, besides, the policy does the same at both. With infinity this is the thesis' rule: hypotheses that the policy treats
    /// alike are the same.
    ///
    /// The error it makes fades: filters at the same level that take in the same actions and observations draw together by
    /// `(I - K H) A` a step, whatever is observed, so a wrong mean is forgotten as fast as the filter forgets its start. Until
    /// then the agent acts on the heavier hypothesis as if it were certain, which a distance limits.
    Agree(f64),
}

/// How hypotheses are pruned and merged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HypothesisSettings {
    /// Hypotheses of less weight are dropped, in `[0, 1)`; the heaviest always stays.
    pub prune: f64,
    /// When they are merged.
    pub merge: Merge,
}

impl Default for HypothesisSettings {
    /// Rejection below 0.05 (thesis 5.6.1), merging within a quarter of a standard deviation.
    fn default() -> Self {
        Self {
            prune: 0.05,
            merge: Merge::Coincide(0.25),
        }
    }
}

impl HypothesisSettings {
    /// The thesis' rules: pruning below 0.05, and merging whatever the policy treats alike.
    pub const PRINTED: Self = Self {
        prune: 0.05,
        merge: Merge::Agree(f64::INFINITY),
    };
}

/// Whether two beliefs are treated alike by whoever acts on them.
type Alike<'a> = Arc<dyn Fn(&Belief, &Belief) -> bool + Send + Sync + 'a>;

/// Follows all hypotheses of a belief, and is read as the heaviest. A step allocates nothing.
#[derive(Clone)]
pub struct HypothesisTracker<'a> {
    alike: Alike<'a>,
    filter: Filter,
    densities: Vec<Density>,
    actions: usize,
    /// Inverse of each level's covariance, to measure distances.
    information: Vec<DMatrix<f64>>,
    starts: Vec<Hypothesis>,
    settings: HypothesisSettings,
    live: Vec<Hypothesis>,
    scratch: Vec<f64>,
    innovation: DVector<f64>,
}

/// N(nu; 0, S), with a matrix `W` such that `W' W = S^-1`.
#[derive(Debug, Clone)]
struct Density {
    whiten: DMatrix<f64>,
    log_scale: f64,
}

impl Density {
    fn new(covariance: &DMatrix<f64>) -> Self {
        let eigen = covariance.clone().symmetric_eigen();
        // Where nothing is random nothing distinguishes the hypotheses either: such directions are left out.
        let floor = eigen.eigenvalues.amax() * 1e-13;
        let kept: Vec<usize> = (0..eigen.eigenvalues.len())
            .filter(|&i| eigen.eigenvalues[i] > floor)
            .collect();
        let sd = |row: usize| eigen.eigenvalues[kept[row]].sqrt();
        Self {
            whiten: DMatrix::from_fn(kept.len(), covariance.nrows(), |row, column| {
                eigen.eigenvectors[(column, kept[row])] / sd(row)
            }),
            log_scale: -(0..kept.len())
                .map(|row| (sd(row) * std::f64::consts::TAU.sqrt()).ln())
                .sum::<f64>(),
        }
    }

    fn log(&self, innovation: &DVector<f64>) -> f64 {
        let squares: f64 = self
            .whiten
            .row_iter()
            .map(|row| row.tr_dot(innovation).powi(2))
            .sum();
        self.log_scale - 0.5 * squares
    }
}

impl<'a> HypothesisTracker<'a> {
    /// A tracker of the start hypotheses of a belief, for someone who treats two beliefs alike where `alike` says so.
    ///
    /// # Errors
    /// [`Error::Unsupported`] where there is only one, or they are not tracked; [`Error::Setting`] for settings out of range.
    pub fn new(
        mdp: &BeliefMdp,
        settings: HypothesisSettings,
        alike: impl Fn(&Belief, &Belief) -> bool + Send + Sync + 'a,
    ) -> Result<Self> {
        let model = mdp.model();
        if mdp.starts().len() < 2 {
            let reason = match model.start.len() {
                1 => "it has one start, so there is nothing to find out by waking up; give a list of [[start]] tables, each with a mean and covariance, and `hypotheses = \"track\"` in [belief]".to_owned(),
                starts => format!("its {starts} starts are kept as one belief; write `hypotheses = \"track\"` in [belief]"),
            };
            return Err(Error::Unsupported {
                solver: "wake-up",
                model: model.name.clone(),
                reason,
            });
        }
        if !(0.0..1.0).contains(&settings.prune) {
            return Err(Error::Setting {
                setting: "prune",
                value: settings.prune.to_string(),
                range: "at least 0 and below 1",
            });
        }
        if let Merge::Coincide(distance) | Merge::Agree(distance) = settings.merge
            && (distance.is_nan() || distance < 0.0)
        {
            return Err(Error::Setting {
                setting: "merge",
                value: distance.to_string(),
                range: "a distance of at least 0 standard deviations",
            });
        }
        let levels = mdp.levels();
        let actions = model.actions.len();
        let density = |edge: usize| {
            let step = levels.step(edge / actions, levels.class_of(edge % actions));
            Density::new(&step.correction.innovation)
        };
        let inverse = |level| {
            let covariance: &DMatrix<f64> = levels.covariance(level);
            let whiten = Density::new(covariance).whiten;
            whiten.transpose() * whiten
        };
        let starts = mdp.starts().iter().enumerate();
        let starts: Vec<Hypothesis> = starts
            .map(|(origin, (weight, belief))| Hypothesis {
                weight: *weight,
                belief: belief.clone(),
                origin,
            })
            .collect();
        Ok(Self {
            alike: Arc::new(alike),
            filter: mdp.filter(),
            densities: (0..levels.len() * actions).map(density).collect(),
            actions,
            information: (0..levels.len()).map(inverse).collect(),
            live: starts.clone(),
            starts,
            settings,
            scratch: vec![0.0; model.state_dim()],
            innovation: DVector::zeros(model.observation_dim()),
        })
    }

    /// The hypotheses that are left, those of the start first.
    pub fn hypotheses(&self) -> &[Hypothesis] {
        &self.live
    }

    /// The start hypotheses.
    pub fn starts(&self) -> &[Hypothesis] {
        &self.starts
    }

    /// The hypothesis of most weight, the first of them where several have as much.
    pub fn heaviest(&self) -> &Hypothesis {
        let heavier = |best: usize, i: usize| match self.live[i].weight > self.live[best].weight {
            true => i,
            false => best,
        };
        &self.live[(0..self.live.len()).fold(0, heavier)]
    }

    fn normalise(&mut self) {
        let total: f64 = self.live.iter().map(|hypothesis| hypothesis.weight).sum();
        for hypothesis in &mut self.live {
            hypothesis.weight /= total;
        }
    }

    fn merge(&mut self) {
        let mut i = 0;
        while i < self.live.len() {
            match (i + 1..self.live.len()).find(|&j| self.are_one(i, j)) {
                Some(j) => {
                    let mut other = self.live.remove(j);
                    if other.weight > self.live[i].weight {
                        std::mem::swap(&mut other, &mut self.live[i]);
                    }
                    self.live[i].weight += other.weight;
                }
                None => i += 1,
            }
        }
    }

    fn are_one(&self, i: usize, j: usize) -> bool {
        let (a, b) = (&self.live[i].belief, &self.live[j].belief);
        if (a.stratum, a.mode) != (b.stratum, b.mode) {
            return false;
        }
        match self.settings.merge {
            Merge::Never => false,
            Merge::Coincide(within) => self.apart(a, b) <= within,
            Merge::Agree(within) => self.apart(a, b) <= within && (self.alike)(a, b),
        }
    }

    /// Distance of two means at the same level, in standard deviations.
    fn apart(&self, a: &Belief, b: &Belief) -> f64 {
        let information = &self.information[a.stratum];
        let between = |i: usize| a.mean[i] - b.mean[i];
        let n = a.mean.len();
        let squares: f64 = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| between(i) * information[(i, j)] * between(j))
            .sum();
        squares.max(0.0).sqrt()
    }
}

impl Tracker for HypothesisTracker<'_> {
    fn reset(&mut self) {
        self.live.clone_from(&self.starts);
    }

    /// Moves all hypotheses on by an action and what was sensed after it, weighs them by the density of their own innovation
    /// (Eq. 5.16), prunes and merges. Nothing sensed speaks for none of them.
    fn update(&mut self, action: ActionId, reading: Reading<'_>) {
        let mut best = f64::NEG_INFINITY;
        for hypothesis in &mut self.live {
            let belief = &mut hypothesis.belief;
            // Logarithms, because every density may be too small for a number.
            hypothesis.weight = hypothesis.weight.ln();
            if let Reading::Values(observation) = reading {
                self.filter.predict(belief, action, &mut self.scratch);
                let values = self.innovation.iter_mut().zip(observation).enumerate();
                for (reading, (value, observed)) in values {
                    let expected = self.filter.expected_reading(belief, &self.scratch, reading);
                    *value = observed - expected;
                }
                let density = &self.densities[belief.stratum * self.actions + action];
                hypothesis.weight += density.log(&self.innovation);
            }
            best = best.max(hypothesis.weight);
            self.filter
                .update(belief, action, reading, &mut self.scratch);
        }
        for hypothesis in &mut self.live {
            hypothesis.weight = (hypothesis.weight - best).exp();
        }
        self.normalise();
        let (prune, most) = (self.settings.prune, self.heaviest().weight);
        self.live
            .retain(|hypothesis| hypothesis.weight >= prune.min(most));
        self.merge();
        self.normalise();
    }

    fn belief(&self) -> &Belief {
        &self.heaviest().belief
    }
}
