//! ART 2-A, clustering that goes on while it learns (thesis 2.4), by the cosine of the paper or by distance.
//!
//! G. A. Carpenter, S. Grossberg, D. B. Rosen, *ART 2-A: An adaptive resonance algorithm for rapid category learning and recognition*,
//! Neural Networks 4, 1991.
//!
//! An input is compared with the centre of every category. The best match above the vigilance learns it; if there is none, the
//! input founds a category of its own.
//!
//! More vigilance means more categories only on the whole. With a learning rate of 0, where centres never move, halving the
//! distance that the vigilance allows never gives fewer: no two of the old centres fit into one new category. For smaller steps, or
//! centres that move, a sequence of inputs can be found for which a higher vigilance gives fewer.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::solve::settings::ensure;

/// How inputs and centres are compared, and how centres learn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rule {
    /// ART 2-A: the cosine between unit vectors without negative components (Eq. 2.39 to 2.51).
    Cosine {
        /// Components of a unit vector that are not above it count as noise; more than 0, at most `1 / sqrt(length)` (Eq. 2.42).
        theta: f64,
        /// Match of an uncommitted category for each unit of input; from 0 to `1 / sqrt(length)` (Eq. 2.44).
        alpha: f64,
    },
    /// Centres that follow their inputs (Eq. 3.1). They are not normalised, so that a cosine would no longer be one: the match is `1 -
    /// d / extent`, at least 0, for the Euclidean distance `d`.
    Distance {
        /// Distance at which nothing matches; more than 0.
        extent: f64,
    },
}

/// Settings of a network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Least match with the centre of a category that an input is counted to; in `[0, 1]` (Eq. 2.47).
    pub vigilance: f64,
    /// How far a centre moves to its input, `beta` in `[0, 1]` (Eq. 2.51).
    pub rate: f64,
    /// How they are compared.
    pub rule: Rule,
    /// Most categories, at least 1.
    pub limit: usize,
}

/// A network and the categories it has found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Art {
    settings: Settings,
    length: usize,
    centres: Vec<Vec<f64>>,
}

/// The category of an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Its number, in order of their founding.
    pub category: usize,
    /// How well the input matches its centre as it was, in `[0, 1]`; 1 for a new category.
    pub resonance: f64,
    /// What the network did.
    pub outcome: Outcome,
}

/// What a network does with an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The category learned it.
    Resonated,
    /// The category is new.
    Committed,
    /// It deserves a category of its own, but the limit is reached: the best of those there are, unchanged.
    Full,
}

impl Art {
    /// A network without categories for inputs of a length.
    ///
    /// # Errors
    /// [`Error::Setting`] for a setting out of range.
    pub fn new(length: usize, settings: Settings) -> Result<Self> {
        let unit = |x: f64| (0.0..=1.0).contains(&x);
        let (vigilance, rate) = (settings.vigilance, settings.rate);
        ensure("length", length, length >= 1, "at least 1")?;
        ensure("vigilance", vigilance, unit(vigilance), "0 to 1")?;
        ensure("rate", rate, unit(rate), "0 to 1")?;
        ensure("limit", settings.limit, settings.limit >= 1, "at least 1")?;
        let most = 1.0 / (length as f64).sqrt();
        match settings.rule {
            Rule::Cosine { theta, alpha } => {
                let range = "more than 0, at most 1 / sqrt(length)";
                ensure("theta", theta, theta > 0.0 && theta <= most, range)?;
                let range = "0 to 1 / sqrt(length)";
                ensure("alpha", alpha, (0.0..=most).contains(&alpha), range)?;
            }
            Rule::Distance { extent } => {
                let fits = extent > 0.0 && extent.is_finite();
                ensure("extent", extent, fits, "more than 0")?;
            }
        }
        Ok(Self {
            settings,
            length,
            centres: Vec::new(),
        })
    }

    /// Centres of the categories: unit vectors under [`Rule::Cosine`], means of what they learned under [`Rule::Distance`].
    pub fn centres(&self) -> &[Vec<f64>] {
        &self.centres
    }

    /// Shows the network an input (of its length), from which it learns.
    ///
    /// # Errors
    /// [`Error::Input`] for an input of another length or with a number that is not finite; under [`Rule::Cosine`] also for one that is
    /// uniform, as it points nowhere in particular, or has no component above `theta`. The network is then unchanged.
    pub fn present(&mut self, input: &[f64]) -> Result<Match> {
        let input = self.code(input)?;
        let best = self.best(&input);
        let full = self.centres.len() >= self.settings.limit;
        let (category, resonance, outcome) = match best {
            Some((category, resonance)) if self.resonates(&input, resonance) => {
                self.learn(category, &input);
                (category, resonance, Outcome::Resonated)
            }
            Some((category, resonance)) if full => (category, resonance, Outcome::Full),
            _ => {
                self.centres.push(input);
                (self.centres.len() - 1, 1.0, Outcome::Committed)
            }
        };
        Ok(Match {
            category,
            resonance,
            outcome,
        })
    }

