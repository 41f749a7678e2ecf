// Which vectors this machine has, for loops over lanes that are compiled for several.
#pragma once

namespace kuafu::host {

#ifdef __x86_64__
inline bool has_avx512() {
  return __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
}
inline bool has_avx2() { return __builtin_cpu_supports("avx2"); }
#define KUAFU_AVX2 [[gnu::target("avx2"), gnu::flatten]]
#define KUAFU_AVX512 [[gnu::target("avx512f,avx512vl,avx512dq,avx512bw"), gnu::flatten]]
#endif

}  // namespace kuafu::host
