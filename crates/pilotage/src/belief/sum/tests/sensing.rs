//! What readings say, and what they are believed to be.

use super::*;

#[test]
fn noise_that_depends_on_the_place_is_taken_as_it_is() {
    let cases: [&[f64]; 8] = [
        &[3.0],
        &[5.0],
        &[-4.0],
        &[5.02],
        &[11.0],
        &[4.0, 6.0, 5.5],
        &[0.0, 1.0, 2.0],
        &[5.2, 6.1, 7.0],
    ];
    for (components, tolerance) in [(20, 0.03), (40, 0.02)] {
        let keeping = light_dark(components);
        for readings in cases {
            let mut sum = keeping.start();
            for (step, reading) in readings.iter().enumerate() {
                keeping.act(&mut sum, RIGHT, step);
                keeping.sense(&mut sum, RIGHT, step, Reading::Values(&[*reading]));
            }
            let moves: Vec<(f64, f64)> = readings.iter().map(|reading| (1.0, *reading)).collect();
            let (mean, sd, _) = light_dark_exactly(&moves);
            let found = moments(&keeping, &sum);
            let (own, own_sd) = (
                found.mean[0] - readings.len() as f64,
                found.covariance[0].sqrt(),
            );
            assert!((own - mean).abs() < tolerance * sd.max(0.2), "{readings:?}");
            assert!((own_sd / sd - 1.0).abs() < 2.0 * tolerance, "{readings:?}");
        }
    }
}

/// Two modes that drift apart: who has heard where the state is knows how likely each is.
#[test]
fn modes_are_weighed_by_what_they_foretold() {
    let drifting = |mode, drift: f64| Case {
        modes: Some(vec![mode]),
        motion: MotionLaw {
            drift: Some(DVector::from_element(1, drift)),
            ..MotionLaw::default()
        },
        ..Case::default()
    };
    let model = light_dark_from_nowhere(60)
        .mode("calm")
        .mode("windy")
        .start_of(0.7, Some("calm"), &[2.0], &[9.0])
        .start_of(0.3, Some("windy"), &[2.0], &[9.0])
        .case(drifting(0, 0.0))
        .case(drifting(1, -0.8));
    let keeping = SumKeeping::new(&model.build().unwrap());
    let mut sum = keeping.start();
    let readings = [4.0, 4.9, 5.3];
    for (step, reading) in readings.iter().enumerate() {
        keeping.act(&mut sum, RIGHT, step);
        keeping.sense(&mut sum, RIGHT, step, Reading::Values(&[*reading]));
    }
    let moves = |by: f64| readings.map(|reading| (by, reading));
    let calm = light_dark_exactly(&moves(1.0)).2 + 0.7_f64.ln();
    let windy = light_dark_exactly(&moves(0.2)).2 + 0.3_f64.ln();
    let exact = 1.0 / (1.0 + (windy - calm).exp());
    let found = moments(&keeping, &sum).weights[0];
    assert!((found - exact).abs() < 0.01, "{found} {exact}");
}

#[test]
fn readings_that_may_come_agree_with_what_is_believed() {
    let keeping = light_dark(20);
    let mut sum = keeping.start();
    keeping.act(&mut sum, RIGHT, 0);
    for most in [20, 100, 400] {
        let readings = keeping.readings(&sum, RIGHT, 0, most);
        let total: f64 = readings.iter().map(|(likely, _)| likely).sum();
        assert!((total - 1.0).abs() < 1e-12);
        let (mut mean, mut square) = (0.0, 0.0);
        for (likely, sensed) in &readings {
            let mut after = sum.clone();
            keeping.sense(&mut after, RIGHT, 0, sensed.reading());
            let found = moments(&keeping, &after);
            mean += likely * found.mean[0];
            square += likely * (found.covariance[0] + found.mean[0] * found.mean[0]);
        }
        let tolerance = 2.0 / (most as f64).sqrt();
        assert!((mean - 3.0).abs() < 0.3 * tolerance, "{most}: {mean}");
        assert!((square / 18.0 - 1.0).abs() < tolerance, "{most}: {square}");
    }
}

