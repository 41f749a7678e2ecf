#include "pathtrace/host_kernels.h"

#include "pathtrace/host_language.h"

#define KUAFU_CHANNELS 3
namespace kuafu {
namespace {

constexpr uint features = feature_camera | feature_motion;
#include "lib/camera.glsl"
#include "lib/element.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"
#include "lib/sequence.glsl"

struct Generate {
  const GeneratePush& push;
#include "stage/generate.glsl"
};

struct Resolve {
  const ResolvePush& push;
#include "stage/resolve.glsl"
};

struct Accumulate {
  const AccumulatePush& push;
#include "stage/accumulate.glsl"
};

struct Visibility {
  const AovPush& push;
#include "stage/visibility.glsl"
};

struct Write {
  const WritePush& push;
#include "stage/write.glsl"
};

}  // namespace

namespace host {

void generate(const GeneratePush& push, uint32_t first, uint32_t end) {
  for (Generate stage{push}; first < end; ++first) stage.generate(first);
}

void resolve(const ResolvePush& push, uint32_t first, uint32_t end) {
  for (Resolve stage{push}; first < end; ++first) stage.resolve(first);
}

void accumulate(const AccumulatePush& push, uint32_t first, uint32_t end) {
  for (Accumulate stage{push}; first < end; ++first) stage.accumulate(first);
}

void visibility(const AovPush& push, uint32_t first, uint32_t end) {
  for (Visibility stage{push}; first < end; ++first) stage.visibility(first);
}

void write(const WritePush& push, uint32_t first, uint32_t end) {
  for (Write stage{push}; first < end; ++first) stage.write_pixel(first);
}

QueuePlaces::Places QueuePlaces::take(size_t chunk, uint32_t next_count, uint32_t shadow_count) {
  std::unique_lock lock(mutex_);
  turned_.wait(lock, [&] { return turn_ == chunk; });
  const Places mine = ends_;
  ends_.next += next_count;
  ends_.shadow += shadow_count;
  ++turn_;
  turned_.notify_all();
  return mine;
}

}  // namespace host
}  // namespace kuafu
