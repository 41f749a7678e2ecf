// SPDX-License-Identifier: Apache-2.0
// The memory of light that bodies of glass bend: the sources of its pencils, the pencils, and the table of where they landed.
// Thread rule: externally synchronised; no work may be in flight during fit.
#pragma once

#include <memory>

#include "frame/device_array.h"
#include "tables/pencil_sources.h"

namespace kuafu {

class Landings {
 public:
  explicit Landings(Memory memory) : memory_(std::move(memory)) {}

  void fit(const PencilSources& sources);
  [[nodiscard]] uint32_t pencil_count() const { return pencil_count_; }
  /// Of the LandingTable.
  [[nodiscard]] uint64_t table() const { return table_.address(); }
  /// What all steps of stage `land` have in common.
  [[nodiscard]] LandPush push(uint32_t key, const glm::vec2& jitter) const;
  /// The words that the table's steps find cleared.
  [[nodiscard]] const ks::Buffer& words() const { return *words_; }
  [[nodiscard]] uint64_t cleared_bytes() const { return (landing_heads + landing_words_per_head * uint64_t(buckets_)) * 4; }
  /// Invocations of a step of the table (landing_step_*).
  [[nodiscard]] uint32_t step_size(uint32_t step) const {
    return step == landing_step_claim || step == landing_step_order ? buckets_ : pencil_count_;
  }

 private:
  Memory memory_;
  MappedTable<PencilSource> sources_;
  MappedTable<LandingTable> table_;
  std::shared_ptr<ks::Buffer> pencils_, words_;
  uint32_t source_count_ = 0, pencil_count_ = 0, buckets_ = 1;
};

}  // namespace kuafu
