// SPDX-License-Identifier: Apache-2.0
// The memory of light that bodies of glass bend: the sources of its beams, the beams, and the table of where they landed.
// Thread rule: externally synchronised; no work may be in flight during fit.
#pragma once

#include <memory>

#include "frame/device_array.h"
#include "tables/beam_sources.h"

namespace kuafu {

class Splats {
 public:
  explicit Splats(Memory memory) : memory_(std::move(memory)) {}

  void fit(const BeamSources& sources);
  [[nodiscard]] uint32_t beam_count() const { return beam_count_; }
  /// The address of the SplatTable.
  [[nodiscard]] uint64_t table() const { return table_.address(); }
  /// The values that all steps of stage `follow` share.
  [[nodiscard]] BeamPush push(uint32_t key, const glm::vec2& jitter) const;
  /// The words that must be zero before the table's steps.
  [[nodiscard]] const ks::Buffer& words() const { return *words_; }
  [[nodiscard]] uint64_t cleared_bytes() const { return (splat_heads + splat_words_per_head * uint64_t(buckets_)) * 4; }
  /// Invocations of a step of the table (splat_step_*).
  [[nodiscard]] uint32_t step_size(uint32_t step) const {
    return step == splat_step_claim || step == splat_step_order ? buckets_ : beam_count_;
  }

 private:
  Memory memory_;
  MappedTable<BeamSource> sources_;
  MappedTable<SplatTable> table_;
  std::shared_ptr<ks::Buffer> beams_, words_;
  uint32_t source_count_ = 0, beam_count_ = 0, buckets_ = 1;
};

}  // namespace kuafu
