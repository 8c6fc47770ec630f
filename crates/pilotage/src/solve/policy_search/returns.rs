//! The search for planes along which an episode earns most, where the model holds.
//!
//! All candidates are tried in the same episodes of the world that the model assumes, start and all, so that they are compared on equal
//! terms. First all levels share their planes, then each group has its own.

use super::refine::POPULATION;
use super::search::{Numbers, Search};
use crate::belief::Filter;
use crate::policy::Policy;
use crate::progress::Silent;
use crate::scenario::Scenario;
use crate::simulate::{Options, evaluate};

/// Episodes, generations and first step size of each phase with shared planes, and of each with planes of each group.
const SHARED: [(usize, usize, f64); 3] = [(200, 24, 0.4), (600, 20, 0.12), (2000, 14, 0.04)];
const APART: [(usize, usize, f64); 2] = [(1000, 20, 0.3), (3000, 15, 0.1)];

/// Episodes that what was found is judged by.
const JUDGED: usize = 10_000;

/// What comes when the discount has fallen below this is not simulated.
const FORGOTTEN: f64 = 1e-3;

/// Moves the numbers to where the discounted return is highest; returns that return, where it is a number.
pub(super) fn improve(search: &mut Search<'_>, numbers: &mut Numbers) -> Option<f64> {
    let groups = search.groups.len();
    let count = |phases: &[(usize, usize, f64)]| phases.iter().map(|phase| phase.1).sum::<usize>();
    search.begin(count(&SHARED) + count(&APART) * usize::from(groups > 1));
    let trial = Trial::new(search);
    search.observer.note(&format!(
        "{} levels in {groups} groups, {} nodes; no grid, less than 16 MiB; at most {:.0} million steps to simulate",
        search.mdp.strata(),
        groups * search.mdp.model().actions.len(),
        trial.steps(search.settings.effort, groups > 1) / 1e6,
    ));
    let first = numbers.clone();
    for (phase, (episodes, generations, step)) in (1..).zip(SHARED) {
        let options = options(search, episodes, phase);
        let mut tied = vec![numbers[0].clone()];
        search.phase(&mut tied, (phase, generations, step), |search, tied| {
            let everywhere = vec![tied[0].clone(); groups];
            -trial.earned(&search.controller(&everywhere), options)
        });
        numbers.fill(tied.swap_remove(0));
    }
    let shared = numbers.clone();
    for (phase, (episodes, generations, step)) in (10..).zip(APART) {
        if groups == 1 {
            break;
        }
        let options = options(search, episodes, phase);
        search.phase(numbers, (phase, generations, step), |search, numbers| {
            -trial.earned(&search.controller(numbers), options)
        });
    }
    // Noise deceives; what does best in episodes that none of them has seen is kept, the earliest of equals.
    let options = options(search, JUDGED, 20);
    let found = [first, shared, numbers.clone()];
    let judged: Vec<f64> = found
        .iter()
        .map(|numbers| trial.earned(&search.controller(numbers), options))
        .collect();
    let best = (1..found.len()).fold(0, |best, i| if judged[i] > judged[best] { i } else { best });
    numbers.clone_from(&found[best]);
    // The one that was kept did well in those episodes, which is no promise: others are asked.
    let options = Options {
        seed: search.seed_of(21),
        ..options
    };
    let promised = trial.promised(&search.controller(numbers), options);
    promised.is_finite().then_some(promised)
}

fn options(search: &Search<'_>, episodes: usize, phase: u64) -> Options {
    Options {
        episodes: search.effort(episodes),
        seed: search.seed_of(phase),
    }
}

/// Where candidates are tried: the world that the model assumes.
struct Trial {
    filter: Filter,
    scenario: Scenario,
    /// The same, with episodes that end when what is to come counts for next to nothing.
    short: Scenario,
}

impl Trial {
    fn new(search: &Search<'_>) -> Self {
        let scenario = Scenario::assumed(search.mdp.model());
        let mut short = scenario.clone();
        let (length, discount) = (scenario.model.episode.length, scenario.model.discount);
        if discount < 1.0 {
            let remembered = FORGOTTEN.ln() / discount.max(f64::MIN_POSITIVE).ln();
            short.model.episode.length = length.min(remembered.ceil().max(1.0) as usize);
        }
        Self {
            filter: search.mdp.filter(),
            scenario,
            short,
        }
    }

    /// Mean discounted return; of beliefs that grow without end, less than any.
    fn earned(&self, policy: &dyn Policy, options: Options) -> f64 {
        Self::mean(&self.short, &self.filter, policy, options)
    }

    /// The same for episodes of full length.
    fn promised(&self, policy: &dyn Policy, options: Options) -> f64 {
        Self::mean(&self.scenario, &self.filter, policy, options)
    }

    fn mean(scenario: &Scenario, filter: &Filter, policy: &dyn Policy, options: Options) -> f64 {
        let earned = evaluate(scenario, filter, policy, options, &Silent);
        match earned.check() {
            Ok(()) => earned.discounted.mean,
            Err(_) => f64::NEG_INFINITY,
        }
    }

    /// Most steps that the search simulates.
    fn steps(&self, effort: f64, apart: bool) -> f64 {
        let episodes = |phases: &[(usize, usize, f64)]| -> usize {
            phases.iter().map(|phase| phase.0 * phase.1).sum()
        };
        let episodes = episodes(&SHARED) + episodes(&APART) * usize::from(apart);
        (episodes * POPULATION + 4 * JUDGED) as f64
            * effort
            * self.short.model.episode.length as f64
    }
}
