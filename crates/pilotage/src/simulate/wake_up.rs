//! Waking up lost (thesis 5.6): the robot is carried to one of several places, is told so, and has to find out which while it
//! makes for the goal (Figure 5.15 with its loop condition corrected).
//!
//! The thesis plans one policy for each start. Here one policy serves all: on beliefs `(level, mean)` what is best does not depend on where
//! an episode began, and the starts share one graph of levels.

use serde::{Deserialize, Serialize};

use super::estimate::Moments;
use super::evaluate::{Runner, run_all};
use super::{Agent, Estimate, TrackingAgent, run_episode};
use crate::belief::{
    Belief, BeliefMdp, Filter, HypothesisSettings, HypothesisTracker, LARGEST, Reading, Tracker,
};
use crate::error::{Error, Result};
use crate::model::{ActionId, Region};
use crate::policy::Policy;
use crate::progress::Progress;
use crate::scenario::{Scenario, Truth};
use crate::world::{Observation, ProblemWorld, Streams};

/// Which action a lost agent takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// That of one hypothesis taken as valid: first the one farthest from the goal, and when it is pruned the heaviest
    /// (thesis 5.6). Farthest is where the policy expects least.
    Valid,
    /// The one with the largest value averaged over all hypotheses; where the policy knows no values of actions, the one that
    /// most weight votes for. In the mazes of thesis 5.6 it earns no more than `Valid`: an average counts on being told the
    /// truth after the next step, and so does nothing to find it out.
    Weighted,
}

/// How to wake up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How hypotheses are pruned and merged.
    pub tracking: HypothesisSettings,
    /// Which action is taken.
    pub choice: Choice,
    /// Kidnappings to run, at least 1.
    pub episodes: usize,
    /// Seed of every random number.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            tracking: HypothesisSettings::default(),
            choice: Choice::Valid,
            episodes: 10_000,
            seed: 1,
        }
    }
}

/// An agent that follows several hypotheses and a policy for a single one.
#[derive(Clone)]
pub struct WakeUpAgent<'a> {
    tracker: HypothesisTracker<'a>,
    policy: &'a dyn Policy,
    choice: Choice,
    actions: usize,
    /// Start hypothesis that is farthest from the goal.
    farthest: usize,
    /// Origin of the hypothesis taken as valid.
    valid: usize,
    steps: usize,
    alone: Option<usize>,
}

impl<'a> WakeUpAgent<'a> {
    /// The agent as it wakes up.
    ///
    /// # Errors
    /// As [`HypothesisTracker::new`].
    pub fn new(
        mdp: &BeliefMdp,
        policy: &'a dyn Policy,
        tracking: HypothesisSettings,
        choice: Choice,
    ) -> Result<Self> {
        let alike = |a: &Belief, b: &Belief| policy.action(a) == policy.action(b);
        let tracker = HypothesisTracker::new(mdp, tracking, alike)?;
        let farthest = farthest(mdp, policy);
        Ok(Self {
            tracker,
            policy,
            choice,
            actions: mdp.model().actions.len(),
            farthest,
            valid: farthest,
            steps: 0,
            alone: None,
        })
    }

    /// The hypotheses it follows.
    pub fn tracker(&self) -> &HypothesisTracker<'a> {
        &self.tracker
    }

    /// Steps after which one hypothesis was left, if it has come to that.
    pub fn alone(&self) -> Option<usize> {
        self.alone
    }

    fn valid(&self) -> &Belief {
        let live = self.tracker.hypotheses();
        let valid = live
            .iter()
            .find(|hypothesis| hypothesis.origin == self.valid);
        &valid.unwrap_or_else(|| self.tracker.heaviest()).belief
    }

    /// Average over the hypotheses of an action's value, or else the weight of those for which the policy takes it.
    fn worth(&self, action: ActionId) -> f64 {
        let live = self.tracker.hypotheses().iter();
        live.map(|hypothesis| {
            let belief = &hypothesis.belief;
            let value = self.policy.action_value(belief, action);
            hypothesis.weight
                * value.unwrap_or_else(|| f64::from(self.policy.action(belief) == action))
        })
        .sum()
    }
}

