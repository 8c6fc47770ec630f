//! What a solver is: a planner, which is handed a model, or a learner, which is handed worlds to act in as well.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::lqg::LqgController;
use super::{Form, Learning, refusals};
use crate::belief::{BeliefMdp, BeliefSpace};
use crate::error::{Error, Result};
use crate::model::{Model, TrackerKind};
use crate::policy::{Automaton, Policy, PolicyGraph};
use crate::progress::Progress;
use crate::world::World;

/// Finds a policy from what is assumed. Its value carries its settings.
pub trait Planner: Send + Sync {
    /// Its name, as on the command line and in policies.
    fn name(&self) -> &'static str;

    /// Whether it is made for such a model, with the settings it has.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the reason, and what would do.
    fn accepts(&self, model: &Model) -> Result<()>;

    /// Whether it is one to try first for a model that it accepts: it finds something good in a minute or two.
    fn suits(&self, model: &Model) -> bool {
        let _ = model;
        true
    }

    /// Whether it plans on the uncertainty levels of a linear model; one that does not is handed models of any kind.
    fn needs_levels(&self) -> bool {
        true
    }

    /// Plans.
    ///
    /// # Errors
    /// As [`Planner::accepts`], [`Error::Setting`] for settings out of range, and the planner's own.
    fn plan(&self, problem: &Problem, observer: &dyn Progress) -> Result<Plan>;

    /// Whether what it finds for a model becomes an automaton: all but a free control does.
    fn makes_automaton(&self, model: &Model) -> bool {
        let _ = model;
        true
    }

    /// Whether it finds a policy graph for a model that it accepts, where the form asked for is [`Form::Graph`].
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the reason, and what would do.
    fn makes_graph(&self, model: &Model) -> Result<()> {
        Err(no_graph(self.name(), model))
    }
}

/// Makes a world to act in.
pub type Worlds<'a> = dyn Fn() -> Box<dyn World> + Sync + 'a;

/// Finds a policy by acting. Its value carries its settings. Most are a [`super::Course`], run by [`super::run_course`].
pub trait Learner: Send + Sync {
    /// Its name, as on the command line and in policies.
    fn name(&self) -> &'static str;

    /// Whether it is made for such a model, with the settings it has.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the reason, and what would do; [`Error::Setting`] for settings out of range.
    fn accepts(&self, model: &Model) -> Result<()>;

    /// Learns in the worlds that `worlds` makes. With a checkpoint file it keeps its state there and goes on from there if the file
    /// exists.
    ///
    /// # Errors
    /// As [`Learner::accepts`], [`Error::Checkpoint`] for a checkpoint of another run or a damaged one, [`Error::Io`] where it cannot
    /// be read or written.
    fn learn(
        &self,
        problem: &Problem,
        worlds: &Worlds<'_>,
        checkpoint: Option<&Path>,
        observer: &dyn Progress,
    ) -> Result<Lesson>;
}

/// A solver of either kind.
pub enum Solver {
    /// Plans from the model.
    Planner(Box<dyn Planner>),
    /// Learns from experience.
    Learner(Box<dyn Learner>),
}

impl Solver {
    /// A planner.
    pub fn planner(planner: impl Planner + 'static) -> Self {
        Self::Planner(Box::new(planner))
    }

    /// A learner.
    pub fn learner(learner: impl Learner + 'static) -> Self {
        Self::Learner(Box::new(learner))
    }

