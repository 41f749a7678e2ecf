#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the wheel for each Python from 3.10 to 3.13 that is found here (pyenv's, or python3.N on the path) beside Debian's 3.11, and runs the
# Python tests that need no package of Debian's against it: those of the lab's threads and figures on all, the lab's slow ones on the newest.
# Takes the libraries from a build folder (pythons.sh [FOLDER], build by default). Needs pip and its index; ends with 0 and the reason without.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
work=$root/build/pythons
quick=(tests/python/common tests/python/effects tests/python/diagnose/test_many_diagnoses.py tests/python/diagnose/test_refine_by_rendering.py
  tests/python/diagnose/test_fit_cache.py tests/python/diagnose/test_parallel_prefit.py tests/python/camera tests/python/model)
slow=(tests/python/diagnose tests/python/compare)
python_of() {
  local found
  for found in "${PYENV_ROOT:-$HOME/.pyenv}"/versions/"$1".*/bin/python "$(command -v "python$1" || true)"; do
    [ -x "$found" ] && "$found" -c 'import ensurepip, ssl' 2>/dev/null && echo "$found" && return
  done
}
found=()
for version in 3.10 3.12 3.13; do
  python=$(python_of "$version" || true)
  if [ -z "$python" ]; then
    echo "== Python $version: skipped, it is not installed here"
  else
    found+=("$version=$python")
  fi
done
[ "${#found[@]}" -gt 0 ] || exit 0
mkdir -p "$work"
cmake --install "${1:-build}" --prefix "$work/prefix" >/dev/null
status=0
for entry in "${found[@]}"; do
  version=${entry%%=*}
  environment=$work/$version
  "${entry#*=}" -m venv "$environment"
  if ! "$environment/bin/pip" install -q pytest pytest-xdist jsonschema "opencv-python-headless>=4.6" 2>"$work/pip.log"; then
    echo "== Python $version: skipped, pip does not reach its index ($(tail -n 1 "$work/pip.log"))"
    continue
  fi
  "$environment/bin/pip" install -q --force-reinstall --no-deps --config-settings "cmake.define.ACTIVESTEREO_LIBRARIES=$work/prefix" .
  "$environment/bin/pip" install -q "activestereo[lab]"
  tests=("${quick[@]}")
  [ "$version" != 3.13 ] || tests+=("${slow[@]}")
  echo "== Python $version"
  # The sources' python folder holds no built modules: the wheel's are imported.
  env -u PYTHONPATH ACTIVESTEREO_BUILD="$work/none" "$environment/bin/python" -m pytest -q -n 2 --dist loadscope -p no:cacheprovider "${tests[@]}" || status=1
done
exit $status
