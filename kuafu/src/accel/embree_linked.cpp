// SPDX-License-Identifier: Apache-2.0
// The table of an Embree whose archives are part of this library (KUAFU_STATIC_EMBREE in CMakeLists.txt). Its names end here:
// capi/packaging/kuafu.map exports none of them, and what a host defines under the same names is never asked.
#include "accel/embree_library.h"

namespace kuafu {

const EmbreeLibrary& embree_library() {
  static constexpr EmbreeLibrary linked = {
#define KUAFU_LINKED(name) .name = ::name,
      KUAFU_EMBREE_FUNCTIONS(KUAFU_LINKED)
#undef KUAFU_LINKED
  };
  return linked;
}

}  // namespace kuafu
