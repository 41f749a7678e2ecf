// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bindings/buffer.h"
#include "bindings/progress.h"
#include "kuafu/kuafu.h"

namespace ks_python {

KS_BINDING_API(Kuafu, kuafu);

void bind_records(py::module_& module);
void bind_scene(py::module_& module);
void bind_renderer(py::module_& module);

}  // namespace ks_python
