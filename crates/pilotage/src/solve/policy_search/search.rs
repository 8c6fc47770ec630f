//! The search for switching planes.
//!
//! The aim is to stay within the limits, and the rewards of the model are not looked at. Three steps:
//!
//! 1. The value of a mean is `-m' P m`, the regulator's cost with one unit for being at a limit (A. E. Bryson, Y.-C. Ho, *Applied
//!    Optimal Control*, 1975). Its greedy actions switch along planes through the space of means.
//! 2. The planes are compiled into one node an action for each group of levels.
//! 3. The nodes are moved to where the belief is least likely to fail: first those of the steady level, where the agent spends
//!    its life, then those of the levels before it, over the first steps of an episode.

use nalgebra::DMatrix;

use super::failure::{Runs, Sample};
use super::refine::{POPULATION, Phase, refine};
use super::{PolicySearch, SOLVER};
use crate::belief::{BeliefMdp, LevelId};
use crate::error::Result;
use crate::model::Model;
use crate::observe::Observer;
use crate::policy::{Automaton, Controller};
use crate::solve::compile::{annotate, planes};
use crate::solve::lqr::lqr_gain;
use crate::solve::settings::Settings;
use crate::solve::solver::refuse_if;

/// Groups of levels end where the variances, in units of the limits squared, fall below so many times their steady sum.
const GROUPS_END: [f64; 2] = [5.0, 1.3];

/// Failures rarer than the first are too rare to search by, and limits are drawn in until they are as frequent as the second.
const RARE: f64 = 1e-6;
const FREQUENT: f64 = 1e-5;

/// Plans a policy that stays within the model's failure limits.
///
/// # Errors
/// [`crate::Error::Unsupported`] for a model without limits around the origin, with several modes or hypotheses to track, or with
/// actions that differ in their noise; [`crate::Error::Setting`] for settings out of range; as [`lqr_gain`] where the limits cannot be
/// kept by any control.
pub fn search(
    mdp: &BeliefMdp,
    settings: &PolicySearch,
    seed: u64,
    observer: &dyn Observer,
) -> Result<Automaton> {
    settings.validate()?;
    refuse_if(SOLVER, mdp.model(), refusal(mdp))?;
    let groups = groups_of_levels(mdp);
    let steady = groups[groups.len() - 1].1;
    observer.note(&format!(
        "{} levels in {} groups, {} nodes; no grid, less than 16 MiB; about {:.0} million steps of belief to simulate",
        mdp.levels().len(),
        groups.len(),
        groups.len() * mdp.model().actions.len(),
        steps(settings, groups.len()) / 1e6,
    ));
    let gain = greedy_gain(mdp, settings)?;
    let mut search = Search::new(mdp, (settings, seed), observer, groups, gain);
    observer.progress("policy search", 0, search.total);
    search.improve_steady(steady);
    search.improve_early();
    let mut automaton = search.automaton(&search.gains);
    annotate(&mut automaton, mdp, ANNOTATED, seed);
    Ok(automaton)
}

/// Episodes run to describe the nodes.
const ANNOTATED: usize = 50;

/// Runs, steps, generations and first step size of each phase at the steady level, and of each over the first steps.
const STEADY: [(usize, usize, usize, f64); 3] = [
    (100, 1500, 16, 0.3),
    (100, 6000, 16, 0.12),
    (200, 10_000, 14, 0.048),
];
const EARLY: [(usize, usize, f64); 2] = [(1000, 20, 0.3), (4000, 15, 0.15)];
/// Steps after the last early level that the early nodes are judged by.
const AFTERMATH: usize = 40;

/// Everything the search shares.
struct Search<'a> {
    mdp: &'a BeliefMdp,
    settings: &'a PolicySearch,
    seed: u64,
    observer: &'a dyn Observer,
    groups: Vec<planes::Group>,
    scale: Vec<f64>,
    /// By group, in scaled variables.
    gains: Vec<DMatrix<f64>>,
    done: u64,
    total: u64,
}

