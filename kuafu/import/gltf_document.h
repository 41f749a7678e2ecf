// SPDX-License-Identifier: Apache-2.0
// A glTF 2.0 file as tinygltf's tables, checked so far that the typed fields are what their names say. Images stay encoded.
#pragma once

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#include <tiny_gltf.h>
#include <nlohmann/json.hpp>

#include "import/import.h"

namespace kuafu {

/// Reads a glTF file with its buffers. Images are unpacked only from data URIs. Names are clean; unknown members give warnings. Throws
/// ks::Error with the field.
tinygltf::Model read_gltf(Import& import);

/// Percent-decodes a URI reference (RFC 3986, section 2.1).
std::string decode_uri(const std::string& uri);

/// Makes compressed views (EXT_meshopt_compression) in a file's JSON refer to their compressed bytes. Returns whether there were any.
bool read_compressed_views(nlohmann::json& root);

/// Decodes those views by libmeshoptimizer, each into a buffer of its own. Throws KS_ERROR_FILE with the view.
void decode_meshopt(Budget& budget, tinygltf::Model& model);

}  // namespace kuafu
