//! The Kalman filter against an independent library, and the laws it has to obey.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Numbers, System, action, apart, built_in, least_eigenvalue};
use nalgebra::{DMatrix, DVector};
use pilotage::belief::{Belief, BeliefMdp, Correction, Filter, KalmanFilter};
use pilotage::solve::kbvi::formulas::{Formulas, Outlook};
use proptest::prelude::*;
use serde::Deserialize;

/// What filterpy computed: see scripts/filter_fixture.py.
#[derive(Deserialize)]
struct Fixture {
    systems: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    radius: f64,
    a: Vec<Vec<f64>>,
    b: Vec<Vec<f64>>,
    q: Vec<Vec<f64>>,
    h: Vec<Vec<f64>>,
    r: Vec<Vec<f64>>,
    mean: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    steps: Vec<Expected>,
}

#[derive(Deserialize)]
struct Expected {
    control: Vec<f64>,
    observation: Vec<f64>,
    mean: Vec<f64>,
    covariance: Vec<Vec<f64>>,
}

fn fixture() -> Vec<Case> {
    let text = include_str!("fixtures/filter.json");
    serde_json::from_str::<Fixture>(text).unwrap().systems
}

fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

fn vector(values: &[f64]) -> DVector<f64> {
    DVector::from_column_slice(values)
}

impl Case {
    fn system(&self) -> System {
        System {
            a: matrix(&self.a),
            q: matrix(&self.q),
            h: matrix(&self.h),
            r: matrix(&self.r),
            mean: vector(&self.mean),
            covariance: matrix(&self.covariance),
        }
    }

    fn kalman(&self) -> KalmanFilter {
        let System {
            a,
            q,
            h,
            r,
            mean,
            covariance,
        } = self.system();
        let b = matrix(&self.b);
        KalmanFilter {
            a,
            b,
            q,
            h,
            r,
            mean,
            covariance,
        }
    }
}

/// The two agree to this much of the largest entry.
const AGREEMENT: f64 = 1e-12;

#[test]
fn the_fixture_holds_stable_and_unstable_systems_of_many_sizes() {
    let systems = fixture();
    assert!(systems.iter().filter(|case| case.radius < 1.0).count() >= 4);
    assert!(systems.iter().filter(|case| case.radius > 1.0).count() >= 4);
    let mut sizes: Vec<(usize, usize)> = systems
        .iter()
        .map(|case| (case.a.len(), case.h.len()))
        .collect();
    sizes.sort();
    sizes.dedup();
    assert!(sizes.len() >= 8);
}

#[test]
fn agrees_with_filterpy() {
    for case in fixture() {
        let mut kalman = case.kalman();
        for (time, expected) in case.steps.iter().enumerate() {
            kalman.step(&vector(&expected.control), &vector(&expected.observation));
            let (mean, covariance) = (vector(&expected.mean), matrix(&expected.covariance));
            let error = (&kalman.mean - &mean).amax() / mean.amax();
            assert!(error <= AGREEMENT, "mean is {error:e} off at step {time}");
            let error = apart(&kalman.covariance, &covariance) / covariance.amax();
            assert!(error <= AGREEMENT, "P is {error:e} off at step {time}");
        }
    }
}

/// The filter on the level graph is the Kalman filter, where every covariance is a level of its own.
#[test]
fn the_level_graph_gives_the_same_means() {
    for case in fixture() {
        let mut model = case.system().model();
        model.motion.b = matrix(&case.b);
        model.belief.level_limit = case.steps.len() + 1;
        // One action for every step, with the control of that step.
        model.actions = case
            .steps
            .iter()
            .enumerate()
            .map(|(time, step)| action(&time.to_string(), vector(&step.control)))
            .collect();
        let mdp = BeliefMdp::new(&model);
        let filter = mdp.filter();
        let mut kalman = case.kalman();
        let mut belief = filter.initial();
        let mut scratch = vec![0.0; filter.states()];
        for (time, step) in case.steps.iter().enumerate() {
            kalman.step(&vector(&step.control), &vector(&step.observation));
            filter.update(&mut belief, time, &step.observation, &mut scratch);
            let error = (vector(&belief.mean) - &kalman.mean).amax() / kalman.mean.amax();
            assert!(error <= AGREEMENT, "mean is {error:e} off at step {time}");
            let level = mdp.covariance(belief.stratum);
            let error = apart(level, &kalman.covariance) / kalman.covariance.amax();
            assert!(error <= AGREEMENT, "P is {error:e} off at step {time}");
        }
    }
}