    /// The category that matches an input best, with its match; nothing is learned. `None` without categories.
    ///
    /// # Errors
    /// As [`Art::present`].
    pub fn classify(&self, input: &[f64]) -> Result<Option<(usize, f64)>> {
        Ok(self.best(&self.code(input)?))
    }

    /// The input as it reaches the categories: `R F_0 R I` (Eq. 2.39), or itself.
    fn code(&self, input: &[f64]) -> Result<Vec<f64>> {
        let refuse = |place: String, value: String, reason: String| {
            Err(Error::Input {
                place,
                value,
                reason,
            })
        };
        if input.len() != self.length {
            let reason = format!("the network takes {} components", self.length);
            return refuse("input length".to_owned(), input.len().to_string(), reason);
        }
        if let Some(i) = input.iter().position(|x| !x.is_finite()) {
            let reason = "it has to be finite".to_owned();
            return refuse(format!("input component {i}"), input[i].to_string(), reason);
        }
        let Rule::Cosine { theta, .. } = self.settings.rule else {
            return Ok(input.to_vec());
        };
        if input.iter().all(|x| *x == input[0]) {
            let reason =
                "a zero or uniform input points nowhere; complement coding would tell inputs apart";
            return refuse(
                "every input component".to_owned(),
                input[0].to_string(),
                reason.to_owned(),
            );
        }
        // The largest component is taken out first, so that squares neither overflow nor vanish.
        let largest = input.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
        let mut code: Vec<f64> = input.iter().map(|x| x / largest).collect();
        normalise(&mut code);
        code.iter_mut()
            .filter(|x| **x <= theta)
            .for_each(|x| *x = 0.0);
        if code.iter().all(|x| *x == 0.0) {
            let (i, most) = (0..input.len())
                .map(|i| (i, input[i]))
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap_or_default();
            let reason = format!(
                "it is the largest, and no component of the unit vector is above theta = {theta}"
            );
            return refuse(format!("input component {i}"), most.to_string(), reason);
        }
        normalise(&mut code);
        Ok(code)
    }

    /// The category with the best match (Eq. 2.43, 2.45); the oldest of equals.
    fn best(&self, input: &[f64]) -> Option<(usize, f64)> {
        let matches = self
            .centres
            .iter()
            .map(|centre| self.compare(input, centre));
        // Of equals, the last in this order.
        let backwards = matches.enumerate().rev();
        backwards.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn compare(&self, input: &[f64], centre: &[f64]) -> f64 {
        match self.settings.rule {
            Rule::Cosine { .. } => dot(input, centre).min(1.0),
            Rule::Distance { extent } => {
                let squares = input.iter().zip(centre).map(|(x, z)| (x - z) * (x - z));
                (1.0 - squares.sum::<f64>().sqrt() / extent).max(0.0)
            }
        }
    }

    /// Whether the best match is kept (Eq. 2.46), and an uncommitted category does not match better.
    fn resonates(&self, input: &[f64], resonance: f64) -> bool {
        let uncommitted = match self.settings.rule {
            Rule::Cosine { alpha, .. } => alpha * input.iter().sum::<f64>(),
            Rule::Distance { .. } => 0.0,
        };
        resonance >= self.settings.vigilance && resonance >= uncommitted.min(1.0)
    }

    /// Moves a centre to its input: Eq. 2.49 and 2.50 with `theta` as threshold, or Eq. 3.1.
    fn learn(&mut self, category: usize, input: &[f64]) {
        let rate = self.settings.rate;
        let centre = &mut self.centres[category];
        match self.settings.rule {
            Rule::Cosine { theta, .. } => {
                let pairs = input.iter().zip(centre.iter());
                let mut psi: Vec<f64> = pairs
                    .map(|(x, z)| if *z > theta { *x } else { 0.0 })
                    .collect();
                // An input without a common component teaches nothing.
                if psi.iter().all(|x| *x == 0.0) {
                    return;
                }
                normalise(&mut psi);
                for (z, psi) in centre.iter_mut().zip(&psi) {
                    *z = rate * psi + (1.0 - rate) * *z;
                }
                normalise(centre);
            }
            Rule::Distance { .. } => {
                for (z, x) in centre.iter_mut().zip(input) {
                    *z += rate * (x - *z);
                }
            }
        }
    }
}

/// Complement coding of numbers in `[0, 1]`: `x` and `1 - x`, as two range finders between opposite walls would read. Unit vectors then
/// still tell large inputs from small ones (Carpenter, Grossberg & Rosen, *Fuzzy ART*, Neural Networks 4, 1991).
pub fn complement(values: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let rest = values.iter().map(|x| 1.0 - x);
    values.iter().copied().chain(rest)
}

/// `x / ||x||` (Eq. 2.40) of a vector that is not zero.
fn normalise(x: &mut [f64]) {
    let norm = dot(x, x).sqrt();
    x.iter_mut().for_each(|x| *x /= norm);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
