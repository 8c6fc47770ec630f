//! Learners on beliefs that no filter keeps: sums of Gaussians and cells, read as strata and means.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;

use common::scenario;
use pilotage::Error;
use pilotage::model::{Part, TrackerKind};
use pilotage::policy::{Automaton, AutomatonRunner, Matching, Node};
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Options, compare, evaluate};
use pilotage::solve::{Course, Learned, Registry, Run, arkaq, kafaq};
use pilotage::world::{ProblemWorld, World};

fn regions() -> kafaq::Settings {
    kafaq::Settings {
        cells_along: 32,
        strata: 6,
        walks: 50,
        epoch_limit: 12,
        trial: 50,
        ..kafaq::Settings::default()
    }
}

fn clusters() -> arkaq::Settings {
    arkaq::Settings {
        vigilances: vec![0.96],
        state_limit: 400,
        strata: 12,
        walks: 50,
        explore_limit: 10_000,
        epoch_limit: 12,
        trial: 50,
        ..arkaq::Settings::default()
    }
}

fn learn_regions(scenario: &Scenario, settings: &kafaq::Settings) -> Automaton {
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(scenario)) };
    let learned = kafaq::learn(&scenario.model, &worlds, settings, None, &Silent).unwrap();
    learned.automaton
}

fn learn_clusters(scenario: &Scenario, settings: &arkaq::Settings) -> Automaton {
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(scenario)) };
    let learned = arkaq::learn(&scenario.model, &worlds, settings, None, &Silent).unwrap();
    learned.automaton
}

/// The automaton with the belief of another that does one thing always.
fn always(automaton: &Automaton, action: usize) -> Automaton {
    let node = &automaton.nodes[0];
    let levels = 0..=automaton.levels.len() - 1;
    Automaton {
        nodes: vec![Node::new(levels, 0, node.place.clone(), action, None)],
        ..automaton.clone()
    }
}

/// That it surely earns more than doing any one thing always, in the same episodes.
fn beats_one_thing_always(scenario: &Scenario, automaton: &Automaton) {
    let options = Options {
        episodes: 300,
        seed: 5,
    };
    for action in 0..scenario.model.actions.len() {
        let difference = compare(
            scenario,
            &automaton.updater,
            &AutomatonRunner::new(automaton),
            &AutomatonRunner::new(&always(automaton, action)),
            options,
            &Silent,
        );
        let surely = difference.mean > 5.0 * difference.stderr;
        assert!(
            surely,
            "{} {}: {action} {difference:?}",
            automaton.problem, automaton.solver
        );
    }
}

/// That its file holds all of it.
fn is_kept(scenario: &Scenario, automaton: &Automaton) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("policy.json");
    automaton.save(&path).unwrap();
    let loaded = Automaton::load(&path).unwrap();
    assert_eq!(&loaded, automaton);
    loaded
        .check_problem(&scenario.model, "policy.json")
        .unwrap();
    let earned = |automaton: &Automaton| {
        let options = Options {
            episodes: 30,
            seed: 9,
        };
        let runner = AutomatonRunner::new(automaton);
        evaluate(scenario, &automaton.updater, &runner, options, &Silent)
    };
    assert_eq!(earned(&loaded), earned(automaton));
}

#[test]
fn the_way_to_the_light_is_learned_by_regions() {
    for (name, kind) in [
        ("light-dark-5", TrackerKind::Sum),
        ("light-dark-binary", TrackerKind::Cells),
    ] {
        let scenario = scenario(name);
        let automaton = learn_regions(&scenario, &regions());
        assert_eq!(automaton.updater.kind(), kind);
        assert_eq!(automaton.matching, Matching::Segments);
        beats_one_thing_always(&scenario, &automaton);
        is_kept(&scenario, &automaton);
    }
}

#[test]
fn places_and_orders_are_learned_by_clusters() {
    for name in ["light-dark-5", "stock"] {
        let scenario = scenario(name);
        let automaton = learn_clusters(&scenario, &clusters());
        beats_one_thing_always(&scenario, &automaton);
        is_kept(&scenario, &automaton);
    }
}

