// SPDX-License-Identifier: Apache-2.0
// A device, a renderer and one radiance image per view, for the benchmarks; each failure ends the program with its message.
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <string>

#include "table_top.h"

namespace bench {

inline double now_ms() { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Processor time of this process and of its children that have ended.
inline double cpu_ms() {
  double ms = 0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage used{};
    getrusage(who, &used);
    for (const timeval& t : {used.ru_utime, used.ru_stime}) ms += 1e3 * double(t.tv_sec) + 1e-3 * double(t.tv_usec);
  }
  return ms;
}

inline kuafu_device open_device() {
  kuafu_device device = nullptr;
  ok(kuafu_device_create(nullptr, &device));
  return device;
}

inline ks_device_info info_of(kuafu_device device) {
  ks_device_info info = ks_device_info_init();
  ok(kuafu_device_get_info(device, &info));
  return info;
}

/// Renders radiance of some views of one size into a buffer of its own.
class Renderer {
 public:
  Renderer(kuafu_device device, uint32_t tracer) : device_(device) {
    const kuafu_renderer_desc desc{ks_header_make(KUAFU_TYPE_RENDERER_DESC, sizeof desc), tracer, 0};
    ok(kuafu_renderer_create(device, &desc, &renderer_));
    settings.ir_ambient_radiance = 0;
  }
  ~Renderer() {
    kuafu_buffer_release(buffer_);
    kuafu_renderer_release(renderer_);
  }
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  void look(const std::vector<kuafu_camera_desc>& cameras, uint32_t band, bool environments = false) {
    views_.clear();
    for (uint32_t i = 0; i < cameras.size(); ++i) {
      kuafu_view_desc v = kuafu_view_desc_init();
      v.camera = cameras[i];
      v.band = band;
      v.environment = environments ? i / 2 : 0;  // pairs
      views_.push_back(v);
    }
    const uint64_t shape[4] = {views_.size(), cameras[0].height, cameras[0].width, band == KUAFU_BAND_INFRARED ? 1u : 3u};
    const uint64_t bytes = shape[0] * shape[1] * shape[2] * shape[3] * 4;
    kuafu_buffer_release(buffer_);
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(bytes, 0);
    ok(kuafu_buffer_create(device_, &create, &buffer_));
    output_ = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, buffer_, ks_image_desc_packed(KS_FORMAT_F32, 4, shape));
    image_.resize(bytes / 4);
  }

  void render(kuafu_scene scene) { ok(try_render(scene)); }

  ks_status try_render(kuafu_scene scene) {
    settings.views = views_.data();
    settings.view_count = uint32_t(views_.size());
    settings.outputs = &output_;
    settings.output_count = 1;
    return kuafu_renderer_render(renderer_, scene, &settings);
  }

  const std::vector<float>& image() {
    ok(kuafu_buffer_read(buffer_, 0, image_.data(), image_.size() * 4));
    return image_;
  }

  /// Milliseconds per stage of the last render.
  std::vector<std::pair<std::string, double>> stage_times() {
    ks_stage_time times[64];
    uint32_t count = 64;
    ok(kuafu_renderer_get_stage_times(renderer_, times, &count));
    std::vector<std::pair<std::string, double>> out;
    for (uint32_t i = 0; i < std::min(count, 64u); ++i) out.emplace_back(times[i].name, times[i].milliseconds);
    return out;
  }
  std::string stages() {
    std::string text;
    for (const auto& [name, ms] : stage_times()) {
      char part[64];
      std::snprintf(part, sizeof part, "%s%s %.2f", text.empty() ? "" : ", ", name.c_str(), ms);
      text += part;
    }
    return text;
  }

  kuafu_render_desc settings = kuafu_render_desc_init();

 private:
  kuafu_device device_;
  kuafu_renderer renderer_ = nullptr;
  kuafu_buffer buffer_ = nullptr;
  std::vector<kuafu_view_desc> views_;
  kuafu_output_desc output_{};
  std::vector<float> image_;
};

}  // namespace bench
