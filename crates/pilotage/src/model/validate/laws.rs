//! Checks of what goes beyond linear motion and sensing. Formulas are asked at points all over the bounds.

use nalgebra::DMatrix;

use super::super::law::{Formula, Point};
use super::super::*;
use super::numbers::{covariance, finite, finite_matrix, shape, vector};
use super::{Fault, MOST_NAMES, Path, at_most, check_interval, check_unique};

/// Points along a variable at which formulas are asked, ends included.
const POINTS: usize = 9;

/// Most points in all.
const MOST_POINTS: usize = 6561;

/// Where a variable has no bounds, formulas are asked so many standard deviations around the starts.
const REACH: f64 = 3.0;

/// Probabilities may miss 1 by this much.
const ROUNDING: f64 = 1e-9;

impl Model {
    pub(super) fn check_laws(&self) -> Result<(), Fault> {
        let laws = &self.laws;
        at_most(
            laws.symbols.len(),
            MOST_NAMES,
            "signals",
            Path::new("sensor").key("symbols"),
        )?;
        if !laws.symbols.is_empty() {
            check_unique(&laws.symbols, "signal", |i| {
                Path::new("sensor").key("symbols").key(&laws.symbols[i])
            })?;
        }
        let saturates = Path::new("sensor").key("saturates");
        if !laws.saturates.is_empty() && laws.saturates.len() != self.sensor_dim() {
            return Err(Fault::new(
                saturates,
                format!(
                    "{} pairs of ends for {} readings",
                    laws.saturates.len(),
                    self.sensor_dim()
                ),
                "give one pair [low, high] for each reading; `-inf` and `inf` leave a side open",
            ));
        }
        for (i, ends) in laws.saturates.iter().enumerate() {
            check_interval(*ends, "the ends", saturates.clone().index(i))?;
        }
        // What [motion] and [sensor] say in formulas comes first, and is written there.
        let written = |case: &Case| case.modes.is_none() && case.actions.is_none();
        let own = usize::from(laws.cases.first().is_some_and(written));
        for (i, case) in laws.cases.iter().enumerate() {
            let path = match i < own {
                true => Path::default(),
                false => Path::new("case").index(i - own),
            };
            self.check_case(case, &path)?;
        }
        for (i, reward) in self.rewards.iter().enumerate() {
            if let Some(formula) = &reward.formula {
                let path = Path::new("reward").index(i).key("value");
                let actions = reward.actions.clone();
                let here = |point: &Point<'_>| reward.region.contains(point.state);
                self.ask(formula, &actions, path, &here, &|value| {
                    (!value.is_finite()).then(|| format!("it is {value}"))
                })?;
            }
        }
        self.check_symbols()
    }

    fn check_case(&self, case: &Case, path: &Path) -> Result<(), Fault> {
        let (n, m) = (self.state_dim(), self.sensor_dim());
        for (i, mode) in case.modes.iter().flatten().enumerate() {
            self.check_mode(Some(*mode), path.clone().key("mode").index(i))?;
        }
        self.check_condition(&case.actions, None, &Region::everywhere(), path)?;
        let variables = format!("there are {n} state variables");
        let of = |table: &str, key: &str| path.clone().key(table).key(key);
        let controls = self.motion.b.ncols().max(1);
        for (table, key, matrix, size) in [
            ("motion", "A", &case.motion.a, (n, n)),
            ("motion", "B", &case.motion.b, (n, controls)),
            ("sensor", "H", &case.sensor.h, (m, n)),
        ] {
            if let Some(matrix) = matrix {
                shape(matrix, size, &variables, of(table, key))?;
                finite_matrix(matrix, of(table, key))?;
            }
        }
        if let Some(drift) = &case.motion.drift {
            vector(drift, n, &variables, of("motion", "drift"))?;
        }
        let is_finite = |value: f64| (!value.is_finite()).then(|| format!("it is {value}"));
        let everywhere = |_: &Point<'_>| true;
        if !case.motion.step.is_empty() && case.motion.step.len() != n {
            return Err(Fault::new(
                of("motion", "step"),
                "not one entry for each state variable",
                variables,
            ));
        }
        for (variable, formula) in self.state.iter().zip(&case.motion.step) {
            if let Some(formula) = formula {
                let path = of("motion", "step").key(&variable.name);
                self.ask(formula, &case.actions, path, &everywhere, &is_finite)?;
            }
        }
        if !case.sensor.read.is_empty() && case.sensor.read.len() != m {
            return Err(Fault::new(
                of("sensor", "read"),
                format!("{} readings, and there are {m}", case.sensor.read.len()),
                "give as many as in [sensor]",
            ));
        }
        for formula in &case.sensor.read {
            self.ask(
                formula,
                &case.actions,
                of("sensor", "read"),
                &everywhere,
                &is_finite,
            )?;
        }
        if let Some(noise) = &case.motion.noise {
            self.check_noise(noise, n, case, of("motion", "noise"))?;
        }
        if let Some(noise) = &case.sensor.noise {
            self.check_noise(noise, m, case, of("sensor", "noise"))?;
        }
        if let Some(present) = &case.sensor.present {
            let path = of("sensor", "present");
            self.ask(present, &case.actions, path, &everywhere, &|value| {
                (!(0.0..=1.0).contains(&value))
                    .then(|| format!("the probability of a reading is {value}"))
            })?;
        }
        Ok(())
    }

