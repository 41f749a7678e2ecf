// SPDX-License-Identifier: Apache-2.0
#include "film/film.h"

#include <algorithm>

#include "film/gaussian.h"
#include "scene/scene.h"
#include "spirv/film.h"

namespace kuafu {
namespace {

constexpr uint32_t light_kind_end = output_light_group + light_group_count;
constexpr uint32_t varying_kernels = 32;  // between the middle's variance and the corners'

double square(double x) { return x * x; }

bool spreads(const Film& film) { return film.psf_sigma_px > 0.0 || film.psf_corner_sigma_px > 0.0; }
bool limits_fireflies(const Film& film) { return film.firefly_factor > 0.0; }

/// Puts the view's kernels behind `table` and says in `record` where they are.
void add_kernels(const Film& film, FilmRecord& record, std::vector<float>& table) {
  if (!spreads(film)) return;
  const double middle = square(film.psf_sigma_px), corner = square(film.psf_corner_sigma_px);
  record.psf_radius = gaussian_radius(middle + corner);
  record.psf_kernels = uint32_t(table.size());
  record.psf_kernels_per_variance = corner > 0.0 ? float(varying_kernels / corner) : 0.0f;
  // There is one kernel more than intervals, and one that rounding in the corners may read.
  for (uint32_t k = 0; k < (corner > 0.0 ? varying_kernels + 2 : 1); ++k) {
    const std::vector<float> kernel = gaussian_kernel(middle + corner * k / varying_kernels, record.psf_radius);
    table.insert(table.end(), kernel.begin(), kernel.end());
  }
}

/// Bit film_*: the step changes the image of such a camera.
uint32_t steps_of(const Film& film) {
  const bool vignettes = film.vignetting_exponent != 0.0 || film.vignetting_polynomial != glm::dvec3(0.0);
  const bool glares = film.veiling_glare_fraction > 0.0;
  return (vignettes ? 1u << film_vignetting : 0) | (film.defocuses() ? 1u << film_defocus : 0) |
         (spreads(film) ? 1u << film_psf_columns : 0) | (glares ? 1u << film_veiling_glare : 0) |
         (limits_fireflies(film) ? 1u << film_fireflies : 0);
}

FilmRecord film_record(const View& view) {
  const Film& film = view.film;
  FilmRecord r{};
  copy_fields(film, r);
  r.fx = float(view.k[0][0]);
  r.fy = float(view.k[1][1]);
  r.cx = float(view.k[2][0]);
  r.cy = float(view.k[2][1]);
  r.skew = float(view.k[1][0]);
  r.distorts = distorts(view.optics.distortion) ? 1 : 0;
  std::ranges::copy(view.optics.distortion, r.distortion);
  r.defocus_px_m = float(film.defocus_lens_radius_m * 0.5 * (view.k[0][0] + view.k[1][1]));
  r.defocus_inverse_focus = film.defocuses() ? float(1.0 / film.defocus_focus_m) : 0.0f;
  return r;
}

}  // namespace

uint32_t held_for_film(const Launch& launch) {
  bool any = false, defocus = false, fireflies = false;
  for (const View& view : launch.views) {
    any = any || !view.film.is_neutral();
    defocus = defocus || view.film.defocuses();
    fireflies = fireflies || limits_fireflies(view.film);
  }
  uint32_t held = 0;
  for (uint32_t kind = output_radiance; any && kind < light_kind_end; ++kind)
    if (launch.shows(kind)) held |= 1u << kind;
  if (fireflies && (held >> output_radiance & 1) != 0) held |= 1u << output_projector_direct;
  return held != 0 && defocus ? held | 1u << output_depth : held;
}

FilmOptics::FilmOptics(Memory memory) : memory_(std::move(memory)), step_(memory_, film_spirv, host::film) {}

void FilmOptics::run(ks::Commands& commands, const Launch& launch, const Frame& frame) {
  fit(launch);
  if (steps_ == 0) return;
  write_records(launch);
  FilmPush push{};
  push.rows = memory_.address(*rows_);
  push.films = records_.address();
  push.kernels = kernels_.address();
  push.width = launch.width;
  push.height = launch.height;
  push.view_count = uint32_t(launch.views.size());
  if (takes(film_defocus)) {
    push.depth = frame.address(output_depth);
    step(commands, push, film_circle_rows, push.view_count * push.height);
  }
  if (takes(film_fireflies) && launch.shows(output_radiance)) limit_fireflies(commands, push, launch, frame);
  for (uint32_t kind = output_radiance; kind < light_kind_end; ++kind) {
    if (!launch.shows(kind)) continue;
    push.channels = launch.channels(kind);
    push.to = frame.address(kind);
    develop(commands, push);
  }
}

void FilmOptics::fit(const Launch& launch) {
  steps_ = 0;
  for (const View& view : launch.views) steps_ |= steps_of(view.film);
  const uint32_t channels = launch.band.channels(), rows = uint32_t(launch.views.size()) * (launch.height + 1) * (channels + 1);
  const bool moves = (steps_ & ~(1u << film_vignetting | 1u << film_veiling_glare)) != 0;
  grow(memory_, scratch_, moves ? uint64_t(launch.pixel_count()) * channels : 1);
  grow(memory_, rows_, rows);
}

void FilmOptics::write_records(const Launch& launch) {
  const auto records = records_.resize(memory_, launch.views.size());
  std::vector<float> kernels = {1.0f};  // the kernel of views without blur
  for (size_t i = 0; i < launch.views.size(); ++i) {
    FilmRecord record = film_record(launch.views[i]);
    add_kernels(launch.views[i].film, record, kernels);
    records[i] = record;
  }
  std::copy(kernels.begin(), kernels.end(), kernels_.resize(memory_, kernels.size()).begin());
}

/// Before the other steps: optics spread what one pixel has too much.
void FilmOptics::limit_fireflies(ks::Commands& commands, FilmPush push, const Launch& launch, const Frame& frame) {
  push.channels = launch.channels(output_radiance);
  push.direct = frame.address(output_projector_direct);
  push.from = frame.address(output_radiance);
  push.to = memory_.address(*scratch_);
  step(commands, push, film_fireflies, launch.pixel_count());
  std::swap(push.from, push.to);
  step(commands, push, film_firefly_pairs, launch.pixel_count());
}

void FilmOptics::develop(ks::Commands& commands, FilmPush push) {
  const uint32_t pixels = push.view_count * push.width * push.height, channels = push.channels;
  const FloatArray image = push.to;
  FloatArray spare = memory_.address(*scratch_);
  const auto in_place = [&](uint32_t which, uint32_t count) {
    push.from = push.to;
    step(commands, push, which, count);
  };
  const auto moved = [&](uint32_t which) {
    push.from = push.to;
    push.to = spare;
    step(commands, push, which, pixels);
    spare = push.from;
  };
  if (takes(film_vignetting)) in_place(film_vignetting, pixels);
  if (takes(film_defocus)) moved(film_defocus);
  if (takes(film_psf_columns)) moved(film_psf_columns), moved(film_psf_rows);
  if (push.to.at != image.at) moved(film_copy);
  if (!takes(film_veiling_glare)) return;
  push.rows.at += push.view_count * push.height;  // behind the circles
  in_place(film_row_sums, push.view_count * push.height * channels);
  in_place(film_view_means, push.view_count * channels);
  in_place(film_veiling_glare, pixels);
}

void FilmOptics::step(ks::Commands& commands, FilmPush push, uint32_t step, uint32_t count) {
  push.step = step;
  push.count = count;
  step_.run(commands, "film", push);
}

}  // namespace kuafu
