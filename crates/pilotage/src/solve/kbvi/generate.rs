//! Policy generation (thesis 5.4, Figure 5.8): run the agent with KBVI's branches, and turn the beliefs it meets into nodes.
//!
//! For every horizon the agent is run anew, and the automaton built anew by the rule of its form. The horizon from which on the
//! number of nodes no longer changes is the *policy convergence horizon*.

use super::branches::Branches;
use crate::belief::{Belief, BeliefMdp};
use crate::error::{Error, Result};
use crate::model::ActionId;
use crate::parallel;
use crate::policy::{Automaton, Matching, Policy, first_best};
use crate::progress::Progress;
use crate::scenario::Scenario;
use crate::simulate::{TrackingAgent, run_episode};
use crate::solve::compile::annotate;
use crate::solve::rollout::check_runs;
use crate::solve::settings::ensure;
use crate::world::{Observation, ProblemWorld, Streams};

/// Most steps that are looked ahead: the search is as deep.
const MOST_HORIZON: usize = 1000;

/// Checks the first and the last horizon tried.
///
/// # Errors
/// [`Error::Setting`] for one that is too far, and for a last one before the first.
pub(super) fn check_horizons(first: usize, last: usize) -> Result<()> {
    for (setting, horizon) in [("first_horizon", first), ("last_horizon", last)] {
        ensure(setting, horizon, horizon <= MOST_HORIZON, "at most 1000")?;
    }
    let range = "at least the first horizon";
    ensure("last_horizon", last, last >= first, range)
}

/// Settings of policy generation.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Form of the automaton.
    pub matching: Matching,
    /// The search at each belief; its horizon is the first one tried.
    pub search: super::branches::Settings,
    /// Last horizon tried, at least the first, at most 1000.
    pub last_horizon: usize,
    /// Horizons over which the number of nodes must not change, at least 1.
    pub repeats: usize,
    /// Runs of the agent for each horizon, 1 to a million. (Figure 5.8 makes one.)
    pub runs: usize,
    /// Whether the agent looks less far ahead with every step, as in Figure 5.8, and not always equally far.
    pub decreasing: bool,
    /// Seed of the runs.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            matching: Matching::Nearest,
            search: super::branches::Settings {
                horizon: 3,
                ..Default::default()
            },
            last_horizon: 20,
            repeats: 3,
            runs: 100,
            decreasing: false,
            seed: 1,
        }
    }
}

/// What policy generation found.
#[derive(Debug, Clone)]
pub struct Generated {
    /// The automaton of the last horizon.
    pub automaton: Automaton,
    /// The policy convergence horizon, where there is one.
    pub convergence_horizon: Option<usize>,
    /// Horizon and number of nodes, one after the other.
    pub history: Vec<(usize, usize)>,
}

/// Generates a policy (Figure 5.8).
///
/// # Errors
/// [`Error::Setting`] for settings out of range; [`Error::Unsupported`] for a model that tests places after the move.
pub fn generate(
    mdp: &BeliefMdp,
    settings: &Settings,
    observer: &dyn Progress,
) -> Result<Generated> {
    let first = settings.search.horizon;
    check_horizons(first, settings.last_horizon)?;
    check_runs("runs", settings.runs)?;
    for (setting, value) in [
        ("repeats", settings.repeats),
        ("group", settings.search.group),
    ] {
        if value == 0 {
            return Err(Error::Setting {
                setting,
                value: "0".to_owned(),
                range: "at least 1",
            });
        }
    }
    super::accepts(mdp.model())?;
    let planner = Branches::new(mdp.clone(), settings.search);
    let mut history: Vec<(usize, usize)> = Vec::new();
    let mut automaton = Automaton::new(mdp, super::SOLVER, settings.matching);
    let total = (settings.last_horizon - first + 1) as u64;
    observer.progress("horizons", 0, total);
    for horizon in first..=settings.last_horizon {
        automaton = at_horizon(&planner.with_horizon(horizon), settings);
        history.push((horizon, automaton.nodes.len()));
        observer.progress("horizons", (horizon - first + 1) as u64, total);
        if settled(&history, settings.repeats) {
            break;
        }
    }
    let convergence_horizon = settled(&history, settings.repeats)
        .then(|| history[history.len() - 1 - settings.repeats].0);
    annotate(&mut automaton, mdp, settings.runs.max(200), settings.seed);
    Ok(Generated {
        automaton,
        convergence_horizon,
        history,
    })
}

/// Whether the number of nodes has stayed the same over the last `repeats` horizons.
fn settled(history: &[(usize, usize)], repeats: usize) -> bool {
    history.len() > repeats
        && history[history.len() - 1 - repeats..]
            .iter()
            .all(|(_, nodes)| *nodes == history[history.len() - 1].1)
}

fn at_horizon(planner: &Branches, settings: &Settings) -> Automaton {
    let mut automaton = Automaton::new(planner.mdp(), super::SOLVER, settings.matching);
    let runs = parallel::map(settings.runs, |run| run_once(planner, settings, run as u64));
    for (belief, action, value) in runs.into_iter().flatten() {
        automaton.learn(&belief, action, value);
    }
    if settings.matching == Matching::Segments {
        automaton.merge_segments();
    }
    automaton.planned_value = planner.value(planner.mdp().start());
    automaton
}

/// One run of the agent (lines 5 to 14 of Figure 5.8): the beliefs it met, what it did there and what it expected.
fn run_once(planner: &Branches, settings: &Settings, run: u64) -> Vec<(Belief, ActionId, f64)> {
    let mdp = planner.mdp();
    let model = mdp.model();
    let horizon = planner.horizon();
    let thinker = Thinker {
        planner,
        decreasing: settings.decreasing,
        met: std::sync::Mutex::new(Vec::new()),
    };
    let filter = mdp.filter();
    let mut agent = TrackingAgent::new(&filter, &thinker);
    let mut observation = Observation::new(model.observation_dim());
    let mut draws = Streams::new(settings.seed, run);
    let length = (horizon + 1).min(model.episode.length);
    run_episode(
        &mut ProblemWorld::new(&Scenario::assumed(model)),
        &mut agent,
        &mut draws,
        &mut observation,
        (length, model.discount),
        &mut |_, _| {},
    );
    drop(agent);
    thinker.met.into_inner().unwrap_or_default()
}

/// KBVI as a policy that remembers the beliefs it was asked about.
struct Thinker<'a> {
    planner: &'a Branches,
    decreasing: bool,
    met: std::sync::Mutex<Vec<(Belief, ActionId, f64)>>,
}

impl Policy for Thinker<'_> {
    fn action(&self, belief: &Belief) -> ActionId {
        let Ok(mut met) = self.met.lock() else {
            return 0;
        };
        let left = if self.decreasing {
            self.planner.horizon() - met.len().min(self.planner.horizon())
        } else {
            self.planner.horizon()
        };
        let q = self.planner.with_horizon(left).q_values(belief);
        let action = first_best(&q);
        met.push((belief.clone(), action, q[action]));
        action
    }
}
