//! Point-based value iteration on cells, for models of one or two state variables: beliefs of any shape, discrete sensors, noise and
//! motion that depend on the state.
//!
//! Beliefs are kept as probabilities of cells ([`CellsKeeping`]). Those met by acting are collected, and vectors over modes and cells,
//! each the value of a policy, are backed up at them. It begins with the values of repeating one action for ever, and every value stays
//! one that a policy earns on the cells, so that what the plan says is a lower bound there. Values are summed without end: in an episode
//! that stops earlier, less may be earned by the discount to the power of its length.
//!
//! # References
//! - J. Pineau, G. Gordon and S. Thrun, "Point-based value iteration: an anytime algorithm for POMDPs", 2003.
//! - M. T. J. Spaan and N. Vlassis, "Perseus: randomized point-based value iteration for POMDPs", 2005.
//! - J. Hoey and P. Poupart, "Solving POMDPs with continuous or large discrete observation spaces", 2005 (readings in bins).

mod backup;
mod graph;
mod improve;
mod occupied;
mod point;
mod policy;
mod shrink;
mod signals;
mod size;
#[cfg(test)]
mod tests;
mod tune;
mod walk;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use point::ValueVector;
pub use policy::PointBasedPolicy;

use super::Form;
use super::refusals;
use super::settings::{PAIRED, Settings, ensure, ensure_count};
use super::solver::{Found, Plan, Planner, Problem, no_graph, refuse, refuse_if};
use crate::belief::{CellsKeeping, Codebook, Coded, CodedSpace, Keeping, Moments, Updater};
use crate::error::Result;
use crate::model::{Model, TrackerKind};
use crate::progress::Progress;
use crate::random::{Rng, Role, stream};
use backup::Backup;
use improve::improve;
use point::{Point, VectorSet};
use policy::Read;
use walk::{Met, Walker};

/// Name of the solver in errors and policies.
const SOLVER: &str = "point-based";

/// Most bins along a reading where settings do not say, for one and for two readings.
const BINS: [usize; 2] = [40, 8];

/// Most readings that are cut into bins.
const MOST_READINGS: usize = BINS.len();

/// Rounds of backups between two times that beliefs are collected.
const SWEEPS: usize = 12;

/// How far apart the strata of a plan are at least, in units of the logarithm of a standard deviation, and how many there are at most.
const APART: f64 = 0.05;
const MOST_STRATA: usize = 200;

/// Walks by which it is found what a plan counts on after the end of an episode.
const WALKS: usize = 64;

/// Share of what a round has to gain that counts as a gain at a belief.
const HARDLY: f64 = 0.01;

/// What point-based value iteration can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PointBased {
    /// Most beliefs at which values are backed up; at least 1, at most 10000.
    pub beliefs: usize,
    /// Sum of the differences of probabilities by which two of them are apart; at least 0, at most 2.
    pub apart: f64,
    /// Most times that beliefs are collected and backed up; at least 1, at most 10000.
    pub rounds: usize,
    /// Share of the value of the start; a round that gains less is the last one; more than 0.
    pub epsilon: f64,
    /// Probability of another action than the best where beliefs are collected; at least 0, at most 1.
    pub exploration: f64,
    /// Most bins along a reading, at least 2, at most 10000; `auto` for 40 of one reading and 8 of two.
    pub bins: Option<usize>,
}

impl Default for PointBased {
    fn default() -> Self {
        Self {
            beliefs: 600,
            apart: 0.1,
            rounds: 20,
            epsilon: 2e-3,
            exploration: 0.15,
            bins: None,
        }
    }
}

impl Settings for PointBased {
    fn validate(&self) -> Result<()> {
        ensure_count("beliefs", self.beliefs, 1, PAIRED)?;
        ensure_count("rounds", self.rounds, 1, PAIRED)?;
        if let Some(bins) = self.bins {
            ensure_count("bins", bins, 2, PAIRED)?;
        }
        let fits = (0.0..=2.0).contains(&self.apart);
        ensure("apart", self.apart, fits, "from 0 to 2")?;
        let fits = (0.0..=1.0).contains(&self.exploration);
        ensure("exploration", self.exploration, fits, "from 0 to 1")?;
        let fits = self.epsilon > 0.0 && self.epsilon.is_finite();
        ensure("epsilon", self.epsilon, fits, "above 0")
    }
}

