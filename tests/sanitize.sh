#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The C and C++ tests under sanitizers, in a build folder of their own: tests/sanitize.sh address|thread [REGEX OF TESTS]
#   address  AddressSanitizer and UndefinedBehaviorSanitizer over every test (build/sanitize).
#   thread   ThreadSanitizer over the tests in which threads of ours meet (build/tsan); tests/sanitize_thread.supp has what is known of others.
# tests/run.sh --full runs both whole, .ci/run the part of ThreadSanitizer that builds in a minute (thread small).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
kind=${1:?address or thread}
. tests/sanitize_tree.sh
sanitize_tree "$kind"
# Mesa and LLVM keep what they allocate until the process ends, so leaks are not counted here; Rounds.* counts the heap.
export ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
# Drivers, Embree and TBB are not compiled for the sanitizer: what they do between their own threads is not looked at.
export TSAN_OPTIONS="ignore_noninstrumented_modules=1:die_after_fork=0:second_deadlock_stack=1:suppressions=$root/tests/sanitize_thread.supp"
tests=(-R .)
case "$kind:${2:-}" in
  thread:)
    threads='*ThreadPool*:*HostThreads*:*HostMemory*:*HostServices*:*Handles*:*Device.*:*ComputeTest*:*CacheFile*:*Cancel*:*Submit*:*Fork*:*ThreadEnd*'
    threads+=':*LiveScene.ScenesAndRenderers*:*ImportProcess.Threads*:*any_number_of_workers*:*any_thread_count*:*Rounds*:Engine*:*Signal.*:*matcher_sizes*:*Imager.Gives*'
    # The programs that have these tests; building the others takes as long again.
    programs=(capi_tests device_tests kuafu_api_tests kuafu_io_tests kuafu_laws_tests simsense_api_tests simsense_match_tests simsense_signal_tests)
    cmake --build "$tree" --target "${programs[@]}"
    export tree threads
    printf '%s\n' "${programs[@]}" | xargs -P "$(nproc)" -I{} bash -c \
      '"$tree/bin/{}" --gtest_filter="$threads" >"$tree/{}.log" 2>&1 && tail -n 1 "$tree/{}.log" || { cat "$tree/{}.log"; exit 1; }'
    exit
    ;;
  thread:small)
    cmake --build "$tree" --target device_tests
    exec ctest --test-dir "$tree" --output-on-failure -j "$(nproc)" --timeout 600 -R 'ThreadPool|[.]Device$|ComputeTest|CacheFile'
    ;;
  *:?*) tests=(-R "$2") ;;
esac
cmake --build "$tree"
ctest --test-dir "$tree" --output-on-failure -j "$(nproc)" --timeout 7200 "${tests[@]}" >"$tree/ctest.log" 2>&1 || {
  cat "$tree/ctest.log"
  exit 1
}
tail -n 15 "$tree/ctest.log"
