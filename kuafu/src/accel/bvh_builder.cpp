// SPDX-License-Identifier: Apache-2.0
#include "accel/bvh_builder.h"

#include <algorithm>
#include <array>
#include <bit>

#include "device/error.h"
#include "device/interrupt.h"

namespace kuafu {
namespace {

constexpr int bin_count = 16;
// Cost of one node visit in units of one triangle test; measured on lavapipe and flat around this value.
constexpr float node_cost = 1.2f;
// Below this the bin scale would overflow.
constexpr float min_extent = 1e-36f;

// So many primitives take a noticeable share of a millisecond.
constexpr size_t long_work = 1024;

struct Primitive {
  Box box;
  uint32_t id;
};

struct Split {
  float cost = std::numeric_limits<float>::infinity();  // half area times count, summed over both sides
  int axis = -1, last_left_bin = 0;
};

/// Maps a centroid to its bin along one axis of the centroids' bounds.
struct Binning {
  float origin, scale;
  Binning(const Box& centroids, int axis)
      : origin(centroids.min[axis]), scale(float(bin_count) / (centroids.max[axis] - centroids.min[axis])) {}
  [[nodiscard]] int bin(float centroid) const { return std::clamp(int((centroid - origin) * scale), 0, bin_count - 1); }
};

class Builder {
 public:
  Builder(std::span<const Box> boxes, uint32_t max_leaf, uint32_t max_depth) : max_leaf_(max_leaf), max_depth_(max_depth) {
    primitives_.reserve(boxes.size());
    for (size_t i = 0; i < boxes.size(); ++i) {
      ks::interruption_point(i);
      primitives_.push_back({boxes[i], uint32_t(i)});
    }
  }

  Bvh run() {
    bvh_.nodes.reserve(primitives_.size() / 2 + 1);
    const Child root = child(primitives_, 1);
    bvh_.bounds = root.box;
    if (root.code & bvh_leaf) {  // the root must be a node
      bvh_.nodes.emplace_back();
      set_children(0, root, {bvh_leaf, {}});
    }
    bvh_.order.reserve(primitives_.size());
    for (size_t i = 0; i < primitives_.size(); ++i) {
      ks::interruption_point(i);
      bvh_.order.push_back(primitives_[i].id);
    }
    return std::move(bvh_);
  }

 private:
  struct Child {
    uint32_t code;
    Box box;
  };
  using Range = std::span<Primitive>;

  /// depth: inner nodes on the way from the root if this becomes one more.
  Child child(Range range, uint32_t depth) {
    if (range.size() >= long_work) ks::interruption_point();
    Box box, centroids;
    for (const Primitive& p : range) box.add(p.box), centroids.add(p.box.centroid());
    const Split split = depth <= max_depth_ ? best_split(range, centroids) : Split{};
    const float leaf_cost = box.half_area() * float(range.size());
    if (range.size() <= max_leaf_ && leaf_cost <= split.cost + node_cost * box.half_area()) return {leaf_code(range), box};

    const auto node = uint32_t(bvh_.nodes.size());
    bvh_.nodes.emplace_back();
    const size_t middle = partition(range, centroids, split, depth);
    const Child left = child(range.first(middle), depth + 1);
    const Child right = child(range.subspan(middle), depth + 1);
    set_children(node, left, right);
    return {node, box};
  }

  [[nodiscard]] uint32_t leaf_code(Range range) const {
    return bvh_leaf | uint32_t(range.size()) << bvh_count_shift | uint32_t(range.data() - primitives_.data());
  }

  static Split best_split(Range range, const Box& centroids) {
    Split best;
    for (int axis = 0; axis < 3; ++axis)
      if (centroids.max[axis] - centroids.min[axis] > min_extent) {
        if (range.size() >= long_work) ks::interruption_point();
        best_split_along(range, centroids, axis, best);
      }
    return best;
  }