    /// A covariance everywhere: square, symmetric, and positive semi-definite at the points asked.
    fn check_noise(
        &self,
        noise: &DMatrix<Formula>,
        size: usize,
        case: &Case,
        path: Path,
    ) -> Result<(), Fault> {
        if noise.shape() != (size, size) {
            return Err(Fault::new(
                path,
                format!(
                    "{} x {} numbers where {size} x {size} belong",
                    noise.nrows(),
                    noise.ncols()
                ),
                "give a covariance, row by row",
            ));
        }
        self.at_points(&case.actions, &mut |point| {
            let values = noise.map(|entry| entry.value(point));
            let first = values.iter().position(|value| !value.is_finite());
            if let Some(entry) = first {
                let (row, column) = (entry % size, entry / size);
                let place = path.clone().index(row).index(column);
                return finite(values[entry], place).map_err(|fault| self.told(fault, point));
            }
            covariance(&values, size, "a covariance is square", path.clone())
                .map_err(|fault| self.told(fault, point))
        })
    }

    fn check_symbols(&self) -> Result<(), Fault> {
        let symbols = &self.laws.symbols;
        if symbols.is_empty() {
            return Ok(());
        }
        let path = Path::new("sensor").key("symbols");
        let dynamics = Dynamics::new(self);
        let mut likely = vec![0.0; symbols.len()];
        for mode in 0..self.modes.len() {
            for action in 0..self.actions.len() {
                self.at_points(&Some(vec![action]), &mut |point| {
                    let doing = Doing {
                        mode,
                        action,
                        step: point.step,
                    };
                    dynamics.symbol_probabilities(doing, point.state, &mut likely);
                    for (name, value) in symbols.iter().zip(&likely) {
                        if !(-ROUNDING..=1.0 + ROUNDING).contains(value) {
                            let fault = Fault::new(
                                path.clone().key(name),
                                format!("the probability of `{name}` is {value}"),
                                "give a number from 0 to 1 everywhere",
                            );
                            return Err(self.told(fault, point));
                        }
                    }
                    let sum: f64 = likely.iter().sum();
                    if (sum - 1.0).abs() > 1e-6 {
                        let fault = Fault::new(
                            path.clone(),
                            format!("the probabilities of the signals sum to {sum}"),
                            "make them sum to 1 everywhere, or write \"rest\" for one of them",
                        );
                        return Err(self.told(fault, point));
                    }
                    Ok(())
                })?;
            }
        }
        Ok(())
    }

    /// Asks a formula at points all over the bounds; `wrong` says what is wrong with a value, if anything is.
    fn ask(
        &self,
        formula: &Formula,
        actions: &Option<Vec<ActionId>>,
        path: Path,
        here: &dyn Fn(&Point<'_>) -> bool,
        wrong: &dyn Fn(f64) -> Option<String>,
    ) -> Result<(), Fault> {
        self.at_points(actions, &mut |point| match wrong(formula.value(point)) {
            Some(what) if here(point) => {
                let hint = "change the expression, or the bounds, so that it is a number with meaning everywhere";
                Err(self.told(Fault::new(path.clone(), what, hint), point))
            }
            _ => Ok(()),
        })
    }

    /// The fault, with the point at which it was found.
    fn told(&self, fault: Fault, point: &Point<'_>) -> Fault {
        let state = self.state.iter().zip(point.state);
        let at: Vec<String> = state
            .map(|(variable, x)| format!("{} = {x}", variable.name))
            .collect();
        Fault {
            message: format!("at {}: {}", at.join(", "), fault.message),
            ..fault
        }
    }

    /// Points at which formulas are asked: a lattice over the bounds, and the means of the starts, with the controls of the actions.
    fn at_points(
        &self,
        actions: &Option<Vec<ActionId>>,
        ask: &mut dyn FnMut(&Point<'_>) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let n = self.state_dim();
        let per_side = (2..=POINTS).rev().find(|side| {
            side.checked_pow(n as u32)
                .is_some_and(|all| all <= MOST_POINTS)
        });
        let ends: Vec<(f64, f64)> = (0..n).map(|i| self.reach(i)).collect();
        let side = per_side.unwrap_or(1);
        let all = per_side.map_or(0, |side| side.pow(n as u32));
        let lattice = (0..all).map(|number| {
            let mut rest = number;
            let place = |&(low, high): &(f64, f64)| {
                let k = rest % side;
                rest /= side;
                low + (high - low) * k as f64 / (side - 1).max(1) as f64
            };
            ends.iter().map(place).collect::<Vec<f64>>()
        });
        let starts = self
            .start
            .iter()
            .map(|start| start.mean.as_slice().to_vec());
        let dynamics = Dynamics::new(self);
        for mut state in starts.chain(lattice) {
            dynamics.round(&mut state);
            for (id, action) in self.actions.iter().enumerate() {
                if actions.as_ref().is_some_and(|list| !list.contains(&id)) {
                    continue;
                }
                ask(&Point {
                    state: &state,
                    control: action.control.as_slice(),
                    step: 0,
                })?;
            }
        }
        Ok(())
    }

    /// Where a variable is asked: its bounds, or around the starts.
    fn reach(&self, variable: usize) -> (f64, f64) {
        let bounds = self.state[variable].bounds;
        let starts = self
            .start
            .iter()
            .filter(|start| start.mean.len() == self.state_dim());
        let around = starts.map(|start| {
            let spread = start.covariance.get((variable, variable));
            let reach = REACH * spread.copied().unwrap_or(0.0).max(0.0).sqrt();
            (start.mean[variable] - reach, start.mean[variable] + reach)
        });
        let (low, high) = around.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (a, b)| {
            (low.min(a), high.max(b))
        });
        let low = if bounds.low.is_finite() {
            bounds.low
        } else {
            low
        };
        let high = if bounds.high.is_finite() {
            bounds.high
        } else {
            high
        };
        (low, high.max(low))
    }
}
