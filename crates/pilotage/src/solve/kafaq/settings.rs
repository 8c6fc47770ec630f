//! What a learning run can be told.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::solve::learn::{Rates, Strata};
use crate::solve::settings::{self, KEPT, MANY, PAIRED, ensure, ensure_count};

/// How regions change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Rules {
    /// On the evidence of many visits, by tests with stated error rates.
    #[default]
    Tested,
    /// At every step, as in Figure 4.5.
    Printed,
}

/// Settings of KAFAQ-learning. Lengths are measured in standard deviations of the steady level, rewards by the range of the
/// rewards that were met, so that the defaults do not depend on a problem's units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Settings {
    /// Seed of every random number.
    pub seed: u64,
    /// How regions change: `tested`, on evidence, or `printed`, at every step as in Figure 4.5.
    pub rules: Rules,
    /// Side of a neighbourhood of the lattice that collects evidence, in `sqrt(P)` of the steady level; more than 0, at most 10.
    pub cell: f64,
    /// A neighbourhood also need not be finer than this share of what an action moves; at least 0.
    pub cell_stride: f64,
    /// Most neighbourhoods along an axis; at least 1.
    pub cells_along: usize,
    /// Most neighbourhoods; at least 1.
    pub cell_limit: usize,
    /// Most strata that beliefs in full are told apart by; at least 1, at most 1000. They share the neighbourhoods that there may be.
    pub strata: usize,
    /// Episodes of acting at random, in thought, among whose beliefs these strata are chosen; at least 1.
    pub walks: usize,
    /// Watkins' lambda, in `[0, 1]`; 0 is one-step Q-learning.
    pub lambda: f64,
    /// Learning rate `max(rate_floor, (1 + n)^-rate_power)` at the n-th visit; the power is in `(0.5, 1]`.
    pub rate_power: f64,
    /// Smallest learning rate, in `[0, 1)`.
    pub rate_floor: f64,
    /// First Boltzmann temperature, a share of the reward range; more than 0.
    pub hot: f64,
    /// Last temperature; more than 0, at most `hot`.
    pub cold: f64,
    /// Factor on the temperature after every epoch, in `(0, 1)`.
    pub cooling: f64,
    /// Share of actions that are drawn uniformly, in `[0, 1]`: every action keeps giving evidence.
    pub explore: f64,
    /// Least steps between two revisions of the regions; at least 1.
    pub epoch: usize,
    /// Steps of an epoch for every memory, neighbourhood and action; at least 1.
    pub epoch_per_cell: usize,
    /// Most epochs of one memory; at least 1. A run that reaches it has not converged.
    pub epoch_limit: usize,
    /// An epoch is calm if the action changes for less than this share of the visits; in `(0, 1)`.
    pub still: f64,
    /// Calm epochs in a row that mean convergence; at least 1.
    pub calm: usize,
    /// Visits for every neighbourhood and action at which a memory has evidence enough, and older evidence starts to fade; at
    /// least 1.
    pub window: usize,
    /// What is left of faded evidence, in `(0, 1)`.
    pub fade: f64,
    /// Memories with less than this share of the visits are not waited for; in `[0, 1)`.
    pub rare: f64,
    /// Error rate of the test that a proposed split has to pass, in `(0, 0.5)`.
    pub split_error: f64,
    /// Error rate of the tests for extending, merging and changing the action of a region, in `(0, 0.5)`.
    pub merge_error: f64,
    /// A region has to be worth this share of the return; in `[0, 1)`.
    pub worth: f64,
    /// A reward of this share of the largest one met is an event to remember; in `(0, 1]`.
    pub notable: f64,
    /// Events farther apart than this, in `sqrt(P)` of the steady level, happened at different places; more than 0.
    pub place: f64,
    /// Thresholds tried for "the event has happened by now"; at least one, each in `(0, 1)`.
    pub odds: Vec<f64>,
    /// Episodes of a trial of an automaton; at least 2.
    pub trial: usize,
    /// Error rate of the test that a memory has to pass, in `(0, 0.5)`.
    pub adopt_error: f64,
    /// Printed rules: half-width of a split region, in `sqrt(P)`; more than 0. The thesis has 1/16.
    pub printed_width: f64,
    /// Printed rules: most steps, and most regions; at least 1.
    pub printed_limit: (usize, usize),
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            rules: Rules::Tested,
            cell: 0.85,
            cell_stride: 0.35,
            cells_along: 64,
            cell_limit: 4_000,
            strata: 12,
            walks: 100,
            lambda: 0.0,
            rate_power: 0.7,
            rate_floor: 0.01,
            hot: 1.0,
            cold: 0.05,
            cooling: 0.85,
            explore: 0.1,
            epoch: 5_000,
            epoch_per_cell: 10,
            epoch_limit: 150,
            still: 0.01,
            calm: 10,
            window: 100,
            fade: 0.7,
            rare: 0.01,
            split_error: 0.001,
            merge_error: 0.05,
            worth: 0.005,
            notable: 0.5,
            place: 3.0,
            odds: vec![0.3, 0.5, 0.7, 0.85],
            trial: 200,
            adopt_error: 0.001,
            printed_width: 1.0 / 16.0,
            printed_limit: (200_000, 400),
        }
    }
}