/// With levels joined at the tolerance, the mean is off by what a gain of that much error makes of the innovations.
#[test]
fn joined_levels_cost_no_more_than_their_tolerance() {
    let model = built_in("corridor-unbounded");
    let mdp = BeliefMdp::new(&model);
    let filter = mdp.filter();
    let start = &model.start[0];
    let mut kalman = KalmanFilter {
        a: model.motion.a.clone(),
        b: model.motion.b.clone(),
        q: model.motion.noise.clone(),
        h: model.sensor.h.clone(),
        r: model.sensor.noise.clone(),
        mean: start.mean.clone(),
        covariance: start.covariance.clone(),
    };
    let mut belief = filter.initial();
    let mut scratch = [0.0];
    for time in 0..200 {
        let observation = [3.0 * f64::from(time).sin()];
        kalman.step(&model.actions[0].control, &vector(&observation));
        filter.update(&mut belief, 0, &observation, &mut scratch);
        // An error of 5e-7 in P is one of about 1e-6 in K; innovations here grow with the distance walked, one a step.
        let scale = 1.0 + f64::from(time);
        assert!((belief.mean[0] - kalman.mean[0]).abs() < 5e-6 * scale);
        assert!((mdp.covariance(belief.stratum)[0] - kalman.covariance[0]).abs() < 1e-6);
    }
}

#[test]
fn a_reset_filter_believes_the_start() {
    let mdp = BeliefMdp::new(&built_in("maze-2d"));
    let filter = mdp.filter();
    let mut belief = filter.initial();
    assert_eq!(&belief, mdp.start());
    filter.update(&mut belief, 1, &[1.5, 2.5], &mut [0.0; 2]);
    assert_ne!(&belief, mdp.start());
    filter.reset(&mut belief);
    assert_eq!(&belief, mdp.start());
}

/// Neither the cart nor its sensor is noisy: nothing is learned from an observation, and there is nothing to learn.
#[test]
fn without_noise_there_is_no_gain() {
    let zero = DMatrix::zeros(1, 1);
    let one = DMatrix::identity(1, 1);
    let correction = Correction::new(&one, &zero, &one, &zero, &zero);
    assert_eq!(correction.gain, zero);
    assert_eq!(correction.covariance, zero);

    let mdp = BeliefMdp::new(&built_in("load-unload"));
    assert_eq!(mdp.strata(), 1);
    let filter = mdp.filter();
    let mut belief = filter.initial();
    filter.update(&mut belief, 0, &[1e9], &mut [0.0]);
    assert_eq!(belief.mean, [1.0]);
}

/// One variable is known and sensed without noise, the other is not: only the second gets a gain.
#[test]
fn a_known_variable_gets_no_gain() {
    let identity = DMatrix::identity(2, 2);
    let second = DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 1.0]));
    let correction = Correction::new(
        &identity,
        &(&second * 0.25),
        &identity,
        &(&second * 0.45),
        &(&second * 0.3),
    );
    assert!(apart(&correction.gain, &(&second * 0.55)) < 1e-15);
    assert!(apart(&correction.covariance, &(&second * (0.55 * 0.45))) < 1e-15);
}

