//! Uncertainty levels: Table 4.1, the steady state by two ways, graphs of several noise classes.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Numbers, System, action, apart, built_in, scalar};
use nalgebra::{DMatrix, DVector};
use pilotage::Error;
use pilotage::belief::riccati::{predicted_steady_state, steady_state};
use pilotage::belief::{BeliefMdp, Correction, LevelGraph};
use pilotage::model::Model;
use proptest::prelude::*;

fn graph(model: &Model) -> LevelGraph {
    let starts: Vec<_> = model
        .start
        .iter()
        .map(|start| start.covariance.clone())
        .collect();
    LevelGraph::new(model, &starts)
}

fn levels(q: f64, r: f64, p: f64, tolerance: f64) -> LevelGraph {
    let mut model = scalar(q, r, p).model();
    model.belief.level_tolerance = tolerance;
    graph(&model)
}

/// Steps until `P` converges for Q = R = 0.5, from five initial uncertainties.
#[test]
fn table_4_1() {
    let steps = [1000.0, 5.0, 1.0, 0.8, 0.3].map(|p| levels(0.5, 0.5, p, 5e-7).len() - 1);
    assert_eq!(steps, [9, 9, 9, 8, 7]);
}

/// The limit is `P = (-Q + sqrt(Q^2 + 4 Q R)) / 2` for `A = H = 1`.
#[test]
fn the_last_level_is_the_steady_state() {
    for (q, r, p) in [
        (0.5, 0.5, 1000.0),
        (0.25, 0.45, 0.3),
        (0.15, 0.2, 5.0),
        (2.0, 0.1, 0.0),
    ] {
        let graph = levels(q, r, p, 5e-7);
        let steady = graph.steady(0, 0).unwrap();
        let exact = 0.5 * (-q + f64::sqrt(q * q + 4.0 * q * r));
        assert_eq!(steady, graph.len() - 1);
        assert!((graph.covariance(steady)[0] - exact).abs() < 1e-14 * (1.0 + exact));
    }
}

#[test]
fn the_corridor_converges_to_0_232946() {
    for name in ["corridor-blind", "corridor-unbounded", "corridor-declare"] {
        let mdp = BeliefMdp::new(&built_in(name));
        let steady = mdp.levels().steady(0, 0).unwrap();
        let covariance = mdp.covariance(steady)[0];
        assert!((covariance - 0.232946).abs() < 5e-7, "{covariance}");
    }
    let model = built_in("corridor-blind");
    let sequence = [0.3, 0.2475, 0.2363, 0.2337, 0.2331, 0.2330];
    let graph = graph(&model);
    for (level, expected) in sequence.into_iter().enumerate() {
        assert!((graph.covariance(level)[0] - expected).abs() < 5e-5);
    }
}

/// Three levels, as the thesis says (5.5.3): the start, one step later, steady.
#[test]
fn the_two_dimensional_maze_has_three_levels() {
    for name in ["maze-2d", "maze-2d-unbounded"] {
        let graph = graph(&built_in(name));
        assert_eq!(graph.len(), 3);
        let variance = |level| graph.covariance(level)[(0, 0)];
        assert_eq!(variance(0), 5.0);
        assert!((variance(1) - 5.15 * 0.2 / 5.35).abs() < 1e-12);
        let steady = 0.5 * (-0.15 + f64::sqrt(0.15 * 0.15 + 4.0 * 0.15 * 0.2));
        assert!((variance(2) - steady).abs() < 1e-12);
        assert_eq!(graph.steady(0, 0), Some(2));
    }
}

/// A tiger that does not move: `P_n = 1 / (1 / P_0 + n / R)` falls for ever, like `R / n`.
#[test]
fn the_tiger_has_no_steady_state() {
    for name in ["tiger", "tiger-sd"] {
        let model = built_in(name);
        let noise = &model.sensor.noise;
        let error = steady_state(&model.motion.a, &model.motion.noise, &model.sensor.h, noise);
        let Err(Error::NoSteadyState { direction, .. }) = &error else {
            panic!("{error:?}");
        };
        assert_eq!(direction.trim_start_matches('-'), "1.000");

        let mdp = BeliefMdp::new(&model);
        for level in 0..mdp.strata() - 1 {
            let expected = 1.0 / (1.0 + level as f64 / noise[0]);
            assert!((mdp.covariance(level)[0] - expected).abs() < 1e-12);
        }
    }
}

