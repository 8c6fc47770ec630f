//! Arithmetic expressions as they are written in a model file.

mod function;
mod parse;
mod tape;
#[cfg(test)]
mod tests;
mod token;

use std::ops::Range;

use tape::Tape;

/// Longest source of an expression, in bytes.
const MOST_BYTES: usize = 10_000;

/// An arithmetic expression of variables with names, such as `if(x < 0, -1, (abs(x - 5)/sqrt(2) + 0.01)^2)`.
///
/// - *Numbers* are written `1`, `.5` or `1e-3`; `pi`, `e` and `inf` are known, unless a variable has that name.
/// - *Variables* are written by name; one that is not made of letters, digits and `_`, or is called `and`, `or` or `not`, is put in
///   backticks: `` `my name` ``.
/// - *Operators*, from those that bind first: `^`, to the right; signs, so that `-2^2` is -4; `*`, `/` and `%`; `+` and `-`; one of
///   `<`, `<=`, `>`, `>=`, `==` and `!=`, which are 1 where they hold and 0 elsewhere; `not`; `and`; `or`. What is not 0 is true.
///   `a % b` has the sign of `b`: it lies in `[0, b)` for `b > 0`.
/// - *Functions* are `abs(x)`, `sqrt(x)`, `exp(x)`, `ln(x)`, `log10(x)`, `sin(x)`, `cos(x)`, `tan(x)`, `asin(x)`, `acos(x)`, `atan(x)`,
///   `atan2(y, x)`, `hypot(x, y)`, `pow(x, y)`, which is `x^y`, `min` and `max` of two or more, `sign(x)`, which is 0 at 0, `floor(x)`,
///   `round(x)`, which takes halves away from 0, `clamp(x, low, high)`, which is never above `high`, and `if(condition, then, else)`.
///   Angles are in radians.
///
/// What has no value, such as `ln(-1)`, is NaN, and so are its sums, products, `min`, `max`, `clamp` and `sign`; of an `if`, the branch
/// that is not taken does not matter.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    source: String,
    tape: Tape,
}

/// Why a text is not an expression.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what} (hint: {hint})")]
pub struct ExpressionError {
    /// Bytes of the source it is about; empty at its end where something is missing there.
    pub span: Range<usize>,
    /// What is wrong.
    pub what: String,
    /// What to do about it.
    pub hint: String,
}

impl Expression {
    /// Reads an expression of some variables: `names[i]` is the name of variable `i`. Of two with the same name, the first is meant.
    ///
    /// # Errors
    ///
    /// If the source is not an expression, names what is not known, or is too much: more than 10,000 bytes, nested more than 200 deep, or
    /// with more than 32 values that wait for each other, as in `a + (b + (c + ...))`.
    pub fn parse(source: &str, names: &[&str]) -> Result<Self, ExpressionError> {
        if source.len() > MOST_BYTES {
            return Err(ExpressionError::new(
                0..source.len(),
                format!("an expression of {} bytes", source.len()),
                format!("write at most {MOST_BYTES}"),
            ));
        }
        Ok(Self {
            source: source.to_owned(),
            tape: parse::parse(source, names)?,
        })
    }

    /// Its value, where variable `i` is `variables[i]`. May be infinite or NaN; nothing is allocated.
    ///
    /// # Panics
    ///
    /// If it uses a variable that is not among them.
    pub fn value(&self, variables: &[f64]) -> f64 {
        self.tape.value(variables)
    }

    /// The text it was read from.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Whether it names a variable.
    pub fn uses(&self, variable: usize) -> bool {
        self.tape.variables().any(|used| used == variable)
    }

    /// The number that it is everywhere, if it names no variable.
    pub fn constant(&self) -> Option<f64> {
        let depends = self.tape.variables().next().is_some();
        (!depends).then(|| self.value(&[]))
    }
}

impl ExpressionError {
    fn new(span: Range<usize>, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self {
            span,
            what: what.into(),
            hint: hint.into(),
        }
    }
}
