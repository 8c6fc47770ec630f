//! What a model file says beyond linear motion and sensing: expressions, cases, signals.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::file::{
    CaseMotionTable, CaseSensorTable, CaseTable, ModelFile, ScalarRows, SensorTable, StateTable,
};
use super::file_value::{Ends, Named, OneOrMany, Scalar};
use super::resolve::{Names, matrix, optional_matrix};
use crate::model::error::{Fault, Path};
use crate::model::*;

/// Reads formulas of a file: it knows what they may name.
pub(super) struct Writing {
    names: Vec<String>,
}

impl Writing {
    /// Formulas of these state variables, of so many controls and of the step.
    pub(super) fn new(state: &[String], controls: usize) -> Self {
        let controls = (1..=controls).map(|i| format!("u{i}"));
        Self {
            names: state
                .iter()
                .cloned()
                .chain(controls)
                .chain(["t".to_owned()])
                .collect(),
        }
    }

    pub(super) fn formula(&self, scalar: &Scalar, path: Path) -> Result<Formula, Fault> {
        let source = match scalar {
            Scalar::Number(value) => return Ok(Formula::Number(*value)),
            Scalar::Expression(source) => source,
        };
        if self.names.len() > MOST_TOLD {
            return Err(Fault::new(
                path,
                format!("an expression of {} names", self.names.len()),
                format!(
                    "models with expressions have at most {} state variables and controls",
                    MOST_TOLD - 1
                ),
            ));
        }
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        let parsed = Expression::parse(source, &names).map_err(|error| {
            let column = source[..error.span.start.min(source.len())].chars().count();
            Fault::new(path.index(0).index(column), error.what, error.hint)
        })?;
        Ok(match parsed.constant() {
            Some(value) => Formula::Number(value),
            None => Formula::Written(parsed),
        })
    }

    fn matrix(&self, rows: &ScalarRows, path: Path) -> Result<DMatrix<Formula>, Fault> {
        let columns = rows.first().map_or(0, Vec::len);
        if let Some(row) = rows.iter().position(|row| row.len() != columns) {
            return Err(Fault::new(
                path.index(row),
                format!(
                    "row {} has {} numbers and the first row has {columns}",
                    row + 1,
                    rows[row].len()
                ),
                "make all rows equally long",
            ));
        }
        let mut entries = Vec::with_capacity(rows.len() * columns);
        for (i, row) in rows.iter().enumerate() {
            for (j, scalar) in row.iter().enumerate() {
                entries.push(self.formula(scalar, path.clone().index(i).index(j))?);
            }
        }
        Ok(DMatrix::from_row_iterator(rows.len(), columns, entries))
    }

    fn optional(
        &self,
        rows: &Option<ScalarRows>,
        path: Path,
    ) -> Result<Option<DMatrix<Formula>>, Fault> {
        rows.as_ref()
            .map(|rows| self.matrix(rows, path))
            .transpose()
    }

    /// Formulas by name of the state variable.
    fn steps(
        &self,
        step: &BTreeMap<String, Scalar>,
        names: &Names,
        path: &Path,
    ) -> Result<Vec<Option<Formula>>, Fault> {
        if step.is_empty() {
            return Ok(Vec::new());
        }
        let mut steps = vec![None; names.state.len()];
        for (name, scalar) in step {
            let path = path.clone().key(name);
            let variable = names.variable(name, path.clone())?;
            steps[variable] = Some(self.formula(scalar, path)?);
        }
        Ok(steps)
    }

    fn named(&self, table: &Named<Scalar>, path: &Path) -> Result<Vec<Formula>, Fault> {
        let entries = table.0.iter();
        entries
            .map(|(name, scalar)| self.formula(scalar, path.clone().key(name)))
            .collect()
    }

