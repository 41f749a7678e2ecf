// SPDX-License-Identifier: Apache-2.0
#include "cpu/calls.h"

#include "device/device.h"
#include "device/host_memory.h"

namespace simsense {

CpuCalls::CpuCalls(std::shared_ptr<ks::Device> device, const PreparedRig& rig)
    : device_(std::move(device)), rig_(rig), stages_(rig, device_->workers()) {}

void CpuCalls::compute(const ComputeRequest& request, const StageSettings& settings) {
  const ks::HostMemory::Use lent(device_->host_memory());
  stages_.reset_times();
  HostFrame frame;
  open_frame(request, rig_, frame, [this](const ImageArgument& argument, const ImageShape& shape, const char* name) {
    return HostImage(*device_, argument, shape, name);
  });
  const uint32_t pairs = rig_.rig.batch_count;
  for (uint32_t n = 0; n < pairs; ++n) {
    const auto tell = [&](float done) { request.tell_progress(n, pairs, done); };
    tell(0);
    stages_.run(settings, frame, n, tell);
  }
  for (auto& output : frame.outputs)
    if (output) output->commit();
}

}  // namespace simsense
