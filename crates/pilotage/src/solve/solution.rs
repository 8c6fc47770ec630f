//! What a solver hands over, in the form asked for.

use super::lqg::LqgController;
use crate::belief::Updater;
use crate::error::{Error, Result};
use crate::model::suggest;
use crate::policy::{Automaton, AutomatonRunner, GraphRunner, Matching, Policy, PolicyGraph};
use crate::progress::Progress;
use crate::scenario::Scenario;
use crate::simulate::{
    Agent, Agents, Difference, Evaluation, Options, TrackingAgent, compare_agents, evaluate_agent,
};

/// Form of the policy a planner hands over. Learners hand over the form they learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// An automaton matched by nearest neighbour (5.4.2).
    #[default]
    Nearest,
    /// An automaton of belief segments (5.4.1).
    Segments,
    /// An automaton whose nodes are the leaves of a decision tree.
    Tree,
    /// The planner itself, asked at every belief: nothing is compiled.
    Grid,
    /// A policy graph, which needs no belief, where the sensor is discrete.
    Graph,
}

impl Form {
    /// All forms.
    pub const ALL: [Self; 5] = [
        Self::Nearest,
        Self::Segments,
        Self::Tree,
        Self::Grid,
        Self::Graph,
    ];

    /// Its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nearest => "nearest",
            Self::Segments => "segments",
            Self::Tree => "tree",
            Self::Grid => "grid",
            Self::Graph => "graph",
        }
    }

    /// The form of that name.
    ///
    /// # Errors
    /// [`Error::Unknown`] with the nearest name.
    pub fn parse(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|form| form.name() == name);
        found.ok_or_else(|| Error::Unknown {
            what: "policy form",
            name: name.to_owned(),
            hint: suggest(name, Self::ALL.map(Self::name)),
        })
    }

    /// Whether it is said of it how small it is to be, as of a tree and a graph.
    pub fn has_size(self) -> bool {
        matches!(self, Self::Tree | Self::Graph)
    }

    /// How automata of this form are matched; nodes found on the way to something else are points.
    pub(super) fn matching(self) -> Matching {
        match self {
            Self::Nearest | Self::Grid | Self::Graph => Matching::Nearest,
            Self::Segments => Matching::Segments,
            Self::Tree => Matching::Tree,
        }
    }
}

/// How a learner learned, to be told and drawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Learning {
    /// What was found, in words: `with ...`.
    pub found: String,
    /// Reward a step over the steps of experience, a line for each attempt.
    pub returns: Vec<Line>,
    /// What the values are of.
    pub valued: &'static str,
    /// Value of what it does over the steps of experience, a line for each place or state it tells apart.
    pub values: Vec<Line>,
}

/// A line through points.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Line {
    /// What it is of.
    pub name: String,
    /// Its points, from left to right.
    pub points: Vec<(f64, f64)>,
}

/// What a solver found.
pub struct Solution {
    /// The policy.
    pub policy: Solved,
    /// Return it expects from the start, where it knows.
    pub planned_value: Option<f64>,
    /// The horizon from which on the number of nodes no longer changes, where the solver has one (thesis 5.4).
    pub policy_convergence_horizon: Option<usize>,
    /// Uncertainty levels, or strata, of the belief; 0 for a policy that needs none.
    pub levels: usize,
    /// Steps of experience used; `None` for planners.
    pub samples: Option<u64>,
    /// How learning went; `None` for planners.
    pub learning: Option<Learning>,
    /// Whether the solver's own test of convergence was passed.
    pub converged: bool,
    /// What is to be known of it: where it is not what it seems, and why.
    pub remarks: Vec<String>,
}

/// A policy and all it takes to run it.
// There is one at a time, so its size does not matter.
#[allow(clippy::large_enum_variant)]
pub enum Solved {
    /// A finite automaton, with its filter inside.
    Automaton(Automaton),
    /// A policy graph, which needs no filter.
    Graph(PolicyGraph),
    /// A feedback on the mean that gives a free control, with its filter inside.
    Control(LqgController),
    /// A rule that is asked at every belief, and the filter that keeps the belief.
    Rule {
        /// The rule.
        policy: Box<dyn Policy>,
        /// Keeps the belief.
        updater: Updater,
    },
}

impl Solution {
    /// The automaton, where it was compiled into one.
    pub fn automaton(&self) -> Option<&Automaton> {
        match &self.policy {
            Solved::Automaton(automaton) => Some(automaton),
            Solved::Graph(_) | Solved::Control(_) | Solved::Rule { .. } => None,
        }
    }

    /// The policy graph, where it is one.
    pub fn graph(&self) -> Option<&PolicyGraph> {
        match &self.policy {
            Solved::Graph(graph) => Some(graph),
            Solved::Automaton(_) | Solved::Control(_) | Solved::Rule { .. } => None,
        }
    }

    /// Number of nodes, where it has some.
    pub fn nodes(&self) -> Option<usize> {
        let graph = self.graph().map(|graph| graph.nodes.len());
        graph.or_else(|| self.automaton().map(|automaton| automaton.nodes.len()))
    }

    /// What compiling cost: the discounted return of the planner itself, solved as [`Form::Grid`], less that of this automaton or graph of
    /// it, over the same episodes. `None` where this is neither, or the other no rule.
    pub fn value_lost(
        &self,
        planner: &Self,
        scenario: &Scenario,
        options: Options,
        observer: &dyn Progress,
    ) -> Option<Difference> {
        let (Solved::Rule { .. }, Solved::Automaton(_) | Solved::Graph(_)) =
            (&planner.policy, &self.policy)
        else {
            return None;
        };
        let compared = planner.acting(|planner| {
            self.acting(|own| compare_agents(scenario, planner, own, options, observer))
        });
        compared.ok()?.ok()
    }

    /// Hands over agents that act by this solution, on a belief or on readings alone; `Err` with a free control, by which none does.
    pub(super) fn acting<T>(
        &self,
        hand_over: impl FnOnce(&Agents<'_, '_>) -> T,
    ) -> std::result::Result<T, &LqgController> {
        fn tracking<'a>(
            updater: &'a Updater,
            policy: &'a dyn Policy,
        ) -> impl Fn() -> Box<dyn Agent + 'a> + Sync {
            move || Box::new(TrackingAgent::new(updater, policy))
        }
        match &self.policy {
            Solved::Automaton(automaton) => {
                let runner = AutomatonRunner::new(automaton);
                Ok(hand_over(&tracking(&automaton.updater, &runner)))
            }
            Solved::Rule { policy, updater } => Ok(hand_over(&tracking(updater, policy.as_ref()))),
            Solved::Graph(graph) => Ok(hand_over(&|| Box::new(GraphRunner::new(graph)))),
            Solved::Control(controller) => Err(controller),
        }
    }

    /// Runs the policy in the scenario's world, by the standard of [`crate::simulate`].
    ///
    /// # Errors
    /// As [`LqgController::evaluate`], for a free control.
    pub fn evaluate(
        &self,
        scenario: &Scenario,
        options: Options,
        observer: &dyn Progress,
    ) -> Result<Evaluation> {
        self.acting(|agents| evaluate_agent(scenario, agents, options, observer))
            .map_or_else(
                |controller| controller.evaluate(scenario, options, observer),
                Ok,
            )
    }
}