impl Agent for WakeUpAgent<'_> {
    fn reset(&mut self) {
        self.tracker.reset();
        self.valid = self.farthest;
        self.steps = 0;
        self.alone = None;
    }

    fn act(&mut self) -> ActionId {
        if self.choice == Choice::Valid || self.tracker.hypotheses().len() == 1 {
            return self.policy.action(self.valid());
        }
        let best = (0..self.actions).fold((0, f64::NEG_INFINITY), |best, action| {
            let worth = self.worth(action);
            if worth > best.1 {
                (action, worth)
            } else {
                best
            }
        });
        best.0
    }

    fn observe(&mut self, action: ActionId, reading: Reading<'_>) {
        self.tracker.update(action, reading);
        self.steps += 1;
        let live = self.tracker.hypotheses();
        if live.len() == 1 && self.alone.is_none() {
            self.alone = Some(self.steps);
        }
        if live
            .iter()
            .all(|hypothesis| hypothesis.origin != self.valid)
        {
            self.valid = self.tracker.heaviest().origin;
        }
    }

    fn belief(&self) -> Option<&Belief> {
        Some(self.valid())
    }

    fn hypotheses(&self) -> Vec<(f64, &Belief)> {
        let live = self.tracker.hypotheses().iter();
        live.map(|hypothesis| (hypothesis.weight, &hypothesis.belief))
            .collect()
    }
}

/// The start hypothesis from which the policy expects least, or, where it knows no values, whose mean is farthest from all goals.
fn farthest(mdp: &BeliefMdp, policy: &dyn Policy) -> usize {
    let goals = mdp.model().goals();
    let worth = |belief: &Belief| {
        policy.value(belief).unwrap_or_else(|| {
            let distances = goals.iter().map(|goal| distance(goal, &belief.mean));
            -distances.fold(f64::INFINITY, f64::min)
        })
    };
    let starts = mdp.starts().iter().map(|(_, belief)| worth(belief));
    let least = starts.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
    least.map_or(0, |(index, _)| index)
}

fn distance(region: &Region, point: &[f64]) -> f64 {
    let apart = |&(variable, side): &(usize, crate::model::Interval)| {
        side.clamp(point[variable]) - point[variable]
    };
    region
        .sides
        .iter()
        .map(|side| apart(side).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// What one agent reached over all kidnappings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// Share of kidnappings in which the true state was at a goal within the step limit.
    pub success: Estimate,
    /// Steps to the goal, over the successes; `None` without any.
    pub steps: Option<Estimate>,
    /// Discounted return.
    pub discounted: Estimate,
}

/// What came of the kidnappings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WakeUp {
    /// Kidnappings run.
    pub episodes: usize,
    /// The agent that wakes up lost.
    pub lost: Reached,
    /// An agent that is told its start hypothesis, in the same worlds with the same noise.
    pub told: Reached,
    /// Success of the lost agent as a share of the told one's, with its standard error (paired, delta method).
    pub ratio: Estimate,
    /// Kidnappings after which one hypothesis was left, by the steps that took, from 0 to the most that it took.
    pub alone_after: Vec<usize>,
    /// Kidnappings in which several were left in the end.
    pub never_alone: usize,
}

/// One kidnapping of one agent.
#[derive(Debug, Clone, Copy)]
struct Run {
    reached: Option<usize>,
    discounted: f64,
    /// Steps after which there was no belief any more.
    beliefless: Option<usize>,
}

/// Both agents after one kidnapping, and what was left of the hypotheses.
struct Pair {
    lost: Run,
    told: Run,
    alone: Option<usize>,
}

/// Kidnaps the agent over and over, in a world with such a truth. The truth is one of the start hypotheses, drawn by weight. The same numbers for any number of threads.
///
/// # Errors
/// [`Error::Unsupported`] for a model with one start, or without anything good to reach; [`Error::Setting`] for settings out of
/// range; [`Error::Lost`] where the mean of an agent's belief has grown to [`crate::belief::LARGEST`].
pub fn measure(
    mdp: &BeliefMdp,
    truth: &Truth,
    policy: &dyn Policy,
    settings: &Settings,
    observer: &dyn Progress,
) -> Result<WakeUp> {
    let goals = mdp.model().goals();
    check(mdp, &goals, settings)?;
    mdp.check()?;
    let agent = WakeUpAgent::new(mdp, policy, settings.tracking, settings.choice)?;
    let told: Vec<Filter> = mdp
        .starts()
        .iter()
        .map(|(_, start)| mdp.filter_from(start))
        .collect();
    // It wakes up where it believes it may be, wherever else an episode would start.
    let scenario = Scenario {
        model: mdp.model().clone(),
        truth: Truth {
            start: None,
            ..truth.clone()
        },
        rule: None,
    };
    let mut tally = Tally::default();
    let runner = || {
        let (goals, told, scenario) = (&goals, &told, &scenario);
        let mut world = ProblemWorld::new(scenario);
        let mut lost = agent.clone();
        Box::new(move |episode| {
            let draws = || Streams::new(settings.seed, episode);
            let of_lost = run(&mut world, &mut lost, draws(), goals, &scenario.model);
            let mut knows = TrackingAgent::new(&told[world.hypothesis()], policy);
            Pair {
                lost: of_lost,
                told: run(&mut world, &mut knows, draws(), goals, &scenario.model),
                alone: lost.alone(),
            }
        }) as Runner<_>
    };
    run_all(
        settings.episodes,
        "kidnappings",
        observer,
        &runner,
        &mut |pair| tally.take(&pair),
    );
    tally.summary()
}

