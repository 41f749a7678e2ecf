// SPDX-License-Identifier: Apache-2.0
// glTF files: geometry, node tree, materials, lights, cameras, textures.
#include <gtest/gtest.h>

#include <cmath>

#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

Loaded load(GltfWriter& writer, const glm::dmat4& root = glm::dmat4(1.0)) {
  const Folder folder;
  writer.write_gltf(folder / "scene.gltf");
  Loaded out = load_path(folder / "scene.gltf", root);
  Scene binary;
  writer.write_glb(folder / "scene.glb");
  load_file(binary, folder / "scene.glb", root);
  EXPECT_EQ(binary.instances().size(), out.scene.instances().size()) << "glb and gltf differ";
  return out;
}

glm::dvec3 apply(const glm::dmat4& m, const glm::dvec3& p) { return glm::dvec3(m * glm::dvec4(p, 1.0)); }

void expect_near(const glm::dvec3& a, const glm::dvec3& b, double tolerance = 1e-12) {
  EXPECT_LT(glm::length(a - b), tolerance) << a.x << " " << a.y << " " << a.z;
}

TEST(GltfNodes, NestedTransformsComposeParentFirst) {
  GltfWriter w;
  const double h = std::sqrt(0.5);
  w.triangle();
  w.node({{"translation", {1, 2, 3}}, {"rotation", {0, 0, h, h}}, {"scale", {2, 2, 2}}, {"children", {1}}});  // quarter turn about z
  w.root["nodes"].push_back({{"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1}}, {"mesh", 0}, {"name", "leaf"}});
  glm::dmat4 root(1.0);
  root[3] = {0, 0, 100, 1};
  const Loaded loaded = load(w, root);
  ASSERT_EQ(loaded.scene.instances().size(), 1u);
  // (1,0,0) -> leaf (11,0,0) -> scale (22,0,0) -> turn (0,22,0) -> move (1,24,3) -> root (1,24,103)
  expect_near(apply(loaded.scene.instances()[0].local_to_world, {1, 0, 0}), {1, 24, 103});
  EXPECT_EQ(loaded.scene.instances()[0].name, "leaf");
}

TEST(GltfNodes, OneMeshShownByTwoNodesIsOneMeshAndTwoInstances) {
  GltfWriter w;
  w.thing();
  w.node({{"mesh", 0}, {"translation", {0, 0, 1}}});
  const Loaded loaded = load(w);
  EXPECT_EQ(loaded.scene.meshes().size(), 1u);
  ASSERT_EQ(loaded.scene.instances().size(), 2u);
  EXPECT_EQ(loaded.scene.instances()[0].mesh, loaded.scene.instances()[1].mesh);
}

TEST(GltfNodes, OnlyTheDefaultSceneIsShown) {
  GltfWriter w;
  w.triangle();
  w.node({{"mesh", 0}, {"name", "a"}});
  w.root["nodes"].push_back({{"mesh", 0}, {"name", "b"}});
  w.root["scenes"].push_back({{"nodes", {1}}});
  w.root["scene"] = 1;
  const Loaded loaded = load(w);
  ASSERT_EQ(loaded.scene.instances().size(), 1u);
  EXPECT_EQ(loaded.scene.instances()[0].name, "b");
}

TEST(GltfNodes, CyclesAndWrongIndicesAreErrors) {
  GltfWriter w;
  w.triangle();
  w.node({{"mesh", 0}, {"children", {0}}});
  expect_error(w, "nodes[0] '' has two parents or is its own ancestor");
  w.root["nodes"][0]["children"] = {5};
  expect_error(w, "node 5 of 1");
  w.root["nodes"][0] = {{"mesh", 3}};
  expect_error(w, "nodes[0] ''.mesh is 3 of 1");
}

TEST(GltfMesh, EveryIndexTypeGivesTheSameTriangles) {
  GltfWriter w;
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, type_float, "VEC3", 3);
  const auto primitive = [&](int indices) { return json{{"attributes", {{"POSITION", positions}}}, {"indices", indices}}; };
  w.mesh({primitive(w.accessor<uint8_t>({0, 1, 2, 2, 1, 3}, type_u8, "SCALAR", 1)),
          primitive(w.accessor<uint16_t>({0, 1, 2, 2, 1, 3}, type_u16, "SCALAR", 1)),
          primitive(w.accessor<uint32_t>({0, 1, 2, 2, 1, 3}, type_u32, "SCALAR", 1))});
  w.node({{"mesh", 0}});
  const Loaded loaded = load(w);
  const Mesh& mesh = loaded.scene.meshes()[0];
  ASSERT_EQ(mesh.indices.size(), 6u);
  for (uint32_t part = 0; part < 3; ++part) {
    EXPECT_EQ(mesh.indices[2 * part], glm::uvec3(0, 1, 2) + 4u * part);
    EXPECT_EQ(mesh.indices[2 * part + 1], glm::uvec3(2, 1, 3) + 4u * part);
  }
  EXPECT_EQ(mesh.slots, (std::vector<uint32_t>{0, 0, 1, 1, 2, 2}));
}

TEST(GltfMesh, StripsAndFansKeepTheirWinding) {
  GltfWriter w;
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, type_float, "VEC3", 3);
  const int fan = w.accessor<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, type_float, "VEC3", 3);
  w.mesh({{{"attributes", {{"POSITION", positions}}}, {"mode", 5}}, {{"attributes", {{"POSITION", fan}}}, {"mode", 6}}});
  w.node({{"mesh", 0}});
  const Loaded loaded = load(w);
  const Mesh& mesh = loaded.scene.meshes()[0];
  ASSERT_EQ(mesh.indices.size(), 4u);
  for (const glm::uvec3& t : mesh.indices)  // all of these turn counter-clockwise seen from +z
    EXPECT_GT(glm::cross(mesh.positions[t[1]] - mesh.positions[t[0]], mesh.positions[t[2]] - mesh.positions[t[0]]).z, 0.0f);
}

