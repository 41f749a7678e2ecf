#include "pathtrace/wave_slots.h"

#include "device/error.h"
#include "device/thread_pool.h"

namespace kuafu {

WaveSlots::WaveSlots(const Memory& memory) {
  const size_t count = memory.on_host ? memory.device->workers().size() : 1;
  for (size_t i = 0; i < count; ++i)
    slots_.push_back({WaveBuffers(memory), memory.on_host ? std::make_unique<ks::Commands>(memory.device) : nullptr});
  for (WaveSlot& slot : slots_) idle_.push_back(&slot);
}

void WaveSlots::fit(const WaveSize& size) {
  for (WaveSlot& slot : slots_) slot.buffers.fit(size);
}

WaveSlots::Lease::Lease(WaveSlots& owner) : owner_(owner) {
  const std::lock_guard lock(owner_.mutex_);
  if (owner_.idle_.empty()) ks::fail(KS_ERROR_INTERNAL, "more waves at once than the device has workers (%zu)", owner_.slots_.size());
  slot_ = owner_.idle_.back();
  owner_.idle_.pop_back();
}

WaveSlots::Lease::~Lease() {
  const std::lock_guard lock(owner_.mutex_);
  owner_.idle_.push_back(slot_);
}

void WaveSlots::collect_times(ks::Commands& commands) {
  for (WaveSlot& slot : slots_) {
    if (!slot.commands) continue;
    for (const auto& [name, milliseconds] : slot.commands->stage_times())
      commands.add_host_time(name.c_str(), milliseconds / double(slots_.size()));
    slot.commands->reset_stage_times();
  }
}

}  // namespace kuafu
