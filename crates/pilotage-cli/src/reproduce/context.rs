//! What experiments share: settings of the run, short cuts to solving and measuring, and the making of a finding.

use pilotage::belief::BeliefMdp;
use pilotage::model::Model;
use pilotage::observe::Observer;
use pilotage::policy::Automaton;
use pilotage::report::{
    Figure, Finding, Series, Table, Verdict, automaton_svg, belief_map_svg, curves_svg,
};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Estimate, Evaluation, Options};
use pilotage::solve::{Solution, SolveSettings, SolverKind, solve};

use crate::failure::Failure;

/// Settings of a reproduction.
pub struct Context<'a> {
    pub seed: u64,
    /// Fewer episodes and seeds, for a look and for CI.
    pub quick: bool,
    pub observer: &'a dyn Observer,
}

impl Context<'_> {
    /// `full`, or `quick` where the run is to be quick.
    pub fn either<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    pub fn options(&self) -> Options {
        Options {
            episodes: self.either(100_000, 4_000),
            seed: self.seed,
        }
    }

    pub fn solved(
        &self,
        solver: SolverKind,
        scenario: &Scenario,
        settings: SolveSettings,
    ) -> Result<Solution, Failure> {
        let settings = SolveSettings {
            seed: self.seed,
            ..settings
        };
        Ok(solve(solver, scenario, &settings, self.observer)?)
    }

    /// The default planner's automaton, which is the yardstick.
    pub fn planned(&self, scenario: &Scenario) -> Result<Solution, Failure> {
        self.solved(SolverKind::KbviClosed, scenario, SolveSettings::default())
    }

    pub fn earned(&self, scenario: &Scenario, solution: &Solution) -> Result<Evaluation, Failure> {
        Ok(solution.evaluate(scenario, self.options(), self.observer)?)
    }
}

pub fn problem(name: &str) -> Result<Scenario, Failure> {
    Ok(scenario::find(name)?)
}

/// The automaton of a solution in the default form.
pub fn automaton(solution: &Solution) -> Result<&Automaton, Failure> {
    solution
        .automaton()
        .ok_or_else(|| Failure::Usage("the solver hands over no automaton".to_owned()))
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

    pub fn curves(
        self,
        caption: &str,
        (x, y): (&str, &str),
        series: &[Series],
    ) -> Result<Self, Failure> {
        Ok(self.figure(caption, curves_svg(caption, x, y, series)?))
    }

    pub fn automaton(
        self,
        caption: impl Into<String>,
        automaton: &Automaton,
    ) -> Result<Self, Failure> {
        Ok(self.figure(caption, automaton_svg(automaton)?))
    }

    pub fn map(
        self,
        caption: impl Into<String>,
        model: &Model,
        automaton: &Automaton,
    ) -> Result<Self, Failure> {
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
