#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The long set behind tests/run.sh --full: address and undefined-behaviour sanitizers over the C++ tests, ray tracing pipelines, the depth engine on ARM
# (emulated), and the practice captures at full quality (ACTIVESTEREO_FULL=1 for pytest, set by tests/run.sh). Each part says what it ran.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
status=0

echo "== full: sanitizers (address, undefined) in build/sanitize"
cmake -S . -B build/sanitize -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DACTIVESTEREO_SANITIZE=address,undefined -DACTIVESTEREO_PYTHON=OFF -DACTIVESTEREO_BENCH=OFF >/dev/null
cmake --build build/sanitize
# Mesa and LLVM keep what they allocate until the process ends, so leaks are not counted here; memory over add/remove rounds has tests of its own.
ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 ctest --test-dir build/sanitize --output-on-failure -j "$(nproc)" --timeout 1800 |
  tail -n 15 || status=1

echo "== full: fuzzing, a minute each, under the sanitizers and another seed every day"
for program in build/sanitize/bin/fuzz_*; do
  seeds=tests/fuzz/corpus/${program##*fuzz_}
  (cd build/sanitize && ASAN_OPTIONS=detect_leaks=0 "$root/$program" -seconds=60 -seed="$(date +%Y%j)" "$root/$seeds") || status=1
done
bash tests/fuzz.sh 60 || status=1

echo "== full: ray tracing pipelines"
bash tests/rt_pipeline.sh || status=1

echo "== full: the stock Mesa of Debian 12"
bash tests/stock_mesa.sh || status=1

echo "== full: simsense on ARM NEON"
bash tests/neon.sh || status=1
exit $status
