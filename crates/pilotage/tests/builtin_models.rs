//! The built-in models read, and say what they should.
#![allow(clippy::unwrap_used)]

use nalgebra::{DMatrix, DVector};
use pilotage::model::{Interval, Model, Region, Then};
use pilotage::scenario::{self, Scenario, Simulator, Walls};

fn scenario(name: &str) -> Scenario {
    scenario::find(name).unwrap_or_else(|error| panic!("{error}"))
}

fn model(name: &str) -> Model {
    scenario(name).model
}

fn action_names(model: &Model) -> Vec<&str> {
    model
        .actions
        .iter()
        .map(|action| action.name.as_str())
        .collect()
}

#[test]
fn every_built_in_model_reads_under_its_own_name() {
    for name in scenario::names() {
        assert_eq!(model(name).name, name);
    }
}

#[test]
fn every_model_file_of_the_workspace_is_built_in() {
    let files = |folder: &str| {
        let folder = format!("{}/models/{folder}", env!("CARGO_MANIFEST_DIR"));
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .filter_map(|entry| {
                entry
                    .unwrap()
                    .file_name()
                    .to_str()?
                    .strip_suffix(".toml")
                    .map(str::to_owned)
            })
            .collect();
        files.sort();
        files
    };
    let mut gallery: Vec<&str> = scenario::gallery_names().collect();
    let mut names: Vec<&str> = scenario::names().collect();
    assert!(names.ends_with(&gallery));
    names.truncate(names.len() - gallery.len());
    names.sort();
    gallery.sort();
    assert_eq!(files(""), names);
    assert_eq!(files("gallery"), gallery);
}

#[test]
fn the_gallery_and_light_and_dark_have_rules_of_thumb() {
    let dark = [
        "light-dark-5",
        "light-dark-10",
        "light-dark-simple",
        "light-dark-2d",
        "beacons-2d",
        "light-dark-binary",
    ];
    for name in scenario::gallery_names().chain(dark) {
        let Scenario { model, rule, .. } = scenario(name);
        let rule = rule.unwrap_or_else(|| panic!("{name} has none"));
        let start = &model.start[0];
        let mean = start.mean.as_slice();
        let deviations: Vec<f64> = start
            .covariance
            .diagonal()
            .iter()
            .map(|v| v.sqrt())
            .collect();
        let weights = vec![1.0 / model.modes.len() as f64; model.modes.len()];
        let action = rule.action(mean, &deviations, &weights, 0);
        assert!(action < model.actions.len(), "{name}");
        assert!(model.discount < 1.0, "{name}");
    }
    assert_eq!(scenario("corridor-blind").rule, None);
    let fingerprint = model("thermostat").fingerprint();
    let text = scenario::builtin("thermostat").unwrap();
    let other = text.replacen("20.5", "19.5", 1);
    let other = scenario::read(&other, "thermostat").unwrap();
    assert_ne!(other.rule, scenario("thermostat").rule);
    assert_eq!(other.model.fingerprint(), fingerprint);
}

#[test]
fn the_corridor() {
    let Scenario {
        model: corridor,
        truth,
        ..
    } = scenario("corridor-blind");
    assert_eq!(action_names(&corridor), ["EAST", "WEST", "STOP"]);
    assert_eq!(corridor.state[0].bounds, Interval::new(0.0, 4.0));
    assert_eq!(
        corridor.rewards[0].region,
        Region::new(vec![(0, Interval::new(3.0, 4.0))])
    );
    assert_eq!((truth.walls, corridor.episode.length), (Walls::Clamp, 60));
    assert_eq!(scenario("corridor-unbounded").truth.walls, Walls::None);
}

/// Reward of an action at a state in the first mode.
fn reward(model: &Model, action: &str, state: &[f64]) -> f64 {
    let action = model.action_named(action).unwrap();
    let terms = model
        .rewards
        .iter()
        .filter(|reward| reward.applies(0, action) && reward.region.contains(state));
    terms.map(|reward| reward.value).sum()
}

#[test]
fn declaring_ends_the_episode_and_pays_at_the_goal_only() {
    let declare = model("corridor-declare");
    assert_eq!(
        declare.actions[declare.action_named("DECLARE").unwrap()].then,
        Then::End
    );
    let paid = [-7.0, 2.9, 3.0, 3.9, 4.0, 11.0].map(|x| reward(&declare, "DECLARE", &[x]));
    assert_eq!(paid, [-10.0, -10.0, 10.0, 10.0, -10.0, -10.0]);
    assert_eq!(reward(&declare, "STOP", &[3.5]), -0.01);
}

