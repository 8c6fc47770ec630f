//! What merging keeps.

use super::*;

proptest! {
    /// Merging the last of some Gaussians changes neither the others nor the moments.
    #[test]
    fn merging_some_keeps_the_moments_of_all(
        means in proptest::collection::vec((-5.0..5.0, -5.0..5.0, 0.1..2.0), 6..20),
        first in 0_usize..4,
        most in 1_usize..4,
    ) {
        let likeness = Likeness::new(vec![1e-6; 2], &[VariableKind::Real; 2]);
        let component = |&(x, y, variance): &(f64, f64, f64)| Component {
            weight: variance / 40.0,
            mode: 0,
            mean: vec![x, y],
            covariance: vec![variance, 0.3 * variance, 0.3 * variance, 1.0],
        };
        let before: Vec<Component> = means.iter().map(component).collect();
        let whole = |components: &[Component]| {
            let mut all = components.to_vec();
            likeness.join(&mut all);
            all.remove(0)
        };
        let mut after = before.clone();
        likeness.reduce_from(&mut after, first, most);
        prop_assert!(after.len() <= first + most);
        prop_assert_eq!(&after[..first], &before[..first]);
        let (found, exact) = (whole(&after), whole(&before));
        prop_assert!((found.weight - exact.weight).abs() < 1e-12);
        assert_near(&found.mean, &exact.mean, 1e-9);
        assert_near(&found.covariance, &exact.covariance, 1e-9);
    }
}

/// Two angles on either side of the cut are near each other.
#[test]
fn angles_are_averaged_the_short_way() {
    let likeness = Likeness::new(vec![1e-6], &[VariableKind::Angle]);
    let at = |mean: f64| Component {
        weight: 0.5,
        mode: 0,
        mean: vec![mean],
        covariance: vec![0.01],
    };
    let mut one = at(3.1);
    likeness.merge(&mut one, &at(-3.1));
    assert!(
        (one.mean[0].abs() - std::f64::consts::PI).abs() < 1e-9,
        "{one:?}"
    );
    assert!(one.covariance[0] < 0.012, "{one:?}");
}

proptest! {
    /// Merging and reducing leave mean, covariance and weights of modes as they are.
    #[test]
    fn merging_keeps_moments(
        parts in prop::collection::vec((0.05..1.0_f64, 0..2_usize, prop::array::uniform6(-3.0..3.0_f64)), 2..12),
        most in 1..6_usize,
    ) {
        let total: f64 = parts.iter().map(|part| part.0).sum();
        let mut components: Vec<Component> = parts.iter().map(|(weight, mode, x)| Component {
            weight: weight / total,
            mode: *mode,
            mean: vec![x[0], x[1]],
            // Some of them singular.
            covariance: vec![x[2] * x[2], x[2] * x[3], x[2] * x[3], x[3] * x[3] + x[4].max(0.0)],
        }).collect();
        let of = |components: &[Component]| -> Vec<f64> {
            let total = |of: &dyn Fn(&Component) -> f64| components.iter().map(|c| c.weight * of(c)).sum::<f64>();
            let mean = [total(&|c| c.mean[0]), total(&|c| c.mean[1])];
            let entry = |k: usize| {
                let (i, j) = (k / 2, k % 2);
                total(&|c| c.covariance[k] + (c.mean[i] - mean[i]) * (c.mean[j] - mean[j]))
            };
            let modes = total(&|c| c.mode as f64);
            [mean[0], mean[1], modes].into_iter().chain((0..4).map(entry)).collect()
        };
        let likeness = Likeness::new(vec![1e-6; 2], &[VariableKind::Real; 2]);
        let before = of(&components);
        if components[0].mode == components[1].mode {
            let mut two = components[..2].to_vec();
            let one = two.remove(1);
            let both = of(&[two[0].clone(), one.clone()]);
            likeness.merge(&mut two[0], &one);
            let share = of(&two);
            prop_assert!((share[0] - both[0]).abs() < 1e-12);
        }
        likeness.reduce(&mut components, most);
        let after = of(&components);
        for (a, b) in before.iter().zip(&after) {
            prop_assert!((a - b).abs() < 1e-9, "{before:?} {after:?}");
        }
    }
}
