// Where waves are rendered: memory of queues and state, and a recorder. A device has one place; on the host each worker has its own, small
// enough for its cache. Thread rule: take and give from any thread, all else externally synchronised.
#pragma once

#include <mutex>

#include "device/compute.h"
#include "pathtrace/wave_buffers.h"

namespace kuafu {

struct WaveSlot {
  WaveBuffers buffers;
  std::unique_ptr<ks::Commands> commands;  // host: for its stage times
};

class WaveSlots {
 public:
  explicit WaveSlots(const Memory& memory);
  void fit(const WaveSize& size);
  [[nodiscard]] const WaveSize& size() const { return slots_.front().buffers.size(); }
  /// The device's.
  [[nodiscard]] WaveBuffers& only() { return slots_.front().buffers; }

  /// Lends one of the host's, while it lives.
  class Lease {
   public:
    explicit Lease(WaveSlots& owner);
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    [[nodiscard]] WaveSlot& slot() const { return *slot_; }

   private:
    WaveSlots& owner_;
    WaveSlot* slot_;
  };

  /// Brings the host's stage times, means of all workers, to `commands` and forgets them.
  void collect_times(ks::Commands& commands);

 private:
  std::vector<WaveSlot> slots_;
  std::mutex mutex_;
  std::vector<WaveSlot*> idle_;
};

}  // namespace kuafu
