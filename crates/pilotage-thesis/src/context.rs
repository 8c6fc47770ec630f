//! What experiments share: settings of the run, short cuts to solving and measuring, and the making of a finding.

use pilotage::belief::BeliefMdp;
use pilotage::model::Model;
use pilotage::policy::Automaton;
use pilotage::progress::Progress;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Estimate, Evaluation, Options};
use pilotage::solve::{Planner, Request, Solution, ValueIteration, plan};
use pilotage_report::{
    Figure, Finding, Series, Table, Verdict, automaton_svg, belief_map_svg, curves_svg,
};

use crate::error::{Error, Result};

/// Settings of a reproduction.
pub struct Context<'a> {
    /// Seed of every random number.
    pub seed: u64,
    /// Fewer episodes and seeds, for a look and for CI.
    pub quick: bool,
    /// Is told how far it has come.
    pub observer: &'a dyn Progress,
}

impl Context<'_> {
    /// `full`, or `quick` where the run is to be quick.
    pub(crate) fn either<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    pub(crate) fn options(&self) -> Options {
        Options {
            episodes: self.either(100_000, 4_000),
            seed: self.seed,
        }
    }

    pub(crate) fn solved(
        &self,
        planner: &dyn Planner,
        scenario: &Scenario,
        request: Request,
    ) -> Result<Solution> {
        let request = Request {
            seed: self.seed,
            ..request
        };
        Ok(plan(planner, &scenario.model, &request, self.observer)?)
    }

    /// The default planner's automaton, which is the baseline.
    pub(crate) fn planned(&self, scenario: &Scenario) -> Result<Solution> {
        self.solved(&ValueIteration::default(), scenario, Request::default())
    }

    pub(crate) fn earned(&self, scenario: &Scenario, solution: &Solution) -> Result<Evaluation> {
        Ok(solution.evaluate(scenario, self.options(), self.observer)?)
    }
}

pub fn problem(name: &str) -> Result<Scenario> {
    Ok(scenario::find(name)?)
}

/// The automaton of a solution in the default form.
pub fn automaton(solution: &Solution) -> Result<&Automaton> {
    solution
        .automaton()
        .ok_or_else(|| Error::Missing("the solver hands over no automaton".to_owned()))
}

/// Mean with standard error.
pub fn shown(estimate: Estimate) -> String {
    format!("{:.4} ± {:.4}", estimate.mean, estimate.stderr)
}

/// A number, or a dash.
pub fn or_dash(number: Option<impl ToString>) -> String {
    number.map_or_else(|| "–".to_owned(), |number| number.to_string())
}

/// What to make of a claim that holds, and of one that does not.
pub fn judge(
    holds: bool,
    yes: (Verdict, impl Into<String>),
    no: (Verdict, impl Into<String>),
) -> (Verdict, String) {
    if holds {
        (yes.0, yes.1.into())
    } else {
        (no.0, no.1.into())
    }
}

/// A finding in the making.
pub struct Draft {
    finding: Finding,
}

impl Draft {
    /// What the thesis shows and says.
    pub fn new(title: impl Into<String>, thesis: impl Into<String>) -> Self {
        Self {
            finding: Finding {
                id: String::new(),
                title: title.into(),
                thesis: thesis.into(),
                tables: Vec::new(),
                figures: Vec::new(),
                verdict: Verdict::NotDecidable,
                why: String::new(),
            },
        }
    }

    pub fn table<const N: usize>(
        mut self,
        caption: impl Into<String>,
        columns: [&str; N],
        rows: Vec<[String; N]>,
    ) -> Self {
        self.finding.tables.push(Table {
            caption: caption.into(),
            columns: columns.map(str::to_owned).to_vec(),
            rows: rows.into_iter().map(|row| row.to_vec()).collect(),
        });
        self
    }

    pub fn figure(mut self, caption: impl Into<String>, svg: String) -> Self {
        self.finding.figures.push(Figure {
            caption: caption.into(),
            svg,
        });
        self
    }

    pub fn curves(self, caption: &str, (x, y): (&str, &str), series: &[Series]) -> Result<Self> {
        Ok(self.figure(caption, curves_svg(caption, x, y, series)?))
    }

    pub fn automaton(self, caption: impl Into<String>, automaton: &Automaton) -> Result<Self> {
        Ok(self.figure(caption, automaton_svg(automaton)?))
    }

    pub fn map(
        self,
        caption: impl Into<String>,
        model: &Model,
        automaton: &Automaton,
    ) -> Result<Self> {
        let svg = belief_map_svg(&BeliefMdp::new(model), automaton, Some(automaton))?;
        Ok(self.figure(caption, svg))
    }

    /// Done, with what to make of it.
    pub fn verdict(mut self, (verdict, why): (Verdict, String)) -> Finding {
        self.finding.verdict = verdict;
        self.finding.why = why;
        self.finding
    }
}
