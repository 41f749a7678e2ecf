// SPDX-License-Identifier: Apache-2.0
// Accessors (glTF 2.0 section 3.6.2) into plain arrays: any component type, byte strides, sparse substitution. Every byte is
// bounds-checked.
#pragma once

#include <string>
#include <vector>

#include "import/gltf_document.h"

namespace kuafu {

/// Reads an accessor's [count * components] values; normalized integers are scaled to [0, 1] or [-1, 1]. `field` names it in errors. Throws
/// for another number of components per element, or if the budget does not hold them.
std::vector<float> read_floats(Budget& budget, const tinygltf::Model& model, int accessor, int components, const std::string& field);

/// Reads scalars of unsigned 8, 16 or 32 bits.
std::vector<uint32_t> read_indices(Budget& budget, const tinygltf::Model& model, int accessor, const std::string& field);

/// The bytes of a buffer view.
struct Bytes {
  const uint8_t* data = nullptr;
  size_t size = 0;
  size_t stride = 0;  // 0 = packed
};
Bytes view_bytes(const tinygltf::Model& model, int view, const std::string& field);

}  // namespace kuafu