/// Settings of runs that end at once.
fn hurried() -> (kafaq::Settings, arkaq::Settings) {
    let regions = kafaq::Settings {
        cells_along: 8,
        strata: 4,
        walks: 5,
        epoch: 500,
        epoch_per_cell: 1,
        epoch_limit: 3,
        trial: 5,
        ..kafaq::Settings::default()
    };
    let clusters = arkaq::Settings {
        scout: 100,
        settle: 50,
        explore_limit: 500,
        state_limit: 20,
        strata: 4,
        walks: 5,
        epoch: 500,
        epoch_per_entry: 1,
        epoch_limit: 3,
        trial: 5,
        ..arkaq::Settings::default()
    };
    (regions, clusters)
}

#[test]
fn a_run_that_is_stopped_after_every_piece_of_work_ends_like_one_that_is_not() {
    let (regions, clusters) = hurried();
    let scenario = scenario("light-dark-binary");
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
    let folder = tempfile::tempdir().unwrap();

    let course = || kafaq::course(&scenario.model, &worlds, &regions).unwrap();
    let stopped = stopped_often(course, &folder.path().join("kafaq.json"));
    let straight = kafaq::learn(&scenario.model, &worlds, &regions, None, &Silent).unwrap();
    assert_eq!(stopped, straight);

    let course = || arkaq::course(&scenario.model, &worlds, &clusters).unwrap();
    let stopped = stopped_often(course, &folder.path().join("arkaq.json"));
    let straight = arkaq::learn(&scenario.model, &worlds, &clusters, None, &Silent).unwrap();
    assert_eq!(stopped, straight);
}

/// What a course comes to that is kept in a file after every piece of work, and gone on with from there.
fn stopped_often<C: Course>(course: impl Fn() -> C, path: &Path) -> Learned<C::Learning> {
    Run::new(course()).unwrap().save(path).unwrap();
    loop {
        let mut run = Run::resume(course(), path).unwrap();
        let more = run.step(&Silent).unwrap();
        run.save(path).unwrap();
        if more.is_break() {
            return run.learned();
        }
    }
}

/// Modes that motion and sensing depend on are told, with what changes them, and their policies are kept like others.
#[test]
fn a_body_has_the_modes_it_feels_and_no_others() {
    let (regions, clusters) = hurried();
    let thermostat = scenario("thermostat");
    let body = thermostat.model.body();
    assert_eq!(body.modes, thermostat.model.modes);
    assert_eq!(body.events.len(), 2);
    assert!(body.rewards.is_empty() && body.cost.is_none() && body.map.is_none());
    assert_eq!(body.text.part, Part::Body);
    for automaton in [
        learn_regions(&thermostat, &regions),
        learn_clusters(&thermostat, &clusters),
    ] {
        is_kept(&thermostat, &automaton);
    }
    // What is paid in a mode is felt by nobody.
    let cart = scenario("cart-load-unload").model.body();
    assert_eq!(cart.modes, [String::new()]);
    assert!(cart.events.is_empty());
    assert!(cart.is_linear());
}

/// No body changes when rewards, events or the map do.
#[test]
fn rewards_tell_a_body_nothing() {
    let told = scenario("light-dark-5");
    let mut richer = told.clone();
    richer.model.rewards[0].value = 1000.0;
    assert_eq!(told.model.body(), richer.model.body());
}

#[test]
fn printed_rules_and_missing_bounds_are_refused_where_beliefs_are_kept_in_full() {
    let registry = Registry::builtin();
    let printed = [("rules".to_owned(), "\"printed\"".to_owned())];
    let solver = registry.find("kafaq").unwrap().solver(&printed).unwrap();
    let error = solver.accepts(&scenario("light-dark-5").model).unwrap_err();
    assert!(matches!(error, Error::Unsupported { .. }));
    assert!(error.to_string().contains("set `rules` to `tested`"));
    let text = scenario::builtin("light-dark-5").unwrap();
    let unbounded = text.replace("bounds = [[-15.0, 20.0]]", "bounds = [[-inf, inf]]");
    let unbounded = scenario::read(&unbounded, "unbounded.toml").unwrap();
    for name in ["kafaq", "arkaq"] {
        let error = registry.find(name).unwrap().accepts(&unbounded.model);
        let error = error.unwrap_err().to_string();
        assert!(error.contains("add `state.bounds`"), "{error}");
    }
}
