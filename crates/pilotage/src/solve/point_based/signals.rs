//! What an agent tells apart after an action: the signals of a discrete sensor, or bins of the numbers that it reads.
//!
//! An agent that only looks in which bin a reading falls can be followed exactly, and does no better than one that looks closer: what it
//! is worth is a lower bound. Bins are chosen for the belief at hand, so that each is as likely as the others, along every reading.

use nalgebra::DMatrix;

use crate::belief::gaussian::{interval_probability, region_probability};
use crate::belief::{CellsKeeping, Heard, Keeping, Sensed};
use crate::model::{ActionId, Interval, Region};

/// So many evenly spread readings a bin tell where it ends.
const READINGS: usize = 12;

/// Where one signal ends and the next begins.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Partition {
    /// The signals of a discrete sensor.
    Signals,
    /// For each reading the places where bins meet, rising.
    Bins(Vec<Vec<f64>>),
}

impl Partition {
    /// Bins of the numbers that may be read in a belief (masses by mode and cell) after an action that led to it; at most `most` along
    /// each reading.
    pub(super) fn new(
        keeping: &CellsKeeping,
        action: ActionId,
        masses: &[f64],
        most: usize,
    ) -> Self {
        if keeping.is_discrete() {
            return Self::Signals;
        }
        let belief = keeping.belief(masses.to_vec());
        let readings = keeping.readings(&belief, action, 0, most * READINGS);
        let values: Vec<Vec<f64>> = readings
            .into_iter()
            .filter_map(|(_, sensed)| match sensed {
                Sensed::Values(values) => Some(values),
                Sensed::Symbol(_) | Sensed::Nothing => None,
            })
            .collect();
        let numbers = values.first().map_or(0, Vec::len);
        let numbers = numbers - usize::from(keeping.sensor().sees_mode() && numbers > 0);
        let edges = |i: usize| {
            let of: Vec<f64> = values.iter().map(|values| values[i]).collect();
            edges(of, most, keeping.sensor().ends().get(i))
        };
        Self::Bins((0..numbers).map(edges).collect())
    }

    /// Number of bins of numbers.
    fn bins(&self) -> usize {
        match self {
            Self::Signals => 0,
            Self::Bins(edges) => edges.iter().map(|edges| edges.len() + 1).product(),
        }
    }

    /// How likely each signal is in some modes and cells: a row for each signal, the last one that there is nothing to read.
    pub(super) fn likelihoods(
        &self,
        keeping: &CellsKeeping,
        action: ActionId,
        states: &[usize],
    ) -> DMatrix<f64> {
        let count = keeping.cells();
        let sensor = keeping.sensor();
        let seen = if sensor.sees_mode() {
            keeping.modes()
        } else {
            1
        };
        let signals = match self {
            Self::Signals => sensor.table(action, 0).signals.len(),
            Self::Bins(_) => self.bins() * seen,
        };
        let mut likely = DMatrix::zeros(signals + 1, states.len());
        for (column, &state) in states.iter().enumerate() {
            let (mode, cell) = (state / count, state % count);
            let table = sensor.table(action, mode);
            let present = table.present[cell];
            likely[(signals, column)] = 1.0 - present;
            match self {
                Self::Signals => {
                    for (row, signal) in table.signals.iter().enumerate() {
                        likely[(row, column)] = present * signal[cell];
                    }
                }
                Self::Bins(edges) => {
                    let first = if seen > 1 { mode * self.bins() } else { 0 };
                    let parts = &table.heard[cell];
                    let share = present / parts.len() as f64;
                    for heard in parts {
                        add_bins(heard, edges, share, &mut |bin, mass| {
                            likely[(first + bin, column)] += mass;
                        });
                    }
                }
            }
        }
        likely
    }
}

/// Edges between which readings are alike likely; ends at which they saturate are bins of their own.
fn edges(mut readings: Vec<f64>, most: usize, ends: Option<&Interval>) -> Vec<f64> {
    readings.sort_by(f64::total_cmp);
    let quantile = |k: usize| {
        let after = (k * readings.len() / most).clamp(1, readings.len() - 1);
        0.5 * (readings[after - 1] + readings[after])
    };
    let mut edges: Vec<f64> = match readings.len() {
        0 | 1 => Vec::new(),
        _ => (1..most).map(quantile).collect(),
    };
    if let Some(ends) = ends {
        edges.retain(|edge| ends.low < *edge && *edge < ends.high);
        let saturated = [ends.low.next_up(), ends.high];
        edges.extend(saturated.into_iter().filter(|end| end.is_finite()));
        edges.sort_by(f64::total_cmp);
    }
    edges.dedup();
    edges
}

/// Adds how likely each bin is under a Gaussian of readings, times a share.
fn add_bins(heard: &Heard, edges: &[Vec<f64>], share: f64, add: &mut dyn FnMut(usize, f64)) {
    let m = edges.len();
    let side = |i: usize, bin: usize| {
        let low = bin
            .checked_sub(1)
            .map_or(f64::NEG_INFINITY, |k| edges[i][k]);
        let high = edges[i].get(bin).copied().unwrap_or(f64::INFINITY);
        Interval::new(low, high)
    };
    let along = |i: usize| -> Vec<f64> {
        let variance = heard.covariance[i * m + i];
        (0..=edges[i].len())
            .map(|bin| interval_probability(heard.mean[i], variance, side(i, bin)))
            .collect()
    };
    match m {
        0 => add(0, share),
        1 => {
            for (bin, mass) in along(0).into_iter().enumerate() {
                add(bin, share * mass);
            }
        }
        _ => {
            let correlated = heard.covariance[1].abs() > 1e-12;
            let (first, second) = (along(0), along(1));
            for (i, a) in first.iter().enumerate() {
                for (j, b) in second.iter().enumerate() {
                    let both = match correlated && a * b > 0.0 {
                        true => rectangle(heard, side(0, i), side(1, j)),
                        false => a * b,
                    };
                    add(i * second.len() + j, share * both);
                }
            }
        }
    }
}

/// Probability of a rectangle of two correlated readings.
fn rectangle(heard: &Heard, first: Interval, second: Interval) -> f64 {
    let covariance = DMatrix::from_row_slice(2, 2, &heard.covariance);
    let region = Region::new(vec![(0, first), (1, second)]);
    region_probability(&heard.mean, &covariance, &region)
}
