// SPDX-License-Identifier: Apache-2.0
#include "api/render_launch.h"

#include <algorithm>
#include <limits>

#include "api/handles.h"
#include "api/struct_table.h"
#include "device/error.h"
#include "device/struct_read.h"
#include "device/struct_table.h"

namespace kuafu {
namespace {

using ull = unsigned long long;

static_assert(format_u8 == KS_FORMAT_U8 && format_u16 == KS_FORMAT_U16 && format_u32 == KS_FORMAT_U32 && format_f16 == KS_FORMAT_F16 &&
              format_f32 == KS_FORMAT_F32);

struct OutputKind {
  uint32_t output;  // KUAFU_OUTPUT_*
  uint32_t kind;    // output_*
  const char* name;
};

constexpr OutputKind output_kinds[] = {
    {KUAFU_OUTPUT_RADIANCE, output_radiance, "KUAFU_OUTPUT_RADIANCE"},
    {KUAFU_OUTPUT_PROJECTOR_DIRECT, output_projector_direct, "KUAFU_OUTPUT_PROJECTOR_DIRECT"},
    {KUAFU_OUTPUT_PROJECTOR_INDIRECT, output_projector_indirect, "KUAFU_OUTPUT_PROJECTOR_INDIRECT"},
    {KUAFU_OUTPUT_AMBIENT, output_radiance + 1 + group_ambient, "KUAFU_OUTPUT_AMBIENT"},
    {KUAFU_OUTPUT_LIGHT_GROUP_0, output_light_group, "KUAFU_OUTPUT_LIGHT_GROUP_0"},
    {KUAFU_OUTPUT_LIGHT_GROUP_0 + 1, output_light_group + 1, "KUAFU_OUTPUT_LIGHT_GROUP_0 + 1"},
    {KUAFU_OUTPUT_LIGHT_GROUP_0 + 2, output_light_group + 2, "KUAFU_OUTPUT_LIGHT_GROUP_0 + 2"},
    {KUAFU_OUTPUT_LIGHT_GROUP_0 + 3, output_light_group + 3, "KUAFU_OUTPUT_LIGHT_GROUP_0 + 3"},
    {KUAFU_OUTPUT_AMBIENT_DIRECT, output_ambient_direct, "KUAFU_OUTPUT_AMBIENT_DIRECT"},
    {KUAFU_OUTPUT_VARIANCE, output_variance, "KUAFU_OUTPUT_VARIANCE"},
    {KUAFU_OUTPUT_SAMPLE_COUNT, output_sample_count, "KUAFU_OUTPUT_SAMPLE_COUNT"},
    {KUAFU_OUTPUT_PROJECTOR, output_projector, "KUAFU_OUTPUT_PROJECTOR"},
    {KUAFU_OUTPUT_SRGB, output_srgb, "KUAFU_OUTPUT_SRGB"},
    {KUAFU_OUTPUT_DEPTH, output_depth, "KUAFU_OUTPUT_DEPTH"},
    {KUAFU_OUTPUT_NORMAL, output_normal, "KUAFU_OUTPUT_NORMAL"},
    {KUAFU_OUTPUT_INSTANCE_ID, output_instance_id, "KUAFU_OUTPUT_INSTANCE_ID"},
    {KUAFU_OUTPUT_MATERIAL_ID, output_material_id, "KUAFU_OUTPUT_MATERIAL_ID"},
    {KUAFU_OUTPUT_SEMANTIC_ID, output_semantic_id, "KUAFU_OUTPUT_SEMANTIC_ID"},
    {KUAFU_OUTPUT_POSITION, output_position, "KUAFU_OUTPUT_POSITION"},
    {KUAFU_OUTPUT_ALBEDO, output_albedo, "KUAFU_OUTPUT_ALBEDO"},
    {KUAFU_OUTPUT_ROUGHNESS, output_roughness, "KUAFU_OUTPUT_ROUGHNESS"},
    {KUAFU_OUTPUT_TRANSMISSION, output_transmission, "KUAFU_OUTPUT_TRANSMISSION"},
    {KUAFU_OUTPUT_PROJECTOR_UV, output_projector_uv, "KUAFU_OUTPUT_PROJECTOR_UV"},
    {KUAFU_OUTPUT_PROJECTOR_VISIBILITY, output_projector_visibility, "KUAFU_OUTPUT_PROJECTOR_VISIBILITY"},
    {KUAFU_OUTPUT_PROJECTOR_GEOMETRY, output_projector_geometry, "KUAFU_OUTPUT_PROJECTOR_GEOMETRY"},
    {KUAFU_OUTPUT_MOTION, output_motion, "KUAFU_OUTPUT_MOTION"},
};

const OutputKind& find_output(uint32_t output) {
  for (const OutputKind& kind : output_kinds)
    if (kind.output == output) return kind;
  ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u is no KUAFU_OUTPUT_*", output);
}

void check_format(const ks_image_desc& image, const OutputKind& kind) {
  const uint32_t f = image.format;
  const bool narrow = f == KS_FORMAT_U8 || f == KS_FORMAT_U16;
  if (kind.kind == output_sample_count && f != KS_FORMAT_U32)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has format %u, it must be KS_FORMAT_U32", kind.name, f);
  if (kind.kind == output_srgb && f != KS_FORMAT_U8)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has format %u, it must be KS_FORMAT_U8", kind.name, f);
  if (is_integer(kind.kind) ? !narrow && f != KS_FORMAT_U32 : !narrow && f != KS_FORMAT_F16 && f != KS_FORMAT_F32)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has format %u, it must be KS_FORMAT_%s, _U16 or _U8", kind.name, f,
             is_integer(kind.kind) ? "U32" : "F32, _F16");
}

void check_shape(const ks_image_desc& image, const OutputKind& kind, const Launch& launch) {
  const uint32_t channels = launch.channels(kind.kind);
  const uint64_t want[4] = {launch.views.size(), launch.height, launch.width, channels};
  bool same = image.dim_count == 4;
  for (int i = 0; i < 4; ++i) same = same && image.shape[i] == want[i];
  if (!same)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has %u dimensions, shape [%llu][%llu][%llu][%llu]; it must be [%llu][%llu][%llu][%llu]",
             kind.name, image.dim_count, ull(image.shape[0]), ull(image.shape[1]), ull(image.shape[2]), ull(image.shape[3]), ull(want[0]),
             ull(want[1]), ull(want[2]), ull(want[3]));
  const uint32_t bytes = ks_format_bytes(image.format);
  if ((channels > 1 && image.byte_stride[3] != bytes) || (launch.width > 1 && image.byte_stride[2] != int64_t{bytes} * channels))
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "%s has byte strides %lld and %lld of column and channel; columns and channels must be packed (%u and %u)", kind.name,
             static_cast<long long>(image.byte_stride[2]), static_cast<long long>(image.byte_stride[3]), bytes * channels, bytes);
}

