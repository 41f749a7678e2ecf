// SPDX-License-Identifier: Apache-2.0
// The objects behind simsense's opaque C handles (device/handle.h).
#pragma once

#include "device/buffer.h"
#include "device/device.h"
#include "device/handle.h"
#include "engine/engine.h"

struct simsense_device_t : ks::Handle<ks::Device, 0x73646576> {
  using Handle::Handle;
};

struct simsense_buffer_t : ks::Handle<ks::Buffer, 0x73627566> {
  using Handle::Handle;
};

struct simsense_engine_t : ks::Handle<simsense::Engine, 0x73656e67> {
  using Handle::Handle;
};
