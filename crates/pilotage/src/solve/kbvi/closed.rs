//! Closed-loop KBVI: value iteration on beliefs `(mode, level, mean)`.
//!
//! The thesis' branches (5.3) fix a sequence of actions in advance, so to them sensing is worth nothing. Here the agent is free to
//! choose again after every observation:
//!
//! ```text
//! Q(b, a) = r(b, a) + discount * E V(b'),   m' = A m + B u + K nu,  nu ~ N(0, S)
//! V(b)    = max_a Q(b, a)
//! ```
//!
//! The expectation is taken first, once for each level and noise class: `W(x) = E V(x + K nu)` on the grid of means. Then
//! `Q` is one look-up of `W` at `A m + B u` for each action. Where the model has failure limits, the belief one step on may have
//! failed: with probability `f(b')` it earns the reward of failing and nothing more, otherwise `discount * V(b')`.
//!
//! Levels are solved in the order in which the filter leaves them, last first, so only those that come back to themselves need
//! iterating.

use nalgebra::DMatrix;

use super::extent::{axes, knows_map, mebibytes};
use crate::belief::{Belief, BeliefMdp, LevelId};
use crate::error::{Error, Result};
use crate::model::{ActionId, Then};
use crate::observe::Observer;
use crate::policy::Policy;
pub use crate::solve::grid::Settings;
use crate::solve::grid::{Grid, Interpolation, Smoother};
use crate::solve::walled::WalledSmoother;

/// The value on the grid, and the policy that looks one step ahead from any belief.
#[derive(Debug)]
pub struct GridPolicy {
    mdp: BeliefMdp,
    grid: Grid,
    /// `V`, by mode and level.
    values: Vec<Vec<f64>>,
    /// Probability of having failed, by level; empty without failure limits.
    failures: Vec<Vec<f64>>,
    /// `discount * W`, by mode, level and noise class: what is still to come after an action of the class, by where the next
    /// mean is centred.
    expected: Vec<Vec<f64>>,
    /// Value of the start belief.
    start_value: f64,
    /// Whether the tolerance was reached within the allowed sweeps.
    pub converged: bool,
    /// Sweeps over all groups of levels.
    pub sweeps: usize,
}

/// Plans by value iteration.
///
/// # Errors
/// [`Error::TooLarge`] where the grid does not fit the memory allowed, [`Error::Setting`] for settings out of range.
pub fn solve(mdp: &BeliefMdp, settings: &Settings, observer: &dyn Observer) -> Result<GridPolicy> {
    check(settings)?;
    let grid = Grid::new(axes(mdp, settings)?, Interpolation::Cubic);
    observer.note(&format!(
        "{} levels on a grid of {} points: {} MiB",
        mdp.levels().len(),
        grid.len(),
        mebibytes(mdp, grid.len() as u64)
    ));
    let mut policy = GridPolicy::new(mdp.clone(), grid);
    let groups = groups_of_levels(mdp);
    for (done, group) in groups.iter().enumerate() {
        policy.solve_group(group, settings);
        observer.progress("levels", done as u64 + 1, groups.len() as u64);
    }
    Ok(policy)
}

fn check(settings: &Settings) -> Result<()> {
    if let Some(points) = settings.points.filter(|points| *points < 2) {
        return Err(Error::Setting {
            setting: "points",
            value: points.to_string(),
            range: "at least 2",
        });
    }
    if settings.tolerance.is_nan() || settings.tolerance <= 0.0 {
        return Err(Error::Setting {
            setting: "tolerance",
            value: settings.tolerance.to_string(),
            range: "above 0",
        });
    }
    if settings.sweeps == 0 {
        return Err(Error::Setting {
            setting: "sweeps",
            value: "0".to_owned(),
            range: "at least 1",
        });
    }
    Ok(())
}

/// Probability of having failed at every point, by level; empty without failure limits.
fn failures(mdp: &BeliefMdp, grid: &Grid) -> Vec<Vec<f64>> {
    if mdp.model().episode.alive.sides.is_empty() {
        return Vec::new();
    }
    let at_level =
        |level| crate::parallel::map(grid.len(), |point| mdp.failure(level, &grid.point(point)));
    (0..mdp.levels().len()).map(at_level).collect()
}

