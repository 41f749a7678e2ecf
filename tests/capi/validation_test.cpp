// SPDX-License-Identifier: Apache-2.0
// What the libraries ask of Vulkan is what Vulkan allows: VK_LAYER_KHRONOS_validation has nothing to say of renders, matches and sharing.
#include <gtest/gtest.h>
#include <unistd.h>

#include <mutex>
#include <string>
#include <vector>

#include "capi/small_match.h"
#include "capi/small_render.h"

namespace ks::test {
namespace {

/// What a device's log heard beyond information.
struct Heard {
  std::mutex mutex;
  std::vector<std::string> texts;
  static void hear(void* self, uint32_t level, const char* text) {
    auto* heard = static_cast<Heard*>(self);
    if (level == KS_LOG_INFO) return;
    const std::lock_guard lock(heard->mutex);
    heard->texts.emplace_back(text);
  }
  [[nodiscard]] ks_device_desc desc() {
    ks_device_desc desc = ks_device_desc_init();
    desc.select = KS_SELECT_CPU, desc.worker_count = 2, desc.validation = 1;
    desc.log = hear, desc.log_user = this;
    return desc;
  }
  /// Why there was no validation; empty where there was.
  [[nodiscard]] std::string why_none() const {
    for (const std::string& text : texts)
      if (text.find("install vulkan-validationlayers") != std::string::npos) return text;
    return {};
  }
};

class Validation : public testing::TestWithParam<uint32_t> {};

TEST_P(Validation, HasNothingToSayOfARender) {
  Heard heard;
  const ks_device_desc desc = heard.desc();
  kuafu_device device = nullptr;
  SKIP_IF(kuafu_device_create(&desc, &device) == KS_OK ? "" : kuafu_last_error());
  {
    SmallRender render(GetParam(), device);
    SKIP_IF(heard.why_none());
    render.expect_works();
    render.desc.denoise = KUAFU_DENOISE_ATROUS;
    render.expect_works();
    ks_sync sync = ks_sync_init();
    EXPECT_EQ(kuafu_renderer_submit(render.renderer, render.scene, &render.desc, &sync), KS_OK);
    EXPECT_EQ(kuafu_renderer_wait(render.renderer, &sync, UINT64_MAX), KS_OK);
  }
  for (const std::string& text : heard.texts) ADD_FAILURE() << text;
}

INSTANTIATE_TEST_SUITE_P(Tracers, Validation, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

TEST(ValidationOfSimsense, HasNothingToSayOfAMatch) {
  Heard heard;
  const ks_device_desc desc = heard.desc();
  simsense_device device = nullptr;
  SKIP_IF(simsense_device_create(&desc, &device) == KS_OK ? "" : simsense_last_error());
  {
    SmallMatch match(device, 1, [](simsense_rig_desc& rig) {
      rig.rectified = 0, rig.back_end = SIMSENSE_BACK_END_VULKAN;
      rig.left.lens.distortion[0] = 0.01;
    });
    for (const uint32_t output : {SIMSENSE_OUTPUT_DISPARITY, SIMSENSE_OUTPUT_DEPTH}) {
      match.output.output = output;
      EXPECT_EQ(simsense_engine_compute(match.engine, &match.desc), KS_OK) << simsense_last_error();
    }
  }
  SKIP_IF(heard.why_none());
  for (const std::string& text : heard.texts) ADD_FAILURE() << text;
}

template <class Library>
class ValidationOfBuffers : public testing::Test {};
using Libraries = testing::Types<Kuafu, Simsense>;
TYPED_TEST_SUITE(ValidationOfBuffers, Libraries);

TYPED_TEST(ValidationOfBuffers, HasNothingToSayOfSharing) {
  Heard heard;
  const ks_device_desc desc = heard.desc();
  typename TypeParam::Device device = nullptr;
  SKIP_IF(TypeParam::device_create(&desc, &device) == KS_OK ? "" : TypeParam::last_error());
  for (const uint32_t memory : {KS_MEMORY_OPAQUE_FD, KS_MEMORY_HOST}) {
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(10000, KS_BUFFER_EXPORTABLE | KS_BUFFER_HOST_VISIBLE);
    typename TypeParam::Buffer buffer = nullptr, view = nullptr;
    ASSERT_EQ(TypeParam::buffer_create(device, &create, &buffer), KS_OK) << TypeParam::last_error();
    ks_buffer_desc shared = ks_buffer_desc_init();
    ASSERT_EQ(TypeParam::buffer_export(buffer, memory, &shared), KS_OK) << TypeParam::last_error();
    EXPECT_EQ(TypeParam::buffer_import(device, &shared, &view), KS_OK) << TypeParam::last_error();
    if (memory == KS_MEMORY_OPAQUE_FD) close(static_cast<int>(shared.handle));
    const uint32_t word = 7;
    EXPECT_EQ(TypeParam::buffer_write(view, 9996, &word, 4), KS_OK);
    TypeParam::buffer_release(view);
    TypeParam::buffer_release(buffer);
  }
  TypeParam::device_release(device);
  SKIP_IF(heard.why_none());
  for (const std::string& text : heard.texts) ADD_FAILURE() << text;
}

}  // namespace
}  // namespace ks::test
