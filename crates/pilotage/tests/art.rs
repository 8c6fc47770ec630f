//! ART 2-A: what its authors promise of it, and what it refuses.
#![allow(clippy::unwrap_used)]

use pilotage::Error;
use pilotage::random::{Role, normal, stream, uniform};
use pilotage::solve::arkaq::art::{Art, Outcome, Rule, Settings, complement};
use proptest::prelude::*;

const LENGTH: usize = 4;

fn network(rule: Rule, vigilance: f64, rate: f64) -> Art {
    let settings = Settings {
        vigilance,
        rate,
        rule,
        limit: usize::MAX,
    };
    Art::new(LENGTH, settings).unwrap()
}

fn cosine() -> Rule {
    Rule::Cosine {
        theta: 0.2,
        alpha: 0.1,
    }
}

const DISTANCE: Rule = Rule::Distance { extent: 1.0 };

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Inputs that both rules accept: positive and not uniform.
fn inputs() -> impl Strategy<Value = Vec<Vec<f64>>> {
    let input = prop::collection::vec(0.01..1.0_f64, LENGTH);
    let uneven = input.prop_filter("uniform", |x| x.iter().any(|y| *y != x[0]));
    prop::collection::vec(uneven, 1..60)
}

proptest! {
    #[test]
    fn centres_stay_bounded(inputs in inputs(), vigilance in 0.0..=1.0_f64, rate in 0.0..=1.0_f64) {
        let mut art = network(cosine(), vigilance, rate);
        for input in &inputs {
            art.present(input).unwrap();
            for centre in art.centres() {
                prop_assert!((norm(centre) - 1.0).abs() < 1e-12);
                prop_assert!(centre.iter().all(|z| (0.0..=1.0 + 1e-12).contains(z)));
            }
        }
        // By distance, centres stay in the box of their inputs.
        let mut art = network(DISTANCE, vigilance, rate);
        for input in &inputs {
            art.present(input).unwrap();
        }
        for i in 0..LENGTH {
            let along = || inputs.iter().map(|input| input[i]);
            let (low, high) = (along().fold(1.0, f64::min), along().fold(0.0, f64::max));
            prop_assert!(art.centres().iter().all(|z| low - 1e-12 <= z[i] && z[i] <= high + 1e-12));
        }
    }

    /// An input that founded a category or resonated with one by distance stays there, however often it is shown; by the cosine, where
    /// components fade for good, it may leave for a category of its own, but only once.
    #[test]
    fn a_repeated_input_settles(inputs in inputs(), vigilance in 0.0..=1.0_f64, rate in 0.0..=1.0_f64) {
        for (rule, most) in [(DISTANCE, 0), (cosine(), 1)] {
            let mut art = network(rule, vigilance, rate);
            for input in &inputs {
                art.present(input).unwrap();
            }
            let last = &inputs[inputs.len() - 1];
            let (known, mut category, mut left) = (art.centres().len(), None, 0);
            for _ in 0..200 {
                let shown = art.present(last).unwrap();
                left += usize::from(category.is_some_and(|before| before != shown.category));
                category = Some(shown.category);
            }
            prop_assert!(left <= most && art.centres().len() <= known + most);
        }
    }

    /// With centres that do not move, no two categories of a network fit into one of a network that allows half the distance.
    #[test]
    fn halving_the_distance_never_gives_fewer_categories(inputs in inputs(), vigilance in 0.0..1.0_f64) {
        let count = |rule, vigilance| {
            let mut art = network(rule, vigilance, 0.0);
            inputs.iter().for_each(|input| assert!(art.present(input).unwrap().resonance >= 0.0));
            art.centres().len()
        };
        prop_assert!(count(DISTANCE, 1.0 - 0.5 * (1.0 - vigilance)) >= count(DISTANCE, vigilance));
        // By the cosine the distance is the angle; an uncommitted category that attracts inputs would spoil it.
        let angles = Rule::Cosine { theta: 0.001, alpha: 0.0 };
        let half = (0.5 * vigilance.acos()).cos();
        prop_assert!(count(angles, half) >= count(angles, vigilance));
    }

    #[test]
    fn what_is_refused_leaves_the_network_unchanged(inputs in inputs(), place in 0..LENGTH, level in -1.0..1.0_f64) {
        for rule in [DISTANCE, cosine()] {
            let mut art = network(rule, 0.8, 0.3);
            inputs.iter().for_each(|input| assert!(art.present(input).unwrap().resonance >= 0.0));
            let before = art.clone();
            let mut bad = vec![vec![0.5; LENGTH + 1], Vec::new()];
            for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut input = inputs[0].clone();
                input[place] = wrong;
                bad.push(input);
            }
            if rule != DISTANCE {
                bad.extend([vec![0.0; LENGTH], vec![level; LENGTH], vec![-1.0, -0.5, -0.2, -0.1]]);
            }
            for input in &bad {
                prop_assert!(matches!(art.present(input), Err(Error::Input { .. })), "{input:?}");
                prop_assert!(art.classify(input).is_err());
                prop_assert_eq!(&art, &before);
            }
        }
    }
}