/// What point-based value iteration found.
#[derive(Debug, Clone)]
pub struct PointBasedPlan {
    /// What can be earned from the start in an episode, at least.
    pub value: f64,
    /// What to do at a belief.
    pub policy: PointBasedPolicy,
    /// Strata by which its beliefs are read.
    pub strata: Codebook,
    /// Beliefs at which values were backed up.
    pub beliefs: usize,
    /// Whether the last round gained less than it was told to.
    pub converged: bool,
}

/// Whether point-based value iteration is made for a model, as far as can be told without making its cells.
///
/// # Errors
/// [`crate::Error::Unsupported`] with the reason, and what would do.
pub fn accepts(model: &Model) -> Result<()> {
    let n = model.state_dim();
    let variables = (n > 2).then(|| {
        format!("it has {n} state variables, and cells are kept of one or two; use another solver")
    });
    let numbers = model.sensor_dim();
    let readings = (numbers > MOST_READINGS).then(|| {
        format!("it reads {numbers} numbers, and at most {MOST_READINGS} are cut into bins; use another solver")
    });
    let reason = refusals::reward_missing(model)
        .or_else(|| refusals::changes(model))
        .or(variables)
        .or(readings)
        .or_else(|| ends_cost(model));
    refuse_if(SOLVER, model, reason)
}

/// Values without end have no last state.
fn ends_cost(model: &Model) -> Option<String> {
    let cost = model.cost.as_ref()?;
    let costs = cost.terminal.iter().any(|weight| *weight != 0.0);
    costs.then(|| {
        "the state in which an episode ends costs (`terminal` in [cost]), and this solver looks ahead without end; use lqg".to_owned()
    })
}

/// Plans on cells.
///
/// # Errors
/// As [`accepts`], [`crate::Error::Setting`] for settings out of range, and [`crate::Error::Unsupported`] for a model of which cells
/// cannot be made.
pub fn solve(
    model: &Model,
    settings: &PointBased,
    seed: u64,
    observer: &dyn Progress,
) -> Result<PointBasedPlan> {
    settings.validate()?;
    accepts(model)?;
    let keeping = Arc::new(CellsKeeping::new(model)?);
    let usual = BINS.get(model.sensor_dim().saturating_sub(1));
    let bins = settings.bins.or(usual.copied());
    let Some(bins) = bins else {
        return Err(refuse(SOLVER, model, "it reads too many numbers"));
    };
    let backup = Backup::new(keeping, model.discount, bins);
    let search = Search {
        backup: &backup,
        settings,
        seed,
        length: model.episode.length,
        observer,
    };
    let (met, set, converged) = search.run();
    let strata = codebook(model, &backup.keeping, &met);
    let value = set.start - search.beyond(&set);
    Ok(PointBasedPlan {
        value,
        policy: PointBasedPolicy::new(backup, set),
        strata,
        beliefs: met.points.len(),
        converged,
    })
}

/// Strata that the beliefs of a plan are near to.
fn codebook(model: &Model, keeping: &CellsKeeping, met: &Met) -> Codebook {
    let moments = |point: &Point| {
        let mut mass = vec![0.0; keeping.states()];
        for (state, part) in point.states.iter().zip(&point.masses) {
            mass[*state] = *part;
        }
        let mut moments = Moments::default();
        keeping.moments(&keeping.belief(mass), &mut moments);
        moments
    };
    let moments: Vec<Moments> = met.points.iter().map(moments).collect();
    let mut codebook = Codebook::new(model);
    codebook.cover(&moments, APART, MOST_STRATA);
    codebook.sort();
    codebook
}

