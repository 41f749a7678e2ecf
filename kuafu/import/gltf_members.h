// SPDX-License-Identifier: Apache-2.0
// glTF allows members that it does not know, and readers pass over them: a member that is misspelt would change the scene without a word.
#pragma once

#include <nlohmann/json.hpp>

#include "import/import.h"

namespace kuafu {

/// One warning for each name that glTF 2.0 does not have where it stands (extensions and extras may hold anything), at its first place; the
/// nearest name is offered where one is near. After ten names one warning stands for the others.
void warn_of_unknown_members(Import& import, const nlohmann::json& root);

}  // namespace kuafu
