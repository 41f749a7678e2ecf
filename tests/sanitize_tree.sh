# SPDX-License-Identifier: Apache-2.0
# sanitize_tree address|thread: configures the build under those sanitizers and names its folder in `tree`. For scripts that build in it.
sanitize_tree() {
  local sanitizers=$1
  tree=build/tsan
  [ "$sanitizers" = thread ] || tree=build/sanitize sanitizers=address,undefined
  local launcher=()
  command -v ccache >/dev/null && launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache -DCMAKE_C_COMPILER_LAUNCHER=ccache)
  cmake -S . -B "$tree" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS=-O1 -DCMAKE_C_FLAGS=-O1 -DACTIVESTEREO_SANITIZE="$sanitizers" \
    -DACTIVESTEREO_LED_FUZZERS=ON -DACTIVESTEREO_PYTHON=OFF -DACTIVESTEREO_BENCH=OFF "${launcher[@]}" >/dev/null
}
