//! Readers of models, policies and checkpoints under fire: whatever they are given, they take it or refuse it, within a second and a
//! gibibyte. What is taken is used, so that it cannot do harm later either.

#![allow(dead_code, unused_imports)]

mod mutate;

use std::path::Path;
use std::time::{Duration, Instant};

use pilotage::belief::{BeliefMdp, Reading};
use pilotage::model::Model;
use pilotage::policy::{
    Automaton, AutomatonRunner, Coordinates, GraphNode, GraphRunner, Matching, PolicyGraph, Saved,
};
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{TrackingAgent, run_episode};
use pilotage::solve::compile::{self, compile};
use pilotage::solve::{Registry, Run, arkaq, kafaq, value_iteration};
use pilotage::world::{Observation, ProblemWorld, Streams, World};

pub use mutate::numbers;

/// No input takes longer.
pub const LONGEST: Duration = Duration::from_secs(1);
/// No input takes more memory, bytes.
pub const LARGEST: u64 = 1 << 30;
/// Longest inputs that are made from another.
const LENGTH: usize = 4 << 20;

/// Takes bytes, or not.
type Read = Box<dyn Fn(&[u8]) -> bool + Send>;

/// A reader, the real files its inputs are made from, and what is done with what it takes; says whether it took it.
pub struct Reader {
    pub name: &'static str,
    pub corpus: Vec<Vec<u8>>,
    pub read: Read,
}

/// What came of many inputs.
#[derive(Debug, Default)]
pub struct Tally {
    pub inputs: u64,
    pub taken: u64,
    pub slowest: Duration,
    pub largest: u64,
}

impl Reader {
    /// Gives the reader one input.
    ///
    /// # Errors
    /// What it did that it must not.
    pub fn give(&self, bytes: &[u8], tally: &mut Tally) -> Result<(), String> {
        let once = || {
            let clock = Instant::now();
            let mut taken = Ok(false);
            let memory = allocation_counter::measure(|| {
                taken =
                    std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| (self.read)(bytes)));
            });
            (taken, clock.elapsed(), memory.bytes_max)
        };
        let (taken, mut time, memory) = once();
        let taken = taken.map_err(|_| "panics".to_owned())?;
        if time > LONGEST {
            // The machine may have been busy.
            time = time.min(once().1);
        }
        tally.inputs += 1;
        tally.taken += u64::from(taken);
        tally.slowest = tally.slowest.max(time);
        tally.largest = tally.largest.max(memory);
        if time > LONGEST {
            return Err(format!("takes {time:?}"));
        }
        if memory > LARGEST {
            return Err(format!("takes {} MiB", memory >> 20));
        }
        Ok(())
    }

    /// The input of a number.
    pub fn input(&self, seed: u64, number: u64) -> Vec<u8> {
        let mut bytes = mutate::input(&self.corpus, seed, number);
        bytes.truncate(LENGTH);
        bytes
    }
}

/// All readers; checkpoints are written to the folder.
pub fn readers(folder: &Path) -> Vec<Reader> {
    vec![
        models(),
        policies(),
        checkpoints_of_kafaq(folder),
        checkpoints_of_arkaq(folder),
    ]
}

fn built_in(name: &str) -> Model {
    scenario::find(name).expect("a built-in model").model
}

fn models() -> Reader {
    let registry = Registry::builtin();
    let texts = scenario::names().filter_map(scenario::builtin);
    Reader {
        name: "models",
        corpus: texts.map(|text| text.as_bytes().to_vec()).collect(),
        read: Box::new(move |bytes| {
            let Ok(mut scenario) = scenario::read(&String::from_utf8_lossy(bytes), "input") else {
                return false;
            };
            let model = &mut scenario.model;
            model.belief.level_limit = model.belief.level_limit.min(12);
            model.episode.length = model.episode.length.min(5);
            let model = &scenario.model;
            let mdp = BeliefMdp::new(model);
            if mdp.check().is_err() {
                return false;
            }
            let _ = mdp.check_bounded();
            for entry in registry.entries() {
                let _ = entry.accepts(model);
            }
            run(&scenario, &mdp);
            true
        }),
    }
}

