#!/usr/bin/env bash
# Makes docs/gallery.md and its pictures: every problem of the gallery solved, measured against its rule of thumb, and drawn.
# With names of problems, a page of these alone is printed, and only they are drawn.
set -euo pipefail
cd "$(dirname "$0")/.."

kept=target/gallery
rm -rf "$kept"
mkdir -p docs/gallery
out=(--out docs/gallery.md)
[ $# -eq 0 ] || out=()
cargo run --release --locked -p pilotage --example benchmarks -- --gallery "$kept" "${out[@]}" "$@"
for policy in "$kept"/*.json; do
  cargo run --release --locked -- draw "$policy" --out docs/gallery
done
rm -f docs/gallery/*-automaton.svg
