//! Walls, and what is believed beyond them.

use super::*;

#[test]
fn what_runs_against_walls_stays_there() {
    let model = |components| {
        let belief = BeliefSettings {
            walls: WallBelief::Clip,
            ..sums(components)
        };
        ModelBuilder::new("walled", 0.9)
            .variable("x", 0.0, 10.0)
            .variable("y", 0.0, 10.0)
            .start(&[2.0, 5.0], &[1.0, 0.5, 0.5, 1.0])
            .motion(&[1.0, 0.0, 0.0, 1.0], &[1.0, 0.0], &[0.3, 0.0, 0.0, 0.2])
            .sensor(&[1.0, 0.0], &[1.0])
            .action("BACK", &[-1.5])
            .reward(1.0, Clause::new().within("x", 0.0, 0.1))
            .belief(belief)
            .build()
            .unwrap()
    };
    let mut rng = stream(8, 0, Role::World);
    let drawn = (0..400_000).map(|_| {
        let z = [(); 4].map(|()| normal(&mut rng));
        // Starts beyond the wall were stopped by it, too.
        let x = (2.0 + z[0]).max(0.0) - 1.5 + 0.3_f64.sqrt() * z[1];
        let y = 5.0 + 0.5 * z[0] + 0.75_f64.sqrt() * z[2] + 0.2_f64.sqrt() * z[3];
        [x.max(0.0), y]
    });
    let (mean, covariance) = drawn_moments(drawn);
    for components in [None, Some(1)] {
        let keeping = SumKeeping::new(&model(components));
        let mut sum = keeping.start();
        keeping.act(&mut sum, 0, 0);
        let found = moments(&keeping, &sum);
        assert_near(&found.mean, &mean, 0.01);
        assert_near(&found.covariance, &covariance, 0.03);
    }
}

/// A Gaussian at a wall reaches beyond it, and what it has there is at the wall.
#[test]
fn a_place_at_a_wall_holds_what_is_believed_beyond_it() {
    let model = |components| {
        let belief = BeliefSettings {
            walls: WallBelief::Clip,
            ..sums(Some(components))
        };
        ModelBuilder::new("walled", 0.9)
            .variable("x", 0.0, 4.0)
            .start(&[2.5], &[0.25])
            .motion(&[1.0], &[1.0], &[0.25])
            .sensor(&[1.0], &[1.0])
            .action("EAST", &[1.0])
            .reward(1.0, Clause::new().within("x", 3.0, 4.0))
            .belief(belief)
            .build()
            .unwrap()
    };
    // Moved by 1 with a variance of 0.5 in all, then stopped at 4.
    let there = 1.0 - normal_cdf((3.0 - 3.5) / 0.5_f64.sqrt());
    for (components, tolerance) in [(1, 0.03), (8, 0.005)] {
        let keeping = SumKeeping::new(&model(components));
        let mut sum = keeping.start();
        keeping.act(&mut sum, 0, 0);
        let paid = keeping.act(&mut sum, 0, 1).reward;
        assert!((paid - there).abs() < tolerance, "{paid}, not {there}");
    }
}

/// In `rooms`, a wall runs from north to south at x = 3, but for the doors in the middle.
#[test]
fn who_leans_on_a_wall_stays_on_its_side() {
    let model = crate::scenario::find("rooms").unwrap().model;
    let east = model.actions.iter().position(|a| a.name == "EAST").unwrap();
    let keeping = SumKeeping::new(&model);
    let mut full = keeping.with_moments(&Moments {
        mean: vec![2.9, 1.0],
        covariance: vec![0.04, 0.0, 0.0, 0.04],
        weights: vec![1.0, 0.0, 0.0, 0.0],
        step: 0,
    });
    let mut moments = Moments::default();
    for _ in 0..5 {
        keeping.act(&mut full, east, 0);
        keeping.sense(&mut full, east, 0, Reading::Values(&[3.4, 1.0, 0.5]));
        keeping.moments(&full, &mut moments);
        assert!(moments.mean[0] < 3.0, "{moments:?}");
        for component in &full.components {
            assert!(component.mean[0] < 3.0, "{component:?}");
        }
    }
    // A little of it on the other side does not draw the mean through the wall.
    let mut beyond = full.components[0].clone();
    beyond.mean[0] = 4.0;
    for component in &mut full.components {
        component.weight *= 0.9;
    }
    beyond.weight = 0.1;
    full.components.push(beyond);
    keeping.moments(&full, &mut moments);
    assert!(moments.mean[0] < 3.0, "{moments:?}");
}

/// A blocked cell in the way, of which some of the noise leads past.
#[test]
fn walls_of_a_map_stop_what_runs_into_them() {
    let belief = BeliefSettings {
        walls: WallBelief::Clip,
        ..sums(None)
    };
    let mut model = ModelBuilder::new("cell", 0.9)
        .variable("x", 0.0, 3.0)
        .variable("y", 0.0, 3.0)
        .start(&[0.5, 1.7], &[0.03, 0.0, 0.0, 0.05])
        .motion(&[1.0, 0.0, 0.0, 1.0], &[1.0, 0.0], &[0.02, 0.0, 0.0, 0.02])
        .sensor(&[1.0, 0.0], &[1.0])
        .action("EAST", &[1.0])
        .reward(1.0, Clause::new())
        .belief(belief)
        .build()
        .unwrap();
    let map = draw("...\n.#.\n...", 1.0).unwrap();
    model.map = Some(map.clone());
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    keeping.act(&mut sum, 0, 0);
    let mut rng = stream(10, 0, Role::World);
    let drawn = (0..200_000).map(|_| {
        let mut noise = |variance: f64| variance.sqrt() * normal(&mut rng);
        let from = map.nearest_free([0.5 + noise(0.03), 1.7 + noise(0.05)]);
        let to = [from[0] + 1.0 + noise(0.02), from[1] + noise(0.02)];
        map.travel(from, to)
    });
    let (mean, covariance) = drawn_moments(drawn);
    let found = moments(&keeping, &sum);
    assert_near(&found.mean, &mean, 0.05);
    assert_near(&found.covariance, &covariance, 0.03);
}
