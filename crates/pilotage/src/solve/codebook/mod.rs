//! Value iteration on a codebook: beliefs of any kind, planned for by stratum and mean.
//!
//! Beliefs are kept in full, by whatever [`Keeping`] a model takes, and read as a mean and one of finitely many strata
//! ([`Codebook`]). Values stand on a grid of means for every stratum.
//!
//! 1. Beliefs are met by acting at random, though not so that the episode is over, and strata chosen among them so that all are near one.
//! 2. From every stratum and mean of the grid every action leads to the beliefs after evenly spread readings, which are read as the strata
//!    that they lie between and the points of the grid around their mean. Once there is a plan, only those are looked at that beliefs were
//!    met near: of the others it is kept.
//! 3. Value iteration on these sparse rows.
//! 4. The greedy policy is run, with some actions at random; the beliefs it meets go back to 1, where strata of them join the others.
//!
//! The round that earns most in the world that the model assumes is kept.

mod grid_values;
mod means;
mod meet;
mod rows;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::grid::Axis;
use super::refusals;
use super::settings::{Settings, ensure};
use super::solver::{Found, Plan, Planner, Problem, refuse_if};
use crate::belief::{
    CellsKeeping, Codebook, Coded, CodedSpace, Keeping, Moments, SumKeeping, Updater,
};
use crate::error::Result;
use crate::model::{Model, TrackerKind};
use crate::progress::Progress;
use crate::solve::deviation::{self, Budget};
pub use grid_values::GridValues;
use means::Means;
use meet::Met;
pub(super) use meet::{Walk, meet};
use rows::Rows;

/// Name of the solver in errors and policies.
const SOLVER: &str = "codebook";

/// The planner on a codebook of strata.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CodebookPlanner {
    /// Most strata; at least 1, at most 1000, or `auto` for 120 where a step of a belief takes little time and 60 elsewhere.
    pub strata: Option<usize>,
    /// How far apart strata are at least, in units of the logarithm of a standard deviation; more than 0.
    pub apart: f64,
    /// Points of the grid of means along each variable; at least 2, or `auto` for what suits the number of variables, and up to twice as many in
    /// each further round where values bend between them.
    pub points: Option<usize>,
    /// Readings that are thought of after an action; at least 1, or `auto` for 15 where one number is read and 9 elsewhere.
    pub readings: Option<usize>,
    /// Times that the plan is refined on the beliefs that it meets; at least 1.
    pub rounds: usize,
    /// Episodes that are run to meet beliefs in a round; at least 1, at most a million.
    pub episodes: usize,
    /// Largest change of a value in the last sweep, as a share of the largest value; more than 0.
    pub tolerance: f64,
}

impl Default for CodebookPlanner {
    fn default() -> Self {
        Self {
            strata: None,
            apart: 0.12,
            points: None,
            readings: None,
            rounds: 4,
            episodes: 200,
            tolerance: 1e-6,
        }
    }
}

impl Settings for CodebookPlanner {
    fn validate(&self) -> Result<()> {
        let strata = self.strata.unwrap_or(1);
        ensure("strata", strata, (1..=1000).contains(&strata), "1 to 1000")?;
        ensure("apart", self.apart, self.apart > 0.0, "above 0")?;
        let points = self.points.unwrap_or(2);
        ensure("points", points, points >= 2, "at least 2")?;
        let readings = self.readings.unwrap_or(1);
        ensure("readings", readings, readings >= 1, "at least 1")?;
        ensure("rounds", self.rounds, self.rounds >= 1, "at least 1")?;
        super::rollout::check_runs("episodes", self.episodes)?;
        ensure("tolerance", self.tolerance, self.tolerance > 0.0, "above 0")
    }
}

/// Whether a model is planned for on a codebook: its beliefs are kept in full.
///
/// # Errors
/// [`crate::Error::Unsupported`] with the reason, and what would do.
pub fn accepts(model: &Model) -> Result<()> {
    let exact = || {
        (model.tracker() == TrackerKind::Linear).then(|| {
            "its belief is one Gaussian on uncertainty levels; use value-iteration, or write `tracker = \"sum\"` in [belief]".to_owned()
        })
    };
    let reason = refusals::reward_missing(model).or_else(exact);
    refuse_if(SOLVER, model, reason)
}

impl Planner for CodebookPlanner {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        accepts(model)
    }

    fn needs_levels(&self) -> bool {
        false
    }

    fn plan(&self, problem: &Problem, observer: &dyn Progress) -> Result<Plan> {
        let model = problem.model();
        match model.tracker() {
            TrackerKind::Cells => {
                let keeping = Arc::new(CellsKeeping::new(model)?);
                self.plan_with(model, keeping, Updater::Cells, problem.seed(), observer)
            }
            _ => {
                let keeping = Arc::new(SumKeeping::new(model));
                self.plan_with(model, keeping, Updater::Sum, problem.seed(), observer)
            }
        }
    }
}

/// How much is planned for.
#[derive(Debug, Clone, Copy)]
struct Size {
    strata: usize,
    rounds: usize,
    readings: usize,
    /// Steps in which the plan of a round is tried.
    trial_steps: usize,
}

