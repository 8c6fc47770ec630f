//! What a learner is measured against: planners that are told map and rewards, and the best policy without memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use pilotage::belief::{Belief, BeliefMdp, Filter, Reading};
use pilotage::error::Result;
use pilotage::model::{ActionId, Region};
use pilotage::policy::Policy;
use pilotage::progress::Progress;
use pilotage::scenario::Scenario;
use pilotage::simulate::{Agent, Estimate, Evaluation, Options, evaluate, run_episode};
use pilotage::solve::value_iteration;
use pilotage::world::{Observation, ProblemWorld, Streams};

/// What somebody earns who knows more than the learner, or does less.
#[derive(Debug, Clone, PartialEq)]
pub struct Baseline {
    /// Who.
    pub who: &'static str,
    /// What is earned.
    pub earned: Evaluation,
}

/// What policies earn that are told map and rewards; the first is the one to compare a learner with.
///
/// With three hidden modes (one for each load of two) that is the planner that keeps to the first pair of stations, which is what a
/// learner finds that settles on what it found first. Where the true motion depends on a mode no planner can be told so; then one
/// is compared with who knows the mode's controls as actions of their own.
///
/// # Errors
/// As [`value_iteration::solve`].
pub fn baselines(
    scenario: &Scenario,
    planner: &value_iteration::Settings,
    options: Options,
    observer: &dyn Progress,
) -> Result<Vec<Baseline>> {
    let told = told(scenario);
    let plan =
        |told: &Scenario| value_iteration::solve(&BeliefMdp::new(&told.model), planner, observer);
    let earned = |world: &Scenario, policy: &value_iteration::GridPolicy| {
        evaluate(world, &policy.mdp().filter(), policy, options, observer)
    };
    let mut found = Vec::new();
    let mut add = |who, earned| found.push(Baseline { who, earned });
    if told.model.modes.len() == 3 {
        let mut pair = told.clone();
        pair.model
            .events
            .retain(|event| event.mode != Some(2) && event.becomes != Some(2));
        add(
            "closed-loop KBVI for a single pair, mode believed",
            earned(scenario, &plan(&pair)?),
        );
    }
    let policy = plan(&told)?;
    add("closed-loop KBVI, mode believed", earned(&told, &policy));
    if told.model.modes.len() > 1 {
        add(
            "closed-loop KBVI, mode seen",
            mode_seen(&told, &policy, options),
        );
    }
    let model = &told.model;
    if model.modes.len() == 2 && model.state_dim() == 1 && model.actions.len() == 2 {
        add(
            "best memoryless policy",
            best_memoryless(scenario, options, observer),
        );
    }
    Ok(found)
}

/// The scenario as a planner has to be told it.
pub fn told(scenario: &Scenario) -> Scenario {
    if scenario.truth.motion.controls.is_empty() {
        scenario.clone()
    } else {
        controls_told(scenario)
    }
}

/// The scenario of one who knows what each mode's controls are: moving the way the mode does not allow is ruled out by its cost. Made
/// for the shuttle, whose first action moves the way it faces and whose other one turns it.
fn controls_told(scenario: &Scenario) -> Scenario {
    let Scenario {
        model: mut told,
        mut truth,
        rule,
    } = scenario.clone();
    if let Some(noise) = truth.motion.noise.take() {
        told.motion.noise = noise;
    }
    truth.motion.controls.clear();
    let [forward, turn] = told.actions.as_slice() else {
        return Scenario {
            model: told,
            truth,
            rule,
        };
    };
    let (mut east, mut west, turn) = (forward.clone(), forward.clone(), turn.clone());
    (east.name, east.control[0]) = ("EAST".to_owned(), 1.0);
    (west.name, west.control[0]) = ("WEST".to_owned(), -1.0);
    told.actions = vec![east, turn, west];
    for reward in &mut told.rewards {
        reward.actions = Some(vec![0, 2]);
    }
    let mut forbidden = told.rewards[0].clone();
    forbidden.region = Region::everywhere();
    forbidden.value = -1_000.0;
    for (mode, name) in scenario.model.modes.iter().enumerate() {
        forbidden.mode = Some(mode);
        forbidden.actions = Some(vec![if name.starts_with("east") { 2 } else { 0 }]);
        told.rewards.push(forbidden.clone());
    }
    Scenario {
        model: told,
        truth,
        rule,
    }
}

/// A policy that is shown the true mode at every step.
fn mode_seen(scenario: &Scenario, policy: &dyn Policy, options: Options) -> Evaluation {
    let model = &scenario.model;
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
        fn observe(&mut self, action: ActionId, reading: Reading<'_>) {
            self.filter
                .update(&mut self.belief, action, reading, &mut self.scratch);
        }
        fn belief(&self) -> Option<&Belief> {
            Some(&self.belief)
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
    let mut world = ProblemWorld::new(scenario);
    let mut observation = Observation::new(model.observation_dim());
    let episodes: Vec<_> = (0..options.episodes)
        .map(|episode| {
            let mut draws = Streams::new(options.seed, episode as u64);
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
        lost: None,
    }
}

/// The best of all 1024 maps from ten cells of the line to two actions.
fn best_memoryless(scenario: &Scenario, options: Options, observer: &dyn Progress) -> Evaluation {
    const MAPS: usize = 1 << 10;
    struct Map(usize);
    impl Policy for Map {
        fn action(&self, belief: &Belief) -> ActionId {
            self.0 >> ((belief.mean[0] / 0.4).clamp(0.0, 9.0) as usize) & 1
        }
    }
    let filter = BeliefMdp::new(&scenario.model).filter();
    let earned = |map: &Map, options| evaluate(scenario, &filter, map, options, observer);
    let quick = Options {
        episodes: 60,
        seed: 31,
    };
    let worths: Vec<f64> = (0..MAPS)
        .map(|map| earned(&Map(map), quick).undiscounted.mean)
        .collect();
    let best = (0..MAPS).fold(0, |best, map| {
        if worths[map] > worths[best] {
            map
        } else {
            best
        }
    });
    earned(&Map(best), options)
}
