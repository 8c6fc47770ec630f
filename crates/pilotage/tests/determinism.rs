//! The same numbers, to the last bit, for any number of threads; other numbers for another seed, episode or role.
#![allow(clippy::unwrap_used)]

mod common;

use common::{built_in, scenario};
use pilotage::belief::{Belief, BeliefMdp};
use pilotage::policy::{Automaton, Matching, Policy};
use pilotage::progress::Silent;
use pilotage::random::{Role, normal, stream, uniform};
use pilotage::simulate::{Evaluation, Options, evaluate};
use pilotage::solve::compile::{self, compile};
use pilotage::solve::kbvi::{branches, generate};
use pilotage::solve::value_iteration;

fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(work)
}

/// Bits of every number, so that even -0 and 0 differ.
fn bits(evaluation: &Evaluation) -> Vec<u64> {
    let Evaluation {
        episodes,
        discounted,
        undiscounted,
        steps,
        failed,
        lost,
    } = evaluation;
    assert_eq!(*lost, None);
    [discounted, undiscounted, steps]
        .iter()
        .flat_map(|estimate| [estimate.mean, estimate.stderr])
        .chain([*failed])
        .map(f64::to_bits)
        .chain([*episodes as u64])
        .collect()
}

fn solved(name: &str, points: usize, matching: Matching) -> (Vec<u64>, Automaton, Vec<u64>) {
    let scenario = scenario(name);
    let mdp = BeliefMdp::new(&scenario.model);
    let settings = value_iteration::Settings {
        points: Some(points),
        tolerance: 1e-5,
        ..value_iteration::Settings::default()
    };
    let policy = value_iteration::solve(&mdp, &settings, &Silent).unwrap();
    let values = (0..50)
        .map(|k| {
            let mean = vec![f64::from(k) / 10.0; scenario.model.state_dim()];
            let belief = Belief {
                mean,
                ..mdp.start().clone()
            };
            policy.value(&belief).unwrap().to_bits()
        })
        .chain([policy.start_value().to_bits()])
        .collect();
    let settings = compile::Settings {
        matching,
        episodes: 20,
        ..compile::Settings::default()
    };
    let automaton = compile(&policy, &mdp, "value-iteration", &settings).unwrap();
    let options = Options {
        episodes: 1001,
        seed: 7,
    };
    let evaluation = evaluate(&scenario, &mdp.filter(), &automaton, options, &Silent);
    (values, automaton, bits(&evaluation))
}

#[test]
fn solving_and_evaluating_do_not_depend_on_threads() {
    for (name, points, matching) in [
        ("corridor-blind", 201, Matching::Nearest),
        ("tiger", 201, Matching::Segments),
        ("maze-2d", 31, Matching::Nearest),
    ] {
        let alone = with_threads(1, || solved(name, points, matching));
        let together = with_threads(5, || solved(name, points, matching));
        assert!(alone == together, "{name}");
    }
}

#[test]
fn generating_does_not_depend_on_threads() {
    let generated = || {
        let settings = generate::Settings {
            matching: Matching::Segments,
            search: branches::Settings {
                horizon: 3,
                ..branches::Settings::default()
            },
            last_horizon: 5,
            runs: 20,
            ..generate::Settings::default()
        };
        let mdp = BeliefMdp::new(&built_in("corridor-blind"));
        let generated = generate::generate(&mdp, &settings, &Silent).unwrap();
        (generated.automaton, generated.history)
    };
    let alone = with_threads(1, generated);
    assert!(alone == with_threads(4, generated));
}

#[test]
fn another_seed_gives_other_episodes() {
    let scenario = scenario("corridor-blind");
    let mdp = BeliefMdp::new(&scenario.model);
    let earned = |seed| {
        let policy = pilotage::policy::AutomatonRunner::new(&Automaton::new(
            &mdp,
            "east",
            Matching::Nearest,
        ));
        let options = Options {
            episodes: 100,
            seed,
        };
        bits(&evaluate(
            &scenario,
            &mdp.filter(),
            &policy,
            options,
            &Silent,
        ))
    };
    assert_eq!(earned(1), earned(1));
    assert_ne!(earned(1), earned(2));
}

#[test]
fn streams_differ_by_seed_episode_and_role() {
    let roles = [Role::World, Role::Sensor, Role::Exploration, Role::Planner];
    let mut firsts: Vec<[u64; 2]> = Vec::new();
    for seed in [0, 1, 7, u64::MAX] {
        for episode in [0, 1, 2, 3, 4, 1_000_000] {
            for role in roles {
                let mut rng = stream(seed, episode, role);
                firsts.push([uniform(&mut rng).to_bits(), uniform(&mut rng).to_bits()]);
                assert_eq!(
                    firsts.last(),
                    Some(&{
                        let mut again = stream(seed, episode, role);
                        [uniform(&mut again).to_bits(), uniform(&mut again).to_bits()]
                    })
                );
            }
        }
    }
    let count = firsts.len();
    firsts.sort();
    firsts.dedup();
    assert_eq!(firsts.len(), count);
}

/// Draws of neighbouring streams have nothing to do with each other: with 20,000 pairs the correlation has a standard deviation of
/// 0.007, and five of them are passed by one seed in a million.
#[test]
fn streams_are_uncorrelated() {
    const DRAWS: usize = 20_000;
    let draws = |episode, role| -> Vec<f64> {
        let mut rng = stream(3, episode, role);
        (0..DRAWS).map(|_| normal(&mut rng)).collect()
    };
    let own = draws(5, Role::World);
    for other in [
        draws(5, Role::Sensor),
        draws(5, Role::Planner),
        draws(6, Role::World),
    ] {
        let product: f64 = own.iter().zip(&other).map(|(a, b)| a * b).sum();
        let correlation = product / DRAWS as f64;
        assert!(
            correlation.abs() < 5.0 / (DRAWS as f64).sqrt(),
            "{correlation}"
        );
    }
}
