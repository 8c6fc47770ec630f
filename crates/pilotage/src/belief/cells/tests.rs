use super::*;
use crate::belief::KalmanFilter;
use crate::belief::full::Keeping;
use crate::model::{BeliefSettings, Clause, Formula, Interval, ModelBuilder, Then, WallBelief};
use nalgebra::{DMatrix, DVector};

fn hallway(cells: Option<usize>) -> Model {
    ModelBuilder::new("hallway", 0.9)
        .variable("x", -10.0, 10.0)
        .start(&[0.3], &[0.5])
        .motion(&[0.9], &[1.0], &[0.1])
        .sensor(&[1.0], &[0.4])
        .action("FORWARD", &[1.0])
        .action("BACK", &[-1.0])
        .reward(1.0, Clause::new().within("x", 1.0, 2.0))
        .belief(BeliefSettings {
            cells,
            ..BeliefSettings::default()
        })
        .build()
        .unwrap()
}

fn plane() -> Model {
    ModelBuilder::new("plane", 0.9)
        .variable("x", -8.0, 8.0)
        .variable("v", -4.0, 4.0)
        .start(&[0.3, 0.1], &[0.5, 0.2, 0.2, 0.3])
        .motion(&[1.0, 0.3, 0.0, 0.9], &[0.0, 0.4], &[0.2, 0.1, 0.1, 0.2])
        .sensor(&[1.0, 0.0, 0.3, 1.0], &[0.4, 0.1, 0.1, 0.6])
        .action("FORWARD", &[1.0])
        .action("BACK", &[-1.0])
        .reward(1.0, Clause::new().within("x", 1.0, 2.0))
        .belief(BeliefSettings {
            cells: Some(60),
            ..BeliefSettings::default()
        })
        .build()
        .unwrap()
}

fn moments(keeping: &CellsKeeping, full: &Cells) -> Moments {
    let mut moments = Moments::default();
    keeping.moments(full, &mut moments);
    moments
}

fn kalman(model: &Model) -> KalmanFilter {
    KalmanFilter {
        a: model.motion.a.clone(),
        b: model.motion.b.clone(),
        q: model.motion.noise.clone(),
        h: model.sensor.h.clone(),
        r: model.sensor.noise.clone(),
        mean: model.start[0].mean.clone(),
        covariance: model.start[0].covariance.clone(),
    }
}

/// Cells agree with the Kalman filter where that is exact, to within what a cell's width blurs: its square, a step.
fn follows_kalman(model: &Model, readings: &[&[f64]], within: f64) {
    let keeping = CellsKeeping::new(model).unwrap();
    let (mut full, mut filter) = (keeping.start(), kalman(model));
    for (step, reading) in readings.iter().enumerate() {
        let action = step % 2;
        keeping.act(&mut full, action, step);
        keeping.sense(&mut full, action, step, Reading::Values(reading));
        filter.step(
            &model.actions[action].control,
            &DVector::from_column_slice(reading),
        );
        let moments = moments(&keeping, &full);
        let n = model.state_dim();
        let mean = DVector::from_column_slice(&moments.mean);
        let covariance = DMatrix::from_row_slice(n, n, &moments.covariance);
        assert!((mean - &filter.mean).amax() < within, "{step}");
        assert!((covariance - &filter.covariance).amax() < within, "{step}");
    }
}

#[test]
fn cells_follow_the_kalman_filter_where_that_is_exact() {
    let readings: [&[f64]; 4] = [&[1.0], &[0.2], &[2.5], &[0.9]];
    follows_kalman(&hallway(None), &readings, 0.004);
    let readings: [&[f64]; 4] = [&[1.0, 0.3], &[0.5, 0.1], &[0.2, 0.9], &[1.0, -0.2]];
    follows_kalman(&plane(), &readings, 0.03);
}

/// Noise much narrower than a cell: the mean is kept to a part of a cell, and no reading is impossible.
#[test]
fn readings_narrower_than_a_cell_place_the_mean_within_it() {
    let mut model = hallway(Some(20));
    model.sensor.noise[(0, 0)] = 1e-6;
    let keeping = CellsKeeping::new(&model).unwrap();
    for k in 0..40 {
        let reading = -1.5 + 0.1 * f64::from(k);
        let mut full = keeping.start();
        keeping.act(&mut full, 0, 0);
        keeping.sense(&mut full, 0, 0, Reading::Values(&[reading]));
        let moments = moments(&keeping, &full);
        assert!(
            (moments.mean[0] - reading).abs() <= 0.5 + 1e-9,
            "{reading}: {moments:?}"
        );
        assert!(moments.covariance[0] < 0.4, "{reading}: {moments:?}");
    }
}

