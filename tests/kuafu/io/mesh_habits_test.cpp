// SPDX-License-Identifier: Apache-2.0
// OBJ, PLY and STL files as many exporters write them: the same two triangles each time, in 200 ways and more.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "capi/device/expect_error.h"
#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

using Corner = std::array<float, 3>;
using Triangle = std::array<Corner, 3>;

/// Each triangle from its least corner on, in order: a reader may begin anywhere.
std::vector<Triangle> sorted(std::vector<Triangle> triangles) {
  for (Triangle& t : triangles) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

std::vector<Triangle> triangles_of(const Scene& scene) {
  std::vector<Triangle> out;
  for (const auto& mesh : scene.meshes()) {
    const auto corner = [&](uint32_t i) { return Corner{mesh->positions[i].x, mesh->positions[i].y, mesh->positions[i].z}; };
    for (const glm::uvec3& t : mesh->indices) out.push_back({corner(t.x), corner(t.y), corner(t.z)});
  }
  return sorted(std::move(out));
}

// The corners: (0.5, 0, 0), (1.25, -0.5, 0), (0, 1, -0.25), (0, 0, 1); the faces: 1 2 3 and 1 3 4.
const std::vector<Triangle> expected = [] {
  const Corner a{0.5f, 0, 0}, b{1.25f, -0.5f, 0}, c{0, 1, -0.25f}, d{0, 0, 1};
  return sorted({{a, b, c}, {a, c, d}});
}();

void expect_the_triangles(const std::string& name, const std::string& text) {
  const Folder folder;
  write_text(folder / name, text);
  SCOPED_TRACE(text);
  const std::vector<Triangle> found = triangles_of(load_path(folder / name).scene);
  ASSERT_EQ(found.size(), expected.size());
  for (size_t t = 0; t < found.size(); ++t)
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(found[t][k][i], expected[t][k][i], 1e-6f) << "triangle " << t;
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size())) text.replace(at, what.size(), by);
  return text;
}

/// How exporters write 0.5, 1.25, -0.5, 1 and -0.25.
struct Numbers {
  const char *half, *five_quarters, *minus_half, *one, *minus_quarter;
};
constexpr std::array numbers = {
    Numbers{"0.5", "1.25", "-0.5", "1", "-0.25"},
    Numbers{".5", "1.25", "-.5", "1.", "-.25"},
    Numbers{"+.5", "+1.25", "-.5", "+1", "-.25"},
    Numbers{"5e-1", "125e-2", "-5E-01", "1e0", "-25.0e-2"},
    Numbers{".5E+00", "1.25E+00", "-.5E+00", "1.E+00", "-.25E+00"},
    Numbers{"0.500000000000000000000000", "1.250000", "-0.500000", "1.000000", "-0.250000"},
    Numbers{"0000.5", "0001.25", "-00.5", "01", "-0000.25"},
    Numbers{"5.0000000e-001", "1.2500000e+000", "-5.0000000e-001", "1.0000000e+000", "-2.5000000e-001"},
};

/// How they write the corners of the two faces.
constexpr std::array faces = {
    "f 1 2 3\nf 1 3 4\n",
    "f -4 -3 -2\nf -4 -2 -1\n",
    "f 1/1 2/2 3/1\nf 1/1 3/1 4/2\n",
    "f 1//1 2//1 3//1\nf 1//1 3//1 4//1\n",
    "f 1/1/1 2/2/1 3/1/1\nf -4/-2/-1 -2/1/1 -1/2/1\n",
    "f 1/ 2/ 3/\nf 1// 3// 4//\n",
    "f 1 2 3 4\n",  // a fan
};

/// What stands between and around: blanks, comments, ends of lines, groups.
std::string habit(size_t which, const std::string& text) {
  switch (which) {
    case 0:
      return text;
    case 1:
      return replaced(text, "\n", "\r\n");
    case 2:
      return replaced(replaced(text, " ", "\t"), "\n", " \t\n");
    case 3:
      return "# Exporter v1.0 \\\n\n" + replaced(text, "\n", " # a comment\n");
    case 4:
      return "\xEF\xBB\xBFo Object.001\n" + replaced(text, "f ", "s off\nusemtl None\nf  ");
    case 5:
      return "mtllib\ng\n  " + replaced(text, "\n", "\n   ");
    case 6:
      return replaced(text.substr(0, text.size() - 1), " 0 ", " \\\n0 ");  // goes on in the next line; ends without one
    default:
      return replaced(text, "\n", "\r");  // old Macs
  }
}
constexpr size_t habits = 8;

