// SPDX-License-Identifier: Apache-2.0
// OBJ, PLY and STL in the dialects of the programs that write them, and known solids in all of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

using Files = std::vector<std::pair<std::string, std::string>>;

/// Loads the first file; the others lie beside it.
Loaded load_files(const Files& files) {
  const Folder folder;
  for (const auto& [name, text] : files) write_text(folder / name, text);
  return load_path(folder / files.front().first);
}

std::string error_of(const Files& files) {
  const Folder folder;
  for (const auto& [name, text] : files) write_text(folder / name, text);
  return try_path(folder / files.front().first).error;
}

struct Measure {
  size_t triangles = 0;
  double area_m2 = 0.0, volume_m3 = 0.0;
};

Measure measure(const Scene& scene) {
  Measure out;
  for (const auto& mesh : scene.meshes())
    for (const glm::uvec3& t : mesh->indices) {
      const glm::dvec3 a(mesh->positions[t.x]), b(mesh->positions[t.y]), c(mesh->positions[t.z]);
      ++out.triangles;
      out.area_m2 += 0.5 * glm::length(glm::cross(b - a, c - a));
      out.volume_m3 += glm::dot(a, glm::cross(b, c)) / 6.0;
    }
  return out;
}

// --- known solids in all formats ---

struct Solid {
  const char* name;
  std::vector<glm::vec3> points;
  std::vector<std::vector<uint32_t>> faces;  // counter-clockwise from outside
  size_t triangles;
  double area_m2, volume_m3;
};

/// A prism of height 1 over a polygon in x and y, counter-clockwise: its area is twice the polygon's and that of its sides.
Solid prism(const char* name, const std::vector<glm::vec2>& base, double base_area) {
  Solid out{name, {}, {{}, {}}, 0, 2.0 * base_area, base_area};
  const auto n = static_cast<uint32_t>(base.size());
  for (const glm::vec2& p : base) out.points.emplace_back(p, 0.0f);
  for (const glm::vec2& p : base) out.points.emplace_back(p, 1.0f);
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t next = (i + 1) % n;
    out.faces[0].push_back(n - 1 - i);
    out.faces[1].push_back(n + i);
    out.faces.push_back({i, next, n + next, n + i});
    out.area_m2 += glm::distance(base[i], base[next]);
  }
  out.triangles = 2 * (n - 2) + 2 * n;
  return out;
}

std::vector<Solid> solids() {
  std::vector<glm::vec2> star, comb{{8, 0}};
  for (int i = 0; i < 10; ++i) {
    const double r = i % 2 == 0 ? 2.0 : 0.5, angle = 2.0 * M_PI * i / 10;
    star.emplace_back(r * std::cos(angle), r * std::sin(angle));
  }
  for (int i = 8; i > 0; --i) comb.emplace_back(i, 3), comb.emplace_back(i - 0.5, 1), comb.emplace_back(i - 1, 1);
  comb.emplace_back(0, 0);
  double comb_area = 0.0;  // by the shoelace formula
  for (size_t i = 0; i < comb.size(); ++i) {
    const glm::vec2 a = comb[i], b = comb[(i + 1) % comb.size()];
    comb_area += 0.5 * (a.x * b.y - a.y * b.x);
  }
  Solid tetrahedron{"tetrahedron",
                    {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                    {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}},
                    4,
                    1.5 + std::sqrt(3.0) / 2.0,
                    1.0 / 6.0};
  return {tetrahedron,
          prism("cube", {{0, 0}, {1, 0}, {1, 1}, {0, 1}}, 1.0),
          prism("L", {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 3}, {0, 3}}, 4.0),
          prism("arrow", {{0, 0}, {2, -1}, {1, 0}, {2, 1}}, 1.0),                             // a concave quad
          prism("C", {{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 2}, {3, 2}, {3, 3}, {0, 3}}, 7.0),  // concave and with corners in line
          prism("frame", {{0, 0}, {3, 0}, {3, 3}, {0, 3}, {0, 0}, {1, 1}, {1, 2}, {2, 2}, {2, 1}, {1, 1}}, 8.0),  // a bridge to its hole
          prism("star", star, 5.0 * 2.0 * 0.5 * std::sin(M_PI / 5)),
          prism("comb", comb, comb_area)};
}

