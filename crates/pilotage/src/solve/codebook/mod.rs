//! Value iteration on a codebook: beliefs of any kind, planned for by stratum and mean.
//!
//! Beliefs are kept in full, by whatever [`Keeping`] a model takes, and read as a mean and one of finitely many strata
//! ([`Codebook`]). Values stand on a grid of means for every stratum.
//!
//! 1. Beliefs are met by acting at random, and strata chosen among them so that all are near one.
//! 2. From every stratum and mean of the grid every action leads to the beliefs after evenly spread readings, which are read as the strata
//!    that they lie between and the points of the grid around their mean. Where beliefs in full were met, they take the place of what
//!    the codebook makes of them.
//! 3. Value iteration on these sparse rows.
//! 4. The greedy policy is run, with some actions at random; the beliefs it meets go back to 1, where strata of them join the others.
//!
//! The round that earns most in the world that the model assumes is kept.

mod grid_values;
mod meet;
mod rows;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::refusals;
use super::settings::{Settings, ensure};
use super::solver::{Found, Plan, Planner, Problem, refuse_if};
use crate::belief::{
    CellsKeeping, Codebook, Coded, CodedSpace, Keeping, Moments, SumKeeping, Updater,
};
use crate::error::Result;
use crate::model::{Model, TrackerKind};
use crate::progress::Progress;
use crate::scenario::Scenario;
use crate::simulate::{Options, evaluate};
pub use grid_values::GridValues;
pub(super) use meet::meet;
use rows::Rows;

/// Name of the solver in errors and policies.
const SOLVER: &str = "codebook";

/// The planner on a codebook of strata.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CodebookPlanner {
    /// Most strata; at least 1, at most 1000, or `auto` for 120 where a step of a belief takes little time and 40 elsewhere.
    pub strata: Option<usize>,
    /// How far apart strata are at least, in units of the logarithm of a standard deviation; more than 0.
    pub apart: f64,
    /// Points of the grid of means along each variable; at least 2, or `auto` for what suits the number of variables.
    pub points: Option<usize>,
    /// Readings that are thought of after an action; at least 1.
    pub readings: usize,
    /// Times that the plan is refined on the beliefs that it meets; at least 1, or `auto` for 3 where a step of a belief takes little time and
    /// 2 elsewhere.
    pub rounds: Option<usize>,
    /// Episodes that are run to meet beliefs in a round; at least 1, at most a million.
    pub episodes: usize,
    /// Most beliefs in full that a round refines on; at least 0, or `auto` for 4000 where a step of a belief takes little time and 1000
    /// elsewhere.
    pub refined: Option<usize>,
    /// Largest change of a value in the last sweep, as a share of the largest value; more than 0.
    pub tolerance: f64,
}

