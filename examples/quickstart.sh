#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# From a fresh Debian 12 to an active stereo depth sensor at work: installs what is missing, builds, renders the example table-top with the
# D435 preset on the best Vulkan device there is, and leaves the pictures in out/quickstart/.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/capi/packaging/build.sh"
install_packages "$root/capi/packaging/debian-packages.txt"
build_product
cd "$root"
echo "== building the example scene"
mkdir -p out/quickstart
PYTHONPATH="$root/build/python" /usr/bin/python3 -m activestereo.scene_io.example_scene out/quickstart/table_top.gltf
echo "== simulating a D435 in front of it"
build/bin/activestereo simulate out/quickstart/table_top.gltf --sensor d435 --out out/quickstart "$@"
echo "== done: open out/quickstart/overview.png"
