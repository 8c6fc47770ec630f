//! From a policy with values to a small decision tree.
//!
//! Beliefs are collected by acting, each with what every action would cost against the best one. The tree grows where that saves most, a
//! test at a time. Then the tree itself is run, and the beliefs *it* meets, which are others than those of the policy, are added: what
//! is imitated has to be right where the imitator goes (S. Ross, G. Gordon and D. Bagnell, 2011; with costs for weights, O. Bastani,
//! Y. Pu and A. Solar-Lezama, 2018).

use crate::belief::{Belief, BeliefSpace};
use crate::model::ActionId;
use crate::parallel;
use crate::policy::{
    Automaton, AutomatonRunner, Branch, Feature, Matching, Node, Place, Policy, StratumFeatures,
    Test, Tree,
};
use crate::progress::Silent;
use crate::scenario::Scenario;
use crate::simulate::{Options, evaluate};
use crate::solve::rollout;

/// How small a tree has to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    /// Most nodes, at least 1.
    pub nodes: usize,
    /// Return that may be lost, as a share of that of the policy; a tree that loses less is not grown further.
    pub loss: f64,
}

/// Times that the beliefs the tree meets are added.
const ROUNDS: usize = 4;

/// Most beliefs that are collected in a round.
const MOST: usize = 40_000;

/// Most beliefs in full that are judged in a round.
const MOST_JUDGED: usize = 12_000;

/// A leaf has at least this share of all weight.
const LEAST: f64 = 2e-5;

/// Beliefs with what actions cost there.
struct Collected {
    beliefs: Vec<Belief>,
    /// By feature and belief.
    features: Vec<Vec<f64>>,
    /// By belief and action: what is lost by the action, times how much the belief counts.
    costs: Vec<f64>,
    /// How much each belief counts: its discount, divided by the number of episodes.
    counts: Vec<f64>,
    /// What the policy expects from each belief, where it knows.
    values: Vec<Option<f64>>,
}

/// A leaf while the tree grows.
struct Leaf {
    members: Vec<u32>,
    action: ActionId,
    cost: f64,
    split: Option<Split>,
    /// The test it hangs from, and on which side.
    parent: Option<(usize, bool)>,
}

/// The best test of a leaf.
#[derive(Clone, Copy)]
struct Split {
    feature: usize,
    less_than: f64,
    saved: f64,
}

/// Grows a tree for a policy, and gives it to the automaton as its nodes.
pub(super) fn grow(
    automaton: &mut Automaton,
    policy: &dyn Policy,
    space: &dyn BeliefSpace,
    size: Size,
    (episodes, seed): (usize, u64),
) {
    let features = features(space, automaton);
    let strata: Vec<StratumFeatures> = (0..space.strata())
        .map(|stratum| StratumFeatures::of(automaton, stratum))
        .collect();
    let actions = space.model().actions.len();
    let value = policy.value(space.start()).map_or(0.0, f64::abs);
    let mut collected = Collected {
        beliefs: Vec::new(),
        features: vec![Vec::new(); features.len()],
        costs: Vec::new(),
        counts: Vec::new(),
        values: Vec::new(),
    };
    let in_full = policy.values_in_full(&space.updater().start()).is_some();
    automaton.matching = Matching::Tree;
    for round in 0..ROUNDS {
        let imitator: &dyn Policy = if round == 0 {
            policy
        } else {
            &automaton.clone()
        };
        let length = space.model().episode.length;
        let seed = seed.wrapping_add(round as u64);
        let feature = |belief: &Belief, i: usize| strata[belief.stratum].value(features[i], belief);
        if in_full {
            let runs = (episodes, length);
            let judged = rollout::judged(space, (imitator, policy), runs, MOST_JUDGED, seed);
            for rollout::Judged {
                belief,
                values,
                counts,
            } in judged
            {
                let best = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let costs = values.into_iter().map(|value| counts * (best - value));
                collected.push(belief, costs, counts, Some(best), feature);
            }
        } else {
            let updater = space.updater();
            let runs = rollout::decisions(space, &updater, imitator, episodes, length, seed);
            collected.add(&runs, policy, actions, space.model().discount, feature);
        }
        // What was collected so far is the return that episodes of all rounds lose together.
        let allowed = size.loss * value * (round + 1) as f64;
        let grown = Grown::new(&collected, actions, size.nodes, allowed);
        grown.write(automaton, &collected, &features);
    }
    let of_size = |nodes: usize| {
        let mut tree = automaton.clone();
        let grown = Grown::new(&collected, actions, nodes, 0.0);
        grown.write(&mut tree, &collected, &features);
        tree
    };
    *automaton = smallest(space, size, (episodes.min(TRIALS), seed), &of_size);
}

