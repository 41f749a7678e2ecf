// SPDX-License-Identifier: Apache-2.0
#include "stages/stages.h"

namespace simsense {
namespace {

struct Call {
  const Stages& stages;
  const StageSettings& settings;
  const Needs& needs;
};

struct Step {
  const char* name;  // of its time
  void (Stages::*run)();
  bool (*is_asked)(const Call& call);
};

bool always(const Call&) { return true; }
bool drops_padding(const Call& c) { return c.settings.drops_padding; }
bool fills_holes(const Call& c) { return c.settings.hole_filling != HoleFilling::keep; }

constexpr Step image_order[] = {
    {"signal", &Stages::signal, always},
    {"rectify", &Stages::rectify, always},
};

// between them, where disparities are asked for: match_order (match/matcher.h)

constexpr Step map_order[] = {
    {"region", &Stages::place_region, [](const Call& c) { return c.settings.is_partial; }},
    {"padding", &Stages::drop_padding, drops_padding},
    {"texture", &Stages::drop_low_texture, [](const Call& c) { return c.settings.texture.min_texture_dn > 0; }},
    {"speckle filter", &Stages::filter_speckles, [](const Call& c) { return c.settings.speckle_max_size > 0; }},
    {"edges", &Stages::drop_edges, [](const Call& c) { return c.settings.edges.is_on(); }},
    {"hole filling", &Stages::fill_holes, fills_holes},
    {"padding", &Stages::drop_padding, [](const Call& c) { return fills_holes(c) && drops_padding(c); }},
    {"depth", &Stages::depth, [](const Call& c) { return c.needs.depth; }},
    {"registration", &Stages::registration, [](const Call& c) { return c.needs.registered; }},
    {"points", &Stages::points, [](const Call& c) { return c.needs.points && c.stages.makes_points_apart(); }},
    {"reason", &Stages::reason, [](const Call& c) { return c.needs.reason; }},
    {"maps", &Stages::store_maps, [](const Call& c) { return c.needs.confidence || c.needs.reason; }},
};

template <size_t count>
void run(const Step (&order)[count], Stages& stages, const Call& call) {
  for (const Step& step : order)
    if (step.is_asked(call)) stages.measure(step.name, [&] { (stages.*step.run)(); });
}

}  // namespace

void run_stages(Stages& stages, const StageSettings& settings, const Needs& needs) {
  const Call call{stages, settings, needs};
  run(image_order, stages, call);
  if (!needs.disparity) return;
  run_match(stages.matcher(), [&](const char* name, const auto& step) { stages.measure(name, step); });
  run(map_order, stages, call);
}

}  // namespace simsense
