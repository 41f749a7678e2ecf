// SPDX-License-Identifier: Apache-2.0
#include "accel/embree_library.h"

#include <dlfcn.h>

#include "device/error.h"

namespace kuafu {
namespace {

constexpr const char* file_name = "libembree3.so.3";

template <class Function>
void find(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(dlsym(library, name));
  if (!function) ks::fail(KS_ERROR_UNSUPPORTED, "%s lacks the function %s: it is no Embree 3", file_name, name);
}

EmbreeLibrary open_library() {
  // Never closed: its worker threads may outlive every device.
  void* library = dlopen(file_name, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (!library) {
    const char* reason = dlerror();
    ks::fail(KS_ERROR_UNSUPPORTED, "Embree cannot be opened (%s): install Debian's libembree3-3, or use KUAFU_TRACER_COMPUTE",
             reason ? reason : file_name);
  }
  EmbreeLibrary table;
#define KUAFU_FIND(name) find(library, #name, table.name);
  KUAFU_EMBREE_FUNCTIONS(KUAFU_FIND)
#undef KUAFU_FIND
  return table;
}

}  // namespace

const EmbreeLibrary& embree_library() {
  static const EmbreeLibrary opened = open_library();
  return opened;
}

}  // namespace kuafu
