//! Yardsticks that learners are compared with.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use pilotage::belief::{Belief, BeliefMdp, Filter};
use pilotage::model::{self, ActionId, Model};
use pilotage::observe::Silent;
use pilotage::policy::Policy;
use pilotage::simulate::{Agent, Estimate, Evaluation, Options, evaluate, run_episode};
use pilotage::solve::kbvi::closed;
use pilotage::world::{Draws, ProblemWorld};

/// How automata are evaluated, learned or planned.
pub const EVALUATION: Options = Options {
    episodes: 2_000,
    seed: 999,
};

/// What policies earn that are told map and rewards; the first is the one to compare with.
pub fn yardsticks(model: &Model) -> Vec<(&'static str, Evaluation)> {
    let told = told(model);
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

/// A model as one who is told everything knows it.
pub fn told(model: &Model) -> Model {
    if model.name == "shuttle" {
        shuttle_told(model)
    } else {
        model.clone()
    }
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
