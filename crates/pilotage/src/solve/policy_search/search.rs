//! What both objectives share: commands by group of levels, their automaton, and a phase of moving its planes.

use nalgebra::{DMatrix, DVector};

use super::failure::{Runs, Sample};
use super::refine::{Phase, refine};
use super::regulator;
use super::settings::{Objective, PolicySearch, SOLVER};
use crate::belief::{BeliefMdp, StratumId};
use crate::error::Result;
use crate::policy::{Automaton, AutomatonRunner};
use crate::progress::Progress;
use crate::solve::compile::planes::{self, Command, Group};

/// A search under way.
pub(super) struct Search<'a> {
    pub mdp: &'a BeliefMdp,
    pub settings: &'a PolicySearch,
    pub observer: &'a dyn Progress,
    pub groups: Vec<Group>,
    seed: u64,
    scale: Vec<f64>,
    /// Generations done, and to do.
    done: u64,
    total: u64,
}

/// What a search moves, by group: `[K | c]` of the command `u = c - K m` in scaled variables (`p x (n + 1)`), or `K` alone (`p x n`)
/// where the offset is none.
pub(super) type Numbers = Vec<DMatrix<f64>>;

impl<'a> Search<'a> {
    /// Begins with the regulator's command everywhere, and measures the scale of every variable under it.
    pub(super) fn new(
        mdp: &'a BeliefMdp,
        (settings, seed): (&'a PolicySearch, u64),
        aim: Objective,
        observer: &'a dyn Progress,
    ) -> Result<(Self, Numbers)> {
        let command = regulator::command(mdp.model(), settings, aim)?;
        let groups = regulator::groups_of_levels(mdp, aim);
        let mut search = Self {
            mdp,
            settings,
            observer,
            seed,
            scale: vec![1.0; mdp.model().state_dim()],
            groups,
            done: 0,
            total: 0,
        };
        search.scale = search.measured_scale(&command, aim);
        let mut numbers = command.gain.clone();
        for (mut column, scale) in numbers.column_iter_mut().zip(&search.scale) {
            column *= *scale;
        }
        if aim == Objective::Return {
            let n = numbers.ncols();
            numbers = numbers.insert_column(n, 0.0);
            numbers.set_column(n, &command.offset);
        }
        let everywhere = vec![numbers; search.groups.len()];
        Ok((search, everywhere))
    }

    /// Standard deviation of the mean at the steady level under a command, by variable; where there is none to be had, half the
    /// width of the bounds, or 1.
    fn measured_scale(&self, command: &Command, aim: Objective) -> Vec<f64> {
        let commands = vec![command.clone(); self.groups.len()];
        let policy = AutomatonRunner::new(&self.compile(&commands));
        let target = regulator::target(self.mdp.model(), aim);
        let runs = Runs::steady(self.mdp, self.steady(), target.as_slice());
        let measured = runs.deviation(&policy, self.sample(100, 2000, 0));
        let variables = self.mdp.model().state.iter();
        let scale = measured.into_iter().zip(variables);
        let usable = |scale: f64| scale > 0.0 && scale.is_finite();
        scale
            .map(|(scale, variable)| match 0.5 * variable.bounds.width() {
                _ if usable(scale) => scale,
                width if usable(width) => width,
                _ => 1.0,
            })
            .collect()
    }

    /// The level at which the agent spends its life.
    pub(super) fn steady(&self) -> StratumId {
        self.groups[self.groups.len() - 1].1
    }

    /// The automaton of the numbers.
    pub(super) fn automaton(&self, numbers: &[DMatrix<f64>]) -> Automaton {
        let n = self.mdp.model().state_dim();
        let command = |numbers: &DMatrix<f64>| Command {
            gain: numbers.columns(0, n).into_owned(),
            offset: match numbers.ncols() > n {
                true => numbers.column(n).into_owned(),
                false => DVector::zeros(numbers.nrows()),
            },
        };
        self.compile(&numbers.iter().map(command).collect::<Vec<_>>())
    }

    fn compile(&self, commands: &[Command]) -> Automaton {
        planes::automaton(self.mdp, SOLVER, &self.groups, commands, &self.scale)
    }

    /// The automaton of the numbers, laid out to be run.
    pub(super) fn controller(&self, numbers: &[DMatrix<f64>]) -> AutomatonRunner {
        AutomatonRunner::new(&self.automaton(numbers))
    }

    /// So many runs of so many steps, which effort lengthens.
    pub(super) fn sample(&self, runs: usize, steps: usize, phase: u64) -> Sample {
        Sample {
            runs,
            steps: self.effort(steps),
            seed: self.seed_of(phase),
        }
    }

    /// A number of steps or runs, times the effort; at least 1.
    pub(super) fn effort(&self, count: usize) -> usize {
        ((count as f64 * self.settings.effort) as usize).max(1)
    }

    /// Seed of the simulations of a phase.
    pub(super) fn seed_of(&self, phase: u64) -> u64 {
        self.seed.wrapping_mul(1000).wrapping_add(phase)
    }

    /// Says how many generations there will be.
    pub(super) fn begin(&mut self, generations: usize) {
        self.total = generations as u64;
        self.observer.progress("policy search", 0, self.total);
    }

    /// Moves the numbers to where the cost is least. All candidates should meet the same random numbers.
    pub(super) fn phase(
        &mut self,
        numbers: &mut [DMatrix<f64>],
        (phase, generations, step): (u64, usize, f64),
        cost: impl Fn(&Self, &[DMatrix<f64>]) -> f64,
    ) {
        let settings = Phase {
            step,
            generations,
            seed: self.seed_of(100 + phase),
        };
        refine(
            numbers,
            settings,
            |numbers| cost(self, numbers),
            |generation| {
                self.observer
                    .progress("policy search", self.done + generation, self.total);
            },
        );
        self.done += generations as u64;
    }
}
