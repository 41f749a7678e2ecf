#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds if needed and runs every test: ctest for C and C++, pytest for Python. Ends with the runners' own closing lines.
# --full adds what takes long (tests/full.sh): sanitizers, ray tracing pipelines, ARM, the practice captures at full quality.
# --quick runs, for at most two minutes, the tests of the files that differ from main: C++ by folder, Python by imports.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
full=0 quick=0
for argument in "$@"; do
  case "$argument" in
    --full) full=1 ;;
    --quick) quick=1 ;;
    -h | --help)
      echo "usage: bash tests/run.sh [--full | --quick]"
      exit 0
      ;;
    *)
      echo "tests/run.sh: unknown argument '$argument' (known: --full, --quick)" >&2
      exit 2
      ;;
  esac
done
. "$root/capi/packaging/build.sh"

# The C++ test programs and Python test files of the files that differ from main.
programs_of() {
  sed -nE 's#^(kuafu|simsense)/src/(\w+)/.*#\1/\2#p; s#^tests/((kuafu|simsense)/\w+)/.*_test\.cpp#\1#p; s#^(capi/device)/.*#\1#p' | sort -u |
    while read -r folder; do sed -nE "s#^ks_test\((\w+) [^)]*\b$folder\b.*#\1#p" "$root/tests/CMakeLists.txt"; done | sort -u
}
python_tests_of() {
  while read -r path; do
    case "$path" in
      tests/*/test_*.py) [ ! -f "$path" ] || echo "$path" ;;
      python/*/*.py) module=${path#python/} module=${module%.py} && grep -rlE "\b${module//\//\\.}\b" --include='test_*.py' tests/python || true ;;
    esac
  done | sort -u
}
if [ "$quick" -eq 1 ]; then
  cd "$root"
  [ -f build/build.ninja ] || configure -DACTIVESTEREO_TESTS=ON -DACTIVESTEREO_BENCH=OFF
  changed=$({ git diff --name-only "$(git merge-base main HEAD)" && git ls-files --others --exclude-standard; } | sort -u)
  mapfile -t programs < <(programs_of <<<"$changed")
  cmake --build build --target product "${programs[@]}" >build/quick.log || { tail -n 30 build/quick.log && exit 1; }
  for program in "${programs[@]}"; do timeout "$((SECONDS < 118 ? 120 - SECONDS : 2))" "build/bin/$program" --gtest_brief=1 || [ $? -eq 124 ] || exit 1; done
  mapfile -t files < <(python_tests_of <<<"$changed")
  status=0
  ACTIVESTEREO_BUILD="$root/build" PYTHONPATH="$root/build/python" timeout --signal=INT "$((SECONDS < 110 ? 120 - SECONDS : 10))" \
    /usr/bin/python3 -m pytest -q -x tests/architecture "${files[@]}" || status=$?
  [ "$status" -ne 124 ] || { echo "two minutes are over: bash tests/run.sh runs the rest" && status=0; }
  exit "$status"
fi
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
