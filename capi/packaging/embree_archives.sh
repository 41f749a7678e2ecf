#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the archives of Embree 3 that KUAFU_STATIC_EMBREE links into libkuafu, of which Debian has none: embree_archives.sh [PREFIX] (build/embree).
# The source is Debian's own, from the mirror that the machine is set up with (private lists, nothing is installed); EMBREE_SOURCE names an unpacked
# one where there is no network. Of Embree only what kuafu uses is built: triangles and instances, its own tasks instead of TBB's.
# Exit status 3: the source cannot be reached.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
prefix=$(realpath -m "${1:-$root/build/embree}")
work=$prefix/work
. "$root/capi/packaging/mirror.sh"

give_up() {
  echo "embree_archives: $*" >&2
  exit 3
}

fetch_source() {
  local uri
  command -v apt-get >/dev/null || give_up "there is no apt-get; name an unpacked source in EMBREE_SOURCE"
  uri=$(mirror_uri)
  [ -n "$uri" ] || give_up "apt knows no mirror of this release; run apt-get update first, or name a source in EMBREE_SOURCE"
  mkdir -p "$work/apt/lists/partial" "$work/source"
  echo "deb-src [signed-by=$debian_key] $uri $release main" >"$work/apt/sources.list"
  apt_in "$work" apt-get update -qq -o APT::Update::Error-Mode=any >&2 || give_up "the mirror has no lists of sources; name a source in EMBREE_SOURCE"
  (cd "$work" && apt_in "$work" apt-get source -qq --download-only --tar-only embree >&2) || give_up "the source of Embree cannot be downloaded"
  tar -xf "$work"/embree_*.orig.tar.* -C "$work/source" --strip-components=1
  touch "$work/source/readme.pdf"  # Debian leaves it out, Embree's rules install it
}

if [ -f "$prefix/lib/libembree3.a" ] && [ ! -d "$work" ]; then  # the work goes last
  exit 0
fi
rm -rf "$work"
if [ -z "${EMBREE_SOURCE:-}" ]; then
  fetch_source
  EMBREE_SOURCE=$work/source
fi
# Code for several kinds of processor, of which Embree takes the best at run time: any x86-64, AVX, AVX2 and AVX-512.
instructions=()
[ "$(uname -m)" != x86_64 ] || instructions=(-DEMBREE_MAX_ISA=NONE -DEMBREE_ISA_SSE42=OFF -DEMBREE_ISA_AVX=ON -DEMBREE_ISA_AVX2=ON -DEMBREE_ISA_AVX512=ON)
without=()
for part in TUTORIALS ISPC_SUPPORT GEOMETRY_QUAD GEOMETRY_CURVE GEOMETRY_SUBDIVISION GEOMETRY_USER GEOMETRY_GRID GEOMETRY_POINT; do
  without+=("-DEMBREE_$part=OFF")
done
launcher=()
! command -v ccache >/dev/null || launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
cmake -S "$EMBREE_SOURCE" -B "$work/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DCMAKE_INSTALL_PREFIX="$prefix" \
  -DCMAKE_INSTALL_LIBDIR=lib -DEMBREE_STATIC_LIB=ON -DEMBREE_TASKING_SYSTEM=INTERNAL "${without[@]}" "${instructions[@]}" "${launcher[@]}" >/dev/null
cmake --build "$work/build"
cmake --install "$work/build" >/dev/null
rm -rf "$work"
