//! The solvers by name: which there are, and what each accepts.

use super::kbvi::quadratic;
use super::{SolveSettings, arkaq, kafaq, lqg, mdp};
use crate::belief::BeliefMdp;
use crate::error::{Error, Result};
use crate::model::{Interval, Model, When, suggest};

/// The solvers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SolverKind {
    /// The thesis' open-loop branches (chapter 5).
    Kbvi,
    /// Closed-loop KBVI: value iteration on level and mean.
    KbviClosed,
    /// The linear-quadratic-Gaussian controller.
    Lqg,
    /// Q_MDP (Littman, Cassandra and Kaelbling, 1995).
    Qmdp,
    /// Most likely state (Nourbakhsh, Powers and Birchfield, 1995).
    Mls,
    /// KAFAQ-learning (thesis chapter 4).
    Kafaq,
    /// ARKAQ-learning (thesis chapter 3).
    Arkaq,
}

impl SolverKind {
    /// All solvers.
    pub const ALL: [Self; 7] = [
        Self::KbviClosed,
        Self::Kbvi,
        Self::Lqg,
        Self::Qmdp,
        Self::Mls,
        Self::Kafaq,
        Self::Arkaq,
    ];

    /// Its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kbvi => "kbvi",
            Self::KbviClosed => "kbvi-closed",
            Self::Lqg => "lqg",
            Self::Qmdp => "qmdp",
            Self::Mls => "mls",
            Self::Kafaq => "kafaq",
            Self::Arkaq => "arkaq",
        }
    }

    /// What it is, in one line.
    pub fn about(self) -> &'static str {
        match self {
            Self::Kbvi => "open-loop branches to a finite horizon (thesis chapter 5)",
            Self::KbviClosed => "value iteration on uncertainty level and mean",
            Self::Lqg => "linear feedback on the mean, for quadratic cost or the nearest action",
            Self::Qmdp => "acts as if all uncertainty were gone after this step",
            Self::Mls => "acts as if the most likely state were certain",
            Self::Kafaq => "learns regions of belief by trial, told neither map nor rewards",
            Self::Arkaq => "learns clusters of belief by trial, with those before as memory",
        }
    }

    /// The solver of that name.
    ///
    /// # Errors
    /// [`Error::Unknown`] with the nearest name.
    pub fn parse(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| Error::Unknown {
            what: "solver",
            name: name.to_owned(),
            hint: suggest(name, Self::ALL.map(Self::name)),
        })
    }

    /// Whether it learns from experience, rather than plan from the model.
    pub fn learns(self) -> bool {
        matches!(self, Self::Kafaq | Self::Arkaq)
    }

    /// Whether it is made for such a model, with its default settings.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the reason, and what would do.
    pub fn accepts(self, model: &Model) -> Result<()> {
        self.accepts_with(model, &SolveSettings::default())
    }

    /// As [`SolverKind::accepts`], for a learner with these settings.
    pub(super) fn accepts_with(self, model: &Model, settings: &SolveSettings) -> Result<()> {
        let reason = match self {
            Self::Kbvi => reward_missing(model).or_else(|| pays_afterwards(model)),
            Self::KbviClosed if quadratic::suits(model) => {
                quadratic::refusal(&BeliefMdp::new(model))
            }
            Self::KbviClosed => nothing_paid(model).or_else(|| bound_missing(model)),
            Self::Lqg => lqg::use_of(model).err(),
            Self::Qmdp | Self::Mls => reward_missing(model)
                .or_else(|| pays_afterwards(model))
                .or_else(|| changes(model))
                .or_else(|| bound_missing(model))
                .or_else(|| too_many_variables(model)),
            Self::Kafaq | Self::Arkaq => reward_missing(model),
        };
        match reason {
            None if self == Self::Kafaq => kafaq::accepts(model, &settings.kafaq),
            None if self == Self::Arkaq => arkaq::accepts(model, &settings.arkaq),
            None => Ok(()),
            Some(reason) => Err(Error::Unsupported {
                solver: self.name(),
                model: model.name.clone(),
                reason,
            }),
        }
    }
}

/// Those that maximise reward need some, discounted.
fn nothing_paid(model: &Model) -> Option<String> {
    let pays = !model.rewards.is_empty()
        || !model.events.is_empty()
        || model.episode.failure_reward != 0.0
        || model.cost.is_some();
    if !pays {
        return Some("nothing in it pays a reward; add a [[reward]] or a [cost]".to_owned());
    }
    None
}

/// Sums without end need a discount.
fn reward_missing(model: &Model) -> Option<String> {
    if let Some(reason) = nothing_paid(model) {
        return Some(reason);
    }
    (model.discount >= 1.0).then(|| {
        "its discount is 1, and a sum without end needs one below 1; set `discount` to 0.99 or less"
            .to_owned()
    })
}

/// Some solvers pay by `r(s, a)` only.
fn pays_afterwards(model: &Model) -> Option<String> {
    let rewards = model.rewards.iter().map(|reward| reward.when);
    let mut asked = rewards.chain(model.events.iter().map(|event| event.when));
    asked.any(|when| when == When::After).then(|| {
        "it pays for where a step has led (`when = \"after\"`), and this solver only for where it begins; use kbvi-closed or state the rewards by action and place".to_owned()
    })
}

/// Values of true states do not tell the step.
fn changes(model: &Model) -> Option<String> {
    let clock = model.clock();
    (clock > 0).then(|| {
        format!("what it pays or changes depends on the step of the episode up to step {clock}, and this solver's values do not; use kbvi-closed")
    })
}

/// Planners on a grid need to know where to put it.
fn bound_missing(model: &Model) -> Option<String> {
    let unbounded = model
        .state
        .iter()
        .find(|variable| variable.bounds == Interval::ALL)?;
    Some(format!(
        "`{}` has no bounds to put a grid between; add `bounds` to [state]",
        unbounded.name
    ))
}

fn too_many_variables(model: &Model) -> Option<String> {
    let (n, most) = (model.state_dim(), mdp::MOST_VARIABLES);
    (n > most).then(|| {
        format!(
            "it has {n} state variables, and a grid of true states is fine enough for {most} at most; use kbvi-closed or lqg"
        )
    })
}
