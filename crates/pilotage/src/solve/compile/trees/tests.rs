//! Growing, refining and cutting back, on beliefs whose costs are known.

use proptest::prelude::*;

use super::collected::Collected;
use super::cuts::Cut;
use super::growth::{Growth, cheapest_of};
use super::shape::{Shape, Spot};
use crate::belief::{Belief, BeliefMdp};
use crate::policy::{Automaton, Matching};
use crate::scenario::find;
use crate::solve::rollout::Judged;

/// Means in a plane, with what is expected of two actions there.
type Beliefs = Vec<([f64; 2], [f64; 2])>;

/// Beliefs of a plane, with what is expected of two actions.
fn collected(beliefs: impl IntoIterator<Item = ([f64; 2], [f64; 2])>) -> Collected {
    let scenario = find("maze-2d-unbounded").unwrap();
    let mdp = BeliefMdp::new(&scenario.model);
    let automaton = Automaton::new(&mdp, "test", Matching::Tree);
    let mut collected = Collected::new(&mdp, &automaton);
    collected.actions = 2;
    collected.extend(beliefs.into_iter().map(|(mean, values)| Judged {
        belief: Belief {
            stratum: 0,
            mode: 0,
            mean: mean.to_vec(),
        },
        moments: None,
        values: values.to_vec(),
        value: None,
        counts: 1.0,
    }));
    collected
}

/// The tree of so many leaves, grown to so many.
fn tree(collected: &Collected, grown: usize, leaves: usize) -> Shape {
    let all = collected.all();
    let mut growths = Growth::straight_and_slanted(collected, &all);
    cheapest_of(&mut growths, (collected, &all), grown, leaves)
}

fn cuts(shape: &Shape) -> Vec<Cut> {
    let cuts = shape.spots.iter().filter_map(|spot| match spot {
        Spot::Test(cut, _) => Some(*cut),
        Spot::Leaf(_) => None,
    });
    cuts.collect()
}

/// Evenly spread, and what is best there by a rule.
fn ruled(first: impl Fn(f64, f64) -> bool) -> Collected {
    let side = || (0..40).map(|k| -1.0 + (f64::from(k) + 0.5) / 20.0);
    let at = side().flat_map(|x| side().map(move |y| [x, y]));
    let values = |[x, y]: [f64; 2]| if first(x, y) { [1.0, 0.0] } else { [0.0, 1.0] };
    collected(at.map(|at| (at, values(at))))
}

#[test]
fn two_questions_are_found_of_which_neither_helps_alone() {
    let collected = ruled(|x, y| (x < 0.2) != (y < -0.3));
    let shape = tree(&collected, 4, 4);
    assert_eq!((shape.cost(&collected), shape.leaves(0)), (0.0, 4));
    assert!(cuts(&shape).iter().all(|cut| !cut.is_slanted()));
}

#[test]
fn a_rule_is_found_to_its_borders_and_cut_back_to_as_many_leaves_as_it_has() {
    let collected = ruled(|x, y| x < 0.4 && y < 0.7 && y > -0.5);
    let shape = tree(&collected, 12, 12);
    assert_eq!((shape.cost(&collected), shape.leaves(0)), (0.0, 4));
    let border = |cut: &Cut| (10.0 * cut.less_than).round() as i32;
    let mut borders: Vec<i32> = cuts(&shape).iter().map(border).collect();
    borders.sort_unstable();
    borders.dedup();
    assert_eq!(borders, [-5, 4, 7]);
}

/// No belief lies so near a border that rounding decides on which side of it.
#[test]
fn a_slanted_border_takes_one_test() {
    for (slant, border) in [
        (3.0, 0.525),
        (3.0, 0.177),
        (-3.0, -0.228),
        (2.0, 0.526),
        (1.0, 0.022),
        (-0.7, 0.2013),
        (0.3, 0.2013),
    ] {
        let collected = ruled(|x, y| x + slant * y < border);
        let shape = tree(&collected, 8, 8);
        let said = format!("{slant}, {border}: {shape:?}");
        assert_eq!(shape.leaves(0), 2, "{said}");
        // Of 1600 beliefs: a slant is found as well as it has to be.
        assert!(shape.cost(&collected) <= 3.0, "{said}");
        let Spot::Test(cut, _) = shape.spots[0] else {
            panic!("{said}");
        };
        let Some((times, 1)) = cut.along.plus else {
            panic!("{said}");
        };
        assert_eq!(cut.along.feature, 0);
        assert!((times - slant).abs() < 0.04 * slant.abs(), "{said}");
        assert!((cut.less_than - border).abs() < 0.05, "{said}");
    }
}

prop_compose! {
    /// Beliefs anywhere, in which anything may be best.
    fn any_beliefs()(
        beliefs in prop::collection::vec(
            ((-1.0f64..1.0, -1.0f64..1.0), (0.0f64..1.0, 0.0f64..1.0)), 1..120),
    ) -> Beliefs {
        beliefs.into_iter().map(|((x, y), (a, b))| ([x, y], [a, b])).collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Whatever things cost, refining never makes a tree worse, no size is exceeded, and every belief is at one leaf.
    #[test]
    fn refining_never_costs_and_cutting_back_keeps_to_the_size(
        beliefs in any_beliefs(),
        leaves in 1usize..9,
    ) {
        let collected = collected(beliefs);
        let all = collected.all();
        for mut growth in Growth::straight_and_slanted(&collected, &all) {
            let alone = growth.to(1).cost(&collected);
            let mut shape: Shape = growth.to(leaves + 6).clone();
            prop_assert!(shape.leaves(0) <= leaves + 6);
            let grown = shape.cost(&collected);
            shape.refine(&collected, &all);
            prop_assert!(shape.cost(&collected) <= grown + 1e-9);
            shape.cut_back(&collected, &all, leaves);
            prop_assert!(shape.leaves(0) <= leaves);
            prop_assert!(shape.cost(&collected) <= alone + 1e-9);
            let members: usize = shape.members(&collected).iter().map(Vec::len).sum();
            prop_assert_eq!(members, collected.beliefs.len());
        }
    }

    /// Only tests about which something changed are looked at again, and that is as good as looking at all.
    #[test]
    fn what_is_settled_need_not_be_looked_at(
        beliefs in any_beliefs(),
        leaves in 1usize..5,
    ) {
        let collected = collected(beliefs);
        let all = collected.all();
        for mut growth in Growth::straight_and_slanted(&collected, &all) {
            let mut kept = growth.to(leaves + 6).clone();
            let mut anew = kept.clone();
            loop {
                for _ in 0..2 {
                    kept.pass(&collected, &all);
                    anew.unsettle_below(0);
                    anew.pass(&collected, &all);
                    prop_assert_eq!(kept.cost(&collected), anew.cost(&collected));
                }
                let cut = kept.cut(&collected, &all, leaves);
                prop_assert_eq!(cut, anew.cut(&collected, &all, leaves));
                if !cut {
                    break;
                }
            }
        }
    }
}
