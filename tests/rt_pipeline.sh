#!/usr/bin/env bash
# The tracers' agreement and the renderer's laws on a lavapipe with ray tracing pipelines (Mesa of bookworm-backports, unpacked into build/, not installed).
# Where that suite cannot be reached it says so and passes: the same tests skip by name in tests/run.sh.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
echo "== tracers and laws on a lavapipe with ray tracing pipelines"
for program in kuafu_accel_tests kuafu_laws_tests; do
  status=0
  bash tests/support/rt_mesa.sh "build/bin/$program" --gtest_brief=1 --gtest_filter='*Tracer*' || status=$?
  if [ $status -eq 3 ]; then
    echo "skipped: bookworm-backports is out of reach"
    exit 0
  fi
  [ $status -eq 0 ] || exit $status
done