fn check(mdp: &BeliefMdp, goals: &[Region], settings: &Settings) -> Result<()> {
    if settings.episodes == 0 {
        return Err(Error::Setting {
            setting: "episodes",
            value: "0".to_owned(),
            range: "at least 1",
        });
    }
    if goals.iter().all(|goal| goal.sides.is_empty()) {
        return Err(Error::Unsupported {
            solver: "wake-up",
            model: mdp.model().name.clone(),
            reason: "it has no goal to reach; add a [[reward]] above 0 `in` a region".to_owned(),
        });
    }
    Ok(())
}

/// Runs one agent and finds out when the true state was first at a goal.
fn run(
    world: &mut ProblemWorld,
    agent: &mut dyn Agent,
    mut draws: Streams,
    goals: &[Region],
    model: &crate::model::Model,
) -> Run {
    let mut observation = Observation::new(model.observation_dim());
    let mut reached = None;
    let episode = run_episode(
        world,
        agent,
        &mut draws,
        &mut observation,
        (model.episode.length, model.discount),
        &mut |moment, _| {
            let there = goals.iter().any(|goal| goal.contains(moment.state));
            reached = reached.or(there.then_some(moment.time + 1));
        },
    );
    Run {
        reached,
        discounted: episode.discounted,
        beliefless: episode.lost.then_some(episode.steps),
    }
}

/// What is kept of one agent's kidnappings.
#[derive(Debug, Default)]
struct Account {
    success: Moments,
    steps: Moments,
    discounted: Moments,
}

impl Account {
    fn take(&mut self, run: Run) {
        self.success.add(f64::from(run.reached.is_some()));
        if let Some(steps) = run.reached {
            self.steps.add(steps as f64);
        }
        self.discounted.add(run.discounted);
    }

    fn summary(&self) -> Reached {
        Reached {
            success: self.success.estimate(),
            steps: (self.steps.count() > 0).then(|| self.steps.estimate()),
            discounted: self.discounted.estimate(),
        }
    }
}

/// What is kept of all kidnappings.
#[derive(Debug, Default)]
struct Tally {
    lost: Account,
    told: Account,
    /// Kidnappings in which both reached a goal.
    both: u64,
    alone_after: Vec<usize>,
    never_alone: usize,
    /// First kidnapping and step after which an agent no longer had a belief.
    beliefless: Option<(u64, usize)>,
}

impl Tally {
    fn take(&mut self, pair: &Pair) {
        for run in [pair.lost, pair.told] {
            if let Some(step) = run.beliefless {
                self.beliefless
                    .get_or_insert((self.lost.success.count(), step));
            }
        }
        self.lost.take(pair.lost);
        self.told.take(pair.told);
        self.both += u64::from(pair.lost.reached.is_some() && pair.told.reached.is_some());
        match pair.alone {
            None => self.never_alone += 1,
            Some(steps) => {
                if self.alone_after.len() <= steps {
                    self.alone_after.resize(steps + 1, 0);
                }
                self.alone_after[steps] += 1;
            }
        }
    }

    fn summary(self) -> Result<WakeUp> {
        if let Some((episode, step)) = self.beliefless {
            return Err(Error::Lost {
                episode,
                step,
                largest: LARGEST,
            });
        }
        let (lost, told) = (self.lost.summary(), self.told.summary());
        let ratio = lost.success.mean / told.success.mean;
        let count = self.lost.success.count() as f64;
        // Sum of the squares of `lost - ratio told`, whose own sum is 0.
        let squares = count * (lost.success.mean + ratio * ratio * told.success.mean)
            - 2.0 * ratio * self.both as f64;
        let missed = if count > 1.0 {
            (squares.max(0.0) / (count - 1.0) / count).sqrt()
        } else {
            0.0
        };
        Ok(WakeUp {
            episodes: self.lost.success.count() as usize,
            ratio: Estimate {
                mean: ratio,
                stderr: missed / told.success.mean,
            },
            lost,
            told,
            alone_after: self.alone_after,
            never_alone: self.never_alone,
        })
    }
}