/// The smallest tree that earns hardly less than the best, in the same episodes of the world that the model assumes: what a plan says of its
/// own losses is off by as much as the plan.
fn smallest(
    space: &dyn BeliefSpace,
    size: Size,
    (episodes, seed): (usize, u64),
    of_size: &dyn Fn(usize) -> Automaton,
) -> Automaton {
    let assumed = Scenario::assumed(space.model());
    let options = Options {
        episodes,
        seed: seed.wrapping_add(ROUNDS as u64),
    };
    let mut tried: Vec<(f64, Automaton)> = Vec::new();
    let mut best = f64::NEG_INFINITY;
    let mut since = 0;
    for nodes in sizes(size.nodes) {
        let tree = of_size(nodes);
        let grew = tried
            .last()
            .is_none_or(|(_, last)| tree.nodes.len() > last.nodes.len());
        if grew {
            let runner = AutomatonRunner::new(&tree);
            let earned = evaluate(&assumed, &tree.updater, &runner, options, &Silent);
            let earned = earned.discounted.mean;
            since = if earned > best + 0.1 * size.loss * best.abs() {
                0
            } else {
                since + 1
            };
            best = best.max(earned);
            tried.push((earned, tree));
        }
        if since >= PATIENCE || (!grew && nodes > 4 * tried.len()) {
            break;
        }
    }
    let enough = best - size.loss * best.abs();
    let chosen = tried
        .iter()
        .position(|(earned, _)| *earned >= enough)
        .unwrap_or(0);
    tried.swap_remove(chosen).1
}

