//! What is true reaches no planner: whatever a model file says of the world, plan and automaton are the same to the last byte.
#![allow(clippy::unwrap_used)]

mod common;

use common::{short, small};
use pilotage::belief::Belief;
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario, Truth};
use pilotage::solve::{Form, Registry, Solution, Solved, solve};

/// A model, and what `[world]` may say beside it.
struct Case {
    model: &'static str,
    /// What stays of the file's own `[world]`, because the model is made of it.
    own: &'static str,
    worlds: &'static [&'static str],
}

/// For one state variable that has bounds from 0 to 4 and one control.
const LINE: &[&str] = &[
    "[world]\nwalls = \"none\"",
    "[world]\nwalls = \"clamp\"",
    "[world.start]\nmean = [3.3]\ncovariance = [[0.01]]",
    "[world.start]\nuniform = { x = [1.0, 4.0] }",
    "[[world.start]]\nweight = 0.9\nmean = [0.5]\ncovariance = [[0.0]]\n[[world.start]]\nweight = 0.1\nmean = [3.5]\ncovariance = [[2.0]]",
    "[world.motion]\nnoise = [[0.01]]",
    "[world.motion]\nnoise = [[3.0]]",
    "[[world.motion.control]]\naction = \"EAST\"\nu = [-1.0]",
    "[[world.motion.control]]\nu = [0.3]",
    "[world]\nwalls = \"clamp\"\n[world.start]\nmean = [3.9]\ncovariance = [[0.5]]\n[world.motion]\nnoise = [[0.9]]\n[[world.motion.control]]\naction = \"WEST\"\nu = [0.5]",
    "[world]\nkind = \"robot\"\n[world.start]\nmean = [2.0]\ncovariance = [[0.0]]\n[world.robot]\ncell = 0.25\nradius = 0.05\naxle = 0.08\nspeed = 0.15\ntick = 0.032\nslip = 0.3\ncompass_noise = 0.02\nrange_noise = 0.177\nrange = 1.0",
    "[world]\nkind = \"robot\"\n[world.start]\nmean = [2.0]\ncovariance = [[0.0]]\n[world.robot]\ncell = 1.0\nradius = 0.1\naxle = 0.1\nspeed = 0.3\ntick = 0.1\nslip = 0.0\ncompass_noise = 0.0\nrange_noise = 0.0\nrange = 4.0",
];

/// The parameters of the cart and pole that `motion.linearise` makes a model of.
const POLE: &str = "[world.cart-pole]\ncart_mass = 0.5\npole_mass = 0.2\nfriction = 0.1\nlength = 0.3\ninertia = 0.006\ngravity = 9.8\nstep = 0.02\nforce_noise = 0.45";

const CASES: &[Case] = &[
    line("corridor-blind"),
    line("corridor-unbounded"),
    line("corridor"),
    line("corridor-declare"),
    line("basic"),
    Case {
        model: "tiger",
        own: "",
        worlds: &[
            "[world]\nwalls = \"clamp\"",
            "[world.start]\nmean = [1.0]\ncovariance = [[0.0]]",
            "[[world.start]]\nweight = 0.2\nmean = [-1.0]\ncovariance = [[0.0]]\n[[world.start]]\nweight = 0.8\nmean = [1.0]\ncovariance = [[0.0]]",
            "[world.motion]\nnoise = [[0.5]]",
            "[[world.motion.control]]\naction = \"LISTEN\"\nu = [1.0]",
        ],
    },
    Case {
        model: "shuttle-blind",
        own: "",
        worlds: &[
            "[world]\nwalls = \"clamp\"",
            "[world.start]\nmode = \"west-after-east\"\nuniform = { x = [2.0, 3.0] }",
            "[world.motion]\nnoise = [[0.3]]",
            "[[world.motion.control]]\naction = \"MOVE\"\nmode = \"east-after-west\"\nu = [1.0]\n[[world.motion.control]]\nmode = \"west-after-east\"\nu = [-1.0]",
        ],
    },
    Case {
        model: "maze-4x4",
        own: "",
        worlds: &[
            "[world]\nwalls = \"clamp\"",
            "[world.start]\nmean = [3.5, 3.5]\ncovariance = [[0.0, 0.0], [0.0, 0.0]]",
            "[world.motion]\nnoise = [[0.01, 0.0], [0.0, 2.0]]",
            "[[world.motion.control]]\naction = \"EAST\"\nu = [0.0, 1.0]",
            "[world]\nkind = \"robot\"\n[world.start]\nuniform = { x = [1.0, 3.0], y = [1.0, 3.0] }\n[world.robot]\ncell = 0.25\nradius = 0.05\naxle = 0.08\nspeed = 0.15\ntick = 0.032\nslip = 0.3\ncompass_noise = 0.02\nrange_noise = 0.177\nrange = 1.0",
        ],
    },
    // Other masses, in `world.cart-pole`, would make another model; the rest does not.
    Case {
        model: "cart-pole-sd",
        own: POLE,
        worlds: &[
            "[world]\nkind = \"cart-pole\"",
            "[world]\nwalls = \"clamp\"",
            "[world.start]\nmean = [0.1, 0.0, 0.05, 0.0]\ncovariance = [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]]",
            "[[world.motion.control]]\naction = \"LEFT\"\nu = [-3.0]",
            "[world]\nkind = \"cart-pole\"\n[world.start]\nmean = [0.0, 0.0, 0.0, 0.0]\ncovariance = [[1e-4, 0.0, 0.0, 0.0], [0.0, 1e-4, 0.0, 0.0], [0.0, 0.0, 1e-4, 0.0], [0.0, 0.0, 0.0, 1e-4]]",
        ],
    },
];

