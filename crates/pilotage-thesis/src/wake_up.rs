//! Section 5.6: waking up lost.

use pilotage::belief::{Belief, BeliefMdp, HypothesisSettings, Merge};
use pilotage::policy::Policy;
use pilotage::simulate::wake_up::{Choice, Settings as Kidnapping, measure};
use pilotage::solve::value_iteration;
use pilotage_report::{Finding, Verdict, belief_map_svg};

use crate::context::{Context, Draft, judge, problem, shown};
use crate::error::Result;

/// Table 5.1: level, name, point and action.
const TABLE_5_1: [(usize, &str, [f64; 2], &str); 10] = [
    (0, "p31", [1.5, 1.5], "SOUTH"),
    (0, "p32", [2.5, 0.5], "EAST"),
    (0, "p33", [2.5, 1.5], "NORTH"),
    (1, "p21", [2.8, 0.5], "EAST"),
    (1, "p22", [4.1, 0.4], "EAST"),
    (1, "p23", [3.9, 2.9], "NORTH"),
    (2, "p11", [3.8, 0.5], "EAST"),
    (2, "p12", [3.9, 1.8], "NORTH"),
    (2, "p13", [4.3, 3.9], "NORTH"),
    (2, "p14", [4.3, 4.6], "EAST"),
];

/// The U-shaped maze's policy.
pub fn table_5_1(context: &Context<'_>) -> Result<Finding> {
    let model = problem("u-maze")?.model;
    let mdp = BeliefMdp::new(&model);
    let policy = value_iteration::solve(
        &mdp,
        &value_iteration::Settings::default(),
        context.observer,
    )?;
    let mut same = 0;
    let rows = TABLE_5_1
        .iter()
        .map(|&(level, name, mean, action)| {
            let belief = Belief {
                stratum: level,
                mode: 0,
                mean: mean.to_vec(),
            };
            let ours = &model.actions[policy.action(&belief)].name;
            same += usize::from(ours == action);
            [
                format!("{:.4}", mdp.covariance(level)[(0, 0)]),
                name.to_owned(),
                format!("({}, {})", mean[0], mean[1]),
                action.to_owned(),
                ours.clone(),
            ]
        })
        .collect();
    Ok(Draft::new(
        "Table 5.1: point backups of the U-shaped maze",
        "Ten points at variances 0.3, 0.28 and 0.27 with an action each.",
    )
    .table("The thesis' points asked of our policy", ["variance", "point", "mean", "thesis", "here"], rows)
    .verdict((
        Verdict::UnderReading,
        format!("{same} of 10 actions agree and so do the variances, cut to two digits. The walls of Figure 5.17 are not in the text; ours were drawn so that the points make sense."),
    )))
}

/// Waking up lost.
pub fn figures_5_16_and_5_17(context: &Context<'_>) -> Result<Finding> {
    let episodes = context.either(10_000, 300);
    let mut rows = Vec::new();
    let mut good = true;
    let mut draft = Draft::new(
        "Figures 5.16 and 5.17: waking up in the N-shaped and the U-shaped maze",
        "In the N-shaped maze one hypothesis is left after the first step; in the U-shaped maze the agent goes SOUTH first, and hypotheses with weights below 0.05 are dropped.",
    );
    for name in ["n-maze", "u-maze"] {
        let scenario = problem(name)?;
        let mdp = BeliefMdp::new(&scenario.model);
        let policy = value_iteration::solve(
            &mdp,
            &value_iteration::Settings::default(),
            context.observer,
        )?;
        draft = draft.figure(
            format!("{name}: what to do at which mean"),
            belief_map_svg(&mdp, &policy, None)?,
        );
        let close = HypothesisSettings {
            merge: Merge::Agree(1.0),
            ..HypothesisSettings::default()
        };
        for (rule, choice, tracking) in [
            (
                "weighted vote, merged when they coincide",
                Choice::Weighted,
                HypothesisSettings::default(),
            ),
            (
                "weighted vote, merged when close and agreed",
                Choice::Weighted,
                close,
            ),
            (
                "the valid one, merged when agreed (printed)",
                Choice::Valid,
                HypothesisSettings::PRINTED,
            ),
        ] {
            let settings = Kidnapping {
                choice,
                tracking,
                episodes,
                seed: context.seed,
            };
            let found = measure(&mdp, &scenario.truth, &policy, &settings, context.observer)?;
            let share = |steps: usize| {
                let count = found.alone_after.get(steps).copied().unwrap_or(0);
                format!("{:.1} %", 100.0 * count as f64 / episodes as f64)
            };
            if tracking == HypothesisSettings::default() {
                good &= found.ratio.mean > 0.95;
            }
            rows.push([
                name.to_owned(),
                rule.to_owned(),
                shown(found.lost.success),
                shown(found.told.success),
                shown(found.ratio),
                share(1),
                share(2),
                share(3),
            ]);
        }
    }
    Ok(draft
        .table(
            format!("{episodes} kidnappings each; how many were left with one hypothesis after 1, 2 and 3 steps"),
            ["maze", "rule", "success, lost", "success, told", "lost / told", "1", "2", "3"],
            rows,
        )
        .verdict(judge(
            good,
            (
                Verdict::UnderReading,
                "Waking up lost costs next to nothing. One hypothesis after the first step holds under the printed rule, which merges hypotheses that agree on an action however far apart they are; weights alone rarely decide that soon.",
            ),
            (Verdict::Contradicted, "The lost agent reaches the goal in less than 95% of the cases in which a told one does."),
        )))
}
