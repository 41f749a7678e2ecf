// SPDX-License-Identifier: Apache-2.0
// EXT_meshopt_compression: buffer views whose bytes libmeshoptimizer decodes.
#pragma once

#include <nlohmann/json.hpp>

#include "import/gltf_document.h"

namespace kuafu {

/// Makes compressed views in a file's JSON refer to their compressed bytes. Returns whether there were any.
bool read_compressed_views(nlohmann::json& root);

/// Decodes the views that read_compressed_views() found, each into a buffer of its own. Throws KS_ERROR_FILE with the view.
void decode_meshopt(Budget& budget, tinygltf::Model& model);

}  // namespace kuafu
