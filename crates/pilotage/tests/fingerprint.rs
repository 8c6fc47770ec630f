//! What a fingerprint depends on, and that it stays what it is: saved policies carry it.
#![allow(clippy::unwrap_used)]

mod common;

use common::{built_in, scenario};
use pilotage::model::{
    Event, Fingerprint, HypothesisBelief, Interval, Model, QuadraticCost, Region, StartShape,
    StateVariable, Steps, Then, VariableKind, WallBelief, When,
};
use pilotage::scenario::{self, Scenario, Simulator, TrueControl, Truth, Walls};

/// Every table and key that a model can have.
const RICH: &str = r#"
format = 1
name = "rich"
discount = 0.9

[state]
names = ["x", "y"]
bounds = [[0.0, 3.0], [0.0, 2.0]]
modes = ["empty", "full"]

[[start]]
weight = 0.25
mode = "full"
mean = [0.5, 0.5]
covariance = [[0.5, 0.1], [0.1, 0.25]]

[[start]]
weight = 0.75
uniform = { x = [0.0, 1.0], y = [0.0, 1.0] }

[motion]
A = [[1.0, 0.125], [0.0, 1.0]]
B = [[1.0], [0.5]]
noise = [[0.25, 0.0], [0.0, 0.5]]

[sensor]
H = [[1.0, 0.0]]
noise = [[0.5]]

[actions]
GO = { u = [1.0] }
LOOK = { u = [0.0], noise = [[0.0, 0.0], [0.0, 0.0]], sensor_noise = [[0.125]] }
STOP = { u = [0.0], then = "end" }

[[reward]]
action = ["GO", "STOP"]
mode = "full"
in = "*"
when = "after"
value = 2.0

[[event]]
action = "GO"
mode = "empty"
in = { x = [1.0, 2.0] }
when = "after"
becomes = "full"
reward = 0.5
then = "restart"

[cost]
state = [[1.0, 0.0], [0.0, 1.0]]
control = [[0.5]]
terminal = [[2.0, 0.0], [0.0, 2.0]]

[episode]
length = 50
alive = { x = [-1.0, 4.0] }
failure_reward = -1.0

[belief]
level_tolerance = 1e-6
level_limit = 100
walls = "clip"
hypotheses = "track"

[map]
cell = 1.0
rows = '''
..*
...
'''

[world]
walls = "clamp"

[[world.start]]
mean = [1.5, 0.5]
covariance = [[0.0, 0.0], [0.0, 0.0]]

[world.motion]
noise = [[0.5, 0.0], [0.0, 0.5]]

[[world.motion.control]]
action = "GO"
mode = "full"
u = [-1.0]
"#;

fn rich_scenario() -> Scenario {
    scenario::read(RICH, "rich.toml").unwrap()
}

fn rich() -> Model {
    rich_scenario().model
}

