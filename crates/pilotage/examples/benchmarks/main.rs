//! Makes docs/benchmarks.md: what plans promise and earn, on problems that others publish numbers for; or docs/gallery.md: the same of
//! problems that people have; or docs/learners.md: what learners earn beside planners, on all built-in problems; or docs/seeds.md: how much
//! it hangs on the seed; or docs/variants.md: the same problems with other noises, rewards and places.
//!
//! ```sh
//! cargo run --release -p pilotage --example benchmarks -- --out docs/benchmarks.md [PROBLEM ...]
//! cargo run --release -p pilotage --example benchmarks -- --gallery target/gallery --out docs/gallery.md [PROBLEM ...]
//! cargo run --release -p pilotage --example benchmarks -- --learners --out docs/learners.md [PROBLEM ...]
//! cargo run --release -p pilotage --example benchmarks -- --seeds 3 --out docs/seeds.md [PROBLEM ...]
//! cargo run --release -p pilotage --example benchmarks -- --variants target/variants --out docs/variants.md [PROBLEM ...]
//! ```
//!
//! What learners earn is kept in docs/data/learners.json as it is measured, so that this may be stopped and gone on with; with `--kept` the
//! page is made of that alone.
//!
//! The automata of the gallery are kept in the folder named, and so are the model files of variants; scripts/gallery.sh draws the former.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod gallery;
mod learners;
mod published;
mod row;
mod seeds;
mod variants;

use std::error::Error;

use row::Task;

/// A page, or a part of one.
type Page = Result<String, Box<dyn Error>>;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(task) = value_of("--one", &mut arguments) {
        let task: Task = serde_json::from_str(&task)?;
        // Whoever asked for it wants the reason in words.
        match task.measure() {
            Ok(row) => println!("{}", serde_json::to_string(&row)?),
            Err(error) => {
                eprintln!("{error}");
                std::process::exit(1);
            }
        }
        return Ok(());
    }
    let out = value_of("--out", &mut arguments);
    let folder = value_of("--gallery", &mut arguments);
    let seeds = value_of("--seeds", &mut arguments);
    let variants = value_of("--variants", &mut arguments);
    let [learners, kept] = ["--learners", "--kept"].map(|flag| is_given(flag, &mut arguments));
    if kept && !(learners && arguments.is_empty()) {
        return Err(
            "--kept goes with --learners, and with no problems: all that is kept is shown".into(),
        );
    }
    let pages = [
        folder.is_some(),
        learners,
        seeds.is_some(),
        variants.is_some(),
    ];
    if pages.into_iter().filter(|given| *given).count() > 1 {
        return Err("one page at a time: --gallery, --learners, --seeds or --variants".into());
    }
    for name in &arguments {
        pilotage::scenario::find(name)?;
    }
    let asked = |name: &str| arguments.is_empty() || arguments.iter().any(|other| other == name);
    let page = match (folder, seeds, variants) {
        (Some(folder), ..) => gallery::page(&folder, &asked)?,
        (_, Some(seeds), _) => seeds::page(seeds.parse()?, &asked)?,
        (.., Some(folder)) => variants::page(&folder, &asked)?,
        _ if learners => learners::page(&arguments, kept)?,
        _ => published::page(&asked)?,
    };
    match out {
        Some(path) => std::fs::write(path, page)?,
        None => println!("{page}"),
    }
    Ok(())
}

/// Takes a flag out of the arguments, if it is there.
fn is_given(flag: &str, arguments: &mut Vec<String>) -> bool {
    let before = arguments.len();
    arguments.retain(|argument| argument != flag);
    arguments.len() < before
}

/// Takes a flag and its value out of the arguments.
fn value_of(flag: &str, arguments: &mut Vec<String>) -> Option<String> {
    let place = arguments.iter().position(|argument| argument == flag)?;
    if place + 1 >= arguments.len() {
        return None;
    }
    arguments.remove(place);
    Some(arguments.remove(place))
}