/// A few steps in a model's world.
fn run(scenario: &Scenario, mdp: &BeliefMdp) {
    struct First;
    impl pilotage::policy::Policy for First {
        fn action(&self, _: &pilotage::belief::Belief) -> usize {
            0
        }
    }
    let model = &scenario.model;
    let filter = mdp.filter();
    let mut world = ProblemWorld::new(scenario);
    let mut agent = TrackingAgent::new(&filter, &First);
    let mut observation = Observation::new(model.observation_dim());
    let limits = (model.episode.length, model.discount);
    let mut draws = Streams::new(1, 0);
    run_episode(
        &mut world,
        &mut agent,
        &mut draws,
        &mut observation,
        limits,
        &mut |_, _| {},
    );
}

fn policies() -> Reader {
    let planned = |name: &str, matching| {
        let mdp = BeliefMdp::new(&built_in(name));
        let grid = value_iteration::Settings {
            points: Some(41),
            tolerance: 1e-3,
            ..Default::default()
        };
        let policy = value_iteration::solve(&mdp, &grid, &Silent).expect("a policy");
        let settings = compile::Settings {
            matching,
            episodes: 50,
            ..Default::default()
        };
        compile(&policy, &mdp, "value-iteration", &settings).expect("an automaton")
    };
    let mut turned = planned("maze-2d", Matching::Nearest);
    turned.coordinates = Some(Coordinates {
        names: vec!["east".to_owned()],
        rows: vec![vec![1.0, 0.5]],
    });
    turned.scale = vec![2.0];
    for node in &mut turned.nodes {
        node.place = pilotage::policy::Place::Point(vec![node.place.centre()[0]]);
    }
    let automata = [
        planned("corridor-blind", Matching::Nearest),
        planned("corridor-blind", Matching::Segments),
        planned("maze-2d", Matching::Segments),
        planned("u-maze", Matching::Nearest),
        planned("load-unload", Matching::Nearest),
        planned("tiger", Matching::Segments),
        turned,
        learned_by_kafaq(),
        learned_by_arkaq(),
    ];
    let text = |automaton: &Automaton| automaton.to_json().expect("a policy").into_bytes();
    let corridor = built_in("corridor-blind");
    Reader {
        name: "policies",
        corpus: automata.iter().map(text).chain([graph()]).collect(),
        read: Box::new(move |bytes| {
            let Ok(saved) = Saved::from_json(&sealed_policy(bytes), "input") else {
                return false;
            };
            let _ = saved.check_problem(&corridor, "input");
            let _ = saved.check_world(&corridor, "input");
            let again = match &saved {
                Saved::Automaton(automaton) => {
                    use_policy(automaton);
                    automaton.to_json()
                }
                Saved::Graph(graph) => {
                    use_graph(graph);
                    graph.to_json()
                }
            };
            let again = again.expect("what was read can be written");
            Saved::from_json(&again, "again").expect("and read again");
            true
        }),
    }
}

/// The file of a small policy graph.
fn graph() -> Vec<u8> {
    let node = |action, next: &[usize]| GraphNode {
        action,
        next: next.to_vec(),
        visits: 0.25,
        gone: vec![0.125; next.len()],
    };
    let graph = PolicyGraph {
        nodes: vec![
            node(1, &[1, 0, 0]),
            node(2, &[2, 0, 1]),
            node(2, &[3, 3, 2]),
            node(0, &[]),
        ],
        ..PolicyGraph::new(&built_in("light-dark-binary"), "by hand")
    };
    graph.to_json().expect("a policy").into_bytes()
}

/// Goes along every way, and after signals that no sensor knows.
fn use_graph(graph: &PolicyGraph) {
    let mut runner = GraphRunner::new(graph);
    let _ = graph.in_words();
    for signal in [0, 1, 0, 2, 3, u32::MAX, 1, 0, 0] {
        let (node, action) = runner.decide();
        assert!(node < graph.nodes.len() && action < graph.actions.len());
        runner.observe(Reading::Symbol(signal));
    }
    runner.observe(Reading::Nothing);
    runner.decide();
}

/// Acts on what hardly any sensor says.
fn use_policy(automaton: &Automaton) {
    let mut controller = AutomatonRunner::new(automaton);
    controller.reset();
    let readings = automaton.updater.readings();
    for reading in [
        0.0,
        1.0,
        -1e10,
        1e300,
        -1.7e308,
        f64::INFINITY,
        f64::NAN,
        0.0,
    ] {
        let (_, action) = controller.decide();
        controller.observe(action, &vec![reading; readings]);
    }
    controller.decide();
}

