// The denoiser's stages compiled as C++. Thread rule: any thread; ranges are independent.
#pragma once

#include "shared/denoise_record.h"

namespace kuafu::host {

void guide(const GuidePush& push, uint32_t first, uint32_t end);
void moments(const MomentsPush& push, uint32_t first, uint32_t end);
void denoise(const DenoisePush& push, uint32_t first, uint32_t end);
void remodulate(const RemodulatePush& push, uint32_t first, uint32_t end);

}  // namespace kuafu::host
