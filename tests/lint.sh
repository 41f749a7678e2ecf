#!/usr/bin/env bash
# clang-format on every C, C++ and GLSL-shared file; ruff (where it is installed: Debian has none) and mypy on Python; clang-tidy on the C++
# files that the last commit (or LINT_BASE) changed, but for those that compile the shaders' text: clang 14 lacks C++20's aggregates in
# parentheses. --no-build leaves out clang-tidy, which needs a build.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/capi/cmake/build.sh"
install_packages "$root/capi/cmake/debian-packages.txt" "$root/tests/debian-packages-lint.txt"
cd "$root"
git ls-files '*.h' '*.hpp' '*.c' '*.cpp' | grep -v '^kuafu/shaders/' | xargs clang-format --dry-run -Werror
echo "== clang-format: clean"
if command -v ruff >/dev/null; then
  ruff check
  echo "== ruff: clean"
else
  echo "== ruff: skipped, it is not installed (pip install ruff)"
fi
/usr/bin/python3 -m mypy
if [ "${1:-}" = --no-build ]; then
  exit 0
fi
base=${LINT_BASE:-$(git rev-parse --verify -q HEAD~1 || git rev-parse HEAD)}
changed=$(git diff --name-only --diff-filter=d "$base" -- '*.cpp' | grep -v '^tests/' | xargs -r grep -L '#include "frame/host_language.h"' || true)
if [ -n "$changed" ]; then
  build_all
  echo "$changed" | xargs -P "$(nproc)" -n 1 clang-tidy --quiet -p build 2>/dev/null
fi
echo "== clang-tidy: clean on $(echo -n "$changed" | grep -c . || true) changed files"
