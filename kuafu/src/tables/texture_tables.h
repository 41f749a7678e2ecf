// SPDX-License-Identifier: Apache-2.0
// Textures and projector patterns in device memory. A texture that is set again is uploaded alone, in place where its size stays.
// Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include "frame/device_array.h"
#include "light/light_table.h"
#include "scene/scene.h"
#include "shared/scene_records.h"

namespace kuafu {

class TextureTables {
 public:
  explicit TextureTables(Memory memory) : memory_(std::move(memory)) {}

  /// Uploads textures that are new or were set again. Returns whether a light's record may name a removed one.
  bool update(const Scene& scene);
  /// Makes the next update upload everything, for another scene.
  void forget();
  /// Returns the plane of a projector's pattern: its texture's or its dots'.
  PatternAddress pattern(const Scene& scene, const Light& light);
  /// Frees dots that no light uses.
  void drop_unused();
  /// Whether any texture has a wrapping, filter, transform or uv set other than the default.
  [[nodiscard]] bool looks_up() const;
  [[nodiscard]] uint64_t address() const { return table_.address(); }

 private:
  struct Pattern {
    std::shared_ptr<ks::Buffer> buffer;
    uint32_t bits = 0;
  };
  struct Slot {
    uint32_t id = none;
    uint64_t revision = 0;              // Texture::revision that the device has
    std::shared_ptr<ks::Buffer> own;    // where the texels lie of one that was set again, or took another's slot
    std::shared_ptr<ks::Buffer> block;  // else: with others of its time, as long as one of them is left
  };

  void add_new(const Scene& scene);
  void replace(const Texture& texture, uint32_t slot);
  bool replace_pattern(const Texture& texture, uint32_t id);
  Pattern upload(const Texture& texture);

  Memory memory_;
  std::vector<TextureRecord> records_;  // by slot
  std::vector<Slot> slots_;
  MappedTable<TextureRecord> table_;
  std::unordered_map<uint32_t, Pattern> patterns_;          // by texture's id
  std::map<std::shared_ptr<const Texture>, Pattern> dots_;  // by raster
};

}  // namespace kuafu