TEST(GltfMesh, InterleavedAndQuantisedAttributesAreReadByStride) {
  GltfWriter w;
  // Per vertex: 3 float position, 3 int8 normal (normalized) and a pad byte, 2 uint16 uv (normalized) = 20 bytes.
  std::string data;
  const auto put = [&](auto value) { data.append(reinterpret_cast<const char*>(&value), sizeof value); };
  for (int i = 0; i < 3; ++i) {
    put(float(i == 1)), put(float(i == 2)), put(0.5f);
    put(int8_t(0)), put(int8_t(0)), put(int8_t(-127)), put(int8_t(0));
    put(uint16_t(65535)), put(uint16_t(0));
  }
  const int view = w.view(data.data(), data.size());
  w.root["bufferViews"][view]["byteStride"] = 20;
  const auto attribute = [&](int offset, int type, const char* shape, bool normalized) {
    const int a = w.accessor(view, 3, type, shape);
    w.root["accessors"][a]["byteOffset"] = offset;
    w.root["accessors"][a]["normalized"] = normalized;
    return a;
  };
  const int p = attribute(0, type_float, "VEC3", false), n = attribute(12, type_byte, "VEC3", true),
            t = attribute(16, type_u16, "VEC2", true);
  w.mesh({{{"attributes", {{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", t}}}}});
  w.node({{"mesh", 0}});
  w.root["extensionsRequired"] = {"KHR_mesh_quantization"};
  const Loaded loaded = load(w);
  const Mesh& mesh = loaded.scene.meshes()[0];
  EXPECT_EQ(mesh.positions[1], glm::vec3(1, 0, 0.5f));
  EXPECT_EQ(mesh.normals[2], glm::vec3(0, 0, -1));
  EXPECT_EQ(mesh.uvs[2], glm::vec2(1, 0));
}

TEST(GltfMesh, SparseAccessorsReplaceTheListedElements) {
  GltfWriter w;
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, type_float, "VEC3", 3);
  const std::vector<uint16_t> which = {2};
  const std::vector<float> what = {0, 5, 7};
  const int indices = w.view(which.data(), 2), values = w.view(what.data(), 12);
  w.root["accessors"][positions]["sparse"] = {
      {"count", 1}, {"indices", {{"bufferView", indices}, {"componentType", type_u16}}}, {"values", {{"bufferView", values}}}};
  w.mesh({{{"attributes", {{"POSITION", positions}}}}});
  w.node({{"mesh", 0}});
  EXPECT_EQ(load(w).scene.meshes()[0].positions[2], glm::vec3(0, 5, 7));
  w.root["accessors"][positions]["sparse"]["count"] = 4;
  expect_error(w, "sparse.indices: 4 elements");
}

TEST(GltfMesh, APrimitiveWithoutNormalsBesideOneWithThemIsFlat) {
  GltfWriter w;
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, type_float, "VEC3", 3);
  const int normals = w.accessor<float>({0, 0, -3, 0, 0, -3, 0, 0, -3}, type_float, "VEC3", 3);
  w.mesh({{{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}}}, {{"attributes", {{"POSITION", positions}}}}});
  w.node({{"mesh", 0}});
  const Loaded loaded = load(w);
  const Mesh& mesh = loaded.scene.meshes()[0];
  EXPECT_EQ(mesh.normals[0], glm::vec3(0, 0, -1)) << "normals are made unit";
  EXPECT_EQ(mesh.normals[5], glm::vec3(0, 0, 1)) << "the triangle's own normal";
}

TEST(GltfMesh, WrongGeometryNamesTheField) {
  GltfWriter w;
  const float inf = std::numeric_limits<float>::quiet_NaN();
  const int good = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, type_float, "VEC3", 3);
  const int bad = w.accessor<float>({0, 0, 0, 1, inf, 0, 0, 1, 0}, type_float, "VEC3", 3);
  const int indices = w.accessor<uint16_t>({0, 1, 9}, type_u16, "SCALAR", 1), two = w.accessor<uint16_t>({0, 1}, type_u16, "SCALAR", 1);
  w.mesh({{{"attributes", {{"POSITION", bad}}}}});
  w.node({{"mesh", 0}});
  const auto primitive = [&]() -> json& { return w.root["meshes"][0]["primitives"][0]; };
  expect_error(w, "position 1 is not finite");
  primitive() = {{"attributes", {{"POSITION", good}}}, {"indices", indices}};
  expect_error(w, "triangle 0 uses vertex 9, but POSITION has 3");
  primitive()["indices"] = two;
  expect_error(w, "2 vertex indices");
  primitive() = {{"attributes", {{"NORMAL", good}}}};
  expect_error(w, "POSITION is missing");
  primitive() = {{"attributes", {{"POSITION", indices}}}};
  expect_error(w, "has 1 components per element, must be 3");
  primitive() = {{"attributes", {{"POSITION", 99}}}};
  expect_error(w, "accessor 99");
  primitive() = {{"attributes", {{"POSITION", good}}}};
  w.root["accessors"][good]["count"] = 4000;
  expect_error(w, "4000 elements");
  w.root["accessors"][good]["count"] = -1;
  expect_error(w, "accessors[0]/count is -1, must be a non-negative integer");
  w.root["accessors"][good]["count"] = 0;
  expect_error(w, "0 vertex indices");
}

TEST(GltfMesh, PointsAndLinesAreIgnoredWithAWarning) {
  GltfWriter w;
  w.triangle();
  w.root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 0}}}, {"mode", 1}});
  w.node({{"mesh", 0}});
  const Loaded loaded = load(w);
  EXPECT_EQ(loaded.scene.meshes()[0].indices.size(), 1u);
  expect_warning(loaded, "points and lines are ignored");
}

