//! Readers of models, policies and checkpoints under fire. The budget is a few thousand inputs each; `FUZZ_INPUTS` sets another, and
//! `cargo run --release -p pilotage --example fuzz_readers` says how a million went.
#![allow(clippy::unwrap_used)]

mod fuzzing;

use fuzzing::{Tally, numbers, readers};

/// Runs on one thread, which is the one whose memory is counted.
fn alone<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.unwrap().install(work)
}

#[test]
fn no_input_makes_a_reader_panic_hang_or_fill_the_memory() {
    let inputs = std::env::var("FUZZ_INPUTS").map_or(3_000, |inputs| inputs.parse().unwrap());
    alone(|| {
        let folder = tempfile::tempdir().unwrap();
        for reader in readers(folder.path()) {
            let mut tally = Tally::default();
            for real in &reader.corpus {
                reader.give(real, &mut tally).unwrap();
            }
            assert_eq!(tally.taken, reader.corpus.len() as u64, "{}", reader.name);
            for number in 0..inputs {
                let input = reader.input(1, number);
                if let Err(wound) = reader.give(&input, &mut tally) {
                    let text = String::from_utf8_lossy(&input);
                    panic!("{}, input {number} {wound}:\n{text:.3000}", reader.name);
                }
            }
            // Inputs that are all refused at the door would prove little.
            assert!(tally.taken > inputs / 100, "{}: {tally:?}", reader.name);
        }
    });
}

/// Every number of a checkpoint in turn is put out of its range, and the checksum made right again.
#[test]
fn no_number_of_a_checkpoint_leads_outside() {
    let wrong = [
        "-1",
        "1",
        "3",
        "1000000",
        "9007199254740993",
        "18446744073709551615",
        "-1e308",
        "1e308",
        "1e-320",
    ];
    alone(|| {
        let folder = tempfile::tempdir().unwrap();
        let checkpoints = readers(folder.path()).into_iter().skip(2);
        for reader in checkpoints {
            let mut tally = Tally::default();
            for (of, whole) in reader.corpus.iter().enumerate() {
                let places = numbers(whole);
                // All of the first ones of a kind, and some of those that only go on.
                let stride = (places.len() / 150).max(1);
                for (i, &(from, to)) in places.iter().enumerate().skip(of).step_by(stride) {
                    let mut input = whole.clone();
                    let new = wrong[(i / stride + of) % wrong.len()];
                    input.splice(from..to, new.bytes());
                    if let Err(wound) = reader.give(&input, &mut tally) {
                        let before =
                            String::from_utf8_lossy(&whole[from.saturating_sub(300)..from]);
                        panic!("{}: {new} after ...{before} {wound}", reader.name);
                    }
                }
            }
            assert!(tally.taken < tally.inputs, "{}: {tally:?}", reader.name);
        }
    });
}