impl<'a> Search<'a> {
    /// Begins with the same gain everywhere, and measures the scale of every variable under it.
    fn new(
        mdp: &'a BeliefMdp,
        (settings, seed): (&'a PolicySearch, u64),
        observer: &'a dyn Observer,
        groups: Vec<planes::Group>,
        gain: DMatrix<f64>,
    ) -> Self {
        let n = mdp.model().state_dim();
        let generations = STEADY.iter().map(|phase| phase.2).sum::<usize>()
            + EARLY.iter().map(|phase| phase.1).sum::<usize>() * usize::from(groups.len() > 1);
        let steady = groups[groups.len() - 1].1;
        let mut search = Self {
            mdp,
            settings,
            seed,
            observer,
            gains: vec![gain; groups.len()],
            groups,
            scale: vec![1.0; n],
            done: 0,
            total: generations as u64,
        };
        let policy = search.controller(&search.gains);
        let sample = search.sample(100, 2000, 0);
        let spread = Runs::steady(mdp, steady).spread(&policy, sample);
        search.scale = spread;
        for gain in &mut search.gains {
            for (mut column, scale) in gain.column_iter_mut().zip(&search.scale) {
                column *= *scale;
            }
        }
        search
    }

    fn automaton(&self, gains: &[DMatrix<f64>]) -> Automaton {
        planes::automaton(self.mdp, SOLVER, &self.groups, gains, &self.scale)
    }

    fn controller(&self, gains: &[DMatrix<f64>]) -> Controller {
        Controller::new(&self.automaton(gains))
    }

    fn sample(&self, runs: usize, steps: usize, phase: u64) -> Sample {
        Sample {
            runs,
            steps: ((steps as f64 * self.settings.effort) as usize).max(1),
            seed: self.seed.wrapping_mul(1000).wrapping_add(phase),
        }
    }

    /// Moves the nodes of the steady level; all other levels follow.
    fn improve_steady(&mut self, steady: LevelId) {
        let (few, short, _, _) = STEADY[0];
        let runs = self.telling(Runs::steady(self.mdp, steady), self.sample(few, short, 1));
        for (phase, (count, steps, generations, step)) in (1..).zip(STEADY) {
            let sample = self.sample(count, steps, phase);
            let mut gain = vec![self.gains[0].clone()];
            self.phase(&mut gain, generations, step, phase, |search, gain| {
                let gains = vec![gain[0].clone(); search.groups.len()];
                runs.hazard(&search.controller(&gains), sample)
            });
            self.gains.fill(gain.swap_remove(0));
        }
        let hazard = Runs::steady(self.mdp, steady)
            .hazard(&self.controller(&self.gains), self.sample(100, 6000, 9));
        self.observer.note(&format!(
            "at the steady level the belief expects a failure in {:.3e} steps",
            1.0 / hazard
        ));
    }

    /// Moves the nodes of all levels before the steady ones together.
    fn improve_early(&mut self) {
        let early = self.groups.len() - 1;
        if early == 0 {
            return;
        }
        let horizon = self.groups[early].0 + AFTERMATH;
        let (effort, seed) = (self.settings.effort, self.seed);
        let sample = move |count: usize, phase| Sample {
            runs: ((count as f64 * effort) as usize).max(1),
            steps: horizon,
            seed: seed.wrapping_mul(1000).wrapping_add(phase),
        };
        let runs = self.telling(Runs::from_start(self.mdp), sample(EARLY[0].0, 10));
        for (phase, (count, generations, step)) in (10..).zip(EARLY) {
            let sample = sample(count, phase);
            let mut gains = self.gains[..early].to_vec();
            self.phase(&mut gains, generations, step, phase, |search, gains| {
                let mut all = gains.to_vec();
                all.push(search.gains[early].clone());
                runs.hazard(&search.controller(&all), sample)
            });
            self.gains[..early].clone_from_slice(&gains);
        }
        let hazard = Runs::from_start(self.mdp)
            .hazard(&self.controller(&self.gains), sample(EARLY[1].0, 19));
        self.observer.note(&format!(
            "over the first {horizon} steps the belief expects {:.3e} failures",
            hazard * horizon as f64
        ));
    }

    /// Runs in which failures are frequent enough to search by.
    fn telling(&self, runs: Runs, sample: Sample) -> Runs {
        let policy = self.controller(&self.gains);
        if runs.hazard(&policy, sample) < RARE {
            runs.with_failures(&policy, sample, FREQUENT)
        } else {
            runs
        }
    }

    fn phase(
        &mut self,
        gains: &mut [DMatrix<f64>],
        generations: usize,
        step: f64,
        phase: u64,
        hazard: impl Fn(&Self, &[DMatrix<f64>]) -> f64,
    ) {
        let settings = Phase {
            step,
            generations,
            seed: self.seed.wrapping_mul(1000).wrapping_add(100 + phase),
        };
        refine(
            gains,
            settings,
            |gains| hazard(self, gains),
            |generation| {
                self.observer
                    .progress("policy search", self.done + generation, self.total);
            },
        );
        self.done += generations as u64;
    }
}

/// Steps of belief that the search simulates.
fn steps(settings: &PolicySearch, groups: usize) -> f64 {
    let steady = STEADY
        .iter()
        .map(|(runs, steps, generations, _)| runs * steps * generations);
    let early = EARLY
        .iter()
        .map(|(runs, generations, _)| runs * generations * (AFTERMATH + 25));
    let early = early.sum::<usize>() * usize::from(groups > 1);
    (steady.sum::<usize>() + early) as f64 * POPULATION as f64 * settings.effort
}

/// The regulator's gain (`p x n`) for one unit of cost at each limit, and `control_weight` for the strongest control.
fn greedy_gain(mdp: &BeliefMdp, settings: &PolicySearch) -> Result<DMatrix<f64>> {
    let model = mdp.model();
    let p = model.motion.b.ncols();
    let strongest = |j: usize| {
        let strengths = model.actions.iter().map(|action| action.control[j].abs());
        strengths.fold(f64::MIN_POSITIVE, f64::max)
    };
    let control = DMatrix::from_fn(p, p, |i, j| {
        if i == j {
            settings.control_weight / strongest(j).powi(2)
        } else {
            0.0
        }
    });
    lqr_gain(
        &model.motion.a,
        &model.motion.b,
        &state_weights(model),
        &control,
    )
}

/// One unit of cost at the nearer limit of each variable (`n x n`, diagonal).
fn state_weights(model: &Model) -> DMatrix<f64> {
    let mut weights = DMatrix::zeros(model.state_dim(), model.state_dim());
    for &(i, side) in &model.episode.alive.sides {
        weights[(i, i)] = side.high.min(-side.low).powi(-2);
    }
    weights
}

/// The levels of an episode in groups of like uncertainty; the last holds the steady level.
fn groups_of_levels(mdp: &BeliefMdp) -> Vec<planes::Group> {
    let levels = mdp.levels();
    let last = levels.len() - 1;
    let weights = state_weights(mdp.model());
    let uncertainty = |level| weights.component_mul(levels.covariance(level)).sum();
    let excess = |level: LevelId| uncertainty(level) / uncertainty(last);
    let mut groups = Vec::new();
    let mut first = 0;
    for end in GROUPS_END {
        let next = (first..last)
            .find(|&level| excess(level) < end)
            .unwrap_or(last);
        if next > first {
            groups.push((first, next - 1));
            first = next;
        }
    }
    groups.push((first, last));
    groups
}

/// Why a model cannot be planned for, and what would do.
pub fn refusal(mdp: &BeliefMdp) -> Option<String> {
    let model = mdp.model();
    let sides = &model.episode.alive.sides;
    if sides.is_empty() {
        Some(format!(
            "it has {} state variables, and no failure limits to plan by; add `alive` to [episode], or use value-iteration where there are at most 3 variables",
            model.state_dim()
        ))
    } else if let Some((i, side)) = sides
        .iter()
        .find(|(_, side)| !(side.low < 0.0 && 0.0 < side.high))
    {
        Some(format!(
            "0 is not within the failure limits [{}, {}] of `{}`, and the planner steers there; measure the variable from a point within its limits",
            side.low, side.high, model.state[*i].name
        ))
    } else if model.modes.len() > 1 || !mdp.is_gaussian() {
        Some("a quadratic value knows nothing of modes, walls or hypotheses; state the problem without them, or use value-iteration".to_owned())
    } else if mdp.levels().classes().len() > 1 {
        Some("its actions differ in their noise, so that its levels are no chain; give all actions the same noise".to_owned())
    } else {
        None
    }
}