TEST(GltfMaterial, DefaultsAreTheSpecifications) {
  GltfWriter w = with_materials({json::object()});
  const Loaded loaded = load(w);
  const Material& m = loaded.scene.materials()[0];
  EXPECT_EQ(m.base_color, glm::vec4(1));
  EXPECT_EQ(m.metallic, 1.0f);
  EXPECT_EQ(m.roughness, 1.0f);
  EXPECT_EQ(m.specular, 1.0f);
  EXPECT_EQ(m.ior, 1.5f);
  EXPECT_EQ(m.transmission, 0.0f);
  EXPECT_EQ(m.emission, glm::vec3(0));
  EXPECT_TRUE(std::isnan(m.ir_albedo));
}

TEST(GltfMaterial, VolumeAndItsRoughnessAreRead) {
  GltfWriter w = with_materials(
      {{{"pbrMetallicRoughness", {{"roughnessFactor", 0.25}}},
        {"extensions",
         {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
          {"KHR_materials_volume", {{"thicknessFactor", 0.1}, {"attenuationDistance", 0.5}, {"attenuationColor", {0.75, 0.5, 0.25}}}}}},
        {"extras", {{"ir_attenuation_color", 0.125}}}}});
  const Loaded loaded = load(w);
  const Material& m = loaded.scene.materials()[0];
  EXPECT_EQ(m.transmission_roughness, 0.25f);
  EXPECT_EQ(m.attenuation_distance_m, 0.5f);
  EXPECT_EQ(m.attenuation_color, glm::vec3(0.75f, 0.5f, 0.25f));
  EXPECT_EQ(m.ir_attenuation_color, 0.125f);
  EXPECT_FALSE(m.thin_walled);
}