impl Settings {
    /// How beliefs in full are read.
    pub(super) fn strata(&self) -> Strata {
        Strata {
            most: self.strata,
            walks: self.walks,
            seed: self.seed,
        }
    }

    /// Most neighbourhoods along each of so many axes, where so many strata share all that there may be.
    pub(super) fn cells_along_in_full(&self, strata: usize, axes: usize) -> usize {
        let share = self.cell_limit as f64 / strata as f64;
        let along = share.powf(1.0 / axes as f64) as usize;
        along.clamp(1, self.cells_along)
    }

    /// How fast values are learned.
    pub(super) fn rates(&self) -> Rates {
        Rates {
            lambda: self.lambda,
            power: self.rate_power,
            floor: self.rate_floor,
        }
    }
}

impl settings::Settings for Settings {
    fn validate(&self) -> Result<()> {
        let open = |x: f64, low: f64, high: f64| low < x && x < high;
        let error_rate = "more than 0 and less than 0.5, such as 0.001";
        let reals = [
            (
                "cell",
                self.cell,
                self.cell > 0.0 && self.cell <= 10.0,
                "more than 0, at most 10",
            ),
            (
                "cell_stride",
                self.cell_stride,
                self.cell_stride >= 0.0 && self.cell_stride.is_finite(),
                "at least 0",
            ),
            (
                "lambda",
                self.lambda,
                (0.0..=1.0).contains(&self.lambda),
                "0 to 1",
            ),
            (
                "rate_power",
                self.rate_power,
                self.rate_power > 0.5 && self.rate_power <= 1.0,
                "more than 0.5, at most 1",
            ),
            (
                "rate_floor",
                self.rate_floor,
                (0.0..1.0).contains(&self.rate_floor),
                "from 0 up to, not including, 1",
            ),
            (
                "hot",
                self.hot,
                self.hot > 0.0 && self.hot.is_finite(),
                "more than 0",
            ),
            (
                "cold",
                self.cold,
                self.cold > 0.0 && self.cold <= self.hot,
                "more than 0, at most `hot`",
            ),
            (
                "cooling",
                self.cooling,
                open(self.cooling, 0.0, 1.0),
                "more than 0 and less than 1",
            ),
            (
                "explore",
                self.explore,
                (0.0..=1.0).contains(&self.explore),
                "0 to 1",
            ),
            (
                "still",
                self.still,
                open(self.still, 0.0, 1.0),
                "more than 0 and less than 1",
            ),
            (
                "fade",
                self.fade,
                open(self.fade, 0.0, 1.0),
                "more than 0 and less than 1",
            ),
            (
                "rare",
                self.rare,
                (0.0..1.0).contains(&self.rare),
                "from 0 up to, not including, 1",
            ),
            (
                "split_error",
                self.split_error,
                open(self.split_error, 0.0, 0.5),
                error_rate,
            ),
            (
                "merge_error",
                self.merge_error,
                open(self.merge_error, 0.0, 0.5),
                error_rate,
            ),
            (
                "worth",
                self.worth,
                (0.0..1.0).contains(&self.worth),
                "from 0 up to, not including, 1",
            ),
            (
                "notable",
                self.notable,
                self.notable > 0.0 && self.notable <= 1.0,
                "more than 0, at most 1",
            ),
            (
                "place",
                self.place,
                self.place > 0.0 && self.place.is_finite(),
                "more than 0",
            ),
            (
                "adopt_error",
                self.adopt_error,
                open(self.adopt_error, 0.0, 0.5),
                error_rate,
            ),
            (
                "printed_width",
                self.printed_width,
                self.printed_width > 0.0 && self.printed_width.is_finite(),
                "more than 0",
            ),
        ];
        for (setting, value, fits, range) in reals {
            ensure(setting, value, fits, range)?;
        }
        for &odds in &self.odds {
            ensure(
                "odds",
                odds,
                open(odds, 0.0, 1.0),
                "more than 0 and less than 1",
            )?;
        }
        self.strata().validate()?;
        let counts = [
            ("cell_limit", self.cell_limit, 1, KEPT),
            ("cells_along", self.cells_along, 1, KEPT),
            ("epoch", self.epoch, 1, MANY),
            ("epoch_per_cell", self.epoch_per_cell, 1, KEPT),
            ("epoch_limit", self.epoch_limit, 1, MANY),
            ("calm", self.calm, 1, MANY),
            ("window", self.window, 1, KEPT),
            ("odds", self.odds.len(), 1, PAIRED),
            ("trial", self.trial, 2, KEPT),
            ("printed_limit", self.printed_limit.0, 1, MANY),
            ("printed_limit", self.printed_limit.1, 1, PAIRED),
        ];
        for (setting, value, least, most) in counts {
            ensure_count(setting, value, least, most)?;
        }
        Ok(())
    }
}
