// SPDX-License-Identifier: Apache-2.0
// EXT_meshopt_compression: what its encoder wrote is read as it was, and broken data is an error that names it.
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cmath>

#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;
using Bytes = std::vector<unsigned char>;

constexpr int columns = 9, rows = 7, triangle_count = (columns - 1) * (rows - 1) * 2;

struct Grid {
  std::vector<float> positions, normals;  // of a vertex: 3, and 4 with a 0
  std::vector<uint32_t> indices;
};

Grid grid() {
  Grid g;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const float x = 0.1f * float(c), y = 0.2f * float(r), z = std::sin(x + y), length = std::sqrt(x * x + y * y + 1);
      g.positions.insert(g.positions.end(), {x, y, z});
      g.normals.insert(g.normals.end(), {x / length, -y / length, 1 / length, 0});
    }
  for (uint32_t r = 0; r + 1 < rows; ++r)
    for (uint32_t c = 0; c + 1 < columns; ++c) {
      const uint32_t i = r * columns + c, down = i + columns;
      g.indices.insert(g.indices.end(), {i, down, i + 1, i + 1, down, down + 1});
    }
  return g;
}

constexpr size_t vertex_count = size_t{columns} * rows;

Bytes encoded_vertices(const void* values, size_t bytes_each) {
  Bytes out(meshopt_encodeVertexBufferBound(vertex_count, bytes_each));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), values, vertex_count, bytes_each));
  return out;
}

Bytes encoded_indices(const std::vector<uint32_t>& indices, bool triangles) {
  Bytes out(triangles ? meshopt_encodeIndexBufferBound(indices.size(), vertex_count)
                      : meshopt_encodeIndexSequenceBound(indices.size(), vertex_count));
  out.resize(triangles ? meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), indices.size())
                       : meshopt_encodeIndexSequence(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}

/// A compressed view; the uncompressed one that it stands for lies in a buffer that has no bytes.
int add(GltfWriter& w, const Bytes& data, json extension) {
  const size_t count = extension["count"], stride = extension["byteStride"];
  const int view = w.view(data.data(), data.size());
  json& v = w.root["bufferViews"][static_cast<size_t>(view)];
  extension.update({{"buffer", v["buffer"]}, {"byteOffset", v["byteOffset"]}, {"byteLength", v["byteLength"]}});
  v = {{"buffer", 1}, {"byteOffset", 0}, {"byteLength", count * stride}, {"extensions", {{"EXT_meshopt_compression", extension}}}};
  if (extension["mode"] == "ATTRIBUTES") v["byteStride"] = stride;
  return view;
}