TEST(GltfMaterial, TransmissionWithoutThicknessIsASheet) {
  const json transmission = {{"transmissionFactor", 1}};
  GltfWriter w = with_materials(
      {{{"extensions", {{"KHR_materials_transmission", transmission}}}},
       {{"extensions", {{"KHR_materials_transmission", transmission}, {"KHR_materials_volume", {{"attenuationDistance", 0.5}}}}}},
       {{"extensions", {{"KHR_materials_transmission", transmission}, {"KHR_materials_volume", {{"thicknessFactor", 0.1}}}}}},
       {{"extensions", {{"KHR_materials_transmission", transmission}}}, {"extras", {{"thin_walled", 0}}}},
       {{"extras", {{"thin_walled", 1}}}},
       json::object()});
  const Loaded loaded = load(w);
  const bool thin[] = {true, true, false, false, true, false};
  for (size_t i = 0; i < std::size(thin); ++i) EXPECT_EQ(loaded.scene.materials()[i].thin_walled, thin[i]) << i;
  expect_warning(loaded, "attenuationDistance is not used");
}

TEST(GltfMaterial, ExtrasGiveWhatGltfHasNoWordsFor) {
  const std::pair<const char*, float Material::*> fields[] = {{"ir_roughness", &Material::ir_roughness},
                                                              {"ir_ior", &Material::ir_ior},
                                                              {"ir_transmission", &Material::ir_transmission},
                                                              {"ir_transmission_roughness", &Material::ir_transmission_roughness},
                                                              {"diffuse_roughness", &Material::diffuse_roughness},
                                                              {"transmission_roughness", &Material::transmission_roughness},
                                                              {"subsurface", &Material::subsurface},
                                                              {"ir_subsurface_color", &Material::ir_subsurface_color},
                                                              {"ir_subsurface_radius_m", &Material::ir_subsurface_radius_m}};
  json extras = {{"subsurface_color", {0.5, 0.25, 0.125}}, {"subsurface_radius_m", {0.5, 0.25, 2}}};
  const auto value = [&](size_t i) { return i == 1 ? 1.25f : 0.0625f * float(i + 1); };  // an index is at least 1
  for (size_t i = 0; i < std::size(fields); ++i) extras[fields[i].first] = value(i);
  GltfWriter w = with_materials({{{"extras", extras}}});
  const Loaded loaded = load(w);
  const Material& m = loaded.scene.materials()[0];
  for (size_t i = 0; i < std::size(fields); ++i) EXPECT_EQ(m.*fields[i].second, value(i)) << fields[i].first;
  EXPECT_EQ(m.subsurface_color, glm::vec3(0.5f, 0.25f, 0.125f));
  EXPECT_EQ(m.subsurface_radius_m, glm::vec3(0.5f, 0.25f, 2.0f));
}

