//! From a policy that can be asked anywhere (a value on a grid, a controller) to a small automaton that does the same.
//!
//! The policy is run in the model to see which beliefs it meets. Levels at which it does the same thing share nodes. In one
//! dimension the borders between actions are found by bisection and nodes are placed so that they reproduce them exactly; in more
//! dimensions nodes are chosen among the beliefs met.

mod annotate;
mod intervals;
pub(crate) mod planes;
mod samples;
mod trees;

pub use annotate::annotate;

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::belief::{Belief, BeliefSpace, StratumId};
use crate::error::{Error, Result};
use crate::model::{ActionId, ModeId};
use crate::policy::{Automaton, Matching, Policy};
use crate::solve::Size;
use crate::solve::rollout::{self, Decision, check_runs};

/// Settings of the compiler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Form of the automaton.
    pub matching: Matching,
    /// Episodes run to see which beliefs are met, 1 to a million.
    pub episodes: usize,
    /// Share of the decisions of a level, in `[0, 1)`, that may come out differently.
    pub slack: f64,
    /// Most nodes of a tree; `None` for as many as it takes.
    pub nodes: Option<usize>,
    /// Return that a tree may lose, as a share of that of the policy, at least 0; `None` for 1 %.
    pub loss: Option<f64>,
    /// Seed of the episodes.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            matching: Matching::Nearest,
            episodes: 2000,
            slack: 0.002,
            nodes: None,
            loss: None,
            seed: 1,
        }
    }
}

/// Most nodes of a tree, unless it is said.
const MOST_NODES: usize = 1000;

/// Decisions a policy took at neighbouring levels in one mode, to be served by the same nodes.
struct Band {
    mode: ModeId,
    levels: (StratumId, StratumId),
    decisions: Vec<(Vec<f64>, ActionId)>,
    /// Means at which a belief may be besides, although the policy itself does not lead there.
    beside: Vec<Vec<f64>>,
}

/// Beliefs of one mode and level.
#[derive(Default)]
struct Met {
    /// Where the policy decided, and what.
    decisions: Vec<(Vec<f64>, ActionId)>,
    /// Means that were met when it was disturbed.
    beside: Vec<Vec<f64>>,
}

/// A policy whose hand slips now and then: at a tenth of all beliefs it does anything. Which beliefs these are is a matter of their
/// numbers, so that nothing depends on the order of asking.
struct Disturbed<'a> {
    policy: &'a dyn Policy,
    actions: usize,
    seed: u64,
}

impl Policy for Disturbed<'_> {
    fn action(&self, belief: &Belief) -> ActionId {
        const SHARE: u64 = 10;
        let bits = belief.mean.iter().map(|mean| mean.to_bits());
        let numbers = bits.chain([belief.stratum as u64, belief.mode as u64]);
        let mixed = numbers.fold(self.seed, |hash, number| {
            let mixed = (hash ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            mixed ^ (mixed >> 29)
        });
        match mixed % SHARE {
            0 => (mixed / SHARE) as usize % self.actions,
            _ => self.policy.action(belief),
        }
    }
}

