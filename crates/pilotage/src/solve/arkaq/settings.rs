//! What a learning run can be told.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::solve::learn::{Rates, Strata};
use crate::solve::settings::{self, KEPT, MANY, PAIRED, ensure, ensure_count};

/// Largest [`Settings::depth`].
const MOST_DEPTH: usize = 16;

/// Settings of ARKAQ-learning. Lengths are shares of the world, rewards shares of the range of the rewards that were met, so that the
/// defaults do not depend on a problem's units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Settings {
    /// Seed of every random number.
    pub seed: u64,
    /// Vigilances to try, at least one, each in `[0, 1]`, rising. With a single one that is the vigilance; of several the one is kept
    /// above which trials show no sure gain.
    pub vigilances: Vec<f64>,
    /// How far the centre of a cluster moves to a belief that falls into it, `beta` of Eq. 3.1, in `[0, 1]`.
    pub rate: f64,
    /// Steps that are remembered, each the action and the cluster it was taken in: at most 16; 1 in the thesis.
    pub depth: usize,
    /// A reward of this share of the largest one met sets a cluster apart while the world is explored; in `(0, 1]`.
    pub notable: f64,
    /// Steps that find out how large rewards are before clusters are made; at least 0.
    pub scout: usize,
    /// Steps without a new cluster, then without a new state, that end the exploration; at least 1.
    pub settle: usize,
    /// Most steps of exploration for clusters, and for states; at least 1.
    pub explore_limit: usize,
    /// Most clusters, and most states; at least 1. Exploration that reaches it ends there, and learning goes on with those there are.
    pub state_limit: usize,
    /// Most strata that beliefs in full are told apart by; at least 1, at most 1000. How certain they are, and of which mode, tells clusters apart.
    pub strata: usize,
    /// Episodes of acting at random, in thought, among whose beliefs these strata are chosen; at least 1.
    pub walks: usize,
    /// Watkins' lambda, in `[0, 1]`; 0 is one-step Q-learning.
    pub lambda: f64,
    /// Learning rate of values, `max(rate_floor, (1 + n)^-rate_power)` at the n-th visit; the power is in `(0.5, 1]`.
    pub rate_power: f64,
    /// Smallest learning rate of values, in `[0, 1)`.
    pub rate_floor: f64,
    /// First Boltzmann temperature, a share of the reward range; more than 0.
    pub hot: f64,
    /// Last temperature; more than 0, at most `hot`.
    pub cold: f64,
    /// Factor on the temperature after every epoch, in `(0, 1)`.
    pub cooling: f64,
    /// Share of actions that are drawn uniformly while values are learned, in `[0, 1]`.
    pub explore: f64,
    /// Least steps of an epoch; at least 1.
    pub epoch: usize,
    /// Steps of an epoch for every state and action; at least 1.
    pub epoch_per_entry: usize,
    /// Most epochs; at least 1. A run that reaches it has not converged.
    pub epoch_limit: usize,
    /// An epoch is calm if the best action changed for less than this share of its visits; in `(0, 1)`.
    pub still: f64,
    /// Calm epochs in a row that mean convergence; at least 1.
    pub calm: usize,
    /// Whether states that agree in action and value are merged: `true` or `false`.
    pub merge: bool,
    /// Values agree that differ by at most this share of the range of values; in `[0, 1]`.
    pub agree: f64,
    /// All merging together may cost this share of the return; in `[0, 1)`.
    pub worth: f64,
    /// Error rate of the test that merging lost something, in `(0, 0.5)`.
    pub merge_error: f64,
    /// Episodes of a trial of an automaton; at least 2.
    pub trial: usize,
    /// Error rate of the test that a higher vigilance has to pass, in `(0, 0.5)`.
    pub adopt_error: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            vigilances: vec![0.8],
            rate: 0.05,
            depth: 1,
            notable: 0.5,
            scout: 1_000,
            settle: 2_000,
            explore_limit: 50_000,
            state_limit: 200,
            strata: 40,
            walks: 100,
            lambda: 0.0,
            rate_power: 0.7,
            rate_floor: 0.01,
            hot: 1.0,
            cold: 0.01,
            cooling: 0.85,
            explore: 0.05,
            epoch: 5_000,
            epoch_per_entry: 25,
            epoch_limit: 80,
            still: 0.02,
            calm: 5,
            merge: false,
            agree: 0.25,
            worth: 0.01,
            merge_error: 0.05,
            trial: 200,
            adopt_error: 0.001,
        }
    }
}

