//! What a plan promises is what it earns where its model holds, or it says why not; what cannot be planned for is an error.
#![allow(clippy::unwrap_used)]

mod common;

use common::hallway;
use pilotage::belief::BeliefMdp;
use pilotage::model::{Model, Steps};
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::Options;
use pilotage::solve::value_iteration::Settings;
use pilotage::solve::{Earned, Form, Request, Solution, ValueIteration, plan};

fn planned(scenario: &Scenario, form: Form) -> pilotage::Result<Solution> {
    let request = Request::form(form);
    plan(
        &ValueIteration::default(),
        &scenario.model,
        &request,
        &Silent,
    )
}

/// Few points, whatever is paid.
fn coarse() -> ValueIteration {
    ValueIteration {
        grid: Settings {
            points: Some(41),
            ..Settings::default()
        },
    }
}

fn earned(scenario: &Scenario, solution: &Solution) -> Earned {
    let options = Options {
        episodes: 4000,
        seed: 5,
    };
    solution.earned(scenario, options, &Silent).unwrap()
}

/// Planned, and what is earned where the model holds, within three standard errors and 1 %.
fn keeps(scenario: &Scenario, form: Form) -> f64 {
    let solution = planned(scenario, form).unwrap();
    let planned = solution.planned_value.unwrap();
    let earned = earned(scenario, &solution);
    let assumed = earned.assumed.discounted;
    let allowed = 1e-9 + 3.0 * assumed.stderr + 0.01 * planned.abs().max(assumed.mean.abs());
    assert!(
        (planned - assumed.mean).abs() <= allowed,
        "planned {planned}, earned {assumed:?}"
    );
    assert_eq!(earned.remarks, Vec::<String>::new());
    planned
}

#[test]
fn a_hallway_earns_what_is_planned() {
    keeps(&hallway(&[]), Form::Nearest);
    keeps(
        &hallway(&[("noise = [[0.4]]", "noise = [[2.0]]")]),
        Form::Grid,
    );
}

#[test]
fn a_plan_ends_with_the_episode() {
    // Five steps lead from 1 to the goal, and are too few to be paid there.
    for length in [1, 5, 8, 20] {
        let end = format!("[episode]\nlength = {length}\n[start]");
        let scenario = hallway(&[("[start]", &end)]);
        let planned = keeps(&scenario, Form::Grid);
        assert_eq!(planned < 0.3, length <= 5, "{length} steps: {planned}");
    }
}

#[test]
fn a_reward_at_the_last_moment_is_waited_for() {
    // A prize that is only there from the tenth step on, and a smaller one before.
    let prize = "value = 1.0\nsteps = { from = 10 }\n[[reward]]\nin = { x = [0.0, 2.0] }\nvalue = 0.3\nsteps = { until = 8 }";
    let scenario = hallway(&[("value = 1.0", prize)]);
    assert_eq!(scenario.model.clock(), 10);
    let told = keeps(&scenario, Form::Grid);
    keeps(&scenario, Form::Nearest);
    // With the prize there from the start, nobody waits.
    let always = hallway(&[("value = 1.0", "value = 1.0\nsteps = { from = 0 }")]);
    assert_eq!(always.model.clock(), 0);
    assert!(keeps(&always, Form::Grid) > told);
    let learned: Vec<Steps> = scenario
        .model
        .rewards
        .iter()
        .map(|term| term.steps)
        .collect();
    assert!(learned[0].contains(10) && !learned[0].contains(9) && !learned[1].contains(8));
}

#[test]
fn cost_is_a_reward_like_any_other() {
    let cost = "[cost]\nstate = [[0.01]]\ncontrol = [[0.2]]\n[start]";
    let (free, dear) = (hallway(&[]), hallway(&[("[start]", cost)]));
    let (free, dear) = (keeps(&free, Form::Grid), keeps(&dear, Form::Grid));
    assert!(dear < free - 1.0, "{free} and {dear}");
}