impl Size {
    /// Most strata of a round: half of all in the first, which knows only what is met by chance, so that later ones find room for strata of
    /// what they have met.
    fn strata_of(self, round: usize) -> usize {
        let later = self.strata / 2;
        match self.rounds {
            1 => self.strata,
            rounds => self.strata - later + (later * round).div_ceil(rounds - 1),
        }
    }
}

/// What a round of planning found.
struct Round {
    values: GridValues,
    space: CodedSpace,
    planned: f64,
    /// What it earns where the model holds in each of some episodes, which are the same for all rounds.
    returns: Vec<f64>,
}

impl Round {
    fn earns_more_than(&self, other: &Self) -> bool {
        deviation::gain(&self.returns, &other.returns).mean > 0.0
    }
}

/// Planning in rounds, and what goes from one to the next.
struct Course<'a, K: Keeping> {
    planner: &'a CodebookPlanner,
    model: &'a Model,
    keeping: Arc<K>,
    updater: fn(Coded<K>) -> Updater,
    seed: u64,
    size: Size,
    codebook: Codebook,
    /// The belief that each stratum was met as.
    shapes: Vec<K::Full>,
    met: Vec<Met<K::Full>>,
    /// Points of the grid along each variable.
    points: Vec<usize>,
    /// What the last round made of it.
    plan: Option<GridValues>,
    /// Rows of the last round, where they are still on the right grid.
    earlier: Option<Rows>,
}

impl<'a, K: Keeping> Course<'a, K> {
    fn new(
        planner: &'a CodebookPlanner,
        model: &'a Model,
        keeping: Arc<K>,
        updater: fn(Coded<K>) -> Updater,
        seed: u64,
    ) -> Self {
        Self {
            planner,
            model,
            updater,
            seed,
            size: planner.size(model, keeping.is_light()),
            codebook: Codebook::new(model),
            shapes: Vec::new(),
            met: meet(model, keeping.as_ref(), Walk::Wary, planner.episodes, seed),
            points: planner.first_points(model),
            plan: None,
            earlier: None,
            keeping,
        }
    }

    fn round(&mut self, round: usize, best: Option<&Round>) -> Round {
        let (planner, model) = (self.planner, self.model);
        let rows = self.rows(round);
        let found = rows.solve(model.discount, planner.tolerance);
        let keeping = self.keeping.as_ref();
        let planned = rows.worth(
            keeping,
            &self.codebook,
            &found,
            model.discount,
            self.size.readings,
        );
        let codebook = Arc::new(self.codebook.clone());
        let actions = model.actions.len();
        let values = GridValues::new(rows.means.clone(), Arc::clone(&codebook), &found, actions);
        let coded = Coded::new(model, Arc::clone(&self.keeping), Arc::clone(&codebook));
        let space = CodedSpace::new(model, (self.updater)(coded), &codebook);
        let returns = self.returns(&values, &space, best);
        if round + 1 < self.size.rounds {
            let seed = self.seed.wrapping_add(2 + round as u64);
            let walk = Walk::Following(&values);
            self.met = meet(model, keeping, walk, planner.episodes, seed);
            self.refine_grid(rows, &found, planned);
            self.plan = Some(values.clone());
        }
        Round {
            values,
            space,
            planned,
            returns,
        }
    }

    /// The rows of a codebook to which strata of what was met are added.
    fn rows(&mut self, round: usize) -> Rows {
        let moments: Vec<Moments> = self.met.iter().map(|met| met.moments.clone()).collect();
        let (apart, most) = (self.planner.apart, self.size.strata_of(round));
        let added = self.codebook.cover(&moments, apart, most).into_iter();
        self.shapes.extend(added.map(|i| self.met[i].full.clone()));
        let reaches = |rows: &Rows| moments.iter().all(|met| rows.means.contains(&met.mean));
        let earlier = self.earlier.take().filter(reaches);
        let known = earlier.as_ref().map(|rows| rows.means.clone());
        let made = || Means::new(self.model, axes(self.model, &moments, &self.points));
        let means = known.unwrap_or_else(made);
        let coarse = self.keeping.coarse();
        let keeping = self.keeping.as_ref();
        Rows::new(
            (keeping, coarse.as_ref().unwrap_or(keeping)),
            (&self.codebook, self.shapes.as_slice()),
            (means, self.model.episode.length),
            &self.met,
            self.size.readings,
            (self.plan.as_ref(), earlier),
        )
    }

    /// What the plan itself earns where the model holds, in fewer episodes if it is plainly worse than the best.
    fn returns(&self, plan: &GridValues, space: &CodedSpace, best: Option<&Round>) -> Vec<f64> {
        let budget = Budget {
            episodes: self.planner.episodes,
            steps: self.size.trial_steps,
        };
        let best = best.map(|best| best.returns.as_slice());
        let seed = self.seed.wrapping_add(1);
        let mut returns = deviation::returns(space, &[plan], budget, seed, best);
        returns.pop().unwrap_or_default()
    }

