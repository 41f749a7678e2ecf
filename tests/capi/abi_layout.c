/* The ABI that callers were compiled against, for 64-bit targets: sizes and offsets never change, new fields are appended, and no struct
 * ends in padding (a field appended into padding would leave the size, and with it the version check, as it was). A failure is a negative
 * array size. */
#include <stddef.h>

#include "kuafu/kuafu.h"
#include "simsense/simsense.h"

#define JOIN_EXPANDED(a, b) a##b
#define JOIN(a, b) JOIN_EXPANDED(a, b)
#define HOLDS(condition) typedef char JOIN(layout_line_, __LINE__)[(condition) ? 1 : -1] __attribute__((unused))
#define SIZE(type, bytes) HOLDS(sizeof(type) == (bytes))
#define AT(type, field, bytes) HOLDS(offsetof(type, field) == (bytes))
#define ENDS_WITH(type, field) HOLDS(sizeof(type) == offsetof(type, field) + sizeof(((type*)0)->field))
#define STARTS_WITH_HEADER(type) HOLDS(offsetof(type, header) == 0 && sizeof(((type*)0)->header) == sizeof(ks_header))

SIZE(ks_status, 4);

SIZE(ks_header, 16);
AT(ks_header, type, 0);
AT(ks_header, size_bytes, 4);
AT(ks_header, next, 8);

SIZE(ks_device_desc, 72);
AT(ks_device_desc, select, 16);
AT(ks_device_desc, index, 20);
AT(ks_device_desc, uuid, 24);
AT(ks_device_desc, worker_count, 40);
AT(ks_device_desc, validation, 44);
AT(ks_device_desc, log, 48);
AT(ks_device_desc, log_user, 56);
AT(ks_device_desc, cache_directory, 64);
ENDS_WITH(ks_device_desc, cache_directory);

SIZE(ks_device_info, 1104);
AT(ks_device_info, name, 16);
AT(ks_device_info, driver, 272);
AT(ks_device_info, refused, 528);
AT(ks_device_info, device_uuid, 1040);
AT(ks_device_info, driver_uuid, 1056);
AT(ks_device_info, index, 1072);
AT(ks_device_info, kind, 1076);
AT(ks_device_info, api_version, 1080);
AT(ks_device_info, usable, 1084);
AT(ks_device_info, capabilities, 1088);
AT(ks_device_info, memory_bytes, 1096);
ENDS_WITH(ks_device_info, memory_bytes);

SIZE(ks_buffer_create, 32);
AT(ks_buffer_create, size_bytes, 16);
AT(ks_buffer_create, flags, 24);
ENDS_WITH(ks_buffer_create, reserved);

SIZE(ks_buffer_desc, 96);
AT(ks_buffer_desc, memory, 16);
AT(ks_buffer_desc, memory_type_index, 20);
AT(ks_buffer_desc, handle, 24);
AT(ks_buffer_desc, allocation_bytes, 32);
AT(ks_buffer_desc, offset_bytes, 40);
AT(ks_buffer_desc, size_bytes, 48);
AT(ks_buffer_desc, dedicated, 56);
AT(ks_buffer_desc, device_uuid, 64);
AT(ks_buffer_desc, driver_uuid, 80);
ENDS_WITH(ks_buffer_desc, driver_uuid);

SIZE(ks_image_desc, 112);
AT(ks_image_desc, format, 16);
AT(ks_image_desc, dim_count, 20);
AT(ks_image_desc, shape, 24);
AT(ks_image_desc, byte_stride, 64);
AT(ks_image_desc, offset_bytes, 104);
ENDS_WITH(ks_image_desc, offset_bytes);

SIZE(ks_sync, 40);
AT(ks_sync, kind, 16);
AT(ks_sync, handle, 24);
AT(ks_sync, value, 32);
ENDS_WITH(ks_sync, value);

SIZE(ks_stage_time, 40);
AT(ks_stage_time, milliseconds, 32);

STARTS_WITH_HEADER(kuafu_scene_summary);
STARTS_WITH_HEADER(kuafu_mesh_desc);
STARTS_WITH_HEADER(kuafu_texture_desc);
STARTS_WITH_HEADER(kuafu_material_desc);
STARTS_WITH_HEADER(kuafu_instance_desc);
STARTS_WITH_HEADER(kuafu_light_desc);
STARTS_WITH_HEADER(kuafu_environment_desc);
STARTS_WITH_HEADER(kuafu_medium_desc);
STARTS_WITH_HEADER(kuafu_camera_desc);
STARTS_WITH_HEADER(kuafu_renderer_desc);
STARTS_WITH_HEADER(kuafu_film_desc);
STARTS_WITH_HEADER(kuafu_view_desc);
STARTS_WITH_HEADER(kuafu_output_desc);
STARTS_WITH_HEADER(kuafu_render_desc);
STARTS_WITH_HEADER(kuafu_render_summary);
STARTS_WITH_HEADER(simsense_rig_desc);
STARTS_WITH_HEADER(simsense_parameters);
STARTS_WITH_HEADER(simsense_signal);
STARTS_WITH_HEADER(simsense_output_desc);
STARTS_WITH_HEADER(simsense_compute_desc);

ENDS_WITH(kuafu_scene_summary, bounds_max_m);
ENDS_WITH(kuafu_mesh_desc, triangle_count);
ENDS_WITH(kuafu_texture_desc, reserved);
ENDS_WITH(kuafu_material_desc, reserved);
ENDS_WITH(kuafu_instance_desc, angular_velocity);
ENDS_WITH(kuafu_light_desc, on_until_s);
ENDS_WITH(kuafu_environment_desc, map_to_world);
ENDS_WITH(kuafu_medium_desc, bounds_max_m);
ENDS_WITH(kuafu_camera_desc, angular_velocity);
ENDS_WITH(kuafu_renderer_desc, oidn_library);
ENDS_WITH(kuafu_film_desc, veiling_glare_fraction);
ENDS_WITH(kuafu_view_desc, previous_camera_to_world);
ENDS_WITH(kuafu_output_desc, image);
ENDS_WITH(kuafu_render_desc, relative_error);
ENDS_WITH(kuafu_render_summary, seconds);
ENDS_WITH(simsense_camera, distortion);
ENDS_WITH(simsense_rig_desc, reserved);
ENDS_WITH(simsense_parameters, census_contrast);
ENDS_WITH(simsense_signal, scene_index);
ENDS_WITH(simsense_image, image);
ENDS_WITH(simsense_output_desc, image);
ENDS_WITH(simsense_compute_desc, right_laser);
