//! Recorded episodes are the runs that a simulation makes.

use pilotage::belief::BeliefMdp;
use pilotage::policy::AutomatonRunner;
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario, Truth};
use pilotage::simulate::{Agent, TrackingAgent, run_episode, wake_up};
use pilotage::solve::value_iteration::Settings;
use pilotage::solve::{Request, ValueIteration, plan};
use pilotage::world::{Observation, ProblemWorld, Streams};
use pilotage_report::{Recording, Take, record};

const SEED: u64 = 3;

/// Rewards, actions and true states of an episode as a simulation has them.
type Steps = Vec<(f64, String, Vec<f64>)>;

fn simulated(scenario: &Scenario, agent: &mut dyn Agent, episode: u64) -> Steps {
    let model = &scenario.model;
    let mut steps = Vec::new();
    run_episode(
        &mut ProblemWorld::new(scenario),
        agent,
        &mut Streams::new(SEED, episode),
        &mut Observation::new(model.observation_dim()),
        (model.episode.length, model.discount),
        &mut |moment, _| {
            let action = model.actions[moment.action].name.clone();
            steps.push((moment.reward, action, moment.state.to_vec()));
        },
    );
    steps
}

/// State of a frame, and what led there.
fn recorded(recording: &Recording) -> Steps {
    let frames = &recording.frames;
    let after = frames.iter().skip(1).map(|frame| frame.state.clone());
    let steps = frames.iter().zip(after);
    steps
        .map(|(frame, state)| (frame.reward, frame.action.clone(), state))
        .collect()
}

#[test]
fn recordings_are_the_runs_of_a_simulation() {
    for name in ["corridor-blind", "load-unload", "u-maze"] {
        let scenario = scenario::find(name).expect("a built-in model");
        let mdp = BeliefMdp::new(&scenario.model);
        let planner = ValueIteration {
            grid: Settings {
                points: Some(41),
                ..Settings::default()
            },
        };
        let solution = plan(&planner, &scenario.model, &Request::default(), &Silent)
            .expect("a model it accepts");
        let automaton = solution.automaton().expect("the default form");
        let controller = AutomatonRunner::new(automaton);
        for episode in 0..5 {
            let whole = if name == "u-maze" {
                let defaults = wake_up::Settings::default();
                let mut agent = wake_up::WakeUpAgent::new(
                    &mdp,
                    &controller,
                    defaults.tracking,
                    defaults.choice,
                )
                .expect("several starts");
                simulated(&scenario, &mut agent, episode)
            } else {
                let mut agent = TrackingAgent::new(&automaton.updater, &controller);
                simulated(&scenario, &mut agent, episode)
            };
            for most_steps in [7, usize::MAX] {
                let take = Take {
                    seed: SEED,
                    episode,
                    most_steps,
                };
                let recording =
                    record(&mdp, &scenario.truth, automaton, take).expect("one or two variables");
                assert_eq!(
                    recorded(&recording),
                    whole[..whole.len().min(most_steps)],
                    "{name}, episode {episode}"
                );
                assert_sound(&recording);
            }
        }
    }
}

/// Weights are a distribution in order, the node does what is done, and all is within the bounds drawn.
fn assert_sound(recording: &Recording) {
    for frame in &recording.frames {
        let weights: Vec<f64> = frame.hypotheses.iter().map(|each| each.weight).collect();
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(weights.is_sorted_by(|a, b| a >= b));
        assert!(frame.valid < weights.len());
        if !frame.action.is_empty() {
            let node = &recording.nodes[frame.node];
            assert_eq!(*node, format!("{} {}", frame.node, frame.action));
        }
        let means = frame.hypotheses.iter().map(|each| &each.mean);
        for point in means.chain([&frame.state]) {
            let within = point.iter().zip(&recording.bounds);
            for (x, (low, high)) in within {
                assert!(low <= x && x <= high, "{x} in [{low}, {high}]");
            }
        }
    }
}

#[test]
fn a_model_with_more_than_two_variables_is_refused() {
    let mdp = BeliefMdp::new(&scenario::find("cart-pole").expect("a built-in model").model);
    let nothing =
        pilotage::policy::Automaton::new(&mdp, "none", pilotage::policy::Matching::Nearest);
    let take = Take {
        seed: SEED,
        episode: 0,
        most_steps: 1,
    };
    let error = record(&mdp, &Truth::default(), &nothing, take).expect_err("four variables");
    assert!(error.to_string().contains("4 state variables"), "{error}");
}
