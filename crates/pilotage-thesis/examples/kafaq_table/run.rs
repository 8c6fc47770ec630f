//! Learning with one seed, and what came of it.

use std::time::Instant;

use pilotage::belief::BeliefMdp;
use pilotage::policy::AutomatonRunner;
use pilotage::progress::Silent;
use pilotage::scenario::Scenario;
use pilotage::simulate::{Evaluation, LifeOptions, evaluate, life};
use pilotage::solve::compile;
use pilotage::solve::kafaq::{self, Learned, Settings};
use pilotage::world::{ProblemWorld, World};
use serde_json::json;

use super::EVALUATION;

/// Steps of every run with the pole: a little more than the thesis' four hours.
const POLE_STEPS: u64 = 750_000;

/// One seed.
pub struct Run {
    seed: u64,
    pub learned: Learned,
    pub earned: Evaluation,
    /// In the world of the robot, unchanged.
    pub on_robot: Option<Evaluation>,
    pub components: usize,
    pub seconds: f64,
}

impl Run {
    /// Learns and evaluates.
    pub fn new(scenario: &Scenario, robot: Option<&Scenario>, seed: u64) -> Self {
        let (mut learned, seconds) = learn(scenario, seed);
        compile::annotate(
            &mut learned.automaton,
            &BeliefMdp::new(&scenario.model),
            500,
            seed,
        );
        let automaton = &learned.automaton;
        let controller = AutomatonRunner::new(automaton);
        let earned = |world: &Scenario| {
            evaluate(world, &automaton.updater, &controller, EVALUATION, &Silent)
        };
        Self {
            seed,
            earned: earned(scenario),
            on_robot: robot.map(earned),
            components: automaton.closed_components(),
            learned,
            seconds,
        }
    }

    pub fn json(&self) -> serde_json::Value {
        json!({
            "seed": self.seed,
            "earned": self.earned,
            "on_robot": self.on_robot,
            "nodes": self.learned.automaton.nodes.len(),
            "components": self.components,
            "converged": self.learned.converged,
            "samples": self.learned.samples,
            "memory": self.learned.learning.memory,
            "seconds": self.seconds,
        })
    }
}

/// One seed with the pole.
pub struct Pole {
    seed: u64,
    pub learned: Learned,
    pub failures: u64,
    pub seconds: f64,
}

impl Pole {
    /// Learns, and balances for longer than the thesis' four hours.
    pub fn new(scenario: &Scenario, seed: u64) -> Self {
        let (learned, seconds) = learn(scenario, seed);
        let options = LifeOptions {
            runs: 1,
            steps: POLE_STEPS,
            seed: EVALUATION.seed + seed,
        };
        let controller = AutomatonRunner::new(&learned.automaton);
        let life = life(
            scenario,
            &learned.automaton.updater,
            &controller,
            options,
            &Silent,
        );
        Self {
            seed,
            failures: life.failures(),
            learned,
            seconds,
        }
    }

    pub fn json(&self) -> serde_json::Value {
        json!({
            "seed": self.seed,
            "steps": POLE_STEPS,
            "failures": self.failures,
            "nodes": self.learned.automaton.nodes.len(),
            "converged": self.learned.converged,
            "samples": self.learned.samples,
            "seconds": self.seconds,
        })
    }
}

fn learn(scenario: &Scenario, seed: u64) -> (Learned, f64) {
    let clock = Instant::now();
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(scenario)) };
    let settings = Settings {
        seed,
        ..Settings::default()
    };
    let learned = kafaq::learn(&scenario.model, &worlds, &settings, None, &Silent).unwrap();
    (learned, clock.elapsed().as_secs_f64())
}