/// Levels that lead back to each other, in an order such that every group only leads to itself and those before it.
fn groups_of_levels(mdp: &BeliefMdp) -> Vec<Vec<LevelId>> {
    let levels = mdp.levels();
    if (0..mdp.model().actions.len())
        .any(|action| mdp.model().actions[action].then == Then::Restart)
        || mdp
            .model()
            .events
            .iter()
            .any(|event| event.then == Then::Restart)
    {
        return vec![(0..levels.len()).rev().collect()];
    }
    let classes = levels.classes().len();
    let reachable: Vec<Vec<bool>> = (0..levels.len())
        .map(|from| {
            let mut seen = vec![false; levels.len()];
            let mut open = vec![from];
            while let Some(level) = open.pop() {
                for class in 0..classes {
                    let next = levels.step(level, class).next;
                    if !std::mem::replace(&mut seen[next], true) {
                        open.push(next);
                    }
                }
            }
            seen
        })
        .collect();
    let mut groups: Vec<Vec<LevelId>> = Vec::new();
    let mut placed = vec![false; levels.len()];
    while let Some(level) = (0..levels.len()).rev().find(|&level| {
        !placed[level]
            && (0..levels.len()).all(|next| {
                !reachable[level][next] || placed[next] || reachable[next][level] || next == level
            })
    }) {
        let group: Vec<LevelId> = (0..levels.len())
            .filter(|&other| other == level || (reachable[level][other] && reachable[other][level]))
            .collect();
        for &member in &group {
            placed[member] = true;
        }
        groups.push(group);
    }
    groups
}

impl GridPolicy {
    fn new(mdp: BeliefMdp, grid: Grid) -> Self {
        let (modes, levels, classes) = (
            mdp.model().modes.len(),
            mdp.levels().len(),
            mdp.levels().classes().len(),
        );
        Self {
            values: vec![vec![0.0; grid.len()]; modes * levels],
            expected: vec![vec![0.0; grid.len()]; modes * levels * classes],
            failures: failures(&mdp, &grid),
            start_value: 0.0,
            converged: true,
            sweeps: 0,
            mdp,
            grid,
        }
    }

    /// The decision process it was planned for.
    pub fn mdp(&self) -> &BeliefMdp {
        &self.mdp
    }

    /// The grid of means.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Planned value of the start belief.
    pub fn start_value(&self) -> f64 {
        self.start_value
    }

    fn value_index(&self, mode: usize, level: LevelId) -> usize {
        mode * self.mdp.levels().len() + level
    }

    fn expected_index(&self, mode: usize, level: LevelId, class: usize) -> usize {
        self.value_index(mode, level) * self.mdp.levels().classes().len() + class
    }

    /// Value iteration on a group of levels until the change bounds the error by the tolerance.
    fn solve_group(&mut self, group: &[LevelId], settings: &Settings) {
        let discount = self.mdp.model().discount;
        let backups = self.backups(group);
        let smoothers: Vec<Vec<Average>> = group
            .iter()
            .map(|&level| {
                (0..self.mdp.levels().classes().len())
                    .map(|class| self.average(&self.mdp.spread(level, class)))
                    .collect()
            })
            .collect();
        let target = settings.tolerance * (1.0 - discount) / discount.max(1e-9);
        for _ in 0..settings.sweeps {
            self.sweeps += 1;
            let mut change = 0.0_f64;
            for (&level, smoothers) in group.iter().zip(&smoothers) {
                self.smooth(level, smoothers);
            }
            for backup in &backups {
                let index = self.value_index(backup.mode, backup.level);
                let fresh = self.back_up(backup);
                change = fresh
                    .iter()
                    .zip(&self.values[index])
                    .fold(change, |change, (new, old)| change.max((new - old).abs()));
                self.values[index] = fresh;
            }
            let start = self.mdp.start();
            self.start_value = self.grid.interpolate(
                &self.values[self.value_index(start.mode, start.level)],
                &start.mean,
            );
            let leads_outside_only = group.len() == 1 && self.leaves_itself(group[0]);
            if change <= target || leads_outside_only {
                for (&level, smoothers) in group.iter().zip(&smoothers) {
                    self.smooth(level, smoothers);
                }
                return;
            }
        }
        self.converged = false;
    }

    /// Whether no action comes back to the level, nor to the start.
    fn leaves_itself(&self, level: LevelId) -> bool {
        let restarts = self
            .mdp
            .model()
            .actions
            .iter()
            .any(|action| action.then == Then::Restart)
            || self
                .mdp
                .model()
                .events
                .iter()
                .any(|event| event.then == Then::Restart);
        !restarts
            && (0..self.mdp.levels().classes().len())
                .all(|class| self.mdp.levels().step(level, class).next != level)
    }

    fn average(&self, spread: &DMatrix<f64>) -> Average {
        if knows_map(&self.mdp) {
            Average::Walled(WalledSmoother::new(&self.mdp, &self.grid, spread))
        } else {
            Average::Free(self.grid.smoother(spread))
        }
    }

    fn smooth(&mut self, level: LevelId, smoothers: &[Average]) {
        for mode in 0..self.mdp.model().modes.len() {
            for (class, smoother) in smoothers.iter().enumerate() {
                let next = self.mdp.levels().step(level, class).next;
                let index = self.expected_index(mode, level, class);
                self.expected[index] = smoother.apply(&self.grid, &self.to_come(mode, next));
            }
        }
    }

