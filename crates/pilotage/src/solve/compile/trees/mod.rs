//! From a policy with values to a small decision tree.
//!
//! 1. **Imitate.** Beliefs are collected by acting, each with what the policy expects of every action. The tree grows where a wrong action costs
//!    most. Then the tree itself is run, and the beliefs *it* meets, which are others than those of the policy, are added: what is imitated
//!    has to be right where the imitator goes (S. Ross, G. Gordon and D. Bagnell, 2011; with costs for weights, O. Bastani, Y. Pu and
//!    A. Solar-Lezama, 2018).
//! 2. **Improve.** The policy sees more of a belief than a tree can ask, so what it expects is not what the tree will earn. The tree is run again,
//!    and from the beliefs it meets each action is tried once before the tree goes on ([`deviation`]). The next tree is grown on what that
//!    earned, summed over the last rounds (as Y. Abbasi-Yadkori and others do over all, "POLITEX", 2019), as long as that helps. Where beliefs
//!    are slow too few actions can be tried for that, and the time is spent on more to imitate.
//! 3. **Choose.** Trees of many sizes are run in the same episodes; the best go on to ever more of them, half of them at a time (Z. Karnin,
//!    T. Koren and O. Somekh, 2013), and the smallest is taken that earns hardly less than the one that is left.

mod collected;
mod cuts;
mod growth;
mod shape;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use crate::belief::{BeliefSpace, Pace};
use crate::policy::{
    Automaton, AutomatonRunner, Branch, Matching, Node, Place, Policy, Term, Test, Tree,
};
use crate::solve::deviation::{self, Budget};
use crate::solve::rollout::{self, Judged};
use collected::{Collected, Members};
use growth::{Growth, cheapest_of};
use shape::{Shape, Spot};

/// How small a tree has to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    /// Most nodes, at least 1.
    pub nodes: usize,
    /// Return that may be lost, as a share of that of the best tree.
    pub loss: f64,
}

/// Rounds in which the policy is imitated.
const IMITATING: usize = 3;

/// So many times more episodes are run in them where nothing is improved afterwards.
const ALONE: usize = 3;

/// Most rounds in which the tree is improved on what it earns, and how many of the last the next tree is grown on.
const IMPROVING: usize = 12;
const KEPT: usize = 3;

/// A round that gains no more than this share of what is earned is a quiet one.
const GAIN: f64 = 2e-3;

/// Beliefs judged in a round of imitation for each episode, and where these are cells about which the policy is asked in full, which takes
/// far longer; and how many are enough in any case.
const JUDGED: f64 = 20.0;
const IN_FULL: f64 = 1.5;
const ENOUGH: usize = 10_000;

/// Beliefs in a round of improvement, and steps, for each episode.
const DEVIATIONS: f64 = 10.0;
const STEPS: f64 = 125.0;

/// Steps for each episode by which a tree is compared.
const TRIAL_STEPS: f64 = 12.5;

/// Trees that are compared in more episodes once all have been tried. Half of them go on to twice as many, as often as that leaves one.
const FINALISTS: usize = 8;

/// So many times fewer episodes are run where a step of the belief takes far longer than elsewhere, and so many times more where it takes
/// next to nothing.
const SLOWER: usize = 10;
const FASTER: usize = 4;

/// Trees that may be no better than those before, one after the other, until no larger one is tried.
const PATIENCE: usize = 4;

/// Trees of up to so many nodes are tried in any case: where it takes many questions to earn anything, a few are as bad as none.
const FEW: usize = 19;

/// A limit beyond which it need not be tried itself.
const LARGE: usize = 500;

