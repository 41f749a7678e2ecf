#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Looks for inputs that break the readers of untrusted bytes with clang's libFuzzer, led by comparisons as well as by code: tests/fuzz.sh
# [SECONDS], for each program (default 60; an hour finds more). It starts from the kept inputs. One that breaks something is left in
# build/fuzz/found: keep it in tests/fuzz/corpus with the fix. Needs Debian's clang and libclang-rt-dev; without them it says so and does
# nothing. The programs that need the whole libraries, and all where clang is missing, are run by tests/fuzz/driver.cpp (README.md there).
set -euo pipefail
seconds=${1:-60}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
if ! command -v clang++ >/dev/null || ! echo 'extern "C" int LLVMFuzzerTestOneInput(const char*, unsigned long) { return 0; }' |
  clang++ -x c++ -fsanitize=fuzzer,address - -o /dev/null 2>/dev/null; then
  echo "SKIPPED libFuzzer: there is no clang++ with it here (Debian: clang libclang-rt-dev)"
  exit 0
fi
cmake -S tests/fuzz -B build/fuzz -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_COMPILER=clang++ >/dev/null
cmake --build build/fuzz
status=0
fuzz() { # fuzz NAME FOLDER_OF_SEEDS...
  local name=$1
  shift
  echo "== libFuzzer: $name, $seconds s"
  mkdir -p build/fuzz/found "build/fuzz/work/$name"
  ASAN_OPTIONS=detect_leaks=0 "build/fuzz/fuzz_$name" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 -max_len=8192 -verbosity=0 \
    -artifact_prefix="build/fuzz/found/${name}_" "build/fuzz/work/$name" "$@" || status=1
}
fuzz image tests/fuzz/corpus/image tests/kuafu/io/images
fuzz gltf tests/fuzz/corpus/gltf
fuzz wire tests/fuzz/corpus/wire
exit $status
