//! Readings that may be missing, motion and sensor that change in the course of an episode, and modes that change by the clock: the world
//! does it, the filter follows, and the plan counts on it.
#![allow(clippy::unwrap_used)]

mod common;

use common::{HALLWAY, hallway};
use pilotage::belief::{BeliefMdp, Reading};
use pilotage::model::{Clause, ModelBuilder, Phase, Sensor};
use pilotage::policy::{Automaton, AutomatonRunner};
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::Options;
use pilotage::solve::{Form, Request, Solution, ValueIteration, plan};
use pilotage::world::{Observation, ProblemWorld, Streams, World};

fn solved(scenario: &Scenario, form: Form) -> Solution {
    plan(
        &ValueIteration::default(),
        &scenario.model,
        &Request::form(form),
        &Silent,
    )
    .unwrap()
}

/// Planned, and what is earned where the model holds, within three standard errors and 1 %.
fn keeps(scenario: &Scenario, form: Form) -> f64 {
    let solution = solved(scenario, form);
    let planned = solution.planned_value.unwrap();
    let options = Options {
        episodes: 10_000,
        seed: 5,
    };
    let earned = solution.earned(scenario, options, &Silent).unwrap();
    let assumed = earned.assumed.discounted;
    let allowed = 3.0 * assumed.stderr + 0.01 * planned.abs();
    assert!(
        (planned - assumed.mean).abs() <= allowed,
        "planned {planned}, earned {assumed:?}"
    );
    assert_eq!(earned.remarks, Vec::<String>::new());
    planned
}

#[test]
fn a_plan_counts_on_readings_that_may_be_missing() {
    let with = |present: &str| {
        // Few levels do: what is forgotten soonest is told apart first.
        let sensor = format!("noise = [[0.4]]\npresent = {present}\n[belief]\nlevel_limit = 60");
        hallway(&[("noise = [[0.4]]", &sensor)])
    };
    let planned = ["1.0", "0.7", "0.3"].map(|present| keeps(&with(present), Form::Grid));
    assert!(
        planned.windows(2).all(|pair| pair[0] > pair[1]),
        "{planned:?}"
    );
    keeps(&with("0.7"), Form::Nearest);
    // A sensor that always speaks is the model that says nothing about it, to the bit.
    let unsaid = hallway(&[(
        "noise = [[0.4]]",
        "noise = [[0.4]]\n[belief]\nlevel_limit = 60",
    )]);
    let silent = solved(&unsaid, Form::Nearest);
    let spoken = solved(&with("1.0"), Form::Nearest);
    assert_eq!(silent.automaton(), spoken.automaton());
}

#[test]
fn two_doors_are_told_apart_by_what_is_heard_of_them() {
    // The hypotheses of the tiger are kept exactly, whether or not it growls.
    let tiger = scenario::builtin("tiger").unwrap();
    let deaf = tiger.replacen("[sensor]", "[sensor]\npresent = 0.6", 1);
    let scenario = scenario::read(&deaf, "deaf.toml").unwrap();
    let planned = keeps(&scenario, Form::Grid);
    let always = solved(&scenario::find("tiger").unwrap(), Form::Grid);
    assert!(planned < always.planned_value.unwrap());
}

#[test]
fn worlds_are_silent_as_often_as_the_model_says() {
    let scenario = hallway(&[("noise = [[0.4]]", "noise = [[0.4]]\npresent = 0.3")]);
    let mut world = ProblemWorld::new(&scenario);
    let mut draws = Streams::new(3, 0);
    let mut observation = Observation::new(1);
    world.reset(&mut draws);
    let heard = (0..10_000).filter(|_| {
        world.step(2, &mut draws, &mut observation);
        observation.reading() != Reading::Nothing
    });
    // Five standard deviations.
    let heard = heard.count() as f64;
    assert!((heard - 3000.0).abs() < 5.0 * 2100_f64.sqrt(), "{heard}");
}

