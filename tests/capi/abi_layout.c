/* The structs that have no table (abi_layout_tables.c has the others). The ABI that callers were compiled against, for 64-bit targets:
 * sizes and offsets never change, new fields are appended, and no struct ends in padding (a field appended into padding would leave the
 * size, and with it the version check, as it was). A failure is a negative array size. */
#include <stddef.h>

#include "ks/effect.h"
#include "ks/log.h"

#define JOIN_EXPANDED(a, b) a##b
#define JOIN(a, b) JOIN_EXPANDED(a, b)
#define HOLDS(condition) typedef char JOIN(layout_line_, __LINE__)[(condition) ? 1 : -1] __attribute__((unused))
#define SIZE(type, bytes) HOLDS(sizeof(type) == (bytes))
#define AT(type, field, bytes) HOLDS(offsetof(type, field) == (bytes))
#define ENDS_WITH(type, field) HOLDS(sizeof(type) == offsetof(type, field) + sizeof(((type*)0)->field))

SIZE(ks_status, 4);

SIZE(ks_header, 16);
AT(ks_header, type, 0);
AT(ks_header, size_bytes, 4);
AT(ks_header, next, 8);

SIZE(ks_stage_time, 40);
AT(ks_stage_time, milliseconds, 32);

SIZE(ks_effect_parameter, 56);
AT(ks_effect_parameter, name, 0);
AT(ks_effect_parameter, unit, 8);
AT(ks_effect_parameter, source, 16);
AT(ks_effect_parameter, neutral, 24);
AT(ks_effect_parameter, low, 32);
AT(ks_effect_parameter, high, 40);
AT(ks_effect_parameter, typical, 48);

SIZE(ks_effect, 80);
AT(ks_effect, id, 16);
AT(ks_effect, family, 24);
AT(ks_effect, summary, 32);
AT(ks_effect, source, 40);
AT(ks_effect, stage, 48);
AT(ks_effect, randomness, 52);
AT(ks_effect, parameter_count, 56);
AT(ks_effect, parameters, 64);
AT(ks_effect, apply, 72);
ENDS_WITH(ks_effect, apply);

AT(ks_effect_view, width, 16);
AT(ks_effect_view, height, 20);
AT(ks_effect_view, is_right, 24);
AT(ks_effect_view, frame_id, 28);
AT(ks_effect_view, k, 32);
AT(ks_effect_view, projector_k, 104);
AT(ks_effect_view, camera_to_projector, 176);
AT(ks_effect_view, left_to_camera, 304);
AT(ks_effect_view, camera_velocity, 432);
AT(ks_effect_view, baseline_m, 480);
AT(ks_effect_view, max_dn, 488);
AT(ks_effect_view, exposure_s, 496);
AT(ks_effect_view, gain, 504);
AT(ks_effect_view, timestamp_s, 512);
AT(ks_effect_view, temperature_c, 520);
AT(ks_effect_view, random_seed, 528);
AT(ks_effect_view, depth_m, 536);
AT(ks_effect_view, normal, 544);
AT(ks_effect_view, pattern, 552);
AT(ks_effect_view, pattern_width, 560);
AT(ks_effect_view, pattern_height, 564);
ENDS_WITH(ks_effect_view, pattern_height);
