//! What a plan promises, and what it earns: where its model holds, and in the world.

use serde::Serialize;

use super::{Solution, Solved};
use crate::belief::{BeliefMdp, Codebook, Updater};
use crate::error::Result;
use crate::model::{HypothesisBelief, Model, WallBelief};
use crate::progress::Progress;
use crate::scenario::{Scenario, Walls};
use crate::simulate::{Agent, Difference, Evaluation, HandAgent, Options, Told, evaluate_both};

/// What a solution earns, beside its promise ([`Solution::planned_value`]). All are returns over an episode.
#[derive(Debug, Clone, PartialEq)]
pub struct Earned {
    /// In the world that the model assumes ([`Scenario::assumed`]).
    pub assumed: Evaluation,
    /// In the scenario's world; the same where that is the one assumed.
    pub world: Evaluation,
    /// What the scenario's rule of thumb earns in its world on the same beliefs, where it has one.
    pub rule: Option<ByRule>,
    /// What is to be known of the difference, and of the plan.
    pub remarks: Vec<String>,
}

/// What a rule of thumb earns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ByRule {
    /// What it earns itself.
    #[serde(flatten)]
    pub earned: Evaluation,
    /// By how much that is less than what the solution earns, over the same episodes.
    pub less: Difference,
}

impl Earned {
    /// Whether there was a belief to act on all the time.
    ///
    /// # Errors
    /// As [`Evaluation::check`].
    pub fn check(&self) -> Result<()> {
        self.assumed.check()?;
        self.world.check()
    }
}

/// A promise that misses what is earned by more than three standard errors and this share of it is remarked upon.
const SHARE: f64 = 0.01;

impl Solution {
    /// Runs the solution where its model holds, and in the scenario's world.
    ///
    /// # Errors
    /// As [`Solution::evaluate`].
    pub fn earned(
        &self,
        scenario: &Scenario,
        options: Options,
        observer: &dyn Progress,
    ) -> Result<Earned> {
        let (world, rule) = match self.beside_rule(scenario, options, observer)? {
            Some((world, rule)) => (world, Some(rule)),
            None => (self.evaluate(scenario, options, observer)?, None),
        };
        let assumed = match scenario.is_as_assumed() {
            true => world,
            false => self.evaluate(&Scenario::assumed(&scenario.model), options, observer)?,
        };
        let mut remarks = self.remarks.clone();
        if !self.converged && self.planned_value.is_some() {
            remarks.push("not converged: the policy still changes with more work".to_owned());
        }
        let missed = self
            .planned_value
            .and_then(|planned| missed(planned, &assumed, &scenario.model));
        if let Some(missed) = missed {
            let reasons = match self.strata() {
                Some(strata) => vec![in_full(
                    strata,
                    self.planned_value < Some(assumed.discounted.mean),
                )],
                None if self.graph().is_some() => {
                    vec!["what is planned is so on cells, and these are coarse; more `cells` in [belief] come nearer".to_owned()]
                }
                None => reasons(&scenario.model),
            };
            remarks.push(match reasons.is_empty() {
                true => missed,
                false => format!("{missed}: {}", reasons.join("; ")),
            });
        }
        if scenario.truth.walls == Walls::Clamp && scenario.model.belief.walls == WallBelief::Ignore
        {
            remarks.push("the world has walls, and the belief does not know of them: the plan expects another return than is earned; write `walls = \"clip\"` in [belief]".to_owned());
        }
        if let Some(ByRule { earned, less }) = &rule
            && less.mean < -3.0 * less.stderr
        {
            remarks.push(format!(
                "the rule of thumb in the model file earns more, {:.4} ± {:.4}",
                earned.discounted.mean, earned.discounted.stderr
            ));
        }
        Ok(Earned {
            assumed,
            world,
            rule,
            remarks,
        })
    }
}

