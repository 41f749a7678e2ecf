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
#include "simsense/parameters.h"
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
typedef struct simsense_buffer_t* simsense_buffer;
typedef struct simsense_engine_t* simsense_engine;

SIMSENSE_API uint32_t simsense_version(void);
SIMSENSE_API const char* simsense_last_error(void);

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

#define SIMSENSE_TYPE_RIG_DESC 0x2001u
#define SIMSENSE_TYPE_COMPUTE_DESC 0x2003u
#define SIMSENSE_TYPE_OUTPUT_DESC 0x2004u

/* One pinhole camera with Brown-Conrady distortion (OpenCV's [k1,k2,p1,p2,k3]). width = 0: absent. */
typedef struct simsense_camera {
  uint32_t width, height;
  double k[9];
  double distortion[5];
} simsense_camera;

/* Faults of the published SimSense that users' results may rest on. Each is a switch; none is on by default. All of them, with the parabola as
 * subpixel step, give its results bit for bit (its random noise apart, whose generator is CUDA's). */
#define SIMSENSE_FAULT_RECTIFIED_SHRUNK 0x01u         /* shrink the rectified images until every source pixel fits (stereoRectify's alpha = 1) */
#define SIMSENSE_FAULT_FOCAL_FROM_RECTIFIER 0x02u     /* depth from stereoRectify's focal length and baseline even where the pair comes rectified;
                                                         cx may differ unheeded, and whether the rig is row-aligned is not checked */
#define SIMSENSE_FAULT_REMAP_NEAREST 0x04u            /* rectify by the nearest pixel; edge pixels repeat beyond the source */
#define SIMSENSE_FAULT_PADDING_MATCHED 0x08u          /* keep disparities of rectified pixels that lie beyond the source image */
#define SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED 0x10u /* register with the left camera's own K and pose, as if nothing had been rectified */
#define SIMSENSE_FAULT_SPLAT_INVALID 0x20u            /* register unmeasured pixels as points at the left camera's centre */
#define SIMSENSE_FAULT_SPLAT_CLIPPED 0x40u            /* registration: a point just beyond the RGB image covers nothing of it, though its splat reaches in */
#define SIMSENSE_FAULTS_PUBLISHED 0x7fu

/* AUTO: Vulkan compute on a GPU that can, else the CPU's vectors (on lavapipe too, where they are faster). VULKAN: KS_ERROR_UNSUPPORTED where it cannot serve.
 * Disparities, confidences and reasons from equal images are the same in every bit. Counts of a noisy signal differ by one where a value lies within rounding of a half, in at
 * most 1 of 1000 pixels; depths by a device's rounding of a quotient (2.5 units in the last place). Vulkan works on the caller's device buffers without
 * any copy; images in host memory are copied, and counted (simsense_device_copied_bytes). */
#define SIMSENSE_BACK_END_AUTO 0u
#define SIMSENSE_BACK_END_CPU 1u
#define SIMSENSE_BACK_END_VULKAN 2u

/* The stereo rig; fixed for the life of an engine. */
typedef struct simsense_rig_desc {
  ks_header header;
  simsense_camera left, right;   /* same width and height, both >= 32 */
  simsense_camera rgb;           /* width 0 = no registration */
  double left_to_right[16];
  double left_to_rgb[16];
  uint32_t rectified;            /* nonzero: the input pair is row-aligned already, K and cx of each camera stay; else it is rectified from both K's,
                                    distortions and left_to_right (OpenCV's stereoRectify, zero disparity at infinity, focal length kept) */
  uint32_t batch_count;          /* image pairs per compute, >= 1 */
  uint32_t faults;               /* SIMSENSE_FAULT_*, or'ed; 0 = none */
  uint32_t back_end;             /* SIMSENSE_BACK_END_*: where the stages run */
  uint32_t low_memory;           /* nonzero: Vulkan takes the least memory, not the least time: one pair of a batch after the other, blocks summed on the way
                                    (960x540, 128 disparities, 7x7 block: 149 instead of 274 MB, in 2.7 times the time). The maps stay the same */
  uint32_t reserved;
} simsense_rig_desc;
static inline simsense_rig_desc simsense_rig_desc_init(void) {
  simsense_rig_desc r;
  int i;
  memset(&r, 0, sizeof r);
  r.header = ks_header_make(SIMSENSE_TYPE_RIG_DESC, (uint32_t)sizeof r);
  for (i = 0; i < 4; ++i) r.left_to_right[5 * i] = r.left_to_rgb[5 * i] = 1.0;
  r.batch_count = 1;
  return r;
}

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

/* An image argument: a buffer of this library, or plain host memory when buffer is NULL. */
typedef struct simsense_image {
  simsense_buffer buffer;
  void* host;               /* used when buffer is NULL; the view's offset counts from here */
  ks_image_desc image;
} simsense_image;

