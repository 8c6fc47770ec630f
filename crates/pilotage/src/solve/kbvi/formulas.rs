//! The three formulas KBVI's branches are made of, each exact by default and as printed in the thesis by choice: expected reward
//! at a belief (5.1), distribution of the next beliefs (5.2), expected reward over that distribution (5.3).

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::belief::gaussian::{gauss_hermite, normal_cdf, normal_density, region_probability};
use crate::belief::kalman::square_root;
use crate::belief::{BeliefMdp, ClassId, StratumId};
use crate::model::{ActionId, Interval, ModeId, Region};

/// Which formulas to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Formulas {
    /// Expected reward at a belief: `exact` or `ramp`, the thesis' lines.
    #[serde(rename = "reward_formula")]
    pub reward: RewardFormula,
    /// Spread of the next beliefs: `exact` or `printed`, as in Eq. 5.4 and 5.6.
    #[serde(rename = "spread_formula")]
    pub spread: SpreadFormula,
    /// Integral of a line against a Gaussian, which only the ramp needs: `exact` or `printed`, as in Eq. 5.14.
    #[serde(rename = "integral_formula")]
    pub integral: IntegralFormula,
}

/// Expected reward at a belief (5.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RewardFormula {
    /// Exact differences of the normal cdf (Eq. 5.2).
    #[default]
    Exact,
    /// The thesis' ramp: a line through 2.5 standard deviations on either side of every edge. Wrong by up to 0.145.
    Ramp,
}

/// Covariance of the mean one step on (5.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SpreadFormula {
    /// `A V A' + K S K'`: what the mean really does.
    #[default]
    Exact,
    /// Eq. 5.4 and 5.6 as printed: `A V A' + Q + K R K'`, which counts the actuator noise although it does not move the mean.
    Printed,
}

/// Integral of a line against a Gaussian (Eq. 5.14).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum IntegralFormula {
    /// `-a sqrt(V / 2 pi) exp(..) + (b + a E) Phi(..)`.
    #[default]
    Exact,
    /// As printed, with `a E / sqrt(2 pi V)` in place of `a E`.
    Printed,
}

/// How uncertain the agent will be after some steps, and how uncertain it is now about the mean it will then have. Neither depends
/// on where it is, so all branches with the same kinds of action share it.
#[derive(Debug, Clone, PartialEq)]
pub struct Outlook {
    /// Uncertainty level.
    pub level: StratumId,
    /// Covariance of the mean, `n x n`.
    pub covariance: DMatrix<f64>,
    /// Level's covariance and the mean's together, `n x n`: how uncertain the agent is now about where it will be.
    pub total: DMatrix<f64>,
}

impl Outlook {
    /// The outlook of an agent whose mean is N(.., covariance) at a level.
    pub(crate) fn new(mdp: &BeliefMdp, level: StratumId, covariance: DMatrix<f64>) -> Self {
        let total = mdp.covariance(level) + &covariance;
        Self {
            level,
            covariance,
            total,
        }
    }

    /// The outlook of an agent that knows its mean.
    pub fn certain(mdp: &BeliefMdp, level: StratumId) -> Self {
        let n = mdp.model().state_dim();
        Self::new(mdp, level, DMatrix::zeros(n, n))
    }
}

impl Formulas {
    /// The outlook one step on (Eq. 5.4 and 5.6). `known` says that the true state is a known point, as in each case of the tiger
    /// problem, so that observations gather around it whatever the mean.
    pub fn next_outlook(
        &self,
        mdp: &BeliefMdp,
        from: &Outlook,
        class: ClassId,
        known: bool,
    ) -> Outlook {
        let model = mdp.model();
        let step = mdp.levels().step(from.level, class);
        let (a, h) = (&model.motion.a, &model.sensor.h);
        let gain = &step.correction.gain;
        let action = mdp.levels().classes()[class];
        let (motion_noise, sensor_noise) =
            (model.motion_noise(action, 0), model.sensor_noise(action, 0));
        let carried = a * &from.covariance * a.transpose();
        let told = gain * sensor_noise * gain.transpose();
        let covariance = match (self.spread, known) {
            (SpreadFormula::Exact, false) => carried + step.correction.mean_covariance(),
            (SpreadFormula::Exact, true) => {
                let keep = DMatrix::identity(a.nrows(), a.nrows()) - gain * h;
                &keep * carried * keep.transpose() + told
            }
            (SpreadFormula::Printed, false) => carried + motion_noise + told,
            (SpreadFormula::Printed, true) => {
                let moved = carried + motion_noise;
                let taken = gain * (h * &moved * h.transpose()) * gain.transpose();
                moved + told - taken
            }
        };
        Outlook::new(mdp, step.next, covariance)
    }