/// Grows a tree for a policy, and gives it to the automaton as its nodes.
pub(super) fn grow(
    automaton: &mut Automaton,
    policy: &dyn Policy,
    space: &dyn BeliefSpace,
    size: Size,
    (episodes, seed): (usize, u64),
) {
    automaton.matching = Matching::Tree;
    let pace = space.updater().pace();
    let start = automaton.updater.start();
    let knows_values =
        policy.values_in_full(&start).is_some() || policy.action_value(start.belief(), 0).is_some();
    let search = Search {
        policy,
        space,
        size,
        improves: knows_values && pace != Pace::Slow,
        episodes: match pace {
            Pace::Fast => FASTER * episodes,
            Pace::Usual => episodes,
            Pace::Slow => episodes.div_ceil(SLOWER),
        },
        seed,
        bare: automaton.clone(),
    };
    let mut trials = Trials::default();
    search.imitate(&mut trials);
    if search.improves {
        search.improve(&mut trials);
    }
    search.compare(&mut trials);
    if let Some(chosen) = search.smallest(&mut trials) {
        *automaton = chosen;
    }
}

struct Search<'a> {
    policy: &'a dyn Policy,
    space: &'a dyn BeliefSpace,
    size: Size,
    /// Not where the policy says only what to do, and not what that is worth: it is to be imitated. And not where beliefs are slow: so few
    /// actions could be tried that what they earn would say nothing.
    improves: bool,
    episodes: usize,
    seed: u64,
    /// The automaton, which has no nodes yet.
    bare: Automaton,
}

/// A tree with what it earns in each of some episodes, which are the same for all.
struct Tried {
    returns: Vec<f64>,
    tree: Automaton,
}

impl Tried {
    fn earned(&self) -> f64 {
        self.returns.iter().sum::<f64>() / self.returns.len() as f64
    }
}

/// Trees that were tried, and which of them earns most.
#[derive(Default)]
struct Trials {
    tried: Vec<Tried>,
    best: usize,
}

impl Trials {
    fn best(&self) -> Option<&Tried> {
        self.tried.get(self.best)
    }

    /// Whether the best earns more than these returns, by more than a share of it.
    fn gained(&self, before: &[f64]) -> bool {
        self.best().is_some_and(|best| {
            let gain = deviation::gain(&best.returns, before);
            gain.mean > GAIN * best.earned().abs()
        })
    }

    fn add(&mut self, tried: Tried) {
        let better = self
            .best()
            .is_none_or(|best| deviation::gain(&tried.returns, &best.returns).mean > 0.0);
        if better {
            self.best = self.tried.len();
        }
        self.tried.push(tried);
    }

    /// The smallest tree that earns hardly less than the best: by at most a share of what that earns.
    fn smallest(&self, loss: f64) -> Option<usize> {
        let best = self.best()?;
        let earned = best.earned();
        let lost = |tried: &Tried| -deviation::gain(&tried.returns, &best.returns).mean;
        let enough = |&i: &usize| lost(&self.tried[i]) <= loss * earned.abs();
        let order = |a: &Tried, b: &Tried| {
            let nodes = a.tree.nodes.len().cmp(&b.tree.nodes.len());
            nodes.then(lost(a).total_cmp(&lost(b)))
        };
        let kept = (0..self.tried.len()).filter(enough);
        kept.min_by(|&a, &b| order(&self.tried[a], &self.tried[b]))
    }

    /// Trees from the one that earns most, against the best, to the one that earns least; so many of them.
    fn ranked(&self, most: usize) -> Vec<usize> {
        let Some(best) = self.best() else {
            return Vec::new();
        };
        let gain = |i: &usize| deviation::gain(&self.tried[*i].returns, &best.returns).mean;
        let mut ranked: Vec<usize> = (0..self.tried.len()).collect();
        ranked.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        // Trees that do the same are one.
        ranked.dedup_by(|a, b| self.tried[*a].returns == self.tried[*b].returns);
        ranked.truncate(most);
        ranked
    }
}

