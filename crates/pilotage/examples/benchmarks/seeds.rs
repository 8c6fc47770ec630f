//! docs/seeds.md: how much what is earned hangs on the seed that it was planned with.

use crate::Page;
use crate::published::{EPISODES, Problem, measured, problems};
use crate::row::{Row, estimate};

pub fn page(seeds: u64, asked: &dyn Fn(&str) -> bool) -> Page {
    if seeds < 2 {
        return Err(format!("--seeds {seeds}: at least 2 of them are compared").into());
    }
    let numbers: String = (1..=seeds).map(|seed| format!(" seed {seed} |")).collect();
    let mut page =
        heading(seeds) + "| problem | nodes at most |" + &numbers + " least | spread |\n";
    page += "|---|--:|";
    page += &"--:|".repeat(seeds as usize + 2);
    page += "\n";
    for problem in problems(asked)? {
        for &most in &problem.nodes {
            page += &line(&problem, most, seeds)?;
        }
    }
    Ok(page)
}

fn heading(seeds: u64) -> String {
    format!(
        "# One plan and another\n\n\
         The problems of [benchmarks.md](benchmarks.md), planned and compiled with {seeds} seeds, nothing else being different: what each tree earns where its model holds, mean ± standard \
         error over {EPISODES} episodes of its own, with its nodes in brackets; the least of these, and their standard deviation. Version {}; made by\n\n\
         ```sh\ncargo run --release -p pilotage --example benchmarks -- --seeds {seeds} --out docs/seeds.md\n```\n\n",
        env!("CARGO_PKG_VERSION")
    )
}

fn line(problem: &Problem, most: usize, seeds: u64) -> Page {
    let by_seed = |seed| measured(&problem.name, Some(most), seed);
    let rows: Vec<Row> = (1..=seeds).map(by_seed).collect::<Result<_, _>>()?;
    let digits = problem.digits;
    let each: String = rows
        .iter()
        .map(|row| {
            let nodes = row.nodes.unwrap_or(0);
            format!(" {} ({nodes}) |", estimate(row.earned, digits))
        })
        .collect();
    let earned = || rows.iter().map(|row| row.earned.0);
    let least = earned().fold(f64::INFINITY, f64::min);
    let mean = earned().sum::<f64>() / seeds as f64;
    let squares: f64 = earned().map(|earned| (earned - mean).powi(2)).sum();
    let spread = (squares / (seeds - 1) as f64).sqrt();
    Ok(format!(
        "| `{}` | {most} |{each} {least:.digits$} | {spread:.digits$} |\n",
        problem.name
    ))
}