  static void best_split_along(Range range, const Box& centroids, int axis, Split& best) {
    struct Bin {
      Box box;
      uint32_t count = 0;
      void add(const Bin& other) { box.add(other.box), count += other.count; }
      [[nodiscard]] float cost() const { return box.half_area() * float(count); }
    };
    std::array<Bin, bin_count> bins;
    const Binning binning(centroids, axis);
    for (const Primitive& p : range) bins[size_t(binning.bin(p.box.centroid()[axis]))].add({p.box, 1});

    std::array<float, bin_count> right_cost{};
    Bin right;
    for (size_t i = bin_count - 1; i > 0; --i) {
      right.add(bins[i]);
      right_cost[i] = right.count ? right.cost() : std::numeric_limits<float>::infinity();
    }
    Bin left;
    for (size_t i = 0; i + 1 < bin_count; ++i) {
      left.add(bins[i]);
      if (left.count == 0) continue;
      const float cost = left.cost() + right_cost[i + 1];
      if (cost < best.cost) best = {cost, axis, int(i)};
    }
  }

  /// Inner nodes that median splits still need below a node of `count` boxes.
  [[nodiscard]] uint32_t levels(size_t count) const {
    const size_t leaves = (count + max_leaf_ - 1) / max_leaf_;
    return leaves <= 1 ? 0 : uint32_t(std::bit_width(leaves - 1));
  }

  size_t partition(Range range, const Box& centroids, const Split& split, uint32_t depth) const {
    if (split.axis >= 0) {
      const Binning binning(centroids, split.axis);
      const auto middle = std::partition(
          range.begin(), range.end(), [&](const Primitive& p) { return binning.bin(p.box.centroid()[split.axis]) <= split.last_left_bin; });
      const auto left = size_t(middle - range.begin());
      if (depth + levels(std::max(left, range.size() - left)) <= max_depth_) return left;
    }
    const glm::vec3 extent = centroids.max - centroids.min;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const size_t middle = range.size() / 2;
    std::nth_element(range.begin(), range.begin() + ptrdiff_t(middle), range.end(),
                     [&](const Primitive& a, const Primitive& b) { return a.box.centroid()[axis] < b.box.centroid()[axis]; });
    return middle;
  }

  void set_children(uint32_t node, const Child& a, const Child& b) {
    BvhNode& n = bvh_.nodes[node];
    n.child0 = a.code, n.child1 = b.code;
    set_child_box(n, 0, a.box), set_child_box(n, 1, b.box);
  }

  uint32_t max_leaf_, max_depth_;
  std::vector<Primitive> primitives_;
  Bvh bvh_;
};

}  // namespace

Box child_box(const BvhNode& node, int child) {
  if ((child == 0 ? node.child0 : node.child1) == bvh_leaf) return {};
  const glm::vec4& xy = child == 0 ? node.xy0 : node.xy1;
  const glm::vec2 z = child == 0 ? glm::vec2(node.z) : glm::vec2(node.z.z, node.z.w);
  return {{xy.x, xy.z, z.x}, {xy.y, xy.w, z.y}};
}

Box node_box(const BvhNode& node) {
  Box box = child_box(node, 0);
  box.add(child_box(node, 1));
  return box;
}

void set_child_box(BvhNode& node, int child, const Box& box) {
  // An empty child is a leaf of no triangles far away; a visit by an endless ray does no harm.
  const glm::vec3 far(std::numeric_limits<float>::max());
  const glm::vec3 low = box.empty() ? far : box.min, high = box.empty() ? far : box.max;
  (child == 0 ? node.xy0 : node.xy1) = {low.x, high.x, low.y, high.y};
  node.z[2 * child] = low.z, node.z[2 * child + 1] = high.z;
}

double expected_cost(std::span<const BvhNode> nodes) {
  Box root;
  double cost = 0.0;
  for (const BvhNode& node : nodes)
    for (int child = 0; child < 2; ++child) {
      const Box box = child_box(node, child);
      const uint32_t code = child == 0 ? node.child0 : node.child1;
      cost += double(box.half_area()) * (code & bvh_leaf ? double(code >> bvh_count_shift & 7u) : double(node_cost));
      if (&node == nodes.data()) root.add(box);
    }
  return root.half_area() > 0.0f ? cost / double(root.half_area()) : 0.0;
}

Bvh build_bvh(std::span<const Box> boxes, uint32_t max_leaf, uint32_t max_depth) {
  const uint64_t most = std::min<uint64_t>(bvh_first_mask, uint64_t(max_leaf) << std::min(max_depth, 32u));
  if (boxes.size() > most)
    ks::fail(KS_ERROR_UNSUPPORTED, "a BVH holds at most %llu primitives, not %zu", (unsigned long long)most, boxes.size());
  return Builder(boxes, max_leaf, max_depth).run();
}

}  // namespace kuafu
