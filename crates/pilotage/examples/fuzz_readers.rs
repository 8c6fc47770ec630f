//! Fires changed files at the readers of models, policies and checkpoints.
//!
//! ```text
//! cargo run --release --example fuzz_readers -- 1000000        inputs for each reader
//! cargo run --release --example fuzz_readers -- 1000000 7      another seed
//! cargo run --release --example fuzz_readers -- 1000000 7 2    reader 2 only, counted from 0
//! ```
//!
//! It ends at the first input that makes a reader panic, takes it longer than a second or more than a gibibyte; the input is then in
//! the file `fuzz-input`.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

#[path = "../tests/fuzzing/mod.rs"]
mod fuzzing;

use fuzzing::{Tally, readers};

/// The input at hand.
const KEPT: &str = "fuzz-input";

fn main() {
    let arguments: Vec<u64> = std::env::args()
        .skip(1)
        .map(|number| number.parse().expect("whole numbers: inputs, seed, reader"))
        .collect();
    let inputs = arguments.first().copied().unwrap_or(10_000);
    let seed = arguments.get(1).copied().unwrap_or(1);
    let only = arguments.get(2).map(|reader| *reader as usize);
    // One thread: the one whose memory is counted.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.unwrap().install(|| {
        let folder = tempfile::tempdir().unwrap();
        for (_, reader) in readers(folder.path())
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
