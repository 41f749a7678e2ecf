// SPDX-License-Identifier: Apache-2.0
#include "optics/optics.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "scene/scene.h"
#include "spirv/optics.h"
#include "spirv/optics_psf.h"

namespace kuafu {
namespace {

constexpr uint32_t light_kind_end = output_ambient_direct + 1;
constexpr uint32_t varying_kernels = 32;  // between the middle's variance and the corners'

double square(double x) { return x * x; }

/// Numbers that are equal in other bits only cost time.
bool same(const OpticsFields& a, const OpticsFields& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;  // NOLINT(bugprone-suspicious-memory-comparison)
}

bool spreads(const Optics& optics) { return optics.psf_sigma_px > 0.0 || optics.psf_corner_sigma_px > 0.0; }
bool limits_fireflies(const Optics& optics) { return optics.firefly_factor > 0.0; }

/// The Gaussian of the integers: exp(-t) I_n(t), whose variance is exactly t and whose blurs add up, unlike a sampled Gaussian's
/// (Lindeberg, Scale-space for discrete signals, 1990). Returns the weights of the middle tap and `radius` taps on one side; both sides and
/// the middle sum to 1. Miller's recurrence goes downwards from where I_n is negligible: I_{n-1} = I_{n+1} + 2 n / t I_n. Dividing by the
/// sum removes its scale.
std::vector<float> gaussian_kernel(double variance, uint32_t radius) {
  std::vector<double> taps(radius + 1, 0.0);
  taps[0] = 1.0;
  double sum = 1.0;
  if (variance > 1e-9) {
    double above = 0.0, here = 1e-200;
    sum = 0.0;
    for (uint32_t n = 2 * radius + 40; n > 0; --n) {
      const double below = above + 2.0 * n / variance * here;
      if (n <= radius) sum += 2.0 * (taps[n] = here);
      above = here;
      here = below;
      if (here < 1e200) continue;
      for (double& tap : taps) tap *= 1e-300;
      above *= 1e-300;
      here *= 1e-300;
      sum *= 1e-300;
    }
    sum += taps[0] = here;
  }
  std::vector<float> kernel;
  kernel.reserve(taps.size());
  for (const double tap : taps) kernel.push_back(float(tap / sum));
  return kernel;
}

/// Puts the view's kernels behind `table` and says in `record` where they are.
void add_kernels(const Optics& optics, OpticsRecord& record, std::vector<float>& table) {
  if (!spreads(optics)) return;
  const double middle = square(optics.psf_sigma_px), corner = square(optics.psf_corner_sigma_px);
  // Beyond lies 1e-6 of the light.
  record.psf_radius = middle + corner > 0.0 ? uint32_t(std::ceil(5.0 * std::sqrt(middle + corner))) + 2 : 0;
  record.psf_kernels = uint32_t(table.size());
  record.psf_kernels_per_variance = corner > 0.0 ? float(varying_kernels / corner) : 0.0f;
  // There is one kernel more than intervals, and one that rounding in the corners may read.
  for (uint32_t k = 0; k < (corner > 0.0 ? varying_kernels + 2 : 1); ++k) {
    const std::vector<float> kernel = gaussian_kernel(middle + corner * k / varying_kernels, record.psf_radius);
    table.insert(table.end(), kernel.begin(), kernel.end());
  }
}

/// Bit optics_*: the step changes the image of such a camera.
uint32_t steps_of(const Optics& optics) {
  const bool vignettes = optics.vignetting_exponent != 0.0 || optics.vignetting_polynomial != glm::dvec3(0.0);
  const bool glares = optics.veiling_glare_fraction > 0.0;
  return (vignettes ? 1u << optics_vignetting : 0) | (optics.defocuses() ? 1u << optics_defocus : 0) |
         (spreads(optics) ? 1u << optics_psf_columns : 0) | (glares ? 1u << optics_veiling_glare : 0) |
         (limits_fireflies(optics) ? 1u << optics_fireflies : 0);
}

OpticsRecord optics_record(const View& view) {
  const Optics& optics = view.optics;
  OpticsRecord r{};
  copy_fields(optics, r);
  r.fx = float(view.k[0][0]);
  r.fy = float(view.k[1][1]);
  r.cx = float(view.k[2][0]);
  r.cy = float(view.k[2][1]);
  r.skew = float(view.k[1][0]);
  r.lens = lens_record(view.lens.distortion);
  r.defocus_px_m = float(optics.defocus_lens_radius_m * 0.5 * (view.k[0][0] + view.k[1][1]));
  r.defocus_inverse_focus = optics.defocuses() ? float(1.0 / optics.defocus_focus_m) : 0.0f;
  return r;
}

}  // namespace

uint32_t held_for_optics(const Launch& launch) {
  bool any = false, defocus = false, fireflies = false;
  for (const View& view : launch.views) {
    any = any || steps_of(view.optics) != 0;
    defocus = defocus || view.optics.defocuses();
    fireflies = fireflies || limits_fireflies(view.optics);
  }
  uint32_t held = 0;
  for (uint32_t kind = output_radiance; any && kind < light_kind_end; ++kind)
    if (launch.shows(kind)) held |= 1u << kind;
  if (fireflies && (held >> output_radiance & 1) != 0) held |= 1u << output_projector_direct;
  return held != 0 && defocus ? held | 1u << output_depth : held;
}

CameraOptics::CameraOptics(Memory memory) : memory_(std::move(memory)), step_(memory_, optics_spirv, host::optics) {}

void CameraOptics::run(ks::Commands& commands, const Launch& launch, Frame& frame) {
  fit(launch);
  if (steps_ == 0) return;
  write_records(launch);
  OpticsPush push{};
  push.rows = memory_.address(*rows_);
  push.optics = records_.address();
  push.kernels = kernels_.address();
  push.width = launch.width;
  push.height = launch.height;
  push.view_count = uint32_t(launch.views.size());
  if (takes(optics_defocus)) {
    push.depth = frame.address(output_depth);
    step(commands, push, optics_circle_rows, push.view_count * push.height);
  }
  if (takes(optics_fireflies) && launch.shows(output_radiance)) limit_fireflies(commands, push, launch, frame);
  for (uint32_t kind = output_radiance; kind < light_kind_end; ++kind) {
    if (!launch.shows(kind)) continue;
    push.channels = launch.channels(kind);
    develop(commands, push, kind, frame);
  }
}

void CameraOptics::fit(const Launch& launch) {
  steps_ = 0;
  for (const View& view : launch.views) steps_ |= steps_of(view.optics);
  const uint32_t channels = launch.band.channels(), rows = uint32_t(launch.views.size()) * (launch.height + 1) * (channels + 1);
  const bool moves = (steps_ & ~(1u << optics_vignetting | 1u << optics_veiling_glare)) != 0;
  grow(memory_, scratch_, moves ? uint64_t(launch.pixel_count()) * channels : 1);
  grow(memory_, rows_, rows);
}

void CameraOptics::write_records(const Launch& launch) {
  const auto records = records_.resize(memory_, launch.views.size());
  std::vector<float> kernels = {1.0f};  // the kernel of views without blur
  OpticsRecord record{};
  psf_radius_ = 0;
  for (size_t i = 0; i < launch.views.size(); ++i) {
    const OpticsRecord before = record;  // reading it back from the table takes a microsecond a word
    record = optics_record(launch.views[i]);
    if (i > 0 && same(launch.views[i].optics, launch.views[i - 1].optics)) {  // a batch's views are alike
      record.psf_radius = before.psf_radius;
      record.psf_kernels = before.psf_kernels;
      record.psf_kernels_per_variance = before.psf_kernels_per_variance;
    } else {
      add_kernels(launch.views[i].optics, record, kernels);
    }
    records[i] = record;
    psf_radius_ = std::max(psf_radius_, record.psf_radius);
  }
  std::copy(kernels.begin(), kernels.end(), kernels_.resize(memory_, kernels.size()).begin());
}

/// Before the other steps: optics spread what one pixel has too much.
void CameraOptics::limit_fireflies(ks::Commands& commands, OpticsPush push, const Launch& launch, const Frame& frame) {
  push.channels = launch.channels(output_radiance);
  push.direct = frame.address(output_projector_direct);
  push.from = frame.address(output_radiance);
  push.to = memory_.address(*scratch_);
  step(commands, push, optics_fireflies, launch.pixel_count());
  std::swap(push.from, push.to);
  step(commands, push, optics_firefly_pairs, launch.pixel_count());
}

void CameraOptics::develop(ks::Commands& commands, OpticsPush push, uint32_t kind, Frame& frame) {
  const uint32_t pixels = push.view_count * push.width * push.height, channels = push.channels;
  const auto in_place = [&](uint32_t which, uint32_t count) {
    push.from = push.to = frame.address(kind);
    step(commands, push, which, count);
  };
  const auto moved = [&](uint32_t which) {
    push.from = frame.address(kind);
    push.to = memory_.address(*scratch_);
    step(commands, push, which, pixels);
    frame.exchange(kind, scratch_);
  };
  const bool tiled_vignetting = tiles() && takes(optics_vignetting) && !takes(optics_defocus);
  if (takes(optics_vignetting) && !tiled_vignetting) in_place(optics_vignetting, pixels);
  if (takes(optics_defocus)) moved(optics_defocus);
  if (tiles())
    moved(tiled_vignetting ? optics_vignetted_psf : optics_psf);
  else if (takes(optics_psf_columns))
    moved(optics_psf_columns), moved(optics_psf_rows);
  if (!takes(optics_veiling_glare)) return;
  push.rows.at += push.view_count * push.height;  // behind the circles
  in_place(optics_row_sums, push.view_count * push.height * channels);
  in_place(optics_view_means, push.view_count * channels);
  in_place(optics_veiling_glare, pixels);
}

void CameraOptics::step(ks::Commands& commands, OpticsPush push, uint32_t step, uint32_t count) {
  push.step = step;
  push.count = count;
  if (step == optics_psf || step == optics_vignetted_psf) return spread(commands, push);
  step_.run(commands, "optics", push, step);
}

void CameraOptics::spread(ks::Commands& commands, const OpticsPush& push) {
  const auto tiles_along = [](uint32_t length) { return (length + optics_tile_px - 1) / optics_tile_px; };
  const uint32_t step[] = {push.step};
  commands.begin_stage("optics");
  commands.dispatch_line(memory_.device->pipelines().get(optics_psf_spirv, sizeof push, step), push,
                         tiles_along(push.width) * tiles_along(push.height) * push.view_count);
}

}  // namespace kuafu
