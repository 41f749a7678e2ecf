// SPDX-License-Identifier: Apache-2.0
#include "pathtrace/landings.h"

#include <algorithm>
#include <bit>

namespace kuafu {

void Landings::fit(const PencilSources& sources) {
  source_count_ = uint32_t(sources.sources.size());
  pencil_count_ = sources.pencil_count;
  if (pencil_count_ == 0) return;
  std::ranges::copy(sources.sources, sources_.resize(memory_, source_count_).begin());
  buckets_ = std::bit_ceil(2 * pencil_count_);
  grow(memory_, pencils_, uint64_t(pencil_count_) * (sizeof(Pencil) / 4));
  grow(memory_, words_, landing_heads + landing_words_per_head * uint64_t(buckets_) + uint64_t(landing_entries_per_pencil) * pencil_count_);
  table_.resize(memory_, 1)[0] = {.pencils = memory_.address(*pencils_),
                                  .words = memory_.address(*words_),
                                  .buckets = buckets_,
                                  .pencil_count = pencil_count_,
                                  .entries = landing_entries_per_pencil * pencil_count_};
}

LandPush Landings::push(uint32_t key, const glm::vec2& jitter) const {
  LandPush push{};
  push.sources = sources_.address();
  push.pencils = memory_.address(*pencils_);
  push.source_count = source_count_;
  push.key = key;
  push.jitter = jitter;
  return push;
}

}  // namespace kuafu
