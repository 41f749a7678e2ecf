// SPDX-License-Identifier: Apache-2.0
// glTF allows members that it does not know, and readers pass over them: a member that is misspelt would change the scene without a word.
#pragma once

#include <nlohmann/json.hpp>

#include "import/import.h"

namespace kuafu {

/// Warns once of each member that glTF 2.0 does not know at its place, with the nearest known name. Extensions and extras may hold
/// anything. After ten names, one warning counts the rest.
void warn_of_unknown_members(Import& import, const nlohmann::json& root);

}  // namespace kuafu
