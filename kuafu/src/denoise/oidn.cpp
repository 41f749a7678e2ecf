// SPDX-License-Identifier: Apache-2.0
#include "denoise/oidn.h"

#include <dlfcn.h>

#include <cstdlib>

#include "device/error.h"

namespace kuafu {
namespace {

// Version 2 has its first number in the name, version 1 all three.
constexpr const char* names[] = {"libOpenImageDenoise.so.2",     "libOpenImageDenoise.so.1",     "libOpenImageDenoise.so",
                                 "libOpenImageDenoise.so.1.4.3", "libOpenImageDenoise.so.1.4.2", "libOpenImageDenoise.so.1.4.1",
                                 "libOpenImageDenoise.so.1.4.0", "libOpenImageDenoise.so.1.3.0", "libOpenImageDenoise.so.1.2.4"};
constexpr int device_cpu = 1, format_float3 = 3;  // OIDN_DEVICE_TYPE_CPU, OIDN_FORMAT_FLOAT3

std::vector<std::string> candidates(const std::string& library) {
  if (!library.empty()) return {library};
  const char* named = std::getenv("KUAFU_OIDN_LIBRARY");
  if (named != nullptr && *named != 0) return {named};
  return {std::begin(names), std::end(names)};
}

// The library keeps threads of its own, so it stays once it is opened.
void* open_library(const std::string& library) {
  std::string tried;
  for (const std::string& name : candidates(library)) {
    if (void* opened = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE)) return opened;
    tried += (tried.empty() ? "" : "; ") + std::string(dlerror());
  }
  ks::fail(KS_ERROR_UNSUPPORTED,
           "KUAFU_DENOISE_OIDN needs Open Image Denoise, and it was not found: install it, name its library in KUAFU_OIDN_LIBRARY or in "
           "kuafu_renderer_desc.oidn_library, or take KUAFU_DENOISE_ATROUS. Tried: %s",
           tried.c_str());
}

}  // namespace

struct Oidn::Interface {
  void* (*new_device)(int type);
  void (*commit_device)(void* device);
  int (*device_error)(void* device, const char** message);
  void (*release_device)(void* device);
  void* (*new_filter)(void* device, const char* type);
  void (*set_image)(void* filter, const char* name, void* pixels, int format, size_t width, size_t height, size_t offset,
                    size_t pixel_stride, size_t row_stride);
  void (*set_bool)(void* filter, const char* name, bool value);
  void (*commit_filter)(void* filter);
  void (*execute_filter)(void* filter);
  void (*release_filter)(void* filter);

  explicit Interface(void* library) {
    load(library, new_device, "oidnNewDevice");
    load(library, commit_device, "oidnCommitDevice");
    load(library, device_error, "oidnGetDeviceError");
    load(library, release_device, "oidnReleaseDevice");
    load(library, new_filter, "oidnNewFilter");
    load(library, set_image, "oidnSetSharedFilterImage");
    load(library, set_bool, "oidnSetFilterBool", "oidnSetFilter1b");  // as version 2 and version 1 call it
    load(library, commit_filter, "oidnCommitFilter");
    load(library, execute_filter, "oidnExecuteFilter");
    load(library, release_filter, "oidnReleaseFilter");
  }

  template <class Function>
  static void load(void* library, Function& function, const char* name, const char* other_name = nullptr) {
    void* symbol = dlsym(library, name);
    if (symbol == nullptr && other_name != nullptr) symbol = dlsym(library, other_name);
    if (symbol == nullptr) ks::fail(KS_ERROR_UNSUPPORTED, "Open Image Denoise was opened, but it has no %s: take version 1 or 2", name);
    function = reinterpret_cast<Function>(symbol);
  }
};

Oidn::Oidn(const std::string& library)
    : interface_(std::make_unique<Interface>(open_library(library))), device_(interface_->new_device(device_cpu)) {
  if (device_ == nullptr) ks::fail(KS_ERROR_UNSUPPORTED, "Open Image Denoise has no CPU device here");
  interface_->commit_device(device_);
}

Oidn::~Oidn() {
  if (device_ != nullptr) interface_->release_device(device_);
}

void Oidn::filter(OidnImages& images, uint32_t width, uint32_t height) {
  images.output.resize(images.color.size());
  void* filter = interface_->new_filter(device_, "RT");
  if (filter != nullptr) {
    const auto set = [&](const char* name, std::vector<float>& pixels) {
      interface_->set_image(filter, name, pixels.data(), format_float3, width, height, 0, 0, 0);
    };
    set("color", images.color);
    set("albedo", images.albedo);
    set("normal", images.normal);
    set("output", images.output);
    interface_->set_bool(filter, "hdr", true);
    interface_->commit_filter(filter);
    interface_->execute_filter(filter);
    interface_->release_filter(filter);
  }
  const char* message = nullptr;
  if (const int error = interface_->device_error(device_, &message); error != 0)
    ks::fail(KS_ERROR_INTERNAL, "Open Image Denoise failed on %u x %u pixels with error %d: %s", width, height, error,
             message ? message : "no message");
}

}  // namespace kuafu