void check_srgb(const ks_image_desc& image, const Launch& launch) {
  if (launch.band.infrared) ks::fail(KS_ERROR_INVALID_ARGUMENT, "KUAFU_OUTPUT_SRGB is of visible views, these are infrared");
  if (image.offset_bytes % 4 != 0 || image.byte_stride[0] % 4 != 0 || image.byte_stride[1] % 4 != 0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "KUAFU_OUTPUT_SRGB has offset %llu and byte strides %lld and %lld, which must be multiples of 4",
             ull(image.offset_bytes), static_cast<long long>(image.byte_stride[0]), static_cast<long long>(image.byte_stride[1]));
}

float read_scale(const kuafu_output_desc& desc, const OutputKind& kind) {
  if (!(desc.scale >= 0.0f && desc.scale <= std::numeric_limits<float>::max()))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has scale %g, it must be finite and >= 0", kind.name, double(desc.scale));
  if (is_integer(kind.kind) && desc.scale != 0.0f && desc.scale != 1.0f)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has scale %g, but ids are not scaled: leave it 0", kind.name, double(desc.scale));
  if (kind.kind == output_srgb) return desc.scale;  // 0: the image's own exposure
  if (desc.scale != 0.0f || is_integer(kind.kind)) return is_integer(kind.kind) ? 1.0f : desc.scale;
  return desc.image.format == KS_FORMAT_U8 ? 255.0f : desc.image.format == KS_FORMAT_U16 ? 65535.0f : 1.0f;
}

