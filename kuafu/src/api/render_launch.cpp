#include "api/render_launch.h"

#include <limits>

#include "api/descriptors.h"
#include "api/handles.h"
#include "device/struct_read.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

using ull = unsigned long long;

constexpr uint32_t most_pixels_per_side = 32768, most_bounces = 1024, most_environments = 65536, most_glass_surfaces = 64;

struct OutputKind {
  const char* name;
  uint32_t kind;      // output_*
  uint32_t channels;  // 0: the band's
  uint32_t format;
};

OutputKind output_kind(uint32_t output) {
  switch (output) {
    case KUAFU_OUTPUT_RADIANCE:
      return {"KUAFU_OUTPUT_RADIANCE", output_radiance, 0, KS_FORMAT_F32};
    case KUAFU_OUTPUT_PROJECTOR_DIRECT:
      return {"KUAFU_OUTPUT_PROJECTOR_DIRECT", output_radiance + 1 + group_projector_direct, 0, KS_FORMAT_F32};
    case KUAFU_OUTPUT_PROJECTOR_INDIRECT:
      return {"KUAFU_OUTPUT_PROJECTOR_INDIRECT", output_radiance + 1 + group_projector_indirect, 0, KS_FORMAT_F32};
    case KUAFU_OUTPUT_AMBIENT:
      return {"KUAFU_OUTPUT_AMBIENT", output_radiance + 1 + group_ambient, 0, KS_FORMAT_F32};
    case KUAFU_OUTPUT_DEPTH:
      return {"KUAFU_OUTPUT_DEPTH", output_depth, 1, KS_FORMAT_F32};
    case KUAFU_OUTPUT_NORMAL:
      return {"KUAFU_OUTPUT_NORMAL", output_normal, 3, KS_FORMAT_F32};
    case KUAFU_OUTPUT_INSTANCE_ID:
      return {"KUAFU_OUTPUT_INSTANCE_ID", output_instance_id, 1, KS_FORMAT_U32};
    case KUAFU_OUTPUT_MATERIAL_ID:
      return {"KUAFU_OUTPUT_MATERIAL_ID", output_material_id, 1, KS_FORMAT_U32};
    default:
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u is no KUAFU_OUTPUT_*", output);
  }
}

// Arrays of structs have the stride that the caller compiled with.
template <class T>
T element(const T* first, uint32_t i, uint32_t type, const char* name) {
  const size_t stride = ks::check_header(first, type, name)->size_bytes;
  return ks::read_struct(reinterpret_cast<const T*>(reinterpret_cast<const unsigned char*>(first) + i * stride), type, name);
}

// A struct inside another cannot grow by itself: its length must be ours.
template <class T>
void check_embedded(const T& value, uint32_t type, const char* name) {
  const ks_header* header = ks::check_header(&value, type, name);
  if (header->size_bytes != sizeof(T))
    ks::fail(KS_ERROR_VERSION, "%s is %u bytes long, this library knows %zu: use headers and library of one version", name,
             header->size_bytes, sizeof(T));
  if (header->next != nullptr)
    ks::fail(KS_ERROR_UNSUPPORTED, "%s chains a struct of type 0x%x that is not known here", name, header->next->type);
}

void check_numbers(const kuafu_render_desc& d) {
  if (d.view_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "view_count is 0: there is nothing to render");
  if (d.output_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output_count is 0: ask for at least one output");
  if (d.samples_per_pixel == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "samples_per_pixel is 0, it must be >= 1");
  if (d.samples_per_pixel > std::numeric_limits<uint32_t>::max() - d.first_sample)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "first_sample %u + samples_per_pixel %u is beyond 2^32 - 1", d.first_sample, d.samples_per_pixel);
  if (d.max_bounces > most_bounces)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "max_bounces is %u, at most %u are possible", d.max_bounces, most_bounces);
  if (d.light_sampling > KUAFU_SAMPLING_BSDF)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "light_sampling %u is no KUAFU_SAMPLING_*", d.light_sampling);
  if (d.glass_surfaces > most_glass_surfaces)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "glass_surfaces is %u, at most %u are possible", d.glass_surfaces, most_glass_surfaces);
  if (!(d.ir_ambient_scale >= 0.0f && d.ir_ambient_scale <= std::numeric_limits<float>::max()))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "ir_ambient_scale is %g, it must be finite and >= 0", double(d.ir_ambient_scale));
  if (!(d.ir_ambient_radiance >= 0.0f && d.ir_ambient_radiance <= std::numeric_limits<float>::max()))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "ir_ambient_radiance is %g W/(sr m^2), it must be finite and >= 0", double(d.ir_ambient_radiance));
}

void check_size(const kuafu_camera_desc& first, const kuafu_camera_desc& camera, uint32_t view) {
  if (camera.width == 0 || camera.height == 0 || camera.width > most_pixels_per_side || camera.height > most_pixels_per_side)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "views[%u] is %u x %u pixels, each side must be 1..%u", view, camera.width, camera.height,
             most_pixels_per_side);
  if (camera.width != first.width || camera.height != first.height)
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "views[%u] is %u x %u pixels and views[0] is %u x %u: render sizes that differ in calls of their own", view, camera.width,
             camera.height, first.width, first.height);
}

