#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The long set behind tests/run.sh --full: sanitizers over the C++ tests, a minute of fuzzing for each reader and interface, ray tracing pipelines, Embree linked into libkuafu,
# the depth engine on ARM (emulated), and the practice captures at full quality (ACTIVESTEREO_FULL=1 for pytest, set by tests/run.sh). Each part says what it ran.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
status=0

echo "== full: address and undefined-behaviour sanitizers, in build/sanitize"
bash tests/sanitize.sh address || status=1

echo "== full: thread sanitizer, in build/tsan"
bash tests/sanitize.sh thread || status=1

echo "== full: fuzzing, a minute each"
bash tests/fuzz.sh 60 || status=1

echo "== full: ray tracing pipelines"
bash tests/rt_pipeline.sh || status=1

echo "== full: the stock Mesa of Debian 12"
bash tests/stock_mesa.sh || status=1

echo "== full: Embree linked into libkuafu"
bash tests/static_embree.sh || status=1

echo "== full: simsense on ARM NEON"
bash tests/neon.sh || status=1
exit $status
