//! What actions move, pay and change.

use super::*;

#[test]
fn a_guess_pays_what_it_is_expected_to() {
    let keeping = light_dark(20);
    let mut sum = keeping.start();
    let acted = keeping.act(&mut sum, GUESS, 0);
    let inside = interval_probability(2.0, 9.0, Interval::new(-1.0, 1.0));
    assert!(
        (acted.reward - (20.0 * inside - 10.0)).abs() < 1e-6,
        "{acted:?}"
    );
    assert!((acted.ended - 1.0).abs() < 1e-7, "{acted:?}");
}

/// A plane with two modes: what happens in a region, by chance, changes the mode.
#[test]
fn an_event_takes_its_part_of_what_is_believed() {
    let p = [1.0, 0.6, 0.6, 2.0];
    let model = ModelBuilder::new("event", 0.9)
        .variable("x", -50.0, 50.0)
        .variable("y", -50.0, 50.0)
        .mode("before")
        .mode("afterwards")
        .start(&[0.3, 1.0], &p)
        .motion(&[1.0, 0.0, 0.0, 1.0], &[0.0, 0.0], &[0.0; 4])
        .sensor(&[1.0, 0.0], &[1.0])
        .action("WAIT", &[0.0])
        .event(
            5.0,
            Some("afterwards"),
            Then::Continue,
            Clause::new().within("x", 0.0, 1.5).with_probability(0.6),
        )
        .belief(sums(None))
        .build()
        .unwrap();
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    let acted = keeping.act(&mut sum, 0, 0);
    let inside = 0.6 * interval_probability(0.3, 1.0, Interval::new(0.0, 1.5));
    let found = moments(&keeping, &sum);
    assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!(
        (found.weights[1] - inside).abs() < 1e-6,
        "{found:?} {inside}"
    );
    assert!((acted.reward - 5.0 * inside).abs() < 1e-5);
    // What has happened to the mode moves nothing.
    let all: Vec<f64> = [0.3, 1.0].into_iter().chain(p).collect();
    let own: Vec<f64> = found
        .mean
        .iter()
        .chain(&found.covariance)
        .copied()
        .collect();
    for (own, exact) in own.iter().zip(&all) {
        assert!((own - exact).abs() < 1e-6, "{own} {exact}");
    }
    // Of what it has happened to, many draws.
    let mut rng = stream(7, 0, Role::World);
    let drawn = (0..400_000).filter_map(|_| {
        let (a, b) = (normal(&mut rng), normal(&mut rng));
        let x = 0.3 + a;
        let y = 1.0 + 0.6 * a + (2.0 - 0.36_f64).sqrt() * b;
        ((0.0..1.5).contains(&x) && uniform(&mut rng) < 0.6).then_some([x, y])
    });
    let (mean, covariance) = drawn_moments(drawn);
    let happened = only(&sum, 1);
    let found = moments(&keeping, &happened);
    assert_near(&found.mean, &mean, 0.02);
    assert_near(&found.covariance, &covariance, 0.02);
}

/// A line without a sensor to speak of, on which one action is taken once.
fn one_step(builder: ModelBuilder, covariance: f64) -> (SumKeeping, Sum, crate::belief::Acted) {
    let model = builder
        .variable("y", f64::NEG_INFINITY, f64::INFINITY)
        .start(&[2.0], &[covariance])
        .sensor(&[1.0], &[1.0])
        .action("GO", &[1.0])
        .belief(sums(Some(40)));
    let keeping = SumKeeping::new(&model.build().unwrap());
    let mut sum = keeping.start();
    let acted = keeping.act(&mut sum, 0, 0);
    (keeping, sum, acted)
}

#[test]
fn formulas_are_paid_where_they_hold() {
    let builder = ModelBuilder::new("paid", 0.9)
        .motion(&[1.0], &[1.0], &[0.1])
        .reward_of(
            Formula::coded("square", |point| point.state[0].powi(2)),
            Clause::new().within("y", 0.5, 3.0),
        );
    let (.., acted) = one_step(builder, 9.0);
    let (_, _, all) = on_a_grid(0.5, 3.0 - 1e-9, |y| log_normal(y - 2.0, 9.0) + 2.0 * y.ln());
    assert!(
        (acted.reward / all.exp() - 1.0).abs() < 1e-3,
        "{acted:?} {}",
        all.exp()
    );
}

#[test]
fn a_motion_that_bends_splits_what_is_moved() {
    let step = |y: f64| y + 2.0 * y.sin();
    let noise = |y: f64| 0.01 + 0.1 * y.abs();
    let law = MotionLaw {
        step: vec![Some(Formula::coded("bent", move |point| {
            step(point.state[0])
        }))],
        noise: Some(DMatrix::from_element(
            1,
            1,
            Formula::coded("gusts", move |point| noise(point.state[0])),
        )),
        ..MotionLaw::default()
    };
    let builder = ModelBuilder::new("bent", 0.9)
        .motion(&[1.0], &[1.0], &[0.1])
        .reward(1.0, Clause::new())
        .case(Case {
            motion: law,
            ..Case::default()
        });
    let (keeping, sum, _) = one_step(builder, 4.0);
    assert!(sum.components().len() > 1);
    let mut rng = stream(9, 0, Role::World);
    let drawn = (0..400_000).map(|_| {
        let y = 2.0 + 2.0 * normal(&mut rng);
        [step(y) + noise(y).sqrt() * normal(&mut rng)]
    });
    let (mean, covariance) = drawn_moments(drawn);
    let found = moments(&keeping, &sum);
    assert_near(&found.mean, &mean, 0.05);
    assert_near(&found.covariance, &covariance, 0.02 * covariance[0]);
}

#[test]
fn modes_that_are_seen_are_known() {
    let builder = light_dark_from_nowhere(20)
        .mode("calm")
        .mode("windy")
        .start_of(0.7, Some("calm"), &[2.0], &[9.0])
        .start_of(0.3, Some("windy"), &[2.0], &[9.0]);
    let mut model = builder.build().unwrap();
    model.laws.modes_seen = true;
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    keeping.act(&mut sum, RIGHT, 0);
    let readings = keeping.readings(&sum, RIGHT, 0, 50);
    let windy = readings.iter().filter(|(_, sensed)| match sensed {
        Sensed::Values(values) => values.len() == 2 && values[1] == 1.0,
        _ => false,
    });
    let windy: f64 = windy.map(|(likely, _)| likely).sum();
    assert!((windy - 0.3).abs() < 0.03, "{windy}");
    keeping.sense(&mut sum, RIGHT, 0, Reading::Values(&[3.0, 1.0]));
    assert_eq!(moments(&keeping, &sum).weights, [0.0, 1.0]);
}

#[test]
fn a_box_that_is_not_aligned_has_its_probability() {
    let component = Component {
        weight: 0.5,
        mode: 0,
        mean: vec![0.3, -0.2],
        covariance: vec![1.0, 0.8, 0.8, 1.0],
    };
    let region = Region::new(vec![
        (0, Interval::new(0.0, 1.0)),
        (1, Interval::new(0.0, 1.0)),
    ]);
    let covariance = DMatrix::from_row_slice(2, 2, &component.covariance);
    let exact = 0.5 * region_probability(&component.mean, &covariance, &region);
    let (inside, outside) = component.cut(&region);
    let inside = inside.map_or(0.0, |inside| inside.weight);
    let outside: f64 = outside.iter().map(|part| part.weight).sum();
    assert!((inside - exact).abs() < 1e-12, "{inside} {exact}");
    assert!((inside + outside - 0.5).abs() < 1e-12);
}
