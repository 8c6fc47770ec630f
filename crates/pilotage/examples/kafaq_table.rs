//! KAFAQ-learning on the thesis' worlds (4.3): medians over many seeds, beside yardsticks that are told map and rewards.
//!
//! `cargo run --release --example kafaq_table -- [PROBLEM or all] [SEEDS] [FILE]` prints a table, and the automaton of the first
//! seed where there are no more than two; it writes every run to FILE as JSON.
#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use pilotage::belief::{Belief, BeliefMdp, Filter};
use pilotage::model::{self, ActionId, Model};
use pilotage::observe::Silent;
use pilotage::policy::{Automaton, Controller, Place, Policy};
use pilotage::simulate::{Agent, Estimate, Evaluation, Options, evaluate, run_episode};
use pilotage::solve::kafaq::{self, Learned, Settings};
use pilotage::solve::kbvi::closed;
use pilotage::world::{Draws, ProblemWorld, World};
use serde_json::json;

const PROBLEMS: [&str; 6] = [
    "basic",
    "basic-inner",
    "maze-4x4",
    "cart-load-unload",
    "stations-5x5",
    "shuttle",
];

const EVALUATION: Options = Options {
    episodes: 2_000,
    seed: 999,
};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let which = arguments.first().map_or("all", String::as_str);
    let seeds: u64 = arguments.get(1).map_or(20, |text| text.parse().unwrap());
    let file = arguments.get(2).map_or("kafaq_table.json", String::as_str);
    let mut results = Vec::new();
    for name in PROBLEMS
        .into_iter()
        .filter(|name| which == "all" || which == *name)
    {
        let model = model::find(name).unwrap();
        let yardsticks = yardsticks(&model);
        for (what, earned) in &yardsticks {
            println!("{name}: {what}: {}", returns(earned));
        }
        let runs = learn_all(&model, seeds);
        if seeds <= 2 {
            print_automaton(&runs[0].learned);
        }
        print_row(
            name,
            &runs,
            yardsticks.first().map(|yardstick| &yardstick.1),
        );
        results.push(json!({
            "problem": name,
            "yardsticks": yardsticks.iter().map(|(what, earned)| json!({ "what": what, "earned": earned })).collect::<Vec<_>>(),
            "runs": runs.iter().map(Run::json).collect::<Vec<_>>(),
        }));
    }
    std::fs::write(file, serde_json::to_string_pretty(&results).unwrap()).unwrap();
}

struct Run {
    seed: u64,
    learned: Learned,
    earned: Evaluation,
    seconds: f64,
}

impl Run {
    fn new(model: &Model, seed: u64) -> Self {
        let clock = Instant::now();
        let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(model)) };
        let settings = Settings {
            seed,
            ..Settings::default()
        };
        let learned = kafaq::learn(model, &worlds, &settings, None, &Silent).unwrap();
        let seconds = clock.elapsed().as_secs_f64();
        let automaton = &learned.automaton;
        let earned = evaluate(
            model,
            &automaton.filter,
            &Controller::new(automaton),
            EVALUATION,
            &Silent,
        );
        Self {
            seed,
            learned,
            earned,
            seconds,
        }
    }

    fn json(&self) -> serde_json::Value {
        json!({
            "seed": self.seed,
            "earned": self.earned,
            "nodes": self.learned.automaton.nodes.len(),
            "converged": self.learned.converged,
            "samples": self.learned.samples,
            "memory": self.learned.learning.memory,
            "seconds": self.seconds,
        })
    }
}

/// All seeds, two at a time.
fn learn_all(model: &Model, seeds: u64) -> Vec<Run> {
    let next = AtomicUsize::new(1);
    let mut runs: Vec<Run> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..2)
            .map(|_| {
                scope.spawn(|| {
                    let seeds = std::iter::from_fn(|| {
                        let seed = next.fetch_add(1, Ordering::Relaxed) as u64;
                        (seed <= seeds).then_some(seed)
                    });
                    seeds.map(|seed| Run::new(model, seed)).collect::<Vec<_>>()
                })
            })
            .collect();
        workers
            .into_iter()
            .flat_map(|worker| worker.join().unwrap())
            .collect()
    });
    runs.sort_by_key(|run| run.seed);
    runs
}

