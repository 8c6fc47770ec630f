//! What a step does is said once: a world that tests it at a state and a belief that integrates it agree, over all models.
#![allow(clippy::unwrap_used)]

use nalgebra::{DMatrix, DVector};
use pilotage::belief::BeliefMdp;
use pilotage::model::{
    Effect, Interval, Model, Region, StartHypothesis, StartShape, Then, WallBelief, When, apart,
};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::Estimate;
use pilotage::world::{Observation, ProblemWorld, Streams, World};
use proptest::prelude::*;

fn region() -> impl Strategy<Value = Region> {
    let side = prop_oneof![
        Just(Interval::ALL),
        (0..6_i32, 1..6_i32)
            .prop_map(|(low, width)| { Interval::new(f64::from(low), f64::from(low + width)) }),
        (0..6_i32).prop_map(|low| Interval::new(f64::from(low), f64::INFINITY)),
    ];
    proptest::collection::vec(side, 3)
        .prop_map(|sides| Region::new(sides.into_iter().enumerate().collect()))
}

fn place() -> impl Strategy<Value = Vec<f64>> {
    // Corners and borders among them.
    proptest::collection::vec((-1..24_i32).prop_map(|half| 0.5 * f64::from(half)), 3)
}

proptest! {
    /// What is left of a region without another is in neither twice nor lost.
    #[test]
    fn a_region_is_the_other_and_the_rest(a in region(), b in region(), at in place()) {
        let rest = a.without(&b);
        let there = rest.iter().filter(|piece| piece.contains(&at)).count();
        let expected = usize::from(a.contains(&at) && !b.contains(&at));
        prop_assert_eq!(there, expected);
    }

    /// Of events that are apart exactly the first that applies holds, and rewards are left as they are.
    #[test]
    fn of_events_apart_the_first_holds(regions in proptest::collection::vec(region(), 1..5), at in place()) {
        let event = |(number, region): (usize, Region)| Effect {
            region,
            when: When::Before,
            reward: number as f64,
            formula: None,
            chance: 1.0,
            change: Some(pilotage::model::Change { mode: number, then: Then::Continue }),
        };
        let effects: Vec<Effect> = regions.into_iter().enumerate().map(event).collect();
        let first = effects.iter().find(|effect| effect.region.contains(&at)).map(|effect| effect.reward);
        let split = apart(effects);
        let holding: Vec<f64> = split.iter().filter(|effect| effect.region.contains(&at)).map(|effect| effect.reward).collect();
        prop_assert_eq!(holding, first.into_iter().collect::<Vec<_>>());
    }
}

/// A model that starts at a belief, in a mode.
fn starting(model: &Model, mode: usize, mean: &[f64], covariance: DMatrix<f64>) -> Model {
    let start = StartHypothesis {
        weight: 1.0,
        mode,
        mean: DVector::from_column_slice(mean),
        covariance,
        shape: StartShape::Normal,
    };
    Model {
        start: vec![start],
        ..model.clone()
    }
}

/// Every model, at beliefs spread over its bounds, in every mode, for every action: what the belief expects of a step is what the world
/// pays on average, and so is what happens to the episode. With 4.5 standard errors about one comparison in 150,000 fails by chance.
#[test]
fn worlds_and_beliefs_agree_over_all_models() {
    const STEPS: u64 = 4000;
    let mut compared = 0;
    // What a belief makes of the steps of other models, tests/beliefs_in_full.rs holds against the world.
    let linear = |name: &&str| scenario::find(name).unwrap().model.is_linear();
    for name in scenario::names().filter(linear) {
        let model = scenario::find(name).unwrap().model;
        // A Gaussian at a wall is an approximation of its own, tested elsewhere.
        let model = Model {
            belief: pilotage::model::BeliefSettings {
                walls: WallBelief::Ignore,
                ..model.belief.clone()
            },
            ..model
        };
        let n = model.state_dim();
        let spread = 0.3;
        for share in [0.1, 0.5, 0.83] {
            let mean: Vec<f64> = model
                .state
                .iter()
                .map(|variable| variable.bounds.low + share * variable.bounds.width())
                .collect();
            // Failing limits are those of the next test.
            if !model.episode.alive.sides.is_empty() {
                continue;
            }
            for mode in 0..model.modes.len() {
                let model = starting(&model, mode, &mean, DMatrix::identity(n, n) * spread);
                let mdp = BeliefMdp::new(&model);
                let start = mdp.start().clone();
                let (low, high) = mdp.reward_range();
                for action in 0..model.actions.len() {
                    let (reward, outcomes) = mdp.step(mode, start.stratum, &start.mean, action);
                    let mut world = ProblemWorld::new(&Scenario::assumed(&model));
                    let mut observation = Observation::new(model.observation_dim());
                    let steps: Vec<(f64, bool, usize)> = (0..STEPS)
                        .map(|episode| {
                            let mut draws = Streams::new(17, episode);
                            world.reset(&mut draws);
                            let step = world.step(action, &mut draws, &mut observation);
                            (step.reward, step.then == Then::Continue, world.mode())
                        })
                        .collect();
                    let mut agree =
                        |what: &str, expected: f64, sample: &dyn Fn(&(f64, bool, usize)) -> f64| {
                            let met = Estimate::of(steps.iter().map(sample));
                            compared += 1;
                            // What happens less than once in all these steps may not have been met.
                            let unseen = 5.0 * (high - low).max(1.0) / STEPS as f64;
                            assert!(
                                (met.mean - expected).abs() <= 4.5 * met.stderr + unseen,
                                "{name}, mode {mode}, action {action} at {mean:?}: {what} {expected} and {met:?}"
                            );
                        };
                    agree("reward", reward, &|step| step.0);
                    let probability = |holds: &dyn Fn(&pilotage::model::Outcome) -> bool| -> f64 {
                        let such = outcomes.iter().filter(|outcome| holds(outcome));
                        such.map(|outcome| outcome.probability).sum()
                    };
                    let goes_on = probability(&|outcome| outcome.then == Then::Continue);
                    agree("going on", goes_on, &|step| f64::from(step.1));
                    for becomes in 0..model.modes.len() {
                        let there = probability(&|outcome| outcome.mode == becomes);
                        agree("mode", there, &|step| f64::from(step.2 == becomes));
                    }
                }
            }
        }
    }
    assert!(compared > 500, "{compared}");
}

