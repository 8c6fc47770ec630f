//! What a policy earns, and what it would earn if it once did something else, found by running it.
//!
//! Episodes of the world that a model assumes are run under the policy. Where a belief is kept in full, returns are sums of what it expects
//! to be paid rather than of what is paid: the same on average, and less by chance (Rao-Blackwell).

use crate::belief::{BeliefSpace, Held, Updater, is_kept};
use crate::model::{ActionId, Model, Then};
use crate::parallel;
use crate::policy::Policy;
use crate::random::{Role, stream, uniform};
use crate::scenario::Scenario;
use crate::simulate::Estimate;
use crate::solve::rollout::{Judged, discounted_steps, told_in};
use crate::world::{Observation, ProblemWorld, Streams, World};

/// How much may be run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    /// Episodes that are run however long they are.
    pub episodes: usize,
    /// Steps in all beyond which no more episodes are begun.
    pub steps: usize,
}

/// Episodes that are run together before the budget is looked at.
const TOGETHER: usize = 16;

/// Beliefs of an episode that is never over early from which every action is tried, on average.
const EACH: f64 = 1.5;

/// A return is not followed further once what is left counts for so little.
const LITTLE: f64 = 1e-3;

/// Beliefs that a policy meets, about `most`, the likelier chosen the more a step counts, with what it earns from there if it begins with
/// each action. The same for any number of threads.
pub(crate) fn deviations(
    space: &dyn BeliefSpace,
    policy: &dyn Policy,
    most: usize,
    budget: Budget,
    seed: u64,
) -> Vec<Judged> {
    let runs = Runs::new(space);
    let mut all: Vec<Judged> = Vec::new();
    let (mut episodes, mut steps) = (0, 0);
    while episodes < budget.episodes || (all.len() < most && steps < budget.steps) {
        let together = parallel::map(TOGETHER, |i| {
            runs.deviating(policy, seed, (episodes + i) as u64)
        });
        for (judged, taken) in together {
            all.extend(judged);
            steps += taken;
        }
        episodes += TOGETHER;
    }
    for judged in &mut all {
        judged.counts /= episodes as f64;
    }
    all
}

/// What policies earn in each of the first episodes of a seed, as many as make so many steps; fewer of one that is plainly worse than another
/// whose returns in them are known. The same for any number of threads, and for each of them as if it ran alone.
pub(crate) fn returns(
    space: &dyn BeliefSpace,
    policies: &[&dyn Policy],
    budget: Budget,
    seed: u64,
    other: Option<&[f64]>,
) -> Vec<Vec<f64>> {
    let runs = Runs::new(space);
    let mut returns: Vec<Vec<f64>> = vec![Vec::new(); policies.len()];
    let mut taken = vec![0; policies.len()];
    let worse = |returns: &[f64]| other.is_some_and(|other| plainly_worse(returns, other));
    loop {
        let goes_on = |&i: &usize| {
            let own = &returns[i];
            own.len() < budget.episodes || (taken[i] < budget.steps && !worse(own))
        };
        let who: Vec<usize> = (0..policies.len()).filter(goes_on).collect();
        let Some(first) = who.first().map(|&i| returns[i].len()) else {
            return returns;
        };
        let run = |k| runs.together(policies, who.clone(), seed, (first + k) as u64);
        for alone in parallel::map(TOGETHER, run).into_iter().flatten() {
            returns[alone.who].push(alone.earned);
            taken[alone.who] += alone.steps;
        }
    }
}

/// Goes on to so many episodes where returns of policies in the first of them are known.
pub(crate) fn more_returns(
    space: &dyn BeliefSpace,
    policies: &[&dyn Policy],
    episodes: usize,
    seed: u64,
    returns: &mut [Vec<f64>],
) {
    let known: Vec<usize> = returns.iter().map(Vec::len).collect();
    let first = known.iter().copied().fold(episodes, usize::min);
    let runs = Runs::new(space);
    let run = |k| {
        let missing = |&i: &usize| known[i] <= first + k;
        let who = (0..policies.len()).filter(missing).collect();
        runs.together(policies, who, seed, (first + k) as u64)
    };
    for alone in parallel::map(episodes - first, run).into_iter().flatten() {
        returns[alone.who].push(alone.earned);
    }
}

