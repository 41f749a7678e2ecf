// SPDX-License-Identifier: Apache-2.0
// A glTF 2.0 file as tinygltf's tables, checked so far that the typed fields are what their names say. Images stay encoded.
#pragma once

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#include <tiny_gltf.h>

#include "import/import.h"

namespace kuafu {

/// Reads a glTF file with its buffers. Images are unpacked only from data URIs. Names are clean; unknown members give warnings. Throws
/// ks::Error with the field.
tinygltf::Model read_gltf(Import& import);

/// Percent-decodes a URI reference (RFC 3986, section 2.1).
std::string decode_uri(const std::string& uri);

}  // namespace kuafu
