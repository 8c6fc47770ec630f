//! Automata: the thesis' rules for learning them, running them, writing files whole.
#![allow(clippy::unwrap_used)]

mod common;

use common::automata::{any_automaton, one_node};
use common::built_in;
use pilotage::Error;
use pilotage::belief::{Belief, BeliefMdp};
use pilotage::model::ActionId;
use pilotage::policy::{Automaton, AutomatonRunner, Matching, Policy, write_whole};
use pilotage::solve::compile::{self, compile};
use pilotage::solve::rollout;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    /// Also where levels and modes have no node of their own, and for means on a grid, where distances are equal.
    #[test]
    fn a_controller_decides_as_its_automaton(
        automaton in any_automaton(-5.0..5.0_f64, 1..30),
        beliefs in proptest::collection::vec(
            (0..100_usize, 0..4_usize, proptest::collection::vec(-8.0..8.0_f64, 4)), 20),
    ) {
        let controller = AutomatonRunner::new(&automaton);
        for (level, mode, mean) in beliefs {
            let belief = Belief {
                stratum: level % automaton.levels.len(),
                mode: mode % automaton.modes.len(),
                mean: mean[..automaton.states.len()].to_vec(),
            };
            prop_assert_eq!(controller.action(&belief), automaton.action(&belief));
        }
    }

    /// The same on whole numbers, so that many nodes are equally near: the first of them counts for both.
    #[test]
    fn a_controller_breaks_ties_as_its_automaton(
        mut automaton in any_automaton((-2..=2_i32).prop_map(f64::from), 1..30),
        means in proptest::collection::vec(proptest::collection::vec(-3..=3_i32, 4), 20),
    ) {
        automaton.scale.fill(1.0);
        let controller = AutomatonRunner::new(&automaton);
        for mean in means {
            let mean = mean[..automaton.states.len()].iter().copied().map(f64::from).collect();
            let belief = Belief { stratum: 0, mode: 0, mean };
            prop_assert_eq!(controller.action(&belief), automaton.action(&belief));
        }
    }
}

#[test]
fn files_are_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let listing = || std::fs::read_dir(folder.path()).unwrap().count();

    let path = folder.path().join("policy.json");
    std::fs::write(&path, "old").unwrap();
    write_whole(&path, b"new").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
    assert_eq!(listing(), 1);

    let lost = folder.path().join("missing").join("policy.json");
    let error = one_node().save(&lost).unwrap_err();
    assert!(matches!(&error, Error::Io { path, .. } if *path == lost));
    assert!(error.to_string().contains("missing"), "{error}");
    assert_eq!(listing(), 1);

    // A folder cannot be replaced by a file: the move fails after everything was written, and nothing is left behind.
    let taken = folder.path().join("folder");
    std::fs::create_dir(&taken).unwrap();
    assert!(write_whole(&taken, b"new").is_err());
    assert!(taken.is_dir());
    assert_eq!(listing(), 2);

    assert!(Automaton::load(&folder.path().join("nowhere.json")).is_err());
    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    assert!(matches!(
        Automaton::load(&path).unwrap_err(),
        Error::Io { .. }
    ));
}

/// A place where even the administrator cannot write.
#[cfg(target_os = "linux")]
#[test]
fn a_read_only_target_is_an_error() {
    let error = one_node()
        .save(std::path::Path::new("/proc/policy.json"))
        .unwrap_err();
    assert!(error.to_string().contains("/proc/policy.json"), "{error}");
}

/// What a policy does on a line: one action between each two borders, the same at every level.
#[derive(Debug)]
struct Pieces {
    borders: Vec<f64>,
    actions: Vec<ActionId>,
}

impl Policy for Pieces {
    fn action(&self, belief: &Belief) -> ActionId {
        let passed = self
            .borders
            .iter()
            .filter(|border| **border <= belief.mean[0]);
        self.actions[passed.count()]
    }
}

/// Borders at least 0.05 apart, and actions that change at each of them.
fn pieces() -> impl Strategy<Value = Pieces> {
    let widths = proptest::collection::vec(0.05..1.5_f64, 0..6);
    let turns = proptest::collection::vec(1..3_usize, 6);
    (-2.0..2.0_f64, widths, turns).prop_map(|(first, widths, turns)| {
        let mut borders = Vec::new();
        let mut actions = vec![0];
        let mut at = first;
        for (width, turn) in widths.iter().zip(turns) {
            borders.push(at);
            actions.push((actions[actions.len() - 1] + turn) % 3);
            at += width;
        }
        Pieces { borders, actions }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Among the means that were met, a compiled automaton does exactly what the policy does, right up to its borders.
    #[test]
    fn compiling_on_a_line_keeps_every_border(pieces in pieces()) {
        let model = built_in("corridor-unbounded");
        let mdp = BeliefMdp::new(&model);
        for matching in [Matching::Nearest, Matching::Segments] {
            let settings = compile::Settings { matching, episodes: 20, ..compile::Settings::default() };
            let automaton = compile(&pieces, &mdp, "test", &settings).unwrap();
            let met = rollout::decisions(
                &mdp, &mdp.filter().into(), &pieces, settings.episodes, model.episode.length, settings.seed);
            let means = || met.iter().flatten().map(|decision| decision.at.mean[0]);
            let (low, high) = (means().fold(f64::INFINITY, f64::min), means().fold(f64::NEG_INFINITY, f64::max));
            let inside: Vec<f64> = pieces.borders.iter().copied().filter(|x| low < *x && *x < high).collect();
            let near = inside.iter().flat_map(|border| [border - 1e-9, border + 1e-9]);
            let spread = (0..=500).map(|k| low + (high - low) * f64::from(k) / 500.0);
            for mean in near.chain(spread).chain(means()).filter(|x| (low..=high).contains(x)) {
                if pieces.borders.iter().any(|border| (border - mean).abs() < 0.5e-9) {
                    continue;
                }
                for level in [0, 1, mdp.strata() - 1] {
                    let belief = Belief { stratum: level, mode: 0, mean: vec![mean] };
                    prop_assert_eq!(
                        automaton.action(&belief), pieces.action(&belief),
                        "{:?} at {}, borders {:?}", matching, mean, inside);
                }
            }
            // A segment for every interval; a point for every interval, or two for every border. Borders beside the way count too.
            let borders = pieces.borders.len();
            let most = match matching {
                Matching::Segments | Matching::Tree => borders + 1,
                Matching::Nearest => (borders + 1).max(2 * borders),
            };
            prop_assert!(automaton.nodes.len() <= most);
        }
    }
}