    /// Its name, as on the command line and in policies.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Planner(planner) => planner.name(),
            Self::Learner(learner) => learner.name(),
        }
    }

    /// Whether it learns from experience, rather than plan from the model.
    pub fn learns(&self) -> bool {
        matches!(self, Self::Learner(_))
    }

    /// Whether it is made for such a model, with the settings it has.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the reason, and what would do; [`Error::Setting`] for settings out of range.
    pub fn accepts(&self, model: &Model) -> Result<()> {
        match self {
            Self::Planner(planner) => accepted(planner.as_ref(), model),
            Self::Learner(learner) => learner.accepts(model),
        }
    }

    /// Whether it is one to try first for a model that it accepts. Who plans on uncertainty levels is not where the model asks for another
    /// tracker.
    pub fn suits(&self, model: &Model) -> bool {
        match self {
            Self::Planner(planner) => {
                let levels = model.tracker() == TrackerKind::Linear;
                (levels || !planner.needs_levels()) && planner.suits(model)
            }
            Self::Learner(_) => false,
        }
    }

    /// The form that suits what it finds: a tree where beliefs are kept in full, nearest points on uncertainty levels.
    pub fn form(&self) -> Form {
        match self {
            Self::Planner(planner) if !planner.needs_levels() => Form::Tree,
            _ => Form::Nearest,
        }
    }

    /// Whether what it finds for a model becomes an automaton: all but a free control does.
    pub fn makes_automaton(&self, model: &Model) -> bool {
        match self {
            Self::Planner(planner) => planner.makes_automaton(model),
            Self::Learner(_) => true,
        }
    }

    /// Whether what it finds for a model that it accepts can have a form: any but a policy graph can.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the reason, and what would do.
    pub fn gives(&self, form: Form, model: &Model) -> Result<()> {
        match self {
            _ if form != Form::Graph => Ok(()),
            Self::Planner(planner) => planner.makes_graph(model),
            Self::Learner(learner) => Err(no_graph(learner.name(), model)),
        }
    }
}

/// What is asked of a solver, whichever it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Form of the policy.
    pub form: Form,
    /// Seed of every random number.
    pub seed: u64,
    /// Most nodes of a tree or graph, at least 1; `None` for as many as it takes.
    pub nodes: Option<usize>,
    /// Return that such a policy may lose, as a share of that of the plan; `None` for 1 %.
    pub loss: Option<f64>,
    /// Episodes run to see which beliefs a policy meets, 1 to a million.
    pub runs: usize,
    /// File in which a learner keeps its state, to go on from there if it is stopped.
    pub checkpoint: Option<PathBuf>,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            form: Form::default(),
            seed: 1,
            nodes: None,
            loss: None,
            runs: 2000,
            checkpoint: None,
        }
    }
}

impl Request {
    /// How large the policy may be.
    pub(super) fn size(&self) -> Size {
        Size {
            nodes: self.nodes,
            loss: self.loss,
        }
    }

    /// A policy in this form, and everything else by default.
    pub fn form(form: Form) -> Self {
        Self {
            form,
            ..Self::default()
        }
    }
}

/// What a solver is handed: what is assumed and what is asked. Nothing true can be reached from here.
#[derive(Debug, Clone)]
pub struct Problem {
    model: Model,
    mdp: OnceLock<BeliefMdp>,
    form: Form,
    size: Size,
    seed: u64,
}

/// How large a tree or graph may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Most nodes, at least 1; `None` for as many as it takes.
    pub nodes: Option<usize>,
    /// Share of the return of the plan that it may lose, at least 0; `None` for 1 %.
    pub loss: Option<f64>,
}

/// Share of the plan's return that a tree or graph may lose, unless it is said.
const LOSS: f64 = 0.01;

impl Size {
    /// Share of the return of the plan that may be lost.
    pub(super) fn loss(self) -> f64 {
        self.loss.unwrap_or(LOSS)
    }

    /// Whether it can be, and is said of a form that has a size.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub(super) fn check(self, has_size: bool) -> Result<()> {
        let fail = |setting, value: String, range| {
            Err(Error::Setting {
                setting,
                value,
                range,
            })
        };
        const ALONE: &str = "for the forms tree and graph alone";
        match (self.nodes, self.loss) {
            (Some(nodes), _) if nodes == 0 => fail("nodes", nodes.to_string(), "at least 1"),
            (_, Some(loss)) if loss < 0.0 || loss.is_nan() => {
                fail("loss", loss.to_string(), "at least 0")
            }
            (Some(nodes), _) if !has_size => fail("nodes", nodes.to_string(), ALONE),
            (_, Some(loss)) if !has_size => fail("loss", loss.to_string(), ALONE),
            _ => Ok(()),
        }
    }
}