#[test]
fn a_cost_without_discount_is_planned_over_its_episode() {
    let scenario = scenario::find("scalar-lqg").unwrap();
    let planned = keeps(&scenario, Form::Grid);
    // A free control earns -32.501; three actions cannot earn more.
    assert!(planned < -32.5 && planned > -50.0, "{planned}");
}

#[test]
fn without_noise_the_plan_is_exact() {
    let still = |step: &str, start: &str| {
        hallway(&[
            ("noise = [[0.1]]", "noise = [[0.0]]"),
            ("covariance = [[0.5]]", "covariance = [[0.0]]"),
            ("u = [1.0]", &format!("u = [{step}]")),
            ("u = [-1.0]", &format!("u = [-{step}]")),
            ("mean = [1.0]", &format!("mean = [{start}]")),
        ])
    };
    // Steps to the goal, whose discount is earned for ever after: 0.9^k / 0.1, but for the end of the episode.
    let ever = |steps: i32| (0.9_f64.powi(steps) - 0.9_f64.powi(100)) / 0.1;
    for (step, start, steps) in [
        ("1.0", "1.0", 5),
        ("0.5", "1.0", 10),
        ("0.25", "1.25", 19),
        ("0.7", "1.3", 7),
        ("2.0", "0.5", 3),
    ] {
        let scenario = still(step, start);
        let planned = keeps(&scenario, Form::Grid);
        assert!(
            (planned - ever(steps)).abs() < 1e-3,
            "{step}: {planned} and {}",
            ever(steps)
        );
        let automaton = keeps(&scenario, Form::Nearest);
        assert!((automaton - planned).abs() < 1e-3);
    }
}

#[test]
fn a_belief_that_is_alive_does_not_count_the_same_error_again() {
    // A slow drift between limits: who is within them now leaves them rarely, however little the filter knows.
    let limits =
        "[episode]\nlength = 60\nalive = { x = [0.0, 10.0] }\nfailure_reward = -2.0\n[start]";
    for (motion, sensor) in [("0.02", "4.0"), ("0.1", "1.0"), ("0.3", "0.5")] {
        let scenario = hallway(&[
            ("[start]", limits),
            ("mean = [1.0]", "mean = [5.0]"),
            ("noise = [[0.1]]", &format!("noise = [[{motion}]]")),
            ("noise = [[0.4]]", &format!("noise = [[{sensor}]]")),
            ("in = { x = [6.0, 7.0] }", "in = { x = [0.0, 1.5] }"),
        ]);
        let solution = planned(&scenario, Form::Grid).unwrap();
        let (planned, earned) = (
            solution.planned_value.unwrap(),
            earned(&scenario, &solution),
        );
        let assumed = earned.assumed.discounted;
        let allowed = 3.0 * assumed.stderr + 0.05 * assumed.mean.abs();
        assert!(
            (planned - assumed.mean).abs() <= allowed,
            "noise {motion}, {sensor}: planned {planned}, earned {assumed:?}"
        );
    }
}

#[test]
fn levels_that_were_cut_make_no_look_worth_more_than_it_tells() {
    let text = scenario::builtin("tiger").unwrap();
    let cut = text.replace(
        "level_tolerance = 1e-4",
        "level_tolerance = 1e-9\nlevel_limit = 4",
    );
    let scenario = scenario::read(&cut, "tiger.toml").unwrap();
    let mdp = BeliefMdp::new(&scenario.model);
    assert!(!mdp.levels().converged());
    let solution = planned(&scenario, Form::Grid).unwrap();
    let planned = solution.planned_value.unwrap();
    let earned = earned(&scenario, &solution);
    // The best with all levels is 4.1065.
    assert!(planned < 4.2, "{planned}");
    assert!(earned.assumed.discounted.mean < 4.1065 + 4.0 * earned.assumed.discounted.stderr);
}

/// What is changed, and parts of what is said.
type Refused = (
    &'static [(&'static str, &'static str)],
    &'static [&'static str],
);

