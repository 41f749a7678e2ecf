/* kuafu: the camera. Included by kuafu.h, whose conventions hold. */
#ifndef KUAFU_CAMERA_H
#define KUAFU_CAMERA_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "ks/header.h"

#define KUAFU_TYPE_CAMERA_DESC 0x1006u

#define KUAFU_SHUTTER_GLOBAL 0u  /* every line is exposed at the same time */
#define KUAFU_SHUTTER_ROLLING 1u /* one line after the other, line_time_s apart */
/* Which way a rolling shutter goes, and what its lines are. */
#define KUAFU_READOUT_ROWS_DOWN 0u /* row 0 first */
#define KUAFU_READOUT_ROWS_UP 1u
#define KUAFU_READOUT_COLUMNS_RIGHT 2u /* column 0 first */
#define KUAFU_READOUT_COLUMNS_LEFT 3u

/* Camera: a pinhole at rest unless its lens, shutter or velocity say more. Time is in seconds from mid-exposure of the middle line, (lines - 1) / 2;
 * line i of a rolling shutter is exposed for exposure_s around (i - (lines - 1) / 2) line_time_s, lines counted in the order of the readout. A pixel is the
 * mean over its square, the lens and its exposure: a longer exposure only blurs, gain belongs to the imager. AOVs are those of the pixel's centre through the
 * lens' centre at the line's mid-exposure. Cameras that a file brought are read with kuafu_scene_get_camera
 * (their width and height are 0 where the file has none). */
typedef struct kuafu_camera_desc {
  ks_header header;
  uint32_t width, height;      /* pixels */
  double k[9];                 /* row-major 3x3 */
  double camera_to_world[16];
  double near_m, far_m;        /* hits outside are not seen by the camera; 0 and +inf by default */
  double distortion[8];        /* k1 k2 p1 p2 k3 k4 k5 k6 of Brown and Conrady (OpenCV's order): from ideal to seen pixels. One that folds back within
                                  the image is refused */
  double lens_radius_m;        /* of the aperture of a thin lens; 0 = pinhole */
  double focus_m;              /* z of the plane that is sharp, > 0 (INFINITY is one); not read for a pinhole */
  uint32_t shutter;            /* KUAFU_SHUTTER_* */
  uint32_t readout;            /* KUAFU_READOUT_*, of a rolling shutter */
  double exposure_s;           /* of each line; 0 = an instant */
  double line_time_s;          /* from one line's exposure to the next one's, of a rolling shutter */
  double linear_velocity[3];   /* twist [v, w] in the camera's own frame, m/s and rad/s: */
  double angular_velocity[3];  /* pose(t) = camera_to_world exp(t [v, w]) */
} kuafu_camera_desc;
static inline kuafu_camera_desc kuafu_camera_desc_init(void) {
  kuafu_camera_desc c;
  int i;
  memset(&c, 0, sizeof c);
  c.header = ks_header_make(KUAFU_TYPE_CAMERA_DESC, (uint32_t)sizeof c);
  for (i = 0; i < 4; ++i) c.camera_to_world[5 * i] = 1.0;
  for (i = 0; i < 3; ++i) c.k[4 * i] = 1.0;
  c.far_m = INFINITY;
  return c;
}

#endif