/// What policies earn that are told map and rewards; the first is the one to compare with.
fn yardsticks(model: &Model) -> Vec<(&'static str, Evaluation)> {
    let told = if model.name == "shuttle" {
        shuttle_told(model)
    } else {
        model.clone()
    };
    let mut found = Vec::new();
    let plan = closed::solve(
        &BeliefMdp::new(&told),
        &closed::Settings::default(),
        &Silent,
    )
    .unwrap();
    let seen = (told.modes.len() > 1).then(|| mode_seen(&told, &plan));
    let believed = evaluate(&told, &plan.mdp().filter(), &plan, EVALUATION, &Silent);
    if model.name == "stations-5x5" {
        let mut pair = model.clone();
        pair.events
            .retain(|event| event.mode != Some(2) && event.becomes != Some(2));
        let shuttle = closed::solve(
            &BeliefMdp::new(&pair),
            &closed::Settings::default(),
            &Silent,
        )
        .unwrap();
        let earned = evaluate(
            model,
            &shuttle.mdp().filter(),
            &shuttle,
            EVALUATION,
            &Silent,
        );
        found.push(("closed-loop KBVI for a single pair, mode believed", earned));
    }
    found.push(("closed-loop KBVI, mode believed", believed));
    if let Some(seen) = seen {
        found.push(("closed-loop KBVI, mode seen", seen));
    }
    if model.name == "cart-load-unload" {
        found.push(("best memoryless policy", best_memoryless(model)));
    }
    found
}

/// The shuttle as one who knows which way it faces: moving the way it does not face is ruled out by its cost.
fn shuttle_told(model: &Model) -> Model {
    let mut told = model.clone();
    let noise = told.world.motion.noise.take().unwrap();
    told.motion.noise = noise;
    told.world.motion.controls.clear();
    let turn = told.action_named("TURN").unwrap();
    let mut east = told.actions[0].clone();
    let mut west = east.clone();
    (east.name, east.control[0]) = ("EAST".to_owned(), 1.0);
    (west.name, west.control[0]) = ("WEST".to_owned(), -1.0);
    let turn = told.actions[turn].clone();
    told.actions = vec![east, turn, west];
    for reward in &mut told.rewards {
        reward.actions = Some(vec![0, 2]);
    }
    let mut forbidden = told.rewards[0].clone();
    forbidden.region = model::Region::everywhere();
    forbidden.value = -1_000.0;
    for (mode, name) in model.modes.iter().enumerate() {
        forbidden.mode = Some(mode);
        forbidden.actions = Some(vec![if name.starts_with("east") { 2 } else { 0 }]);
        told.rewards.push(forbidden.clone());
    }
    told
}

/// A policy that is shown the true mode at every step.
fn mode_seen(model: &Model, policy: &dyn Policy) -> Evaluation {
    struct Seer<'a> {
        filter: Filter,
        policy: &'a dyn Policy,
        belief: Belief,
        scratch: Vec<f64>,
        mode: Arc<AtomicUsize>,
    }
    impl Agent for Seer<'_> {
        fn reset(&mut self) {
            self.filter.reset(&mut self.belief);
            self.mode.store(self.belief.mode, Ordering::Relaxed);
        }
        fn act(&mut self) -> ActionId {
            self.belief.mode = self.mode.load(Ordering::Relaxed);
            self.policy.action(&self.belief)
        }
        fn observe(&mut self, action: ActionId, observation: &[f64]) {
            self.filter
                .update(&mut self.belief, action, observation, &mut self.scratch);
        }
        fn belief(&self) -> &Belief {
            &self.belief
        }
    }
    let filter = BeliefMdp::new(model).filter();
    let mode = Arc::new(AtomicUsize::new(0));
    let mut seer = Seer {
        belief: filter.initial(),
        scratch: vec![0.0; filter.states()],
        filter,
        policy,
        mode: mode.clone(),
    };
    let mut world = ProblemWorld::new(model);
    let mut observation = vec![0.0; model.observation_dim()];
    let episodes: Vec<_> = (0..EVALUATION.episodes)
        .map(|episode| {
            let mut draws = Draws::new(EVALUATION.seed, episode as u64);
            run_episode(
                &mut world,
                &mut seer,
                &mut draws,
                &mut observation,
                (model.episode.length, model.discount),
                &mut |moment, _| mode.store(moment.mode, Ordering::Relaxed),
            )
        })
        .collect();
    Evaluation {
        episodes: episodes.len(),
        discounted: Estimate::of(episodes.iter().map(|episode| episode.discounted)),
        undiscounted: Estimate::of(episodes.iter().map(|episode| episode.undiscounted)),
        steps: Estimate::of(episodes.iter().map(|episode| episode.steps as f64)),
        failed: 0.0,
    }
}

