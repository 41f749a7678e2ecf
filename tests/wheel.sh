#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the wheel from the libraries in a build folder (wheel.sh [FOLDER], build by default), installs it into clean virtual environments with
# NumPy 1.24 and with the newest NumPy, and lets each render an infrared pair and measure depth with nothing of this repository or of Debian's
# Python packages in reach; without a Vulkan driver each says what to install. Needs pip, the network and python3-venv: not part of the README's
# two commands. With --from-source in place of the folder the libraries are built by pip too.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
from=${1:-build}
work=$root/build/wheel_test
rm -rf "$work"
mkdir -p "$work"
if [ "$from" = --from-source ]; then
  /usr/bin/python3 -m venv "$work/build"
  "$work/build/bin/pip" wheel -q --no-deps -w "$work" .
else
  bash python/wheels.sh --libraries "$from" --out "$work" "$(/usr/bin/python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')"
fi
wheel=$(ls "$work"/activestereo-*.whl)
unpacked=$(/usr/bin/python3 -c 'import sys, zipfile; print(sum(i.file_size for i in zipfile.ZipFile(sys.argv[1]).infolist()))' "$wheel")
echo "== wheel: $(basename "$wheel"), $(($(stat -c %s "$wheel") / 1000000)) MB, $((unpacked / 1000000)) MB unpacked"
for numpy in "numpy==1.24.*" "numpy>=2"; do
  environment=$work/$(echo "$numpy" | tr -dc 'a-z0-9')
  /usr/bin/python3 -m venv "$environment"
  "$environment/bin/pip" install -q "$wheel" "$numpy"
  (cd "$environment" && env -u PYTHONPATH -u LD_LIBRARY_PATH bin/python "$root/tests/wheel_check.py")
  (cd "$environment" && env -u PYTHONPATH bin/activestereo --help >/dev/null)
  status=0
  (cd "$environment" && env -u PYTHONPATH VK_ICD_FILENAMES=/nonexistent bin/activestereo simulate table_top.gltf --out without 2>said) || status=$?
  if [ $status -ne 2 ] || [ "$(wc -l <"$environment/said")" -ne 1 ] || ! grep -q "install .* mesa-vulkan-drivers" "$environment/said"; then
    echo "without a Vulkan driver it ends with $status and says: $(cat "$environment/said")" >&2
    exit 1
  fi
  if ! ldd "$environment"/lib/python3*/site-packages/kuafu/lib/kuafu-import-assimp | grep libassimp | grep -q "$environment"; then
    echo "the reader of Collada files does not find the wheel's own assimp" >&2
    exit 1
  fi
done
