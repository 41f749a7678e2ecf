// SPDX-License-Identifier: Apache-2.0
// Every function of both interfaces that takes a handle, with a handle that is NULL, of another kind or released, and with a good one but
// absurd arguments: pointers are NULL, sizes and ids the largest, numbers none.
#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <string>
#include <tuple>
#include <type_traits>

#include "capi/functions_of_handles.h"  // by capi/generation
#include "capi/small_match.h"
#include "capi/small_render.h"
#include "kuafu/api.h"
#include "simsense/api.h"

namespace ks::test {
namespace {

template <class T>
T absurd() {
  if constexpr (std::is_pointer_v<T>)
    return nullptr;
  else if constexpr (std::is_floating_point_v<T>)
    return std::numeric_limits<T>::quiet_NaN();
  else
    return std::numeric_limits<T>::max();
}

/// A handle of each kind of both libraries.
using Kinds = std::tuple<kuafu_device, kuafu_buffer, kuafu_scene, kuafu_renderer, simsense_device, simsense_buffer, simsense_engine>;

/// `attempt(name, function)` with every function of both libraries that takes a handle.
template <class Attempt>
void each_function(const Attempt& attempt) {
  const kuafu_api& kuafu = *kuafu_get_api();
  const simsense_api& simsense = *simsense_get_api();
#define KS_TRY_KUAFU(entry) attempt("kuafu_" #entry, kuafu.entry);
#define KS_TRY_SIMSENSE(entry) attempt("simsense_" #entry, simsense.entry);
  KUAFU_FUNCTIONS(KS_TRY_KUAFU)
  SIMSENSE_FUNCTIONS(KS_TRY_SIMSENSE)
}

/// What the function answers to absurd arguments. A name that is not given counts as an error, as does what has no result.
template <class Result, class H, class... Rest>
ks_status answer(Result (*function)(H, Rest...), const Kinds& given) {
  if constexpr (std::is_same_v<Result, ks_status>)
    return function(std::get<H>(given), absurd<Rest>()...);
  else if constexpr (std::is_pointer_v<Result>)
    return function(std::get<H>(given), absurd<Rest>()...) == nullptr ? KS_ERROR_INVALID_ARGUMENT : KS_OK;
  else
    function(std::get<H>(given), absurd<Rest>()...);
  return KS_ERROR_INVALID_ARGUMENT;
}

void expect_all_refuse(const Kinds& given) {
  each_function([&](const char* name, auto* function) { EXPECT_EQ(answer(function, given), KS_ERROR_INVALID_ARGUMENT) << name; });
}

class EveryFunction : public testing::Test {
 protected:
  /// Objects of all kinds, and their handles.
  struct Objects {
    Objects() : render(KUAFU_TRACER_EMBREE), match(open_host_device()) {
      const ks_buffer_create_desc create = ks_buffer_create_desc_init(64, KS_BUFFER_HOST_VISIBLE);
      EXPECT_EQ(simsense_buffer_create(match.device, &create, &buffer), KS_OK) << simsense_last_error();
    }
    ~Objects() { simsense_buffer_release(buffer); }
    [[nodiscard]] Kinds handles() const {
      return {render.device, render.buffer, render.scene, render.renderer, match.device, buffer, match.engine};
    }
    SmallRender render;
    SmallMatch match;
    simsense_buffer buffer = nullptr;
  };
  Objects objects_;
};

TEST_F(EveryFunction, RefusesAHandleThatIsNull) {
  expect_all_refuse({});
  for (const std::string said : {kuafu_last_error(), simsense_last_error()}) EXPECT_NE(said.find(" is NULL"), std::string::npos) << said;
}

TEST_F(EveryFunction, RefusesAHandleOfAnotherKind) {
  SKIP_IF(objects_.render.device ? "" : kuafu_last_error());
  const auto [device, buffer, scene, renderer, engines_device, engines_buffer, engine] = objects_.handles();
  const Kinds other{reinterpret_cast<kuafu_device>(engines_device),   reinterpret_cast<kuafu_buffer>(engines_buffer),
                    reinterpret_cast<kuafu_scene>(renderer),          reinterpret_cast<kuafu_renderer>(scene),
                    reinterpret_cast<simsense_device>(device),        reinterpret_cast<simsense_buffer>(buffer),
                    reinterpret_cast<simsense_engine>(engines_device)};
  expect_all_refuse(other);
  ks_device_info info = ks_device_info_init();
  (void)kuafu_device_get_info(std::get<0>(other), &info), (void)simsense_device_get_info(std::get<4>(other), &info);
  for (const std::string said : {kuafu_last_error(), simsense_last_error()})
    EXPECT_NE(said.find("no such handle"), std::string::npos) << said;
  objects_.render.expect_works();
  EXPECT_EQ(simsense_engine_compute(objects_.match.engine, &objects_.match.desc), KS_OK) << simsense_last_error();
}

TEST_F(EveryFunction, RefusesAHandleThatWasReleased) {
  SKIP_IF(objects_.render.device ? "" : kuafu_last_error());
  Kinds released;
  {
    const Objects others;
    released = others.handles();
  }
  expect_all_refuse(released);
  objects_.render.expect_works();
}

TEST_F(EveryFunction, RefusesAbsurdArgumentsOfAGoodHandle) {
  SKIP_IF(objects_.render.device ? "" : kuafu_last_error());
  // NULL is no medium, or what is not asked for; what takes a handle alone has nothing absurd.
  const std::set<std::string> meant = {"kuafu_scene_set_medium", "simsense_engine_get_signal", "simsense_engine_get_rectified",
                                       "kuafu_scene_next_frame", "kuafu_scene_cancel_load",    "kuafu_renderer_cancel",
                                       "simsense_engine_cancel"};
  const Kinds good = objects_.handles();
  each_function([&](const std::string& name, auto* function) {
    if (name.ends_with("_retain") || name.ends_with("_release")) return;
    EXPECT_EQ(answer(function, good) < KS_OK, !meant.contains(name)) << name;
  });
  objects_.render.expect_works();
  EXPECT_EQ(simsense_engine_compute(objects_.match.engine, &objects_.match.desc), KS_OK) << simsense_last_error();
}

}  // namespace
}  // namespace ks::test