    /// Chooses the points of the next round, where nobody has said how many there are, and keeps the rows if they stay.
    fn refine_grid(&mut self, rows: Rows, found: &[f64], planned: f64) {
        let points = match self.planner.points {
            Some(_) => self.points.clone(),
            None => {
                let steps = (self.met.len() / self.planner.episodes).max(1) as i32;
                let horizon: f64 = (0..steps).map(|t| self.model.discount.powi(t)).sum();
                let bends = rows.bends(&self.codebook, found, &self.met).into_iter();
                let off = bends.map(|bend| horizon * bend / (OFF * planned.abs()));
                let shares = self.size.strata * self.model.actions.len();
                finer(&self.points, off, MOST_VALUES / shares.max(1))
            }
        };
        self.earlier = (points == self.points).then_some(rows);
        self.points = points;
    }
}

impl CodebookPlanner {
    fn plan_with<K: Keeping>(
        &self,
        model: &Model,
        keeping: Arc<K>,
        updater: fn(Coded<K>) -> Updater,
        seed: u64,
        observer: &dyn Progress,
    ) -> Result<Plan> {
        let mut course = Course::new(self, model, keeping, updater, seed);
        let rounds = course.size.rounds;
        let mut best: Option<Round> = None;
        for round in 0..rounds {
            observer.progress("rounds", round as u64, rounds as u64);
            let found = course.round(round, best.as_ref());
            if best.as_ref().is_none_or(|best| found.earns_more_than(best)) {
                best = Some(found);
            }
        }
        observer.progress("rounds", rounds as u64, rounds as u64);
        let Some(best) = best else {
            return Err(crate::Error::Setting {
                setting: "rounds",
                value: rounds.to_string(),
                range: "at least 1",
            });
        };
        Ok(Plan {
            value: Some(best.planned),
            ..Plan::of(Found::Rule {
                policy: Box::new(best.values),
                space: Box::new(best.space),
            })
        })
    }

    /// What is not set, by what is read and by whether a step of a belief takes little time.
    fn size(&self, model: &Model, light: bool) -> Size {
        let or = |set: Option<usize>, quick, slow| set.unwrap_or(if light { quick } else { slow });
        Size {
            strata: or(self.strata, 120, 60),
            rounds: self.rounds,
            trial_steps: self.episodes * if light { TRIAL_STEPS.0 } else { TRIAL_STEPS.1 },
            // Single numbers can be put in order, and each of them counts.
            readings: self.readings.unwrap_or(match model.sensor_dim() {
                0 | 1 => 15,
                _ => 9,
            }),
        }
    }

    /// Points along each variable in the first round.
    fn first_points(&self, model: &Model) -> Vec<usize> {
        let n = model.state_dim();
        let points = self.points.unwrap_or(match n {
            1 => 201,
            2 => 17,
            3 => 9,
            _ => 7,
        });
        vec![points; n]
    }
}

/// Evenly spaced points of means that cover those that were met.
fn axes(model: &Model, met: &[Moments], points: &[usize]) -> Vec<Axis> {
    let axis = |i: usize| {
        let means = met.iter().map(|moments| moments.mean[i]);
        let (low, high) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        let margin = 0.05 * (high - low).max(1e-9);
        let bounds = model.state[i].bounds;
        let (low, high) = (
            (low - margin).max(bounds.low),
            (high + margin).min(bounds.high),
        );
        Axis::new(low, high.max(low + 1e-9), points[i])
    };
    (0..points.len()).map(axis).collect()
}

/// As many points as leave straight lines between them off by as much as may be, where they are `off` by so many times that; at most twice
/// as many along a variable, and `most` in all. What is off falls with the square of the distance of points.
fn finer(points: &[usize], off: impl Iterator<Item = f64>, most: usize) -> Vec<usize> {
    let factors: Vec<f64> = off.map(|off| off.sqrt().clamp(1.0, 2.0)).collect();
    let scaled = |share: f64| -> Vec<usize> {
        let of = |(points, factor): (&usize, &f64)| {
            let intervals = (points - 1) as f64 * (1.0 + share * (factor - 1.0));
            intervals.ceil() as usize + 1
        };
        points.iter().zip(&factors).map(of).collect()
    };
    let shares = (1..=SHARES).rev().map(|k| k as f64 / SHARES as f64);
    let fits = |points: &Vec<usize>| points.iter().product::<usize>() <= most;
    shares
        .map(scaled)
        .find(fits)
        .unwrap_or_else(|| points.to_vec())
}

/// Share of the plan by which straight lines between points may be off along a variable, all steps of an episode together.
const OFF: f64 = 0.01;

/// Most values of actions that a grid is made finer for. Rows are found of few of them: of those that beliefs are met near.
const MOST_VALUES: usize = 1_200_000;

/// Steps in which a finer grid is given up where it has too many points.
const SHARES: usize = 8;

/// Steps in which the plan of a round is tried, for each episode in which beliefs are met: where a step of a belief takes little time, and
/// elsewhere.
const TRIAL_STEPS: (usize, usize) = (1000, 100);
