#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The tracers' agreement and the renderer's laws under another Mesa: each_tracer.sh MESA_SCRIPT NAME, where MESA_SCRIPT runs a command under it, or
# ends with 3 where its packages, NAME, cannot be reached: then this says so and passes.
set -euo pipefail
status=0
bash "$1" true || status=$?
if [ $status -eq 3 ]; then
  echo "skipped: $2 is out of reach"
  exit 0
fi
[ $status -eq 0 ] || exit $status
shards=$(nproc)
for program in kuafu_accel_tests kuafu_laws_tests; do
  running=()
  for ((shard = 0; shard < shards; shard++)); do
    GTEST_TOTAL_SHARDS=$shards GTEST_SHARD_INDEX=$shard bash "$1" "build/bin/$program" --gtest_brief=1 --gtest_filter='*Tracer*' &
    running+=($!)
  done
  for process in "${running[@]}"; do
    wait "$process" || status=1
  done
done
exit $status
