//! ARKAQ-learning: what it finds, what it says when there is too much, and that a stopped run ends like one that was not.
#![allow(clippy::unwrap_used)]

mod common;

use std::sync::Mutex;

use common::automata::sealed;
use pilotage::Error;
use pilotage::belief::BeliefMdp;
use pilotage::model::{Interval, Model};
use pilotage::policy::{Automaton, AutomatonRunner, Node, Place};
use pilotage::progress::{Progress, Silent};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Evaluation, Options, evaluate};
use pilotage::solve::Run;
use pilotage::solve::arkaq::{self, Learned, Settings};
use pilotage::solve::value_iteration;
use pilotage::world::{ProblemWorld, World};

const OPTIONS: Options = Options {
    episodes: 500,
    seed: 77,
};

fn scenario(name: &str) -> Scenario {
    scenario::find(name).unwrap_or_else(|error| panic!("{error}"))
}

fn learn_in(
    world: &Scenario,
    told: &Model,
    settings: &Settings,
    observer: &dyn Progress,
) -> pilotage::Result<Learned> {
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(world)) };
    arkaq::learn(told, &worlds, settings, None, observer)
}

fn learn(scenario: &Scenario, settings: &Settings) -> Learned {
    learn_in(scenario, &scenario.model, settings, &Silent).unwrap()
}

fn at(vigilance: f64) -> Settings {
    Settings {
        vigilances: vec![vigilance],
        ..Settings::default()
    }
}

/// Settings of a run that ends soon, wherever it has come.
fn hurried() -> Settings {
    Settings {
        vigilances: vec![0.3, 0.6],
        merge: true,
        lambda: 0.5,
        epoch: 500,
        epoch_per_entry: 1,
        epoch_limit: 4,
        settle: 300,
        trial: 10,
        ..Settings::default()
    }
}

fn earned(scenario: &Scenario, automaton: &Automaton) -> Evaluation {
    let controller = AutomatonRunner::new(automaton);
    evaluate(scenario, &automaton.updater, &controller, OPTIONS, &Silent)
}

fn planned(scenario: &Scenario) -> Evaluation {
    let mdp = BeliefMdp::new(&scenario.model);
    let plan =
        value_iteration::solve(&mdp, &value_iteration::Settings::default(), &Silent).unwrap();
    evaluate(scenario, &plan.mdp().filter(), &plan, OPTIONS, &Silent)
}

#[test]
fn the_hallway_has_few_clusters_at_low_vigilance_and_more_at_high_and_the_goal_is_apart() {
    let scenario = scenario("basic");
    let best = planned(&scenario).discounted.mean;
    let mut clusters = 0;
    for (vigilance, most) in [(0.1, 3), (0.5, 6), (0.9, 30)] {
        let learned = learn(&scenario, &at(vigilance));
        let found = learned.learning.clusters.len();
        assert!(
            clusters < found && found <= most,
            "{found} clusters at {vigilance}"
        );
        clusters = found;
        let rewarded = |share: f64| {
            learned
                .learning
                .clusters
                .iter()
                .filter(move |c| c.rewarded == share)
        };
        assert!(rewarded(1.0).count() >= 1, "no goal at {vigilance}");
        assert_eq!(
            rewarded(0.0).count() + rewarded(1.0).count(),
            found,
            "mixed with the goal"
        );
        // The goal is the cell at the right end; a belief lags behind, so that not all of its clusters need lie there.
        let middle = |share: f64| {
            let places: Vec<f64> = rewarded(share).map(|c| c.centre[0]).collect();
            places.iter().sum::<f64>() / places.len() as f64
        };
        assert!(middle(1.0) > 2.4 && middle(0.0) < 2.4);
        let earned = earned(&scenario, &learned.automaton).discounted.mean;
        assert!(earned >= 0.97 * best, "{earned} of {best} at {vigilance}");
    }
}

