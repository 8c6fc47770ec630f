//! Chapters 3, 4 and 6: what the learners find, over many seeds, beside planners that are told map and rewards.

use pilotage::belief::BeliefMdp;
use pilotage::policy::{Automaton, AutomatonRunner};
use pilotage::progress::Silent;
use pilotage::scenario::Scenario;
use pilotage::simulate::{Evaluation, LifeOptions, Options, evaluate, life};
use pilotage::solve::compile;
use pilotage::solve::kafaq::{self, Learned};
use pilotage::solve::value_iteration;
use pilotage::world::{ProblemWorld, World};
use pilotage_report::{Finding, Verdict, returns_svg, values_svg};
use rayon::prelude::*;

use crate::baseline::baselines;
use crate::context::{Context, Draft, judge, or_dash, problem, shown};
use crate::error::{Error, Result};

/// A learning problem of chapters 3 and 4.
struct Problem {
    model: &'static str,
    title: &'static str,
    thesis: &'static str,
    /// Regions the thesis reports, where it does.
    regions: Option<usize>,
    /// Share of the baseline from which on it counts as solved.
    solved: f64,
}

/// One seed.
pub struct Run {
    pub learned: Learned,
    pub earned: Evaluation,
}

/// Median with the least and the greatest.
pub fn spread(mut values: Vec<f64>, digits: usize) -> String {
    values.sort_by(f64::total_cmp);
    let (Some(least), Some(most)) = (values.first(), values.last()) else {
        return "–".to_owned();
    };
    let middle = median(&values);
    if least == most {
        return format!("{middle:.digits$}");
    }
    format!("{middle:.digits$} ({least:.digits$} to {most:.digits$})")
}

/// Middle of sorted values.
fn median(sorted: &[f64]) -> f64 {
    0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2])
}

/// Median of values in any order.
pub fn median_of(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    median(&values)
}

pub fn evaluation(context: &Context<'_>) -> Options {
    Options {
        episodes: context.either(2_000, 300),
        seed: context.seed + 998,
    }
}

/// Seeds of the runs, the report's own first.
pub fn seeds(context: &Context<'_>) -> Vec<u64> {
    (0..context.either(20, 2))
        .map(|k| context.seed + k)
        .collect()
}

fn learn(scenario: &Scenario, seed: u64) -> Result<Learned> {
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(scenario)) };
    let settings = kafaq::Settings {
        seed,
        ..kafaq::Settings::default()
    };
    let mut learned = kafaq::learn(&scenario.model, &worlds, &settings, None, &Silent)?;
    compile::annotate(
        &mut learned.automaton,
        &BeliefMdp::new(&scenario.model),
        500,
        seed,
    );
    Ok(learned)
}

pub fn earned(world: &Scenario, automaton: &Automaton, options: Options) -> Evaluation {
    evaluate(
        world,
        &automaton.updater,
        &AutomatonRunner::new(automaton),
        options,
        &Silent,
    )
}

pub fn runs(context: &Context<'_>, scenario: &Scenario) -> Result<Vec<Run>> {
    seeds(context)
        .into_par_iter()
        .map(|seed| {
            let learned = learn(scenario, seed)?;
            let earned = earned(scenario, &learned.automaton, evaluation(context));
            Ok(Run { learned, earned })
        })
        .collect()
}

/// The planner that is the baseline. For a quick look its grid of the plane is coarser: the policy is hardly worse, and it takes a
/// tenth of the time.
fn planner(context: &Context<'_>, scenario: &Scenario) -> value_iteration::Settings {
    value_iteration::Settings {
        points: (context.quick && scenario.model.state_dim() == 2).then_some(25),
        ..value_iteration::Settings::default()
    }
}

