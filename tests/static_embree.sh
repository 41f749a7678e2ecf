#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# libkuafu with Embree linked into it (KUAFU_STATIC_EMBREE), in build/static_embree: nothing of Embree is seen from outside, a host that defines
# Embree's names is not disturbed, Embree's tests and the laws hold, and the wheel and the Debian package made of it neither bring nor ask for an Embree.
# Where the source of Embree cannot be reached it says so and passes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tree=build/static_embree
library=$tree/lib/libkuafu.so.0

fail() {
  echo "static_embree: $*" >&2
  exit 1
}

echo "== Embree linked into libkuafu"
status=0
bash capi/cmake/embree_archives.sh build/embree || status=$?
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
cmake --build $tree --target kuafu simsense kuafu-import-gltf kuafu-import-assimp kuafu_accel_tests kuafu_laws_tests

if nm -D --defined-only "$library" | grep ' rtc'; then fail "$library shows functions of Embree"; fi
if readelf -d "$library" | grep -E 'NEEDED.*(embree|tbb)'; then fail "$library asks for a library of Embree"; fi
if strings "$library" | grep -F libembree3.so; then fail "$library still opens Embree at run time"; fi
ACTIVESTEREO_BUILD=$PWD/$tree /usr/bin/python3 -m pytest -q tests/install/test_host.py
for program in kuafu_accel_tests kuafu_laws_tests; do
  "$tree/bin/$program" --gtest_brief=1 --gtest_filter='*Embree*'
done

bash tests/wheel.sh $tree
if unzip -l build/wheel_test/activestereo-*.whl | grep -E 'libembree|libtbb\.'; then fail "the wheel brings Embree beside libkuafu"; fi
(cd $tree && cpack -G DEB >/dev/null)
if dpkg-deb -f $tree/libkuafu0_*.deb Depends | grep -E 'embree|tbb'; then fail "the Debian package asks for Embree"; fi
echo "== Embree is inside: libkuafu has $(($(stat -Lc %s "$library") / 1000)) kB, $(($(stat -Lc %s build/lib/libkuafu.so.0) / 1000)) kB where it opens Embree"