impl Default for CodebookPlanner {
    fn default() -> Self {
        Self {
            strata: None,
            apart: 0.12,
            points: None,
            readings: 9,
            rounds: None,
            episodes: 200,
            refined: None,
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
        ensure("readings", self.readings, self.readings >= 1, "at least 1")?;
        let rounds = self.rounds.unwrap_or(1);
        ensure("rounds", rounds, rounds >= 1, "at least 1")?;
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
    let reason = refusals::reward_missing(model)
        .or_else(exact)
        .or_else(|| refusals::changes(model));
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
    refined: usize,
}

impl Size {
    /// Most strata of a round: three quarters of all in the first, so that later ones find room for strata of what they have met.
    fn strata_of(self, round: usize) -> usize {
        let later = self.strata / 4;
        match self.rounds {
            1 => self.strata,
            rounds => self.strata - later + (later * round).div_ceil(rounds - 1),
        }
    }
}

/// What a round of planning found.
struct Round {
    values: GridValues,
    updater: Updater,
    codebook: Arc<Codebook>,
    planned: f64,
    earned: f64,
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
        let size = self.size(keeping.is_light());
        let coarse = keeping.coarse();
        let mut codebook = Codebook::new(model);
        let mut met = meet(model, keeping.as_ref(), None, self.episodes, seed);
        let mut best: Option<Round> = None;
        let mut shapes: Vec<K::Full> = Vec::new();
        let mut earlier: Option<Rows> = None;
        for round in 0..size.rounds {
            observer.progress("rounds", round as u64, size.rounds as u64);
            let moments: Vec<Moments> = met.iter().map(|met| met.moments.clone()).collect();
            let added = codebook.cover(&moments, self.apart, size.strata_of(round));
            shapes.extend(added.into_iter().map(|i| met[i].full.clone()));
            let reaches = |rows: &Rows| moments.iter().all(|met| rows.grid.contains(&met.mean));
            earlier = earlier.filter(reaches);
            let known = earlier.as_ref().map(|rows| rows.grid.clone());
            let grid = known.unwrap_or_else(|| self.grid(model, &moments));
            let ways = (keeping.as_ref(), coarse.as_ref().unwrap_or(&keeping));
            let strata = (&codebook, shapes.as_slice());
            let rows = Rows::new(
                ways,
                strata,
                grid,
                &met,
                (size.refined, self.readings),
                earlier.take(),
            );
            let found = rows.solve(model.discount, self.tolerance);
            let planned = rows.worth(keeping.as_ref(), &codebook, &found, model.discount, self);
            let grid = rows.grid.clone();
            earlier = Some(rows);
            let shared = Arc::new(codebook.clone());
            let values = GridValues::new(grid, Arc::clone(&shared), &found, model.actions.len());
            let updater = updater(Coded::new(model, Arc::clone(&keeping), Arc::clone(&shared)));
            let options = Options {
                episodes: TRIALS * self.episodes,
                seed: seed.wrapping_add(1),
            };
            let assumed = Scenario::assumed(model);
            let earned = evaluate(
                &assumed,
                &updater,
                &values,
                options,
                &crate::progress::Silent,
            );
            let earned = earned.discounted.mean;
            met = meet(
                model,
                keeping.as_ref(),
                Some(&values),
                self.episodes,
                seed.wrapping_add(2 + round as u64),
            );
            if best.as_ref().is_none_or(|best| earned > best.earned) {
                best = Some(Round {
                    values,
                    updater,
                    codebook: shared,
                    planned,
                    earned,
                });
            }
        }
        observer.progress("rounds", size.rounds as u64, size.rounds as u64);
        let Some(best) = best else {
            return Err(crate::Error::Setting {
                setting: "rounds",
                value: size.rounds.to_string(),
                range: "at least 1",
            });
        };
        let space = CodedSpace::new(model, best.updater, &best.codebook);
        Ok(Plan {
            value: Some(best.planned),
            ..Plan::of(Found::Rule {
                policy: Box::new(best.values),
                space: Box::new(space),
            })
        })
    }

    /// What is not set, by whether a step of a belief takes little time.
    fn size(&self, light: bool) -> Size {
        let or = |set: Option<usize>, quick, slow| set.unwrap_or(if light { quick } else { slow });
        Size {
            strata: or(self.strata, 120, 40),
            rounds: or(self.rounds, 3, 2),
            refined: or(self.refined, 4000, 1000),
        }
    }

    /// Points of means that cover those that were met.
    fn grid(&self, model: &Model, met: &[Moments]) -> super::grid::Grid {
        let n = model.state_dim();
        let points = self.points.unwrap_or(match n {
            1 => 201,
            2 => 33,
            3 => 15,
            _ => 9,
        });
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
            super::grid::Axis::new(low, high.max(low + 1e-9), points)
        };
        super::grid::Grid::new(
            (0..n).map(axis).collect(),
            super::grid::Interpolation::Linear,
        )
    }
}

/// Rounds are compared by so many times as many episodes as beliefs are met in.
const TRIALS: usize = 5;