void read_output(const kuafu_output_desc& desc, const ks::Device& device, Launch& launch) {
  const OutputKind& kind = find_output(desc.output);
  const std::shared_ptr<ks::Buffer>& buffer = ks::object_of(desc.buffer, kind.name);
  if (buffer->device().get() != &device)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: its buffer belongs to another device than the renderer", kind.name);
  const ks_image_desc& image = desc.image;
  ks::check_embedded(image, KS_TYPE_IMAGE_DESC, kind.name);
  check_format(image, kind);
  check_shape(image, kind, launch);
  if (kind.kind == output_srgb) check_srgb(image, launch);
  const ks::ByteRange range = ks::check_image(image, buffer->size_bytes(), kind.name);
  const int64_t bytes = ks_format_bytes(image.format);
  const uint64_t begin = range.begin / 4 * 4;
  if ((range.end - begin) / bytes > std::numeric_limits<int32_t>::max())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s spans %llu elements, at most 2^31 - 1 are possible", kind.name,
             ull((range.end - begin) / bytes));
  OutputImage& out = launch.outputs[kind.kind];
  if (out.buffer) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is asked for twice", kind.name);
  const auto elements = [&](int dim) { return image.shape[dim] > 1 ? int(image.byte_stride[dim] / bytes) : 0; };
  out = {.buffer = buffer,
         .offset_bytes = begin,
         .first = int((image.offset_bytes - begin) / bytes),
         .view_stride = elements(0),
         .row_stride = elements(1),
         .format = image.format,
         .scale = read_scale(desc, kind)};
}

void check_fits(const Launch& launch, uint32_t kind, const char* what, uint64_t largest) {
  if (!launch.outputs[kind].buffer || launch.outputs[kind].format == format_u32) return;
  const uint64_t most = (uint64_t(1) << format_bits(launch.outputs[kind].format)) - 2;  // the last one says: none
  if (largest > most)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s go to %llu, its output's format holds 0..%llu: take a wider format", what, ull(largest),
             ull(most));
}

}  // namespace

void read_outputs(const kuafu_render_desc& desc, const ks::Device& device, Launch& launch) {
  for (uint32_t i = 0; i < desc.output_count; ++i)
    read_output(ks::read_element(desc.outputs, i, KUAFU_TYPE_OUTPUT_DESC, "outputs"), device, launch);
  if (launch.outputs[output_ambient_direct].buffer && launch.wants(output_light_group, output_light_group + light_group_count))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "KUAFU_OUTPUT_AMBIENT_DIRECT and light groups divide the same light: ask for them in two renders");
}

void check_ids_fit(const Launch& launch, const Scene& scene) {
  uint64_t largest = 0, largest_semantic = 0, largest_material = 0;
  for (const uint32_t id : scene.instances().ids()) {
    if (id == none) continue;
    largest = std::max<uint64_t>(largest, id);
    largest_semantic = std::max<uint64_t>(largest_semantic, scene.instances()[id].semantic_id);
  }
  for (const uint32_t id : scene.materials().ids()) largest_material = std::max<uint64_t>(largest_material, id == none ? 0 : id);
  check_fits(launch, output_instance_id, "instance ids", largest);
  check_fits(launch, output_semantic_id, "semantic ids", largest_semantic);
  check_fits(launch, output_material_id, "material ids", largest_material);
}

}  // namespace kuafu