type Change<M> = (&'static str, fn(&mut M));

/// One change of every field that a policy depends on.
const CHANGES: &[Change<Model>] = &[
    ("discount", |m| m.discount = 0.9_f64.next_up()),
    ("state.name", |m| m.state[0].name.push('1')),
    ("state.bounds.low", |m| m.state[0].bounds.low = -1.0),
    ("state.bounds.high", |m| m.state[0].bounds.high = 4.0),
    ("state.bounds, none", |m| m.state[0].bounds = Interval::ALL),
    ("state, one more", |m| {
        m.state.push(StateVariable {
            name: "z".to_owned(),
            bounds: Interval::ALL,
            kind: VariableKind::Real,
        });
    }),
    ("state, other order", |m| m.state.swap(0, 1)),
    ("modes.name", |m| m.modes[1].push('1')),
    ("modes, one more", |m| m.modes.push("half".to_owned())),
    ("modes, one", |m| m.modes = vec![String::new()]),
    ("start, one", |m| drop(m.start.pop())),
    ("start.weight", |m| m.start[0].weight = 0.26),
    ("start.mode", |m| m.start[0].mode = 0),
    ("start.mode of the second", |m| m.start[1].mode = 1),
    ("start.mean", |m| m.start[0].mean[1] = 0.6),
    ("start.covariance", |m| m.start[0].covariance[(0, 1)] = 0.11),
    ("start.covariance, transposed", |m| {
        m.start[0].covariance[(1, 0)] = 0.11
    }),
    ("start.shape", |m| m.start[0].shape = StartShape::Uniform),
    ("motion.a", |m| m.motion.a[(0, 1)] = 0.25),
    ("motion.a, transposed", |m| {
        m.motion.a = m.motion.a.transpose()
    }),
    ("motion.b", |m| m.motion.b[(1, 0)] = 0.25),
    ("motion.noise", |m| m.motion.noise[(1, 1)] = 0.75),
    ("sensor.h", |m| m.sensor.h[(0, 1)] = 1.0),
    ("sensor.h, one more row", |m| {
        m.sensor.h = m.sensor.h.clone().insert_row(1, 0.0)
    }),
    ("sensor.noise", |m| m.sensor.noise[(0, 0)] = 0.75),
    ("actions.name", |m| m.actions[0].name.push('1')),
    ("actions.control", |m| m.actions[0].control[0] = 2.0),
    ("actions.motion_noise", |m| {
        m.actions[0].motion_noise = Some(m.motion.noise.clone() * 2.0)
    }),
    ("actions.motion_noise, none", |m| {
        m.actions[1].motion_noise = None
    }),
    ("actions.sensor_noise", |m| {
        m.actions[0].sensor_noise = Some(m.sensor.noise.clone() * 2.0)
    }),
    ("actions.sensor_noise, none", |m| {
        m.actions[1].sensor_noise = None
    }),
    ("actions.then", |m| m.actions[0].then = Then::Restart),
    ("actions.then of the last", |m| {
        m.actions[2].then = Then::Continue
    }),
    ("actions, other order", |m| m.actions.swap(0, 1)),
    ("rewards, none", |m| m.rewards.clear()),
    ("rewards, twice", |m| m.rewards.push(m.rewards[0].clone())),
    ("rewards.actions", |m| m.rewards[0].actions = Some(vec![0])),
    ("rewards.actions, all", |m| m.rewards[0].actions = None),
    ("rewards.mode", |m| m.rewards[0].mode = Some(0)),
    ("rewards.mode, all", |m| m.rewards[0].mode = None),
    ("rewards.region", |m| {
        m.rewards[0].region.sides[0].1.low = 1.5
    }),
    ("rewards.region.variable", |m| {
        m.rewards[0].region.sides.truncate(1)
    }),
    ("rewards.region, everywhere", |m| {
        m.rewards[0].region = Region::everywhere()
    }),
    ("rewards.when", |m| m.rewards[0].when = When::Before),
    ("rewards.steps.from", |m| m.rewards[0].steps.from = 1),
    ("rewards.steps.until", |m| m.rewards[0].steps.until = 9),
    ("rewards.steps, both", |m| {
        m.rewards[0].steps = Steps { from: 1, until: 9 }
    }),
    ("rewards.value", |m| m.rewards[0].value = -2.0),
    ("events, none", |m| m.events.clear()),
    ("events, twice", |m| m.events.push(m.events[0].clone())),
    ("events.actions", |m| m.events[0].actions = Some(vec![1])),
    ("events.actions, all", |m| m.events[0].actions = None),
    ("events.mode", |m| m.events[0].mode = Some(1)),
    ("events.mode, any", |m| m.events[0].mode = None),
    ("events.region", |m| {
        m.events[0].region.sides[0].1.high = 2.5
    }),
    ("events.when", |m| m.events[0].when = When::Before),
    ("events.steps.from", |m| m.events[0].steps.from = 1),
    ("events.steps.until", |m| m.events[0].steps.until = 9),
    ("events.becomes", |m| m.events[0].becomes = Some(0)),
    ("events.becomes, as before", |m| m.events[0].becomes = None),
    ("events.reward", |m| m.events[0].reward = 0.0),
    ("events.then", |m| m.events[0].then = Then::Continue),
    ("cost, none", |m| m.cost = None),
    ("cost.state", |m| cost(m).state[(0, 0)] = 3.0),
    ("cost.control", |m| cost(m).control[(0, 0)] = 3.0),
    ("cost.terminal", |m| cost(m).terminal[(0, 0)] = 3.0),
    ("episode.length", |m| m.episode.length = 51),
    ("episode.alive", |m| m.episode.alive.sides[0].1.high = 5.0),
    ("episode.alive, everywhere", |m| {
        m.episode.alive = Region::everywhere()
    }),
    ("episode.failure_reward", |m| m.episode.failure_reward = 0.0),
    ("belief.level_tolerance", |m| {
        m.belief.level_tolerance = 2e-6
    }),
    ("belief.level_limit", |m| m.belief.level_limit = 101),
    ("belief.walls", |m| m.belief.walls = WallBelief::Ignore),
    ("belief.hypotheses", |m| {
        m.belief.hypotheses = HypothesisBelief::Collapse
    }),
    ("belief.hypotheses, Gaussian", |m| {
        m.belief.hypotheses = HypothesisBelief::Gaussian
    }),
    ("map, none", |m| m.map = None),
    ("map.rows", |m| {
        m.map.as_mut().unwrap().rows[0] = "#.*".to_owned()
    }),
    ("map.cell", |m| m.map.as_mut().unwrap().cell = 2.0),
];

fn cost(model: &mut Model) -> &mut QuadraticCost {
    model.cost.as_mut().unwrap()
}

/// One change of everything that is true of the world alone.
const CHANGES_OF_THE_TRUTH: &[Change<Truth>] = &[
    ("all", |t| *t = Truth::default()),
    ("simulator, cart and pole", |t| {
        t.simulator = scenario("cart-pole").truth.simulator
    }),
    ("simulator, robot", |t| {
        t.simulator = scenario("robot-basic").truth.simulator
    }),
    ("walls", |t| t.walls = Walls::None),
    ("start", |t| t.start = None),
    ("start.mean", |t| t.start.as_mut().unwrap()[0].mean[0] = 0.5),
    ("motion.noise", |t| t.motion.noise = None),
    ("motion.noise of x", |t| {
        t.motion.noise.as_mut().unwrap()[(0, 0)] = 0.25
    }),
    ("motion.controls", |t| t.motion.controls.clear()),
    ("motion.controls.actions", |t| {
        t.motion.controls[0].actions = None
    }),
    ("motion.controls.mode", |t| t.motion.controls[0].mode = None),
    ("motion.controls.control", |t| {
        t.motion.controls[0].control[0] = 0.0
    }),
    ("motion.controls, one more", |t| {
        t.motion.controls.push(TrueControl {
            actions: None,
            mode: None,
            control: nalgebra::dvector![0.0],
        });
    }),
];

/// Fingerprints of a thing and of all its changed versions: no two are the same.
fn all_differ<M: Clone>(original: &M, changes: &[Change<M>], of: fn(&M) -> Fingerprint) {
    let mut seen = vec![("nothing", of(original))];
    for (what, change) in changes {
        let mut changed = original.clone();
        change(&mut changed);
        let fingerprint = of(&changed);
        let same = seen.iter().find(|(_, known)| *known == fingerprint);
        assert!(same.is_none(), "{what} changes it as much as {same:?}");
        seen.push((what, fingerprint));
    }
}

#[test]
fn every_field_changes_it() {
    all_differ(&rich(), CHANGES, Model::fingerprint);
    all_differ(
        &rich_scenario().truth,
        CHANGES_OF_THE_TRUTH,
        Truth::fingerprint,
    );
}

/// The plants' parameters, all of which are numbers.
#[test]
fn every_parameter_of_a_plant_changes_it() {
    for name in ["cart-pole", "robot-basic"] {
        let truth = scenario(name).truth;
        let parameters = match &truth.simulator {
            Simulator::CartPole(parameters) => serde_json::to_value(parameters).unwrap(),
            Simulator::Robot(robot) => serde_json::to_value(robot).unwrap(),
            Simulator::Linear => panic!("{name} has no plant"),
        };
        let mut seen = vec![truth.fingerprint()];
        for key in parameters.as_object().unwrap().keys() {
            let mut changed = parameters.clone();
            changed[key] = (changed[key].as_f64().unwrap_or(0.0) + 0.125).into();
            let simulator = match &truth.simulator {
                Simulator::CartPole(_) => {
                    Simulator::CartPole(serde_json::from_value(changed).unwrap())
                }
                _ => Simulator::Robot(serde_json::from_value(changed).unwrap()),
            };
            let fingerprint = Truth {
                simulator,
                ..truth.clone()
            }
            .fingerprint();
            assert!(!seen.contains(&fingerprint), "{name}: {key}");
            seen.push(fingerprint);
        }
    }
}

/// What says nothing leaves it as it is.
#[test]
fn words_zeros_and_defaults_do_not_change_it() {
    let changes: &[Change<Model>] = &[
        ("name", |m| m.name.push('1')),
        ("about", |m| m.about.push('1')),
        ("-0 in a matrix", |m| m.motion.a[(1, 0)] = -0.0),
        ("-0 in a vector", |m| m.actions[1].control[0] = -0.0),
        ("-0 of a bound", |m| m.state[0].bounds.low = -0.0),
        ("the motion's own noise", |m| {
            m.actions[0].motion_noise = Some(m.motion.noise.clone())
        }),
        ("the sensor's own noise", |m| {
            m.actions[0].sensor_noise = Some(m.sensor.noise.clone())
        }),
    ];
    let original = rich();
    for (what, change) in changes {
        let mut changed = original.clone();
        change(&mut changed);
        assert_eq!(changed.fingerprint(), original.fingerprint(), "{what}");
    }
    let mut zeros = original;
    zeros.episode.failure_reward = 0.0;
    zeros.events[0].reward = 0.0;
    let mut negative = zeros.clone();
    negative.episode.failure_reward = -0.0;
    negative.events[0].reward = -0.0;
    assert_eq!(negative.fingerprint(), zeros.fingerprint());
}

/// Where one list ends and the next begins makes a difference.
#[test]
fn lists_do_not_run_into_each_other() {
    let event = |action| Event {
        actions: Some(vec![action]),
        mode: None,
        region: Region::everywhere(),
        when: When::Before,
        steps: Steps::ALL,
        probability: 1.0,
        becomes: None,
        reward: 0.0,
        then: Then::Continue,
    };
    let with = |lists: [&[usize]; 2]| {
        let mut model = rich();
        model.events = lists
            .iter()
            .map(|actions| Event {
                actions: Some(actions.to_vec()),
                ..event(0)
            })
            .collect();
        model.fingerprint()
    };
    assert_ne!(with([&[0, 1], &[2]]), with([&[0], &[1, 2]]));
    let named = |names: [&str; 2]| {
        let mut model = rich();
        model.modes = names.map(str::to_owned).to_vec();
        model.fingerprint()
    };
    assert_ne!(named(["ab", "c"]), named(["a", "bc"]));
}

#[test]
fn it_is_read_as_it_is_written_and_in_no_other_way() {
    let fingerprint = rich().fingerprint();
    let text = fingerprint.to_string();
    assert_eq!(text.len(), 3 + 16);
    assert!(text.starts_with("v1-"));
    assert_eq!(text.parse(), Ok(fingerprint));
    let other: Fingerprint = "v2-0123456789abcdef".parse().unwrap();
    assert!(!other.comparable(&fingerprint));
    for wrong in [
        "",
        "v1",
        "v1-",
        "1-0123456789abcdef",
        "v1-0123456789ABCDEF",
        "v1-0123456789abcde",
        "v1-0123456789abcdeff",
        "v1-+123456789abcdef",
        "v01-0123456789abcdef",
        "v-1-0123456789abcdef",
        " v1-0123456789abcdef",
    ] {
        assert!(wrong.parse::<Fingerprint>().is_err(), "{wrong}");
    }
}

/// Policies that people have saved name their problems by these. One that changes without a change of its model is a mistake here; where
/// the model did change, its line does too.
#[test]
fn fingerprints_of_the_built_in_models_stay() {
    let golden = include_str!("fixtures/fingerprints.txt");
    let golden: Vec<&str> = golden.lines().collect();
    let current: Vec<String> = scenario::names()
        .map(|name| format!("{name} {}", built_in(name).fingerprint()))
        .collect();
    assert_eq!(
        current,
        golden,
        "put this into tests/fixtures/fingerprints.txt if the models have changed:\n{}",
        current.join("\n")
    );
}