#[test]
fn a_hidden_load_becomes_states_in_the_same_cluster_with_opposite_actions() {
    let scenario = scenario("cart-load-unload");
    let learned = learn(&scenario, &at(0.7));
    let best = planned(&scenario).discounted.mean;
    let earned = earned(&scenario, &learned.automaton).discounted.mean;
    assert!(earned >= 0.85 * best, "{earned} of {best}");
    // In the middle, a node that goes east and one that goes west.
    let inside =
        |node: &&Node| matches!(&node.place, Place::Point(x) if (1.2..2.8).contains(&x[0]));
    let nodes: Vec<&Node> = learned.automaton.nodes.iter().filter(inside).collect();
    let opposite = nodes.iter().any(|a| {
        nodes
            .iter()
            .any(|b| a.place == b.place && a.action != b.action)
    });
    assert!(opposite, "{nodes:?}");
    // One that forgets cannot tell.
    let forgetful = Settings {
        depth: 0,
        ..at(0.7)
    };
    let without = self::earned(&scenario, &learn(&scenario, &forgetful).automaton)
        .discounted
        .mean;
    assert!(without < 0.7 * best, "{without} of {best}");
}

#[test]
fn merging_leaves_fewer_nodes_and_loses_nothing() {
    let scenario = scenario("cart-load-unload");
    let merging = Settings {
        merge: true,
        ..at(0.7)
    };
    let (learned, merged) = (learn(&scenario, &at(0.7)), learn(&scenario, &merging));
    assert_eq!(learned.learning.clusters, merged.learning.clusters);
    assert!(4 * merged.automaton.nodes.len() <= learned.automaton.nodes.len());
    let [before, after] = [&learned, &merged].map(|l| earned(&scenario, &l.automaton).discounted);
    // Merging may cost a hundredth in its own trials; the rest is what 500 episodes leave open.
    let open = 4.0 * (before.stderr + after.stderr);
    assert!(
        after.mean >= 0.99 * before.mean - open,
        "{after:?} after {before:?}"
    );
}

#[test]
fn too_many_states_end_exploration_with_a_clear_statement() {
    struct Notes(Mutex<Vec<String>>);
    impl Progress for Notes {
        fn note(&self, message: &str) {
            self.0.lock().unwrap().push(message.to_owned());
        }
    }
    let scenario = scenario("cart-pole-sd");
    let settings = Settings {
        state_limit: 40,
        epoch_limit: 2,
        ..at(0.9)
    };
    let notes = Notes(Mutex::default());
    let learned = learn_in(&scenario, &scenario.model, &settings, &notes).unwrap();
    assert!(learned.learning.capped && !learned.converged);
    assert_eq!(learned.automaton.nodes.len(), 40);
    let notes = notes.0.into_inner().unwrap();
    let said = notes
        .iter()
        .any(|note| note.contains("limit of 40 states") && note.contains("state_limit"));
    assert!(said, "{notes:?}");
}

#[test]
fn vigilance_that_tunes_itself_stops_at_the_limit_and_keeps_the_best() {
    let scenario = scenario("cart-load-unload");
    let settings = Settings {
        vigilances: vec![0.1, 0.5, 0.9, 0.95],
        state_limit: 60,
        ..Settings::default()
    };
    let learned = learn(&scenario, &settings);
    // At 0.1 loaded and empty are told apart poorly; 0.9 needs too many, so that 0.95 is not tried.
    assert!(learned.learning.vigilance > 0.1);
    assert!(
        learned
            .learning
            .curve
            .iter()
            .any(|point| point.vigilance == 0.9)
    );
    assert!(
        learned
            .learning
            .curve
            .iter()
            .all(|point| point.vigilance < 0.95)
    );
}

