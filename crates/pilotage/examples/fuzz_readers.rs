//! Fires changed files at the readers of models, policies and checkpoints.
//!
//! ```text
//! cargo run --release -p pilotage --example fuzz_readers -- 1000000        inputs for each reader
//! cargo run --release -p pilotage --example fuzz_readers -- 1000000 7      another seed
//! cargo run --release -p pilotage --example fuzz_readers -- 1000000 7 2    reader 2 only, counted from 0
//! ```
//!
//! It ends at the first input that makes a reader panic, takes it longer than a second or more than a gibibyte; the input is then in
//! the file `fuzz-input` of the folder it was started in. It writes there all the time, so that a folder in memory is the fastest.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

#[path = "../tests/fuzzing/mod.rs"]
mod fuzzing;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use fuzzing::{Tally, readers};

/// The input at hand.
const KEPT: &str = "fuzz-input";

/// Ends the program where an input does not come to an end at all. Inputs are counted as they are given.
fn watch(given: Arc<AtomicU64>) {
    const HANGS: Duration = Duration::from_secs(60);
    std::thread::spawn(move || {
        let mut last = u64::MAX;
        loop {
            let now = given.load(Ordering::Relaxed);
            if now == last {
                println!("an input takes longer than a minute; it is in {KEPT}");
                std::process::exit(1);
            }
            last = now;
            std::thread::sleep(HANGS);
        }
    });
}

fn main() {
    let arguments: Vec<u64> = std::env::args()
        .skip(1)
        .map(|number| number.parse().expect("whole numbers: inputs, seed, reader"))
        .collect();
    let inputs = arguments.first().copied().unwrap_or(10_000);
    let seed = arguments.get(1).copied().unwrap_or(1);
    let only = arguments.get(2).map(|reader| *reader as usize);
    let given = Arc::new(AtomicU64::new(0));
    // One thread: the one whose memory is counted.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.unwrap().install(|| {
        let folder = tempfile::tempdir().unwrap();
        let readers = readers(folder.path());
        watch(given.clone());
        for (_, reader) in readers
            .into_iter()
            .enumerate()
            .filter(|(number, _)| only.is_none_or(|only| only == *number))
        {
            let clock = std::time::Instant::now();
            let mut tally = Tally::default();
            for number in 0..inputs {
                let input = reader.input(seed, number);
                // Beforehand: a stack that overflows, or memory that is refused, ends the program.
                std::fs::write(KEPT, &input).unwrap();
                given.fetch_add(1, Ordering::Relaxed);
                if let Err(wound) = reader.give(&input, &mut tally) {
                    println!(
                        "{}: input {number} of seed {seed} {wound}; it is in {KEPT}",
                        reader.name
                    );
                    std::process::exit(1);
                }
            }
            println!(
                "{:<22} {} inputs in {:.0} s, {} taken, the slowest {:.0} ms, the largest {} MiB",
                reader.name,
                tally.inputs,
                clock.elapsed().as_secs_f64(),
                tally.taken,
                1e3 * tally.slowest.as_secs_f64(),
                tally.largest >> 20
            );
        }
    });
    std::fs::remove_file(KEPT).unwrap();
}
