// SPDX-License-Identifier: Apache-2.0
#include "import/import.h"

#include "device/log_sink.h"
#include "io/wire.h"

namespace kuafu {

std::string clean_name(std::string_view name) { return ks::one_line(name, 200); }

void Import::warn(const std::string& text) {
  std::string line = ks::one_line(text, longest_text_bytes);
  if (said_.size() + 1 >= most_warnings) {
    if (!said_.contains(line)) ++unsaid_;
    return;
  }
  if (said_.insert(line).second) warnings.push_back(std::move(line));
}

void Import::close_warnings() {
  if (unsaid_ > 0) warnings.push_back("and " + std::to_string(unsaid_) + " more such messages");
}

}  // namespace kuafu