#[test]
fn an_automaton_runs_from_its_file_as_it_was_learned() {
    let scenario = scenario("cart-load-unload");
    let learned = learn(&scenario, &hurried());
    let text = learned.automaton.to_json().unwrap();
    let read = Automaton::from_json(&text, "test").unwrap();
    assert_eq!(read, learned.automaton);
    assert_eq!(
        earned(&scenario, &read),
        earned(&scenario, &learned.automaton)
    );
    // A mode that there is none of makes a damaged file.
    let mut damaged: serde_json::Value = serde_json::from_str(&text).unwrap();
    let next = damaged
        .pointer_mut("/policy/memory/recall/next/0/0/0")
        .unwrap();
    *next = learned.automaton.modes.len().into();
    let error = Automaton::from_json(&sealed(damaged), "test").unwrap_err();
    assert!(
        error.to_string().contains("memory.recall.next[0][0][0]"),
        "{error}"
    );
}

#[test]
fn a_run_is_its_seed_and_a_resumed_one_ends_like_one_never_stopped() {
    let scenario = scenario("cart-load-unload");
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
    let whole = learn(&scenario, &hurried());
    assert_eq!(whole, learn(&scenario, &hurried()));
    let other = Settings {
        seed: 2,
        ..hurried()
    };
    assert_ne!(
        whole.learning.curve,
        learn(&scenario, &other).learning.curve
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint");
    let course = |settings: &Settings| arkaq::course(&scenario.model, &worlds, settings).unwrap();
    let mut run = Run::new(course(&hurried())).unwrap();
    while run.step(&Silent).unwrap().is_continue() {
        run.save(&path).unwrap();
        run = Run::resume(course(&hurried()), &path).unwrap();
    }
    assert_eq!(run.learned(), whole);
    // Another's checkpoint is refused.
    assert!(matches!(
        Run::resume(course(&other), &path).map(|_| ()),
        Err(Error::Checkpoint { .. })
    ));
}

/// The learner is told neither rewards nor events: a model without them makes no difference.
#[test]
fn rewards_and_map_are_learned_and_not_read() {
    let world = scenario("cart-load-unload");
    let mut told = world.model.clone();
    told.rewards.clear();
    told.events.clear();
    let (all, little) = (
        learn_in(&world, &world.model, &hurried(), &Silent).unwrap(),
        learn_in(&world, &told, &hurried(), &Silent).unwrap(),
    );
    assert_eq!(all.learning.curve, little.learning.curve);
    assert_eq!(all.automaton.nodes, little.automaton.nodes);
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let bad = [
        (
            "vigilance",
            Settings {
                vigilances: vec![1.5],
                ..Settings::default()
            },
        ),
        (
            "vigilance",
            Settings {
                vigilances: vec![f64::NAN],
                ..Settings::default()
            },
        ),
        (
            "vigilances",
            Settings {
                vigilances: Vec::new(),
                ..Settings::default()
            },
        ),
        (
            "vigilances",
            Settings {
                vigilances: vec![0.5, 0.5],
                ..Settings::default()
            },
        ),
        (
            "rate",
            Settings {
                rate: -0.1,
                ..Settings::default()
            },
        ),
        (
            "depth",
            Settings {
                depth: 17,
                ..Settings::default()
            },
        ),
        (
            "notable",
            Settings {
                notable: 0.0,
                ..Settings::default()
            },
        ),
        (
            "state_limit",
            Settings {
                state_limit: 0,
                ..Settings::default()
            },
        ),
        (
            "lambda",
            Settings {
                lambda: 1.1,
                ..Settings::default()
            },
        ),
        (
            "cold",
            Settings {
                cold: 2.0,
                ..Settings::default()
            },
        ),
        (
            "trial",
            Settings {
                trial: 1,
                ..Settings::default()
            },
        ),
    ];
    let scenario = scenario("basic");
    for (name, settings) in bad {
        let error = learn_in(&scenario, &scenario.model, &settings, &Silent).unwrap_err();
        assert!(
            matches!(error, Error::Setting { setting, .. } if setting == name),
            "{name}: {error}"
        );
    }
}

#[test]
fn a_world_without_bounds_is_refused() {
    let mut scenario = scenario("basic");
    scenario.model.state[0].bounds = Interval::ALL;
    let error = learn_in(&scenario, &scenario.model, &hurried(), &Silent).unwrap_err();
    assert!(error.to_string().contains("state.bounds"), "{error}");
}
