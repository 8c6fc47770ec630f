//! Rewards and events that depend on where an action leads, uniform starts, and a true motion that depends on the hidden mode.
#![allow(clippy::unwrap_used)]

use nalgebra::DVector;
use pilotage::belief::{Belief, BeliefMdp, Filter, Reading};
use pilotage::model::{Interval, Region, StartShape, Steps, Switch, Then, When};
use pilotage::scenario::{self, Scenario, Truth};
use pilotage::world::{Observation, ProblemWorld, Streams, World};

fn scenario(name: &str) -> Scenario {
    scenario::find(name).unwrap_or_else(|error| panic!("{error}"))
}

/// The scenario without any noise, starting at a point.
fn still(name: &str, at: &[f64], mode: usize) -> Scenario {
    let Scenario {
        mut model,
        mut truth,
        rule,
    } = scenario(name);
    model.motion.noise *= 0.0;
    model.sensor.noise *= 0.0;
    if let Some(noise) = &mut truth.motion.noise {
        *noise *= 0.0;
    }
    let mut start = truth.start.take().unwrap_or_else(|| model.start.clone());
    start[0].mean = DVector::from_column_slice(at);
    start[0].covariance *= 0.0;
    start[0].mode = mode;
    truth.start = Some(start);
    Scenario { model, truth, rule }
}

/// Reward, state and mode afterwards of a plan's steps.
fn walk(scenario: &Scenario, plan: &[&str]) -> Vec<(f64, Vec<f64>, usize)> {
    let model = &scenario.model;
    let mut world = ProblemWorld::new(scenario);
    let mut draws = Streams::new(1, 0);
    world.reset(&mut draws);
    let mut sensed = Observation::new(model.observation_dim());
    let step = |name: &&str| {
        let step = world.step(model.action_named(name).unwrap(), &mut draws, &mut sensed);
        let shown = Reading::Values(world.state());
        assert_eq!(sensed.reading(), shown, "noiseless sensors show the place");
        (step.reward, world.state().to_vec(), world.mode())
    };
    plan.iter().map(step).collect()
}

fn rewards(walk: &[(f64, Vec<f64>, usize)]) -> Vec<f64> {
    walk.iter().map(|step| step.0).collect()
}

#[test]
fn the_hallway_pays_for_arriving_and_for_the_right_direction() {
    let paid = rewards(&walk(
        &still("basic", &[1.5], 0),
        &["EAST", "EAST", "EAST", "WEST", "WEST"],
    ));
    assert_eq!(paid, [1.0, 11.0, 9.0, 0.0, 0.0]);
    // The world ends just below 4, as its bounds exclude their upper end; from there WEST leads just below 3.
    let inner = rewards(&walk(
        &still("basic-inner", &[1.75], 0),
        &["EAST", "EAST", "WEST", "WEST"],
    ));
    assert_eq!(inner, [11.0, 0.0, 11.0, 0.0]);
}

#[test]
fn a_load_is_taken_on_arrival() {
    let scenario = still("cart-load-unload", &[1.5], 0);
    let steps = walk(&scenario, &["WEST", "EAST", "EAST", "EAST", "WEST", "EAST"]);
    assert_eq!(rewards(&steps), [20.0, 0.0, 0.0, 20.0, 0.0, 0.0]);
    assert_eq!(
        steps.iter().map(|step| step.2).collect::<Vec<_>>(),
        [1, 1, 1, 0, 0, 0]
    );
}

#[test]
fn the_maze_pays_at_its_corner_and_for_no_wall() {
    let scenario = still("maze-4x4", &[2.5, 1.5], 0);
    assert_eq!(
        rewards(&walk(&scenario, &["SOUTH", "EAST", "EAST", "NORTH"])),
        [0.0, 10.0, 9.0, 0.0]
    );
}

#[test]
fn stations_match() {
    let scenario = still("stations-5x5", &[1.5, 3.5], 0);
    let steps = walk(
        &scenario,
        &["WEST", "NORTH", "SOUTH", "SOUTH", "SOUTH", "SOUTH", "EAST"],
    );
    // WEST: toward L1; NORTH: toward it and into it; then down to U1; then EAST, toward L2 from the wrong half.
    assert_eq!(rewards(&steps), [2.0, 12.0, 2.0, 2.0, 2.0, 12.0, 1.0]);
    assert_eq!(
        steps.iter().map(|step| step.2).collect::<Vec<_>>(),
        [0, 1, 1, 1, 1, 0, 0]
    );
    let wrong = still("stations-5x5", &[0.5, 1.5], 2);
    let steps = walk(&wrong, &["SOUTH", "WEST", "EAST"]);
    assert_eq!(
        rewards(&steps),
        [2.0, -1.0, 2.0],
        "U1 does not take a load from L2"
    );
}

#[test]
fn the_shuttle_moves_the_way_it_faces_and_docks_backwards() {
    let scenario = still("shuttle-blind", &[0.5], 0);
    let plan = [
        "MOVE", "MOVE", "TURN", "TURN", "TURN", "MOVE", "MOVE", "MOVE", "TURN",
    ];
    let steps = walk(&scenario, &plan);
    let places: Vec<f64> = steps.iter().map(|step| step.1[0]).collect();
    assert_eq!(places, [1.5, 2.5, 2.5, 2.5, 2.5, 1.5, 0.5, 0.0, 0.0]);
    // The first turn attaches; the next two do not, as this dock was visited last; a MOVE into a station costs 10.
    assert_eq!(
        rewards(&steps),
        [0.0, 0.0, 10.0, 0.0, 0.0, 0.0, 0.0, -10.0, 10.0]
    );
    // The agent's own model has no idea of it.
    assert_eq!(scenario.model.displacement(0, 0)[0], 0.0);
}

