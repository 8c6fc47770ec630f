//! Running policies in worlds, and what they earn.
//!
//! [`evaluate`] runs a policy for many episodes of a scenario and gives an [`Evaluation`], each of its numbers an [`Estimate`] with a
//! standard error; [`compare`] runs two of them through the same episodes; [`evaluate_agent`] and [`compare_agents`] do so for agents of any
//! kind, such as the [`GraphRunner`](crate::policy::GraphRunner) of a policy graph; [`life`] asks how long it takes until one fails, and
//! [`wake_up`] what becomes of an agent that is carried elsewhere.
//!
//! One episode is [`run_episode`]: an [`Agent`], such as the [`TrackingAgent`] of a tracker and a policy, in a
//! [`World`].

mod agent;
mod estimate;
mod evaluate;
mod hand;
mod life;
pub mod wake_up;

pub use agent::{Agent, TrackingAgent};
pub use estimate::Estimate;
pub(crate) use evaluate::summarise;
pub use evaluate::{
    Agents, Difference, Evaluation, Lost, Options, compare, compare_agents, evaluate,
    evaluate_agent, evaluate_both,
};
pub use hand::{HandAgent, Told};
pub use life::{Life, LifeOptions, Run, life};

use crate::belief::{Reading, is_kept};
use crate::model::{ActionId, Then};
use crate::world::{Observation, Streams, World};

/// What one episode earned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Episode {
    /// Sum of `discount^t r_t`.
    pub discounted: f64,
    /// Sum of `r_t`.
    pub undiscounted: f64,
    /// Steps taken.
    pub steps: usize,
    /// Whether it ended in failure.
    pub failed: bool,
    /// Whether it ended because the mean of the agent's belief had grown to [`crate::belief::LARGEST`].
    pub lost: bool,
}

/// One step of an episode, as a watcher sees it.
#[derive(Debug)]
pub struct Moment<'a> {
    /// Steps taken before this one.
    pub time: usize,
    /// Action taken.
    pub action: ActionId,
    /// Reward collected.
    pub reward: f64,
    /// True state afterwards.
    pub state: &'a [f64],
    /// True mode afterwards.
    pub mode: usize,
    /// What was sensed afterwards; that of the step before where the episode ends or restarts.
    pub reading: Reading<'a>,
    /// Whether the episode goes on.
    pub then: Then,
}

/// Runs one episode of at most `length` steps. `observation` is room for what is sensed.
///
/// The order is that of POMDPs.jl: stop if the episode is over, act, collect the discounted reward, then update the belief. An agent
/// whose mean has grown to [`crate::belief::LARGEST`] has no belief to act on: the episode ends there. What ending costs is paid after the last step.
pub fn run_episode(
    world: &mut dyn World,
    agent: &mut dyn Agent,
    draws: &mut Streams,
    observation: &mut Observation,
    (length, discount): (usize, f64),
    watch: &mut dyn FnMut(&Moment<'_>, &dyn Agent),
) -> Episode {
    world.reset(draws);
    agent.reset();
    let mut episode = Episode {
        discounted: 0.0,
        undiscounted: 0.0,
        steps: 0,
        failed: false,
        lost: false,
    };
    let mut weight = 1.0;
    while episode.steps < length {
        let action = agent.act();
        let step = world.step(action, draws, observation);
        episode.discounted += weight * step.reward;
        episode.undiscounted += step.reward;
        weight *= discount;
        match step.then {
            Then::Continue => agent.observe(action, observation.reading()),
            Then::Restart => agent.reset(),
            Then::End => {}
        }
        let moment = Moment {
            time: episode.steps,
            action,
            reward: step.reward,
            state: world.state(),
            mode: world.mode(),
            reading: observation.reading(),
            then: step.then,
        };
        watch(&moment, agent);
        episode.steps += 1;
        if step.then == Then::End {
            episode.failed = step.failed;
            break;
        }
        if agent.belief().is_some_and(|belief| !is_kept(&belief.mean)) {
            episode.lost = true;
            break;
        }
    }
    let ending = world.ending();
    episode.discounted += weight * ending;
    episode.undiscounted += ending;
    episode
}