fn eventful() -> Model {
    ModelBuilder::new("eventful", 0.9)
        .variable("x", 0.0, 4.0)
        .mode("empty")
        .mode("loaded")
        .start_of(0.6, Some("empty"), &[1.1], &[0.5])
        .start_of(0.4, Some("loaded"), &[2.7], &[0.3])
        .motion(&[1.0], &[1.0], &[0.3])
        .sensor(&[1.0], &[0.25])
        .present(0.7)
        .action("EAST", &[1.0])
        .action("WEST", &[-1.0])
        .event(
            2.0,
            Some("loaded"),
            Then::Continue,
            Clause::new()
                .in_mode("empty")
                .within("x", 0.0, 1.05)
                .after(),
        )
        .event(
            3.0,
            Some("empty"),
            Then::Continue,
            Clause::new()
                .in_mode("loaded")
                .within("x", 2.77, 4.0)
                .with_probability(0.4),
        )
        .event(
            -1.0,
            None,
            Then::End,
            Clause::new()
                .within("x", 1.5, 1.9)
                .with_probability(0.25)
                .after(),
        )
        .event(
            1.0,
            None,
            Then::Restart,
            Clause::new()
                .on("WEST")
                .within("x", 1.0, 1.7)
                .with_probability(0.5),
        )
        .reward(0.5, Clause::new().within("x", 0.33, 2.21).after())
        .reward_of(
            Formula::coded("square", |point| point.state[0].powi(2)),
            Clause::new().within("x", 0.33, 2.21),
        )
        .alive(Clause::new().within("x", 0.21, 3.87), -5.0)
        .build()
        .unwrap()
}

#[test]
fn what_ends_restarts_and_goes_on_is_all_there_is() {
    for model in [eventful(), hallway(None), plane()] {
        let keeping = CellsKeeping::new(&model).unwrap();
        let from = keeping.start();
        for action in 0..2 {
            let mut to = vec![0.0; from.mass.len()];
            keeping.forward(action, &from.mass, &mut to);
            let mut full = from.clone();
            let acted = keeping.act(&mut full, action, 0);
            let goes_on: f64 = to.iter().sum();
            assert!((goes_on + acted.ended + acted.restarted - 1.0).abs() < 1e-8);
            assert!((full.mass.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            // What is expected of values is the same from either end.
            let values: Vec<f64> = (0..to.len()).map(|i| (i as f64).sin()).collect();
            let ahead: f64 = to.iter().zip(&values).map(product).sum();
            let behind: f64 = from
                .mass
                .iter()
                .zip(&keeping.backward(action, &values))
                .map(product)
                .sum();
            assert!((ahead - behind).abs() < 1e-12);
        }
    }
}

/// Posteriors averaged over the readings are what was believed before.
#[test]
fn readings_say_on_average_what_was_believed() {
    for (model, most) in [(eventful(), 400), (hallway(None), 400), (plane(), 500)] {
        let keeping = CellsKeeping::new(&model).unwrap();
        let mut full = keeping.start();
        keeping.act(&mut full, 0, 0);
        let readings = keeping.readings(&full, 0, 0, most);
        let sum: f64 = readings.iter().map(|(likely, _)| likely).sum();
        assert!((sum - 1.0).abs() < 1e-12);
        let mut average = vec![0.0; full.mass.len()];
        for (likely, sensed) in &readings {
            let mut after = full.clone();
            keeping.sense(&mut after, 0, 0, sensed.reading());
            for (sum, mass) in average.iter_mut().zip(&after.mass) {
                *sum += likely * mass;
            }
        }
        let average = Cells { mass: average };
        let (before, after) = (moments(&keeping, &full), moments(&keeping, &average));
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.02);
        assert!(close(&before.mean, &after.mean), "{before:?} {after:?}");
        assert!(
            close(&before.covariance, &after.covariance),
            "{before:?} {after:?}"
        );
        assert!(
            close(&before.weights, &after.weights),
            "{before:?} {after:?}"
        );
    }
}

#[test]
fn moments_come_back_and_means_move() {
    for model in [hallway(None), plane()] {
        let keeping = CellsKeeping::new(&model).unwrap();
        let given = moments(&keeping, &keeping.start());
        let again = moments(&keeping, &keeping.with_moments(&given));
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.03);
        assert!(close(&given.mean, &again.mean) && close(&given.covariance, &again.covariance));
        let mean: Vec<f64> = given.mean.iter().map(|x| x + 1.23).collect();
        let moved = moments(&keeping, &keeping.moved_to(&keeping.start(), &mean));
        assert!(close(&moved.mean, &mean), "{moved:?}");
        assert!(close(&moved.covariance, &given.covariance), "{moved:?}");
    }
}

