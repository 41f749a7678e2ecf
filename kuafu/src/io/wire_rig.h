// SPDX-License-Identifier: Apache-2.0
// A rig (scene/rig.h) in a helper program's answer.
#pragma once

#include "io/wire_stream.h"
#include "scene/rig.h"

namespace kuafu {

void transfer(Writer& to, const Rig& rig);
/// Reads a rig without checks; Scene::add_rig checks it.
void transfer(Reader& from, Rig& rig);

}  // namespace kuafu
