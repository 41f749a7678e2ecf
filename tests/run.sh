#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds if needed and runs every test: ctest for C and C++, pytest for Python. Ends with the runners' own closing lines.
# --full adds what takes long (tests/full.sh): sanitizers, ray tracing pipelines, ARM, the practice captures at full quality.
# --quick runs, for at most two minutes, the tests of the files that differ from main: C++ by folder, Python by folder and imports.
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
export OPENBLAS_NUM_THREADS=1  # as commands have it: threads of several processes wait for each other

# The folders of C++ tests, and the Python test files, of the files that differ from main. Tests mirror the tree; a folder of a library without
# tests of its own has those of its whole.
cpp_folders_of() {
  sed -nE 's#^simsense/src/((cpu|vulkan)/)?(\w+/)?[^/]*$#simsense/\3#p; s#^simsense/shaders/.*#simsense/#p
    s#^kuafu/(src/(\w+/)|shaders/).*#kuafu/\2#p; s#^capi/device/.*#capi/device/#p
    s#^tests/((kuafu|simsense|capi)/(\w+/)?)\w+_test\.cpp$#\1#p' | sort -u | while read -r folder; do
    if compgen -G "tests/$folder*_test.cpp" >/dev/null; then echo "${folder%/}"
    elif [ "${folder%%/*}" = kuafu ]; then echo kuafu/pathtrace
    else printf '%s\n' simsense/engine simsense/match; fi
  done | sort -u
}
python_tests_of() {
  while read -r path; do
    case "$path" in
      tests/*/test_*.py) [ ! -f "$path" ] || echo "$path" ;;
      python/*/*.py)
        module=${path#python/} module=${module%.py} package=${module#*/}
        grep -rlE "\b${module//\//\\.}\b" --include='test_*.py' tests/python || true
        find "tests/python/${package%%/*}" -maxdepth 1 -name 'test_*.py' 2>/dev/null || true
        ;;
    esac
  done | awk '!seen[$0]++'
}
# "program filter" for each test program with tests of the folders on stdin: build.ninja knows the program of each test file.
programs_of() {
  while read -r folder; do
    suites=$(sed -nE 's#^(TYPED_)?TEST(_[FP])?\((\w+),.*#*\3?*#p' "tests/$folder"/*_test.cpp | sort -u | paste -sd:)
    sed -nE "s#^build tests/CMakeFiles/(\w+)\.dir/$folder/\w+_test\.cpp\.o:.*#\1 $suites#p" build/build.ninja
  done | sort -u
}
if [ "$quick" -eq 1 ]; then
  cd "$root"
  [ -f build/build.ninja ] || configure -DACTIVESTEREO_TESTS=ON -DACTIVESTEREO_BENCH=OFF
  changed=$({ git diff --name-only "$(git merge-base main HEAD)" && git ls-files --others --exclude-standard; } | sort -u)
  mapfile -t programs < <(cpp_folders_of <<<"$changed" | programs_of)
  cmake --build build --target product "${programs[@]%% *}" >build/quick.log || { tail -n 30 build/quick.log && exit 1; }
  status=0 over=0
  for program in "${programs[@]}"; do
    timeout "$((SECONDS < 103 ? 105 - SECONDS : 2))" "build/bin/${program% *}" --gtest_brief=1 --gtest_filter="${program#* }" || status=$?
    [ "$status" -ne 124 ] || over=1 status=0
    [ "$status" -eq 0 ] || exit 1
  done
  mapfile -t files < <(python_tests_of <<<"$changed")
  ACTIVESTEREO_BUILD="$root/build" PYTHONPATH="$root/build/python" timeout --signal=INT "$((SECONDS < 110 ? 120 - SECONDS : 10))" \
    /usr/bin/python3 -m pytest -q -x tests/architecture "${files[@]}" || status=$?
  [ "$status" -ne 124 ] || over=1 status=0
  [ "$over" -eq 0 ] || echo "two minutes are over: bash tests/run.sh runs the rest"
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