/// What the baseline of a problem earns.
pub fn baseline(context: &Context<'_>, scenario: &Scenario) -> Result<Evaluation> {
    let all = baselines(
        scenario,
        &planner(context, scenario),
        evaluation(context),
        context.observer,
    )?;
    let first = all.into_iter().next();
    first
        .map(|one| one.earned)
        .ok_or_else(|| Error::Missing(format!("{} has no baseline", scenario.model.name)))
}

fn reproduced(context: &Context<'_>, problem_: &Problem) -> Result<Finding> {
    let scenario = problem(problem_.model)?;
    let runs = runs(context, &scenario)?;
    let planner = planner(context, &scenario);
    let told = baselines(&scenario, &planner, evaluation(context), context.observer)?;
    let of = |value: &dyn Fn(&Run) -> f64| -> Vec<f64> { runs.iter().map(value).collect() };
    let best = told
        .first()
        .map_or(f64::NAN, |baseline| baseline.earned.discounted.mean);
    let shares = of(&|run| 100.0 * run.earned.discounted.mean / best);
    let share = median_of(shares.clone());
    let regions = of(&|run| run.learned.automaton.nodes.len() as f64);
    let parts = of(&|run| run.learned.automaton.closed_components() as f64);
    let converged = runs.iter().filter(|run| run.learned.converged).count();
    let row = vec![[
        spread(regions.clone(), 0),
        or_dash(problem_.regions),
        spread(parts.clone(), 0),
        spread(of(&|run| run.earned.discounted.mean), 2),
        spread(shares, 1),
        format!("{converged} of {}", runs.len()),
        spread(of(&|run| run.learned.samples as f64 / 1000.0), 0),
    ]];
    let others = told
        .iter()
        .map(|baseline| [baseline.who.to_owned(), shown(baseline.earned.discounted)])
        .collect();
    let mut draft = Draft::new(problem_.title, problem_.thesis)
        .table(
            format!(
                "KAFAQ over {} seeds: median (least to greatest)",
                runs.len()
            ),
            [
                "regions",
                "thesis",
                "closed parts",
                "discounted",
                "% of the yardstick",
                "converged",
                "thousand steps",
            ],
            row,
        )
        .table(
            "What others earn; the first is the yardstick",
            ["who", "discounted"],
            others,
        );
    if let Some(first) = runs.first() {
        let automaton = &first.learned.automaton;
        let learning = &kafaq::drawn(automaton, &first.learned.learning);
        draft = draft
            .automaton(format!("The automaton of seed {}", context.seed), automaton)?
            .figure("Q-values while learning", values_svg(automaton, learning)?)
            .figure(
                "Reward a step while learning, exploration included",
                returns_svg(automaton, learning)?,
            );
    }
    let nodes = median_of(regions);
    let good = share >= 100.0 * problem_.solved;
    let found = format!(
        "a median of {nodes} regions in {} closed parts earns {share:.1}% of the yardstick",
        median_of(parts)
    );
    let few = problem_
        .regions
        .is_none_or(|regions| nodes <= regions as f64);
    Ok(draft.verdict(match (good, few) {
        (true, true) => (
            Verdict::Reproduced,
            format!("Solved, with no more regions than reported: {found}."),
        ),
        (true, false) => (
            Verdict::UnderReading,
            format!("Solved, with more regions than reported: {found}."),
        ),
        (false, _) => (Verdict::Contradicted, format!("Not solved: {found}.")),
    }))
}

pub fn figure_4_8(context: &Context<'_>) -> Result<Finding> {
    reproduced(
        context,
        &Problem {
            model: "basic-inner",
            title: "Figures 4.8 and 4.9: KAFAQ in the basic world",
            thesis: "Three regions: EAST before the goal, WEST in and behind it, and a tiny one at the end; Q-values converge in about 7 steps.",
            regions: Some(3),
            solved: 0.97,
        },
    )
}

