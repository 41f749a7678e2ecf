// SPDX-License-Identifier: Apache-2.0
// EXT_meshopt_compression: buffer views whose bytes libmeshoptimizer decodes.
#pragma once

#include <nlohmann/json.hpp>

#include "import/gltf_document.h"

namespace kuafu {

/// Lets compressed views in a file's JSON mean their compressed bytes from here on. Returns whether there was any.
bool read_compressed_views(nlohmann::json& root);

/// Decodes in the tables made of that: every compressed view gets a buffer of its decoded bytes. Throws KS_ERROR_FILE that names the view.
void decode_meshopt(Budget& budget, tinygltf::Model& model);

}  // namespace kuafu