#[test]
fn the_tiger_sits_behind_one_door_and_does_not_move() {
    for (name, noise) in [("tiger", 0.625), ("tiger-sd", 0.625 * 0.625)] {
        let tiger = model(name);
        assert_eq!(action_names(&tiger), ["LISTEN", "OPEN-LEFT", "OPEN-RIGHT"]);
        assert_eq!(tiger.sensor.noise[0], noise);
        assert_eq!(
            tiger
                .start
                .iter()
                .map(|s| (s.weight, s.mean[0]))
                .collect::<Vec<_>>(),
            [(0.5, -1.0), (0.5, 1.0)]
        );
        assert!((0..3).all(|action| tiger.displacement(action, 0)[0] == 0.0
            && tiger.motion_noise(action, 0)[0] == 0.0));
        assert_eq!(reward(&tiger, "OPEN-LEFT", &[-1.0]), -100.0);
        assert_eq!(reward(&tiger, "OPEN-LEFT", &[1.0]), 10.0);
        assert_eq!(reward(&tiger, "OPEN-RIGHT", &[1.0]), -100.0);
        assert_eq!(reward(&tiger, "LISTEN", &[1.0]), -1.0);
    }
}

#[test]
fn the_mazes_have_the_same_goal_and_bounds() {
    let (walled, unbounded) = (model("maze-2d"), model("maze-2d-unbounded"));
    assert_eq!(walled.state, unbounded.state);
    assert_eq!(walled.rewards, unbounded.rewards);
    assert_eq!(
        action_names(&walled),
        ["NORTH", "EAST", "SOUTH", "WEST", "STOP"]
    );
    assert_eq!(reward(&walled, "STOP", &[3.5, 0.5]), 1.0);
}

/// Reward and next state and mode of one step without noise.
fn step(model: &Model, name: &str, x: f64, mode: usize) -> (f64, f64, usize) {
    let action = model.action_named(name).unwrap();
    let event = model
        .events
        .iter()
        .find(|event| event.applies(mode, action) && event.region.contains(&[x]));
    let next = model.state[0]
        .bounds
        .clamp(x + model.displacement(action, 0)[0]);
    (
        event.map_or(0.0, |event| event.reward),
        next,
        event.and_then(|event| event.becomes).unwrap_or(mode),
    )
}

#[test]
fn a_cycle_of_loading_takes_ten_steps_and_pays_twice() {
    let model = model("load-unload");
    let plan = [
        "LOAD", "EAST", "EAST", "EAST", "EAST", "UNLOAD", "WEST", "WEST", "WEST", "WEST",
    ];
    let (mut x, mut mode, mut paid) = (model.start[0].mean[0], model.start[0].mode, 0.0);
    for action in plan {
        let (reward, next, next_mode) = step(&model, action, x, mode);
        (x, mode, paid) = (next, next_mode, paid + reward);
    }
    assert_eq!((x, mode, paid), (0.0, 0, 2.0));
}

#[test]
fn the_cart_and_pole_are_held_exactly_over_a_step() {
    for (name, force, sensor) in [
        ("cart-pole", 0.45, 0.05),
        ("cart-pole-sd", 0.45 * 0.45, 0.05 * 0.05),
        ("cart-pole-noisy", 0.45, 0.15),
        ("cart-pole-noisy-sd", 0.45 * 0.45, 0.15 * 0.15),
    ] {
        let Scenario {
            model: pole, truth, ..
        } = scenario(name);
        let mut eigenvalues: Vec<f64> = pole
            .motion
            .a
            .complex_eigenvalues()
            .iter()
            .map(|value| value.re)
            .collect();
        eigenvalues.sort_by(f64::total_cmp);
        for (found, expected) in eigenvalues.iter().zip([0.8940, 0.9971, 1.0, 1.1177]) {
            assert!((found - expected).abs() < 5e-5, "{eigenvalues:?}");
        }
        let b = DMatrix::from_column_slice(4, 1, &[3.6328e-4, 3.6314e-2, 9.0893e-4, 9.0933e-2]);
        assert!((&pole.motion.b - &b).amax() < 5e-7, "{}", pole.motion.b);
        let noise =
            &pole.motion.b * force * pole.motion.b.transpose() + DMatrix::identity(4, 4) * 1e-9;
        assert!((&pole.motion.noise - noise).amax() < 1e-15);
        assert!((&pole.sensor.noise - DMatrix::identity(4, 4) * sensor).amax() < 1e-15);
        assert!(matches!(truth.simulator, Simulator::CartPole(_)));
        assert_eq!(truth.start.unwrap()[0].mean, DVector::zeros(4));
    }
}

#[test]
fn actions_keep_the_order_of_the_file() {
    let text = scenario::builtin("corridor-blind").unwrap();
    let east = "EAST = { u = [1.0] }\n";
    let last = text
        .replacen(east, "", 1)
        .replacen("STOP =", "ZIGZAG = { u = [0.5] }\nSTOP =", 1);
    let tables = last.replacen("[[reward]]", "[actions.EAST]\nu = [1.0]\n\n[[reward]]", 1);
    let reordered = scenario::read(&tables, "reordered").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        action_names(&reordered.model),
        ["WEST", "ZIGZAG", "STOP", "EAST"]
    );
}
