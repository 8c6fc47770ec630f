//! The search for planes along which the agent stays alive: first at the steady level, where it spends its life, then at the levels
//! before it, over the first steps of an episode.

use super::failure::{Runs, Sample};
use super::refine::POPULATION;
use super::search::{Numbers, Search};
use crate::policy::Policy;

/// Failures rarer than the first are too rare to search by, and limits are drawn in until they are as frequent as the second.
const RARE: f64 = 1e-6;
const FREQUENT: f64 = 1e-5;

/// Runs, steps, generations and first step size of each phase at the steady level, and of each over the first steps.
const STEADY: [(usize, usize, usize, f64); 3] = [
    (100, 1500, 16, 0.3),
    (100, 6000, 16, 0.12),
    (200, 10_000, 14, 0.048),
];
const EARLY: [(usize, usize, f64); 2] = [(1000, 20, 0.3), (4000, 15, 0.15)];
/// Steps after the last early level that the early nodes are judged by.
const AFTERMATH: usize = 40;

/// Moves the numbers to where the belief is least likely to fail.
pub(super) fn improve(search: &mut Search<'_>, numbers: &mut Numbers) {
    let early = search.groups.len() > 1;
    let steady: usize = STEADY.iter().map(|phase| phase.2).sum();
    let first: usize = EARLY.iter().map(|phase| phase.1).sum();
    search.begin(steady + first * usize::from(early));
    search.observer.note(&format!(
        "{} levels in {} groups, {} nodes; no grid, less than 16 MiB; about {:.0} million steps of belief to simulate",
        search.mdp.strata(),
        search.groups.len(),
        search.groups.len() * search.mdp.model().actions.len(),
        steps(search.settings.effort, early) / 1e6,
    ));
    improve_steady(search, numbers);
    if early {
        improve_early(search, numbers);
    }
}

/// Steps of belief that the search simulates.
fn steps(effort: f64, early: bool) -> f64 {
    let steady = STEADY
        .iter()
        .map(|(runs, steps, generations, _)| runs * steps * generations);
    let first = EARLY
        .iter()
        .map(|(runs, generations, _)| runs * generations * (AFTERMATH + 25));
    let first = first.sum::<usize>() * usize::from(early);
    (steady.sum::<usize>() + first) as f64 * POPULATION as f64 * effort
}

/// Moves the nodes of the steady level; all other levels follow.
fn improve_steady(search: &mut Search<'_>, numbers: &mut Numbers) {
    let origin = vec![0.0; search.mdp.model().state_dim()];
    let at_rest = || Runs::steady(search.mdp, search.steady(), &origin);
    let (few, short, _, _) = STEADY[0];
    let policy = search.controller(numbers);
    let runs = telling(at_rest(), &policy, search.sample(few, short, 1));
    for (phase, (count, steps, generations, step)) in (1..).zip(STEADY) {
        let sample = search.sample(count, steps, phase);
        let mut tied = vec![numbers[0].clone()];
        search.phase(&mut tied, (phase, generations, step), |search, tied| {
            let everywhere = vec![tied[0].clone(); search.groups.len()];
            runs.failure(&search.controller(&everywhere), sample)
        });
        numbers.fill(tied.swap_remove(0));
    }
    let sample = search.sample(100, 6000, 9);
    let at_rest = Runs::steady(search.mdp, search.steady(), &origin);
    let failure = at_rest.failure(&search.controller(numbers), sample);
    search.observer.note(&format!(
        "at the steady level the belief expects a failure in {:.3e} steps",
        1.0 / failure
    ));
}

/// Moves the nodes of all levels before the steady ones together.
fn improve_early(search: &mut Search<'_>, numbers: &mut Numbers) {
    let early = search.groups.len() - 1;
    let horizon = search.groups[early].0 + AFTERMATH;
    let runs = Runs::from_start(search.mdp);
    for (phase, (count, generations, step)) in (10..).zip(EARLY) {
        let sample = Sample {
            runs: search.effort(count),
            steps: horizon,
            seed: search.seed_of(phase),
        };
        let mut free = numbers[..early].to_vec();
        let last = numbers[early].clone();
        search.phase(&mut free, (phase, generations, step), |search, free| {
            let mut all = free.to_vec();
            all.push(last.clone());
            runs.failing(&search.controller(&all), sample)
        });
        numbers[..early].clone_from_slice(&free);
    }
    let sample = Sample {
        runs: search.effort(EARLY[1].0),
        steps: horizon,
        seed: search.seed_of(19),
    };
    let failing = runs.failing(&search.controller(numbers), sample);
    search.observer.note(&format!(
        "of all that are alive at the start {:.1} % are expected to fail in the first {horizon} steps",
        100.0 * failing
    ));
}

/// Runs in which failures are frequent enough to search by.
fn telling(runs: Runs, policy: &dyn Policy, sample: Sample) -> Runs {
    if runs.failure(policy, sample) < RARE {
        runs.with_failures(policy, sample, FREQUENT)
    } else {
        runs
    }
}