/// Who takes the mean for the state infers of modes what the world does there, at every step of the clock: over all models, and for events
/// that stand in each other's way.
#[test]
fn the_filter_changes_modes_as_the_world_does() {
    let clocked = r#"
format = 1
name = "clocked"
discount = 0.9
[state]
names = ["x"]
modes = ["a", "b", "c"]
bounds = [[0.0, 10.0]]
[start]
mean = [1.0]
covariance = [[0.0]]
[motion]
A = [[1.0]]
noise = [[0.0]]
[sensor]
noise = [[1.0]]
[actions]
GO = { u = [1.0] }
STAY = {}
[[event]]
in = { x = [0.0, 2.0] }
reward = 1.0
[[event]]
mode = "a"
in = { x = [0.0, 6.0] }
steps = { from = 1, until = 3 }
becomes = "b"
[[event]]
mode = "b"
when = "after"
in = { x = [4.0, 10.0] }
steps = { from = 2 }
becomes = "c"
[[event]]
mode = "c"
action = "STAY"
becomes = "a"
[[reward]]
value = 1.0
"#;
    let own = scenario::read(clocked, "clocked.toml").unwrap().model;
    let builtin = scenario::names().map(|name| scenario::find(name).unwrap().model);
    let builtin = builtin.filter(Model::is_linear);
    let mut compared = 0;
    for model in builtin.chain([own]) {
        let n = model.state_dim();
        if !model.episode.alive.sides.is_empty() {
            continue;
        }
        // What is asked after the move is asked of a state that is known: nothing is uncertain here.
        let mut model = Model {
            belief: pilotage::model::BeliefSettings {
                walls: WallBelief::Ignore,
                ..model.belief.clone()
            },
            ..model
        };
        model.motion.noise.fill(0.0);
        model.sensor.h = DMatrix::identity(n, n);
        model.sensor.noise = DMatrix::identity(n, n);
        for action in &mut model.actions {
            (action.motion_noise, action.sensor_noise) = (None, None);
        }
        for share in [0.05, 0.3, 0.55, 0.8] {
            let mean: Vec<f64> = model
                .state
                .iter()
                .map(|variable| variable.bounds.low + share * variable.bounds.width())
                .collect();
            for mode in 0..model.modes.len() {
                let model = starting(&model, mode, &mean, DMatrix::zeros(n, n));
                let mdp = BeliefMdp::new(&model);
                let filter = mdp.filter();
                for plan in 0..model.actions.len() {
                    let mut world = ProblemWorld::new(&Scenario::assumed(&model));
                    let mut observation = Observation::new(n);
                    let mut draws = Streams::new(5, 0);
                    world.reset(&mut draws);
                    let mut belief = filter.initial();
                    let mut scratch = vec![0.0; n];
                    for step in 0..8 {
                        let action = (plan + step / 2) % model.actions.len();
                        let then = world.step(action, &mut draws, &mut observation).then;
                        if then != Then::Continue {
                            break;
                        }
                        let state = world.state().to_vec();
                        filter.update(&mut belief, action, observation.reading(), &mut scratch);
                        assert_eq!(
                            (belief.mode, &belief.mean),
                            (world.mode(), &state),
                            "{}, step {step} of {plan} from {mean:?} in mode {mode}",
                            model.name
                        );
                        compared += 1;
                    }
                }
            }
        }
    }
    assert!(compared > 500, "{compared}");
}