impl Search<'_> {
    fn times(&self, each: f64) -> usize {
        (each * self.episodes as f64).ceil() as usize
    }

    /// As many steps for each episode that was asked for; a fiftieth of the episodes, 4 to 40, in any case.
    fn budget(&self, steps: f64) -> Budget {
        Budget {
            episodes: (self.episodes / 50).clamp(4, 40),
            steps: self.times(steps),
        }
    }

    /// Trees grown on what the policy expects at the beliefs that they meet. Where that is all there is, more is made of it: more beliefs are
    /// looked at, and the trees of every round are tried.
    fn imitate(&self, trials: &mut Trials) {
        let length = self.space.model().episode.length;
        let start = self.bare.updater.start();
        let in_full = start.cells().is_some() && self.policy.values_in_full(&start).is_some();
        let each = if in_full { IN_FULL } else { JUDGED };
        let more = if self.improves { 1 } else { ALONE };
        let most = self.times(more as f64 * each).min(ENOUGH);
        let runs = (more * self.episodes, length);
        let mut collected = Collected::new(self.space, &self.bare);
        let mut tree: Option<Automaton> = None;
        for round in 0..IMITATING {
            let runner = tree.as_ref().map(AutomatonRunner::new);
            let imitator = runner.as_ref().map_or(self.policy, |runner| runner);
            let seed = self.seed.wrapping_add(round as u64);
            collected.extend(rollout::judged(
                self.space,
                (imitator, self.policy),
                runs,
                most,
                seed,
            ));
            let is_last = round + 1 == IMITATING;
            if is_last || !self.improves {
                self.try_sizes(&collected, trials);
            }
            if !is_last {
                let all = collected.all();
                let mut growths = Growth::straight_and_slanted(&collected, &all);
                tree = Some(self.of_size((&collected, &all), &mut growths, self.imitated()));
            }
        }
    }

    /// Nodes of a tree that collects beliefs for the next.
    fn imitated(&self) -> usize {
        const MANY: usize = 40;
        self.size.nodes.min(MANY)
    }

    /// Trees grown on what the best so far earns if it once does something else, until none is better twice in a row.
    fn improve(&self, trials: &mut Trials) {
        let most = self.times(DEVIATIONS);
        let budget = self.budget(STEPS);
        let mut kept: VecDeque<Vec<Judged>> = VecDeque::new();
        let mut quiet = 0;
        for round in 0..IMPROVING {
            let Some(best) = trials.best() else { return };
            let earned = best.returns.clone();
            let runner = AutomatonRunner::new(&best.tree);
            let seed = self.seed.wrapping_add((IMITATING + round) as u64);
            let judged = deviation::deviations(self.space, &runner, most, budget, seed);
            kept.push_back(judged);
            if kept.len() > KEPT {
                kept.pop_front();
            }
            let mut collected = Collected::new(self.space, &self.bare);
            collected.extend(kept.iter().flatten().cloned());
            self.try_sizes(&collected, trials);
            quiet = if trials.gained(&earned) { 0 } else { quiet + 1 };
            if quiet == 2 {
                return;
            }
        }
    }

    /// Tries trees of many sizes, as far as larger ones earn more.
    fn try_sizes(&self, collected: &Collected, trials: &mut Trials) {
        let all = collected.all();
        let mut growths = Growth::straight_and_slanted(collected, &all);
        let sizes = sizes(self.size.nodes);
        let mut left = sizes.as_slice();
        let first = trials.tried.len();
        let (mut best, mut since) = (first, 0);
        while !left.is_empty() && since < PATIENCE {
            // So many are tried whatever they earn.
            let few = left.iter().take_while(|&&nodes| nodes < FEW).count();
            let (now, later) = left.split_at((few + 1).max(PATIENCE - since).min(left.len()));
            left = later;
            let mut fresh: Vec<Option<Automaton>> = Vec::new();
            for &nodes in now {
                let tree = self.of_size((collected, &all), &mut growths, nodes);
                let tried = trials.tried[first..].iter().map(|tried| &tried.tree);
                let mut known = tried.chain(fresh.iter().flatten());
                let is_known = known.any(|known| known.tree == tree.tree);
                fresh.push((!is_known).then_some(tree));
            }
            let trees: Vec<&Automaton> = fresh.iter().flatten().collect();
            let mut earned = self.returns(&trees, trials).into_iter();
            for tree in fresh {
                since += 1;
                let Some((tree, returns)) = tree.and_then(|tree| Some((tree, earned.next()?)))
                else {
                    continue;
                };
                trials.add(Tried { returns, tree });
                let new = trials.tried.len() - 1;
                let returns = |i: usize| &trials.tried[i].returns;
                if new == first || deviation::gain(returns(new), returns(best)).mean > 0.0 {
                    (best, since) = (new, 0);
                }
            }
        }
    }

    /// What trees earn where the model holds, in the same episodes as every other.
    fn returns(&self, trees: &[&Automaton], trials: &Trials) -> Vec<Vec<f64>> {
        let seed = self.trial_seed();
        let other = trials.best().map(|best| best.returns.as_slice());
        let runners: Vec<AutomatonRunner> = trees
            .iter()
            .map(|tree| AutomatonRunner::new(tree))
            .collect();
        let policies: Vec<&dyn Policy> =
            runners.iter().map(|runner| runner as &dyn Policy).collect();
        deviation::returns(self.space, &policies, self.budget(TRIAL_STEPS), seed, other)
    }

    /// Finds the best of the trees that were tried, in more episodes.
    fn compare(&self, trials: &mut Trials) {
        let mut finalists = trials.ranked(FINALISTS);
        while finalists.len() > 1 {
            let longest = finalists.iter().map(|&i| trials.tried[i].returns.len());
            let episodes = 2 * longest.max().unwrap_or(0);
            self.go_on(trials, &finalists, episodes);
            let earned = |i: usize| trials.tried[i].earned();
            finalists.sort_by(|&a, &b| earned(b).total_cmp(&earned(a)));
            finalists.truncate(finalists.len().div_ceil(2));
            trials.best = finalists[0];
        }
    }

    /// The smallest tree that earns hardly less than the best, in as many episodes as that.
    fn smallest(&self, trials: &mut Trials) -> Option<Automaton> {
        loop {
            let chosen = trials.smallest(self.size.loss)?;
            let episodes = trials.best()?.returns.len();
            let tried = &trials.tried[chosen];
            if tried.returns.len() >= episodes {
                return Some(tried.tree.clone());
            }
            self.go_on(trials, &[chosen], episodes);
        }
    }

    /// Runs some of the trees that were tried in more episodes.
    fn go_on(&self, trials: &mut Trials, who: &[usize], episodes: usize) {
        let own = |&i: &usize| std::mem::take(&mut trials.tried[i].returns);
        let mut returns: Vec<Vec<f64>> = who.iter().map(own).collect();
        let runner = |&i: &usize| AutomatonRunner::new(&trials.tried[i].tree);
        let runners: Vec<AutomatonRunner> = who.iter().map(runner).collect();
        let policies: Vec<&dyn Policy> =
            runners.iter().map(|runner| runner as &dyn Policy).collect();
        let seed = self.trial_seed();
        deviation::more_returns(self.space, &policies, episodes, seed, &mut returns);
        for (&i, returns) in who.iter().zip(returns) {
            trials.tried[i].returns = returns;
        }
    }

    fn trial_seed(&self) -> u64 {
        self.seed.wrapping_add((IMITATING + IMPROVING) as u64)
    }

    /// A tree of at most so many nodes, grown larger before it is cut back.
    fn of_size(
        &self,
        (collected, all): (&Collected, &Members),
        growths: &mut [Growth<'_>; 2],
        nodes: usize,
    ) -> Automaton {
        let shape = cheapest_of(growths, (collected, all), larger(nodes), nodes);
        let mut tree = self.bare.clone();
        write(&shape, collected, &mut tree);
        tree
    }
}

