// Standard normal numbers that neighbouring pixels share as a point spread function makes them: what gives speckle its grain. Each number
// alone is N(0, 1), so a quantile of it keeps its law; numbers d pixels apart correlate by exp(-d^2 / (4 sigma^2)).
#pragma once

#include <vector>

#include "cpu/buffer.h"
#include "signal/key.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Weights -radius..radius of the Gaussian PSF along one axis, their squares summing to 1; radius is 4 sigma, rounded up.
std::vector<float> grain_kernel(float sigma_px);

/// [height][pitch] normals; pitch is a multiple of cpu::row_padding, at least the width.
cpu::Buffer<float> grain_normals(const PhiloxKey& key, Dimension dimension, float sigma_px, size_t pitch, size_t height,
                                 ks::ThreadPool& workers);

}  // namespace simsense