/// Ranges to two beacons: sd .05 + .25 of the range.
fn beacons(
    read: bool,
    noise: impl Fn(f64) -> f64 + Send + Sync + Copy + 'static,
    p: &[f64],
) -> SumKeeping {
    const PLACES: [[f64; 2]; 2] = [[5.0, 5.0], [5.0, -5.0]];
    let range = |state: &[f64], k: usize| (state[0] - PLACES[k][0]).hypot(state[1] - PLACES[k][1]);
    let variance = move |k: usize| {
        Formula::coded(&format!("noise {k}"), move |point| {
            noise(range(point.state, k)).powi(2)
        })
    };
    let none = || Formula::Number(0.0);
    let ranges = vec![
        Formula::coded("range 0", move |point| range(point.state, 0)),
        Formula::coded("range 1", move |point| range(point.state, 1)),
    ];
    let model = ModelBuilder::new("beacons", 0.95)
        .variable("x", -20.0, 20.0)
        .variable("y", -20.0, 20.0)
        .start(&[2.0, 2.0], p)
        .motion(
            &[1.0, 0.0, 0.0, 1.0],
            &[1.0, 0.0, 0.0, 1.0],
            &[0.01, 0.0, 0.0, 0.01],
        )
        .sensor(&[1.0, 0.0, 0.0, 1.0], &[1.0, 0.0, 0.0, 1.0])
        .case(Case {
            sensor: SensorLaw {
                read: if read { ranges } else { Vec::new() },
                noise: Some(DMatrix::from_row_slice(
                    2,
                    2,
                    &[variance(0), none(), none(), variance(1)],
                )),
                ..SensorLaw::default()
            },
            ..Case::default()
        })
        .action("STAY", &[0.0, 0.0])
        .action("EAST", &[1.0, 0.0])
        .reward(1.0, Clause::new().within("x", -1.0, 1.0))
        .belief(sums(None))
        .build()
        .unwrap();
    SumKeeping::new(&model)
}

/// Mean and covariance of a density in the plane, by a grid.
fn in_the_plane(
    centre: [f64; 2],
    half: f64,
    log_density: impl Fn(&[f64; 2]) -> f64,
) -> (Vec<f64>, Vec<f64>) {
    const SIDE: usize = 1501;
    let at = |k: usize, i: usize| centre[i] + half * (2.0 * k as f64 / (SIDE - 1) as f64 - 1.0);
    let points = (0..SIDE * SIDE).map(|k| [at(k / SIDE, 0), at(k % SIDE, 1)]);
    let weighed: Vec<([f64; 2], f64)> = points.map(|x| (x, log_density(&x))).collect();
    let best = weighed
        .iter()
        .fold(f64::NEG_INFINITY, |best, (_, log)| best.max(*log));
    let total: f64 = weighed.iter().map(|(_, log)| (log - best).exp()).sum();
    let expect = |of: &dyn Fn(&[f64; 2]) -> f64| {
        let weighed = weighed.iter().map(|(x, log)| (log - best).exp() * of(x));
        weighed.sum::<f64>() / total
    };
    let mean: Vec<f64> = (0..2).map(|i| expect(&|x| x[i])).collect();
    let entry = |k: usize| expect(&|x| (x[k / 2] - mean[k / 2]) * (x[k % 2] - mean[k % 2]));
    let covariance = (0..4).map(entry).collect();
    (mean, covariance)
}

/// Posterior in the plane after ranges were read in the same place, some motion noise apart.
fn ranged(
    noise: impl Fn(f64) -> f64,
    p: &[f64],
    reading: [f64; 2],
    around: ([f64; 2], f64),
) -> (Vec<f64>, Vec<f64>) {
    let (a, b, c) = (p[0] + 0.01, p[1], p[3] + 0.01);
    let det = a * c - b * b;
    in_the_plane(around.0, around.1, |x| {
        let (u, v) = (x[0] - 2.0, x[1] - 2.0);
        let prior = -0.5 * (c * u * u - 2.0 * b * u * v + a * v * v) / det;
        let likely = |k: usize| {
            let place = [5.0, -5.0][k];
            let range = (x[0] - 5.0).hypot(x[1] - place);
            log_normal(reading[k] - range, noise(range).powi(2))
        };
        prior + likely(0) + likely(1)
    })
}