#[test]
fn refusals_name_the_place_and_the_value() {
    let mut art = network(cosine(), 0.5, 0.5);
    let mut refusal = |input: &[f64]| art.present(input).unwrap_err().to_string();
    let text = refusal(&[0.1, 0.2, f64::NAN, 0.4]);
    assert!(text.contains("component 2 = NaN"), "{text}");
    let text = refusal(&[0.1, 0.2]);
    assert!(text.contains("length = 2") && text.contains('4'), "{text}");
    let text = refusal(&[0.0; 4]);
    assert!(text.contains("= 0") && text.contains("uniform"), "{text}");
    let text = refusal(&[0.25; 4]);
    assert!(text.contains("= 0.25"), "{text}");
    let text = refusal(&[-1.0, -0.1, -0.2, -0.3]);
    assert!(text.contains("component 1 = -0.1"), "{text}");
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let good = Settings {
        vigilance: 0.5,
        rate: 0.5,
        rule: cosine(),
        limit: 10,
    };
    assert!(Art::new(LENGTH, good.clone()).is_ok());
    let rule = |theta, alpha| Rule::Cosine { theta, alpha };
    let bad = [
        (
            "vigilance",
            Settings {
                vigilance: 1.01,
                ..good.clone()
            },
        ),
        (
            "vigilance",
            Settings {
                vigilance: -0.1,
                ..good.clone()
            },
        ),
        (
            "vigilance",
            Settings {
                vigilance: f64::NAN,
                ..good.clone()
            },
        ),
        (
            "rate",
            Settings {
                rate: 1.5,
                ..good.clone()
            },
        ),
        (
            "limit",
            Settings {
                limit: 0,
                ..good.clone()
            },
        ),
        (
            "theta",
            Settings {
                rule: rule(0.0, 0.1),
                ..good.clone()
            },
        ),
        (
            "theta",
            Settings {
                rule: rule(0.51, 0.1),
                ..good.clone()
            },
        ),
        (
            "alpha",
            Settings {
                rule: rule(0.2, 0.51),
                ..good.clone()
            },
        ),
        (
            "extent",
            Settings {
                rule: Rule::Distance { extent: 0.0 },
                ..good
            },
        ),
    ];
    for (name, settings) in bad {
        let error = Art::new(LENGTH, settings).unwrap_err();
        assert!(
            matches!(error, Error::Setting { setting, .. } if setting == name),
            "{name}: {error}"
        );
    }
}