    /// Formulas of the signals, in the order of their names; what is left to 1 for the one that is `"rest"`.
    fn signals(
        &self,
        table: &Named<Scalar>,
        known: &[String],
        path: &Path,
    ) -> Result<Vec<Formula>, Fault> {
        let is_rest =
            |scalar: &Scalar| matches!(scalar, Scalar::Expression(text) if text.trim() == "rest");
        let text = |scalar: &Scalar| match scalar {
            Scalar::Number(value) => value.to_string(),
            Scalar::Expression(text) => format!("({text})"),
        };
        let others = table.0.iter().filter(|(_, scalar)| !is_rest(scalar));
        let sum: Vec<String> = others.map(|(_, scalar)| text(scalar)).collect();
        let rest = Scalar::Expression(format!("1 - ({})", sum.join(" + ")));
        let mut found = vec![None; known.len()];
        let mut rests = 0;
        // The rest is written with the others, which are looked at first.
        let (others, last): (Vec<_>, Vec<_>) =
            table.0.iter().partition(|(_, scalar)| !is_rest(scalar));
        for (name, scalar) in others.into_iter().chain(last) {
            let path = path.clone().key(name);
            let signal = known
                .iter()
                .position(|known| known == name)
                .ok_or_else(|| {
                    Fault::unknown(
                        path.clone(),
                        "signal",
                        name,
                        known.iter().map(String::as_str),
                    )
                })?;
            rests += usize::from(is_rest(scalar));
            if rests > 1 {
                return Err(Fault::new(
                    path,
                    "a second signal is the rest",
                    "give an expression for all signals but one",
                ));
            }
            let scalar = if is_rest(scalar) { &rest } else { scalar };
            found[signal] = Some(self.formula(scalar, path)?);
        }
        let missing = found.iter().position(Option::is_none);
        match missing {
            Some(signal) => Err(Fault::new(
                path.clone(),
                format!("the signal `{}` is missing", known[signal]),
                "give a probability for each signal",
            )),
            None => Ok(found.into_iter().flatten().collect()),
        }
    }
}

/// What is given to sensors and motions alike, wherever it is written.
struct Given<'a> {
    names: &'a Names,
    writing: &'a Writing,
    symbols: &'a [String],
}

impl Given<'_> {
    fn motion(&self, table: &CaseMotionTable, path: &Path) -> Result<MotionLaw, Fault> {
        let of = |key: &str| path.clone().key(key);
        Ok(MotionLaw {
            a: optional_matrix(&table.a, of("A"))?,
            b: optional_matrix(&table.b, of("B"))?,
            drift: table.drift.as_deref().map(DVector::from_column_slice),
            step: self.writing.steps(&table.step, self.names, &of("step"))?,
            noise: self.writing.optional(&table.noise, of("noise"))?,
        })
    }

    fn sensor(&self, table: &CaseSensorTable, path: &Path) -> Result<SensorLaw, Fault> {
        let of = |key: &str| path.clone().key(key);
        Ok(SensorLaw {
            h: optional_matrix(&table.h, of("H"))?,
            read: match &table.read {
                Some(read) => self.writing.named(read, &of("read"))?,
                None => Vec::new(),
            },
            noise: self.writing.optional(&table.noise, of("noise"))?,
            symbols: match &table.symbols {
                Some(table) => self.writing.signals(table, self.symbols, &of("symbols"))?,
                None => Vec::new(),
            },
            present: match &table.present {
                Some(present) => Some(self.writing.formula(present, of("present"))?),
                None => None,
            },
        })
    }
}

/// The laws of a file. What its [motion] and [sensor] say in formulas is the first case; what they say in numbers is not repeated.
pub(super) fn laws(file: &ModelFile, names: &Names, writing: &Writing) -> Result<Laws, Fault> {
    let symbols: Vec<String> = file.sensor.symbols.as_ref().map_or_else(Vec::new, |table| {
        table.0.iter().map(|(name, _)| name.clone()).collect()
    });
    let given = Given {
        names,
        writing,
        symbols: &symbols,
    };
    let (motion, sensor) = (Path::new("motion"), Path::new("sensor"));
    let steps = writing.steps(&file.motion.step, names, &motion.clone().key("step"))?;
    let base = Case {
        modes: None,
        actions: None,
        motion: MotionLaw {
            step: steps,
            noise: varying(writing.optional(&file.motion.noise, motion.key("noise"))?),
            ..MotionLaw::default()
        },
        sensor: SensorLaw {
            h: None,
            read: match &file.sensor.read {
                Some(read) => writing.named(read, &sensor.clone().key("read"))?,
                None => Vec::new(),
            },
            noise: varying(writing.optional(&file.sensor.noise, sensor.clone().key("noise"))?),
            symbols: match &file.sensor.symbols {
                Some(table) => writing.signals(table, &symbols, &sensor.clone().key("symbols"))?,
                None => Vec::new(),
            },
            present: match &file.sensor.present {
                Some(present) => Some(writing.formula(present, sensor.clone().key("present"))?)
                    .filter(|present| present.constant().is_none()),
                None => None,
            },
        },
    };
    let mut cases = Vec::new();
    if base != Case::default() {
        cases.push(base);
    }
    for (i, table) in file.case.iter().enumerate() {
        cases.push(case(table, &given, &Path::new("case").index(i))?);
    }
    Ok(Laws {
        cases,
        symbols,
        saturates: file
            .sensor
            .saturates
            .as_ref()
            .map_or_else(Vec::new, |ends| {
                ends.iter().map(|&Ends(interval)| interval).collect()
            }),
        modes_seen: file.state.modes_seen,
    })
}

