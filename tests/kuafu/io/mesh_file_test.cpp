// SPDX-License-Identifier: Apache-2.0
// OBJ, PLY, STL and Collada files: what is in them arrives, whatever their habits.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "capi/device/expect_error.h"
#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;
using Corner = std::array<float, 3>;
using Triangle = std::array<Corner, 3>;

TEST(ObjFile, QuadsNormalsUvsAndMaterialsArrive) {
  const Folder folder;
  write_text(folder / "wood.png", png_pixel());
  write_text(folder / "box.mtl",
             "newmtl dull\nKd 0.2 0.4 0.6\nKs 0 0 0\nillum 1\nnewmtl shiny\nKd 0.5 0.5 0.5\nKs 0.3 0.3 0.3\nNs 198\nNi 1.33\nKe 1 2 "
             "3\nillum 2\nmap_Kd "
             "wood.png\nnewmtl glass\nKd 1 1 1\nd 0.25\nNi 1.45\nillum 7\n");
  write_text(folder / "box.obj",
             "mtllib box.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0.25\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\no a\nusemtl dull\nf 1/1/1 "
             "2/2/1 3/3/1 4/4/1\n"
             "o b\nusemtl shiny\nf 1/1/1 2/2/1 3/3/1\no c\nusemtl glass\nf 1/1/1 2/2/1 3/3/1\n");
  glm::dmat4 root(1.0);
  root[3] = {0, 0, 2, 1};
  const Loaded loaded = load_path(folder / "box.obj", root);
  const Scene& scene = loaded.scene;
  ASSERT_EQ(scene.instances().size(), 3u);
  EXPECT_EQ(scene.meshes()[0].indices.size(), 2u) << "a quad is two triangles";
  ASSERT_EQ(scene.meshes()[0].normals.size(), scene.meshes()[0].positions.size());
  EXPECT_EQ(scene.meshes()[0].normals[0], glm::vec3(0, 0, 1));
  for (size_t i = 0; i < scene.meshes()[0].positions.size(); ++i) {
    if (scene.meshes()[0].positions[i] == glm::vec3(0)) {
      EXPECT_NEAR(scene.meshes()[0].uvs[i].y, 0.75f, 1e-6f) << "v points down";
    }
  }
  EXPECT_EQ(scene.bounds().min, glm::dvec3(0, 0, 2));
  EXPECT_EQ(loaded.material(0).name, "dull");
  EXPECT_EQ(loaded.material(0).base_color, glm::vec4(0.2f, 0.4f, 0.6f, 1));
  EXPECT_EQ(loaded.material(0).specular, 0.0f) << "no highlight is exactly Lambertian";
  EXPECT_EQ(loaded.material(0).metallic, 0.0f);
  EXPECT_NEAR(loaded.material(1).specular, 0.3f, 1e-6f);
  EXPECT_NEAR(loaded.material(1).roughness, std::pow(2.0 / 200.0, 0.25), 1e-5);
  EXPECT_NEAR(loaded.material(1).ior, 1.33f, 1e-6f);
  EXPECT_EQ(loaded.material(1).emission, glm::vec3(1, 2, 3));
  ASSERT_NE(loaded.material(1).base_color_texture, none);
  EXPECT_TRUE(scene.textures()[loaded.material(1).base_color_texture].srgb);
  EXPECT_NEAR(loaded.material(2).transmission, 0.75f, 1e-6f);
  EXPECT_EQ(loaded.material(2).roughness, 0.0f);
  EXPECT_NEAR(loaded.material(2).ior, 1.45f, 1e-6f);
}

TEST(ObjFile, OnlyBlackWithTracedReflectionsIsAMirror) {
  const std::string looks = "Kd 0 0 0\nKs 0.9 0.8 0.7\nNs 100000\n";
  for (const auto& [illum, metallic] : {std::pair{"illum 2\n", 0.0f}, {"illum 3\n", 1.0f}, {"illum 3\nPm 0\n", 0.0f}}) {
    const Folder folder;
    write_text(folder / "a.mtl", "newmtl m\n" + looks + illum);
    write_text(folder / "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl m\nf 1 2 3\n");
    const Material m = load_path(folder / "a.obj").scene.materials()[0];
    EXPECT_EQ(m.metallic, metallic) << illum;
    EXPECT_EQ(m.base_color[0], metallic == 1.0f ? 0.9f : 0.0f) << illum;
    EXPECT_LT(m.roughness, 0.1f);
  }
}