/// Leaves to which a tree is grown before it is cut back to so many.
fn larger(nodes: usize) -> usize {
    nodes + (nodes / 2 + 4).min(16)
}

/// Numbers of nodes that are tried: each about half more than the one before, up to the most.
fn sizes(most: usize) -> Vec<usize> {
    let mut sizes = vec![1];
    while let Some(&last) = sizes.last() {
        let next = (last + 1).max(last * 3 / 2);
        if next > most {
            break;
        }
        sizes.push(next);
    }
    if sizes.last() != Some(&most) && most < LARGE {
        sizes.push(most);
    }
    sizes
}

/// Gives tests and nodes to an automaton, in the order of a walk through the tree.
fn write(shape: &Shape, collected: &Collected, automaton: &mut Automaton) {
    let members = shape.members(collected);
    let mut tree = Tree::default();
    automaton.nodes.clear();
    walk(shape, 0, &mut tree, collected, &mut |spot, action| {
        automaton
            .nodes
            .push(node(&members[spot], action, collected));
        automaton.nodes.len() - 1
    });
    automaton.tree = Some(tree);
}

fn walk(
    shape: &Shape,
    spot: usize,
    tree: &mut Tree,
    collected: &Collected,
    add: &mut dyn FnMut(usize, usize) -> usize,
) -> Branch {
    match shape.spots[spot] {
        Spot::Leaf(action) => Branch::Node(add(spot, action)),
        Spot::Test(cut, ends) => {
            let number = tree.tests.len();
            let term = |(times, feature): (f64, usize)| Term {
                times,
                feature: collected.features[feature],
            };
            tree.tests.push(Test {
                feature: collected.features[cut.along.feature],
                plus: cut.along.plus.map(term).into_iter().collect(),
                less_than: cut.less_than,
                yes: Branch::Node(0),
                no: Branch::Node(0),
            });
            let [yes, no] = ends.map(|end| walk(shape, end, tree, collected, add));
            tree.tests[number].yes = yes;
            tree.tests[number].no = no;
            Branch::Test(number)
        }
    }
}

