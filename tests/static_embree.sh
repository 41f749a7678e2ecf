#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# libkuafu with Embree linked into it (KUAFU_STATIC_EMBREE), in build/static_embree: nothing of Embree is seen from outside, a host that defines
# Embree's names is not disturbed, Embree's tests and the laws hold, and the wheel and the Debian package made of it neither bring nor ask for an Embree.
# Where the source of Embree cannot be reached it says so and passes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tree=build/static_embree
library=$tree/lib/libkuafu.so.1

fail() {
  echo "static_embree: $*" >&2
  exit 1
}

# refuse MESSAGE PATTERN COMMAND...: what the command prints must be something, and may not have the pattern.
refuse() {
  local message=$1 pattern=$2 printed
  shift 2
  printed=$("$@")
  [ -n "$printed" ] || fail "$1 printed nothing"
  ! grep -E -- "$pattern" <<<"$printed" || fail "$message"
}

echo "== Embree linked into libkuafu"
status=0
bash capi/packaging/embree_archives.sh build/embree || status=$?
if [ $status -eq 3 ]; then
  echo "skipped: the source of Embree is out of reach"
  exit 0
fi
[ $status -eq 0 ] || exit $status
launcher=()
if command -v ccache >/dev/null; then
  launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
  export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$PWD} CCACHE_NOHASHDIR=1
fi
cmake -S . -B $tree -G Ninja -DCMAKE_BUILD_TYPE=Release -DKUAFU_STATIC_EMBREE=ON -Dembree_ROOT="$PWD/build/embree" -DACTIVESTEREO_PYTHON=OFF \
  -DACTIVESTEREO_BENCH=OFF "${launcher[@]}" >/dev/null
cmake --build $tree --target kuafu simsense kuafu-import-gltf kuafu-import-mesh kuafu-import-assimp kuafu_accel_tests kuafu_laws_tests

refuse "$library shows functions of Embree" ' rtc' nm -D --defined-only "$library"
refuse "$library asks for a library of Embree" 'NEEDED.*(embree|tbb)' readelf -d "$library"
refuse "$library still opens Embree at run time" 'libembree3[.]so' strings "$library"
ACTIVESTEREO_BUILD=$PWD/$tree /usr/bin/python3 -m pytest -q tests/install/test_host.py
for program in kuafu_accel_tests kuafu_laws_tests; do
  "$tree/bin/$program" --gtest_brief=1 --gtest_filter='*Embree*'
done

bash tests/wheel.sh $tree
refuse "the wheel brings Embree beside libkuafu" 'libembree|libtbb[.]' /usr/bin/python3 -m zipfile -l build/wheel_test/activestereo-*.whl
(cd $tree && cpack -G DEB >/dev/null)
refuse "the Debian package asks for Embree" 'embree|tbb' dpkg-deb -f $tree/libkuafu[0-9]*_*.deb Depends
echo "== Embree is inside: libkuafu has $(($(stat -Lc %s "$library") / 1000)) kB"
