// One render call's images between its last path and the caller's buffers: words of 32 bits (float32, ids as uint32), packed
// [view][row][column][channel]. An output stands here when a later step needs it (film, denoiser, another format); else the stages write
// straight into the caller's image, and nothing is here. Thread rule: externally synchronised.
#pragma once

#include <array>

#include "pathtrace/device_array.h"
#include "pathtrace/launch.h"

namespace kuafu {

class Frame {
 public:
  explicit Frame(Memory memory) : memory_(std::move(memory)) {}

  /// Makes room for what `launch` holds, and gives back what it does not.
  void fit(const Launch& launch);
  /// Whether it must hold an image of this launch.
  [[nodiscard]] static bool needs(const Launch& launch, uint32_t kind) {
    return (launch.held >> kind & 1) != 0 || (launch.outputs[kind].buffer && !launch.outputs[kind].is_plain());
  }
  [[nodiscard]] bool holds(uint32_t kind) const { return images_[kind] != nullptr; }
  [[nodiscard]] bool is_empty() const;
  [[nodiscard]] ks::Buffer& image(uint32_t kind) const { return *images_[kind]; }
  [[nodiscard]] uint64_t address(uint32_t kind) const { return memory_.address(*images_[kind]); }
  /// Where the stages write output `kind`: here or, where it is not held, into the caller's image.
  [[nodiscard]] OutputRecord target(const Launch& launch, uint32_t kind) const;
  /// A held image on its way to the caller's.
  [[nodiscard]] WritePush write(const Launch& launch, uint32_t kind) const;

 private:
  Memory memory_;
  std::array<std::shared_ptr<ks::Buffer>, output_kind_count> images_;
};

}  // namespace kuafu
