#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds and tries the wheels of the Pythons from 3.10 to 3.13 that are found here beside Debian's 3.11 (python/wheels.sh), and runs all Python tests
# against each; what is skipped is printed with its reason. Takes the libraries from a build folder.
# Usage: bash tests/pythons.sh [FOLDER [TEST ...]] (build, tests/python). Needs pip and its index.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
work=$root/build/pythons
libraries=${1:-build}
tests=("${@:2}")
[ ${#tests[@]} -gt 0 ] || tests=(tests/python)
rm -rf "$work"
bash python/wheels.sh --libraries "$libraries" --out "$work" 3.10 3.12 3.13
status=0
for wheel in "$work"/*.whl; do
  [ -f "$wheel" ] || continue
  version=$(sed -E 's/.*-cp3([0-9]+)-.*/3.\1/' <<<"$wheel")
  environment=$root/build/wheels/clean-$version
  "$environment/bin/pip" install -q "$wheel[lab,bags,yaml]" pytest pytest-xdist jsonschema
  echo "== Python $version"
  # The sources' python folder holds no built modules: the wheel's are imported. Tests find the command in the environment.
  env -u PYTHONPATH ACTIVESTEREO_BUILD="$environment" "$environment/bin/python" -m pytest -q -rs -n 2 --dist loadscope -p no:cacheprovider \
    "${tests[@]}" || status=1
done
exit $status
