//! The robot: files that differ from what was learned in by the world alone, and automata that run on it unchanged.
#![allow(clippy::unwrap_used)]

use pilotage::Error;
use pilotage::model::Model;
use pilotage::policy::AutomatonRunner;
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario, Simulator, Walls};
use pilotage::simulate::{Options, evaluate};
use pilotage::solve::kafaq::{Settings, learn};
use pilotage::world::{Observation, ProblemWorld, Streams, World};

const PROBLEMS: [&str; 3] = ["basic", "maze-4x4", "cart-load-unload"];

fn scenario(name: &str) -> Scenario {
    scenario::find(name).unwrap_or_else(|error| panic!("{error}"))
}

fn robot_of(name: &str) -> Scenario {
    scenario(&format!("robot-{name}"))
}

#[test]
fn a_robot_file_is_its_problem_in_another_world() {
    for name in PROBLEMS {
        let (plain, robot) = (scenario(name), robot_of(name));
        assert!(matches!(robot.truth.simulator, Simulator::Robot(_)));
        let stripped = |scenario: &Scenario| Model {
            name: String::new(),
            about: String::new(),
            ..scenario.model.clone()
        };
        assert_eq!(stripped(&plain), stripped(&robot), "{name}");
        assert_eq!(plain.truth.walls, Walls::Clamp);
    }
}

/// Readings of the robot miss its place as the agent assumes, give or take what walls and headings do; five standard errors of a
/// standard deviation over 5000 readings are 5 %.
#[test]
fn the_robot_senses_as_well_as_the_agent_assumes() {
    let robot = robot_of("maze-4x4");
    let mut world = ProblemWorld::new(&robot);
    let mut draws = Streams::new(4, 0);
    let (mut square, mut count) = (0.0, 0.0);
    let mut observation = Observation::new(2);
    for episode in 0..50 {
        world.reset(&mut draws);
        for step in 0..50 {
            world.step((episode + step * 7) % 4, &mut draws, &mut observation);
            let reading = observation.reading().values().unwrap();
            for (sensed, place) in reading.iter().zip(world.state()) {
                square += (sensed - place).powi(2);
                count += 1.0;
            }
        }
    }
    let (sd, assumed) = (
        (square / count).sqrt(),
        robot.model.sensor.noise[(0, 0)].sqrt(),
    );
    assert!((sd / assumed - 1.0).abs() < 0.1, "{sd} against {assumed}");
}

#[test]
fn what_was_learned_elsewhere_earns_its_return_on_the_robot() {
    let options = Options {
        episodes: 200,
        seed: 11,
    };
    for name in PROBLEMS {
        let (plain, robot) = (scenario(name), robot_of(name));
        let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&plain)) };
        let learned = learn(&plain.model, &worlds, &Settings::default(), None, &Silent).unwrap();
        let automaton = &learned.automaton;
        automaton.check_problem(&plain.model, "policy").unwrap();
        automaton.check_world(&robot.model, "policy").unwrap();
        let controller = AutomatonRunner::new(automaton);
        let [there, here] = [&plain, &robot]
            .map(|world| evaluate(world, &automaton.updater, &controller, options, &Silent));
        assert!(
            here.discounted.mean >= 0.85 * there.discounted.mean
                && here.undiscounted.mean >= 0.85 * there.undiscounted.mean,
            "{name}: {here:?} against {there:?}"
        );
    }
}

#[test]
fn a_policy_is_refused_a_world_that_it_has_no_actions_or_sensors_for() {
    let plain = scenario("basic");
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&plain)) };
    let automaton = learn(&plain.model, &worlds, &Settings::default(), None, &Silent)
        .unwrap()
        .automaton;
    let refused = |world: &Model| {
        let error = automaton.check_world(world, "p.json").unwrap_err();
        assert!(matches!(error, Error::Policy { .. }), "{error}");
        error.to_string()
    };
    assert!(refused(&robot_of("maze-4x4").model).contains("actions EAST, WEST"));
    let mut renamed = plain.model.clone();
    renamed.state[0].name = "place".to_owned();
    assert!(refused(&renamed).contains("state variables x"));
    let mut blind = plain.model.clone();
    blind.sensor.h = nalgebra::DMatrix::from_row_slice(2, 1, &[1.0, 1.0]);
    assert!(refused(&blind).contains("2 readings"));
}

/// A way of next to nothing, in ticks so long that the speed for it is no number above 0, comes to its end.
#[test]
fn the_shortest_way_ends() {
    let mut robot = robot_of("maze-4x4");
    let Simulator::Robot(arena) = &mut robot.truth.simulator else {
        panic!("no robot");
    };
    arena.tick = 9e15;
    for shortest in [1e-300, 1e-308] {
        robot.model.motion.b[(1, 1)] = -shortest;
        let mut world = ProblemWorld::new(&robot);
        let mut draws = Streams::new(1, 0);
        world.reset(&mut draws);
        let mut observation = Observation::new(2);
        for action in 0..4 {
            world.step(action, &mut draws, &mut observation);
        }
    }
}