/// Compiles a policy into an automaton named after `solver`.
///
/// # Errors
/// [`Error::Setting`] for settings out of range.
pub fn compile(
    policy: &dyn Policy,
    space: &dyn BeliefSpace,
    solver: &str,
    settings: &Settings,
) -> Result<Automaton> {
    check_runs("runs", settings.episodes)?;
    if !(0.0..1.0).contains(&settings.slack) {
        return Err(Error::Setting {
            setting: "slack",
            value: settings.slack.to_string(),
            range: "at least 0 and below 1",
        });
    }
    let size = Size {
        nodes: settings.nodes,
        loss: settings.loss,
    };
    size.check(settings.matching == Matching::Tree)?;
    let model = space.model();
    if settings.matching == Matching::Tree {
        let mut automaton = Automaton::new(space, solver, Matching::Tree);
        automaton.planned_value = policy.value(space.start());
        let size = trees::Size {
            nodes: size.nodes.unwrap_or(MOST_NODES),
            loss: size.loss(),
        };
        let runs = (settings.episodes, settings.seed);
        trees::grow(&mut automaton, policy, space, size, runs);
        annotate(&mut automaton, space, settings.episodes, settings.seed);
        return Ok(automaton);
    }
    let met = meet(space, policy, settings);
    let mut automaton = Automaton::new(space, solver, settings.matching);
    automaton.planned_value = policy.value(space.start());
    for band in bands(space, policy, met, settings.slack) {
        if model.state_dim() == 1 {
            intervals::place(&mut automaton, policy, &band);
        } else {
            samples::place(&mut automaton, policy, &band, settings.slack);
        }
    }
    annotate(&mut automaton, space, settings.episodes, settings.seed);
    Ok(automaton)
}

/// The beliefs that a policy meets in the world its model assumes, and those that it meets when it is disturbed, by mode and level.
///
/// Without the latter a policy would have nothing to say once anything is a little otherwise than assumed.
fn meet(
    space: &dyn BeliefSpace,
    policy: &dyn Policy,
    settings: &Settings,
) -> BTreeMap<(ModeId, Reverse<StratumId>), Met> {
    let disturbed = Disturbed {
        policy,
        actions: space.model().actions.len(),
        seed: settings.seed,
    };
    let run = |policy: &dyn Policy, episodes| {
        let length = space.model().episode.length;
        let updater = space.updater();
        rollout::decisions(space, &updater, policy, episodes, length, settings.seed).concat()
    };
    let mut met: BTreeMap<_, Met> = BTreeMap::new();
    let place = |belief: &Belief| (belief.mode, Reverse(belief.stratum));
    for Decision {
        at: belief, action, ..
    } in run(policy, settings.episodes)
    {
        let met = met.entry(place(&belief)).or_default();
        met.decisions.push((belief.mean, action));
    }
    for Decision { at: belief, .. } in run(&disturbed, settings.episodes.div_ceil(4)) {
        met.entry(place(&belief))
            .or_default()
            .beside
            .push(belief.mean);
    }
    for (&(mode, Reverse(level)), met) in &mut met {
        if !met.decisions.is_empty() {
            continue;
        }
        let decided = met.beside.iter().map(|mean| {
            let mean = mean.clone();
            let belief = Belief {
                stratum: level,
                mode,
                mean,
            };
            let action = policy.action(&belief);
            (belief.mean, action)
        });
        met.decisions = decided.collect();
    }
    met
}

/// Joins neighbouring levels, from the most certain upwards, as long as the policy at the band's first level, asked at the
/// beliefs of the next, gives the same actions but for the slack.
fn bands(
    space: &dyn BeliefSpace,
    policy: &dyn Policy,
    met: BTreeMap<(ModeId, Reverse<StratumId>), Met>,
    slack: f64,
) -> Vec<Band> {
    let mut bands: Vec<Band> = Vec::new();
    for ((mode, Reverse(level)), Met { decisions, beside }) in met {
        if space.is_over(level) {
            continue;
        }
        let joins = bands.last().is_some_and(|band| {
            let differs = |(mean, action): &&(Vec<f64>, ActionId)| {
                policy.action(&Belief {
                    stratum: band.levels.1,
                    mode,
                    mean: mean.clone(),
                }) != *action
            };
            band.mode == mode
                && band.levels.0 == level + 1
                && decisions.iter().filter(differs).count() as f64 <= slack * decisions.len() as f64
        });
        match bands.last_mut() {
            Some(band) if joins => {
                band.levels.0 = level;
                band.decisions.extend(decisions);
                band.beside.extend(beside);
            }
            _ => bands.push(Band {
                mode,
                levels: (level, level),
                decisions,
                beside,
            }),
        }
    }
    bands
}