std::string bytes_of(float value, bool big) {
  std::string out(4, '\0');
  std::memcpy(out.data(), &value, 4);
  if (big) std::reverse(out.begin(), out.end());
  return out;
}
std::string bytes_of(uint32_t value, bool big) { return bytes_of(std::bit_cast<float>(value), big); }

std::string words_of(const glm::vec3& p) {
  std::array<char, 100> text{};
  return {text.data(), size_t(std::snprintf(text.data(), text.size(), "%.9g %.9g %.9g", p.x, p.y, p.z))};
}

std::string obj_of(const Solid& solid, bool backwards) {
  std::string out = "# by the test\no " + std::string(solid.name) + "\n";
  for (const glm::vec3& p : solid.points) out += "v " + words_of(p) + "\n";
  for (const auto& face : solid.faces) {
    out += "f";
    for (const uint32_t i : face) out += " " + std::to_string(backwards ? int(i) - int(solid.points.size()) : int(i) + 1);
    out += "\n";
  }
  return out;
}

std::string ply_header(const Solid& solid, const std::string& format) {
  return "ply\nformat " + format + " 1.0\nelement vertex " + std::to_string(solid.points.size()) +
         "\nproperty float x\nproperty float y\nproperty float z\nelement face " + std::to_string(solid.faces.size()) +
         "\nproperty list uchar int vertex_indices\nend_header\n";
}

std::string ascii_ply(const Solid& solid) {
  std::string out = ply_header(solid, "ascii");
  for (const glm::vec3& p : solid.points) out += words_of(p) + "\n";
  for (const auto& face : solid.faces) {
    out += std::to_string(face.size());
    for (const uint32_t i : face) out += " " + std::to_string(i);
    out += "\n";
  }
  return out;
}

std::string binary_ply(const Solid& solid, bool big) {
  std::string out = ply_header(solid, big ? "binary_big_endian" : "binary_little_endian");
  for (const glm::vec3& p : solid.points)
    for (int i = 0; i < 3; ++i) out += bytes_of(p[i], big);
  for (const auto& face : solid.faces) {
    out.push_back(static_cast<char>(face.size()));
    for (const uint32_t i : face) out += bytes_of(i, big);
  }
  return out;
}

/// As fans, which the area and volume of a concave polygon with signs do not mind; their areas without signs do.
std::vector<std::array<glm::vec3, 3>> fans(const Solid& solid) {
  std::vector<std::array<glm::vec3, 3>> out;
  for (const auto& face : solid.faces)
    for (size_t k = 2; k < face.size(); ++k) out.push_back({solid.points[face[0]], solid.points[face[k - 1]], solid.points[face[k]]});
  return out;
}

std::string ascii_stl(const Solid& solid) {
  std::string out = "solid " + std::string(solid.name) + "\n";
  for (const auto& t : fans(solid)) {
    out += "facet normal 0 0 0\nouter loop\n";
    for (const glm::vec3& p : t) out += "vertex " + words_of(p) + "\n";
    out += "endloop\nendfacet\n";
  }
  return out + "endsolid\n";
}

std::string binary_stl(const Solid& solid) {
  const auto triangles = fans(solid);
  std::string out = "solid " + std::string(74, ' ') + bytes_of(static_cast<uint32_t>(triangles.size()), false);
  for (const auto& t : triangles) {
    out += std::string(12, '\0');
    for (const glm::vec3& p : t)
      for (int i = 0; i < 3; ++i) out += bytes_of(p[i], false);
    out += std::string(2, '\0');
  }
  return out;
}

