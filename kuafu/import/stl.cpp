// SPDX-License-Identifier: Apache-2.0
// STL, ASCII and binary (3D Systems, StereoLithography Interface Specification, 1989). Its normals repeat what the order of the corners
// says, often wrongly, and are not read.
#include <algorithm>
#include <bit>

#include "import/bytes.h"
#include "import/polygons.h"
#include "import/text.h"

namespace kuafu {
namespace {

using View = std::string_view;

constexpr size_t stl_header_bytes = 84, stl_facet_bytes = 50;

Polygons read_binary(Import& import, View file) {
  if (file.size() < stl_header_bytes)
    ks::fail(KS_ERROR_FILE, "the file is cut off: it has %zu bytes, and a binary STL file's header alone has %zu", file.size(),
             stl_header_bytes);
  const std::span bytes(reinterpret_cast<const uint8_t*>(file.data()), file.size());
  const uint32_t facets = u32(bytes, stl_header_bytes - 4);
  const uint64_t needed = stl_header_bytes + uint64_t{facets} * stl_facet_bytes;
  if (needed > file.size())
    ks::fail(KS_ERROR_FILE, "the file is cut off, or is no STL file: its %u facets take %zu bytes, and it has %zu", facets, needed,
             file.size());
  if (needed < file.size())
    import.warn(std::to_string(file.size() - needed) + " bytes after the last of its " + std::to_string(facets) + " facets are ignored");
  if (file.substr(0, stl_header_bytes).find("COLOR=") != View::npos) import.warn("its colours are not read");
  Polygons out;
  PolygonPart& part = out.parts.emplace_back();
  for (uint64_t f = 0; f < facets; ++f) {
    for (uint64_t k = 0; k < 3; ++k) {
      const uint64_t at = stl_header_bytes + f * stl_facet_bytes + 12 * (k + 1);
      glm::vec3 position;
      for (int i = 0; i < 3; ++i) position[i] = std::bit_cast<float>(u32(bytes, at + 4 * static_cast<uint64_t>(i)));
      if (!std::isfinite(position.x + position.y + position.z))
        ks::fail(KS_ERROR_FILE, "facet %zu has a corner at %g, %g, %g", f, position.x, position.y, position.z);
      part.corners.push_back({static_cast<uint32_t>(out.positions.size())});
      out.positions.push_back(position);
    }
    part.close(3);
  }
  return out;
}

class AsciiReader {
 public:
  explicit AsciiReader(View file) : rest_(file) {}

  Polygons read(Import& import) {
    out_.parts.emplace_back();
    while (!rest_.empty()) {
      ++line_;
      std::string line(take_line(rest_));
      // A comma is the decimal point if there is no other one.
      std::replace(line.begin(), line.end(), ',', line.find('.') == std::string::npos ? '.' : ' ');
      statement(line);
    }
    close();
    if (in_solid_) import.warn("its last solid has no 'endsolid': the file may be cut off");
    return std::move(out_);
  }

 private:
  void statement(View words) {
    for (View word = take_word(words); !word.empty(); word = take_word(words)) {
      const std::string name = lower_case(word);
      if (name != "vertex") close();
      if (name == "vertex") {
        glm::dvec3 position;
        for (int i = 0; i < 3; ++i) position[i] = parse_real(take_word(words), line_);
        out_.parts.back().corners.push_back({static_cast<uint32_t>(out_.positions.size())});
        out_.positions.emplace_back(position);
        ++open_;
      } else if (name == "solid") {
        if (!out_.parts.back().sizes.empty()) out_.parts.emplace_back();
        out_.parts.back().name = trimmed(words);
        in_solid_ = true;
        return;
      } else if (name == "endsolid") {
        in_solid_ = false;
        return;
      }
    }
  }

  void close() {
    if (open_ == 1 || open_ == 2) ks::fail(KS_ERROR_FILE, "line %zu: a facet ends after %zu corners, must have 3", line_, open_);
    out_.parts.back().close(open_);
    open_ = 0;
  }

  View rest_;
  Polygons out_;
  size_t line_ = 0, open_ = 0;  // corners of the facet so far
  bool in_solid_ = false;
};

}  // namespace

Polygons read_stl(Import& import, View file) {
  // A binary header may begin with "solid" too, but the count behind it has a zero byte.
  const View head = file.substr(0, stl_header_bytes);
  View words = head.substr(head.starts_with("\xef\xbb\xbf") ? 3 : 0);
  while (trimmed(words).starts_with('\n')) take_line(words);
  const bool is_ascii = lower_case(trimmed(words)).starts_with("solid") && head.find('\0') == View::npos;
  return is_ascii ? AsciiReader(without_mark(file)).read(import) : read_binary(import, file);
}

}  // namespace kuafu
