//! From a policy that can be asked anywhere (a value on a grid, a controller) to a small automaton that does the same.
//!
//! The policy is run in the model to see which beliefs it meets. Levels at which it does the same thing share nodes. In one
//! dimension the borders between actions are found by bisection and nodes are placed so that they reproduce them exactly; in more
//! dimensions nodes are chosen among the beliefs met.

mod annotate;
mod intervals;
pub mod planes;
mod samples;

pub use annotate::annotate;

use crate::belief::{Belief, BeliefMdp, LevelId};
use crate::error::{Error, Result};
use crate::model::{ActionId, ModeId};
use crate::policy::{Automaton, Matching, Policy};
use crate::solve::rollout::{self, Decision};

/// Settings of the compiler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Form of the automaton.
    pub matching: Matching,
    /// Episodes run to see which beliefs are met, at least 1.
    pub episodes: usize,
    /// Share of the decisions of a level, in `[0, 1)`, that may come out differently.
    pub slack: f64,
    /// Seed of the episodes.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            matching: Matching::Nearest,
            episodes: 2000,
            slack: 0.002,
            seed: 1,
        }
    }
}

/// Decisions a policy took at neighbouring levels in one mode, to be served by the same nodes.
struct Band {
    mode: ModeId,
    levels: (LevelId, LevelId),
    decisions: Vec<(Vec<f64>, ActionId)>,
}

/// Compiles a policy into an automaton named after `solver`.
///
/// # Errors
/// [`Error::Setting`] for settings out of range.
pub fn compile(
    policy: &dyn Policy,
    mdp: &BeliefMdp,
    solver: &str,
    settings: &Settings,
) -> Result<Automaton> {
    if settings.episodes == 0 {
        return Err(Error::Setting {
            setting: "episodes",
            value: "0".to_owned(),
            range: "at least 1",
        });
    }
    if !(0.0..1.0).contains(&settings.slack) {
        return Err(Error::Setting {
            setting: "slack",
            value: settings.slack.to_string(),
            range: "at least 0 and below 1",
        });
    }
    let model = mdp.model();
    let met = rollout::decisions(
        mdp,
        &mdp.filter(),
        policy,
        settings.episodes,
        model.episode.length,
        settings.seed,
    );
    let mut automaton = Automaton::new(mdp, solver, settings.matching);
    automaton.planned_value = policy.value(mdp.start());
    for band in bands(mdp, policy, &met.concat(), settings.slack) {
        if model.state_dim() == 1 {
            intervals::place(&mut automaton, policy, &band);
        } else {
            samples::place(&mut automaton, policy, &band, settings.slack);
        }
    }
    annotate(&mut automaton, mdp, settings.episodes, settings.seed);
    Ok(automaton)
}

/// Joins neighbouring levels, from the most certain upwards, as long as the policy at the band's first level, asked at the
/// beliefs of the next, gives the same actions but for the slack.
fn bands(mdp: &BeliefMdp, policy: &dyn Policy, met: &[Decision], slack: f64) -> Vec<Band> {
    let mut bands: Vec<Band> = Vec::new();
    for mode in 0..mdp.model().modes.len() {
        for level in (0..mdp.levels().len()).rev() {
            let here = met
                .iter()
                .filter(|decision| decision.belief.mode == mode && decision.belief.level == level);
            let decisions: Vec<(Vec<f64>, ActionId)> = here
                .map(|decision| (decision.belief.mean.clone(), decision.action))
                .collect();
            if decisions.is_empty() {
                continue;
            }
            let joins = bands.last().is_some_and(|band| {
                let differs = |(mean, action): &(Vec<f64>, ActionId)| {
                    policy.action(&Belief {
                        level: band.levels.1,
                        mode,
                        mean: mean.clone(),
                    }) != *action
                };
                let apart = decisions
                    .iter()
                    .filter(|decision| differs(decision))
                    .count() as f64;
                band.mode == mode
                    && band.levels.0 == level + 1
                    && apart <= slack * decisions.len() as f64
            });
            match bands.last_mut() {
                Some(band) if joins => {
                    band.levels.0 = level;
                    band.decisions.extend(decisions);
                }
                _ => bands.push(Band {
                    mode,
                    levels: (level, level),
                    decisions,
                }),
            }
        }
    }
    bands
}