TEST(GltfMaterial, WrongTypesAndRangesNameTheField) {
  const std::pair<json, const char*> wrong[] = {{{{"pbrMetallicRoughness", {{"metallicFactor", "shiny"}}}},
                                                 "materials[0]/pbrMetallicRoughness/metallicFactor is \"shiny\", must be a number"},
                                                {{{"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1}}}}}, "must be 4 numbers"},
                                                {{{"pbrMetallicRoughness", {{"roughnessFactor", 3}}}}, "roughness is 3"},
                                                {{{"extras", {{"ir_albedo", -0.5}}}}, "ir_albedo is -0.5"},
                                                {{{"extras", {{"ior_texture", {{"index", 3}}}}}}, "extras.ior_texture: texture 3 of 0"},
                                                {{{"extras", {{"subsurface_color", {1, 1}}}}}, "must be 3 numbers"},
                                                {{{"emissiveTexture", {{"index", 4}}}}, "emissiveTexture: texture 4 of 0"}};
  for (const auto& [material, says] : wrong) {
    GltfWriter w = with_materials(json::array({material}));
    expect_error(w, says);
  }
  GltfWriter w = with_materials({json::object()});
  w.root["meshes"][0]["primitives"][0]["material"] = 8;
  expect_error(w, "material 8 of 1");
}

TEST(GltfTexture, EmbeddedExternalAndDataUriImagesAreDecoded) {
  GltfWriter w;
  const std::string png = png_pixel();
  const Folder folder;
  write_text(folder / "two words+50%.png", png);
  w.root["images"] = {
      {{"bufferView", w.view(png.data(), png.size())}, {"mimeType", "image/png"}, {"name", "inside"}},
      {{"uri", "two%20words+50%25.png"}},
      {{"uri", "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nGPgEpH7DwABpAE8k4sOtwAAAABJRU5ErkJggg=="}}};
  w.root["textures"] = {{{"source", 0}}, {{"source", 1}}, {{"source", 2}}};
  w.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicRoughnessTexture", {{"index", 0}}}}},
                          {"emissiveTexture", {{"index", 1}}},
                          {"normalTexture", {{"index", 2}}}}};
  w.thing(0);
  w.write_gltf(folder / "scene.gltf", "da%20ta+1.bin", "da ta+1.bin");
  Scene scene;
  load_file(scene, folder / "scene.gltf", glm::dmat4(1.0));
  const Material& m = scene.materials()[0];
  ASSERT_EQ(scene.textures().size(), 4u) << "one image as colour and as data is two textures";
  EXPECT_TRUE(scene.textures()[m.base_color_texture].srgb);
  EXPECT_FALSE(scene.textures()[m.metallic_roughness_texture].srgb);
  EXPECT_TRUE(scene.textures()[m.emission_texture].srgb);
  EXPECT_FALSE(scene.textures()[m.normal_texture].srgb);
  EXPECT_EQ(scene.textures()[m.base_color_texture].name, "inside");
  for (const auto& texture : scene.textures()) EXPECT_EQ(texture->texels, (std::vector<uint8_t>{10, 20, 30, 255}));
}

TEST(GltfTexture, AnImageThatIsNotInTheFileIsAnError) {
  GltfWriter w;
  w.root["images"] = {{{"uri", "missing.png"}}};
  w.root["textures"] = {{{"source", 2}}};
  w.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  w.thing(0);
  expect_error(w, "image 2 of 1");
}

// One candela is 1/683 W/sr at 540 THz, by the definition of the unit.
TEST(GltfLight, CandelaBecomeWattsPerSteradianAndLightsLookForward) {
  GltfWriter w;
  w.root["extensionsUsed"] = {"KHR_lights_punctual"};
  w.lights({{{"type", "point"}, {"color", {1.0, 0.5, 0.25}}, {"intensity", 8 * 683}, {"name", "lamp"}, {"extras", {{"ir_share", 2.5}}}},
            {{"type", "spot"}, {"spot", json::object()}},
            {{"type", "directional"}, {"intensity", 683}, {"extras", {{"ir_intensity", 0.25}}}}});
  for (int i = 0; i < 3; ++i)
    w.node({{"translation", {1, 2, 3 + i}}, {"scale", {2, 2, 2}}, {"extensions", {{"KHR_lights_punctual", {{"light", i}}}}}});
  const Loaded loaded = load(w);
  ASSERT_EQ(loaded.scene.lights().size(), 3u);
  const Light& light = loaded.scene.lights()[0];
  EXPECT_EQ(light.intensity, glm::vec3(8, 4, 2));
  EXPECT_EQ(light.name, "lamp");
  EXPECT_TRUE(std::isnan(light.ir_intensity));
  expect_near(glm::dvec3(light.light_to_world[3]), {1, 2, 3});
  EXPECT_EQ(glm::dmat3(light.light_to_world), glm::dmat3(1.0)) << "a light takes no scale";
  const Light &spot = loaded.scene.lights()[1], &sun = loaded.scene.lights()[2];
  EXPECT_EQ(spot.kind, Light::Kind::spot);
  EXPECT_EQ(light.ir_share, 2.5);
  EXPECT_EQ(sun.intensity, glm::vec3(1.0f));
  EXPECT_EQ(sun.ir_intensity, 0.25f) << "what extras state in W/m^2 is taken as it is";
  EXPECT_EQ(spot.inner_rad, 0.0);
  EXPECT_NEAR(spot.outer_rad, 0.78539816339744831, 1e-9) << "the extension's default, pi / 4";
  EXPECT_EQ(sun.kind, Light::Kind::directional);
  expect_near(glm::dvec3(sun.light_to_world[2]), {0, 0, -1});
}

TEST(GltfCamera, LooksForwardWithDownwardY) {
  GltfWriter w;
  w.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"aspectRatio", 1.5}, {"znear", 0.1}, {"zfar", 20.0}}}},
                       {{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 0.1}}}},
                       {{"type", "orthographic"}, {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"znear", 0}, {"zfar", 1}}}}};
  for (int i = 0; i < 3; ++i) w.node({{"camera", i}, {"translation", {0, 0, 5}}, {"scale", {3, 3, 3}}});
  const Loaded loaded = load(w);
  ASSERT_EQ(loaded.scene.cameras().size(), 2u);
  expect_warning(loaded, "orthographic");
  const Camera& camera = loaded.scene.cameras()[0];
  expect_near(apply(camera.camera_to_world, {0, 0, 1}), {0, 0, 4});
  expect_near(apply(camera.camera_to_world, {0, 1, 0}), {0, -1, 5});
  expect_near(apply(camera.camera_to_world, {1, 0, 0}), {1, 0, 5});
  EXPECT_EQ(camera.height, 0u);
  // The top edge of the image, v = 0 in units of its height, is at yfov / 2 above the axis.
  EXPECT_NEAR((0.0 - camera.k[2][1]) / camera.k[1][1], -std::tan(0.5), 1e-12);
  EXPECT_NEAR(2 * camera.k[2][0], 1.5, 1e-12);
  EXPECT_EQ(camera.k[0][0], camera.k[1][1]);
  EXPECT_EQ(camera.near_m, 0.1);
  EXPECT_EQ(camera.far_m, 20.0);
  EXPECT_TRUE(std::isinf(loaded.scene.cameras()[1].far_m));
}