/// The best of all 1024 maps from ten cells of the line to two actions.
fn best_memoryless(model: &Model) -> Evaluation {
    struct Map(usize);
    impl Policy for Map {
        fn action(&self, belief: &Belief) -> ActionId {
            self.0 >> ((belief.mean[0] / 0.4).clamp(0.0, 9.0) as usize) & 1
        }
    }
    let filter = BeliefMdp::new(model).filter();
    let earned = |map: &Map, options| evaluate(model, &filter, map, options, &Silent);
    let quick = Options {
        episodes: 60,
        seed: 31,
    };
    let best = (0..1024)
        .map(Map)
        .max_by(|a, b| {
            let [a, b] = [a, b].map(|map| earned(map, quick).undiscounted.mean);
            a.total_cmp(&b)
        })
        .unwrap();
    earned(&best, EVALUATION)
}

fn returns(earned: &Evaluation) -> String {
    format!(
        "{:.2} ± {:.2} discounted, {:.3} ± {:.3} a step",
        earned.discounted.mean,
        earned.discounted.stderr,
        earned.undiscounted.mean / earned.steps.mean,
        earned.undiscounted.stderr / earned.steps.mean,
    )
}

fn print_row(name: &str, runs: &[Run], yardstick: Option<&Evaluation>) {
    let spread = |of: &dyn Fn(&Run) -> f64, digits: usize| {
        let mut values: Vec<f64> = runs.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        let middle = 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]);
        format!(
            "{middle:.digits$} [{:.digits$}, {:.digits$}]",
            values[0],
            values[values.len() - 1]
        )
    };
    let (discounted, undiscounted) = yardstick.map_or((f64::NAN, f64::NAN), |yardstick| {
        (yardstick.discounted.mean, yardstick.undiscounted.mean)
    });
    println!(
        "{name}: nodes {}, discounted {} = {}% of the yardstick, undiscounted {}%, converged {} of {}, steps {}, seconds {}",
        spread(&|run| run.learned.automaton.nodes.len() as f64, 0),
        spread(&|run| run.earned.discounted.mean, 2),
        spread(&|run| 100.0 * run.earned.discounted.mean / discounted, 1),
        spread(
            &|run| 100.0 * run.earned.undiscounted.mean / undiscounted,
            1
        ),
        runs.iter().filter(|run| run.learned.converged).count(),
        runs.len(),
        spread(&|run| run.learned.samples as f64, 0),
        spread(&|run| run.seconds, 1),
    );
}

fn print_automaton(learned: &Learned) {
    let automaton: &Automaton = &learned.automaton;
    println!("  {}", learned.learning.memory);
    for node in &automaton.nodes {
        if let Place::Segment { lower, upper, .. } = &node.place {
            println!(
                "  levels {:?} {:?} {lower:.2?}..{upper:.2?} {} {:.1?}",
                node.levels, automaton.modes[node.mode], automaton.actions[node.action], node.value
            );
        }
    }
}
