// SPDX-License-Identifier: Apache-2.0
// Collada files that assimp 5.2.5 trusts, and then crashes on or never returns from. A clear error is better than the end of the process.
#pragma once

#include <string_view>

#include "import/import.h"

namespace kuafu {

/// Rewrites a Collada file so that assimp reads it correctly: in UTF-8, without blanks around numbers and names, without cameras, lights
/// and animations, which are not shown. Throws KS_ERROR_FILE for an accessor that exceeds its array.
std::vector<uint8_t> plain_collada(Import& import, std::string_view file);

}  // namespace kuafu