/// An uncompressed grey TGA of one row.
std::string grey_row(const std::vector<unsigned char>& values) {
  std::string out(18, '\0');
  out[2] = 3;
  out[12] = static_cast<char>(values.size());
  out[14] = 1;
  out[16] = 8;
  return out + std::string(values.begin(), values.end());
}

std::vector<uint8_t> texel(const Scene& scene, uint32_t id, uint32_t x = 0) {
  const Texture& t = scene.textures()[id];
  return {t.texels.begin() + x * t.channels, t.texels.begin() + (x + 1) * t.channels};
}

TEST(ObjFile, EveryMapOfAMaterialArrives) {
  const Folder folder;
  write_text(folder / "d.tga", grey_row({40, 255, 100, 100}));
  write_text(folder / "r.tga", grey_row({50}));
  write_text(folder / "m.tga", grey_row({200}));
  write_text(folder / "pixel.png", png_pixel());
  write_text(folder / "a.mtl",
             "newmtl all\nKd 1 1 1\nKs 1 1 1\nillum 2\nmap_Kd pixel.png\nmap_d d.tga\nmap_Ks pixel.png\nmap_Pr r.tga\nmap_Pm m.tga\n"
             "map_bump -bm 2 d.tga\n"
             "newmtl cut\nKd 1 1 1\nillum 2\nd 0.25\n"
             "newmtl mask\nKd 1 1 1\nillum 2\nmap_d d.tga\n"
             "newmtl directed\nKd 1 1 1\nillum 2\nnorm pixel.png\n");
  std::string obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (const char* name : {"all", "cut", "mask", "directed"}) obj += std::string("o ") + name + "\nusemtl " + name + "\nf 1 2 3\n";
  write_text(folder / "a.obj", obj);
  const Loaded loaded = load_path(folder / "a.obj");
  EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings[0];
  const Scene& scene = loaded.scene;
  const Material& all = loaded.material(0);
  EXPECT_EQ(all.alpha_mode, Material::AlphaMode::blend);
  EXPECT_EQ(texel(scene, all.base_color_texture), (std::vector<uint8_t>{10, 20, 30, 40})) << "map_d is map_Kd's alpha";
  EXPECT_TRUE(scene.textures()[all.base_color_texture].srgb);
  EXPECT_EQ(texel(scene, all.specular_texture)[3], 20) << "the mean of 10, 20 and 30";
  EXPECT_EQ(texel(scene, all.metallic_roughness_texture)[1], 50);
  EXPECT_EQ(texel(scene, all.metallic_roughness_texture)[2], 200);
  EXPECT_EQ(all.roughness, 1.0f);
  EXPECT_EQ(all.metallic, 1.0f);
  // Heights 0.157, 1, 0.392, 0.392: at the first texel the slope is (1 - 0.392) / 2 per texel, twice as steep by -bm 2.
  const double slope = 155 / 255.0, length = std::hypot(slope, 1.0);
  const std::vector<uint8_t> normal = texel(scene, all.normal_texture);
  EXPECT_NEAR(normal[0], 255 * (0.5 - 0.5 * slope / length), 1);
  EXPECT_NEAR(normal[1], 127.5, 1);
  EXPECT_NEAR(normal[2], 255 * (0.5 + 0.5 / length), 1);
  EXPECT_EQ(loaded.material(1).alpha_mode, Material::AlphaMode::blend);
  EXPECT_EQ(loaded.material(1).base_color.a, 0.25f);
  EXPECT_EQ(texel(scene, loaded.material(2).base_color_texture, 2), (std::vector<uint8_t>{255, 255, 255, 100}));
  EXPECT_EQ(texel(scene, loaded.material(3).normal_texture), (std::vector<uint8_t>{10, 20, 30, 255}));
}

