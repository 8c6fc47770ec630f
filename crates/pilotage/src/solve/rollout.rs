//! Beliefs a policy meets, sampled from the model.

use crate::belief::{Belief, BeliefSpace, Held, Moments, Reading, Updater};
use crate::error::Result;
use crate::model::{ActionId, Model};
use crate::parallel;
use crate::policy::Policy;
use crate::random::{Rng, Role, stream, uniform};
use crate::scenario::Scenario;
use crate::simulate::{Agent, TrackingAgent, run_episode};
use crate::solve::settings::ensure;
use crate::world::{Observation, ProblemWorld, Streams, World};

/// One decision: where it was taken, what was done, and what was sensed on the way there.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision<At = Belief> {
    /// Where it was taken: the belief, as it is read, unless something else was asked for.
    pub at: At,
    /// Action taken.
    pub action: ActionId,
    /// What was sensed just before (length `m`); empty at the start of an episode, and where the reading was missing.
    pub observation: Vec<f64>,
}

/// Most episodes that are run.
const MOST_RUNS: usize = 1_000_000;

/// Most decisions that are kept, of all episodes together.
const MOST_DECISIONS: usize = 10_000_000;

/// Checks how many episodes are run.
///
/// # Errors
/// [`crate::Error::Setting`] for none, or too many to keep what they meet.
pub(crate) fn check_runs(setting: &'static str, runs: usize) -> Result<()> {
    let fits = (1..=MOST_RUNS).contains(&runs);
    ensure(setting, runs, fits, "1 to 1000000")
}

/// Runs `episodes` episodes, one to a million, in the world that the model assumes and returns the decisions of each.
/// The same for any number of threads.
///
/// Episodes that are very long are cut, all at the same step, so that no more than ten million decisions are kept.
///
/// Where the start hypotheses of a belief are tracked, the agent is told which of them is true: one policy serves all of them.
pub fn decisions(
    space: &dyn BeliefSpace,
    updater: &Updater,
    policy: &dyn Policy,
    episodes: usize,
    length: usize,
    seed: u64,
) -> Vec<Vec<Decision>> {
    let at = |agent: &TrackingAgent<'_>| agent.believed().clone();
    recorded(space, (updater, policy), (episodes, length), seed, &at)
}

/// The same, with what `at` says of the agent in place of the belief.
pub(crate) fn recorded<At: Send>(
    space: &dyn BeliefSpace,
    (updater, policy): (&Updater, &dyn Policy),
    (episodes, length): (usize, usize),
    seed: u64,
    at: &(dyn Fn(&TrackingAgent<'_>) -> At + Sync),
) -> Vec<Vec<Decision<At>>> {
    let length = length.min(MOST_DECISIONS / episodes.max(1));
    let model = space.model();
    let scenario = Scenario::assumed(model);
    let told = updater.told(space);
    parallel::map(episodes, |episode| {
        let mut world = ProblemWorld::new(&scenario);
        world.reset(&mut Streams::new(seed, episode as u64));
        let mut agent = Recorder {
            inner: TrackingAgent::new(told_in(&told, &world), policy),
            at,
            sensed: Vec::new(),
            decisions: Vec::new(),
        };
        follow(model, &mut world, &mut agent, length, (seed, episode));
        agent.decisions
    })
}

/// The one that starts as a world does, of those of [`Updater::told`].
pub(crate) fn told_in<'a>(told: &'a [Updater], world: &ProblemWorld) -> &'a Updater {
    &told[world.hypothesis().min(told.len() - 1)]
}

/// Steps of an episode that is never over early, each counted by its discount.
pub(crate) fn discounted_steps(model: &Model, length: usize) -> f64 {
    let counts = (0..length).map(|step| model.discount.powi(step as i32));
    counts.sum()
}

/// Runs an episode that is told by a seed and its number.
fn follow(
    model: &Model,
    world: &mut ProblemWorld,
    agent: &mut dyn Agent,
    length: usize,
    (seed, episode): (u64, usize),
) {
    run_episode(
        world,
        agent,
        &mut Streams::new(seed, episode as u64),
        &mut Observation::new(model.observation_dim()),
        (length, model.discount),
        &mut |_, _| {},
    );
}

/// A belief that a policy met, with what another policy expects of every action there.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// The belief, as it is read.
    pub belief: Belief,
    /// Its own moments, where it is kept in full.
    pub moments: Option<Moments>,
    /// By action: the return expected, or how much less than that of the best action.
    pub values: Vec<f64>,
    /// The return expected of whoever acts on, where it is known.
    pub value: Option<f64>,
    /// How often an episode is expected to meet such a belief, discounted.
    pub counts: f64,
}

