// SPDX-License-Identifier: Apache-2.0
// The frame holds the images of one render call between its last path and the caller's buffers: words of 32 bits (float32, ids as uint32),
// packed [view][row][column][channel]. It holds an output only when a later step needs it (optics, denoiser, another format); the stages
// write any other output straight into the caller's image. Thread rule: externally synchronised.
#pragma once

#include <array>

#include "frame/device_array.h"
#include "frame/image_step.h"
#include "frame/launch.h"
#include "frame/srgb.h"

namespace kuafu {

class Frame {
 public:
  explicit Frame(Memory memory);

  /// Makes room for the images that the launch needs here. An image is freed once several launches in a row did not need it. A sensor's
  /// colour and infrared pictures take turns: allocating anew for each costs a tenth of a small picture's time.
  void fit(const Launch& launch);
  /// Whether the frame must hold this output of the launch.
  [[nodiscard]] static bool needs(const Launch& launch, uint32_t kind) {
    const bool differs = launch.outputs[kind].buffer && !launch.outputs[kind].is_plain() && !is_made(kind);
    return (launch.held >> kind & 1) != 0 || differs;
  }
  [[nodiscard]] bool holds(uint32_t kind) const { return images_[kind].unneeded == 0 && images_[kind].buffer != nullptr; }
  [[nodiscard]] bool is_empty() const;
  [[nodiscard]] ks::Buffer& image(uint32_t kind) const { return *images_[kind].buffer; }
  [[nodiscard]] uint64_t address(uint32_t kind) const { return memory_.address(image(kind)); }
  /// Swaps the image's buffer with one of at least its size, into which a later step wrote the image.
  void exchange(uint32_t kind, std::shared_ptr<ks::Buffer>& buffer) { std::swap(images_[kind].buffer, buffer); }
  /// Address of an OutputArray, by output_*: the places that the stages write, here or in the caller's image.
  [[nodiscard]] uint64_t outputs() const { return outputs_.address(); }
  /// Copies the held images to the caller's, in the caller's formats.
  void deliver(ks::Commands& commands, const Launch& launch);

 private:
  struct HeldImage {
    std::shared_ptr<ks::Buffer> buffer;
    uint32_t unneeded = 0;  // launches since one needed it
  };
  [[nodiscard]] std::shared_ptr<ks::Buffer> new_image(uint64_t bytes);
  [[nodiscard]] OutputRecord target(const Launch& launch, uint32_t kind) const;

  Memory memory_;
  std::array<HeldImage, output_kind_count> images_;
  MappedTable<OutputRecord> outputs_;
  ImageStep<WritePush> write_;
  SrgbEncoder srgb_;
};

namespace host {
/// Runs stage `write` on the host. Thread rule: any thread; ranges are independent.
void write(const WritePush& push, uint32_t first, uint32_t end);
}  // namespace host

}  // namespace kuafu
