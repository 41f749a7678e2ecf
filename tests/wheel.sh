#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the wheel from the libraries in a build folder (wheel.sh [FOLDER], build by default), installs it into clean virtual environments with
# NumPy 1.24 and with the newest NumPy, and lets each render an infrared pair and measure depth with nothing of this repository or of Debian's
# Python packages in reach. Needs pip, the network and python3-venv: not part of the README's two commands. With --from-source in place of the
# folder the libraries are built by pip too.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
from=${1:-build}
work=$root/build/wheel_test
rm -rf "$work"
mkdir -p "$work"
take_libraries=()
if [ "$from" != --from-source ]; then
  cmake --install "$from" --prefix "$work/prefix" >/dev/null
  take_libraries=(--config-settings "cmake.define.ACTIVESTEREO_LIBRARIES=$work/prefix")
fi
/usr/bin/python3 -m venv "$work/build"
"$work/build/bin/pip" wheel -q --no-deps "${take_libraries[@]}" -w "$work" .
wheel=$(ls "$work"/activestereo-*.whl)
size=$(stat -c %s "$wheel")
unpacked=$(/usr/bin/python3 -c 'import sys, zipfile; print(sum(i.file_size for i in zipfile.ZipFile(sys.argv[1]).infolist()))' "$wheel")
echo "== wheel: $(basename "$wheel"), $((size / 1000000)) MB, $((unpacked / 1000000)) MB unpacked"
if [ "$size" -gt 40000000 ]; then
  echo "the wheel has more than 40 MB" >&2
  exit 1
fi
for numpy in "numpy==1.24.*" "numpy>=2"; do
  environment=$work/$(echo "$numpy" | tr -dc 'a-z0-9')
  /usr/bin/python3 -m venv "$environment"
  "$environment/bin/pip" install -q "$wheel" "$numpy"
  (cd "$environment" && env -u PYTHONPATH -u LD_LIBRARY_PATH bin/python "$root/tests/wheel_check.py")
  (cd "$environment" && env -u PYTHONPATH bin/activestereo --help >/dev/null)
  if ! ldd "$environment"/lib/python3*/site-packages/kuafu/lib/kuafu-import-assimp | grep libassimp | grep -q "$environment"; then
    echo "the reader of OBJ files does not find the wheel's own assimp" >&2
    exit 1
  fi
done