/// Numbers of nodes that are tried: each about a third more than the one before, up to the most.
fn sizes(most: usize) -> Vec<usize> {
    let mut sizes = vec![1];
    while let Some(&last) = sizes.last() {
        let next = (last + 1).max(last * 4 / 3);
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

/// Most episodes by which trees are compared.
const TRIALS: usize = 2000;

/// Trees that may be no better than those before, one after the other, until no larger one is tried.
const PATIENCE: usize = 6;

/// A limit beyond which it need not be tried itself.
const LARGE: usize = 500;

/// What the tree may ask: means, deviations where strata differ in them, modes where there are several.
fn features(space: &dyn BeliefSpace, automaton: &Automaton) -> Vec<Feature> {
    let n = space.model().state_dim();
    let means = (0..n).map(Feature::Mean);
    let deviations = (0..n).map(Feature::Deviation);
    let modes = match automaton.modes.len() {
        0 | 1 => 0..0,
        2 => 1..2,
        modes => 0..modes,
    };
    means
        .chain(deviations)
        .chain(modes.map(Feature::Mode))
        .collect()
}

impl Collected {
    fn add(
        &mut self,
        runs: &[Vec<rollout::Decision>],
        policy: &dyn Policy,
        actions: usize,
        discount: f64,
        feature: impl Fn(&Belief, usize) -> f64 + Sync,
    ) {
        let all: usize = runs.iter().map(Vec::len).sum();
        let stride = all.div_ceil(MOST).max(1);
        let share = stride as f64 / runs.len().max(1) as f64;
        let chosen: Vec<(&Belief, f64)> = runs
            .iter()
            .flat_map(|run| run.iter().enumerate())
            .enumerate()
            .filter(|(number, _)| number % stride == 0)
            .map(|(_, (step, decision))| (&decision.belief, share * discount.powi(step as i32)))
            .collect();
        let judged = parallel::map(chosen.len(), |i| {
            let (belief, counts) = chosen[i];
            let costs = costs(policy, belief, actions).into_iter();
            let costs: Vec<f64> = costs.map(|cost| counts * cost).collect();
            (costs, policy.value(belief))
        });
        for ((belief, counts), (costs, value)) in chosen.into_iter().zip(judged) {
            self.push(belief.clone(), costs.into_iter(), counts, value, &feature);
        }
    }

    fn push(
        &mut self,
        belief: Belief,
        costs: impl Iterator<Item = f64>,
        counts: f64,
        value: Option<f64>,
        feature: impl Fn(&Belief, usize) -> f64,
    ) {
        for (i, values) in self.features.iter_mut().enumerate() {
            values.push(feature(&belief, i));
        }
        self.beliefs.push(belief);
        self.costs.extend(costs);
        self.counts.push(counts);
        self.values.push(value);
    }
}

/// What every action loses against the best one: 1 for all but the policy's own where it knows no values.
fn costs(policy: &dyn Policy, belief: &Belief, actions: usize) -> Vec<f64> {
    let values: Option<Vec<f64>> = (0..actions)
        .map(|action| policy.action_value(belief, action))
        .collect();
    match values {
        Some(values) => {
            let best = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            values.into_iter().map(|value| best - value).collect()
        }
        None => {
            let own = policy.action(belief);
            (0..actions)
                .map(|action| f64::from(action != own))
                .collect()
        }
    }
}

/// A tree as it grows.
struct Grown<'a> {
    collected: &'a Collected,
    actions: usize,
    leaves: Vec<Leaf>,
    /// Feature and number of each test, with where it leads: a test or a leaf on either side.
    tests: Vec<(usize, f64, [Option<End>; 2])>,
}

#[derive(Clone, Copy)]
enum End {
    Test(usize),
    Leaf(usize),
}

impl<'a> Grown<'a> {
    fn new(collected: &'a Collected, actions: usize, nodes: usize, allowed: f64) -> Self {
        let mut grown = Self {
            collected,
            actions,
            leaves: Vec::new(),
            tests: Vec::new(),
        };
        let all = (0..collected.beliefs.len() as u32).collect();
        let first = grown.leaf(all, None);
        grown.leaves.push(first);
        while grown.leaves.len() < nodes {
            let lost: f64 = grown.leaves.iter().map(|leaf| leaf.cost).sum();
            if lost <= allowed {
                break;
            }
            let saved = |leaf: &Leaf| leaf.split.map_or(0.0, |split| split.saved);
            let best = (0..grown.leaves.len()).max_by(|&a, &b| {
                saved(&grown.leaves[a])
                    .total_cmp(&saved(&grown.leaves[b]))
                    .then(b.cmp(&a))
            });
            let Some(best) = best.filter(|&leaf| saved(&grown.leaves[leaf]) > 0.0) else {
                break;
            };
            grown.split(best);
        }
        grown.prune();
        grown
    }

    fn leaf(&self, members: Vec<u32>, parent: Option<(usize, bool)>) -> Leaf {
        let mut sums = vec![0.0; self.actions];
        for member in &members {
            let row = *member as usize * self.actions;
            for (sum, cost) in sums.iter_mut().zip(&self.collected.costs[row..]) {
                *sum += cost;
            }
        }
        let action = cheapest(&sums);
        Leaf {
            split: self.best_split(&members, sums[action], &sums),
            cost: sums[action],
            action,
            members,
            parent,
        }
    }

    /// The test that saves most, if any does.
    fn best_split(&self, members: &[u32], cost: f64, sums: &[f64]) -> Option<Split> {
        if cost <= 0.0 || members.len() < 2 {
            return None;
        }
        let of = |feature: usize| self.best_of(feature, members, cost, sums);
        let splits = parallel::map(self.collected.features.len(), of);
        let better = |best: Option<Split>, split: Split| match best {
            Some(best) if best.saved >= split.saved => Some(best),
            _ => Some(split),
        };
        splits.into_iter().flatten().fold(None, better)
    }

    fn best_of(&self, feature: usize, members: &[u32], cost: f64, sums: &[f64]) -> Option<Split> {
        let values = &self.collected.features[feature];
        let mut order: Vec<u32> = members.to_vec();
        order.sort_by(|&a, &b| {
            values[a as usize]
                .total_cmp(&values[b as usize])
                .then(a.cmp(&b))
        });
        let all: f64 = self.collected.counts.iter().sum();
        let own: f64 = members
            .iter()
            .map(|m| self.collected.counts[*m as usize])
            .sum();
        let (mut below, mut counted) = (vec![0.0; self.actions], 0.0);
        let mut best: Option<Split> = None;
        for pair in order.windows(2) {
            let (here, next) = (pair[0] as usize, pair[1] as usize);
            for (sum, cost) in below
                .iter_mut()
                .zip(&self.collected.costs[here * self.actions..])
            {
                *sum += cost;
            }
            counted += self.collected.counts[here];
            let least = LEAST * all;
            if values[here] >= values[next] || counted < least || own - counted < least {
                continue;
            }
            let lower = below.iter().copied().fold(f64::INFINITY, f64::min);
            let upper = below.iter().zip(sums).map(|(below, sum)| sum - below);
            let saved = cost - lower - upper.fold(f64::INFINITY, f64::min);
            if saved > best.map_or(1e-12 * cost, |best| best.saved) {
                best = Some(Split {
                    feature,
                    less_than: 0.5 * (values[here] + values[next]),
                    saved,
                });
            }
        }
        best
    }

    fn split(&mut self, id: usize) {
        let Some(split) = self.leaves[id].split else {
            return;
        };
        let values = &self.collected.features[split.feature];
        let members = std::mem::take(&mut self.leaves[id].members);
        let (below, above): (Vec<u32>, Vec<u32>) = members
            .into_iter()
            .partition(|&member| values[member as usize] < split.less_than);
        let test = self.tests.len();
        if let Some((parent, side)) = self.leaves[id].parent {
            self.tests[parent].2[usize::from(side)] = Some(End::Test(test));
        }
        let (first, second) = (
            self.leaf(below, Some((test, false))),
            self.leaf(above, Some((test, true))),
        );
        self.leaves[id] = first;
        self.leaves.push(second);
        let ends = [Some(End::Leaf(id)), Some(End::Leaf(self.leaves.len() - 1))];
        self.tests.push((split.feature, split.less_than, ends));
    }

    /// Joins leaves of one test that do the same, over and over.
    fn prune(&mut self) {
        loop {
            let joined = (0..self.tests.len()).find_map(|test| match self.tests[test].2 {
                [Some(End::Leaf(a)), Some(End::Leaf(b))]
                    if self.leaves[a].action == self.leaves[b].action =>
                {
                    Some((test, a, b))
                }
                _ => None,
            });
            let Some((test, a, b)) = joined else { return };
            let members = std::mem::take(&mut self.leaves[b].members);
            self.leaves[a].members.extend(members);
            let cost = self.leaves[b].cost;
            self.leaves[a].cost += cost;
            self.tests[test].2 = [None, None];
            for (_, _, ends) in &mut self.tests {
                for end in ends.iter_mut() {
                    if matches!(end, Some(End::Test(child)) if *child == test) {
                        *end = Some(End::Leaf(a));
                    }
                }
            }
            if test == 0 {
                return;
            }
        }
    }

    /// Gives tests and nodes to an automaton, those that are reached, in the order of a walk through the tree.
    fn write(&self, automaton: &mut Automaton, collected: &Collected, features: &[Feature]) {
        let mut tree = Tree::default();
        automaton.nodes.clear();
        let first = match self.tests.first() {
            Some((_, _, [Some(_), Some(_)])) => End::Test(0),
            Some(_) | None => End::Leaf(0),
        };
        self.walk(
            first,
            &mut tree,
            &mut |leaf: &Leaf| {
                let id = automaton.nodes.len();
                automaton.nodes.push(node(leaf, collected));
                id
            },
            features,
        );
        automaton.tree = Some(tree);
    }

    fn walk(
        &self,
        end: End,
        tree: &mut Tree,
        add: &mut dyn FnMut(&Leaf) -> usize,
        features: &[Feature],
    ) -> Branch {
        match end {
            End::Leaf(leaf) => Branch::Node(add(&self.leaves[leaf])),
            End::Test(test) => {
                let (feature, less_than, ends) = self.tests[test];
                let number = tree.tests.len();
                tree.tests.push(Test {
                    feature: features[feature],
                    less_than,
                    yes: Branch::Node(0),
                    no: Branch::Node(0),
                });
                let [yes, no] = ends.map(|end| match end {
                    Some(end) => self.walk(end, tree, add, features),
                    None => Branch::Node(0),
                });
                tree.tests[number].yes = yes;
                tree.tests[number].no = no;
                Branch::Test(number)
            }
        }
    }
}

/// The node of a leaf: where the beliefs that were met in it lie.
fn node(leaf: &Leaf, collected: &Collected) -> Node {
    let members = || {
        let members = leaf.members.iter().map(|member| *member as usize);
        members.map(|member| (&collected.beliefs[member], collected.values[member]))
    };
    let n = members().next().map_or(0, |(belief, _)| belief.mean.len());
    let (mut lower, mut upper) = (vec![f64::INFINITY; n], vec![f64::NEG_INFINITY; n]);
    let mut middle = vec![0.0; n];
    let (mut first, mut last) = (usize::MAX, 0);
    let mut modes: Vec<usize> = Vec::new();
    let mut value = 0.0;
    let mut known = true;
    let count = leaf.members.len().max(1) as f64;
    for (belief, worth) in members() {
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
        leaf.action,
        known.then_some(value),
    )
}

/// The first of the least.
fn cheapest(sums: &[f64]) -> ActionId {
    let cheaper = |best: usize, action: usize| match sums[action] < sums[best] {
        true => action,
        false => best,
    };
    (0..sums.len()).fold(0, cheaper)
}
