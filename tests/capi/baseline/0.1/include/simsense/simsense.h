/* simsense: a stereo depth engine (imager noise, rectification, census, semi-global matching, checks, registration). C99.
 *
 * Conventions: metres, radians, seconds; camera x right, y down, z forward; pixel centres at integers; depth is z, 0 = invalid; disparity =
 * x_left - x_right in pixels, -1 = invalid. A 4x4 transform is row-major and named a_to_b: it maps coordinates in a to coordinates in b.
 * Errors: a call that can fail returns ks_status; simsense_last_error() is the calling thread's last message, with the numbers and what to do. A failed
 * call leaves its objects as they were, and sets no handle.
 * Handles: a create or import gives its caller one reference; whoever holds one gives it back with ..._release, once, from any thread; ..._retain takes
 * one more. An engine or buffer keeps its device and what it was given, so any order of releases is right; release(NULL) does nothing. A handle
 * never goes to another library: buffers meet through ks_buffer_desc.
 * Threads: a device may be used by several threads at once; an engine or a buffer by one at a time, its release included; distinct objects are
 * independent. Callbacks come on the thread that called and must not call back into the library. */
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
#define SIMSENSE_VERSION_MINOR 1
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
/* Fills in the header and the defaults of any struct, as its inline ..._init does: type is the struct's ..._TYPE_..., size_bytes its sizeof where the
 * caller was compiled. For languages that read no headers. */
SIMSENSE_API ks_status simsense_struct_init(uint32_t type, void* out, uint32_t size_bytes);

/* Device and buffer calls mean what their namesakes in kuafu.h mean. KS_SELECT_HOST gives a device without Vulkan: the CPU back end. */
SIMSENSE_API ks_status simsense_device_enumerate(ks_device_info* infos, uint32_t* count);
SIMSENSE_API ks_status simsense_device_create(const ks_device_desc* desc, simsense_device* out);
SIMSENSE_API ks_status simsense_device_get_info(simsense_device device, ks_device_info* out);
SIMSENSE_API void simsense_device_retain(simsense_device device);
SIMSENSE_API void simsense_device_release(simsense_device device);
SIMSENSE_API ks_status simsense_device_copied_bytes(simsense_device device, uint64_t* out);
/* Bytes of memory that this device's buffers hold now, those of renderers and scenes included. */
SIMSENSE_API ks_status simsense_device_allocated_bytes(simsense_device device, uint64_t* out);

SIMSENSE_API ks_status simsense_buffer_create(simsense_device device, const ks_buffer_create* create, simsense_buffer* out);
SIMSENSE_API ks_status simsense_buffer_import(simsense_device device, const ks_buffer_desc* desc, simsense_buffer* out);
SIMSENSE_API ks_status simsense_buffer_export(simsense_buffer buffer, uint32_t memory, ks_buffer_desc* out);
SIMSENSE_API ks_status simsense_buffer_map(simsense_buffer buffer, void** out);
SIMSENSE_API ks_status simsense_buffer_write(simsense_buffer buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
SIMSENSE_API ks_status simsense_buffer_read(simsense_buffer buffer, uint64_t offset_bytes, void* data, uint64_t size_bytes);
SIMSENSE_API void simsense_buffer_retain(simsense_buffer buffer);
SIMSENSE_API void simsense_buffer_release(simsense_buffer buffer);

/* Imagers by name. "neutral" is simsense_signal_init; the others are measured, and their input is in 8-bit counts: multiply responsivity_e for other
 * units. `out` is initialised by the caller.
 * "paper-d415": gamma factor and Gaussian noise fitted to a D415 (Zhang et al., Close the Optical Sensing Domain Gap by Physics-Grounded Active Stereo
 *   Sensor Simulation, 2023): shape 3.98, scale 0.254, mu -0.231 DN, sigma 0.83 DN.
 * "sapien": defaults of SAPIEN 3's stereo depth sensor: a gamma factor of 2.7 % and 0.25 DN.
 * "d435": shot noise of a D435, from pairs of frames of a static scene without projector: variance 0.00497 DN * signal + (0.1 DN)^2. */
SIMSENSE_API ks_status simsense_signal_preset(const char* name, simsense_signal* out);

SIMSENSE_API ks_status simsense_engine_create(simsense_device device, const simsense_rig_desc* rig, const simsense_parameters* parameters, simsense_engine* out);
SIMSENSE_API ks_status simsense_engine_set_parameters(simsense_engine engine, const simsense_parameters* parameters);
SIMSENSE_API ks_status simsense_engine_get_parameters(simsense_engine engine, simsense_parameters* out);
/* The two imagers; a new engine's are neutral. Their noise is independent, and unequal gains or black levels are the pair's mismatch. Either struct of
 * get may be NULL. A refused pair leaves the old one in force. */
SIMSENSE_API ks_status simsense_engine_set_signal(simsense_engine engine, const simsense_signal* left, const simsense_signal* right);
SIMSENSE_API ks_status simsense_engine_get_signal(simsense_engine engine, simsense_signal* left, simsense_signal* right);
SIMSENSE_API void simsense_engine_retain(simsense_engine engine);
SIMSENSE_API void simsense_engine_release(simsense_engine engine);

/* After rectification: the left camera's K (row-major 3x3), shared by the right one (a pair given as rectified may differ in cx, and depth heeds that),
 * the baseline in metres (> 0), and left_to_rectified (4x4 rotation). Each pointer may be NULL. */
SIMSENSE_API ks_status simsense_engine_get_rectified(simsense_engine engine, double* k, double* baseline_m, double* left_to_rectified);

/* Blocks until the outputs may be read (KS_SYNC_HOST). */
SIMSENSE_API ks_status simsense_engine_compute(simsense_engine engine, const simsense_compute_desc* desc);
/* The same, but returns as soon as the work is under way where that is possible: in Vulkan with every image in a buffer of the device (else it has
 * ended, KS_SYNC_HOST). Buffers may be used again, and parameters and signals changed, only for what is submitted later: work of one engine runs in the
 * order of its submissions. `out` is initialised by the caller and becomes what wait takes; two submissions may be under way, a third waits for the first. */
SIMSENSE_API ks_status simsense_engine_submit(simsense_engine engine, const simsense_compute_desc* desc, ks_sync* out);
/* Blocks until that submission's outputs may be read. */
SIMSENSE_API ks_status simsense_engine_wait(simsense_engine engine, const ks_sync* sync);
/* The semaphore that reaches each submission's value, for waiting on the device: a KS_SYNC_TIMELINE_FD with the last submission's value, whose fd is the
 * caller's to close. Needs KS_CAP_TIMELINE_FD and one submission. */
SIMSENSE_API ks_status simsense_engine_export_timeline(simsense_engine engine, ks_sync* out);
/* Of the last compute or wait. */
SIMSENSE_API ks_status simsense_engine_get_stage_times(simsense_engine engine, ks_stage_time* times, uint32_t* count);

#ifdef __cplusplus
}
#endif

#endif
