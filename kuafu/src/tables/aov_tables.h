// SPDX-License-Identifier: Apache-2.0
// Stage `aov` reads these tables beyond the scene's: the projectors, and the motion since the last frame. Each render that asks for them
// makes them again.
// Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include "frame/device_array.h"
#include "frame/launch.h"

namespace kuafu {

class AovTables {
 public:
  explicit AovTables(Memory memory) : memory_(std::move(memory)) {}

  /// Updates the tables; throws if the launch names a light that is no projector.
  void update(const Scene& scene, const Launch& launch);
  [[nodiscard]] uint64_t address() const { return addresses_.address(); }

 private:
  void write_projectors(const Scene& scene, const Launch& launch);
  void write_motion(const Scene& scene, const Launch& launch);

  Memory memory_;
  MappedTable<ProjectorRecord> projectors_;
  MappedTable<MotionView> motion_;
  MappedTable<glm::vec4> previous_local_to_world_;
  MappedTable<AovAddresses> addresses_;
};

}  // namespace kuafu
