//! Episodes written down step by step, to be played: the very runs that a simulation makes with the same seed.

use super::finding::{Frame, Hypothesis, Recording};
use pilotage::belief::{Belief, BeliefSpace};
use pilotage::error::{Error, Result};
use pilotage::model::{Interval, ModeId, Model, Region};
use pilotage::policy::{Automaton, AutomatonRunner};
use pilotage::scenario::{Scenario, Truth, Walls};
use pilotage::simulate::{Agent, TrackingAgent, run_episode, wake_up};
use pilotage::world::{Observation, ProblemWorld, Streams, World};

/// Which run to write down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Take {
    /// Seed of every random number.
    pub seed: u64,
    /// Number of the episode.
    pub episode: u64,
    /// Steps after which to stop, if the episode has not ended before.
    pub most_steps: usize,
}

/// Runs an automaton in the world of its model and writes down an episode. Where the belief tracks several start hypotheses the
/// agent wakes up lost (thesis 5.6), with the default settings of [`wake_up`]. Named after the model.
///
/// # Errors
/// [`Error::Unsupported`] for models with more than two state variables.
pub fn record(
    space: &dyn BeliefSpace,
    truth: &Truth,
    automaton: &Automaton,
    take: Take,
) -> Result<Recording> {
    let mut scenario = Scenario {
        model: space.model().clone(),
        truth: truth.clone(),
        rule: None,
    };
    let model = space.model();
    if model.state_dim() > 2 {
        return Err(Error::Unsupported {
            solver: "recording an episode",
            reason: format!(
                "it has {} state variables, and one or two can be drawn",
                model.state_dim()
            ),
            model: model.name.clone(),
        });
    }
    let controller = AutomatonRunner::new(automaton);
    let several = space.as_mdp().filter(|mdp| mdp.starts().len() > 1);
    let frames = if let Some(mdp) = several {
        scenario.truth.start = None;
        let wake_up::Settings {
            tracking, choice, ..
        } = wake_up::Settings::default();
        let mut agent = wake_up::WakeUpAgent::new(mdp, &controller, tracking, choice)?;
        run(space, &scenario, automaton, &mut agent, take)
    } else {
        let mut agent = TrackingAgent::new(&automaton.updater, &controller);
        run(space, &scenario, automaton, &mut agent, take)
    };
    let bounds = bounds(model, &frames);
    let corners = |region: &Region| corners(region, &bounds);
    let map = model.map.as_ref();
    Ok(Recording {
        id: model.name.clone(),
        title: model.name.clone(),
        about: model.about.clone(),
        states: automaton.states.clone(),
        places: places(model)
            .into_iter()
            .map(|(region, name)| {
                let (lower, upper) = corners(&region);
                (lower, upper, name)
            })
            .collect(),
        blocked: map.map_or_else(Vec::new, |map| map.blocked.iter().map(corners).collect()),
        walls: walls(&scenario),
        nodes: automaton
            .nodes
            .iter()
            .enumerate()
            .map(|(id, node)| format!("{id} {}", automaton.actions[node.action]))
            .collect(),
        frames,
        bounds,
    })
}

/// The frames of an episode: each the state and belief before a step, with what was done there and what it paid.
fn run(
    space: &dyn BeliefSpace,
    scenario: &Scenario,
    automaton: &Automaton,
    agent: &mut dyn Agent,
    take: Take,
) -> Vec<Frame> {
    let model = &scenario.model;
    let mut world = ProblemWorld::new(scenario);
    // The run below draws the same start once more.
    world.reset(&mut Streams::new(take.seed, take.episode));
    agent.reset();
    let before = |state: &[f64], mode: ModeId, agent: &dyn Agent| {
        let (valid, hypotheses) = believed(space, agent);
        Frame {
            state: state.to_vec(),
            mode: mode_name(model, mode),
            hypotheses,
            valid,
            node: agent.node(automaton).unwrap_or(0),
            action: String::new(),
            reward: 0.0,
        }
    };
    let mut frames = Vec::new();
    let mut next = before(world.state(), world.mode(), agent);
    run_episode(
        &mut world,
        agent,
        &mut Streams::new(take.seed, take.episode),
        &mut Observation::new(model.observation_dim()),
        (model.episode.length.min(take.most_steps), model.discount),
        &mut |moment, agent| {
            let after = before(moment.state, moment.mode, agent);
            frames.push(Frame {
                action: model.actions[moment.action].name.clone(),
                reward: moment.reward,
                ..std::mem::replace(&mut next, after)
            });
        },
    );
    frames.push(next);
    frames
}