    /// What a belief at a level is worth to a step that leads there: discounted, unless it failed on the way.
    fn to_come(&self, mode: usize, level: LevelId) -> Vec<f64> {
        let model = self.mdp.model();
        let values = self.values[self.value_index(mode, level)].iter();
        match self.failures.get(level) {
            None => values.map(|value| model.discount * value).collect(),
            Some(failures) => values
                .zip(failures)
                .map(|(value, failed)| {
                    failed * model.episode.failure_reward + (1.0 - failed) * model.discount * value
                })
                .collect(),
        }
    }

    /// Rewards and places to look up, which no sweep changes.
    fn backups(&self, group: &[LevelId]) -> Vec<Backup> {
        let actions = self.mdp.model().actions.len();
        let mut backups = Vec::new();
        for &level in group {
            for mode in 0..self.mdp.model().modes.len() {
                let entries = crate::parallel::map(self.grid.len(), |point| {
                    // Where no belief can be, the value is that of the belief kept instead.
                    let mean = self.mdp.confine(self.grid.point(point).into());
                    let mean = mean.as_slice();
                    (0..actions)
                        .map(|action| self.backup_entry(mode, level, mean, action))
                        .collect()
                });
                backups.push(Backup {
                    mode,
                    level,
                    entries,
                });
            }
        }
        backups
    }

    fn backup_entry(&self, mode: usize, level: LevelId, mean: &[f64], action: ActionId) -> Entry {
        let outcomes = self.mdp.outcomes(mode, level, mean, action);
        let restart = outcomes
            .iter()
            .filter(|outcome| outcome.then == Then::Restart)
            .map(|outcome| outcome.probability)
            .sum();
        let mut next: Vec<(usize, f64)> = Vec::new();
        for outcome in outcomes
            .iter()
            .filter(|outcome| outcome.then == Then::Continue)
        {
            next.push((
                self.expected_index(outcome.mode, level, self.mdp.levels().class_of(action)),
                outcome.probability,
            ));
        }
        let centres = if next.is_empty() {
            Vec::new()
        } else {
            self.mdp
                .centres(level, mean, action)
                .into_iter()
                .map(|(weight, centre)| (weight, centre.as_slice().to_vec()))
                .collect()
        };
        Entry {
            reward: self.mdp.reward(mode, level, mean, action),
            restart,
            next,
            centres,
        }
    }

    fn q(&self, entry: &Entry) -> f64 {
        let mut future = self.mdp.model().discount * entry.restart * self.start_value;
        for (expected, probability) in &entry.next {
            for (weight, centre) in &entry.centres {
                future +=
                    probability * weight * self.grid.interpolate(&self.expected[*expected], centre);
            }
        }
        entry.reward + future
    }

    fn back_up(&self, backup: &Backup) -> Vec<f64> {
        crate::parallel::map(backup.entries.len(), |point| {
            backup.entries[point]
                .iter()
                .map(|entry| self.q(entry))
                .fold(f64::NEG_INFINITY, f64::max)
        })
    }

    /// `Q(b, a)` by one step of look-ahead.
    pub fn q_value(&self, belief: &Belief, action: ActionId) -> f64 {
        self.q(&self.backup_entry(belief.mode, belief.level, &belief.mean, action))
    }
}

/// How the next mean spreads around its centre.
enum Average {
    /// Freely, but for the ends of the grid.
    Free(Smoother),
    /// Stopped by the walls of a map.
    Walled(WalledSmoother),
}

impl Average {
    fn apply(&self, grid: &Grid, values: &[f64]) -> Vec<f64> {
        match self {
            Self::Free(smoother) => smoother.apply(grid, values),
            Self::Walled(smoother) => smoother.apply(grid, values),
        }
    }
}

/// One action at one point: reward, probability of a restart, tables to look up with their probability, and where.
#[derive(Debug)]
struct Entry {
    reward: f64,
    restart: f64,
    next: Vec<(usize, f64)>,
    centres: Vec<(f64, Vec<f64>)>,
}

#[derive(Debug)]
struct Backup {
    mode: usize,
    level: LevelId,
    /// By grid point, then action.
    entries: Vec<Vec<Entry>>,
}

impl Policy for GridPolicy {
    fn action(&self, belief: &Belief) -> ActionId {
        let mut best = (0, f64::NEG_INFINITY);
        for action in 0..self.mdp.model().actions.len() {
            let q = self.q_value(belief, action);
            // Ties go to the first action: values that differ by rounding alone are the same.
            if q > best.1 + 1e-12 * best.1.abs().max(1.0) || best.1 == f64::NEG_INFINITY {
                best = (action, q);
            }
        }
        best.0
    }

    fn action_value(&self, belief: &Belief, action: ActionId) -> Option<f64> {
        Some(self.q_value(belief, action))
    }

    fn value(&self, belief: &Belief) -> Option<f64> {
        Some(
            (0..self.mdp.model().actions.len())
                .map(|action| self.q_value(belief, action))
                .fold(f64::NEG_INFINITY, f64::max),
        )
    }
}
