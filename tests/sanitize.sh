#!/bin/sh
# What tests cannot see: the C hosts under AddressSanitizer and UndefinedBehaviorSanitizer, the library's own unsafe code
# under Miri, and its workers under ThreadSanitizer. Takes a quarter of an hour; Miri and ThreadSanitizer need
#
#     rustup toolchain install nightly --profile minimal -c rust-src -c miri
set -eu
cd "$(dirname "$0")/.."
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
host=$(rustc -vV | sed -n "s/^host: //p")

echo "== C and C++ hosts: AddressSanitizer, UndefinedBehaviorSanitizer"
cargo build --locked --release
cmake -DPREFIX="$folder" -P include/install.cmake >/dev/null
flags="-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
make -C c_examples check PREFIX="$folder" BUILD="$folder/build" CFLAGS="$flags" CXXFLAGS="$flags" FFLAGS="$flags"

if ! cargo +nightly miri --version >/dev/null 2>&1; then
    echo "LEFT OUT: Miri and ThreadSanitizer, for want of a nightly toolchain" >&2
    exit 0
fi

echo "== Miri: what is unsafe and small enough"
# rayon's queues are sound by tree borrows, not by stacked ones, and their garbage ends with the process.
MIRIFLAGS="-Zmiri-disable-isolation -Zmiri-tree-borrows -Zmiri-ignore-leaks" cargo +nightly miri test --locked --no-default-features --features reserve --lib -- \
    memory::reserve:: array:: sum:: words:: pool::tests::results

echo "== ThreadSanitizer: workers"
RUSTFLAGS=-Zsanitizer=thread CARGO_TARGET_DIR=target/thread cargo +nightly test --locked -Zbuild-std --target "$host" \
    --no-default-features --lib -- pool:: sum:: space:: operator:: integrator:: solver::
