//! Beliefs that are kept in full, held against the world whose steps they follow, and against the Kalman filter where that is exact.
#![allow(clippy::unwrap_used)]

use nalgebra::{DMatrix, DVector};
use pilotage::belief::{CellsKeeping, KalmanFilter, Keeping, Moments, Reading, SumKeeping};
use pilotage::model::{Clause, Formula, Model, ModelBuilder, Then, WallBelief};
use pilotage::scenario::Scenario;
use pilotage::world::{Observation, ProblemWorld, Streams, World};

/// Everything that a step can do, in a model of one variable and two modes.
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

fn moments<K: Keeping>(keeping: &K, full: &K::Full) -> Moments {
    let mut moments = Moments::default();
    keeping.moments(full, &mut moments);
    moments
}

/// The step of a world of many states, event by event, against what a belief makes of it. Standard errors of 2e5 draws are below a
/// quarter of what cells are allowed; a sum of Gaussians keeps moments of what is cut, not its shape, and is allowed six times as much.
fn follows_the_world<K: Keeping>(model: &Model, keeping: &K, allowed: f64) {
    const DRAWS: usize = 200_000;
    let mut world = ProblemWorld::new(&Scenario::assumed(model));
    let mut draws = Streams::new(7, 0);
    let mut observation = Observation::new(1);
    for action in 0..2 {
        let (mut reward, mut ended, mut restarted, mut loaded, mut sum) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for _ in 0..DRAWS {
            world.reset(&mut draws);
            let step = world.step(action, &mut draws, &mut observation);
            reward += step.reward / DRAWS as f64;
            match step.then {
                Then::End => ended += 1.0 / DRAWS as f64,
                Then::Restart => restarted += 1.0 / DRAWS as f64,
                Then::Continue => {
                    loaded += world.mode() as f64 / DRAWS as f64;
                    sum += world.state()[0] / DRAWS as f64;
                }
            }
        }
        let mut full = keeping.start();
        let acted = keeping.act(&mut full, action, 0);
        let moments = moments(keeping, &full);
        let left = 1.0 - acted.ended - acted.restarted;
        for (name, drawn, kept, within) in [
            ("reward", reward, acted.reward, 0.03),
            ("ended", ended, acted.ended, 0.004),
            ("restarted", restarted, acted.restarted, 0.004),
            ("loaded", loaded, left * moments.weights[1], 0.004),
            ("mean", sum, left * moments.mean[0], 0.012),
        ] {
            assert!(
                (drawn - kept).abs() < allowed * within,
                "{:?} {action} {name}: {drawn} {kept}",
                model.belief.walls
            );
        }
    }
}

#[test]
fn a_step_of_a_belief_is_what_the_world_does() {
    for walls in [WallBelief::Ignore, WallBelief::Clip] {
        let mut model = eventful();
        model.belief.walls = walls;
        model.belief.cells = Some(400);
        follows_the_world(&model, &CellsKeeping::new(&model).unwrap(), 1.0);
        follows_the_world(&model, &SumKeeping::new(&model), 6.0);
    }
}

/// Posteriors averaged over the readings are what was believed before.
#[test]
fn readings_say_on_average_what_a_sum_believed() {
    let model = eventful();
    let keeping = SumKeeping::new(&model);
    let mut full = keeping.start();
    keeping.act(&mut full, 0, 0);
    let before = moments(&keeping, &full);
    let readings = keeping.readings(&full, 0, 0, 400);
    let sum: f64 = readings.iter().map(|(likely, _)| likely).sum();
    assert!((sum - 1.0).abs() < 1e-12);
    let (mut mean, mut loaded) = (0.0, 0.0);
    for (likely, sensed) in &readings {
        let mut after = full.clone();
        keeping.sense(&mut after, 0, 0, sensed.reading());
        let after = moments(&keeping, &after);
        mean += likely * after.mean[0];
        loaded += likely * after.weights[1];
    }
    assert!((mean - before.mean[0]).abs() < 0.02, "{mean} {before:?}");
    assert!(
        (loaded - before.weights[1]).abs() < 0.02,
        "{loaded} {before:?}"
    );
}