/// The filter, step by step, beside a Kalman filter that computes its covariance as it goes.
#[test]
fn a_filter_follows_motion_sensor_and_silence_of_every_step() {
    let later = r#"
[[later]]
from = 3
motion = { A = [[0.8]], B = [[2.0]], noise = [[0.3]] }
sensor = { H = [[1.5]], noise = [[0.2]] }
[[later]]
from = 5
sensor = { present = 0.5 }
[[reward]]"#;
    let scenario = hallway(&[("\n[[reward]]", later)]);
    let model = &scenario.model;
    assert_eq!(model.clock(), 5);
    assert_eq!(model.sensor_at(7).noise[0], 0.2, "what is not said stays");
    let mdp = BeliefMdp::new(model);
    let filter = mdp.filter();
    let mut belief = filter.initial();
    let (mut mean, mut variance) = (1.0, 0.5);
    let mut scratch = [0.0];
    for step in 0..12_usize {
        let action = [0, 2, 0, 1, 2, 0][step % 6];
        let (motion, sensor) = (model.motion_at(step), model.sensor_at(step));
        let control = model.actions[action].control[0];
        let (predicted, before) = (
            motion.a[0] * mean + motion.b[0] * control,
            motion.a[0].powi(2) * variance + motion.noise[0],
        );
        let reading = 1.0 + 0.7 * step as f64;
        let silent = step == 6 || step == 9;
        if silent {
            (mean, variance) = (predicted, before);
            filter.update(&mut belief, action, Reading::Nothing, &mut scratch);
        } else {
            let h = sensor.h[0];
            let gain = before * h / (h * h * before + sensor.noise[0]);
            mean = predicted + gain * (reading - h * predicted);
            variance = (1.0 - gain * h) * before;
            filter.update(&mut belief, action, &[reading], &mut scratch);
        }
        // Exact as long as readings always come; then levels within a hundredth of a variance are one.
        let allowed = if step < 5 { 1e-5 } else { 0.02 };
        assert!((belief.mean[0] - mean).abs() < allowed, "step {step}");
        let kept = mdp.covariance(belief.stratum)[0];
        assert!(
            (kept - variance).abs() < allowed * variance,
            "step {step}: {kept} and {variance}"
        );
    }
}

#[test]
fn a_plan_counts_on_what_changes_later() {
    // The ground gets slippery and the sensor fails at step 4; then the way back opens.
    let later = r#"
[[later]]
from = 4
motion = { noise = [[0.6]] }
sensor = { noise = [[3.0]] }
[[later]]
from = 9
motion = { B = [[-1.0]] }
[[reward]]"#;
    let scenario = hallway(&[("\n[[reward]]", later)]);
    keeps(&scenario, Form::Grid);
    keeps(&scenario, Form::Nearest);
    // The same from the start on is another problem, and so is never.
    let planned = |later: &str| {
        let scenario = hallway(&[("\n[[reward]]", later)]);
        solved(&scenario, Form::Grid).planned_value.unwrap()
    };
    let worse = planned("\n[[later]]\nfrom = 4\nsensor = { noise = [[3.0]] }\n[[reward]]");
    let never = planned("\n[[reward]]");
    let at_once = solved(&hallway(&[("[[0.4]]", "[[3.0]]")]), Form::Grid);
    assert!(at_once.planned_value.unwrap() < worse && worse < never);
}