TEST(MeshHabits, EveryObjHasTheSameTriangles) {
  size_t files = 0, first = 0;
  for (const Numbers& n : numbers)
    for (const char* face : faces)
      for (size_t h = first++ % 2; h < habits; h += 2, ++files) {  // each second one of all
        std::string text = std::string("v ") + n.half + " 0 0\nv " + n.five_quarters + " " + n.minus_half + " 0\nv 0 " + n.one + " " +
                           n.minus_quarter + "\nv 0 0 " + n.one + "\nvt " + n.half + " 0\nvt 1 " + n.half + "\nvn 0 0 " + n.one + "\n";
        expect_the_triangles("a.obj", habit(h, text + face));
        if (HasFatalFailure() || HasNonfatalFailure()) return;
      }
  EXPECT_GE(files, 200u);
}

TEST(MeshHabits, WeightsAndColoursOfObjVerticesLeaveTheirPlaces) {
  const std::string rest = "f 1 2 3\nf 1 3 4\n";
  expect_the_triangles("a.obj", "v .5 0 0 1\nv 1.25 -.5 0 1.0\nv 0 2 -.5 2\nv 0 0 1 1\n" + rest);
  expect_the_triangles("a.obj", "v .5 0 0 1 0 0\nv 1.25 -.5 0 .5 .5 .5\nv 0 1 -.25 0 0 0\nv 0 0 1 0 1 0\n" + rest);
  expect_the_triangles("a.obj", "v .5 0 0 1 .1 .2 .3\nv 1.25 -.5 0 1 1 1 1\nv 0 1 -.25 1 0 0 0\nv 0 0 1 1 0 1 0\n" + rest);
}

TEST(MeshHabits, EveryPlyAndStlHasTheSameTriangles) {
  for (const Numbers& n : numbers)
    for (size_t h = 0; h < 2; ++h) {
      const std::string a = std::string(n.half) + " 0 0", b = std::string(n.five_quarters) + " " + n.minus_half + " 0",
                        c = std::string("0 ") + n.one + " " + n.minus_quarter, d = std::string("0 0 ") + n.one;
      const std::string ply =
          "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float "
          "quality\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n";
      expect_the_triangles("a.ply", habit(h, ply + a + " 0\n" + b + " 1\n" + c + " 2\n" + d + " 3\n3 0 1 2\n3 0 2 3\n"));
      std::string stl = "solid a b\n";
      for (const auto& corners : {std::array{a, b, c}, std::array{a, c, d}}) {
        stl += "facet normal 0 0 0\nouter loop\n";
        for (const std::string& corner : corners) stl += "vertex " + corner + "\n";
        stl += "endloop\nendfacet\n";
      }
      expect_the_triangles("a.stl", habit(h, stl + "endsolid a b\n"));
    }
}

TEST(MeshHabits, WhatIsNoNumberOrCornerNamesItsLine) {
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (const auto& [text, said] : std::vector<std::pair<std::string, std::string>>{
           {corners + "v 1,5 0 0\nf 1 2 3\n", "line 4: '1,5' is no number"},
           {corners + "v 1 nan 0\nf 1 2 3\n", "line 4: nan is beyond"},
           {corners + "v 1 2\nf 1 2 3\n", "line 4: 'v' has 2 numbers"},
           {corners + "v 1e39 0 0\nf 1 2 4\n", "line 4: 1e39 is beyond"},
           {corners + "f 1 2 4\n", "line 4: a corner names vertex 4 of 3"},
           {corners + "f 0 1 2\n", "line 4: corner '0' names no vertex"},
           {corners + "f 1 2 -4\n", "line 4: corner '-4' names no vertex"},
           {corners + "f 1/x 2 3\n", "line 4: corner '1/x' names no texture"},
           {corners + "f 1 2 \\\n7777777777777777777\n", "line 4: corner '7777777777777777777'"}}) {
    const Folder folder;
    write_text(folder / "a.obj", text);
    EXPECT_ERROR(load_path(folder / "a.obj"), KS_ERROR_FILE, said);
  }
}

}  // namespace
