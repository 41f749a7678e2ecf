// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bindings/buffer.h"
#include "bindings/progress.h"
#include "simsense/simsense.h"

namespace ks_python {

KS_BINDING_API(Simsense, simsense);

void bind_engine(py::module_& module);

}  // namespace ks_python
