// SPDX-License-Identifier: Apache-2.0
#include "api/optics_desc.h"

#include "api/fields.h"
#include "api/struct_table.h"
#include "device/struct_read.h"

namespace kuafu {

Optics read_optics(const kuafu_optics_desc* desc, const std::string& view) {
  Optics optics;
  if (desc == nullptr) return optics;
  copy_fields(ks::read_struct(desc, KUAFU_TYPE_OPTICS_DESC, "optics desc"), optics);
  check_fields(optics, view + ".optics.");
  if (optics.defocuses() && !(optics.defocus_focus_m > 0.0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s.optics.defocus_focus_m is %g, it must be > 0 where there is a lens", view.c_str(),
             optics.defocus_focus_m);
  return optics;
}

}  // namespace kuafu
