// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>

#include "import/bytes.h"
#include "import/plain_mesh.h"
#include "import/plain_text.h"

namespace kuafu {
namespace {

constexpr size_t header_bytes = 80, facet_bytes = 50;

PlainMesh read_binary(std::span<const uint8_t> file) {
  PlainMesh mesh;
  const uint32_t facets = u32(file, header_bytes);
  for (uint64_t f = 0; f < facets; ++f)
    for (uint64_t k = 0; k < 3; ++k) {
      const uint64_t at = header_bytes + 4 + f * facet_bytes + 12 * (k + 1);
      mesh.use({std::bit_cast<float>(u32(file, at)), std::bit_cast<float>(u32(file, at + 4)), std::bit_cast<float>(u32(file, at + 8))});
    }
  mesh.faces = facets;
  mesh.corners = 3 * uint64_t{facets};
  return mesh;
}

PlainMesh read_ascii(std::string_view text) {
  PlainMesh mesh;
  for (uint64_t line = 1; !text.empty(); ++line) {
    std::string_view words = take_line(text);
    if (take_word(words) != "vertex") continue;
    glm::dvec3 position;
    for (int i = 0; i < 3; ++i) position[i] = parse_real(take_word(words), line);
    mesh.use(position);
    ++mesh.corners;
  }
  mesh.faces = mesh.corners / 3;
  return mesh;
}

}  // namespace

PlainMesh plain_stl(std::string_view file) {
  const std::span bytes(reinterpret_cast<const uint8_t*>(file.data()), file.size());
  // A binary header may begin with "solid" too: its length tells.
  const bool is_binary =
      file.size() >= header_bytes + 4 && file.size() == header_bytes + 4 + uint64_t{u32(bytes, header_bytes)} * facet_bytes;
  const size_t start = std::min(file.find_first_not_of(" \t\r\n"), file.size());
  return is_binary || !file.substr(start).starts_with("solid") ? read_binary(bytes) : read_ascii(file);
}

}  // namespace kuafu