/// The node of a leaf: where the beliefs that were met in it lie.
fn node(members: &[u32], action: usize, collected: &Collected) -> Node {
    let met = || {
        let members = members.iter().map(|member| *member as usize);
        members.map(|member| (&collected.beliefs[member], collected.values[member]))
    };
    let n = collected
        .beliefs
        .first()
        .map_or(0, |belief| belief.mean.len());
    let (mut lower, mut upper) = (vec![f64::INFINITY; n], vec![f64::NEG_INFINITY; n]);
    let mut middle = vec![0.0; n];
    let (mut first, mut last) = (usize::MAX, 0);
    let mut modes: Vec<usize> = Vec::new();
    let mut value = 0.0;
    let mut known = true;
    let count = members.len().max(1) as f64;
    for (belief, worth) in met() {
        for i in 0..n {
            lower[i] = lower[i].min(belief.mean[i]);
            upper[i] = upper[i].max(belief.mean[i]);
            middle[i] += belief.mean[i] / count;
        }
        (first, last) = (first.min(belief.stratum), last.max(belief.stratum));
        modes.resize(modes.len().max(belief.mode + 1), 0);
        modes[belief.mode] += 1;
        match worth {
            Some(worth) => value += worth / count,
            None => known = false,
        }
    }
    for i in 0..n {
        middle[i] = middle[i].clamp(lower[i], upper[i]);
    }
    let mode = (0..modes.len()).max_by_key(|&mode| (modes[mode], std::cmp::Reverse(mode)));
    let place = Place::Segment {
        lower,
        minimum: middle,
        upper,
    };
    let levels = first.min(last)..=last;
    Node::new(
        levels,
        mode.unwrap_or(0),
        place,
        action,
        known.then_some(value),
    )
}
