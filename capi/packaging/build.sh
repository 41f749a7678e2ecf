#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing from Debian's packages, then builds everything (Release) into build/. Run again at once it does only what changed.
# Sourced by examples/quickstart.sh and tests/run.sh; can be run by itself. Never touches package sources.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

missing_packages() {
  local package
  grep -hv '^#' "$@" | while read -r package; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || echo "$package"
  done
}

# install_packages LIST...: nothing to do is silent; needs root or sudo only when something is missing.
install_packages() {
  local missing sudo=()
  missing=$(missing_packages "$@")
  [ -z "$missing" ] && return 0
  if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null; then
      echo "These Debian packages are missing and neither root nor sudo is at hand to install them:" >&2
      echo $missing >&2
      exit 2
    fi
    sudo=(sudo)
  fi
  echo "== installing from Debian: "$missing
  "${sudo[@]}" apt-get update -qq
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
}

# configure [-D...]: settings of an earlier build stay, but for those given.
configure() {
  echo "== building into build/ (Release)"
  local launcher=()
  if command -v ccache >/dev/null; then
    launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
    export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$root} CCACHE_NOHASHDIR=1  # what one checkout compiled, another takes
  fi
  cmake -S "$root" -B "$root/build" -G Ninja -DCMAKE_BUILD_TYPE=Release "${launcher[@]}" "$@" >/dev/null
}

# Both libraries, the programs beside them and the Python modules.
build_product() {
  local first=()
  [ -f "$root/build/CMakeCache.txt" ] || first=(-DACTIVESTEREO_TESTS=OFF -DACTIVESTEREO_BENCH=OFF -DACTIVESTEREO_UNITY=ON)
  configure "${first[@]}"
  cmake --build "$root/build" --target product
}

# The tests and benchmarks too.
build_all() {
  configure -DACTIVESTEREO_TESTS=ON -DACTIVESTEREO_BENCH=ON
  cmake --build "$root/build"
}

if [ "${BASH_SOURCE[0]}" = "$0" ]; then
  install_packages "$root/capi/packaging/debian-packages.txt" "$root/tests/debian-packages.txt"
  build_all
fi
