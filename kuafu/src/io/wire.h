// SPDX-License-Identifier: Apache-2.0
// What a helper program answers, as bytes: either a failure, or warnings and a scene. The host believes nothing of it: sizes are bounded
// before memory is taken, and everything goes through Scene's own checks. Both ends are of one build and one machine, so numbers stand as
// they are in memory. Thread rule: pure functions.
#pragma once

#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// The warnings of one answer: further ones are counted, not kept, and each text is cut to a line of this length.
inline constexpr size_t most_warnings = 100, longest_text_bytes = 1000;

struct ImportAnswer {
  Scene scene;
  std::vector<std::string> warnings;
};

/// Throws KS_ERROR_FILE when it cannot be written.
void write_answer(std::FILE* to, const Scene& scene, const std::vector<std::string>& warnings);
void write_failure(std::FILE* to, int status, const std::string& text);

/// `read` fills the bytes it is given or throws. Throws the failure that was written; KS_ERROR_FILE for what no helper writes and where the
/// scene would be larger than `most_bytes`.
ImportAnswer read_answer(const std::function<void(void*, size_t)>& read, uint64_t most_bytes);

}  // namespace kuafu