/// Mode changes happen on the mean before the action, not after it.
#[test]
fn the_filter_changes_the_mode_where_the_agent_acts() {
    let model = built_in("load-unload");
    let mdp = BeliefMdp::new(&model);
    let filter = Filter::new(&model, mdp.levels(), mdp.start());
    let load = model.action_named("LOAD").unwrap();
    let east = model.action_named("EAST").unwrap();
    let after = |mean: f64, actions: &[usize]| {
        let mut belief = Belief {
            mean: vec![mean],
            ..filter.initial()
        };
        for &action in actions {
            filter.update(&mut belief, action, &[0.0], &mut [0.0]);
        }
        belief.mode
    };
    assert_eq!(after(0.5, &[load]), 1);
    assert_eq!(after(0.5, &[east, load]), 0);
    assert_eq!(after(1.0, &[load]), 0);
}

fn any_system() -> impl Strategy<Value = System> {
    let numbers = proptest::collection::vec(-1.0..1.0_f64, 128);
    (1..=4_usize, 1..=4_usize, 0..=4_usize, numbers)
        .prop_map(|(n, m, rank, numbers)| Numbers::new(&numbers).system(n, m, rank.min(n)))
}

impl System {
    fn correction(&self, p: &DMatrix<f64>) -> Correction {
        Correction::new(&self.a, &self.q, &self.h, &self.r, p)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn covariances_stay_covariances(system in any_system()) {
        let mut p = system.covariance.clone();
        for _ in 0..20 {
            let correction = system.correction(&p);
            p = correction.covariance;
            prop_assert_eq!(&p, &p.transpose());
            prop_assert!(least_eigenvalue(&p) >= -1e-13 * correction.predicted.amax());
        }
    }

    #[test]
    fn an_observation_never_makes_less_certain(system in any_system()) {
        let correction = system.correction(&system.covariance);
        let gained = &correction.predicted - &correction.covariance;
        prop_assert!(least_eigenvalue(&gained) >= -1e-13 * correction.predicted.amax());
        // What is gained is what the mean will move by: K S K' = P- - P (Eq. 5.6, corrected).
        prop_assert!(apart(&gained, &correction.mean_covariance()) <= 1e-12 * correction.predicted.amax());
    }

    #[test]
    fn josephs_form_is_the_short_form(system in any_system()) {
        let correction = system.correction(&system.covariance);
        let n = system.a.nrows();
        let keep = DMatrix::identity(n, n) - &correction.gain * &system.h;
        let short = keep * &correction.predicted;
        prop_assert!(apart(&short, &correction.covariance) <= 1e-12 * correction.predicted.amax());
    }

    /// The law of total variance: what the agent is unsure of now, and how far its mean may yet move, make together the
    /// uncertainty of one who never looks. `Sigma' = A Sigma A' + Q`.
    #[test]
    fn spread_of_the_mean_and_covariance_make_the_open_loop_covariance(system in any_system()) {
        const STEPS: usize = 12;
        let mut model = system.model();
        model.belief.level_limit = STEPS + 1;
        let mdp = BeliefMdp::new(&model);
        let formulas = Formulas::default();
        let mut outlook = Outlook::certain(&mdp, mdp.start().stratum);
        let mut open_loop = system.covariance.clone();
        let mut spread = DMatrix::zeros(system.a.nrows(), system.a.nrows());
        for _ in 0..STEPS {
            let correction = system.correction(mdp.covariance(outlook.level));
            spread = &system.a * spread * system.a.transpose()
                + &correction.gain * &correction.innovation * correction.gain.transpose();
            open_loop = &system.a * open_loop * system.a.transpose() + &system.q;
            outlook = formulas.next_outlook(&mdp, &outlook, 0, false);
            let scale = open_loop.amax();
            prop_assert!(apart(&outlook.covariance, &spread) <= 1e-12 * scale);
            prop_assert!(apart(&outlook.total, &open_loop) <= 1e-12 * scale);
            prop_assert!(apart(&(spread.clone() + &correction.covariance), &open_loop) <= 1e-12 * scale);
        }
    }
}