/// Settings with which an epoch is over at once.
fn kafaq_settings() -> kafaq::Settings {
    kafaq::Settings {
        epoch: 1,
        epoch_per_cell: 4,
        epoch_limit: 6,
        trial: 2,
        window: 1,
        cells_along: 5,
        cold: 0.9,
        cooling: 0.5,
        ..Default::default()
    }
}

fn arkaq_settings() -> arkaq::Settings {
    arkaq::Settings {
        epoch: 1,
        epoch_per_entry: 2,
        epoch_limit: 3,
        scout: 20,
        settle: 20,
        explore_limit: 200,
        state_limit: 12,
        trial: 2,
        merge: true,
        depth: 2,
        vigilances: vec![0.3, 0.6],
        ..Default::default()
    }
}

const LEARNED: &str = "cart-load-unload";

fn learned_by_kafaq() -> Automaton {
    let model = built_in(LEARNED);
    let scenario = Scenario::assumed(&model);
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
    let learned = kafaq::learn(&model, &worlds, &kafaq_settings(), None, &Silent);
    learned.expect("an automaton").automaton
}

fn learned_by_arkaq() -> Automaton {
    let model = built_in(LEARNED);
    let scenario = Scenario::assumed(&model);
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
    let learned = arkaq::learn(&model, &worlds, &arkaq_settings(), None, &Silent);
    learned.expect("an automaton").automaton
}

/// The run of a learner, as a checkpoint holds it.
macro_rules! checkpoints {
    ($name:ident, $learner:ident, $settings:ident) => {
        fn $name(folder: &Path) -> Reader {
            let model = built_in(LEARNED);
            let scenario = Scenario::assumed(&model);
            let path = folder.join(concat!(stringify!($learner), ".json"));
            let mut corpus = Vec::new();
            {
                let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
                let course = $learner::course(&model, &worlds, &$settings()).expect("a course");
                let mut run = Run::new(course).expect("a run");
                loop {
                    run.save(&path).expect("a checkpoint");
                    corpus.push(std::fs::read(&path).expect("a checkpoint"));
                    if run.step(&Silent).expect("a step").is_break() {
                        break;
                    }
                }
            }
            Reader {
                name: concat!("checkpoints of ", stringify!($learner)),
                corpus,
                read: Box::new(move |bytes| {
                    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
                    std::fs::write(&path, sealed(bytes)).expect("a file to read");
                    let course = $learner::course(&model, &worlds, &$settings()).expect("a course");
                    let Ok(mut run) = Run::resume(course, &path) else {
                        return false;
                    };
                    use_policy(&run.learned().automaton);
                    for _ in 0..2 {
                        let _ = run.step(&Silent);
                    }
                    use_policy(&run.learned().automaton);
                    run.save(&path).expect("it can be written again");
                    true
                }),
            }
        }
    };
}

checkpoints!(checkpoints_of_kafaq, kafaq, kafaq_settings);
checkpoints!(checkpoints_of_arkaq, arkaq, arkaq_settings);

/// A policy file with the checksum that belongs to what it has become: FNV-1a over the policy without white space between its values.
fn sealed_policy(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let Ok(mut file) = serde_json::from_str::<serde_json::Value>(&text) else {
        return text;
    };
    let (Some(policy), true) = (file.get("policy"), file.get("checksum").is_some()) else {
        return text;
    };
    let checksum = fnv1a64(policy.to_string().as_bytes());
    file["checksum"] = format!("fnv1a64-{checksum:016x}").into();
    file.to_string()
}

fn fnv1a64(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// A checkpoint with the checksum that belongs to what it has become, as someone would write it who means harm.
pub fn sealed(bytes: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let Some((header, state)) = text.split_once('\n') else {
        return bytes.to_vec();
    };
    let Ok(mut header) = serde_json::from_str::<serde_json::Value>(header) else {
        return bytes.to_vec();
    };
    let state = state.trim_end_matches('\n');
    let checksum = fnv1a64(state.as_bytes());
    if let Some(sum) = header.get_mut("checksum") {
        *sum = format!("fnv1a64-{checksum:016x}").into();
    }
    format!("{header}\n{state}\n").into_bytes()
}
