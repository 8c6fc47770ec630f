//! All that can be made again, in the order of the thesis.

use pilotage_report::Finding;

use crate::context::Context;
use crate::error::Result;
use crate::{chapter3, chapter4, chapter5, chapter6, learning, pole, wake_up};

/// A table or figure, and how to make it again.
pub struct Experiment {
    /// Its name on the command line and in links.
    pub id: &'static str,
    /// What it is, in a few words.
    pub about: &'static str,
    /// How long it takes in the full report and in the quick one, compared with the others: to foretell what is left.
    pub cost: (f64, f64),
    /// Makes it; the finding has no id yet.
    pub make: fn(&Context<'_>) -> Result<Finding>,
}

const fn of(
    id: &'static str,
    about: &'static str,
    cost: (f64, f64),
    make: fn(&Context<'_>) -> Result<Finding>,
) -> Experiment {
    Experiment {
        id,
        about,
        cost,
        make,
    }
}

/// All of them.
#[rustfmt::skip]
pub const EXPERIMENTS: &[Experiment] = &[
    of("figure-3.4", "ARKAQ in the basic world (and 3.5, 3.6)", (10.0, 0.5), chapter3::figure_3_4),
    of("figure-3.8", "ARKAQ in the 4x4 maze (and 3.9, 3.10)", (100.0, 2.0), chapter3::figure_3_8),
    of("figure-3.11", "ARKAQ and the hidden load", (10.0, 0.5), chapter3::figure_3_11),
    of("figure-3.13", "ARKAQ and the four stations (and 3.14)", (60.0, 4.0), chapter3::figure_3_13),
    of("figure-3.15", "ARKAQ and the shuttle (and 3.16)", (20.0, 0.5), chapter3::figure_3_15),
    of("table-3.1", "the pole's parameters and linearisation", (0.0, 0.0), chapter3::table_3_1),
    of("section-3.4.8", "ARKAQ and the pole", (30.0, 3.0), chapter3::section_3_4_8),
    of("table-4.1", "uncertainty levels", (0.0, 0.0), chapter4::table_4_1),
    of("figure-4.8", "KAFAQ in the basic world (and 4.9)", (1.0, 0.2), learning::figure_4_8),
    of("figure-4.10", "KAFAQ in the 4x4 maze (and 4.11)", (10.0, 1.0), learning::figure_4_10),
    of("figure-4.12", "KAFAQ and the hidden load (and 4.13)", (5.0, 0.5), learning::figure_4_12),
    of("figure-4.14", "KAFAQ and the four stations (and 4.15)", (80.0, 5.0), learning::figure_4_14),
    of("figure-4.16", "KAFAQ and the shuttle (and 4.17)", (5.0, 0.5), learning::figure_4_16),
    of("section-4.3.6", "KAFAQ balances the pole", (60.0, 4.0), learning::section_4_3_6),
    of("figure-5.2", "reward at a belief", (0.0, 0.0), chapter5::figure_5_2),
    of("figure-5.4", "beliefs reachable in one step (and 5.3)", (0.0, 0.0), chapter5::figures_5_3_and_5_4),
    of("figure-5.6", "levels of the one-dimensional maze", (0.0, 0.0), chapter5::figure_5_6),
    of("figure-5.10", "the tiger (and 5.9)", (12.0, 3.0), chapter5::figures_5_9_and_5_10),
    of("figure-5.13", "the one-dimensional maze (and 5.11, 5.12)", (10.0, 1.5), chapter5::figures_5_11_to_5_13),
    of("convergence", "policy convergence horizons", (20.0, 3.0), chapter5::convergence),
    of("section-5.5.3", "the two-dimensional maze", (20.0, 0.5), chapter5::section_5_5_3),
    of("figure-5.14", "the hidden load (and 2.10, 2.11)", (0.5, 0.3), chapter5::figure_5_14),
    of("section-5.5.5", "the inverted pendulum", (120.0, 4.0), pole::section_5_5_5),
    of("table-5.1", "policy of the U-shaped maze", (1.0, 1.0), wake_up::table_5_1),
    of("figure-5.17", "waking up lost (and 5.16)", (40.0, 2.5), wake_up::figures_5_16_and_5_17),
    of("declare", "a maze in which looking pays", (5.0, 1.0), chapter5::declare),
    of("table-6.1", "segments and nearest neighbours", (30.0, 4.0), chapter6::table_6_1),
    of("figure-6.2", "ARKAQ and KAFAQ compared", (150.0, 2.0), chapter3::figure_6_2),
    of("table-a.1", "Q-values of the pole", (0.0, 0.0), chapter4::table_a_1),
];