fn case(table: &CaseTable, given: &Given<'_>, path: &Path) -> Result<Case, Fault> {
    let modes = |list: &OneOrMany<String>| {
        let path = path.clone().key("mode");
        let named = list.as_slice().iter().enumerate();
        named
            .map(|(i, name)| given.names.mode_named(name, path.clone().index(i)))
            .collect::<Result<Vec<_>, _>>()
    };
    Ok(Case {
        modes: table.mode.as_ref().map(modes).transpose()?,
        actions: given.names.action_list(&table.action, path)?,
        motion: given.motion(&table.motion, &path.clone().key("motion"))?,
        sensor: given.sensor(&table.sensor, &path.clone().key("sensor"))?,
    })
}

/// A matrix, unless it consists of numbers alone.
fn varying(matrix: Option<DMatrix<Formula>>) -> Option<DMatrix<Formula>> {
    matrix.filter(|matrix| matrix.iter().any(|entry| entry.constant().is_none()))
}

/// A matrix of numbers from one that may have expressions, which count as 0 until [`constant`] says what they are.
pub(super) fn numbers(rows: &ScalarRows, path: Path) -> Result<DMatrix<f64>, Fault> {
    let number = |scalar: &Scalar| match scalar {
        Scalar::Number(value) => *value,
        Scalar::Expression(_) => 0.0,
    };
    let rows = rows.iter().map(|row| row.iter().map(number).collect());
    matrix(&rows.collect(), path)
}

/// A matrix whose expressions are all numbers, such as `"0.1^2"`.
pub(super) fn constant(
    rows: &Option<ScalarRows>,
    writing: &Writing,
    path: Path,
) -> Result<Option<DMatrix<f64>>, Fault> {
    let Some(matrix) = writing.optional(rows, path)? else {
        return Ok(None);
    };
    let entries: Option<Vec<f64>> = matrix.iter().map(Formula::constant).collect();
    Ok(entries.map(|entries| DMatrix::from_vec(matrix.nrows(), matrix.ncols(), entries)))
}

/// How the sensor's readings are called and how many there are: those of `read`, the rows of H, or the state variables.
pub(super) fn readings(sensor: &SensorTable, variables: usize) -> usize {
    match (&sensor.symbols, &sensor.read, &sensor.h) {
        (Some(_), _, _) => 0,
        (None, Some(read), _) => read.0.len(),
        (None, None, Some(h)) => h.len(),
        (None, None, None) => variables,
    }
}

/// What the values of the state variables are.
pub(super) fn kinds(table: &StateTable, names: &Names) -> Result<Vec<VariableKind>, Fault> {
    let mut kinds = vec![VariableKind::Real; table.names.len()];
    for (key, list, kind) in [
        ("integer", &table.integer, VariableKind::Integer),
        ("angle", &table.angle, VariableKind::Angle),
    ] {
        for (i, name) in list.iter().enumerate() {
            let path = Path::new("state").key(key).index(i);
            let variable = names.variable(name, path.clone())?;
            if kinds[variable] != VariableKind::Real {
                return Err(Fault::new(
                    path,
                    format!("`{name}` is named before"),
                    "name each variable once, in `integer` or in `angle`",
                ));
            }
            kinds[variable] = kind;
        }
    }
    Ok(kinds)
}
