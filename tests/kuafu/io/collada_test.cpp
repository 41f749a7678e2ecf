// SPDX-License-Identifier: Apache-2.0
// Collada as exporters write it: cameras, blanks, encodings, units, and polygons of any shape.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "capi/device/expect_error.h"
#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

std::string with_cameras(const char* first, const char* second) {
  const auto camera = [](const std::string& id, const std::string& name) {
    return "<camera id=\"" + id + "\" name=\"" + name +
           "\"><optics><technique_common><perspective><xfov>40</xfov><znear>1</znear><zfar>9</zfar></perspective></technique_common></"
           "optics>"
           "</camera>";
  };
  const std::string text =
      replaced(collada_triangle(), "<library_geometries>",
               "<library_cameras>" + camera("c", first) + camera("d", second) + "</library_cameras><library_geometries>");
  return replaced(text, "<node id=\"m\"",
                  "<node id=\"x\"><instance_camera url=\"#c\"/></node><node id=\"y\"><instance_camera url=\"#d\"/></node><node id=\"m\"");
}

std::string utf16(const std::string& text) {
  std::string out = "\xff\xfe";
  for (const char c : text) out += {c, '\0'};
  return out;
}

struct Dialect {
  const char* name;
  std::string text;
  double width_m, height_m;
};

class Collada : public testing::TestWithParam<Dialect> {};

TEST_P(Collada, IsRead) {
  const Folder folder;
  write_text(folder / "a.dae", GetParam().text);
  const Loaded loaded = load_path(folder / "a.dae");
  EXPECT_EQ(loaded.scene.instances().size(), 2u);
  EXPECT_NEAR(loaded.scene.bounds().max.x, GetParam().width_m, 1e-6);
  EXPECT_NEAR(loaded.scene.bounds().max.y, GetParam().height_m, 1e-6) << "z points up in the file";
}

const std::string unit = "<unit name=\"centimeter\" meter=\"0.01\"/>";
INSTANTIATE_TEST_SUITE_P(
    Dialects, Collada,
    testing::Values(
        Dialect{"two cameras of one name", with_cameras("Camera", "Camera"), 1.0, 2.0},
        Dialect{"cameras without names", with_cameras("", ""), 1.0, 2.0},
        Dialect{"UTF-16", utf16(replaced(collada_triangle(), "?>", " encoding=\"utf-16\"?>")), 1.0, 2.0},
        Dialect{"blanks around numbers", replaced(collada_triangle(), "0 0 200</translate>", "\n  0.0 0.0 200.0  \n</translate>"), 1.0,
                2.0},
        Dialect{"blanks in a matrix",
                replaced(collada_triangle(), "<translate>0 0 200</translate>", "<matrix>  1 0 0 0 0 1 0 0 0 0 1 200 0 0 0 1  </matrix>"),
                1.0, 2.0},
        Dialect{
            "blanks in a colour",
            replaced(collada_triangle(), "<library_geometries>",
                     "<library_effects><effect id=\"e\"><profile_COMMON><technique sid=\"c\"><lambert><diffuse><color>  0.5 0.5 0.5 1.0  "
                     "</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects><library_geometries>"),
            1.0, 2.0},
        Dialect{"inches", replaced(collada_triangle(), unit, "<unit name=\"inch\" meter=\"0.0254\"/>"), 2.54, 5.08},
        Dialect{"a unit without a name", replaced(collada_triangle(), unit, "<unit meter=\" 0.001 \"/>"), 0.1, 0.2},
        Dialect{"no unit", replaced(collada_triangle(), unit, ""), 100.0, 200.0}),
    [](const auto& info) {
      std::string name = info.param.name;
      std::replace_if(
          name.begin(), name.end(), [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
      return name;
    });

TEST(ColladaFile, CamerasThatAreNotShownAreSaid) {
  const Folder folder;
  write_text(folder / "a.dae", with_cameras("a", "b"));
  const Loaded loaded = load_path(folder / "a.dae");
  ASSERT_FALSE(loaded.warnings.empty());
  EXPECT_NE(loaded.warnings[0].find("its cameras are left out"), std::string::npos);
}

TEST(ColladaFile, AFileThatIsNoXmlNamesThePlace) {
  const Folder folder;
  write_text(folder / "a.dae", replaced(collada_triangle(), "</library_geometries>", ""));
  EXPECT_ERROR(load_path(folder / "a.dae"), KS_ERROR_FILE, "a.dae: this is no XML: at byte ");
}

struct Outline {
  const char* name;
  std::vector<glm::dvec2> corners;
};

class Polygon : public testing::TestWithParam<Outline> {};

/// The triangles of a polygon are inside of it, once: each counter-clockwise, and their areas sum up to its own (the shoelace formula).
TEST_P(Polygon, IsCoveredOnce) {
  const std::vector<glm::dvec2>& corners = GetParam().corners;
  std::string points, order;
  double area = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const glm::dvec2 a = corners[i], b = corners[(i + 1) % corners.size()];
    area += (a.x * b.y - b.x * a.y) / 2;
    points += std::to_string(a.x) + " " + std::to_string(a.y) + " 0 ";
    order += std::to_string(i) + " ";
  }
  const std::string n = std::to_string(corners.size());
  std::string text = replaced(
      replaced(collada_triangle(), "count=\"9\">0 0 0 100 0 0 0 100 0", "count=\"" + std::to_string(3 * corners.size()) + "\">" + points),
      "count=\"3\" stride", "count=\"" + n + "\" stride");
  text = replaced(replaced(text, "<triangles count=\"1\">", "<polylist count=\"1\">"), "<p>0 1 2</p></triangles>",
                  "<vcount>" + n + "</vcount><p>" + order + "</p></polylist>");
  const Folder folder;
  write_text(folder / "a.dae", text);
  const Loaded loaded = load_path(folder / "a.dae");
  const Mesh& mesh = loaded.scene.meshes()[0];
  EXPECT_EQ(mesh.indices.size(), corners.size() - 2);
  double sum = 0;
  for (const glm::uvec3& t : mesh.indices) {
    const glm::dvec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
    const double twice = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    EXPECT_GE(twice, 0.0) << "it lies outside";
    sum += twice / 2;
  }
  EXPECT_NEAR(sum, area, 1e-5 * area);
}

INSTANTIATE_TEST_SUITE_P(
    Outlines, Polygon,
    testing::Values(
        Outline{"arrow", {{0, 0}, {4, 1}, {0, 2}, {1, 1}}}, Outline{"turned_arrow", {{1, 1}, {0, 0}, {4, 1}, {0, 2}}},
        Outline{"l", {{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 3}, {0, 3}}},
        Outline{"turned_l", {{1, 1}, {1, 3}, {0, 3}, {0, 0}, {3, 0}, {3, 1}}},
        Outline{"u", {{0, 0}, {5, 0}, {5, 5}, {4, 5}, {4, 1}, {1, 1}, {1, 5}, {0, 5}}},
        Outline{"comb", {{0, 0}, {7, 0}, {7, 3}, {6, 3}, {6, 1}, {4, 1}, {4, 3}, {3, 3}, {3, 1}, {1, 1}, {1, 3}, {0, 3}}},
        Outline{"star",
                {{0, 3}, {-0.7, 1}, {-2.9, 0.9}, {-1.1, -0.4}, {-1.8, -2.4}, {0, -1.2}, {1.8, -2.4}, {1.1, -0.4}, {2.9, 0.9}, {0.7, 1}}}),
    [](const auto& info) { return info.param.name; });

}  // namespace