/// A gate that opens at step 6: whoever passes it before is turned away.
#[test]
fn modes_change_by_the_clock() {
    let gate = r#"
[[event]]
action = "STAY"
mode = "outside"
in = { x = [3.0, 10.0] }
steps = { from = 6 }
becomes = "inside"
[[reward]]
mode = "inside"
"#;
    let scenario = hallway(&[
        ("bounds =", "modes = [\"outside\", \"inside\"]\nbounds ="),
        ("\n[[reward]]\n", gate),
        ("noise = [[0.4]]", "noise = [[0.0001]]"),
        ("covariance = [[0.5]]", "covariance = [[0.0001]]"),
        ("noise = [[0.1]]", "noise = [[0.0001]]"),
    ]);
    keeps(&scenario, Form::Grid);
    let solution = solved(&scenario, Form::Nearest);
    let automaton: Automaton = solution.automaton().unwrap().clone();
    // The runner's mode is that of the world at every step, and so it is after a way through the file.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("policy.json");
    automaton.save(&file).unwrap();
    let read = Automaton::load(&file).unwrap();
    assert_eq!(read, automaton);
    let mut runner = AutomatonRunner::new(&read);
    let mut world = ProblemWorld::new(&scenario);
    let mut observation = Observation::new(1);
    let mut draws = Streams::new(1, 0);
    world.reset(&mut draws);
    let mut entered = None;
    for step in 0..15 {
        let (_, action) = runner.decide();
        world.step(action, &mut draws, &mut observation);
        runner.observe(action, observation.reading());
        assert_eq!(runner.belief().mode, world.mode(), "step {step}");
        entered = entered.or((world.mode() == 1).then_some(step));
    }
    assert!(entered.is_some_and(|step| step >= 6), "{entered:?}");
}

/// What no model says still happens: a reading that always comes is missing. The mean is then where it was predicted, at the level
/// whose covariance is closest to the one predicted.
#[test]
fn a_policy_goes_on_without_a_reading() {
    let scenario = hallway(&[]);
    let mdp = BeliefMdp::new(&scenario.model);
    let filter = mdp.filter();
    let mut belief = filter.initial();
    let mut scratch = [0.0];
    for _ in 0..20 {
        let expected = belief.mean[0] + 1.0;
        filter.update(&mut belief, 0, &[expected], &mut scratch);
    }
    let before = belief.clone();
    filter.update(&mut belief, 0, Reading::Nothing, &mut scratch);
    assert!((belief.mean[0] - before.mean[0] - 1.0).abs() < 1e-12);
    let predicted = mdp.covariance(before.stratum)[0] + 0.1;
    let gap = |stratum| (mdp.covariance(stratum)[0] - predicted).abs();
    let closest = (0..mdp.strata()).min_by(|&a, &b| gap(a).total_cmp(&gap(b)));
    assert_eq!(Some(belief.stratum), closest);
    // Lost readings cost something, and not much.
    let policy = solved(&scenario, Form::Nearest)
        .automaton()
        .unwrap()
        .clone();
    let deaf = hallway(&[("noise = [[0.4]]", "noise = [[0.4]]\npresent = 0.8")]);
    let earned = |scenario: &Scenario| {
        let options = Options {
            episodes: 4000,
            seed: 2,
        };
        let runner = AutomatonRunner::new(&policy);
        pilotage::simulate::evaluate(scenario, &policy.updater, &runner, options, &Silent)
            .discounted
            .mean
    };
    let (always, sometimes) = (earned(&scenario), earned(&deaf));
    assert!(
        sometimes < always && sometimes > 0.9 * always,
        "{sometimes} of {always}"
    );
}