std::string dae_of(const Solid& solid) {
  std::string points, counts, corners;
  for (const glm::vec3& p : solid.points) points += words_of(p) + " ";
  for (const auto& face : solid.faces) {
    counts += std::to_string(face.size()) + " ";
    for (const uint32_t i : face) corners += std::to_string(i) + " ";
  }
  const size_t count = solid.points.size();
  std::string text = collada_with_material("<technique sid=\"c\"><lambert/></technique>");
  text = replaced(text, "count=\"9\">0 0 0 100 0 0 0 100 0", "count=\"" + std::to_string(3 * count) + "\">" + points);
  text = replaced(text, "count=\"3\" stride", "count=\"" + std::to_string(count) + "\" stride");
  text = replaced(text, "<triangles count=\"1\"", "<polylist count=\"" + std::to_string(solid.faces.size()) + "\"");
  text = replaced(text, "<p>0 1 2</p></triangles>", "<vcount>" + counts + "</vcount><p>" + corners + "</p></polylist>");
  text.erase(text.find("<node id=\"n\""), text.find("<node id=\"m\"") - text.find("<node id=\"n\""));  // one node shows it
  return replaced(replaced(text, "meter=\"0.01\"", "meter=\"1\""), "Z_UP", "Y_UP");
}

TEST(MeshDialects, KnownSolidsHaveTheirBoundsAreaVolumeAndTrianglesInEveryFormat) {
  for (const Solid& solid : solids()) {
    Bounds bounds;
    for (const glm::vec3& p : solid.points) bounds = {glm::min(bounds.min, glm::dvec3(p)), glm::max(bounds.max, glm::dvec3(p))};
    const Files files = {{"a.obj", obj_of(solid, false)},          {"back.obj", obj_of(solid, true)},    {"ascii.ply", ascii_ply(solid)},
                         {"little.ply", binary_ply(solid, false)}, {"big.ply", binary_ply(solid, true)}, {"a.dae", dae_of(solid)},
                         {"ascii.stl", ascii_stl(solid)},          {"binary.stl", binary_stl(solid)}};
    for (const auto& file : files) {
      SCOPED_TRACE(std::string(solid.name) + " as " + file.first);
      const Loaded loaded = load_files({file});
      const Measure found = measure(loaded.scene);
      EXPECT_EQ(found.triangles, solid.triangles);
      EXPECT_NEAR(found.volume_m3, solid.volume_m3, 1e-5 * solid.volume_m3);
      if (!file.first.ends_with(".stl")) {
        EXPECT_NEAR(found.area_m2, solid.area_m2, 1e-5 * solid.area_m2) << "triangles overlap";
      }
      EXPECT_LT(glm::distance(loaded.scene.bounds().min, bounds.min), 1e-6);
      EXPECT_LT(glm::distance(loaded.scene.bounds().max, bounds.max), 1e-6);
      EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
    }
  }
}

// --- OBJ and MTL ---

const std::string obj_triangle = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";

class MtlTextureName : public testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(MtlTextureName, IsFound) {
  const auto& [line, file] = GetParam();
  const Loaded loaded = load_files({{"a.obj", obj_triangle}, {"a.mtl", std::string(line) + "\n"}, {file, png_pixel()}});
  EXPECT_NE(loaded.material().base_color_texture, none);
  EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
}

INSTANTIATE_TEST_SUITE_P(
    Mtl, MtlTextureName,
    testing::Values(std::pair{"newmtl m\nmap_Kd\tred.png", "red.png"}, std::pair{"newmtl m\nMAP_KD red.png", "red.png"},
                    std::pair{"newmtl m\nMap_kd red.png", "red.png"}, std::pair{"newmtl m\nmap_Kd my red.png", "my red.png"},
                    std::pair{"newmtl m\nmap_Kd red#1.png", "red#1.png"}, std::pair{"newmtl m\nmap_Kd red%20x.png", "red%20x.png"},
                    std::pair{"newmtl m\nmap_Kd r\xc3\xa9"
                              "d.png",
                              "r\xc3\xa9"
                              "d.png"},
                    std::pair{"newmtl m\r\nmap_Kd red.png\r", "red.png"}, std::pair{"\xef\xbb\xbfnewmtl m\nmap_Kd red.png", "red.png"},
                    std::pair{"  newmtl m  \n  map_Kd red.png", "red.png"},
                    std::pair{"newmtl m\nmap_Kd -s 1 1 1 -o 0 0 -clamp off -blendu on -mm 0 1 red.png", "red.png"},
                    std::pair{"newmtl m\nmap_Kd -bm 0.5 -texres 512 -type sphere my red.png", "my red.png"}));

