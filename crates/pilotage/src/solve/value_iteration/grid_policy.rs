//! The value of beliefs `(mode, stratum, mean)` on a grid of means.
//!
//! With an agent that is free to choose again after every observation,
//!
//! ```text
//! Q(b, a) = r(b, a) + discount * E V(b'),   m' = A m + B u + K nu,  nu ~ N(0, S)
//! V(b)    = max_a Q(b, a)
//! ```
//!
//! The expectation is taken first, once for each stratum and noise class: `W(x) = E V(x + K nu)` on the grid of means. Then
//! `Q` is one look-up of `W` at `A m + B u` for each action. Where the model has failure limits, the step may fail: with probability
//! `f(b, a)` it earns the reward of failing and nothing more. Where the reading may be missing, the mean is then where it was predicted:
//! `V` itself is looked up there, at the stratum that the filter is left with.
//!
//! Levels are solved in the order in which the filter leaves them, last first, so only those that come back to themselves need
//! iterating.

use nalgebra::DMatrix;
use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};

use super::extent::{axes, kinds, knows_map, mebibytes};
use crate::belief::{Belief, BeliefMdp, StratumId};
use crate::error::{Error, Result};
use crate::model::{ActionId, Outcome, Then};
use crate::policy::Policy;
use crate::progress::Progress;
use crate::solve::grid::{Axis, Grid, Interpolation, Settings, Smoother};
use crate::solve::rollout;
use crate::solve::walled::WalledSmoother;

/// The value on the grid, and the policy that looks one step ahead from any belief.
#[derive(Debug)]
pub struct GridPolicy {
    mdp: BeliefMdp,
    grid: Grid,
    /// `V`, by mode and stratum.
    pub(super) values: Vec<Vec<f64>>,
    /// `discount * W`, by mode, stratum and noise class: what is still to come after an action of the class, by where the next
    /// mean is centred. Where readings may be missing, as many follow for the steps after which one is.
    pub(super) expected: Vec<Vec<f64>>,
    /// Probability of being within the limits, by stratum; empty without limits.
    alive: Vec<Vec<f64>>,
    /// Value of the start belief.
    pub(super) start_value: f64,
    /// What it earns in an episode, where that is not the value of the start belief.
    pub(super) promised: Option<f64>,
    pub(super) remarks: Vec<String>,
    /// Whether the tolerance was reached within the allowed sweeps.
    pub converged: bool,
    /// Sweeps over all groups of strata.
    pub sweeps: usize,
}

/// Plans by value iteration, for the length of an episode where that matters.
///
/// # Errors
/// [`crate::Error::TooLarge`] and [`crate::Error::OutOfMemory`] where the grid does not fit the memory, [`crate::Error::Setting`] for settings out of range,
/// [`crate::Error::Unsupported`] where the grid does not see what is paid, [`crate::Error::NotFinite`] where numbers grow beyond all bounds.
pub fn solve(mdp: &BeliefMdp, settings: &Settings, observer: &dyn Progress) -> Result<GridPolicy> {
    settings.validate()?;
    let mut policy = super::horizon::plan(mdp, settings, observer)?;
    if let Some(remark) = policy.strays() {
        policy.remarks.push(remark);
    }
    Ok(policy)
}

/// Plans for episodes that are as long as the strata of the decision process say: for ever, unless they tell the time.
pub(super) fn iterate(
    mdp: &BeliefMdp,
    settings: &Settings,
    observer: &dyn Progress,
) -> Result<GridPolicy> {
    let grid = Grid::new(axes(mdp, settings)?, Interpolation::Cubic);
    observer.note(&format!(
        "{} levels on a grid of {} points: {} MiB",
        mdp.strata(),
        grid.len(),
        mebibytes(mdp, grid.len() as u64)
    ));
    let groups = groups_of_levels(mdp);
    let largest = groups.iter().map(Vec::len).max().unwrap_or(0);
    super::extent::sweep_fits(mdp, grid.len(), largest)?;
    let mut policy = GridPolicy::new(mdp.clone(), grid);
    policy.end_episodes();
    observer.progress("levels", 0, groups.len() as u64);
    for (done, group) in groups.iter().enumerate() {
        policy.solve_group(group, settings)?;
        observer.progress("levels", done as u64 + 1, groups.len() as u64);
    }
    Ok(policy)
}

/// Probability of being within the limits at every point, by stratum; empty without limits.
fn alive(mdp: &BeliefMdp, grid: &Grid) -> Vec<Vec<f64>> {
    if mdp.model().episode.alive.sides.is_empty() {
        return Vec::new();
    }
    let at_level =
        |stratum| crate::parallel::map(grid.len(), |point| mdp.alive(stratum, &grid.point(point)));
    (0..mdp.strata()).map(at_level).collect()
}

