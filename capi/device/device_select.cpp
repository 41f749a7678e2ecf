// SPDX-License-Identifier: Apache-2.0
#include "device/physical.h"

#include <cstring>
#include <string>

#include "device/error.h"
#include "device/instance.h"

namespace ks {
namespace {

// Order of KS_SELECT_AUTO; larger is better.
int rank(uint32_t kind) {
  switch (kind) {
    case KS_DEVICE_KIND_DISCRETE_GPU:
      return 4;
    case KS_DEVICE_KIND_INTEGRATED_GPU:
      return 3;
    case KS_DEVICE_KIND_VIRTUAL_GPU:
      return 2;
    case KS_DEVICE_KIND_CPU:
      return 1;
    default:
      return 0;
  }
}

[[noreturn]] void fail_listing(const std::vector<ks_device_info>& devices, const std::string& wanted) {
  std::string text = wanted + ". Devices:";
  for (const ks_device_info& d : devices)
    text += " [" + std::to_string(d.index) + "] " + d.name + ": " + (d.usable ? "usable" : std::string("refused, ") + d.refused) + ".";
  text += std::string(" For another device, ") + install_hint + ".";
  fail(KS_ERROR_NO_DEVICE, "%s", text.c_str());
}

}  // namespace

size_t select_device(const std::vector<ks_device_info>& devices, const ks_device_desc& desc, const std::string& why_none) {
  if (desc.select > KS_SELECT_VULKAN)
    fail(KS_ERROR_INVALID_ARGUMENT, "device desc: select is %u, the largest known is %u", desc.select, KS_SELECT_VULKAN);
  if (desc.select == KS_SELECT_VULKAN) fail(KS_ERROR_INTERNAL, "a device of the host's is not among those that are chosen from");
  if (devices.empty()) fail(KS_ERROR_NO_DEVICE, "no Vulkan device: %s", why_none.c_str());
  constexpr size_t none = SIZE_MAX;
  size_t chosen = none;
  for (size_t i = 0; i < devices.size(); ++i) {
    const ks_device_info& d = devices[i];
    const bool better = d.usable && (chosen == none || rank(d.kind) > rank(devices[chosen].kind));
    const bool first = chosen == none;
    if (desc.select == KS_SELECT_AUTO && better) chosen = i;
    if (desc.select == KS_SELECT_CPU && first && d.usable && d.kind == KS_DEVICE_KIND_CPU) chosen = i;
    if (desc.select == KS_SELECT_INDEX && d.index == desc.index) chosen = i;
    if (desc.select == KS_SELECT_UUID && first && std::memcmp(d.device_uuid, desc.uuid, sizeof d.device_uuid) == 0) chosen = i;
  }
  if (chosen != none && devices[chosen].usable) return chosen;
  if (chosen != none) fail_listing(devices, std::string("the chosen device cannot be used: ") + devices[chosen].name);
  switch (desc.select) {
    case KS_SELECT_INDEX:
      fail_listing(devices, "there is no device with index " + std::to_string(desc.index));
    case KS_SELECT_UUID:
      fail_listing(devices, "no device has the given UUID");
    case KS_SELECT_CPU:
      fail_listing(devices, "there is no usable Vulkan device of type CPU");
    default:
      fail_listing(devices, "no Vulkan device can be used");
  }
}

}  // namespace ks