fn direction(a: &[f64], q: &[f64], h: &[f64]) -> Vec<f64> {
    let n = a.len();
    let diagonal = |values: &[f64]| DMatrix::from_diagonal(&DVector::from_column_slice(values));
    let one = DMatrix::identity(1, 1);
    let h = DMatrix::from_row_slice(1, n, h);
    match steady_state(&diagonal(a), &diagonal(q), &h, &one) {
        Err(Error::NoSteadyState {
            direction, change, ..
        }) => {
            assert!(change > 0.0);
            let parsed = direction.split(", ").map(|x| x.parse::<f64>().unwrap());
            parsed.map(f64::abs).collect()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn names_the_direction_that_has_no_steady_state() {
    // The first variable grows and is not sensed.
    assert_eq!(direction(&[1.2, 0.5], &[0.1, 0.1], &[0.0, 1.0]), [1.0, 0.0]);
    // It stays, is disturbed, and is not sensed.
    assert_eq!(direction(&[0.5, 1.0], &[0.1, 0.1], &[1.0, 0.0]), [0.0, 1.0]);
    // It stays and nothing disturbs it: certainty grows for ever.
    assert_eq!(direction(&[0.5, 1.0], &[0.1, 0.0], &[0.0, 1.0]), [0.0, 1.0]);
}

#[test]
fn a_sensor_noise_that_cannot_be_inverted_is_an_error() {
    let (one, zero) = (DMatrix::identity(1, 1), DMatrix::zeros(1, 1));
    let error = steady_state(&one, &one, &one, &zero).unwrap_err();
    assert!(matches!(error, Error::NotPositiveDefinite { eigenvalue, .. } if eigenvalue == 0.0));
}

/// Without noise in motion, a variable that fades is known in the end, one that grows is not: it is followed.
#[test]
fn certain_motion() {
    let number = |x| DMatrix::from_element(1, 1, x);
    let of = |a| steady_state(&number(a), &number(0.0), &number(1.0), &number(1.0));
    assert_eq!(of(0.9).unwrap()[0], 0.0);
    assert!(matches!(of(1.0), Err(Error::NoSteadyState { .. })));
}

/// Levels are cut at the limit, and the graph says so.
#[test]
fn a_graph_that_is_cut_says_so() {
    let mut model = scalar(0.0, 1.0, 1.0).model();
    model.belief.level_tolerance = 1e-12;
    model.belief.level_limit = 7;
    let graph = graph(&model);
    assert_eq!(graph.len(), 7);
    assert!(!graph.converged());
    assert_eq!(graph.steady(0, 0), None);
    assert!((0..7).all(|level| graph.step(level, 0).next < 7));
}

/// Moving, listening and standing still in two dimensions.
fn three_classes(tolerance: f64) -> Model {
    let square = |x: f64, y: f64| Some(DMatrix::from_diagonal(&DVector::from_vec(vec![x, y])));
    let mut model = System {
        a: DMatrix::identity(2, 2),
        q: DMatrix::identity(2, 2) * 0.25,
        h: DMatrix::identity(2, 2),
        r: DMatrix::identity(2, 2) * 0.45,
        mean: DVector::zeros(2),
        covariance: DMatrix::identity(2, 2) * 0.3,
    }
    .model();
    model.belief.level_tolerance = tolerance;
    model.belief.level_limit = 2000;
    let mut listen = action("LISTEN", DVector::zeros(2));
    listen.motion_noise = square(0.05, 0.02);
    listen.sensor_noise = square(0.1, 0.2);
    let mut slide = action("SLIDE", DVector::from_vec(vec![1.0, 0.0]));
    slide.motion_noise = square(0.5, 0.0);
    let move_on = action("MOVE", DVector::from_vec(vec![0.0, 1.0]));
    model.actions = vec![move_on, listen, slide];
    model
}

#[test]
fn a_graph_of_several_noise_classes_is_closed() {
    const TOLERANCE: f64 = 0.01;
    let model = three_classes(TOLERANCE);
    let graph = graph(&model);
    assert_eq!(graph.classes().len(), 3);
    assert!(graph.converged());
    assert!(graph.len() < 500, "{} levels", graph.len());
    for level in 0..graph.len() {
        for class in 0..3 {
            let step = graph.step(level, class);
            assert!(step.next < graph.len());
            let off = apart(graph.covariance(step.next), &step.correction.covariance);
            // The next level is within the tolerance, or the steady level of a class that no longer moves by more.
            let steady = graph.steady(level, class) == Some(step.next);
            assert!(
                off <= TOLERANCE || steady && off <= 2.0 * TOLERANCE,
                "{off}"
            );
        }
    }
}

/// Wherever actions lead, the level stays near the covariance that the filter really has: the filter forgets errors, so that
/// tolerances do not add up.
#[test]
fn levels_stay_near_the_true_covariance() {
    const TOLERANCE: f64 = 0.01;
    let model = three_classes(TOLERANCE);
    let graph = graph(&model);
    let mut level = graph.starts()[0];
    let mut exact = graph.covariance(level).clone();
    let mut worst = 0.0_f64;
    for time in 0..10_000_usize {
        let action = (time * time / 7 + time / 3) % 3;
        let class = graph.class_of(action);
        exact = Correction::new(
            &model.motion.a,
            model.motion_noise(action, 0),
            &model.sensor.h,
            model.sensor_noise(action, 0),
            &exact,
        )
        .covariance;
        level = graph.step(level, class).next;
        worst = worst.max(apart(graph.covariance(level), &exact));
    }
    // Slowest to forget is the sliding's second variable, by (R / (P + R))^2, at worst about 0.5 a step.
    assert!(worst <= 3.0 * TOLERANCE, "{worst}");
    assert!(worst > 0.0);
}

#[test]
fn starts_with_the_same_covariance_share_a_level() {
    let model = scalar(0.25, 0.45, 0.3).model();
    let number = |x| DMatrix::from_element(1, 1, x);
    let graph = LevelGraph::new(&model, &[number(0.3), number(0.7), number(0.3)]);
    assert_eq!(graph.starts(), [0, 1, 0]);
}

/// Smallest singular value of `[H; H A; ...]`.
fn observability(system: &System) -> f64 {
    let n = system.a.nrows();
    let m = system.h.nrows();
    let mut rows = DMatrix::zeros(n * m, n);
    let mut block = system.h.clone();
    for k in 0..n {
        rows.rows_mut(k * m, m).copy_from(&block);
        block *= &system.a;
    }
    rows.singular_values().min()
}

fn radius(a: &DMatrix<f64>) -> f64 {
    let eigenvalues = a.complex_eigenvalues();
    eigenvalues
        .iter()
        .map(|value| value.norm())
        .fold(0.0, f64::max)
}

/// Systems with process noise in every direction, of any spectral radius up to 1.3; undetectable ones are left out.
fn detectable() -> impl Strategy<Value = System> {
    let numbers = proptest::collection::vec(-1.0..1.0_f64, 128);
    (1..=4_usize, 1..=4_usize, 0.1..1.3_f64, numbers)
        .prop_map(|(n, m, wanted, numbers)| {
            let mut system = Numbers::new(&numbers).system(n, m, n);
            let now = radius(&system.a).max(1e-3);
            system.a *= wanted / now;
            system.q += DMatrix::identity(n, n) * 0.01;
            system
        })
        .prop_filter("detectable, and not by a hair", |system| {
            radius(&system.a) < 0.99 || observability(system) > 0.05
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn riccati_and_recursion_agree(system in detectable()) {
        let System { a, q, h, r, covariance, .. } = &system;
        let steady = steady_state(a, q, h, r).unwrap();
        let predicted = predicted_steady_state(a, q, h, r).unwrap();
        let mut p = covariance.clone();
        let mut before = p.clone();
        for _ in 0..20_000 {
            let correction = Correction::new(a, q, h, r, &p);
            before = correction.predicted;
            let change = apart(&correction.covariance, &p);
            p = correction.covariance;
            if change <= 1e-14 * p.amax() {
                break;
            }
        }
        prop_assert!(apart(&steady, &p) <= 1e-9 * p.amax().max(1.0));
        prop_assert!(apart(&predicted, &before) <= 1e-9 * before.amax().max(1.0));
    }
}

/// Numbers whose products are none, or are too far apart, make no levels; the message says which number it was.
#[test]
fn what_cannot_be_multiplied_is_refused_with_level_and_entry() {
    for (name, good, bad, says) in [
        (
            "corridor-blind",
            "H = [[1.0]]",
            "H = [[-1e308]]",
            "level 0 is that of no belief: entry [0][0] of the innovation covariance of the step by EAST is inf",
        ),
        (
            "corridor-blind",
            "A = [[1.0]]",
            "A = [[1e200]]",
            "predicted covariance",
        ),
        (
            "corridor-blind",
            "noise = [[0.45]]",
            "noise = [[1.7e308]]",
            "innovation covariance",
        ),
        (
            "cart-pole",
            "step = 0.02",
            "step = 9.0",
            "level 1 is that of no belief: the smallest eigenvalue of the covariance is -",
        ),
    ] {
        let text = pilotage::scenario::builtin(name).unwrap();
        assert!(text.contains(good), "{name}: {good}");
        let model = pilotage::scenario::read(&text.replacen(good, bad, 1), name)
            .unwrap()
            .model;
        let error = BeliefMdp::new(&model).check().unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains(says) && message.contains("units"),
            "{name}: {message}"
        );
    }
    for name in pilotage::scenario::names() {
        let model = built_in(name);
        BeliefMdp::new(&model).check().unwrap();
    }
}

/// A hundred thousand levels are found in a moment.
#[test]
fn many_levels_are_found_fast() {
    let text = pilotage::scenario::builtin("tiger").unwrap();
    let many = "level_tolerance = 0.0\nlevel_limit = 100000";
    let text = text.replacen("level_tolerance = 1e-4", many, 1);
    let model = pilotage::scenario::read(&text, "many").unwrap().model;
    let clock = std::time::Instant::now();
    let mdp = BeliefMdp::new(&model);
    assert_eq!(mdp.strata(), 100_000);
    mdp.check().unwrap();
    assert!(clock.elapsed().as_secs_f64() < 5.0, "{:?}", clock.elapsed());
}