#[test]
fn ranges_are_taken_by_their_moments() {
    let wide = [5.0, 0.0, 0.0, 5.0];
    let narrow = [0.4, 0.2, 0.2, 0.6];
    let rough = |range: f64| 0.05 + 0.25 * range;
    let fine = |_: f64| 0.02;
    for p in [&wide, &narrow] {
        for reading in [[4.2, 7.6], [2.0, 6.0], [6.0, 9.0]] {
            let keeping = beacons(true, rough, p);
            let mut sum = keeping.start();
            keeping.act(&mut sum, 0, 0);
            keeping.sense(&mut sum, 0, 0, Reading::Values(&reading));
            let found = moments(&keeping, &sum);
            let (mean, covariance) = ranged(rough, p, reading, ([2.0, 2.0], 12.0));
            for i in 0..2 {
                let sd = covariance[3 * i].sqrt();
                assert!((found.mean[i] - mean[i]).abs() < 0.05 * sd);
                assert!((found.covariance[3 * i].sqrt() / sd - 1.0).abs() < 0.05);
            }
        }
        // Far sharper than what was known.
        let (x, y): (f64, f64) = (2.5, 1.5);
        let reading = [(x - 5.0).hypot(y - 5.0), (x - 5.0).hypot(y + 5.0)];
        let keeping = beacons(true, fine, p);
        let mut sum = keeping.start();
        keeping.act(&mut sum, 0, 0);
        keeping.sense(&mut sum, 0, 0, Reading::Values(&reading));
        let found = moments(&keeping, &sum);
        let (mean, covariance) = ranged(fine, p, reading, ([5.0, y], 4.0));
        for i in 0..2 {
            let sd = covariance[3 * i].sqrt();
            assert!((found.mean[i] - mean[i]).abs() < 0.1 * sd);
            assert!((found.covariance[3 * i].sqrt() / sd - 1.0).abs() < 0.1);
        }
    }
}

/// Noise next to none, and a covariance that has only one direction.
#[test]
fn what_is_known_exactly_is_no_obstacle() {
    for p in [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0], [0.0; 4]] {
        let model = ModelBuilder::new("singular", 0.9)
            .variable("x", -50.0, 50.0)
            .variable("y", -50.0, 50.0)
            .start(&[0.0, 0.0], &p)
            .motion(&[1.0, 0.0, 0.0, 1.0], &[0.0, 0.0], &[0.0; 4])
            .sensor(&[1.0, 0.0], &[1.0])
            .case(Case {
                sensor: noisy(Formula::coded("steep", |point| {
                    (0.01 + (point.state[0] - 1.0).powi(2)) * 0.3
                })),
                ..Case::default()
            })
            .action("WAIT", &[0.0])
            .reward(1.0, Clause::new().within("x", 0.0, 1.5))
            .belief(sums(None))
            .build()
            .unwrap();
        let keeping = SumKeeping::new(&model);
        let mut sum = keeping.start();
        keeping.act(&mut sum, 0, 0);
        keeping.sense(&mut sum, 0, 0, Reading::Values(&[0.9]));
        let found = moments(&keeping, &sum);
        let (mean, sd, _) = match p[0] > 0.0 {
            false => (0.0, 0.0, 0.0),
            true => on_a_grid(-8.0, 8.0, |x| {
                log_normal(x, 1.0) + log_normal(0.9 - x, (0.01 + (x - 1.0).powi(2)) * 0.3)
            }),
        };
        assert!(
            (found.mean[0] - mean).abs() <= 0.03 * sd,
            "{p:?}: {found:?} {mean} {sd}"
        );
        assert!(
            (found.covariance[0].sqrt() - sd).abs() <= 0.03 * sd,
            "{p:?}: {found:?} {sd}"
        );
        let slope = p[1];
        assert!(
            (found.mean[1] - slope * mean).abs() <= 0.03 * sd,
            "{p:?}: {found:?}"
        );
        assert!((found.covariance[3] - slope * sd * sd).abs() <= 0.06 * sd * sd);
    }
}

/// A binary light: signals and silence have the probabilities that an integral gives them.
#[test]
fn signals_and_silence_are_heard() {
    let bright = |y: f64| 0.05 + 0.9 / (1.0 + (-6.0 * (1.5 - (y - 5.0).abs())).exp());
    let present = |y: f64| 0.3 + 0.6 / (1.0 + y * y);
    let sensor = SensorLaw {
        symbols: vec![
            Formula::coded("bright", move |point| bright(point.state[0])),
            Formula::coded("dark", move |point| 1.0 - bright(point.state[0])),
        ],
        present: Some(Formula::coded("heard", move |point| {
            present(point.state[0])
        })),
        ..SensorLaw::default()
    };
    let model = light_dark_from_nowhere(40).start(&[2.0], &[9.0]);
    let mut model = model.build().unwrap();
    model.sensor.h = DMatrix::zeros(0, 1);
    model.sensor.noise = DMatrix::zeros(0, 0);
    model.laws = Laws {
        symbols: vec!["bright".to_owned(), "dark".to_owned()],
        cases: vec![Case {
            sensor,
            ..Case::default()
        }],
        ..Laws::default()
    };
    model.validate().unwrap();
    let keeping = SumKeeping::new(&model);
    let mut moved = keeping.start();
    keeping.act(&mut moved, RIGHT, 0);
    let likely = |sensed: &Sensed, y: f64| match sensed {
        Sensed::Symbol(0) => present(y) * bright(y),
        Sensed::Symbol(_) => present(y) * (1.0 - bright(y)),
        _ => 1.0 - present(y),
    };
    let readings = keeping.readings(&moved, RIGHT, 0, 10);
    assert_eq!(readings.len(), 3);
    for (probability, sensed) in readings {
        let (mean, sd, evidence) = on_a_grid(-22.0, 28.0, |y| {
            log_normal(y - 3.0, 9.0) + likely(&sensed, y).ln()
        });
        let mut after = moved.clone();
        keeping.sense(&mut after, RIGHT, 0, sensed.reading());
        let found = moments(&keeping, &after);
        let own = (found.mean[0], found.covariance[0].sqrt());
        assert!((probability - evidence.exp()).abs() < 0.005, "{sensed:?}");
        assert!(
            (own.0 - mean).abs() < 0.03 * sd && (own.1 / sd - 1.0).abs() < 0.03,
            "{sensed:?}"
        );
    }
}