/// How much more is earned than by another, in the episodes that both have.
pub(crate) fn gain(returns: &[f64], other: &[f64]) -> Estimate {
    let count = returns.len().min(other.len());
    let pairs = returns[..count].iter().zip(&other[..count]);
    Estimate::of(pairs.map(|(own, other)| own - other))
}

/// Whether less is earned, by four standard errors.
fn plainly_worse(returns: &[f64], other: &[f64]) -> bool {
    let gain = gain(returns, other);
    gain.mean + 4.0 * gain.stderr < 0.0
}

/// Episodes in the world that a model assumes.
struct Runs<'a> {
    model: &'a Model,
    scenario: Scenario,
    /// By start hypothesis.
    told: Vec<Updater>,
    /// Share of first decisions from which every action is tried.
    share: f64,
}

/// An episode as it goes on.
struct Course<'a> {
    runs: &'a Runs<'a>,
    world: ProblemWorld,
    updater: &'a Updater,
    held: Held,
    observation: Observation,
    /// Steps taken.
    step: usize,
}

/// An episode as far as several policies have it in common.
struct Common<'a> {
    course: Course<'a>,
    draws: Streams,
    who: Vec<usize>,
    earned: f64,
    counts: f64,
}

/// What one of several policies earned in an episode, and the steps that it took.
struct Alone {
    who: usize,
    earned: f64,
    steps: usize,
}

/// What a step pays, and whether the episode goes on.
struct Paid {
    reward: f64,
    goes_on: bool,
}

impl<'a> Runs<'a> {
    fn new(space: &'a dyn BeliefSpace) -> Self {
        let model = space.model();
        Self {
            model,
            scenario: Scenario::assumed(model),
            told: space.updater().told(space),
            share: EACH / discounted_steps(model, model.episode.length),
        }
    }

    fn start(&'a self, draws: &mut Streams) -> Course<'a> {
        let mut world = ProblemWorld::new(&self.scenario);
        world.reset(draws);
        let updater = told_in(&self.told, &world);
        Course {
            runs: self,
            world,
            held: updater.start(),
            updater,
            observation: Observation::new(self.model.observation_dim()),
            step: 0,
        }
    }

    /// An episode of several policies. What they do alike is done once: beliefs are dear.
    fn together(
        &'a self,
        policies: &[&dyn Policy],
        who: Vec<usize>,
        seed: u64,
        episode: u64,
    ) -> Vec<Alone> {
        let mut draws = Streams::new(seed, episode);
        let mut going = vec![Common {
            course: self.start(&mut draws),
            draws,
            who,
            earned: 0.0,
            counts: 1.0,
        }];
        let mut done = Vec::new();
        while let Some(mut common) = going.pop() {
            while common.course.step < self.model.episode.length {
                let held = &common.course.held;
                let action = |&i: &usize| policies[i].action_in_full(held);
                let Some(own) = common.who.first().map(action) else {
                    break;
                };
                let others: Vec<usize> = common
                    .who
                    .iter()
                    .copied()
                    .filter(|i| action(i) != own)
                    .collect();
                if !others.is_empty() {
                    common.who.retain(|i| !others.contains(i));
                    going.push(common.parted(others));
                }
                let paid = common.course.take(own, &mut common.draws);
                common.earned += common.counts * paid.reward;
                common.counts *= self.model.discount;
                if !paid.goes_on {
                    break;
                }
            }
            let earned = common.earned + common.counts * common.course.world.ending();
            let steps = common.course.step;
            done.extend(common.who.iter().map(|&who| Alone { who, earned, steps }));
        }
        done
    }

    /// The beliefs chosen of an episode, and the steps that it took in all. Beliefs count by their discount.
    fn deviating(&'a self, policy: &dyn Policy, seed: u64, episode: u64) -> (Vec<Judged>, usize) {
        let mut whims = stream(seed, episode, Role::Exploration);
        let mut draws = Streams::new(seed, episode);
        let mut course = self.start(&mut draws);
        let mut branch = self.start(&mut Streams::new(seed, episode));
        let (mut judged, mut steps) = (Vec::new(), 0);
        let mut counts = 1.0;
        while course.step < self.model.episode.length {
            let likely = (self.share * counts).min(1.0);
            let own = policy.action_in_full(&course.held);
            if uniform(&mut whims) < likely {
                // The same draws for every action, and others than those of the episode itself.
                let number = episode
                    .wrapping_mul(self.model.episode.length as u64)
                    .wrapping_add(course.step as u64);
                let tried = |action| {
                    branch.go_back_to(&course);
                    let mut draws = Streams::new(!seed, number);
                    let earned = branch.followed(policy, action, &mut draws);
                    (earned, branch.step - course.step)
                };
                let tried: Vec<(f64, usize)> = (0..self.model.actions.len()).map(tried).collect();
                steps += tried.iter().map(|(_, steps)| steps).sum::<usize>();
                let values: Vec<f64> = tried.iter().map(|(earned, _)| *earned).collect();
                judged.push(Judged {
                    belief: course.held.belief().clone(),
                    moments: course.held.moments().cloned(),
                    value: Some(values[own]),
                    values,
                    counts: counts / likely,
                });
            }
            counts *= self.model.discount;
            if !course.take(own, &mut draws).goes_on {
                break;
            }
        }
        (judged, steps + course.step)
    }
}

impl Common<'_> {
    /// The same episode for those who do something else from here on.
    fn parted(&self, who: Vec<usize>) -> Self {
        let mut course = self.course.runs.start(&mut self.draws.fork());
        course.go_back_to(&self.course);
        Self {
            course,
            draws: self.draws.fork(),
            who,
            ..*self
        }
    }
}