/// The grid's mesh. `triangles`: its indices are encoded as such, else as a sequence.
GltfWriter written(const Grid& g, bool triangles, size_t cut = 0) {
  GltfWriter w;
  w.more_buffers = {{{"byteLength", 1 << 20}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  w.root["extensionsRequired"] = {"EXT_meshopt_compression", "KHR_mesh_quantization"};
  Bytes positions = encoded_vertices(g.positions.data(), 12);
  positions.resize(positions.size() - cut);
  const json all = {{"count", vertex_count}, {"mode", "ATTRIBUTES"}};
  json place = all, direction = all;
  place.update({{"byteStride", 12}});
  std::vector<int16_t> octahedral(vertex_count * 4);
  meshopt_encodeFilterOct(octahedral.data(), vertex_count, 8, 16, g.normals.data());
  direction.update({{"byteStride", 8}, {"filter", "OCTAHEDRAL"}});
  const int p = w.accessor(add(w, positions, place), vertex_count, type_float, "VEC3"),
            n = w.accessor(add(w, encoded_vertices(octahedral.data(), 8), direction), vertex_count, 5122, "VEC3");
  w.root["accessors"][static_cast<size_t>(n)]["normalized"] = true;
  const json order = {{"count", g.indices.size()}, {"byteStride", 2}, {"mode", triangles ? "TRIANGLES" : "INDICES"}};
  const int i = w.accessor(add(w, encoded_indices(g.indices, triangles), order), g.indices.size(), type_u16, "SCALAR");
  w.mesh({{{"attributes", {{"POSITION", p}, {"NORMAL", n}}}, {"indices", i}}});
  w.node({{"mesh", 0}});
  return w;
}

TEST(GltfMeshopt, CompressedViewsAreDecoded) {
  const Grid g = grid();
  for (const bool triangles : {false, true}) {
    GltfWriter w = written(g, triangles);
    const Loaded loaded = load_glb(w);
    EXPECT_TRUE(loaded.warnings.empty());
    const Mesh& mesh = loaded.scene.meshes()[0];
    ASSERT_EQ(mesh.positions.size(), vertex_count);
    ASSERT_EQ(mesh.indices.size(), size_t{triangle_count});
    for (size_t i = 0; i < vertex_count; ++i) {
      EXPECT_EQ(mesh.positions[i], glm::vec3(g.positions[3 * i], g.positions[3 * i + 1], g.positions[3 * i + 2]));
      EXPECT_LT(glm::length(mesh.normals[i] - glm::vec3(g.normals[4 * i], g.normals[4 * i + 1], g.normals[4 * i + 2])), 1e-3f);
    }
    for (size_t i = 0; i < size_t{triangle_count}; ++i) {  // the encoder may begin a triangle at another of its corners
      const glm::uvec3 t = mesh.indices[i];
      const uint32_t* const want = &g.indices[3 * i];
      const bool same = t == glm::uvec3(want[0], want[1], want[2]) || t == glm::uvec3(want[1], want[2], want[0]) ||
                        t == glm::uvec3(want[2], want[0], want[1]);
      EXPECT_TRUE(same) << "triangle " << i;
    }
  }
}

TEST(GltfMeshopt, ABufferThatStandsInNeedsNoFlag) {
  GltfWriter w = written(grid(), true);
  w.more_buffers = {{{"byteLength", 1 << 20}}};
  EXPECT_EQ(try_glb(w).error, "");
  w.root["bufferViews"][0].erase("extensions");
  expect_error(w, "buffers[1] has no uri");
}

TEST(GltfMeshopt, ExponentsAreDecoded) {
  const Grid g = grid();
  GltfWriter w = written(g, true);
  std::vector<uint32_t> packed(vertex_count * 3);
  meshopt_encodeFilterExp(packed.data(), vertex_count, 12, 15, g.positions.data());
  const int view = add(w, encoded_vertices(packed.data(), 12),
                       {{"count", vertex_count}, {"mode", "ATTRIBUTES"}, {"byteStride", 12}, {"filter", "EXPONENTIAL"}});
  w.root["accessors"][0]["bufferView"] = view;
  const Loaded loaded = load_glb(w);
  const Mesh& mesh = loaded.scene.meshes()[0];
  for (size_t i = 0; i < vertex_count; ++i)
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(mesh.positions[i][k], g.positions[3 * i + size_t(k)], 1e-3);
}

TEST(GltfMeshopt, BrokenDataIsAnErrorThatNamesIt) {
  const Grid g = grid();
  for (const size_t cut : {size_t{1}, size_t{20}, size_t{60}}) {
    GltfWriter w = written(g, true, cut);
    expect_error(w, "bufferViews[0].extensions.EXT_meshopt_compression: its");
  }
  const auto refused = [&](const char* key, const json& value, const char* message) {
    GltfWriter w = written(g, true);
    w.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][key] = value;
    expect_error(w, message);
  };
  refused("mode", "POINTS", "mode is 'POINTS'");
  refused("filter", "QUATERNION", "filter is 'QUATERNION'");
  refused("byteStride", 7, "byteStride is 7");
  refused("byteStride", 16, "byteStride is 16");
  refused("count", uint64_t{1} << 40, "EXT_meshopt_compression");
  refused("count", "many", "must be a non-negative integer");
  refused("byteLength", 1 << 30, "ends beyond its buffer");
  refused("buffer", 7, "buffer 7 of 2");
}

}  // namespace