TEST(MeshDialects, LibrariesHaveBlanksInTheirNamesOrAreSeveral) {
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
  const std::string red = "newmtl m\nKd 1 0 0\n";
  for (const Files& files : {Files{{"a.obj", "mtllib my mat.mtl\n" + triangle}, {"my mat.mtl", red}},
                             Files{{"a.obj", "mtllib b.mtl c.mtl\n" + triangle}, {"b.mtl", "newmtl n\n"}, {"c.mtl", red}},
                             Files{{"a.obj", triangle + "mtllib c.mtl\n"}, {"c.mtl", red}}}) {
    const Loaded loaded = load_files(files);
    EXPECT_EQ(loaded.material().base_color, glm::vec4(1, 0, 0, 1));
    EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
  }
}

TEST(MeshDialects, AnMtlStatementThatIsNotRenderedIsSaidAndWhatIsNoNumberHasItsPlace) {
  const auto with = [](const std::string& statement) {
    return Files{{"a.obj", obj_triangle}, {"a.mtl", "newmtl m\nKd 0.5 0.25 1\n" + statement + "\n"}};
  };
  for (const char* statement : {"aniso 0", "anisor 0", "Pc 0", "sharpness 60", "map_Ka x.png", "something else"}) {
    const Loaded loaded = load_files(with(statement));
    EXPECT_EQ(loaded.material().base_color, glm::vec4(0.5f, 0.25f, 1, 1));
    EXPECT_EQ(loaded.warnings.size(), 1u) << statement;
    EXPECT_TRUE(warns(loaded, "material 'm': '")) << loaded.warnings[0];
  }
  expect_error(error_of(with("Ns 1,5")), "a.obj: 'a.mtl', line 3: '1,5' is no number");
}

TEST(MeshDialects, PartsOfOneMaterialAndNameAreOneMesh) {
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\no body\n";
  for (int i = 0; i < 50; ++i) text += std::string("usemtl ") + (i % 2 ? "a" : "b") + "\nf 1 2 3\n";
  const Loaded loaded = load_files({{"a.obj", text}});
  ASSERT_EQ(loaded.scene.instances().size(), 2u);
  EXPECT_EQ(loaded.scene.instances()[0].name, "body");
  EXPECT_TRUE(warns(loaded, "material 'a' is in no MTL file"));
}

TEST(MeshDialects, CornersMayNameNormalsWhereThereAreNone) {
  const Loaded loaded = load_files({{"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1/1 2/2/1 3/3/1\n"}});
  EXPECT_EQ(measure(loaded.scene).triangles, 1u);
  EXPECT_TRUE(warns(loaded, "its faces name a normal at each corner, but it has none"));
  EXPECT_TRUE(warns(loaded, "its faces name a texture coordinate at each corner, but it has none"));
}

// --- PLY ---

const std::string ply_vertex = "property float x\nproperty float y\nproperty float z\n";
const std::string ply_face = "element face 1\nproperty list uchar int vertex_indices\n";