impl Settings {
    /// ARKAQ with what the thesis left to be done (chapter 7): vigilance that tunes itself, states that merge, and Q(lambda); and with a
    /// memory that reaches farther back than one cluster.
    pub fn extended() -> Self {
        Self {
            vigilances: vec![0.1, 0.3, 0.5, 0.7, 0.8],
            merge: true,
            ..Self::remembering()
        }
    }

    /// ARKAQ with a memory of three steps, room for the states that takes, and Q(lambda).
    pub fn remembering() -> Self {
        Self {
            lambda: 0.9,
            depth: 3,
            state_limit: 1_000,
            ..Self::default()
        }
    }

    /// How beliefs in full are read.
    pub(super) fn strata(&self) -> Strata {
        Strata {
            most: self.strata,
            walks: self.walks,
            seed: self.seed,
        }
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
        let unit = |x: f64| (0.0..=1.0).contains(&x);
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let error_rate = "more than 0 and less than 0.5, such as 0.001";
        for &vigilance in &self.vigilances {
            ensure("vigilance", vigilance, unit(vigilance), "0 to 1")?;
        }
        let rising = self.vigilances.windows(2).find(|pair| pair[0] >= pair[1]);
        if let Some(pair) = rising {
            ensure(
                "vigilances",
                pair[1],
                false,
                "each more than the one before",
            )?;
        }
        let reals = [
            ("rate", self.rate, unit(self.rate), "0 to 1"),
            (
                "notable",
                self.notable,
                self.notable > 0.0 && self.notable <= 1.0,
                "more than 0, at most 1",
            ),
            ("lambda", self.lambda, unit(self.lambda), "0 to 1"),
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
            ("hot", self.hot, positive(self.hot), "more than 0"),
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
            ("explore", self.explore, unit(self.explore), "0 to 1"),
            (
                "still",
                self.still,
                open(self.still, 0.0, 1.0),
                "more than 0 and less than 1",
            ),
            ("agree", self.agree, unit(self.agree), "0 to 1"),
            (
                "worth",
                self.worth,
                (0.0..1.0).contains(&self.worth),
                "from 0 up to, not including, 1",
            ),
            (
                "merge_error",
                self.merge_error,
                open(self.merge_error, 0.0, 0.5),
                error_rate,
            ),
            (
                "adopt_error",
                self.adopt_error,
                open(self.adopt_error, 0.0, 0.5),
                error_rate,
            ),
        ];
        for (setting, value, fits, range) in reals {
            ensure(setting, value, fits, range)?;
        }
        self.strata().validate()?;
        let counts = [
            ("vigilances", self.vigilances.len(), 1, PAIRED),
            ("scout", self.scout, 0, MANY),
            ("settle", self.settle, 1, MANY),
            ("explore_limit", self.explore_limit, 1, MANY),
            ("state_limit", self.state_limit, 1, PAIRED),
            ("epoch", self.epoch, 1, MANY),
            ("epoch_per_entry", self.epoch_per_entry, 1, KEPT),
            ("epoch_limit", self.epoch_limit, 1, MANY),
            ("calm", self.calm, 1, MANY),
            ("trial", self.trial, 2, KEPT),
        ];
        for (setting, value, least, most) in counts {
            ensure_count(setting, value, least, most)?;
        }
        ensure("depth", self.depth, self.depth <= MOST_DEPTH, "0 to 16")
    }
}
