// SPDX-License-Identifier: Apache-2.0
// These are boxes in the world around instances of smooth glass, which tell stage `shade` where light may come on a bent way.
// Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include <map>

#include "frame/band.h"
#include "frame/device_array.h"
#include "scene/scene.h"
#include "shared/scene_records.h"

namespace kuafu {

class GlassBoxes {
 public:
  /// Cost follows the instances, and the vertices of glass that is new or deformed.
  void update(const Memory& memory, const Scene& scene, const Band& band);
  void forget() { meshes_.clear(); }
  [[nodiscard]] uint32_t count() const { return count_; }
  [[nodiscard]] uint64_t address() const { return table_.address(); }

 private:
  struct MeshBox {
    uint64_t deformation = 0;
    Scene::Bounds local;
  };
  const Scene::Bounds& local_box(const Scene& scene, uint32_t mesh);

  std::map<uint32_t, MeshBox> meshes_;
  MappedTable<GlassBox> table_;
  uint32_t count_ = 0;
};

}  // namespace kuafu
