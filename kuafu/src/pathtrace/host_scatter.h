// BSDFs of many paths at once, one path per lane of the machine's vectors: what stage `shade` spends most on. The text is the shaders' own
// (lib/bsdf.glsl), in loops that the compiler vectorises. Thread rule: any thread, each with its own lanes.
#pragma once

#include "shared/wave.h"

namespace kuafu::host {

constexpr uint32_t scatter_lanes = 32;

/// Lanes that no path is in may hold anything.
template <uint32_t channels>
struct alignas(64) ScatterLanes {
  template <class T>
  using Lanes = T[scatter_lanes];

  Vec2Array table;  // SceneAddresses.specular_albedo
  uint32_t bounce;
  Lanes<uint32_t> key, index;  // of the path's samples
  Lanes<float> base[channels], metallic, roughness, specular, ior, transmission, coat;
  Lanes<float> wo[3], wi[3];

  Lanes<float> f[channels];                           // towards wi
  Lanes<float> choice, roulette;                      // as stage `shade` draws them
  Lanes<float> u[2], direction[3], weight[channels];  // the way on, unless
  Lanes<uint32_t> delta;                              // it is a mirror's or through glass
};

/// f of wi. The widest vectors that the machine has; results do not depend on them.
void evaluate(ScatterLanes<1>& lanes);
void evaluate(ScatterLanes<3>& lanes);
/// Draws samples, and takes direction and weight from them.
void scatter(ScatterLanes<1>& lanes);
void scatter(ScatterLanes<3>& lanes);

}  // namespace kuafu::host