View read_view(const kuafu_view_desc& desc, uint32_t index) {
  Camera camera = to_camera(desc.camera);
  camera.name = "views[" + std::to_string(index) + "]";
  check(camera);
  if (desc.environment >= most_environments)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "views[%u].environment is %u, it must be below %u", index, desc.environment, most_environments);
  return {camera.k, camera.camera_to_world, camera.near_m, camera.far_m, desc.environment};
}

void read_views(const kuafu_render_desc& desc, Launch& launch) {
  kuafu_view_desc first{};
  for (uint32_t i = 0; i < desc.view_count; ++i) {
    const kuafu_view_desc view = element(desc.views, i, KUAFU_TYPE_VIEW_DESC, "views");
    check_embedded(view.camera, KUAFU_TYPE_CAMERA_DESC, "views[].camera");
    if (i == 0) first = view;
    check_size(first.camera, view.camera, i);
    if (view.band != KUAFU_BAND_VISIBLE && view.band != KUAFU_BAND_INFRARED)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "views[%u].band is %u, which is no KUAFU_BAND_*", i, view.band);
    if (view.band != first.band)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "views[%u] is %s and views[0] is not: render each band in a call of its own", i,
               view.band == KUAFU_BAND_INFRARED ? "infrared" : "visible");
    launch.views.push_back(read_view(view, i));
  }
  launch.width = first.camera.width;
  launch.height = first.camera.height;
  launch.band = {first.band == KUAFU_BAND_INFRARED, desc.ir_ambient_scale, desc.ir_ambient_radiance};
  const ull pixels = ull(launch.views.size()) * launch.width * launch.height;
  if (pixels > std::numeric_limits<int32_t>::max())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%u views of %u x %u are %llu pixels, at most 2^31 - 1 fit one call", desc.view_count, launch.width,
             launch.height, pixels);
}

void check_shape(const ks_image_desc& image, const OutputKind& kind, const Launch& launch, uint32_t channels) {
  if (image.format != kind.format)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has format %u, it must be %s", kind.name, image.format,
             kind.format == KS_FORMAT_F32 ? "KS_FORMAT_F32" : "KS_FORMAT_U32");
  const uint64_t want[4] = {launch.views.size(), launch.height, launch.width, channels};
  bool same = image.dim_count == 4;
  for (int i = 0; i < 4; ++i) same = same && image.shape[i] == want[i];
  if (!same)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has %u dimensions, shape [%llu][%llu][%llu][%llu]; it must be [%llu][%llu][%llu][%llu]",
             kind.name, image.dim_count, ull(image.shape[0]), ull(image.shape[1]), ull(image.shape[2]), ull(image.shape[3]), ull(want[0]),
             ull(want[1]), ull(want[2]), ull(want[3]));
  if ((channels > 1 && image.byte_stride[3] != 4) || (launch.width > 1 && image.byte_stride[2] != int64_t(4 * channels)))
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "%s has byte strides %lld and %lld of column and channel; columns and channels must be packed (%u and 4)", kind.name,
             static_cast<long long>(image.byte_stride[2]), static_cast<long long>(image.byte_stride[3]), 4 * channels);
}

void read_output(const kuafu_output_desc& desc, const ks::Device& device, Launch& launch) {
  const OutputKind kind = output_kind(desc.output);
  const std::shared_ptr<ks::Buffer>& buffer = ks::object_of(desc.buffer, kind.name);
  if (buffer->device().get() != &device)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: its buffer belongs to another device than the renderer", kind.name);
  const ks_image_desc& image = desc.image;
  check_embedded(image, KS_TYPE_IMAGE_DESC, kind.name);
  check_shape(image, kind, launch, kind.channels == 0 ? launch.band.channels() : kind.channels);
  const ks::ByteRange range = ks::check_image(image, buffer->size_bytes(), kind.name);
  if ((range.end - range.begin) / 4 > std::numeric_limits<int32_t>::max())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s spans %llu bytes, at most 8 GiB are possible", kind.name, ull(range.end - range.begin));
  OutputImage& out = launch.outputs[kind.kind];
  if (out.buffer) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is asked for twice", kind.name);
  const auto words = [](int64_t bytes, uint64_t extent) { return extent > 1 ? int(bytes / 4) : 0; };
  out = {buffer, range.begin, int((image.offset_bytes - range.begin) / 4), words(image.byte_stride[0], image.shape[0]),
         words(image.byte_stride[1], image.shape[1])};
}

}  // namespace

Launch read_launch(const kuafu_render_desc* desc, const ks::Device& device) {
  const kuafu_render_desc d = ks::read_struct(desc, KUAFU_TYPE_RENDER_DESC, "render desc");
  check_numbers(d);
  Launch launch;
  read_views(d, launch);
  for (uint32_t i = 0; i < d.output_count; ++i) read_output(element(d.outputs, i, KUAFU_TYPE_OUTPUT_DESC, "outputs"), device, launch);
  launch.samples = d.samples_per_pixel;
  launch.first_sample = d.first_sample;
  launch.max_bounces = d.max_bounces;
  launch.seed = d.seed;
  launch.glass_surfaces = d.glass_surfaces;
  launch.light_sampling = static_cast<LightSampling>(d.light_sampling);
  if (d.progress != nullptr) launch.cancelled = [f = d.progress, user = d.progress_user](float fraction) { return f(user, fraction) != 0; };
  return launch;
}

}  // namespace kuafu
