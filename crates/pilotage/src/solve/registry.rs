//! The solvers by name.

use super::settings::{SettingInfo, Settings};
use super::solver::{Learner, Planner, Solver};
use super::{
    Arkaq, CodebookPlanner, Kafaq, Kbvi, Lqg, Mls, PointBased, PolicySearch, Qmdp, ValueIteration,
};
use crate::error::{Error, Result};
use crate::model::{Model, suggest};

/// Every solver of the library, the first that accepts a model being the one to try first.
const BUILTIN: [Entry; 10] = [
    Entry::planner::<ValueIteration>(
        "value-iteration",
        &["kbvi-closed"],
        "value iteration on uncertainty level and mean",
    ),
    Entry::planner::<PolicySearch>(
        "policy-search",
        &[],
        "moves the planes at which an automaton switches to where it fails least",
    ),
    Entry::planner::<Lqg>(
        "lqg",
        &[],
        "linear feedback on the mean, for quadratic cost or the nearest action",
    ),
    Entry::planner::<Kbvi>(
        "kbvi",
        &[],
        "open-loop branches to a finite horizon (thesis chapter 5)",
    ),
    Entry::planner::<Qmdp>(
        "qmdp",
        &[],
        "acts as if all uncertainty were gone after this step",
    ),
    Entry::planner::<Mls>("mls", &[], "acts as if the most likely state were certain"),
    Entry::planner::<PointBased>(
        "point-based",
        &[],
        "values of policies, backed up at beliefs on cells, for one or two variables",
    ),
    Entry::planner::<CodebookPlanner>(
        "codebook",
        &[],
        "value iteration on strata and means of beliefs of any kind",
    ),
    Entry::learner::<Kafaq>(
        "kafaq",
        &[],
        "learns regions of belief by trial, told neither map nor rewards",
    ),
    Entry::learner::<Arkaq>(
        "arkaq",
        &[],
        "learns clusters of belief by trial, with those before as memory",
    ),
];

/// A solver that can be asked for by name.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    name: &'static str,
    other_names: &'static [&'static str],
    about: &'static str,
    learns: bool,
    settings: fn() -> Vec<SettingInfo>,
    make: fn(&[(String, String)]) -> Result<Solver>,
}

impl Entry {
    /// A planner with its name, other names it is understood by, and what it is in one line.
    pub const fn planner<P: Planner + Settings + 'static>(
        name: &'static str,
        other_names: &'static [&'static str],
        about: &'static str,
    ) -> Self {
        Self {
            name,
            other_names,
            about,
            learns: false,
            settings: P::described,
            make: |settings| Ok(Solver::planner(configured::<P>(settings)?)),
        }
    }

    /// A learner with its name, other names it is understood by, and what it is in one line.
    pub const fn learner<L: Learner + Settings + 'static>(
        name: &'static str,
        other_names: &'static [&'static str],
        about: &'static str,
    ) -> Self {
        Self {
            name,
            other_names,
            about,
            learns: true,
            settings: L::described,
            make: |settings| Ok(Solver::learner(configured::<L>(settings)?)),
        }
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// What it is, in one line.
    pub fn about(&self) -> &'static str {
        self.about
    }

    /// Whether it learns from experience, rather than plan from the model.
    pub fn learns(&self) -> bool {
        self.learns
    }

    /// What it can be told.
    pub fn settings(&self) -> Vec<SettingInfo> {
        (self.settings)()
    }

    /// Whether it is made for such a model, with its default settings.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the reason, and what would do.
    pub fn accepts(&self, model: &Model) -> Result<()> {
        self.solver(&[])?.accepts(model)
    }

    /// The solver with some settings other than their defaults, by name and as in JSON.
    ///
    /// # Errors
    /// [`Error::Unknown`] for a setting that it does not have, with those it has; [`Error::Setting`] for a value out of range.
    pub fn solver(&self, settings: &[(String, String)]) -> Result<Solver> {
        (self.make)(settings)
    }
}

fn configured<S: Settings>(told: &[(String, String)]) -> Result<S> {
    let mut settings = S::default();
    for (name, value) in told {
        settings.set(name, value)?;
    }
    settings.validate()?;
    Ok(settings)
}

/// Solvers by name, in the order in which they are tried where none is named.
#[derive(Debug, Clone)]
pub struct Registry {
    entries: Vec<Entry>,
}

impl Default for Registry {
    fn default() -> Self {
        Self::builtin()
    }
}

impl Registry {
    /// The solvers of the library.
    pub fn builtin() -> Self {
        Self {
            entries: BUILTIN.to_vec(),
        }
    }

    /// With one more, which is tried last.
    pub fn with(mut self, entry: Entry) -> Self {
        self.entries.push(entry);
        self
    }

    /// All of them.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The solver of that name.
    ///
    /// # Errors
    /// [`Error::Unknown`] with the nearest name.
    pub fn find(&self, name: &str) -> Result<&Entry> {
        let named = |entry: &&Entry| entry.name == name || entry.other_names.contains(&name);
        let names = self.entries.iter().map(Entry::name);
        self.entries
            .iter()
            .find(named)
            .ok_or_else(|| Error::Unknown {
                what: "solver",
                name: name.to_owned(),
                hint: suggest(name, names),
            })
    }

    /// The first planner that accepts a model with its default settings, of those that it suits if there are any.
    ///
    /// # Errors
    /// What the first of all says against the model, if all of them refuse it.
    pub fn first_for(&self, model: &Model) -> Result<&Entry> {
        let planners = || self.entries.iter().filter(|entry| !entry.learns);
        let accepting = || planners().filter(|entry| entry.accepts(model).is_ok());
        let suits = |entry: &&Entry| entry.solver(&[]).is_ok_and(|solver| solver.suits(model));
        let chosen = accepting().find(suits).or_else(|| accepting().next());
        match (chosen, planners().next()) {
            (Some(entry), _) => Ok(entry),
            (None, Some(first)) => {
                first.accepts(model)?;
                Ok(first)
            }
            (None, None) => Err(Error::Unknown {
                what: "planner",
                name: String::new(),
                hint: "this registry has none".to_owned(),
            }),
        }
    }
}
