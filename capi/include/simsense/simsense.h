/* SPDX-License-Identifier: Apache-2.0 */
/* simsense: a stereo depth engine (imager noise, rectification, census, semi-global matching, checks, registration). C99.
 *
 * Conventions: lengths are in metres, angles in radians, times in seconds. In a camera's frame x points right, y down and z forward. Pixel centres lie at
 * integers. Depth is z, and 0 means invalid. Disparity is x_left - x_right in pixels, and -1 means invalid. A 4x4 transform is row-major and named a_to_b:
 * it maps coordinates in a to coordinates in b.
 * Errors: every function that can fail returns ks_status. simsense_last_error() is the calling thread's last message, with the numbers and what to do. A
 * failed call leaves its objects as they were, and sets no handle.
 * Lifetime: a create or import function returns one reference, ..._retain takes another, and ..._release gives one back, from any thread;
 * ..._release(NULL) does nothing. An engine or buffer keeps its device and what it was given, so that these may be released in any order. Handles are never
 * given to another library: buffers are shared through ks_buffer_desc.
 * Threads: a device may be used by several threads at once, an engine or a buffer by one at a time. A call into an engine that is inside another call is
 * refused with KS_ERROR_INVALID_STATE (simsense_engine_cancel and the release may come from any thread). Distinct objects are independent. Callbacks are
 * called in the thread that called the library, and must not call the library themselves. */
#ifndef SIMSENSE_SIMSENSE_H
#define SIMSENSE_SIMSENSE_H

#include <stdint.h>
#include <string.h>

#include "ks/buffer.h"
#include "ks/device.h"
#include "ks/header.h"
#include "ks/image.h"
#include "ks/log.h"
#include "ks/status.h"
#include "ks/sync.h"
#include "simsense/compute.h"
#include "simsense/parameters.h"
#include "simsense/rig.h"
#include "simsense/signal.h"

#define SIMSENSE_VERSION_MAJOR 0
#define SIMSENSE_VERSION_MINOR 2
#define SIMSENSE_VERSION_PATCH 0

#if defined(__GNUC__)
#define SIMSENSE_API __attribute__((visibility("default")))
#else
#define SIMSENSE_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef struct simsense_device_t* simsense_device;
typedef struct simsense_engine_t* simsense_engine;

SIMSENSE_API uint32_t simsense_version(void);
SIMSENSE_API const char* simsense_last_error(void);
/* Fills in the header and the defaults of any struct, as the struct's inline ..._init does. `type` is the struct's ..._TYPE_... and size_bytes its size in
 * the caller's program. It is meant for languages that do not read C headers. */
SIMSENSE_API ks_status simsense_struct_init(uint32_t type, void* out, uint32_t size_bytes);

/* The functions of devices and buffers do the same as those of kuafu.h with the same names. KS_SELECT_HOST opens a device without Vulkan, for the CPU back
 * end. */
SIMSENSE_API ks_status simsense_device_enumerate(ks_device_info* infos, uint32_t* count);
SIMSENSE_API ks_status simsense_device_create(const ks_device_desc* desc, simsense_device* out);
SIMSENSE_API ks_status simsense_device_get_info(simsense_device device, ks_device_info* out);
SIMSENSE_API void simsense_device_retain(simsense_device device);
SIMSENSE_API void simsense_device_release(simsense_device device);
SIMSENSE_API ks_status simsense_device_copied_bytes(simsense_device device, uint64_t* out);
/* Number of bytes that the device's buffers hold now, including those of engines. */
SIMSENSE_API ks_status simsense_device_allocated_bytes(simsense_device device, uint64_t* out);
/* Lends the library's VkDevice and its queue to another library: *out is what ks_device_desc.vulkan takes. Two libraries on one VkDevice
 * spare the GPU a change of context between their submissions. Release everything made from the borrower's device before `device`.
 * KS_ERROR_INVALID_STATE where the VkDevice is the host's, KS_ERROR_UNSUPPORTED where there is none. */
SIMSENSE_API ks_status simsense_device_lend(simsense_device device, ks_vulkan_device* out);