/// Whole numbers: a start on every one of them, a light at 10.
#[test]
fn whole_numbers_are_points() {
    let noise = |s: f64| ((s - 10.0).abs() + 1e-4).powi(2);
    let belief = BeliefSettings {
        walls: WallBelief::Clip,
        ..sums(None)
    };
    let mut model = ModelBuilder::new("whole", 0.95)
        .variable("s", -60.0, 60.0)
        .kind(VariableKind::Integer)
        .start(&[0.0], &[310.0])
        .motion(&[1.0], &[1.0], &[0.0])
        .sensor(&[1.0], &[1.0])
        .case(Case {
            sensor: noisy(Formula::coded("whole light", move |point| {
                noise(point.state[0])
            })),
            ..Case::default()
        })
        .action("RIGHT", &[1.0])
        .reward(1.0, Clause::new().within("s", 0.0, 1.0))
        .belief(belief)
        .build()
        .unwrap();
    model.start[0].shape = crate::model::StartShape::Uniform;
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    assert_eq!(sum.components().len(), 61);
    keeping.act(&mut sum, 0, 0);
    keeping.sense(&mut sum, 0, 0, Reading::Values(&[4.0]));
    let weights: Vec<(f64, f64)> = (-29..=31)
        .map(|s| {
            (
                f64::from(s),
                log_normal(4.0 - f64::from(s), noise(f64::from(s))).exp(),
            )
        })
        .collect();
    let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
    let mean = weights.iter().map(|(s, weight)| s * weight).sum::<f64>() / total;
    let square = weights
        .iter()
        .map(|(s, weight)| s * s * weight)
        .sum::<f64>()
        / total;
    let found = moments(&keeping, &sum);
    assert!((found.mean[0] - mean).abs() < 0.02, "{found:?} {mean}");
    assert!((found.covariance[0] - (square - mean * mean)).abs() < 0.5);
}

#[test]
fn a_reading_at_its_end_says_that_there_is_more() {
    let mut model = light_dark_from_nowhere(40)
        .start(&[2.0], &[9.0])
        .build()
        .unwrap();
    model.laws.saturates = vec![Interval::new(0.0, 4.0)];
    let keeping = SumKeeping::new(&model);
    for reading in [4.0, 0.0, 2.0] {
        let mut sum = keeping.start();
        keeping.act(&mut sum, RIGHT, 0);
        keeping.sense(&mut sum, RIGHT, 0, Reading::Values(&[reading]));
        let found = moments(&keeping, &sum);
        let (mean, sd, _) = on_a_grid(-21.0, 27.0, |y| {
            let apart = reading - y;
            log_normal(y - 3.0, 9.0)
                + match reading {
                    4.0 => normal_cdf(-apart / light(y)).ln(),
                    0.0 => normal_cdf(apart / light(y)).ln(),
                    _ => log_normal(apart, light(y).powi(2)),
                }
        });
        assert!(
            (found.mean[0] - mean).abs() < 0.02 * sd,
            "{reading}: {found:?} {mean} {sd}"
        );
        assert!(
            (found.covariance[0].sqrt() / sd - 1.0).abs() < 0.02,
            "{reading}: {found:?} {sd}"
        );
    }
    let mut sum = keeping.start();
    keeping.act(&mut sum, RIGHT, 0);
    let readings = keeping.readings(&sum, RIGHT, 0, 50);
    let beyond = readings
        .iter()
        .filter(|(_, sensed)| *sensed == Sensed::Values(vec![4.0]));
    assert!(beyond.count() > 5);
}
