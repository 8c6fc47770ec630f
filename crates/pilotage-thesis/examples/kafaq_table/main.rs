//! KAFAQ-learning on the thesis' worlds (4.3): medians over many seeds, beside baselines that are told map and rewards; the pole of
//! 5.5.5; and the automata learned, run on a robot.
//!
//! ```text
//! cargo run --release -p pilotage-thesis --example kafaq_table -- [PROBLEM or all [SEEDS [FOLDER]]]
//! ```
//!
//! Prints a page of Markdown. With a folder, such as `docs`, it is kept as FOLDER/kafaq.md, and every run as FOLDER/data/kafaq.json.
#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)]

mod page;
mod run;

use std::path::Path;

use pilotage::model::Model;
use pilotage::policy::write_whole;
use pilotage::progress::Silent;
use pilotage::scenario;
use pilotage::simulate::Options;
use pilotage::solve::value_iteration;
use pilotage_thesis::baseline::{Baseline, baselines};
use serde_json::json;

use run::{Pole, Run};

const PROBLEMS: [&str; 6] = [
    "basic",
    "basic-inner",
    "maze-4x4",
    "cart-load-unload",
    "stations-5x5",
    "shuttle-blind",
];

/// Problems that are also there for a robot.
const ON_ROBOT: [&str; 3] = ["basic", "maze-4x4", "cart-load-unload"];

const POLE: &str = "cart-pole-sd";

const EVALUATION: Options = Options {
    episodes: 2_000,
    seed: 999,
};

/// All that was measured of a problem.
struct Measured {
    model: Model,
    /// What others earn, with what they are; the first is the one to compare with.
    baselines: Vec<Baseline>,
    runs: Vec<Run>,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let which = arguments.first().map_or("all", String::as_str);
    let seeds: u64 = arguments.get(1).map_or(20, |text| text.parse().unwrap());
    let chosen = |name: &str| which == "all" || which == name;
    let measured: Vec<Measured> = PROBLEMS
        .into_iter()
        .filter(|name| chosen(name))
        .map(|name| measure(name, seeds))
        .collect();
    let poles: Vec<Pole> = (1..=seeds)
        .filter(|_| chosen(POLE))
        .map(|seed| {
            eprintln!("{POLE}, seed {seed}");
            Pole::new(&scenario::find(POLE).unwrap(), seed)
        })
        .collect();
    let text = page::page(&measured, &poles, seeds);
    println!("{text}");
    if let Some(folder) = arguments.get(2) {
        let folder = Path::new(folder);
        let data = json!({
            "pilotage": env!("CARGO_PKG_VERSION"),
            "evaluation": { "episodes": EVALUATION.episodes, "seed": EVALUATION.seed },
            "problems": measured.iter().map(Measured::json).collect::<Vec<_>>(),
            "pole": { "problem": POLE, "runs": poles.iter().map(Pole::json).collect::<Vec<_>>() },
        });
        std::fs::create_dir_all(folder.join("data")).unwrap();
        let data = serde_json::to_string_pretty(&data).unwrap() + "\n";
        write_whole(&folder.join("data/kafaq.json"), data.as_bytes()).unwrap();
        write_whole(&folder.join("kafaq.md"), text.as_bytes()).unwrap();
    }
}

fn measure(name: &str, seeds: u64) -> Measured {
    let scenario = scenario::find(name).unwrap();
    let robot = ON_ROBOT
        .contains(&name)
        .then(|| scenario::find(format!("robot-{name}")).unwrap());
    let baselines = baselines(
        &scenario,
        &value_iteration::Settings::default(),
        EVALUATION,
        &Silent,
    )
    .unwrap();
    let runs = (1..=seeds)
        .map(|seed| {
            eprintln!("{name}, seed {seed}");
            Run::new(&scenario, robot.as_ref(), seed)
        })
        .collect();
    Measured {
        model: scenario.model,
        baselines,
        runs,
    }
}

impl Measured {
    fn json(&self) -> serde_json::Value {
        let baselines = self.baselines.iter();
        json!({
            "problem": self.model.name,
            "yardsticks": baselines.map(|Baseline { who, earned }| json!({ "what": who, "earned": earned })).collect::<Vec<_>>(),
            "runs": self.runs.iter().map(Run::json).collect::<Vec<_>>(),
        })
    }
}