impl<'a> Course<'a> {
    /// The same episode at the same step as another, to be gone on with otherwise.
    fn go_back_to(&mut self, other: &Self) {
        self.world.resume(&other.world);
        self.updater = other.updater;
        self.held.clone_from(&other.held);
        self.step = other.step;
    }

    fn take(&mut self, action: ActionId, draws: &mut Streams) -> Paid {
        let expected = self.updater.act(&mut self.held, action);
        let step = self.world.step(action, draws, &mut self.observation);
        match (step.then, expected.is_some()) {
            (Then::Continue, true) => {
                let reading = self.observation.reading();
                self.updater.sense(&mut self.held, action, reading);
            }
            (Then::Continue, false) => {
                let reading = self.observation.reading();
                self.updater.update(&mut self.held, action, reading);
            }
            (Then::Restart, _) => self.updater.reset(&mut self.held),
            (Then::End, _) => {}
        }
        self.step += 1;
        Paid {
            reward: expected.map_or(step.reward, |expected| expected.reward),
            goes_on: step.then != Then::End && is_kept(&self.held.belief().mean),
        }
    }

    /// Takes an action, goes on by a policy, and returns what that earns from here; no further than where what is left counts for little.
    fn followed(&mut self, policy: &dyn Policy, first: ActionId, draws: &mut Streams) -> f64 {
        let model = self.runs.model;
        let (mut earned, mut counts, mut next) = (0.0, 1.0, Some(first));
        while self.step < model.episode.length && counts >= LITTLE {
            let own = || policy.action_in_full(&self.held);
            let action = next.take().unwrap_or_else(own);
            let paid = self.take(action, draws);
            earned += counts * paid.reward;
            counts *= model.discount;
            if !paid.goes_on {
                break;
            }
        }
        earned + counts * self.world.ending()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::Belief;
    use crate::progress::Silent;
    use crate::scenario::find;
    use crate::simulate::{Options, evaluate};
    use crate::solve::{Planner, PointBased, Problem, Request};

    const BUDGET: Budget = Budget {
        episodes: 40,
        steps: 20_000,
    };

    /// Does one thing everywhere.
    struct Always(ActionId);

    impl Policy for Always {
        fn action(&self, _: &Belief) -> ActionId {
            self.0
        }
    }

    fn alone(
        space: &dyn BeliefSpace,
        policy: &dyn Policy,
        other: Option<&[f64]>,
        seed: u64,
    ) -> Vec<f64> {
        returns(space, &[policy], BUDGET, seed, other).concat()
    }

    /// Up to a place, then down.
    struct UpTo(f64);

    impl Policy for UpTo {
        fn action(&self, belief: &Belief) -> ActionId {
            if belief.mean[0] < self.0 { 1 } else { 0 }
        }
    }

    #[test]
    fn who_runs_together_earns_what_each_earns_alone() {
        let model = find("light-dark-5").unwrap().model;
        let space = cells_of(&model);
        let space = space.as_ref();
        let (here, there) = (UpTo(3.0), UpTo(4.5));
        let policies: [&dyn Policy; 4] = [&here, &Always(1), &there, &here];
        let mut together = returns(space, &policies, BUDGET, 1, None);
        let each: Vec<Vec<f64>> = policies
            .iter()
            .map(|policy| alone(space, *policy, None, 1))
            .collect();
        assert_eq!(together, each);
        assert_ne!(each[0], each[2]);
        // They go on from where each of them is.
        together[2].truncate(10);
        together[3].truncate(100);
        more_returns(space, &policies, 300, 1, &mut together);
        for (policy, together) in policies.iter().zip(&together) {
            let mut own = vec![Vec::new()];
            more_returns(space, &[*policy], 300.max(together.len()), 1, &mut own);
            assert_eq!(*together, own[0]);
        }
    }

    #[test]
    fn what_is_expected_is_what_is_earned() {
        let model = find("light-dark-5").unwrap().model;
        let planner = PointBased {
            beliefs: 100,
            rounds: 4,
            ..PointBased::default()
        };
        let request = Request {
            runs: 100,
            ..Request::default()
        };
        let plan = crate::solve::plan(&planner, &model, &request, &Silent).unwrap();
        let automaton = plan.automaton().unwrap();
        let space = automaton.space(&model);
        let returns = alone(space.as_ref(), automaton, None, 3);
        let expected = Estimate::of(returns.iter().copied());
        let options = Options {
            episodes: 4000,
            seed: 5,
        };
        let assumed = Scenario::assumed(&model);
        let earned = evaluate(&assumed, &automaton.updater, automaton, options, &Silent);
        // An error rate of 1e-4.
        let apart = (expected.mean - earned.discounted.mean).abs();
        let error = expected.stderr.hypot(earned.discounted.stderr);
        assert!(apart < 4.0 * error, "{expected:?}, {earned:?}");
        assert!(expected.stderr > 0.0);
    }

    #[test]
    fn who_is_plainly_worse_is_not_run_to_the_end() {
        let model = find("light-dark-5").unwrap().model;
        let space = cells_of(&model);
        let up = alone(space.as_ref(), &Always(1), None, 1);
        assert_eq!(up, vec![0.0; 208], "a hundred steps each, 16 at a time");
        let stop = alone(space.as_ref(), &Always(0), Some(&up), 1);
        assert!(stop.len() < 100 && gain(&stop, &up).mean < 0.0);
        let same = alone(space.as_ref(), &Always(2), Some(&up), 1);
        assert_eq!(gain(&same, &up), Estimate::of([0.0, 0.0].into_iter()));
        assert_eq!(same.len(), up.len());
    }

    fn cells_of(model: &Model) -> Box<dyn BeliefSpace> {
        let request = Request::default();
        let planner = PointBased {
            beliefs: 1,
            rounds: 1,
            ..PointBased::default()
        };
        let plan = planner
            .plan(&Problem::new(model, &request), &Silent)
            .unwrap();
        match plan.policy {
            crate::solve::Found::Rule { space, .. } => space,
            _ => panic!("a rule"),
        }
    }

    #[test]
    fn deviating_costs_what_the_first_step_does_where_all_else_is_the_same() {
        // To stop pays at once; whoever goes UP first and then for ever is paid nothing.
        let model = find("light-dark-5").unwrap().model;
        let space = cells_of(&model);
        let up = Always(1);
        let judged = deviations(space.as_ref(), &up, 60, BUDGET, 1);
        assert!(judged.len() >= 60);
        let counted: f64 = judged.iter().map(|judged| judged.counts).sum();
        assert!((counted - 10.0).abs() < 3.0, "{counted}");
        for judged in judged {
            assert_eq!(judged.values[1..], [0.0, 0.0]);
            assert_eq!(judged.value, Some(0.0));
            assert!(judged.values[0].abs() < 10.0 + 1e-9, "{judged:?}");
        }
    }
}
