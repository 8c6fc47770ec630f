//! Section 5.5.5: the inverted pendulum, planned.

use pilotage::belief::BeliefMdp;
use pilotage::policy::{AutomatonRunner, Policy};
use pilotage::simulate::{LifeOptions, life};
use pilotage::solve::kbvi::branches::{self, Branches};
use pilotage::solve::{PolicySearch, policy_search};
use pilotage_report::{Finding, Verdict};

use crate::context::{Context, Draft, judge, problem};
use crate::error::Result;
use crate::regulator::tuned;

/// The pole (5.5.5).
pub fn section_5_5_5(context: &Context<'_>) -> Result<Finding> {
    let (runs, steps) = context.either((10, 1_500_000), (2, 20_000));
    let mut rows = Vec::new();
    let mut held = false;
    let mut draft = Draft::new(
        "Section 5.5.5: the inverted pendulum",
        "Segments (1, 41 and 122 at three levels) hold the pole for more than 1,500,000 steps, 1-NN (1, 38 and 116 nodes) for more than 800,000.",
    );
    let models: &[&str] = context.either(&["cart-pole", "cart-pole-noisy"], &["cart-pole"]);
    for &name in models {
        let scenario = problem(name)?;
        let mdp = BeliefMdp::new(&scenario.model);
        let settings = PolicySearch {
            effort: context.either(1.0, 0.1),
            ..PolicySearch::survival()
        };
        let found = policy_search::search(&mdp, &settings, context.seed, context.observer)?;
        let filter = found.updater.clone();
        let (regulator, _) = tuned(&mdp, context.either(1.0, 0.02))?;
        let open_loop = |horizon, group| {
            let settings = branches::Settings {
                horizon,
                group,
                ..branches::Settings::default()
            };
            Branches::new(mdp.clone(), settings)
        };
        let (planned, long, short) = (
            AutomatonRunner::new(&found),
            open_loop(180, 20),
            open_loop(6, 1),
        );
        let policies: [(&str, &dyn Policy, u64); 4] = [
            ("policy-search, automaton", &planned, steps),
            ("lqg, bang-bang, its weights tuned", &regulator, steps),
            (
                "kbvi, open loop, horizon 180 by twenties",
                &long,
                steps.min(5_000),
            ),
            ("kbvi, open loop, horizon 6", &short, steps.min(5_000)),
        ];
        for (label, policy, steps) in policies {
            let options = LifeOptions {
                runs,
                steps,
                seed: context.seed,
            };
            let lived = life(&scenario, &filter, policy, options, context.observer);
            if name == "cart-pole" && label.starts_with("policy-search") {
                held = lived.failures() == 0;
            }
            let mean = lived.mean().map_or_else(
                || format!("more than {:.0} (95%)", lived.at_least()),
                |mean| format!("{:.0} ± {:.0}", mean.mean, mean.stderr),
            );
            rows.push([
                name.to_owned(),
                label.to_owned(),
                lived.steps().to_string(),
                lived.failures().to_string(),
                format!("{} of {}", lived.unfailing(), lived.runs.len()),
                mean,
            ]);
        }
        if name == "cart-pole" {
            draft = draft.automaton("The automaton that holds the pole", &found)?;
        }
    }
    Ok(draft
        .table(
            "How long the pole stays up, in steps of 0.02 s",
            ["model", "policy", "steps", "failures", "runs without", "mean life"],
            rows,
        )
        .verdict(judge(
            held,
            (
                Verdict::UnderReading,
                "With the noise on the force, failure at 12 degrees and sensor variance 0.05, six nodes hold the pole through every run; the thesis' own open-loop planning, corrected or not, lets it fall within seconds, and its noise added to the state itself cannot be survived by any policy.",
            ),
            (Verdict::Contradicted, "The automaton failed within the steps run here."),
        )))
}
