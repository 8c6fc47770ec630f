//! Chapter 4: uncertainty levels, and the appendix' table.

use pilotage::belief::BeliefMdp;
use pilotage::report::{Finding, Series, Verdict};

use super::context::{Context, Draft, judge, problem};
use crate::failure::Failure;

/// Table 4.1: `P_0` and the steps until it has converged.
const TABLE_4_1: [(f64, usize); 5] = [(1000.0, 9), (5.0, 9), (1.0, 9), (0.8, 8), (0.3, 7)];

/// Steps until the variance converges.
pub fn table_4_1(_: &Context<'_>) -> Result<Finding, Failure> {
    let mut rows = Vec::new();
    let mut series = Vec::new();
    let mut same = true;
    for (start, printed) in TABLE_4_1 {
        // Q = R = 0.5, A = H = 1.
        let mut model = problem("corridor-unbounded")?.model;
        model.start[0].covariance[(0, 0)] = start;
        model.motion.noise.fill(0.5);
        model.sensor.noise.fill(0.5);
        model.belief.level_tolerance = 5e-7;
        let mdp = BeliefMdp::new(&model);
        let levels = mdp.levels();
        let steps = levels.len() - 1;
        same &= steps == printed;
        rows.push([start.to_string(), printed.to_string(), steps.to_string()]);
        series.push(Series {
            name: format!("P_0 = {start}"),
            points: (1..levels.len())
                .map(|level| (level as f64, levels.covariance(level)[(0, 0)]))
                .collect(),
            band: None,
        });
    }
    Ok(Draft::new(
        "Table 4.1: uncertainty levels",
        "Steps until the variance converges, Q = R = 0.5, for five start variances: 9, 9, 9, 8, 7.",
    )
    .table("Steps until convergence", ["P_0", "thesis", "here"], rows)
    .curves(
        "The variance from the first step on",
        ("step", "variance"),
        &series,
    )?
    .verdict(judge(
        same,
        (
            Verdict::Reproduced,
            "All five come out if \"the same value\" means the same to six decimals.",
        ),
        (Verdict::Contradicted, "Other counts come out."),
    )))
}

/// Table A.1 of the thesis, its numbers as printed.
const TABLE_A_1: &str = include_str!("table_a1.csv");

/// What the 324 Q-values of Table A.1 can tell.
pub fn table_a_1(_: &Context<'_>) -> Result<Finding, Failure> {
    let values: Vec<f64> = TABLE_A_1
        .lines()
        .skip(1)
        .flat_map(|line| {
            line.split(',')
                .skip(1)
                .filter_map(|cell| cell.parse().ok())
                .collect::<Vec<f64>>()
        })
        .collect();
    let row = |name: &str, low: f64, high: f64| {
        let mut inside: Vec<f64> = values
            .iter()
            .copied()
            .filter(|x| (low..=high).contains(x))
            .collect();
        inside.sort_by(f64::total_cmp);
        let n = inside.len() as f64;
        // Kolmogorov's distance from the uniform distribution, and its limit at the level 0.05.
        let distance = inside
            .iter()
            .enumerate()
            .map(|(k, x)| {
                let uniform = (x - low) / (high - low);
                (uniform - k as f64 / n)
                    .abs()
                    .max((uniform - (k + 1) as f64 / n).abs())
            })
            .fold(0.0, f64::max);
        let limit = 1.358 / n.sqrt();
        (
            [
                name.to_owned(),
                inside.len().to_string(),
                format!("{distance:.3}"),
                format!("{limit:.3}"),
            ],
            inside.len(),
            distance < limit,
        )
    };
    let (positive, of_positive, first) = row("0 to 0.01", 0.0, 0.01);
    let (negative, of_negative, second) = row("-0.02 to -0.01", -0.02, -0.01);
    let all = of_positive + of_negative == values.len();
    let rest = values.len() - of_positive - of_negative;
    Ok(Draft::new(
        "Table A.1: Q-values of the pole's 162 states",
        "Two Q-values, push left and push right, for each of 162 states; which state is which is not said.",
    )
    .table(
        "How the 324 values lie, and how far from uniform (Kolmogorov-Smirnov, limit at 5%)",
        ["range", "values", "distance", "limit"],
        vec![
            positive,
            negative,
            ["elsewhere".to_owned(), rest.to_string(), String::new(), String::new()],
        ],
    )
    .verdict(judge(
        all && first && second,
        (
            Verdict::NotDecidable,
            "Every value lies in one of two ranges, and within each they cannot be told from uniform random numbers; without the states' places they say nothing that could be compared. 162 = 3 x 3 x 6 x 3 is also the number of boxes of Barto, Sutton and Anderson (1983).",
        ),
        (Verdict::NotDecidable, "The states' places are not given, so nothing can be compared."),
    )))
}