pub fn figure_4_10(context: &Context<'_>) -> Result<Finding> {
    reproduced(
        context,
        &Problem {
            model: "maze-4x4",
            title: "Figures 4.10 and 4.11: KAFAQ in the 4x4 maze",
            thesis: "Three regions: SOUTH in the north of the goal, EAST in its west, and the goal.",
            regions: Some(3),
            solved: 0.95,
        },
    )
}

pub fn figure_4_12(context: &Context<'_>) -> Result<Finding> {
    reproduced(
        context,
        &Problem {
            model: "cart-load-unload",
            title: "Figures 4.12 and 4.13: KAFAQ and the hidden load",
            thesis: "Two states, loaded and unloaded, with opposite actions.",
            regions: Some(2),
            solved: 0.90,
        },
    )
}

pub fn figure_4_14(context: &Context<'_>) -> Result<Finding> {
    reproduced(
        context,
        &Problem {
            model: "stations-5x5",
            title: "Figures 4.14 and 4.15: KAFAQ and the four stations",
            thesis: "Two automata that are not connected, one for each pair of stations; EAST and WEST die out.",
            regions: None,
            solved: 0.85,
        },
    )
}

pub fn figure_4_16(context: &Context<'_>) -> Result<Finding> {
    reproduced(
        context,
        &Problem {
            model: "shuttle-blind",
            title: "Figures 4.16 and 4.17: KAFAQ and the shuttle",
            thesis: "Four states; MOVE and TURN follow each other; stable after 47 steps.",
            regions: Some(4),
            solved: 0.90,
        },
    )
}

/// The pole (4.3.6).
pub fn section_4_3_6(context: &Context<'_>) -> Result<Finding> {
    /// A little more than the thesis' four hours of 0.02 s.
    const STEPS: u64 = 750_000;
    let scenario = problem("cart-pole-sd")?;
    let steps = context.either(STEPS, 50_000);
    let lives = seeds(context)
        .into_par_iter()
        .map(|seed| {
            let learned = learn(&scenario, seed)?;
            let options = LifeOptions {
                runs: 1,
                steps,
                seed: context.seed + 998 + seed,
            };
            let policy = AutomatonRunner::new(&learned.automaton);
            let lived = life(
                &scenario,
                &learned.automaton.updater,
                &policy,
                options,
                &Silent,
            );
            Ok((learned, lived.failures()))
        })
        .collect::<Result<Vec<_>>>()?;
    let unfailing = lives.iter().filter(|(_, failures)| *failures == 0).count();
    let of = |value: &dyn Fn(&(Learned, u64)) -> f64| lives.iter().map(value).collect::<Vec<f64>>();
    let mut draft = Draft::new(
        "Section 4.3.6: KAFAQ balances the pole",
        "162 regions; the pole is balanced for more than four hours, 720,000 steps.",
    )
    .table(
        format!(
            "{} seeds, {steps} steps each: median (least to greatest)",
            lives.len()
        ),
        [
            "seeds without a failure",
            "failures",
            "regions",
            "thesis",
            "thousand steps learned",
        ],
        vec![[
            format!("{unfailing} of {}", lives.len()),
            spread(of(&|one| one.1 as f64), 0),
            spread(of(&|one| one.0.automaton.nodes.len() as f64), 0),
            "162".to_owned(),
            spread(of(&|one| one.0.samples as f64 / 1000.0), 0),
        ]],
    );
    if let Some((first, _)) = lives.first() {
        draft = draft.figure(
            format!("Reward a step while seed {} learned", context.seed),
            returns_svg(
                &first.automaton,
                &kafaq::drawn(&first.automaton, &first.learning),
            )?,
        );
    }
    Ok(draft.verdict(judge(
        2 * unfailing > lives.len(),
        (
            Verdict::UnderReading,
            format!("With the noises read as standard deviations {unfailing} of {} seeds hold it through {steps} steps, with far fewer regions than 162.", lives.len()),
        ),
        (Verdict::Contradicted, format!("Only {unfailing} of {} seeds hold it through {steps} steps.", lives.len())),
    )))
}