TEST(PlyFile, ColoursOfVerticesAreLinearAndShown) {
  const Folder folder;
  write_text(folder / "a.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
             "property uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
             "0 0 0 255 0 0\n1 0 0 0 128 0\n0 1 0 0 0 0\n3 0 1 2\n");
  const Loaded loaded = load_path(folder / "a.ply");
  const Mesh& mesh = loaded.scene.meshes()[0];
  ASSERT_EQ(mesh.colors.size(), mesh.positions.size());
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    EXPECT_NEAR(mesh.colors[i].r, mesh.positions[i] == glm::vec3(0) ? 1.0 : 0.0, 1e-6);
    EXPECT_NEAR(mesh.colors[i].g, mesh.positions[i].x == 1.0f ? 0.21586 : 0.0, 1e-4);
  }
  ASSERT_NE(loaded.scene.instances()[0].materials.at(0), none);
  EXPECT_EQ(loaded.material().base_color, glm::vec4(1)) << "the grey of surfaces without a material would dim them";
}

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
  const Loaded loaded = load_path(folder / name);
  const std::vector<Triangle> found = triangles_of(loaded.scene);
  const uint32_t material = loaded.scene.meshes()[0].colors.empty() ? none : 0;
  EXPECT_EQ(loaded.scene.instances()[0].materials, std::vector<uint32_t>{material}) << "without colours, the default one";
  ASSERT_EQ(found.size(), expected.size());
  for (size_t t = 0; t < found.size(); ++t)
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(found[t][k][i], expected[t][k][i], 1e-6f) << "triangle " << t;
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
constexpr std::string (*habits[])(const std::string& text) = {
    [](const std::string& text) { return text; },  // as it is
    [](const std::string& text) { return replaced(text, "\n", "\r\n"); },
    [](const std::string& text) { return replaced(replaced(text, " ", "\t"), "\n", " \t\n"); },
    [](const std::string& text) { return "# Exporter v1.0 \\\n\n" + replaced(text, "\n", " # a comment\n"); },
    [](const std::string& text) { return "\xEF\xBB\xBFo Object.001\n" + replaced(text, "f ", "s off\nusemtl None\nf  "); },
    [](const std::string& text) { return "mtllib\ng\n  " + replaced(text, "\n", "\n   "); },
    // goes on in the next line; ends without one
    [](const std::string& text) { return replaced(text.substr(0, text.size() - 1), " 0 ", " \\\n0 "); },
    [](const std::string& text) { return replaced(text, "\n", "\r"); },  // old Macs
};

TEST(MeshHabits, EveryObjHasTheSameTriangles) {
  size_t files = 0, first = 0;
  for (const Numbers& n : numbers)
    for (const char* face : faces)
      for (size_t h = first++ % 2; h < std::size(habits); h += 2, ++files) {  // each second one of all
        std::string text = std::string("v ") + n.half + " 0 0\nv " + n.five_quarters + " " + n.minus_half + " 0\nv 0 " + n.one + " " +
                           n.minus_quarter + "\nv 0 0 " + n.one + "\nvt " + n.half + " 0\nvt 1 " + n.half + "\nvn 0 0 " + n.one + "\n";
        expect_the_triangles("a.obj", habits[h](text + face));
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
      expect_the_triangles("a.ply", habits[h](ply + a + " 0\n" + b + " 1\n" + c + " 2\n" + d + " 3\n3 0 1 2\n3 0 2 3\n"));
      std::string stl = "solid a b\n";
      for (const auto& corners : {std::array{a, b, c}, std::array{a, c, d}}) {
        stl += "facet normal 0 0 0\nouter loop\n";
        for (const std::string& corner : corners) stl += "vertex " + corner + "\n";
        stl += "endloop\nendfacet\n";
      }
      expect_the_triangles("a.stl", habits[h](stl + "endsolid a b\n"));
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
  EXPECT_EQ(loaded.scene.meshes().size(), 1u) << "two nodes share one geometry";
  EXPECT_NEAR(loaded.scene.bounds().max.x, GetParam().width_m, 1e-6);
  EXPECT_NEAR(loaded.scene.bounds().max.y, GetParam().height_m, 1e-6) << "z points up in the file";
}

const std::string unit = "<unit name=\"centimeter\" meter=\"0.01\"/>";
INSTANTIATE_TEST_SUITE_P(
    Dialects, Collada,
    testing::Values(
        Dialect{"centimetres", collada_triangle(), 1.0, 2.0},
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
  expect_warning(loaded, "its cameras are left out");
}

TEST(ColladaFile, AFileThatIsNoXmlNamesThePlace) {
  const Folder folder;
  write_text(folder / "a.dae", replaced(collada_triangle(), "</library_geometries>", ""));
  EXPECT_ERROR(load_path(folder / "a.dae"), KS_ERROR_FILE, "a.dae: this is no XML: at byte ");
}

}  // namespace
