#!/usr/bin/env bash
# The tracers and the renderer's laws on Debian's own lavapipe (Mesa 22.3: no ray tracing), unpacked into build/, not installed, so that they are
# proved there too where a newer Mesa is installed. Where the packages cannot be reached it says so and passes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
echo "== tracers and laws on the release's own lavapipe"
for program in kuafu_accel_tests kuafu_laws_tests; do
  status=0
  bash tests/support/stock_mesa.sh "build/bin/$program" --gtest_brief=1 --gtest_filter='*Tracer*' || status=$?
  if [ $status -eq 3 ]; then
    echo "skipped: the release's packages are out of reach"
    exit 0
  fi
  [ $status -eq 0 ] || exit $status
done
