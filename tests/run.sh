#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds if needed and runs every test: ctest for C and C++, pytest for Python. Ends with the runners' own closing lines.
# --full adds what takes long (tests/full.sh): sanitizers, ray tracing pipelines, ARM, the practice captures at full quality.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
full=0
for argument in "$@"; do
  case "$argument" in
    --full) full=1 ;;
    -h | --help)
      echo "usage: bash tests/run.sh [--full]"
      exit 0
      ;;
    *)
      echo "tests/run.sh: unknown argument '$argument' (known: --full)" >&2
      exit 2
      ;;
  esac
done
. "$root/capi/packaging/build.sh"
install_packages "$root/capi/packaging/debian-packages.txt" "$root/tests/debian-packages.txt"
build_all
cd "$root"
status=0
if [ "$full" -eq 1 ]; then
  bash tests/full.sh || status=1
  export ACTIVESTEREO_FULL=1
fi
echo "== ctest"
ctest --test-dir build --output-on-failure -j "$(nproc)" --progress >build/ctest.log 2>&1 || {
  status=1
  cat build/ctest.log
}
echo "== pytest"
workers=$(nproc)  # a worker renders on all cores and may take 2 GB: more than four gain nothing
[ "$workers" -le 4 ] || workers=4
ACTIVESTEREO_BUILD="$root/build" PYTHONPATH="$root/build/python" /usr/bin/python3 -m pytest -q -rs --durations=15 -n "$workers" --dist loadscope tests || status=1
echo "== ctest said"
grep -A 1 ': Skipped$' build/Testing/Temporary/LastTest.log | grep -v -e '^--' -e ': Skipped$' | sort | uniq -c || true
tail -n 12 build/ctest.log
exit $status
