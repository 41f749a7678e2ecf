#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# From a fresh Debian 12 to an active stereo depth sensor at work: installs what is missing, builds, and runs 'activestereo demo' on the best Vulkan
# device there is: the example's table as a D435 sees it, and an effect that was hidden and is found. Options go to that command.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/capi/packaging/build.sh"
install_packages "$root/capi/packaging/debian-packages.txt"
build_product
cd "$root"
rm -rf out/quickstart
build/bin/activestereo demo --out out/quickstart "$@"
