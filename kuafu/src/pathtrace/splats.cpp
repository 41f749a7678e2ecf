// SPDX-License-Identifier: Apache-2.0
#include "pathtrace/splats.h"

#include <algorithm>
#include <bit>

namespace kuafu {

void Splats::fit(const BeamSources& sources) {
  source_count_ = uint32_t(sources.sources.size());
  beam_count_ = sources.beam_count;
  if (beam_count_ == 0) return;
  std::ranges::copy(sources.sources, sources_.resize(memory_, source_count_).begin());
  buckets_ = std::bit_ceil(2 * beam_count_);
  grow(memory_, beams_, uint64_t(beam_count_) * (sizeof(Beam) / 4));
  grow(memory_, words_, splat_heads + splat_words_per_head * uint64_t(buckets_) + uint64_t(splat_entries_per_beam) * beam_count_);
  table_.resize(memory_, 1)[0] = {.beams = memory_.address(*beams_),
                                  .words = memory_.address(*words_),
                                  .buckets = buckets_,
                                  .beam_count = beam_count_,
                                  .entries = splat_entries_per_beam * beam_count_};
}

BeamPush Splats::push(uint32_t key, const glm::vec2& jitter) const {
  BeamPush push{};
  push.sources = sources_.address();
  push.beams = memory_.address(*beams_);
  push.source_count = source_count_;
  push.key = key;
  push.jitter = jitter;
  return push;
}

}  // namespace kuafu
