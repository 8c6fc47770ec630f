//! CMA-ES on functions with known minima.

use pilotage::solve::policy_search::cma::Evolution;

fn minimise(f: impl Fn(&[f64]) -> f64, start: &[f64], generations: usize) -> Vec<f64> {
    let mut evolution = Evolution::new(start, 0.5, 10, 1);
    for _ in 0..generations {
        let values: Vec<f64> = evolution.ask().iter().map(|x| f(x)).collect();
        evolution.tell(&values);
    }
    evolution.mean().to_vec()
}

#[test]
fn a_stretched_bowl_is_followed_to_its_bottom() {
    let bowl = |x: &[f64]| (x[0] - 1.0).powi(2) + 1e4 * (x[1] + x[0] + 2.0).powi(2) + x[2].powi(2);
    let found = minimise(bowl, &[0.0; 3], 150);
    for (value, expected) in found.iter().zip([1.0, -3.0, 0.0]) {
        assert!((value - expected).abs() < 1e-6, "{found:?}");
    }
}

#[test]
fn a_curved_valley_is_followed_to_its_bottom() {
    let rosenbrock = |x: &[f64]| 100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2);
    let found = minimise(rosenbrock, &[-1.0, 1.0], 250);
    assert!(
        (found[0] - 1.0).abs() < 1e-5 && (found[1] - 1.0).abs() < 1e-5,
        "{found:?}"
    );
}

#[test]
fn the_order_of_values_is_all_that_counts() {
    let bowl = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>();
    let plain = minimise(bowl, &[1.0, 2.0], 30);
    let bent = minimise(|x| bowl(x).powi(3).ln_1p(), &[1.0, 2.0], 30);
    assert_eq!(plain, bent);
}