/// Levels that lead back to each other, in an order such that every group only leads to itself and those before it.
fn groups_of_levels(mdp: &BeliefMdp) -> Vec<Vec<StratumId>> {
    if mdp.model().restarts() {
        return vec![(0..mdp.strata()).rev().collect()];
    }
    let edges = (0..mdp.strata()).flat_map(|stratum| {
        let classes = 0..mdp.classes();
        let after = classes.flat_map(move |class| {
            let blind = (mdp.present(stratum) < 1.0).then(|| mdp.next_blind(stratum, class));
            std::iter::once(mdp.next(stratum, class)).chain(blind)
        });
        after.map(move |next| (stratum as u32, next as u32))
    });
    let graph = DiGraph::<(), ()>::from_edges(edges);
    let group = |nodes: Vec<NodeIndex>| {
        let mut group: Vec<StratumId> = nodes.into_iter().map(NodeIndex::index).collect();
        group.sort_unstable();
        group
    };
    // Not Tarjan's: that one recurses, and strata that lead to each other in a long line would overflow the stack.
    let groups = kosaraju_scc(&graph).into_iter().map(group);
    groups
        .filter(|group| !group.iter().any(|stratum| mdp.is_over(*stratum)))
        .collect()
}

impl GridPolicy {
    fn new(mdp: BeliefMdp, grid: Grid) -> Self {
        let (modes, strata, classes) = (mdp.model().modes.len(), mdp.strata(), mdp.classes());
        Self {
            values: vec![vec![0.0; grid.len()]; modes * strata],
            expected: vec![vec![0.0; grid.len()]; modes * strata * classes * kinds(&mdp)],
            alive: alive(&mdp, &grid),
            start_value: 0.0,
            promised: None,
            remarks: Vec::new(),
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
    pub(crate) fn grid(&self) -> &Grid {
        &self.grid
    }

    /// What the plan expects to earn from the start, over the length of an episode.
    pub fn planned_value(&self) -> f64 {
        let start = || self.value(self.mdp.start()).unwrap_or(self.start_value);
        self.promised.unwrap_or_else(start)
    }

    /// Value of the start belief.
    pub fn start_value(&self) -> f64 {
        self.start_value
    }

    /// What is to be known of the plan: where it is not what it seems, and why.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Says so if the plan meets beliefs beyond its grid, where it knows nothing.
    fn strays(&self) -> Option<String> {
        const EPISODES: usize = 50;
        const SHARE: f64 = 0.01;
        let (filter, length) = (self.mdp.filter(), self.mdp.model().episode.length.min(1000));
        let met = rollout::decisions(&self.mdp, &filter.into(), self, EPISODES, length, 1).concat();
        let axes = self.grid.axes();
        let beyond = |axis: &Axis, x: f64| x < axis.low || x > axis.at(axis.count - 1);
        let beyond = |i: usize| {
            let outside = met
                .iter()
                .filter(|decision| beyond(&axes[i], decision.at.mean[i]));
            (outside.count() as f64 / met.len() as f64, i)
        };
        let (share, i) = (0..axes.len())
            .map(beyond)
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        (share > SHARE).then(|| {
            format!(
                "grid edge: {:.0} % of the beliefs that the plan meets lie beyond its grid, {} from {} to {}, where it knows nothing; widen `state.bounds`",
                100.0 * share,
                self.mdp.model().state[i].name,
                axes[i].low,
                axes[i].at(axes[i].count - 1)
            )
        })
    }

    /// Value of the strata at which an episode is over.
    fn end_episodes(&mut self) {
        for stratum in (0..self.mdp.strata()).filter(|stratum| self.mdp.is_over(*stratum)) {
            let worth = self.ending(stratum);
            for mode in 0..self.mdp.model().modes.len() {
                let index = self.value_index(mode, stratum);
                self.values[index].clone_from(&worth);
            }
        }
    }

    /// What ending an episode is worth at every point of a stratum.
    pub(super) fn ending(&self, stratum: StratumId) -> Vec<f64> {
        crate::parallel::map(self.grid.len(), |point| {
            self.mdp.terminal_cost(stratum, &self.grid.point(point))
        })
    }

    pub(super) fn value_index(&self, mode: usize, stratum: StratumId) -> usize {
        mode * self.mdp.strata() + stratum
    }

    /// Place of the expectation after a step of a class, sensed or blind.
    fn expected_index(&self, mode: usize, stratum: StratumId, class: usize, blind: bool) -> usize {
        let row = self.value_index(mode, stratum) * kinds(&self.mdp) + usize::from(blind);
        row * self.mdp.classes() + class
    }

    /// Value iteration on a group of strata until the change bounds the error by the tolerance.
    fn solve_group(&mut self, group: &[StratumId], settings: &Settings) -> Result<()> {
        let discount = self.mdp.model().discount;
        let backups = self.backups(group);
        let smoothers = self.smoothers(group);
        let target = settings.tolerance * (1.0 - discount) / discount.max(1e-9);
        for _ in 0..settings.sweeps {
            self.sweeps += 1;
            let mut change = 0.0_f64;
            for (&stratum, smoothers) in group.iter().zip(&smoothers) {
                self.smooth(stratum, smoothers);
            }
            for backup in &backups {
                let index = self.value_index(backup.mode, backup.stratum);
                let fresh = self.back_up(backup);
                change = self.change(backup, &fresh, change)?;
                self.values[index] = fresh;
            }
            self.start_value = self.value_at_start();
            let leads_outside_only = group.len() == 1 && self.leaves_itself(group[0]);
            if change <= target || leads_outside_only {
                for (&stratum, smoothers) in group.iter().zip(&smoothers) {
                    self.smooth(stratum, smoothers);
                }
                return Ok(());
            }
        }
        self.converged = false;
        Ok(())
    }

    /// By stratum of a group and noise class: how the next mean spreads.
    pub(super) fn smoothers(&self, group: &[StratumId]) -> Vec<Vec<Average>> {
        let classes = 0..self.mdp.classes();
        let of = |&stratum: &StratumId| {
            let class = |class| self.average(&self.mdp.mean_covariance(stratum, class));
            classes.clone().map(class).collect()
        };
        group.iter().map(of).collect()
    }

    /// The larger of a change and that of the values of a backup, all of them finite.
    fn change(&self, backup: &Backup, fresh: &[f64], change: f64) -> Result<f64> {
        let old = &self.values[self.value_index(backup.mode, backup.stratum)];
        if let Some(point) = fresh.iter().position(|value| !value.is_finite()) {
            return Err(Error::NotFinite {
                what: "the value of a belief".to_owned(),
                value: fresh[point],
                place: format!(
                    "mean {:?} at uncertainty level {}",
                    self.grid.point(point),
                    backup.stratum
                ),
                remedy: "its rewards, or what multiplies the state, are too large to add up; state them in other units",
            });
        }
        let changes = fresh.iter().zip(old).map(|(new, old)| (new - old).abs());
        Ok(changes.fold(change, f64::max))
    }

    pub(super) fn value_at_start(&self) -> f64 {
        let start = self.mdp.start();
        let values = &self.values[self.value_index(start.mode, start.stratum)];
        self.grid.interpolate(values, &start.mean)
    }

    /// Whether no action comes back to the stratum, nor to the start.
    fn leaves_itself(&self, stratum: StratumId) -> bool {
        !self.mdp.model().restarts()
            && (0..self.mdp.classes()).all(|class| {
                self.mdp.next(stratum, class) != stratum
                    && (self.mdp.present(stratum) == 1.0
                        || self.mdp.next_blind(stratum, class) != stratum)
            })
    }

    fn average(&self, spread: &DMatrix<f64>) -> Average {
        if knows_map(&self.mdp) {
            Average::Walled(WalledSmoother::new(&self.mdp, &self.grid, spread))
        } else {
            Average::Free(self.grid.smoother(spread))
        }
    }

    pub(super) fn smooth(&mut self, stratum: StratumId, smoothers: &[Average]) {
        for mode in 0..self.mdp.model().modes.len() {
            for (class, smoother) in smoothers.iter().enumerate() {
                let next = self.mdp.next(stratum, class);
                let index = self.expected_index(mode, stratum, class, false);
                self.expected[index] = smoother.apply(&self.grid, &self.to_come(mode, next));
                if self.mdp.present(stratum) < 1.0 {
                    let next = self.mdp.next_blind(stratum, class);
                    let index = self.expected_index(mode, stratum, class, true);
                    self.expected[index] = self.to_come(mode, next);
                }
            }
        }
    }

    /// What a belief at a stratum is worth to a step that leads there: discounted, as far as the agent is alive to have it.
    fn to_come(&self, mode: usize, stratum: StratumId) -> Vec<f64> {
        let discount = self.mdp.model().discount;
        let values = self.values[self.value_index(mode, stratum)].iter();
        match self.alive.get(stratum) {
            None => values.map(|value| discount * value).collect(),
            Some(alive) => values
                .zip(alive)
                .map(|(value, alive)| alive * discount * value)
                .collect(),
        }
    }

    /// Rewards and places to look up, which no sweep changes.
    pub(super) fn backups(&self, group: &[StratumId]) -> Vec<Backup> {
        let actions = self.mdp.model().actions.len();
        let mut backups = Vec::new();
        for &stratum in group {
            for mode in 0..self.mdp.model().modes.len() {
                let entries = crate::parallel::map(self.grid.len(), |point| {
                    // Where no belief can be, the value is that of the belief kept instead.
                    let mean = self.mdp.confine(self.grid.point(point).into());
                    let mean = mean.as_slice();
                    (0..actions)
                        .map(|action| self.backup_entry(mode, stratum, mean, action))
                        .collect()
                });
                backups.push(Backup {
                    mode,
                    stratum,
                    entries,
                });
            }
        }
        backups
    }

    fn backup_entry(
        &self,
        mode: usize,
        stratum: StratumId,
        mean: &[f64],
        action: ActionId,
    ) -> Entry {
        let (mut reward, outcomes) = self.mdp.step(mode, stratum, mean, action);
        let model = self.mdp.model();
        let share = |then: Then| -> f64 {
            let such = outcomes.iter().filter(|outcome| outcome.then == then);
            such.map(|outcome| outcome.probability).sum()
        };
        if model.cost.is_some() {
            reward += share(Then::End) * model.discount * self.mdp.terminal_cost(stratum, mean);
        }
        let survival = self.mdp.survival(stratum, mean, action);
        let fails = 1.0 - survival.probability;
        if fails > 0.0 {
            reward += share(Then::Continue) * fails * model.episode.failure_reward;
        }
        let class = self.mdp.class_of(action);
        let next = |blind: bool, chance: f64| -> Vec<(usize, f64)> {
            let goes_on = outcomes
                .iter()
                .filter(|outcome| outcome.then == Then::Continue && survival.odds > 0.0);
            let look_up = |outcome: &Outcome| {
                let index = self.expected_index(outcome.mode, stratum, class, blind);
                (index, chance * survival.odds * outcome.probability)
            };
            goes_on.map(look_up).collect()
        };
        let present = self.mdp.present(stratum);
        let blind = (present < 1.0).then(|| {
            Box::new(Blind {
                next: next(true, 1.0 - present),
                mean: self
                    .mdp
                    .predicted(stratum, mean, action)
                    .as_slice()
                    .to_vec(),
            })
        });
        let next = next(false, present);
        let centres = if next.is_empty() {
            Vec::new()
        } else {
            self.mdp
                .centres(stratum, mean, action)
                .into_iter()
                .map(|(weight, centre)| (weight, centre.as_slice().to_vec()))
                .collect()
        };
        Entry {
            reward,
            restart: share(Then::Restart),
            next,
            centres,
            blind,
        }
    }

    pub(super) fn q(&self, entry: &Entry) -> f64 {
        let mut future = self.mdp.model().discount * entry.restart * self.start_value;
        for (expected, probability) in &entry.next {
            for (weight, centre) in &entry.centres {
                future +=
                    probability * weight * self.grid.interpolate(&self.expected[*expected], centre);
            }
        }
        if let Some(Blind { next, mean }) = entry.blind.as_deref() {
            for (expected, probability) in next {
                future += probability * self.grid.interpolate(&self.expected[*expected], mean);
            }
        }
        entry.reward + future
    }

    pub(super) fn back_up(&self, backup: &Backup) -> Vec<f64> {
        crate::parallel::map(backup.entries.len(), |point| {
            backup.entries[point]
                .iter()
                .map(|entry| self.q(entry))
                .fold(f64::NEG_INFINITY, f64::max)
        })
    }

    /// `Q(b, a)` by one step of look-ahead.
    pub fn q_value(&self, belief: &Belief, action: ActionId) -> f64 {
        self.q(&self.backup_entry(belief.mode, belief.stratum, &belief.mean, action))
    }
}

/// How the next mean spreads around its centre.
pub(super) enum Average {
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
pub(super) struct Entry {
    reward: f64,
    restart: f64,
    next: Vec<(usize, f64)>,
    centres: Vec<(f64, Vec<f64>)>,
    blind: Option<Box<Blind>>,
}

/// What is looked up, and where, if the reading is missing.
#[derive(Debug)]
struct Blind {
    next: Vec<(usize, f64)>,
    mean: Vec<f64>,
}

#[derive(Debug)]
pub(super) struct Backup {
    pub mode: usize,
    pub stratum: StratumId,
    /// By grid point, then action.
    pub entries: Vec<Vec<Entry>>,
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