SIMSENSE_API ks_status simsense_buffer_create(simsense_device device, const ks_buffer_create_desc* create, simsense_buffer* out);
SIMSENSE_API ks_status simsense_buffer_import(simsense_device device, const ks_buffer_desc* desc, simsense_buffer* out);
SIMSENSE_API ks_status simsense_buffer_export(simsense_buffer buffer, uint32_t memory, ks_buffer_desc* out);
SIMSENSE_API ks_status simsense_buffer_map(simsense_buffer buffer, void** out);
SIMSENSE_API ks_status simsense_buffer_write(simsense_buffer buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
SIMSENSE_API ks_status simsense_buffer_read(simsense_buffer buffer, uint64_t offset_bytes, void* data, uint64_t size_bytes);
SIMSENSE_API void simsense_buffer_retain(simsense_buffer buffer);
SIMSENSE_API void simsense_buffer_release(simsense_buffer buffer);

/* Returns an imager by its name. "neutral" is the same as simsense_signal_init. The others were measured, and their input is in 8-bit counts; for other
 * units multiply responsivity_e. The caller initialises `out`.
 * "paper-d415": gamma factor and Gaussian noise fitted to a D415 (Zhang et al., Close the Optical Sensing Domain Gap by Physics-Grounded Active Stereo
 *   Sensor Simulation, 2023): shape 3.98, scale 0.254, mu -0.231 DN, sigma 0.83 DN.
 * "sapien": defaults of SAPIEN 3's stereo depth sensor: a gamma factor of 2.7 % and 0.25 DN.
 * "d435": shot noise of a D435, from pairs of frames of a static scene without projector: variance 0.00497 DN * signal + (0.1 DN)^2. */
SIMSENSE_API ks_status simsense_signal_preset(const char* name, simsense_signal* out);
/* Gives the analogue counts of one imager: DN with black level, which its converter would round and bound. Without noise in the signal they are the
 * expected value. light and dn are packed [height][width] in the host's memory, 2^26 pixels at most. seed and frame_index rule the noise as the parameters
 * noise_seed and frame_index do; side is 0 for the left imager, 1 for the right one. All work is done in the caller's thread. */
SIMSENSE_API ks_status simsense_signal_analogue(const simsense_signal* signal, const float* light, uint32_t width, uint32_t height, uint64_t seed,
                                                uint64_t frame_index, uint32_t side, float* dn);

SIMSENSE_API ks_status simsense_engine_create(simsense_device device, const simsense_rig_desc* rig, const simsense_parameters* parameters, simsense_engine* out);
SIMSENSE_API ks_status simsense_engine_set_parameters(simsense_engine engine, const simsense_parameters* parameters);
SIMSENSE_API ks_status simsense_engine_get_parameters(simsense_engine engine, simsense_parameters* out);
/* Sets and gets the two imagers, which are neutral in a new engine. Their noise is independent. A mismatch of the pair is given by unequal gains or black
 * levels. Either struct of get may be NULL. Where the pair is refused, the previous one stays in use. */
SIMSENSE_API ks_status simsense_engine_set_signal(simsense_engine engine, const simsense_signal* left, const simsense_signal* right);
SIMSENSE_API ks_status simsense_engine_get_signal(simsense_engine engine, simsense_signal* left, simsense_signal* right);
SIMSENSE_API void simsense_engine_retain(simsense_engine engine);
SIMSENSE_API void simsense_engine_release(simsense_engine engine);

/* Returns the geometry after rectification: the left camera's K (row-major 3x3), the baseline in metres (> 0), and left_to_rectified (a 4x4 rotation). The
 * right camera has the same K; in a pair that was given as rectified its cx may differ, which the depth takes into account. Each pointer may be NULL. */
SIMSENSE_API ks_status simsense_engine_get_rectified(simsense_engine engine, double* k, double* baseline_m, double* left_to_rectified);

/* Computes the outputs, and returns when they may be read (KS_SYNC_HOST). */
SIMSENSE_API ks_status simsense_engine_compute(simsense_engine engine, const simsense_compute_desc* desc);
/* Starts a computation. In Vulkan with every image in a buffer of the device it returns while the device works; otherwise it returns when the work has
 * ended (KS_SYNC_HOST). The work of one engine runs in the order of its submissions, so that buffers may be used again, and parameters and signals changed,
 * for later submissions. The caller initialises `out`, which simsense_engine_wait then takes. Two submissions may be under way; a third call waits for the
 * first one. */
SIMSENSE_API ks_status simsense_engine_submit(simsense_engine engine, const simsense_compute_desc* desc, ks_sync* out);
/* Waits until the outputs of a submission may be read. */
SIMSENSE_API ks_status simsense_engine_wait(simsense_engine engine, const ks_sync* sync);
/* Like simsense_engine_wait, but waits at most timeout_ns. KS_ERROR_TIMEOUT means that the submission is still running and may be waited for again.
 * 0 checks without waiting, UINT64_MAX waits as long as it takes. */
SIMSENSE_API ks_status simsense_engine_wait_for(simsense_engine engine, const ks_sync* sync, uint64_t timeout_ns);
/* Ends the compute that another thread is in: it returns KS_ERROR_CANCELLED soon, and the contents of its outputs are undefined. What a GPU has begun
 * runs to its end, which takes milliseconds. Any thread may call it at any time. */
SIMSENSE_API ks_status simsense_engine_cancel(simsense_engine engine);
/* Returns the timeline semaphore that each submission advances to its value, for waiting on the device: its value is the last
 * submission's. On a device that the host has made it is a KS_SYNC_SEMAPHORE, which lives as long as the engine; elsewhere a KS_SYNC_TIMELINE_FD, whose
 * file descriptor the caller closes and for which the device needs KS_CAP_TIMELINE_FD. There must have been a submission. */
SIMSENSE_API ks_status simsense_engine_export_timeline(simsense_engine engine, ks_sync* out);
/* Times of the stages of the last compute or wait; count works as in kuafu_renderer_get_stage_times. */
SIMSENSE_API ks_status simsense_engine_get_stage_times(simsense_engine engine, ks_stage_time* times, uint32_t* count);

#ifdef __cplusplus
}
#endif

#endif
