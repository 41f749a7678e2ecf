#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Looks for inputs that break the readers of untrusted bytes and the C interfaces, under the address and undefined-behaviour sanitizers:
# tests/fuzz.sh [SECONDS [PROGRAM...]], for each program (default 60; an hour finds more). libFuzzer starts from the kept inputs. One that breaks
# something is left in build/sanitize/found: keep it in tests/fuzz/corpus with the fix.
set -euo pipefail
seconds=${1:-60}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
. tests/sanitize_tree.sh
sanitize_tree address
programs=("${@:2}")
[ ${#programs[@]} -gt 0 ] || programs=(image gltf wire mesh simsense kuafu)
cmake --build "$tree" --target "${programs[@]/#/fuzz_}"
export ASAN_OPTIONS=detect_leaks=0
mkdir -p "$tree/found"
status=0
for name in "${programs[@]}"; do
  seeds=()
  for folder in {"$root","$tree"}"/tests/fuzz/corpus/$name" $([ "$name" = image ] && echo "$root/tests/kuafu/io/images"); do
    [ ! -d "$folder" ] || seeds+=("$folder")
  done
  echo "== $name, $seconds s"
  mkdir -p "$tree/reached/$name"  # what was found to reach new code, for the next time
  "$tree/bin/fuzz_$name" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=4096 -max_len=8192 -verbosity=0 -print_final_stats=1 \
    -artifact_prefix="$tree/found/${name}_" "$tree/reached/$name" "${seeds[@]}" || status=1
done
exit $status