impl Problem {
    /// The problem of a model, with what is asked of its solver.
    pub fn new(model: &Model, request: &Request) -> Self {
        Self {
            model: model.clone(),
            mdp: OnceLock::new(),
            form: request.form,
            size: request.size(),
            seed: request.seed,
        }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The belief decision process of the model on uncertainty levels, for planners that [need](Planner::needs_levels) them: those of a
    /// model that is not linear are not its own.
    pub fn mdp(&self) -> &BeliefMdp {
        self.mdp.get_or_init(|| BeliefMdp::new(&self.model))
    }

    /// Form in which the policy is wanted. A planner may hand over any; it is brought into this form afterwards.
    pub fn form(&self) -> Form {
        self.form
    }

    /// How large a policy graph may be; trees are grown afterwards.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Seed of every random number.
    pub fn seed(&self) -> u64 {
        self.seed
    }
}

/// What a planner found.
pub struct Plan {
    /// The policy.
    pub policy: Found,
    /// Return it expects from the start, where it knows.
    pub value: Option<f64>,
    /// Whether the planner's own test of convergence was passed.
    pub converged: bool,
    /// The horizon from which on the number of nodes no longer changes, where the planner has one (thesis 5.4).
    pub policy_convergence_horizon: Option<usize>,
    /// What is to be known of it: where it is not what it seems, and why.
    pub remarks: Vec<String>,
}

/// A policy as a planner has it.
// There is one at a time, so its size does not matter.
#[allow(clippy::large_enum_variant)]
pub enum Found {
    /// A rule that can be asked at every belief.
    Rule {
        /// The rule.
        policy: Box<dyn Policy>,
        /// The beliefs it is asked at.
        space: Box<dyn BeliefSpace>,
    },
    /// An automaton.
    Automaton(Automaton),
    /// A policy graph, for those who asked for one.
    Graph(PolicyGraph),
    /// A feedback on the mean that gives a free control.
    Control(LqgController),
}

impl Plan {
    /// A rule for beliefs, which knows what it expects from the start if any does.
    pub fn rule(policy: impl Policy + 'static, space: impl BeliefSpace + 'static) -> Self {
        Self {
            value: policy.value(space.start()),
            ..Self::of(Found::Rule {
                policy: Box::new(policy),
                space: Box::new(space),
            })
        }
    }

    /// An automaton, with what it says that it is worth.
    pub fn automaton(automaton: Automaton) -> Self {
        Self {
            value: automaton.planned_value,
            ..Self::of(Found::Automaton(automaton))
        }
    }

    /// A policy graph, with what it says that it is worth.
    pub fn graph(graph: PolicyGraph) -> Self {
        Self {
            value: graph.planned_value,
            ..Self::of(Found::Graph(graph))
        }
    }

    /// A policy of which nothing is known but that it was found.
    pub fn of(policy: Found) -> Self {
        Self {
            policy,
            value: None,
            converged: true,
            policy_convergence_horizon: None,
            remarks: Vec::new(),
        }
    }
}

/// What a learner found.
pub struct Lesson {
    /// The automaton, in the form that was learned. It runs without seeing rewards.
    pub automaton: Automaton,
    /// Whether the learner's own test of convergence was passed.
    pub converged: bool,
    /// Steps of experience, trials included.
    pub samples: u64,
    /// How it came about.
    pub learning: Learning,
    /// What is to be known of it: where it is not what it seems, and why.
    pub remarks: Vec<String>,
}

/// Whether a planner is made for a model, and levels follow it where the planner needs them.
///
/// # Errors
/// As [`Planner::accepts`].
pub(super) fn accepted(planner: &dyn Planner, model: &Model) -> Result<()> {
    if planner.needs_levels() {
        refuse_if(planner.name(), model, refusals::beyond_levels(model))?;
    }
    planner.accepts(model)
}

/// Refuses a model, with the reason and what would do.
pub(super) fn refuse(solver: &'static str, model: &Model, reason: impl Into<String>) -> Error {
    Error::Unsupported {
        solver,
        model: model.name.clone(),
        reason: reason.into(),
    }
}

/// What is said where there is no policy graph.
pub(super) fn no_graph(solver: &'static str, model: &Model) -> Error {
    let reason = match model.laws.symbols.is_empty() {
        true => {
            "a policy graph needs a discrete sensor (`symbols` in [sensor]), and it has none; use another form, such as tree"
        }
        false => {
            "this solver finds no policy graph; use point-based, or another form, such as tree"
        }
    };
    refuse(solver, model, reason)
}

/// Refuses a model for the reason, if there is one.
///
/// # Errors
/// [`Error::Unsupported`].
pub(super) fn refuse_if(solver: &'static str, model: &Model, reason: Option<String>) -> Result<()> {
    reason.map_or(Ok(()), |reason| Err(refuse(solver, model, reason)))
}