    /// Expected reward of an action over the beliefs that may be held by then (Eq. 5.10), events included; `mean` is where the
    /// mean is expected.
    pub fn reward(
        &self,
        mdp: &BeliefMdp,
        mode: ModeId,
        outlook: &Outlook,
        mean: &DVector<f64>,
        action: ActionId,
    ) -> f64 {
        match self.reward {
            RewardFormula::Exact if mdp.is_gaussian() => {
                // The average of N(s; m, P) over N(m; mean, V) is N(s; mean, V + P).
                terms(mdp, mode, outlook.level, action, |region| {
                    region_probability(mean.as_slice(), &outlook.total, region)
                })
            }
            RewardFormula::Exact if outlook.covariance.amax() == 0.0 => {
                mdp.reward(mode, outlook.level, mean.as_slice(), action)
            }
            RewardFormula::Exact => over_gaussian(mean, &outlook.covariance, |mean| {
                mdp.reward(mode, outlook.level, mean, action)
            }),
            RewardFormula::Ramp => terms(mdp, mode, outlook.level, action, |region| {
                self.ramp(mdp, outlook, mean, region)
            }),
        }
    }

    /// The ramp of a box is the product of the ramps of its sides, each integrated line by line (Eq. 5.14).
    fn ramp(
        &self,
        mdp: &BeliefMdp,
        outlook: &Outlook,
        mean: &DVector<f64>,
        region: &Region,
    ) -> f64 {
        let covariance = mdp.covariance(outlook.level);
        let side = |&(i, side): &(usize, Interval)| -> f64 {
            let lines = ramp_lines(side, covariance[(i, i)].sqrt());
            lines
                .iter()
                .map(|line| line.expectation(mean[i], outlook.covariance[(i, i)], self.integral))
                .sum()
        };
        region.sides.iter().map(side).product()
    }
}

fn terms(
    mdp: &BeliefMdp,
    mode: ModeId,
    level: StratumId,
    action: ActionId,
    probability: impl Fn(&Region) -> f64,
) -> f64 {
    mdp.effects(mode, level, action)
        .iter()
        .map(|effect| effect.reward * probability(&effect.region))
        .sum()
}

/// `E f(x)` for x ~ N(mean, covariance).
fn over_gaussian(mean: &DVector<f64>, covariance: &DMatrix<f64>, f: impl Fn(&[f64]) -> f64) -> f64 {
    let root = square_root(covariance);
    let rule = gauss_hermite(21);
    let mut digits = vec![0; root.ncols()];
    let mut sum = 0.0;
    loop {
        let offset = DVector::from_iterator(
            digits.len(),
            digits.iter().map(|&digit: &usize| rule[digit].0),
        );
        let weight: f64 = digits.iter().map(|&digit| rule[digit].1).product();
        sum += weight * f((mean + &root * offset).as_slice());
        let Some(place) = digits.iter().rposition(|&digit| digit + 1 < rule.len()) else {
            return sum;
        };
        digits[place] += 1;
        digits[place + 1..].fill(0);
    }
}

/// `slope * s + intercept` for s from `low` to `high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Where it holds.
    pub range: Interval,
    /// Slope.
    pub slope: f64,
    /// Value at 0.
    pub intercept: f64,
}

impl Line {
    /// Integral of the line against N(mean, variance) over its range (Eq. 5.14).
    pub fn expectation(&self, mean: f64, variance: f64, formula: IntegralFormula) -> f64 {
        if variance <= 0.0 {
            return if self.range.contains(mean) {
                self.slope * mean + self.intercept
            } else {
                0.0
            };
        }
        let sd = variance.sqrt();
        let level = match formula {
            IntegralFormula::Exact => self.intercept + self.slope * mean,
            IntegralFormula::Printed => {
                self.intercept + self.slope * mean / (std::f64::consts::TAU * variance).sqrt()
            }
        };
        let (low, high) = ((self.range.low - mean) / sd, (self.range.high - mean) / sd);
        -self.slope * sd * (normal_density(high) - normal_density(low))
            + level * (normal_cdf(high) - normal_cdf(low))
    }
}

/// The reward 1 inside an interval as the thesis draws it at uncertainty `sd` (Figure 5.2): each edge becomes a line from 0 at
/// 2.5 standard deviations outside to 1 at 2.5 inside; where two edges' lines meet, the lower counts.
pub fn ramp_lines(side: Interval, sd: f64) -> Vec<Line> {
    let reach = 2.5 * sd;
    if reach == 0.0 {
        return vec![Line {
            range: side,
            slope: 0.0,
            intercept: 1.0,
        }];
    }
    let slope = 0.5 / reach;
    let middle = 0.5 * (side.low + side.high);
    let rise_end = (side.low + reach).min(if middle.is_finite() {
        middle
    } else {
        f64::INFINITY
    });
    let fall_start = (side.high - reach).max(if middle.is_finite() {
        middle
    } else {
        f64::NEG_INFINITY
    });
    let mut lines = Vec::new();
    if side.low.is_finite() {
        lines.push(Line {
            range: Interval::new(side.low - reach, rise_end),
            slope,
            intercept: 0.5 - slope * side.low,
        });
    }
    let flat = Interval::new(
        if side.low.is_finite() {
            rise_end
        } else {
            f64::NEG_INFINITY
        },
        if side.high.is_finite() {
            fall_start
        } else {
            f64::INFINITY
        },
    );
    if flat.low < flat.high {
        lines.push(Line {
            range: flat,
            slope: 0.0,
            intercept: 1.0,
        });
    }
    if side.high.is_finite() {
        lines.push(Line {
            range: Interval::new(fall_start, side.high + reach),
            slope: -slope,
            intercept: 0.5 + slope * side.high,
        });
    }
    lines
}
