// SPDX-License-Identifier: Apache-2.0
// Open Image Denoise is opened at run time when it is asked for: versions 1 and 2 of its C interface, on the CPU. Thread rule: externally
// synchronised.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace kuafu {

/// Packed [row][column][3] floats of one view.
struct OidnImages {
  std::vector<float> color, albedo, normal;  // linear radiance; -1..1 in the world's frame
  std::vector<float> output;
};

class Oidn {
 public:
  /// `library` is its path. If that is empty, the environment variable KUAFU_OIDN_LIBRARY names it, else its usual names are tried. Throws
  /// KS_ERROR_UNSUPPORTED with what was tried.
  explicit Oidn(const std::string& library);
  ~Oidn();
  Oidn(const Oidn&) = delete;
  Oidn& operator=(const Oidn&) = delete;
  void filter(OidnImages& images, uint32_t width, uint32_t height);

 private:
  struct Interface;
  std::unique_ptr<Interface> interface_;
  void* device_ = nullptr;
};

}  // namespace kuafu