/* What an output holds. H,W are the IR size except where said. */
#define SIMSENSE_OUTPUT_DISPARITY 1u      /* float32 [N,H,W] pixels in the rectified left image, or int16: sixteenths of pixels. -1 pixel = invalid;
                                             min_disparity - 1 where that is less. int16 holds disparities up to 2047 */
#define SIMSENSE_OUTPUT_DEPTH 2u          /* float32 [N,H,W] metres in the rectified left camera, or uint16 or int16: millimetres. 0 = invalid, or
                                             beyond the integer's range */
#define SIMSENSE_OUTPUT_DEPTH_RGB 3u      /* the same [N,H_rgb,W_rgb] in the RGB camera; needs rig.rgb */
#define SIMSENSE_OUTPUT_IR_LEFT 4u        /* uint8 [N,H,W], uint16 above 8 bit: what the left imager gives: after the signal stage, before rectification */
#define SIMSENSE_OUTPUT_IR_RIGHT 5u
#define SIMSENSE_OUTPUT_RECTIFIED_LEFT 6u /* uint8 [N,H,W], uint16 where either imager has more than 8 bit: what the matcher saw */
#define SIMSENSE_OUTPUT_RECTIFIED_RIGHT 7u
#define SIMSENSE_OUTPUT_POINTS 8u         /* float32 [N,H',W',3] metres, RGB camera frame and size if rig.rgb is present, else rectified left; 0,0,0 = invalid */
#define SIMSENSE_OUTPUT_CONFIDENCE 9u     /* float32 [N,H,W] 0..1: 1 - lowest cost / lowest cost of a disparity that is no neighbour of the winner;
                                             unique by ratio r is what has at least r percent. 0 where nothing was measured */
#define SIMSENSE_OUTPUT_REASON 10u        /* uint8 [N,H,W] SIMSENSE_REASON_*: why the left depth is 0 (before hole filling, for disparities) */
#define SIMSENSE_OUTPUT_POINTS_COLORED 11u /* float32 [N,H_rgb,W_rgb,6] x, y, z as POINTS, red, green, blue of the rgb image 0..1; needs rig.rgb */

#define SIMSENSE_REASON_VALID 0u
#define SIMSENSE_REASON_NOT_UNIQUE 1u     /* another disparity fits nearly as well */
#define SIMSENSE_REASON_OUTSIDE 2u        /* its match would lie outside the right image */
#define SIMSENSE_REASON_OCCLUDED 3u       /* the right image's match disagrees: seen by the left eye alone, or wrong */
#define SIMSENSE_REASON_ISOLATED 4u       /* the median: most pixels around are invalid */
#define SIMSENSE_REASON_SPECKLE 5u        /* part of too small an island */
#define SIMSENSE_REASON_OUT_OF_RANGE 6u   /* measured, but not in min_depth_m .. max_depth_m, or at infinity */
#define SIMSENSE_REASON_NOT_COMPUTED 7u   /* outside the region of interest, or seen by no pixel of the unrectified image */
/* These two replace 1, 3, 4, 5 and 6 where the left image explains them. */
#define SIMSENSE_REASON_LOW_TEXTURE 8u
#define SIMSENSE_REASON_SATURATED 9u      /* at least half of the census window is at the largest count */

typedef struct simsense_output_desc {
  ks_header header;
  uint32_t output;    /* SIMSENSE_OUTPUT_* */
  uint32_t reserved;
  simsense_image image;
} simsense_output_desc;

typedef struct simsense_compute_desc {
  ks_header header;
  simsense_image left, right;            /* uint8, uint16 or float32, [N,H,W]; [H,W] when batch_count is 1; any strides */
  const simsense_output_desc* outputs;   /* [output_count] */
  uint32_t output_count;
  uint32_t reserved;
  ks_progress_fn progress;
  void* progress_user;
  simsense_image rgb;                    /* uint8 [N,H_rgb,W_rgb,3], only for POINTS_COLORED; neither buffer nor host = none */
  simsense_image left_laser, right_laser; /* the part of left and right that is laser light, in their unit, uint8, uint16 or float32 [N,H,W]: only coherent
                                            light has speckle (Goodman, Speckle Phenomena in Optics). Taken to be 0..left. Neither buffer nor host: all
                                            light has it. Both or none */
} simsense_compute_desc;
static inline simsense_compute_desc simsense_compute_desc_init(void) {
  simsense_compute_desc c;
  memset(&c, 0, sizeof c);
  c.header = ks_header_make(SIMSENSE_TYPE_COMPUTE_DESC, (uint32_t)sizeof c);
  return c;
}
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