/// Runs episodes as [`decisions`] does, of which some decisions are judged: about `most`, and the likelier the more a step counts. A judge
/// who knows no values holds all actions but its own to be worse by 1. The same for any number of threads.
pub fn judged(
    space: &dyn BeliefSpace,
    (policy, judge): (&dyn Policy, &dyn Policy),
    (episodes, length): (usize, usize),
    most: usize,
    seed: u64,
) -> Vec<Judged> {
    let model = space.model();
    let scenario = Scenario::assumed(model);
    let told = space.updater().told(space);
    let share = most as f64 / (episodes as f64 * discounted_steps(model, length));
    let runs = parallel::map(episodes, |episode| {
        let mut world = ProblemWorld::new(&scenario);
        world.reset(&mut Streams::new(seed, episode as u64));
        let mut agent = Judge {
            inner: TrackingAgent::new(told_in(&told, &world), policy),
            judge,
            actions: model.actions.len(),
            share,
            discount: model.discount,
            counts: 1.0 / episodes as f64,
            whims: stream(seed, episode as u64, Role::Exploration),
            judged: Vec::new(),
        };
        follow(model, &mut world, &mut agent, length, (seed, episode));
        agent.judged
    });
    runs.into_iter().flatten().collect()
}

/// An agent some of whose decisions are judged.
struct Judge<'a> {
    inner: TrackingAgent<'a>,
    judge: &'a dyn Policy,
    actions: usize,
    /// Share of first decisions that is judged.
    share: f64,
    discount: f64,
    /// How much the decision counts.
    counts: f64,
    whims: Rng,
    judged: Vec<Judged>,
}

impl Judge<'_> {
    /// The belief of now, judged in full if the judge looks at beliefs in full.
    fn judged_now(&self, counts: f64) -> Judged {
        let (belief, held) = (self.inner.believed(), self.inner.held());
        let in_full = held.and_then(|held| self.judge.values_in_full(held));
        let (values, value) = match in_full {
            Some(values) => {
                let best = values.iter().copied().reduce(f64::max);
                (values, best)
            }
            None => (self.read(belief), self.judge.value(belief)),
        };
        Judged {
            belief: belief.clone(),
            moments: held.and_then(Held::moments).cloned(),
            values,
            value,
            counts,
        }
    }

    /// What is expected of each action at what a belief is read as.
    fn read(&self, belief: &Belief) -> Vec<f64> {
        let actions = 0..self.actions;
        let known = actions
            .clone()
            .map(|action| self.judge.action_value(belief, action));
        known.collect::<Option<Vec<f64>>>().unwrap_or_else(|| {
            let own = self.judge.action(belief);
            let value = |action| if action == own { 0.0 } else { -1.0 };
            actions.map(value).collect()
        })
    }
}

impl Agent for Judge<'_> {
    fn reset(&mut self) {
        self.inner.reset();
    }

    fn act(&mut self) -> ActionId {
        let likely = self.share.min(1.0);
        if likely > 0.0 && uniform(&mut self.whims) < likely {
            let judged = self.judged_now(self.counts / likely);
            self.judged.push(judged);
        }
        self.share *= self.discount;
        self.counts *= self.discount;
        self.inner.act()
    }

    fn observe(&mut self, action: ActionId, reading: Reading<'_>) {
        self.inner.observe(action, reading);
    }

    fn belief(&self) -> Option<&Belief> {
        self.inner.belief()
    }
}

/// An agent that writes down its decisions.
struct Recorder<'a, At> {
    inner: TrackingAgent<'a>,
    at: &'a (dyn Fn(&TrackingAgent<'_>) -> At + Sync),
    sensed: Vec<f64>,
    decisions: Vec<Decision<At>>,
}

impl<At: Send> Agent for Recorder<'_, At> {
    fn reset(&mut self) {
        self.sensed.clear();
        self.inner.reset();
    }

    fn act(&mut self) -> ActionId {
        let action = self.inner.act();
        let observation = std::mem::take(&mut self.sensed);
        self.decisions.push(Decision {
            at: (self.at)(&self.inner),
            action,
            observation,
        });
        action
    }

    fn observe(&mut self, action: ActionId, reading: Reading<'_>) {
        self.sensed = reading.values().map(<[f64]>::to_vec).unwrap_or_default();
        self.inner.observe(action, reading);
    }

    fn belief(&self) -> Option<&Belief> {
        self.inner.belief()
    }
}
