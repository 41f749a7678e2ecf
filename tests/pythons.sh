#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds and tries the wheels of the Pythons from 3.10 to 3.13 that are found here beside Debian's 3.11 (python/wheels.sh), and runs the Python
# tests that need no package of Debian's against each: those of the lab's threads and figures on all, the lab's slow ones on the newest.
# Takes the libraries from a build folder (pythons.sh [FOLDER], build by default). Needs pip and its index.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
work=$root/build/pythons
quick=(tests/python/common tests/python/effects tests/python/diagnose/test_many_diagnoses.py tests/python/diagnose/test_refine_by_rendering.py
  tests/python/diagnose/test_fit_cache.py tests/python/diagnose/test_parallel_prefit.py tests/python/camera tests/python/model)
slow=(tests/python/diagnose tests/python/compare)
rm -rf "$work"
bash python/wheels.sh --libraries "${1:-build}" --out "$work" 3.10 3.12 3.13
status=0
for wheel in "$work"/*.whl; do
  [ -f "$wheel" ] || continue
  version=$(sed -E 's/.*-cp3([0-9]+)-.*/3.\1/' <<<"$wheel")
  environment=$root/build/wheels/clean-$version
  "$environment/bin/pip" install -q "$wheel[lab]" pytest pytest-xdist jsonschema pyyaml
  tests=("${quick[@]}")
  [ "$version" != 3.13 ] || tests+=("${slow[@]}")
  echo "== Python $version"
  # The sources' python folder holds no built modules: the wheel's are imported.
  env -u PYTHONPATH ACTIVESTEREO_BUILD="$work/none" "$environment/bin/python" -m pytest -q -n 2 --dist loadscope -p no:cacheprovider "${tests[@]}" || status=1
done
exit $status