impl Planner for PointBased {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        accepts(model)
    }

    /// Cells of two variables are many, and worth it where the model asks for them.
    fn suits(&self, model: &Model) -> bool {
        model.state_dim() == 1 || model.belief.tracker == TrackerKind::Cells
    }

    fn needs_levels(&self) -> bool {
        false
    }

    fn makes_graph(&self, model: &Model) -> Result<()> {
        match model.laws.symbols.is_empty() {
            true => Err(no_graph(SOLVER, model)),
            false => Ok(()),
        }
    }

    fn plan(&self, problem: &Problem, observer: &dyn Progress) -> Result<Plan> {
        let model = problem.model();
        let found = solve(model, self, problem.seed(), observer)?;
        if problem.form() == Form::Graph {
            let graph = found.policy.graph(model, problem.size(), observer);
            let graph = graph.ok_or_else(|| no_graph(SOLVER, model))?;
            return Ok(Plan {
                converged: found.converged,
                ..Plan::graph(graph)
            });
        }
        let codebook = Arc::new(found.strata);
        let keeping = Arc::clone(&found.policy.backup.keeping);
        let updater = Updater::Cells(Coded::new(model, keeping, Arc::clone(&codebook)));
        let space = CodedSpace::new(model, updater, &codebook);
        let policy = Read {
            policy: found.policy,
            codebook,
        };
        Ok(Plan {
            value: Some(found.value),
            converged: found.converged,
            ..Plan::of(Found::Rule {
                policy: Box::new(policy),
                space: Box::new(space),
            })
        })
    }
}

struct Search<'a> {
    backup: &'a Backup,
    settings: &'a PointBased,
    seed: u64,
    /// Steps of an episode.
    length: usize,
    observer: &'a dyn Progress,
}

impl Search<'_> {
    fn rng(&self) -> Rng {
        stream(self.seed, u64::MAX, Role::Planner)
    }

    /// The values of repeating one action for ever.
    fn blind(&self) -> VectorSet {
        let actions = 0..self.backup.keeping.actions();
        let vectors = actions.map(|action| Arc::new(self.backup.blind(action)));
        VectorSet::new(vectors.collect(), &self.backup.start)
    }

    /// What a plan without end counts on after the end of an episode.
    fn beyond(&self, set: &VectorSet) -> f64 {
        let walker = Walker {
            exploration: 0.0,
            ..self.walker(Some(set))
        };
        walker.beyond(set, WALKS)
    }

    fn walker<'b>(&'b self, vectors: Option<&'b VectorSet>) -> Walker<'b> {
        Walker {
            backup: self.backup,
            vectors,
            exploration: self.settings.exploration,
            length: self.length,
            seed: self.seed,
        }
    }

    /// Collects beliefs and backs them up in turns, until a round gains little.
    fn run(&self) -> (Met, VectorSet, bool) {
        let most = self.settings.beliefs;
        let mut rng = self.rng();
        let mut set = self.blind();
        let blind = set.start;
        let mut met = Met::new(self.backup.start.clone(), self.settings.apart);
        met.collect(&self.walker(None), most.div_ceil(4));
        let mut quiet = 0;
        for round in 0..self.settings.rounds {
            let before = set.start;
            set = self.sweep(&met.points, set, &mut rng);
            let gain = set.start - before;
            self.observer.progress(
                "backing up beliefs",
                round as u64 + 1,
                self.settings.rounds as u64,
            );
            self.observer.status(&format!(
                "{} beliefs, {} vectors, value {:.4}",
                met.points.len(),
                set.vectors.len(),
                set.start
            ));
            quiet = match gain <= self.settings.epsilon * set.start.abs() {
                true => quiet + 1,
                false => 0,
            };
            // A round of quiet may be for want of beliefs, above all where nothing has been gained at all.
            if quiet >= 2 && (set.start > blind || met.points.len() == most) {
                return (met, set, true);
            }
            let share = most.div_ceil(8).max(1);
            let more = (met.points.len() + share).min(most);
            met.collect(&self.walker(Some(&set)), more);
        }
        (met, set, false)
    }

    /// Backs up until little is gained anywhere.
    fn sweep(&self, points: &[Point], mut set: VectorSet, rng: &mut Rng) -> VectorSet {
        for _ in 0..SWEEPS {
            let little = self.settings.epsilon * set.start.abs();
            let improved = improve(self.backup, points, &set, HARDLY * little, rng);
            set = improved.set;
            if improved.gain <= little {
                break;
            }
        }
        set
    }
}