const fn line(model: &'static str) -> Case {
    Case {
        model,
        own: "",
        worlds: LINE,
    }
}

impl Case {
    /// The model with this `[world]`.
    fn with(&self, world: &str) -> Scenario {
        let text = scenario::builtin(self.model).unwrap();
        let assumed = text.split("\n[world]").next().unwrap();
        let text = format!("{assumed}\n{world}\n{}\n", self.own);
        scenario::read(&text, self.model).unwrap_or_else(|error| panic!("{error}"))
    }
}

/// All that was planned, as text: the automaton's file, or what a rule does and expects all over the bounds.
fn text_of(scenario: &Scenario, solution: &Solution) -> String {
    let plan = match &solution.policy {
        Solved::Automaton(automaton) => automaton.to_json().unwrap(),
        Solved::Graph(graph) => graph.to_json().unwrap(),
        Solved::Control(_) => panic!("none of these models has a cost"),
        Solved::Rule { policy, updater } => {
            let model = &scenario.model;
            let levels = updater.space(model).strata();
            let at = |k: usize| {
                let share = k as f64 / 10.0;
                let mean = |bounds: pilotage::model::Interval| bounds.low + share * bounds.width();
                Belief {
                    stratum: k % levels,
                    mode: k % model.modes.len(),
                    mean: model.state.iter().map(|s| mean(s.bounds)).collect(),
                }
            };
            let asked = (0..=10).map(|k| (policy.action(&at(k)), policy.value(&at(k))));
            format!("{:?}", asked.collect::<Vec<_>>())
        }
    };
    format!(
        "{plan}\n{:?} {:?} {} {}",
        solution.planned_value,
        solution.policy_convergence_horizon,
        solution.levels,
        solution.converged
    )
}

#[test]
fn no_world_changes_a_plan_or_its_automaton() {
    for case in CASES {
        let base = case.with("");
        let others: Vec<Scenario> = case.worlds.iter().map(|world| case.with(world)).collect();
        for (other, world) in others.iter().zip(case.worlds) {
            assert_eq!(other.model, base.model, "{}: {world}", case.model);
            assert!(
                other.truth != base.truth || *world == "[world]\nwalls = \"none\"",
                "{}: {world} says nothing",
                case.model
            );
        }
        let registry = Registry::builtin();
        let planners = registry.entries().iter().filter(|entry| !entry.learns());
        for planner in planners.filter(|entry| entry.accepts(&base.model).is_ok()) {
            let solver = small(planner, &base.model);
            // Cells take seconds to plan on without optimisation, and those of two variables minutes: one form and one world.
            let cells = planner.name() == "point-based";
            if cells && base.model.state_dim() > 1 {
                continue;
            }
            let (forms, worlds) = match cells {
                true => (&[Form::Tree][..], 1),
                false => (&Form::ALL[..], case.worlds.len()),
            };
            let given = |form: &&Form| solver.gives(**form, &base.model).is_ok();
            for &form in forms.iter().filter(given) {
                let planned = |scenario: &Scenario| {
                    let solution = solve(&solver, scenario, &short(form), &Silent).unwrap();
                    text_of(scenario, &solution)
                };
                let expected = planned(&base);
                for (other, world) in others.iter().zip(case.worlds).take(worlds) {
                    assert!(
                        planned(other) == expected,
                        "{} with {} as {} is planned otherwise beside\n{world}",
                        case.model,
                        planner.name(),
                        form.name()
                    );
                }
            }
        }
    }
}

/// The world of which a plan speaks has walls where the belief knows of them, and is otherwise as the model says.
#[test]
fn the_assumed_world_is_what_the_belief_expects() {
    for name in scenario::names() {
        let scenario = scenario::find(name).unwrap();
        let assumed = Scenario::assumed(&scenario.model);
        assumed
            .validate()
            .unwrap_or_else(|fault| panic!("{name}: {fault:?}"));
        assert!(assumed.is_as_assumed(), "{name}");
        assert_eq!(assumed.start(), scenario.model.start, "{name}");
        assert_eq!(scenario.is_as_assumed(), scenario.truth == assumed.truth);
    }
    let as_assumed = |name: &str| scenario::find(name).unwrap().is_as_assumed();
    for (name, expected) in [
        ("corridor-unbounded", true),
        ("corridor", true),
        ("basic", true),
        ("tiger", true),
        ("corridor-blind", false),
        ("shuttle-blind", false),
        ("cart-pole", false),
        ("robot-basic", false),
    ] {
        assert_eq!(as_assumed(name), expected, "{name}");
    }
    let corridor = scenario::find("corridor-unbounded").unwrap();
    assert_eq!(corridor.truth, Truth::default());
}
