// SPDX-License-Identifier: Apache-2.0
// A helper program's answer as bytes: a failure, or warnings and a scene. The host trusts none of it: it bounds sizes before it allocates,
// and Scene checks everything. Both ends are of one build and machine, so numbers have their form in memory. Thread rule: pure functions.
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

/// Writes the helper's answer. Throws KS_ERROR_FILE if that fails.
void write_answer(std::FILE* to, const Scene& scene, const std::vector<std::string>& warnings);
void write_failure(std::FILE* to, int status, const std::string& text);

/// Reads a helper's answer; `read` fills the given bytes or throws. Throws the failure that the helper wrote, or KS_ERROR_FILE for an
/// invalid answer or a scene larger than `most_bytes`.
ImportAnswer read_answer(const std::function<void(void*, size_t)>& read, uint64_t most_bytes);

}  // namespace kuafu
