// SPDX-License-Identifier: Apache-2.0
#include "tables/texture_tables.h"

#include <algorithm>

#include "kuafu/geometry.h"
#include "material/texels.h"

namespace kuafu {
namespace {

/// Writes the words into the buffer if they fit exactly, else into a new one.
void put(const Memory& memory, std::shared_ptr<ks::Buffer>& buffer, const std::vector<uint32_t>& words) {
  Block block;
  const uint64_t bytes = words.size() * 4;
  if (buffer && buffer->size_bytes() == std::max<uint64_t>(bytes, 16)) {
    buffer->write(0, words.data(), bytes);
    return;
  }
  block.add(words);
  buffer = block.upload(memory.device);
}

/// How a material looks a texture up (TextureRecord.lookup).
uint32_t lookup_of(const Texture& t) {
  const bool transforms = std::ranges::any_of(t.uv_transform, [](float value) { return value != 0; });
  return t.wrap_u | t.wrap_v << lookup_wrap_v_shift | (t.filter == KUAFU_FILTER_NEAREST ? lookup_nearest : 0) |
         (t.uv_set == 1 ? lookup_uv_1 : 0) | (transforms ? lookup_transform : 0);
}

TextureRecord record_of(const Texture& t, UintArray texels, uint32_t format) {
  const auto& m = t.uv_transform;
  return {.texels = texels,
          .width = t.width,
          .height = t.height,
          .format = format,
          .lookup = lookup_of(t),
          .transform = {{m[0], m[1], m[2]}, {m[3], m[4], m[5]}}};
}

}  // namespace

bool TextureTables::looks_up() const {
  return std::ranges::any_of(records_, [](const TextureRecord& r) { return r.lookup != 0; });
}

bool TextureTables::update(const Scene& scene) {
  bool lights = false;
  for (uint32_t slot = 0; slot < slots_.size(); ++slot) {
    const uint32_t id = scene.textures().ids()[slot];
    if (id != slots_[slot].id) {
      patterns_.erase(slots_[slot].id);
      records_[slot] = {};
      slots_[slot] = {};
    } else if (id == none || scene.textures()[id].revision == slots_[slot].revision) {
      continue;
    }
    if (id == none) continue;
    replace(scene.textures()[id], slot);
    lights |= replace_pattern(scene.textures()[id], id) || scene.environment().texture == id;
    slots_[slot].id = id;
    slots_[slot].revision = scene.textures()[id].revision;
  }
  if (records_.size() < scene.textures().ids().size()) add_new(scene);
  std::ranges::copy(records_, table_.resize(memory_, records_.size()).begin());
  return lights;
}

void TextureTables::forget() {
  records_.clear();
  slots_.clear();
  patterns_.clear();
  dots_.clear();
}

void TextureTables::add_new(const Scene& scene) {
  const std::vector<uint32_t>& ids = scene.textures().ids();
  const size_t first = slots_.size();
  slots_.resize(ids.size());
  records_.resize(ids.size());
  Block block;
  std::vector<uint64_t> offsets(ids.size());
  for (size_t slot = first; slot < ids.size(); ++slot) {
    if (ids[slot] == none) continue;
    const Texture& t = scene.textures()[ids[slot]];
    const Texels texels = linear_texels(t);
    offsets[slot] = block.add(texels.words);
    records_[slot] = record_of(t, {}, texels.format);
    slots_[slot].id = ids[slot];
    slots_[slot].revision = t.revision;
  }
  const auto buffer = block.upload(memory_.device);
  for (size_t slot = first; slot < ids.size(); ++slot) {
    if (ids[slot] == none) continue;
    records_[slot].texels = memory_.address(*buffer) + offsets[slot];
    slots_[slot].block = buffer;
  }
}

void TextureTables::replace(const Texture& texture, uint32_t slot) {
  const Texels texels = linear_texels(texture);
  put(memory_, slots_[slot].own, texels.words);
  slots_[slot].block.reset();
  records_[slot] = record_of(texture, memory_.address(*slots_[slot].own), texels.format);
}

bool TextureTables::replace_pattern(const Texture& texture, uint32_t id) {
  const auto found = patterns_.find(id);
  if (found == patterns_.end()) return false;
  const PatternPlane plane = pattern_plane(texture);
  put(memory_, found->second.buffer, plane.words);
  found->second.bits = plane.bits;
  return true;
}

TextureTables::Pattern TextureTables::upload(const Texture& texture) {
  const PatternPlane plane = pattern_plane(texture);
  Pattern pattern{nullptr, plane.bits};
  put(memory_, pattern.buffer, plane.words);
  return pattern;
}

PatternAddress TextureTables::pattern(const Scene& scene, const Light& light) {
  Pattern& pattern = light.raster ? dots_[light.raster] : patterns_[light.texture];
  if (!pattern.buffer) pattern = upload(pattern_of(scene, light));
  return {memory_.address(*pattern.buffer), pattern.bits};
}

void TextureTables::drop_unused() {
  std::erase_if(dots_, [](const auto& entry) { return entry.first.use_count() == 1; });
}

}  // namespace kuafu