impl Solution {
    /// What this earns in the scenario's world, and what its rule of thumb does in the same episodes. The rule acts on beliefs that are kept as
    /// those of this solution, but about all that the model says, or, where it keeps none, as the model asks.
    fn beside_rule(
        &self,
        scenario: &Scenario,
        options: Options,
        observer: &dyn Progress,
    ) -> Result<Option<(Evaluation, ByRule)>> {
        let Some(rule) = scenario.rule.as_ref() else {
            return Ok(None);
        };
        let updater = match (&self.policy, self.updater()) {
            (Solved::Graph(_), _) => Updater::of(&scenario.model)?,
            (_, Some(updater)) => updater.whole(&scenario.model)?,
            (_, None) => return Ok(None),
        };
        let space = updater.space(&scenario.model);
        let told = Told::of(space.as_ref());
        let keeper = space.updater();
        let hand = || -> Box<dyn Agent + '_> { Box::new(HandAgent::new(&keeper, rule, &told)) };
        let both = self.acting(|own| evaluate_both(scenario, (own, &hand), options, observer));
        Ok(both
            .ok()
            .map(|([own, earned], less)| (own, ByRule { earned, less })))
    }

    /// How many strata beliefs are read as, where they are kept in full.
    fn strata(&self) -> Option<usize> {
        self.updater()?.codebook().map(Codebook::len)
    }

    /// What keeps the belief, where it keeps one.
    fn updater(&self) -> Option<&Updater> {
        match &self.policy {
            Solved::Automaton(automaton) => Some(&automaton.updater),
            Solved::Rule { updater, .. } => Some(updater),
            Solved::Graph(_) | Solved::Control(_) => None,
        }
    }
}

/// Says by how much a promise misses what is earned where it should hold, if it does.
fn missed(planned: f64, assumed: &Evaluation, model: &Model) -> Option<String> {
    let earned = &assumed.discounted;
    // What pays once in more episodes than were run may not have been seen.
    let (low, high) = model.reward_range();
    let unseen = (high - low) / assumed.episodes as f64;
    let apart = (planned - earned.mean).abs();
    let allowed = unseen + 3.0 * earned.stderr + SHARE * planned.abs().max(earned.mean.abs());
    // Not a number is neither more nor less.
    let holds = apart <= allowed;
    (!holds).then(|| {
        format!(
            "planned {planned:.4}, and where the model holds {:.4} ± {:.4} is earned",
            earned.mean, earned.stderr
        )
    })
}

/// Why a plan for beliefs in full, which are read as so many strata, earns something else than it says.
fn in_full(strata: usize, earned_more: bool) -> String {
    match earned_more {
        true => "a plan is made for some beliefs, and says too little of those between them; with more `beliefs`, `points` or `rounds` it comes nearer".to_owned(),
        false => format!(
            "the plan is finer than what an automaton asks of a belief, or coarser than beliefs are, of which it tells {strata} strata apart; more `--nodes`, `strata`, `points` or `rounds` come nearer"
        ),
    }
}

/// What in a model makes a belief say something else than is so.
fn reasons(model: &Model) -> Vec<String> {
    let mut reasons = Vec::new();
    if model.modes.len() > 1 {
        reasons.push("one hidden mode is believed at a time, and planned for as if it were known");
    }
    if model.belief.walls == WallBelief::Clip {
        reasons.push("the belief at a wall is a clipped Gaussian, and the state there is not");
    }
    if model.belief.hypotheses == HypothesisBelief::Track && model.start.len() > 1 {
        reasons.push("the plan is for one who is told which of its starts is true");
    }
    if model.belief.hypotheses == HypothesisBelief::Gaussian && model.start.len() > 1 {
        reasons.push("several starts are taken for one Gaussian");
    }
    if !model.episode.alive.sides.is_empty() {
        reasons.push("the belief does not learn from not having failed");
    }
    let mut reasons: Vec<String> = reasons.into_iter().map(str::to_owned).collect();
    let levels = BeliefMdp::new(model);
    if !levels.levels().converged() {
        reasons.push(format!(
            "uncertainty levels were cut at {} (`belief.level_limit`), while uncertainty still changed",
            model.belief.level_limit
        ));
    }
    reasons
}
