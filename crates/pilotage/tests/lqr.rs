//! The linear-quadratic regulator against closed forms and against the optimality it promises.

use nalgebra::{DMatrix, dmatrix};
use pilotage::Error;
use pilotage::scenario::find;
use pilotage::solve::lqr::lqr_gain;

/// In one dimension with `a = b = 1` the cost solves `p^2 = q p + q r`.
#[test]
fn scalar_gain_is_the_closed_form() {
    let one = dmatrix![1.0];
    for (q, r) in [(1.0, 1.0), (0.3, 2.0), (5.0, 0.01)] {
        let p = 0.5 * (q + f64::sqrt(q * q + 4.0 * q * r));
        let gain = lqr_gain(&one, &one, &dmatrix![q], &dmatrix![r]).unwrap()[(0, 0)];
        assert!(
            (gain - p / (r + p)).abs() < 1e-12,
            "q = {q}, r = {r}: {gain}"
        );
    }
}

fn cart_pole() -> (DMatrix<f64>, DMatrix<f64>) {
    let model = find("cart-pole").expect("a built-in model").model;
    (model.motion.a, model.motion.b)
}

fn cost_of(
    (a, b): &(DMatrix<f64>, DMatrix<f64>),
    gain: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> f64 {
    let closed = a - b * gain;
    let step = q + gain.transpose() * r * gain;
    let (mut cost, mut power) = (DMatrix::zeros(4, 4), DMatrix::identity(4, 4));
    for _ in 0..20_000 {
        cost += power.transpose() * &step * &power;
        power = &closed * power;
    }
    cost.trace()
}

#[test]
fn cart_pole_is_stable_and_no_other_gain_costs_less() {
    let plant = cart_pole();
    let q = DMatrix::from_diagonal(&nalgebra::dvector![0.17, 0.0, 22.8, 0.0]);
    let r = dmatrix![1e-4];
    let gain = lqr_gain(&plant.0, &plant.1, &q, &r).unwrap();
    let closed = &plant.0 - &plant.1 * &gain;
    let radius = closed
        .complex_eigenvalues()
        .iter()
        .map(|value| value.norm())
        .fold(0.0, f64::max);
    assert!(radius < 1.0, "spectral radius {radius}");
    let least = cost_of(&plant, &gain, &q, &r);
    for i in 0..4 {
        for factor in [0.98, 1.02] {
            let mut other = gain.clone();
            other[(0, i)] *= factor;
            let cost = cost_of(&plant, &other, &q, &r);
            assert!(cost > least, "gain {i} times {factor}: {cost} <= {least}");
        }
    }
}

#[test]
fn what_cannot_be_regulated_is_refused() {
    let one = dmatrix![1.0];
    let unreachable = lqr_gain(&dmatrix![1.1], &dmatrix![0.0], &one, &one);
    assert!(matches!(
        unreachable,
        Err(Error::NoSteadyState {
            what: "regulator",
            ..
        })
    ));
    let free = lqr_gain(&one, &one, &one, &dmatrix![0.0]);
    assert!(matches!(
        free,
        Err(Error::NotPositiveDefinite {
            what: "the control weight",
            ..
        })
    ));
}