/// The hypotheses, the likeliest first, and which of them the agent acts on.
fn believed(space: &dyn BeliefSpace, agent: &dyn Agent) -> (usize, Vec<Hypothesis>) {
    let mut hypotheses = agent.hypotheses();
    hypotheses.sort_by(|a, b| b.0.total_cmp(&a.0));
    let own = agent.belief();
    let acted_on = |&(_, belief): &(f64, &Belief)| own.is_some_and(|own| std::ptr::eq(belief, own));
    let valid = hypotheses.iter().position(acted_on).unwrap_or(0);
    let drawn = hypotheses.into_iter().map(|(weight, belief)| Hypothesis {
        weight,
        mode: mode_name(space.model(), belief.mode),
        mean: belief.mean.clone(),
        // A covariance is the same row by row and column by column.
        covariance: space.covariance(belief.stratum).as_slice().to_vec(),
    });
    (valid, drawn.collect())
}

fn mode_name(model: &Model, mode: ModeId) -> String {
    match model.modes.as_slice() {
        [_] => String::new(),
        modes => modes[mode].clone(),
    }
}

/// The model's bounds, widened to every true state and to a standard deviation around every mean.
fn bounds(model: &Model, frames: &[Frame]) -> Vec<(f64, f64)> {
    let n = model.state_dim();
    let of_variable = |i: usize| {
        let believed = frames
            .iter()
            .flat_map(|frame| &frame.hypotheses)
            .flat_map(|hypothesis| {
                let sd = hypothesis.covariance[i * n + i].sqrt();
                [hypothesis.mean[i] - sd, hypothesis.mean[i] + sd]
            });
        let Interval { low, high } = model.state[i].bounds;
        frames
            .iter()
            .map(|frame| frame.state[i])
            .chain(believed)
            .chain([low, high])
            .filter(|x| x.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| {
                (least.min(x), most.max(x))
            })
    };
    (0..n).map(of_variable).collect()
}

/// Where something good is paid, and for what.
fn places(model: &Model) -> Vec<(Region, String)> {
    let name = |actions: &Option<Vec<usize>>, paid: f64| match actions {
        None => format!("pays {paid}"),
        Some(actions) => {
            let names = actions.iter().map(|&action| &*model.actions[action].name);
            format!("{} pays {paid}", names.collect::<Vec<_>>().join(" or "))
        }
    };
    let rewards = model
        .rewards
        .iter()
        .map(|reward| (&reward.actions, reward.value, &reward.region));
    let events = model
        .events
        .iter()
        .map(|event| (&event.actions, event.reward, &event.region));
    rewards
        .chain(events)
        .filter(|(_, paid, region)| *paid > 0.0 && !region.sides.is_empty())
        .map(|(actions, paid, region)| (region.clone(), name(actions, paid)))
        .collect()
}

/// Lower and upper corner of the part of a region that is drawn.
fn corners(region: &Region, bounds: &[(f64, f64)]) -> (Vec<f64>, Vec<f64>) {
    let (mut lower, mut upper): (Vec<f64>, Vec<f64>) = bounds.iter().copied().unzip();
    for &(variable, side) in &region.sides {
        lower[variable] = side.low.max(lower[variable]);
        upper[variable] = side.high.min(upper[variable]);
    }
    (lower, upper)
}

/// The walls that stop the true state: thin ones of a map, and those around everything.
fn walls(scenario: &Scenario) -> Vec<((f64, f64), (f64, f64))> {
    let model = &scenario.model;
    if scenario.truth.walls == Walls::None {
        return Vec::new();
    }
    let sides: Vec<Interval> = match &model.map {
        Some(map) => map.extent().to_vec(),
        None => model.state.iter().map(|variable| variable.bounds).collect(),
    };
    let around = match *sides {
        [x] => vec![((x.low, 0.0), (x.low, 0.0)), ((x.high, 0.0), (x.high, 0.0))],
        [x, y] => vec![
            ((x.low, y.low), (x.high, y.low)),
            ((x.high, y.low), (x.high, y.high)),
            ((x.high, y.high), (x.low, y.high)),
            ((x.low, y.high), (x.low, y.low)),
        ],
        _ => Vec::new(),
    };
    let thin = model.map.iter().flat_map(|map| &map.walls);
    let thin = thin.map(|&[from, to]| ((from[0], from[1]), (to[0], to[1])));
    around
        .into_iter()
        .filter(|(from, to)| [from.0, from.1, to.0, to.1].iter().all(|x| x.is_finite()))
        .chain(thin)
        .collect()
}
