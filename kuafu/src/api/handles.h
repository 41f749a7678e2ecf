// What kuafu's opaque C handles point to (device/handle.h).
#pragma once

#include "device/buffer.h"
#include "device/device.h"
#include "device/handle.h"

struct kuafu_device_t : ks::Handle<ks::Device, 0x6b646576> {
  using Handle::Handle;
};

struct kuafu_buffer_t : ks::Handle<ks::Buffer, 0x6b627566> {
  using Handle::Handle;
};