/// One Gaussian, linear motion and sensing: a sum is the Kalman filter, to rounding.
#[test]
fn a_sum_is_the_kalman_filter_where_that_is_exact() {
    let model = ModelBuilder::new("plane", 0.9)
        .variable("x", -8.0, 8.0)
        .variable("v", -4.0, 4.0)
        .start(&[0.3, 0.1], &[0.5, 0.2, 0.2, 0.3])
        .motion(&[1.0, 0.3, 0.0, 0.9], &[0.0, 0.4], &[0.2, 0.1, 0.1, 0.2])
        .sensor(&[1.0, 0.0, 0.3, 1.0], &[0.4, 0.1, 0.1, 0.6])
        .action("FORWARD", &[1.0])
        .action("BACK", &[-1.0])
        .reward(1.0, Clause::new().within("x", 1.0, 2.0))
        .build()
        .unwrap();
    let keeping = SumKeeping::new(&model);
    let mut full = keeping.start();
    let mut filter = KalmanFilter {
        a: model.motion.a.clone(),
        b: model.motion.b.clone(),
        q: model.motion.noise.clone(),
        h: model.sensor.h.clone(),
        r: model.sensor.noise.clone(),
        mean: model.start[0].mean.clone(),
        covariance: model.start[0].covariance.clone(),
    };
    let readings: [&[f64]; 4] = [&[1.0, 0.3], &[0.5, 0.1], &[0.2, 0.9], &[1.0, -0.2]];
    for (step, reading) in readings.iter().enumerate() {
        let action = step % 2;
        keeping.act(&mut full, action, step);
        keeping.sense(&mut full, action, step, Reading::Values(reading));
        let control = &model.actions[action].control;
        filter.step(control, &DVector::from_column_slice(reading));
        let moments = moments(&keeping, &full);
        let mean = DVector::from_column_slice(&moments.mean);
        let covariance = DMatrix::from_row_slice(2, 2, &moments.covariance);
        assert!((mean - &filter.mean).amax() < 1e-9, "{step}");
        assert!((covariance - &filter.covariance).amax() < 1e-9, "{step}");
    }
}

/// Light-dark: mean, to a twentieth of a deviation, and deviation, to a tenth, against a fine grid.
#[test]
fn a_sum_follows_noise_that_depends_on_the_place() {
    let text = pilotage::scenario::builtin("light-dark-5").unwrap();
    let model = pilotage::scenario::read(text, "light-dark-5")
        .unwrap()
        .model;
    let noise = |y: f64| ((y - 5.0).abs() / 2.0_f64.sqrt() + 0.01).powi(2);
    let keeping = SumKeeping::new(&model);
    let right = (0..model.actions.len())
        .find(|a| model.actions[*a].control[0] == 1.0)
        .unwrap();
    let mut full = keeping.start();
    let grid: Vec<f64> = (0..60_000).map(|k| -13.0 + 0.0005 * f64::from(k)).collect();
    let mut density: Vec<f64> = grid
        .iter()
        .map(|y| (-0.5 * (y - 2.0).powi(2) / 9.0).exp())
        .collect();
    let mut shift = 0.0;
    for (step, reading) in [3.4, 3.2, 4.7].into_iter().enumerate() {
        keeping.act(&mut full, right, step);
        keeping.sense(&mut full, right, step, Reading::Values(&[reading]));
        shift += 1.0;
        for (mass, y) in density.iter_mut().zip(&grid) {
            let variance = noise(y + shift);
            let apart = reading - (y + shift);
            *mass *= (-0.5 * apart * apart / variance).exp() / variance.sqrt();
        }
        let total: f64 = density.iter().sum();
        let first: f64 = density
            .iter()
            .zip(&grid)
            .map(|(mass, y)| mass * (y + shift))
            .sum();
        let mean = first / total;
        let second: f64 = density
            .iter()
            .zip(&grid)
            .map(|(mass, y)| mass * (y + shift - mean).powi(2))
            .sum();
        let deviation = (second / total).sqrt();
        let kept = moments(&keeping, &full);
        let off = (kept.mean[0] - mean).abs() / deviation;
        assert!(off < 0.05, "{step}: {} {mean} ± {deviation}", kept.mean[0]);
        let ratio = kept.covariance[0].sqrt() / deviation;
        assert!((ratio - 1.0).abs() < 0.1, "{step}: {ratio}");
    }
}