TEST(MeshDialects, TheFirstByteOfABinaryPlyMayBeAnything) {
  for (int byte = 0; byte < 256; ++byte)
    for (const char* end : {"\n", "\r\n"}) {
      std::string text;
      for (const char* line : {"ply", "format binary_little_endian 1.0", "element vertex 3", "property float x", "property float y",
                               "property float z", "element face 1", "property list uchar int vertex_indices", "end_header"})
        text += std::string(line) + end;
      const float first = std::bit_cast<float>(0x3f000000u | static_cast<uint32_t>(byte));
      for (const float value : {first, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) text += bytes_of(value, false);
      text += '\3' + bytes_of(0u, false) + bytes_of(1u, false) + bytes_of(2u, false);
      const Loaded loaded = load_files({{"a.ply", text}});
      ASSERT_EQ(measure(loaded.scene).triangles, 1u) << byte;
      ASSERT_EQ(loaded.scene.meshes()[0].positions[0].x, first) << byte;
    }
}

TEST(MeshDialects, PlyElementsAndPropertiesStandInAnyOrder) {
  const std::string corners = "0 0 0\n1 0 0\n0 1 0\n";
  const Files files = {
      {"camera.ply", "ply\nformat ascii 1.0\nelement camera 1\nproperty float view_px\nproperty float view_py\nelement vertex 3\n" +
                         ply_vertex + ply_face + "end_header\n9 9\n" + corners + "3 0 1 2\n"},
      {"colours.ply", "ply\nformat ascii 1.0\nobj_info x\nelement vertex 3\n" + ply_vertex +
                          "element face 1\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty list uchar int "
                          "vertex_index\nend_header\n" +
                          corners + "255 0 0 3 0 1 2\n"},
      {"faces.ply", "ply\nformat ascii 1.0\n" + ply_face + "element vertex 3\n" + ply_vertex + "end_header\n3 0 1 2\n" + corners},
      {"more.ply",  // than the header says, as MeshLab writes colours of faces
       "ply\nformat ascii 1.0\nelement vertex 3\n" + ply_vertex + ply_face +
           "end_header\n0 0 0 7 7\n1 0 0 7 7\n0 1 0 7 7\n3 0 1 2 9 1 1 1\n"},
      {"strip.ply", "ply\nformat ascii 1.0\nelement vertex 3\n" + ply_vertex +
                        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" + corners + "4 0 1 2 -1\n"},
  };
  for (const auto& file : files) {
    SCOPED_TRACE(file.first);
    const Measure found = measure(load_files({file}).scene);
    EXPECT_EQ(found.triangles, 1u);
    EXPECT_NEAR(found.area_m2, 0.5, 1e-6);
  }
  EXPECT_EQ(load_files({files[1]}).scene.meshes()[0].colors.at(0), glm::vec4(1, 0, 0, 1));
  EXPECT_TRUE(warns(load_files({files[0]}), "element 'camera' is not read"));
}

TEST(MeshDialects, TexturesOfPlyAreThoseOfCornersOrVertices) {
  const std::string begin = "ply\nformat ascii 1.0\ncomment TextureFile red.png\nelement vertex 3\n" + ply_vertex;
  Files files = {{"corners.ply",
                  begin + ply_face + "property list uchar float texcoord\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 0.5 0 0 0.25\n"}};
  for (const auto& [u, v] : {std::pair{"s", "t"}, std::pair{"u", "v"}, std::pair{"texture_u", "texture_v"}})
    files.emplace_back(std::string(u) + ".ply", begin + "property float " + u + "\nproperty float " + v +
                                                    "\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n" + ply_face +
                                                    "end_header\n0 0 0 0 0 9 9 9\n1 0 0 0.5 0 9 9 9\n0 1 0 0 0.25 9 9 9\n3 0 1 2\n");
  for (const auto& file : files) {
    SCOPED_TRACE(file.first);
    const Loaded loaded = load_files({file, {"red.png", png_pixel()}});
    const Material& material = loaded.material();
    ASSERT_NE(material.base_color_texture, none);
    EXPECT_EQ(material.base_color, glm::vec4(1));
    EXPECT_EQ(material.specular, 0.0f);
    const Mesh& mesh = loaded.scene.meshes()[0];
    EXPECT_TRUE(mesh.colors.empty()) << "they say what the image says";
    ASSERT_EQ(mesh.uvs.size(), 3u);
    for (size_t i = 0; i < 3; ++i)
      EXPECT_EQ(mesh.uvs[i], glm::vec2(0.5f * mesh.positions[i].x, 1.0f - 0.25f * mesh.positions[i].y)) << "v points down";
    const Loaded without = load_files({file});
    EXPECT_TRUE(warns(without, "'red.png'")) << "a missing image is said";
    EXPECT_EQ(measure(without.scene).triangles, 1u);
  }
}

TEST(MeshDialects, FacesOfPlyChooseAmongItsImages) {
  const Loaded loaded =
      load_files({{"a.ply", "ply\nformat ascii 1.0\ncomment TextureFile 0.png\ncomment TextureFile 1.png\nelement vertex 3\n" + ply_vertex +
                                "element face 3\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
                                "property int texnumber\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1 1\n"
                                "3 0 1 2 6 0 0 1 0 0 1 0\n3 0 1 2 0 -1\n"},
                  {"0.png", png_pixel()},
                  {"1.png", png_pixel()}});
  ASSERT_EQ(loaded.scene.instances().size(), 3u);
  EXPECT_EQ(loaded.scene.textures()[loaded.material(0).base_color_texture].name, "0.png");
  EXPECT_EQ(loaded.scene.textures()[loaded.material(1).base_color_texture].name, "1.png");
  EXPECT_EQ(loaded.scene.instances()[2].materials.at(0), none);
}

// --- STL ---

TEST(MeshDialects, StlIsReadInCapitalsWithCommasInSeveralSolidsAndWithBytesBehindIt) {
  const std::string facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0.5 0 0\nvertex 0 0.5 0\nendloop\nendfacet\n";
  std::string capitals = "solid x\n" + facet + "endsolid x\n", commas = capitals, pairs = capitals;
  std::ranges::transform(capitals, capitals.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  std::ranges::replace(commas, '.', ',');
  for (size_t at = pairs.find("0 0\n"); at != std::string::npos; at = pairs.find("0 0\n")) pairs.replace(at, 3, "0.0, 0");
  const std::string binary = binary_stl({"", {{0, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0}}, {{0, 1, 2}}, 1, 0, 0});
  for (const auto& [text, triangles] :
       {std::pair{capitals, 1u}, std::pair{commas, 1u}, std::pair{pairs, 1u},
        std::pair{"solid a\n" + facet + "endsolid a\nsolid b\n" + facet + facet + "endsolid b\n", 3u},
        std::pair{"solid empty\nendsolid empty\nsolid b\n" + facet + "endsolid b\n", 1u},
        std::pair{"\n\r\n  solid x\n" + facet + "endsolid x\n", 1u}, std::pair{"\xef\xbb\xbfsolid x\n" + facet + "endsolid x\n", 1u},
        std::pair{binary, 1u}, std::pair{binary + "left behind", 1u}}) {
    SCOPED_TRACE(text);
    const Measure found = measure(load_files({{"a.stl", text}}).scene);
    EXPECT_EQ(found.triangles, triangles);
    EXPECT_NEAR(found.area_m2, 0.125 * triangles, 1e-6);
  }
  EXPECT_TRUE(warns(load_files({{"a.stl", binary + "left behind"}}), "11 bytes after the last of its 1 facets"));
}

// --- what is wrong ---

TEST(MeshDialects, WhatIsWrongIsSaidInOneLine) {
  const std::string vertices = "ply\nformat ascii 1.0\nelement vertex 2\n" + ply_vertex;
  for (const auto& [name, text, said] : std::vector<std::array<std::string, 3>>{
           {"a.obj", "v 0 0 0\nv 1 0 0\n", "this is a point cloud: it has 2 points and no faces"},
           {"a.ply", vertices + "end_header\n0 0 0\n1 0 0\n", "this is a point cloud: it has 2 points and no faces"},
           {"a.ply", vertices + "element face 0\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n", "point cloud"},
           {"a.ply", vertices + ply_face + "end_header\n0 0 0\n1 0 0\n3 0 1 2\n", "a face names vertex 2 of 2"},
           {"a.ply", vertices + ply_face + "end_header\n0 0 0\n1 x 0\n3 0 1 1\n", "line 11: 'x' is no number"},
           {"a.ply", vertices + ply_face + "end_header\n0 0 0\n", "the file ends before the elements that its header announces"},
           {"a.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty real x\nend_header\n",
            "the PLY header has the line 'property real x'"},
           {"a.stl", std::string(80, '\0'), "the file is cut off: it has 80 bytes"},
           {"a.stl", std::string(80, '\0') + std::string("\5\0\0\0", 4) + std::string(60, '\0'),
            "its 5 facets take 334 bytes, and it has 144"},
           {"a.stl", "solid x\nfacet\nvertex 0 0 0\nvertex 1 0 0\nendfacet\nendsolid\n", "line 5: a facet ends after 2 corners"},
           {"a.stl", "solid x\nfacet\nvertex 0 0 y\n", "line 3: 'y' is no number"},
           {"a.obj", "\xff\xfev\0 \0", "UTF-16"}}) {
    expect_error(error_of({{name, text}}), said);
  }
}

}  // namespace