#[test]
fn what_makes_no_sense_is_an_error_at_its_place() {
    let cases = [
        (
            "noise = [[0.4]]",
            "noise = [[0.4]]\npresent = 1.5",
            "sensor.present",
        ),
        (
            "noise = [[0.4]]",
            "noise = [[0.4]]\npresent = nan",
            "sensor.present",
        ),
        ("\n[[reward]]", "\n[[later]]\nfrom = 0\n[[reward]]", "later"),
        (
            "\n[[reward]]",
            "\n[[later]]\nfrom = 5\n[[later]]\nfrom = 5\n[[reward]]",
            "later",
        ),
        (
            "\n[[reward]]",
            "\n[[later]]\nfrom = 1\nsensor = { present = -0.1 }\n[[reward]]",
            "present",
        ),
        (
            "\n[[reward]]",
            "\n[[later]]\nfrom = 1\nmotion = { noise = [[-1.0]] }\n[[reward]]",
            "noise",
        ),
        (
            "\n[[reward]]",
            "\n[[later]]\nfrom = 1\nsensor = { H = [[1.0], [2.0]] }\n[[reward]]",
            "H",
        ),
        (
            "\n[[reward]]",
            "\n[[later]]\nfrom = 1\nmotion = { A = [[1.0, 0.0]] }\n[[reward]]",
            "A",
        ),
        ("\n[[reward]]", "\n[[later]]\nform = 1\n[[reward]]", "form"),
        // What would never happen, and what nobody could tell apart.
        (
            "\n[[reward]]",
            "\n[[later]]\nfrom = 100\n[[reward]]",
            "from",
        ),
        (
            "value = 1.0",
            "value = 1.0\nsteps = { from = 1000000000 }",
            "from",
        ),
        (
            "\n[[reward]]",
            "\n[episode]\nlength = 2000000000\n[[later]]\nfrom = 1000000000\n[[reward]]",
            "length",
        ),
    ];
    for (from, to, place) in cases {
        let text = HALLWAY.replacen(from, to, 1);
        let error = scenario::read(&text, "x.toml").map(drop).unwrap_err();
        let said = format!("{error:?}");
        assert!(
            said.contains(place.split('.').next_back().unwrap()),
            "{to}: {said}"
        );
    }
}

/// Who cannot follow says so.
#[test]
fn solvers_that_know_one_sensor_refuse_others() {
    let missing = hallway(&[("noise = [[0.4]]", "noise = [[0.4]]\npresent = 0.5")]);
    let later = hallway(&[(
        "\n[[reward]]",
        "\n[[later]]\nfrom = 4\nsensor = { noise = [[3.0]] }\n[[reward]]",
    )]);
    let registry = pilotage::solve::Registry::builtin();
    for (scenario, word, follow) in [
        (
            &missing,
            "missing",
            &["value-iteration", "qmdp", "mls", "point-based", "arkaq"][..],
        ),
        (&later, "step", &["value-iteration", "arkaq"][..]),
    ] {
        // Codebook leaves linear models to the others.
        let solvers = registry.entries().iter();
        for solver in solvers.filter(|solver| solver.name() != "codebook") {
            match solver.accepts(&scenario.model) {
                Ok(()) => assert!(follow.contains(&solver.name()), "{}", solver.name()),
                Err(error) => {
                    let said = error.to_string();
                    assert!(!follow.contains(&solver.name()), "{said}");
                    assert!(said.contains(word) || solver.name() == "lqg", "{said}");
                }
            }
        }
    }
}

/// What a program builds is what a file says.
#[test]
fn the_builder_says_the_same() {
    let scenario = hallway(&[
        ("noise = [[0.4]]", "noise = [[0.4]]\npresent = 0.7"),
        (
            "\n[[reward]]",
            "\n[[later]]\nfrom = 4\nsensor = { noise = [[3.0]] }\n[[reward]]",
        ),
    ]);
    let model = &scenario.model;
    let phase = Phase {
        from: 4,
        motion: model.motion.clone(),
        sensor: Sensor {
            noise: nalgebra::dmatrix![3.0],
            ..model.sensor.clone()
        },
    };
    let built = ModelBuilder::new("hallway", 0.9)
        .variable("x", 0.0, 10.0)
        .start(&[1.0], &[0.5])
        .motion(&[1.0], &[1.0], &[0.1])
        .sensor(&[1.0], &[0.4])
        .present(0.7)
        .later(phase)
        .action("FORWARD", &[1.0])
        .action("BACK", &[-1.0])
        .action("STAY", &[0.0])
        .reward(1.0, Clause::new().within("x", 6.0, 7.0))
        .build()
        .unwrap();
    assert_eq!(&built, model);
}