/// Whole numbers have a cell each, signals count as they are likely, and a discrete sensor says each of them.
#[test]
fn whole_numbers_and_signals_are_exact() {
    let text = r#"
        format = 1
        name = "rungs"
        discount = 0.9
        [state]
        names = ["x"]
        bounds = [[0.0, 4.0]]
        integer = ["x"]
        [start]
        mean = [2.0]
        covariance = [[0.0]]
        [motion]
        A = [[1.0]]
        B = [[1.0]]
        noise = [[0.0]]
        [sensor]
        symbols = { high = "0.1 + 0.2*x", low = "rest" }
        [actions]
        UP = { u = [1.0] }
        STAY = { u = [0.0] }
        [belief]
        walls = "clip"
        [[reward]]
        in = { x = [4.0, 5.0] }
        value = 1.0
    "#;
    let model = crate::scenario::read(text, "rungs").unwrap().model;
    let keeping = CellsKeeping::new(&model).unwrap();
    assert_eq!(keeping.cells(), 5);
    let mut full = Cells {
        mass: vec![0.2, 0.3, 0.5, 0.0, 0.0],
    };
    keeping.act(&mut full, 0, 0);
    assert_eq!(full.mass, [0.0, 0.2, 0.3, 0.5, 0.0]);
    let readings = keeping.readings(&full, 0, 0, 1);
    let high = 0.2 * 0.3 + 0.3 * 0.5 + 0.5 * 0.7;
    assert!((readings[0].0 - high).abs() < 1e-12 && readings.len() == 2);
    keeping.sense(&mut full, 0, 0, Reading::Symbol(0));
    assert!((full.mass[3] - 0.35 / high).abs() < 1e-12);
}

/// Bounds far beyond all that a few steps reach are coarse, and still there.
#[test]
fn cells_follow_what_drifts_to_a_far_bound() {
    let mut model = hallway(None);
    model.state[0].bounds = Interval::new(-200.0, 300.0);
    model.motion.a[(0, 0)] = 1.0;
    let keeping = CellsKeeping::new(&model).unwrap();
    assert!(keeping.cells() < 400, "{}", keeping.cells());
    let mut full = keeping.start();
    for step in 0..250 {
        keeping.act(&mut full, 0, step);
        let moments = moments(&keeping, &full);
        let expected = 0.3 + (step + 1) as f64;
        assert!(
            (moments.mean[0] - expected).abs() < 0.1 * expected.max(10.0),
            "{step}: {moments:?}"
        );
    }
}

/// Who was stopped at a wall stands there exactly, and starts from there.
#[test]
fn who_is_stopped_at_a_wall_starts_from_it() {
    let mut model = hallway(None);
    model.state[0].bounds = Interval::new(0.0, 4.0);
    model.motion.a[(0, 0)] = 1.0;
    model.motion.b[(0, 0)] = 0.25;
    model.belief.walls = WallBelief::Clip;
    let keeping = CellsKeeping::new(&model).unwrap();
    // All at the east wall, and then back: half of what noise adds to a step of -0.25 is stopped there again.
    let mut full = keeping.start();
    for step in 0..200 {
        keeping.act(&mut full, 0, step);
    }
    let stationary = |mut x: f64| {
        // The same by drawing: a reflected walk that is held at the wall.
        let mut rng = crate::random::stream(1, 0, crate::random::Role::World);
        let (mut at_wall, mut mean) = (0.0, 0.0);
        let steps = 400_000;
        for _ in 0..steps {
            let noise = 0.1f64.sqrt() * crate::random::normal(&mut rng);
            x = (x + 0.25 + noise).clamp(0.0, 4.0);
            at_wall += f64::from(x == 4.0) / f64::from(steps);
            mean += x / f64::from(steps);
        }
        (at_wall, mean)
    };
    let (at_wall, mean) = stationary(4.0);
    let moments = moments(&keeping, &full);
    // Ten standard errors of correlated draws.
    assert!((moments.mean[0] - mean).abs() < 0.01, "{mean} {moments:?}");
    let last = full.mass[keeping.cells() - 1];
    assert!((last - at_wall).abs() < 0.02, "{last} {at_wall}");
}

/// Wherever a way is stopped, there is a stop at that place.
#[test]
fn ways_end_at_stops() {
    let text = crate::scenario::builtin("u-maze").unwrap();
    let model = crate::scenario::read(text, "u-maze").unwrap().model;
    let map = model.map.unwrap();
    let stops = [0, 1].map(|axis| map.stops(axis));
    let mut rng = crate::random::stream(1, 0, crate::random::Role::World);
    let mut met = [vec![false; stops[0].len()], vec![false; stops[1].len()]];
    for _ in 0..20_000 {
        let mut point = || [0, 1].map(|_| 7.0 * crate::random::uniform(&mut rng) - 1.0);
        let (from, to) = (map.nearest_free(point()), point());
        let end = map.travel(from, to);
        let cut = |axis: usize| end[axis] != to[axis];
        let at = |axis: usize| {
            stops[axis].iter().position(|stop| {
                let near = (stop.place - end[axis]).abs() < 1e-9;
                near && stop.upwards == (to[axis] > from[axis])
            })
        };
        if let Some(axis) = [0, 1]
            .into_iter()
            .find(|axis| cut(*axis) && at(*axis).is_some())
        {
            met[axis][at(axis).unwrap()] = true;
        } else {
            assert_eq!(end, to, "{from:?}");
        }
    }
    assert!(met.iter().flatten().all(|met| *met), "{stops:?} {met:?}");
}