TEST(GltfFile, UnsupportedRequiredExtensionsAreNamed) {
  GltfWriter w;
  w.thing();
  w.root["extensionsRequired"] = {"KHR_texture_basisu"};
  expect_error(w, "KHR_texture_basisu is not supported");
  w.root.erase("extensionsRequired");
  w.root["extensionsUsed"] = {"KHR_materials_variants"};
  expect_warning(load(w), "KHR_materials_variants is ignored");
}

TEST(GltfFile, NothingToShowIsAnError) {
  GltfWriter w;
  w.node({{"name", "empty"}});
  expect_error(w, "no mesh, light or camera");
}

TEST(GltfFile, PathsWithSpacesAndSecondLoadsAppend) {
  GltfWriter w = with_materials({{{"name", "a"}}});
  const Folder folder;
  std::filesystem::create_directory(folder / "two words");
  w.write_gltf(folder / "two words/the scene.gltf");
  Scene scene;
  for (int i = 0; i < 2; ++i) load_file(scene, folder / "two words/the scene.gltf", glm::dmat4(1.0));
  ASSERT_EQ(scene.instances().size(), 2u);
  EXPECT_EQ(scene.instances()[1].mesh, 1u);
  EXPECT_EQ(scene.instances()[1].materials, std::vector<uint32_t>{1});
}

}  // namespace