/// What is refused, by what is changed and a part of what is said.
#[test]
fn what_no_plan_sees_is_an_error() {
    let refused: &[Refused] = &[
        (
            &[("in = { x = [6.0, 7.0] }", "in = { x = [60.0, 70.0] }")],
            &["reward 1", "x = [60, 70]", "widen `state.bounds`"],
        ),
        (
            &[
                ("in = { x = [6.0, 7.0] }", "in = { x = [12.0, 14.0] }"),
                ("[start]", "[belief]\nwalls = \"clip\"\n[start]"),
            ],
            &["reward 1", "x = [12, 14]", "from 0 to 10"],
        ),
        (
            &[
                ("value = 1.0", "value = 1e308"),
                ("noise = [[0.1]]", "noise = [[0.1]]\nB = [[1.0]]"),
            ],
            &["is inf", "too large"],
        ),
    ];
    for (changes, said) in refused {
        let error = planned(&hallway(changes), Form::Grid)
            .map(|_| ())
            .unwrap_err()
            .to_string();
        for part in *said {
            assert!(error.contains(part), "`{part}` is not in: {error}");
        }
    }
}

#[test]
fn a_grid_resolves_what_is_paid() {
    let narrow = hallway(&[
        ("bounds = [[0.0, 10.0]]", "bounds = [[0.0, 400.0]]"),
        ("in = { x = [6.0, 7.0] }", "in = { x = [6.0, 6.3] }"),
        ("noise = [[0.4]]", "noise = [[0.0001]]"),
        ("noise = [[0.1]]", "noise = [[0.0001]]"),
    ]);
    // The default becomes as fine as it has to be.
    keeps(&narrow, Form::Grid);
    let error = plan(&coarse(), &narrow.model, &Request::default(), &Silent);
    let error = error.map(|_| ()).unwrap_err().to_string();
    assert!(
        error.contains("reward 1 is 0.3") && error.contains("--grid"),
        "{error}"
    );
}

#[test]
fn a_promise_that_is_not_kept_says_why() {
    for (name, reason) in [
        ("cart-load-unload", "mode"),
        ("n-maze", "told which of its starts"),
    ] {
        let scenario = scenario::find(name).unwrap();
        let request = Request {
            runs: 200,
            ..Request::default()
        };
        let solution = plan(&coarse(), &scenario.model, &request, &Silent).unwrap();
        let earned = earned(&scenario, &solution);
        let said = earned
            .remarks
            .iter()
            .any(|remark| remark.starts_with("planned ") && remark.contains(reason));
        assert!(said, "{name}: {:?}", earned.remarks);
    }
}

#[test]
fn a_plan_that_runs_off_its_grid_says_so() {
    // Going on for ever pays, and the bounds say that there is nothing to be seen there.
    let scenario = hallway(&[
        ("in = { x = [6.0, 7.0] }", "in = { x = [8.0, inf] }"),
        ("STAY = {}", "STAY = { u = [3.0] }"),
    ]);
    let solution = planned(&scenario, Form::Grid).unwrap();
    assert!(
        solution
            .remarks
            .iter()
            .any(|remark| remark.starts_with("grid edge")),
        "{:?}",
        solution.remarks
    );
}

/// A model that is the same but for when it pays is planned by the clock alone.
#[test]
fn the_clock_of_a_model_is_its_last_change() {
    let mut model: Model = hallway(&[]).model;
    assert_eq!(
        (model.clock(), BeliefMdp::new(&model).levels().time(3)),
        (0, 0)
    );
    model.rewards[0].steps = Steps { from: 2, until: 7 };
    let levels = BeliefMdp::new(&model);
    let levels = levels.levels();
    assert_eq!(model.clock(), 7);
    let mut level = levels.starts()[0];
    for step in 0..20 {
        assert_eq!(levels.time(level), step.min(7));
        level = levels.step(level, 0).next;
    }
}