#[test]
fn a_uniform_start_fills_its_box_and_is_believed_by_its_moments() {
    let scenario = scenario("stations-5x5");
    let start = &scenario.model.start[0];
    assert_eq!(start.shape, StartShape::Uniform);
    assert_eq!(start.mean.as_slice(), [2.5, 2.5]);
    assert!(
        (start.covariance[(0, 0)] - 25.0 / 12.0).abs() < 1e-12 && start.covariance[(0, 1)] == 0.0
    );
    let mut world = ProblemWorld::new(&scenario);
    let count = 4_000;
    let (mut sum, mut fourth) = ([0.0; 2], 0.0);
    for episode in 0..count {
        world.reset(&mut Streams::new(9, episode));
        for (i, sum) in sum.iter_mut().enumerate() {
            let x = world.state()[i];
            assert!((0.0..5.0).contains(&x));
            *sum += x;
        }
        fourth += (world.state()[0] - 2.5_f64).powi(4);
    }
    // Standard errors 0.023 and 0.16: four of them, error rate 6e-5 each. A Gaussian of this variance has a fourth moment of 13.
    for sum in sum {
        assert!((sum / count as f64 - 2.5).abs() < 0.092);
    }
    assert!((fourth / count as f64 - 2.5_f64.powi(4) / 5.0).abs() < 0.65);
}

/// The planner's expected reward and chances are what the world does, on average over the belief, where no wall is near.
#[test]
fn expected_rewards_after_the_move_are_averages_of_the_world() {
    let Scenario {
        mut model, truth, ..
    } = scenario("cart-load-unload");
    model.state[0].bounds = Interval::new(-50.0, 50.0);
    let mdp = BeliefMdp::new(&model);
    let level = mdp.levels().steady(mdp.start().stratum, 0).unwrap();
    for (mean, mode, action) in [(1.4, 0, 1), (2.3, 1, 0), (0.4, 0, 0)] {
        let mut start = model.start.clone();
        start[0].shape = StartShape::Normal;
        start[0].mode = mode;
        start[0].mean[0] = mean;
        start[0].covariance = mdp.covariance(level).clone();
        let there = Scenario {
            model: model.clone(),
            truth: Truth {
                start: Some(start),
                ..truth.clone()
            },
            rule: None,
        };
        let mut world = ProblemWorld::new(&there);
        let (mut paid, mut switched) = (0.0, 0.0);
        let count = 4_000;
        for episode in 0..count {
            let mut draws = Streams::new(11, episode);
            world.reset(&mut draws);
            paid += world
                .step(action, &mut draws, &mut Observation::new(1))
                .reward
                / count as f64;
            switched += f64::from(world.mode() != mode) / count as f64;
        }
        let expected = mdp.reward(mode, level, &[mean], action);
        let outcomes = mdp.outcomes(mode, level, &[mean], action);
        let change: f64 = outcomes
            .iter()
            .filter(|o| o.mode != mode)
            .map(|o| o.probability)
            .sum();
        assert!((outcomes.iter().map(|o| o.probability).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(outcomes.iter().all(|o| o.then == Then::Continue));
        // Four standard errors of a share in 4000 draws are at most 0.032.
        assert!(
            (switched - change).abs() < 0.032,
            "{switched} against {change}"
        );
        assert!(
            (paid - expected).abs() < 20.0 * 0.032,
            "{paid} against {expected}"
        );
    }
}

#[test]
fn a_filter_switches_by_the_mean_before_or_after() {
    let model = scenario("cart-load-unload").model;
    let mdp = BeliefMdp::new(&model);
    let switch = |when| Switch {
        actions: Some(vec![1]),
        mode: Some(0),
        region: Region::new(vec![(0, Interval::new(0.0, 1.0))]),
        when,
        steps: Steps::ALL,
        becomes: 1,
    };
    let modes = |when: When| -> Vec<usize> {
        let filter = Filter::with_switches(&model, mdp.levels(), mdp.start(), vec![switch(when)]);
        let mut belief = Belief {
            mode: 0,
            stratum: 0,
            mean: vec![1.5],
        };
        let mut modes = Vec::new();
        for (action, sensed) in [(0, 1.5), (1, 0.5), (1, 0.5), (1, 0.5)] {
            filter.update(&mut belief, action, &[sensed], &mut [0.0]);
            modes.push(belief.mode);
            if action == 0 {
                belief.mean[0] = 1.5;
            }
        }
        modes
    };
    assert_eq!(modes(When::After), [0, 1, 1, 1]);
    assert_eq!(modes(When::Before), [0, 0, 1, 1]);
}

/// A belief that knows of walls does not expect to have walked through one.
#[test]
fn predictions_stop_at_walls() {
    let model = scenario("basic").model;
    let mdp = BeliefMdp::new(&model);
    let filter = mdp.filter();
    let level = mdp.levels().steady(mdp.start().stratum, 0).unwrap();
    let mut belief = Belief {
        mode: 0,
        stratum: level,
        mean: vec![3.9],
    };
    filter.update(&mut belief, 0, &[3.2], &mut [0.0]);
    let gain = mdp.levels().step(level, 0).correction.gain[0];
    let wall = 4.0_f64.next_down();
    assert!((belief.mean[0] - (wall + gain * (3.2 - wall))).abs() < 1e-12);
}