/// A case done by hand, for Eq. 2.39 to 2.50 with the threshold of the paper.
#[test]
fn the_equations_are_those_of_the_paper() {
    let settings = Settings {
        vigilance: 0.9,
        rate: 0.5,
        rule: Rule::Cosine {
            theta: 0.3,
            alpha: 0.0,
        },
        limit: 3,
    };
    let mut art = Art::new(3, settings).unwrap();
    // |(3, 4, 1)| = sqrt 26; 1 / sqrt 26 is below theta, so the code is (3, 4, 0) / 5.
    let first = art.present(&[3.0, 4.0, 1.0]).unwrap();
    assert_eq!((first.category, first.outcome), (0, Outcome::Committed));
    let close = |x: &[f64], y: &[f64]| x.iter().zip(y).all(|(x, y)| (x - y).abs() < 1e-12);
    assert!(close(&art.centres()[0], &[0.6, 0.8, 0.0]));
    // The code of (4, 3, 2) is itself over sqrt 29. Its match is 24 / (5 sqrt 29) = 0.891: a new category.
    let second = art.present(&[4.0, 3.0, 2.0]).unwrap();
    assert_eq!(second.outcome, Outcome::Committed);
    // (4, 4, 2) / 6 matches the second best: (16 + 12 + 4) / (6 sqrt 29) = 0.990 against 28 / 30.
    let third = art.present(&[4.0, 4.0, 2.0]).unwrap();
    assert_eq!((third.category, third.outcome), (1, Outcome::Resonated));
    assert!((third.resonance - 32.0 / (6.0 * 29.0_f64.sqrt())).abs() < 1e-12);
    let root = 29.0_f64.sqrt();
    let sum: Vec<f64> = [4.0, 4.0, 2.0]
        .iter()
        .zip([4.0, 3.0, 2.0])
        .map(|(i, z)| 0.5 * i / 6.0 + 0.5 * z / root)
        .collect();
    let length = norm(&sum);
    let expected: Vec<f64> = sum.iter().map(|x| x / length).collect();
    assert!(close(&art.centres()[1], &expected));
    // Psi leaves out what the centre has not: category 0 learns nothing about the third component.
    let fourth = art.present(&[2.5, 6.0, 2.3]).unwrap();
    assert_eq!((fourth.category, fourth.outcome), (0, Outcome::Resonated));
    let psi = norm(&[2.5, 6.0]);
    let sum = [0.5 * (2.5 / psi + 0.6), 0.5 * (6.0 / psi + 0.8), 0.0];
    let expected = sum.map(|x| x / norm(&sum));
    assert!(close(&art.centres()[0], &expected));
    // A full network says so, and learns nothing.
    art.present(&[0.0, 0.0, 1.0]).unwrap();
    let before = art.clone();
    let full = art.present(&[1.0, 0.0, 0.0]).unwrap();
    assert_eq!(full.outcome, Outcome::Full);
    assert_eq!(art, before);
}

/// On the whole: mean number of categories over 40 sequences of 300 inputs, by both rules, at a rate of 0.1.
#[test]
fn more_vigilance_means_more_categories_on_the_whole() {
    let sequence = |seed| -> Vec<Vec<f64>> {
        let mut rng = stream(seed, 0, Role::World);
        let mut input = || {
            let x = [
                uniform(&mut rng),
                (0.5 + 0.15 * normal(&mut rng)).clamp(0.0, 1.0),
            ];
            complement(&x).collect::<Vec<f64>>()
        };
        (0..300).map(|_| input()).collect()
    };
    for rule in [DISTANCE, cosine()] {
        let mut before = 0.0;
        for vigilance in [0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95] {
            let counts = (0..40).map(|seed| {
                let mut art = network(rule, vigilance, 0.1);
                sequence(seed)
                    .iter()
                    .for_each(|input| assert!(art.present(input).unwrap().resonance >= 0.0));
                art.centres().len() as f64
            });
            let mean = counts.sum::<f64>() / 40.0;
            assert!(
                mean >= before,
                "{rule:?} at {vigilance}: {mean} after {before}"
            );
            before = mean;
        }
        assert!(before > 10.0);
    }
    // At the ends: one category, or one for each input.
    let mut all = network(DISTANCE, 1.0, 0.1);
    let mut one = network(DISTANCE, 0.0, 0.1);
    for input in sequence(0) {
        all.present(&input).unwrap();
        one.present(&input).unwrap();
    }
    assert_eq!((all.centres().len(), one.centres().len()), (300, 1));
}

/// It is no law: here vigilance 0.5 gives three categories and 0.55 two.
#[test]
fn a_single_sequence_may_go_the_other_way() {
    let settings = |vigilance| Settings {
        vigilance,
        rate: 0.0,
        rule: DISTANCE,
        limit: 10,
    };
    // The second input is at 0.48 from the first, the others at 0.44 from the second and more than 0.5 from the first and each other.
    let inputs = [[0.0, 0.0], [0.48, 0.0], [0.55, 0.43], [0.55, -0.43]];
    let count = |vigilance| {
        let mut art = Art::new(2, settings(vigilance)).unwrap();
        inputs
            .iter()
            .for_each(|input| assert!(art.present(input).unwrap().resonance >= 0.0));
        art.centres().len()
    };
    assert_eq!((count(0.5), count(0.55)), (3, 2));
}
