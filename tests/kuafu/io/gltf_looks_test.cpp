// SPDX-License-Identifier: Apache-2.0
// How glTF files say that textures are read, colours of vertices, alpha, copies by EXT_mesh_gpu_instancing, and Draco's geometry.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>

#include <cmath>

#include "device/error.h"
#include "kuafu/geometry.h"
#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

/// A triangle with the material, and one image as texture 0.
GltfWriter with_material(const json& material) {
  GltfWriter w;
  w.texture();
  w.root["materials"] = {material};
  w.thing(0);
  return w;
}

json base_texture(json info) { return {{"pbrMetallicRoughness", {{"baseColorTexture", std::move(info)}}}}; }

TEST(GltfLooks, SamplersSetsAndTransformsArrive) {
  const json transform = {{"offset", {0.25, 0.5}}, {"rotation", 0.5}, {"scale", {2, 3}}, {"texCoord", 1}};
  GltfWriter w = with_material(base_texture({{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}}));
  w.root["extensionsRequired"] = {"KHR_texture_transform"};
  w.root["samplers"] = {{{"magFilter", 9728}, {"wrapS", 33071}, {"wrapT", 33648}}};
  w.root["textures"][0]["sampler"] = 0;
  const Loaded loaded = load_glb(w);
  EXPECT_TRUE(loaded.warnings.empty());
  const Texture& t = loaded.scene.textures()[loaded.scene.materials()[0].base_color_texture];
  EXPECT_EQ(t.wrap_u, KUAFU_WRAP_CLAMP);
  EXPECT_EQ(t.wrap_v, KUAFU_WRAP_MIRROR);
  EXPECT_EQ(t.filter, KUAFU_FILTER_NEAREST);
  EXPECT_EQ(t.uv_set, 1u);
  const double c = std::cos(0.5), s = std::sin(0.5), rows[6] = {2 * c, 3 * s, 0.25, -2 * s, 3 * c, 0.5};
  for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(t.uv_transform[i], rows[i], 1e-6);
}

TEST(GltfLooks, OneImageLookedUpInTwoWaysIsTwoTexturesAndTheSameWayOne) {
  json material = base_texture({{"index", 0}});
  material["emissiveTexture"] = {{"index", 0}};
  material["extensions"]["KHR_materials_transmission"]["transmissionTexture"] = {{"index", 0}, {"texCoord", 1}};
  GltfWriter w = with_material(material);
  const Loaded loaded = load_glb(w);
  const Material& m = loaded.scene.materials()[0];
  EXPECT_EQ(m.base_color_texture, m.emission_texture);
  EXPECT_EQ(loaded.scene.textures().size(), 2u);
  EXPECT_EQ(loaded.scene.textures()[m.transmission_texture].uv_set, 1u);
}

TEST(GltfLooks, WrongOnesNameTheField) {
  GltfWriter w = with_material(base_texture({{"index", 0}}));
  w.root["samplers"] = {{{"wrapS", 7}}};
  w.root["textures"][0]["sampler"] = 0;
  expect_error(w, "wrapS is 7");
  w.root["textures"][0]["sampler"] = 3;
  expect_error(w, "sampler 3 of 1");
  w = with_material(base_texture({{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"scale", {1, 2, 3}}}}}}}));
  expect_error(w, "must be 2 numbers");
  w = with_material({{"alphaMode", "GLASSY"}});
  expect_error(w, "alphaMode is 'GLASSY'");
  w = with_material(base_texture({{"index", 0}}));
  w.root["textures"] = {{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}}};
  expect_error(w, "KHR_texture_basisu alone, which is not read");
}

TEST(GltfLooks, AlphaScaleAndRangeArrive) {
  GltfWriter w = with_material({{"alphaMode", "MASK"},
                                {"alphaCutoff", 0.25},
                                {"normalTexture", {{"index", 0}, {"scale", 0.5}}},
                                {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.75}}}}});
  w.root["materials"].push_back({{"alphaMode", "BLEND"}, {"normalTexture", {{"index", 0}, {"scale", 0}}}});
  w.lights({{{"type", "point"}, {"range", 3}}});
  w.node({{"extensions", light_0()}});
  const Loaded loaded = load_glb(w);
  EXPECT_TRUE(loaded.warnings.empty());
  const auto& m = loaded.scene.materials();
  EXPECT_EQ(m[0].alpha_mode, Material::AlphaMode::mask);
  EXPECT_EQ(m[0].alpha_cutoff, 0.25f);
  EXPECT_EQ(m[0].base_color.a, 0.75f);
  EXPECT_EQ(m[0].normal_scale, 0.5f);
  EXPECT_EQ(m[1].alpha_mode, Material::AlphaMode::blend);
  EXPECT_EQ(m[1].normal_scale, 0.0f);
  EXPECT_EQ(loaded.scene.lights()[0].range_m, 3);
}

TEST(GltfLooks, AClearCoatArrivesWithItsTextures) {
  GltfWriter w =
      with_material({{"extensions", {{"KHR_materials_clearcoat", {{"clearcoatFactor", 0.75}, {"clearcoatRoughnessFactor", 0.25}}}}}});
  w.root["extensionsUsed"] = {"KHR_materials_clearcoat"};
  w.root["extensionsRequired"] = {"KHR_materials_clearcoat"};
  const Loaded loaded = load_glb(w);
  EXPECT_TRUE(loaded.warnings.empty());
  EXPECT_EQ(loaded.material().clearcoat, 0.75f);
  EXPECT_EQ(loaded.material().clearcoat_roughness, 0.25f);
  json& coat = w.root["materials"][0]["extensions"]["KHR_materials_clearcoat"];
  coat["clearcoatTexture"] = {{"index", 0}};
  coat["clearcoatRoughnessTexture"] = {{"index", 0}, {"texCoord", 1}};
  coat["clearcoatNormalTexture"] = {{"index", 0}, {"scale", 0.5}};
  const Loaded textured = load_glb(w);
  EXPECT_TRUE(textured.warnings.empty());
  EXPECT_EQ(textured.scene.materials()[0].clearcoat_texture, 0u);
  EXPECT_EQ(textured.scene.materials()[0].clearcoat_normal_texture, 0u);
  EXPECT_EQ(textured.scene.materials()[0].clearcoat_normal_scale, 0.5f);
  EXPECT_EQ(textured.scene.materials()[0].clearcoat_roughness_texture, 1u);
  coat["clearcoatFactor"] = 1.5;
  expect_error(w, "clearcoat is 1.5");
}

TEST(GltfLooks, TheReflectingLayersColourIsItsMean) {
  const auto with_color = [](const json& color) {
    GltfWriter w = with_material({{"extensions", {{"KHR_materials_specular", {{"specularFactor", 0.5}, {"specularColorFactor", color}}}}}});
    return load_glb(w);
  };
  EXPECT_TRUE(with_color({1, 1, 1}).warnings.empty());
  EXPECT_TRUE(with_color({0.5, 0.5, 0.5}).warnings.empty());
  EXPECT_EQ(with_color({0.5, 0.5, 0.5}).scene.materials()[0].specular, 0.25f);
  const Loaded colored = with_color({1, 0.5, 0});
  EXPECT_EQ(colored.scene.materials()[0].specular, 0.25f);
  EXPECT_EQ(colored.warnings.size(), 1u);
  const Loaded bright = with_color({9, 9, 9});
  EXPECT_EQ(bright.scene.materials()[0].specular, 1.0f);
  EXPECT_EQ(bright.warnings.size(), 1u);
}

TEST(GltfLooks, UnlitBecomesMatt) {
  GltfWriter w = with_material(
      {{"pbrMetallicRoughness", {{"baseColorFactor", {0.25, 0.5, 0.75, 1}}}}, {"extensions", {{"KHR_materials_unlit", json::object()}}}});
  w.root["extensionsRequired"] = {"KHR_materials_unlit"};
  const Loaded loaded = load_glb(w);
  const Material& m = loaded.scene.materials()[0];
  EXPECT_EQ(m.base_color, glm::vec4(0.25f, 0.5f, 0.75f, 1));
  EXPECT_EQ(m.metallic, 0.0f);
  EXPECT_EQ(m.specular, 0.0f);
  ASSERT_EQ(loaded.warnings.size(), 1u);
  expect_warning(loaded, "matt");
}

/// A triangle with normals and a TANGENT of each vertex.
GltfWriter with_tangents(const json& material, const std::vector<float>& tangents) {
  GltfWriter w = with_material(material);
  json& attributes = w.root["meshes"][0]["primitives"][0]["attributes"];
  attributes["NORMAL"] = w.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, type_float, "VEC3", 3);
  attributes["TANGENT"] = w.accessor<float>(tangents, type_float, "VEC4", 4);
  return w;
}

const json mapped = {{"normalTexture", {{"index", 0}}}};
const std::vector<float> some_tangents{0, 2, 0, 1, 0.6f, 0.8f, 0, -1, 0, 0, 0, 1};

TEST(GltfLooks, TangentsArriveWhereSomethingFollowsThem) {
  GltfWriter w = with_tangents(mapped, some_tangents);
  const Loaded loaded = load_glb(w);
  EXPECT_TRUE(loaded.warnings.empty());
  const std::vector<glm::vec4>& tangents = loaded.scene.meshes()[0].tangents;
  ASSERT_EQ(tangents.size(), 3u);
  EXPECT_EQ(tangents[0], glm::vec4(0, 1, 0, 1));
  EXPECT_LT(glm::length(tangents[1] - glm::vec4(0.6f, 0.8f, 0, -1)), 1e-6f);
  EXPECT_EQ(tangents[2], glm::vec4(0.0f)) << "no direction";
  GltfWriter brushed = with_tangents({{"extensions", {{"KHR_materials_anisotropy", json::object()}}}}, some_tangents);
  EXPECT_EQ(load_glb(brushed).scene.meshes()[0].tangents.size(), 3u);
  GltfWriter plain = with_tangents(json::object(), some_tangents);
  EXPECT_TRUE(load_glb(plain).scene.meshes()[0].tangents.empty()) << "nothing follows them";
  w.root["meshes"][0]["primitives"][0]["attributes"].erase("NORMAL");
  EXPECT_TRUE(load_glb(w).scene.meshes()[0].tangents.empty()) << "without normals they are to be ignored";
}

TEST(GltfLooks, TangentsOfOnePrimitiveLeaveTheOthersTheTextureCoordinates) {
  GltfWriter w = with_tangents(mapped, some_tangents);
  json& primitives = w.root["meshes"][0]["primitives"];
  primitives.push_back(primitives[0]);
  primitives[1]["attributes"].erase("TANGENT");
  const Loaded loaded = load_glb(w);
  const std::vector<glm::vec4>& tangents = loaded.scene.meshes()[0].tangents;
  ASSERT_EQ(tangents.size(), 6u);
  for (size_t i = 3; i < 6; ++i) EXPECT_EQ(tangents[i], glm::vec4(0.0f));
}

TEST(GltfLooks, MorphTargetsMoveTangents) {
  GltfWriter w = with_tangents(mapped, {1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, -1});
  const int added = w.accessor<float>({0, 2, 0, 0, 2, 0, 0, 2, 0}, type_float, "VEC3", 3);
  w.root["meshes"][0]["primitives"][0]["targets"] = {{{"TANGENT", added}}};
  w.root["meshes"][0]["weights"] = {0.5};
  const Loaded loaded = load_glb(w);
  EXPECT_TRUE(loaded.warnings.empty());
  const float half = std::sqrt(0.5f);
  EXPECT_LT(glm::length(loaded.scene.meshes()[0].tangents[2] - glm::vec4(half, half, 0, -1)), 1e-6f);
}

TEST(GltfLooks, AsManyTangentsAsVertices) {
  GltfWriter w = with_tangents(mapped, {1, 0, 0, 1, 1, 0, 0, 1});
  expect_error(w, "3 positions, 2 of TANGENT");
}

TEST(GltfLooks, LightThatIsLetThroughArrivesWithItsTextures) {
  const char* name = "KHR_materials_diffuse_transmission";
  GltfWriter w =
      with_material({{"extensions", {{name, {{"diffuseTransmissionFactor", 0.75}, {"diffuseTransmissionColorFactor", {0.25, 0.5, 1}}}}}},
                     {"extras", {{"ir_diffuse_transmission_color", 0.875}}}});
  w.root["extensionsUsed"] = {name};
  w.root["extensionsRequired"] = {name};
  const Loaded loaded = load_glb(w);
  EXPECT_TRUE(loaded.warnings.empty());
  const Material& m = loaded.scene.materials()[0];
  EXPECT_EQ(m.diffuse_transmission, 0.75f);
  EXPECT_EQ(m.diffuse_transmission_color, glm::vec3(0.25f, 0.5f, 1));
  EXPECT_EQ(m.ir_diffuse_transmission_color, 0.875f);
  EXPECT_TRUE(m.thin_walled);
  json& extensions = w.root["materials"][0]["extensions"];
  extensions[name]["diffuseTransmissionTexture"] = extensions[name]["diffuseTransmissionColorTexture"] = {{"index", 0}};
  const Loaded textured = load_glb(w);
  EXPECT_TRUE(textured.warnings.empty());
  EXPECT_FALSE(textured.scene.textures()[textured.scene.materials()[0].diffuse_transmission_texture].srgb);
  EXPECT_TRUE(textured.scene.textures()[textured.scene.materials()[0].diffuse_transmission_color_texture].srgb);
  extensions["KHR_materials_volume"] = {{"thicknessFactor", 0.01}};
  EXPECT_FALSE(load_glb(w).scene.materials()[0].thin_walled);
  extensions[name]["diffuseTransmissionColorFactor"] = {1, 2, 0};
  expect_error(w, "diffuse_transmission_color is 2");
}

TEST(GltfLooks, AFileOfPointsAloneSaysWhyNothingIsInIt) {
  GltfWriter w = with_material(json::object());
  w.root["meshes"][0]["primitives"][0]["mode"] = 0;
  expect_error(w, "in it: mesh");
  expect_error(w, "points and lines are ignored");
}

TEST(GltfLooks, BrushedFluffyFilmedAndDispersiveMaterialsArrive) {
  const json texture = {{"index", 0}};
  const json extensions = {
      {"KHR_materials_anisotropy", {{"anisotropyStrength", 0.75}, {"anisotropyRotation", 0.5}, {"anisotropyTexture", texture}}},
      {"KHR_materials_sheen",
       {{"sheenColorFactor", {0.25, 0.5, 1}},
        {"sheenRoughnessFactor", 0.375},
        {"sheenColorTexture", texture},
        {"sheenRoughnessTexture", texture}}},
      {"KHR_materials_iridescence",
       {{"iridescenceFactor", 0.5},
        {"iridescenceThicknessMinimum", 200},
        {"iridescenceThicknessMaximum", 600},
        {"iridescenceTexture", texture},
        {"iridescenceThicknessTexture", texture}}},
      {"KHR_materials_dispersion", {{"dispersion", 2}}}};
  GltfWriter w = with_material({{"extensions", extensions}, {"extras", {{"ir_sheen_color", 0.125}}}});
  for (const auto& [name, extension] : extensions.items()) w.root["extensionsRequired"].push_back(name);
  const Loaded loaded = load_glb(w);
  EXPECT_TRUE(loaded.warnings.empty());
  const Material& m = loaded.scene.materials()[0];
  EXPECT_EQ(m.anisotropy, 0.75f);
  EXPECT_EQ(m.anisotropy_rotation_rad, 0.5f);
  EXPECT_EQ(m.sheen_color, glm::vec3(0.25f, 0.5f, 1));
  EXPECT_EQ(m.sheen_roughness, 0.375f);
  EXPECT_EQ(m.ir_sheen_color, 0.125f);
  EXPECT_EQ(m.iridescence, 0.5f);
  EXPECT_EQ(m.iridescence_ior, 1.3f);
  EXPECT_EQ(m.iridescence_least_thickness_nm, 200);
  EXPECT_EQ(m.iridescence_thickness_nm, 600);
  EXPECT_EQ(m.dispersion, 2);
  EXPECT_TRUE(loaded.scene.textures()[m.sheen_color_texture].srgb);
  for (const uint32_t data : {m.anisotropy_texture, m.sheen_roughness_texture, m.iridescence_texture, m.iridescence_thickness_texture})
    EXPECT_FALSE(loaded.scene.textures()[data].srgb);
  w.root["materials"][0]["extensions"]["KHR_materials_iridescence"]["iridescenceIor"] = 0.5;
  expect_error(w, "iridescence_ior is 0.5");
}

TEST(GltfLooks, ColoursAndTheSecondSetAreReadWhereTheyMatter) {
  const auto file = [](const std::vector<float>& colors, int uv_set) {
    GltfWriter w = with_material(base_texture({{"index", 0}, {"texCoord", uv_set}}));
    json& attributes = w.root["meshes"][0]["primitives"][0]["attributes"];
    attributes["COLOR_0"] = w.accessor<float>(colors, type_float, "VEC3", 3);
    attributes["TEXCOORD_0"] = w.accessor<float>({0, 0, 1, 0, 0, 1}, type_float, "VEC2", 2);
    attributes["TEXCOORD_1"] = w.accessor<float>({0, 0, 5, 0, 0, 5}, type_float, "VEC2", 2);
    return load_glb(w);
  };
  const Loaded both = file({1, 0, 0, 0, 1, 0, 0, 0, 0.5f}, 1);
  ASSERT_EQ(both.scene.meshes()[0].colors.size(), 3u);
  EXPECT_EQ(both.scene.meshes()[0].colors[2], glm::vec4(0, 0, 0.5f, 1));
  ASSERT_EQ(both.scene.meshes()[0].uvs_1.size(), 3u);
  EXPECT_EQ(both.scene.meshes()[0].uvs_1[1], glm::vec2(5, 0));
  const Loaded neither = file(std::vector<float>(9, 1.0f), 0);
  EXPECT_TRUE(neither.scene.meshes()[0].colors.empty()) << "white changes nothing";
  EXPECT_TRUE(neither.scene.meshes()[0].uvs_1.empty()) << "nothing reads it";
}

TEST(GltfLooks, EveryCopyOfAnInstancedNodeIsThere) {
  GltfWriter w;
  w.triangle();
  const float h = std::sqrt(0.5f);
  const int places = w.accessor<float>({1, 0, 0, 0, 2, 0, 0, 0, 3}, type_float, "VEC3", 3),
            turns = w.accessor<float>({0, 0, 0, 1, 0, 0, h, h, 0, 0, 0, 1}, type_float, "VEC4", 4);
  w.root["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  w.node({{"mesh", 0},
          {"translation", {0, 0, 10}},
          {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}, {"ROTATION", turns}}}}}}}});
  const Loaded loaded = load_glb(w);
  ASSERT_EQ(loaded.scene.instances().size(), 3u);
  EXPECT_EQ(loaded.scene.meshes().size(), 1u);
  const auto point = [&](size_t i) { return glm::dvec3(loaded.scene.instances()[i].local_to_world * glm::dvec4(1, 0, 0, 1)); };
  EXPECT_LT(glm::length(point(0) - glm::dvec3(2, 0, 10)), 1e-6);
  EXPECT_LT(glm::length(point(1) - glm::dvec3(0, 3, 10)), 1e-6) << "turned by a quarter about z";
  EXPECT_LT(glm::length(point(2) - glm::dvec3(1, 0, 13)), 1e-6);
  w.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = w.accessor<float>({1, 1, 1}, type_float, "VEC3", 3);
  expect_error(w, "1 of SCALE, must be as many");
}

std::vector<char> draco_triangle() {
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(1);
  const int positions = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int uvs = builder.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
  const float p[3][3] = {{0, 0, 0}, {2, 0, 0}, {0, 3, 0}}, t[3][2] = {{0, 0}, {1, 0}, {0, 1}};
  builder.SetAttributeValuesForFace(positions, draco::FaceIndex(0), p[0], p[1], p[2]);
  builder.SetAttributeValuesForFace(uvs, draco::FaceIndex(0), t[0], t[1], t[2]);
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  draco::Encoder encoder;
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
  return {buffer.data(), buffer.data() + buffer.size()};
}

GltfWriter with_draco(const std::vector<char>& data) {
  GltfWriter w;
  const int view = w.view(data.data(), data.size());
  w.root["accessors"] = {{{"componentType", type_float}, {"count", 3}, {"type", "VEC3"}},
                         {{"componentType", type_float}, {"count", 3}, {"type", "VEC2"}},
                         {{"componentType", type_u16}, {"count", 3}, {"type", "SCALAR"}}};
  w.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  w.mesh(
      {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}},
        {"indices", 2},
        {"extensions", {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}}}}}}});
  w.node({{"mesh", 0}});
  return w;
}

TEST(GltfDraco, CompressedTrianglesAreDecodedAndBrokenOnesAreErrors) {
  std::vector<char> data = draco_triangle();
  GltfWriter w = with_draco(data);
  const Loaded loaded = load_glb(w);
  const Mesh& mesh = loaded.scene.meshes()[0];
  ASSERT_EQ(mesh.indices.size(), 1u);
  for (int k = 0; k < 3; ++k) {
    const uint32_t i = mesh.indices[0][k];
    EXPECT_NEAR(mesh.positions[i].x, 2 * mesh.uvs[i].x, 1e-3);
    EXPECT_NEAR(mesh.positions[i].y, 3 * mesh.uvs[i].y, 1e-3);
  }
  EXPECT_NEAR(loaded.scene.bounds().max.y, 3, 1e-3);
  for (const size_t kept : {size_t{1}, size_t{3}, data.size() / 2, data.size() - 1}) {
    GltfWriter cut = with_draco(std::vector<char>(data.begin(), data.begin() + long(kept)));
    expect_error(cut, "KHR_draco_mesh_compression");
  }
  w.root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = 9;
  expect_error(w, "buffer view 9");
}

std::string collada(const std::string& transparent) {
  return collada_with_material("<technique sid=\"c\"><lambert><diffuse><color>0.5 0.5 0.5 1</color></diffuse>" + transparent +
                               "</lambert></technique>");
}

/// A triangle of a material with these fields.
std::string gltf(json material) {
  material["name"] = "m";
  return with_materials({material}).glb();
}

std::string mtl(const std::string& opacity) { return "newmtl m\nKd 0.5 0.5 0.5\nillum 2\n" + opacity + "\n"; }

Loaded loaded(const Folder& folder, const std::string& file, const std::string& text, bool keep) {
  write_text(folder / "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
  write_text(folder / file, text);
  Loaded out;
  out.warnings = load_file(out.scene, folder / (file == "a.mtl" ? "a.obj" : file), glm::dmat4(1.0), {.keep_transparent = keep});
  return out;
}

class Opacity0 : public testing::TestWithParam<std::pair<const char*, std::string>> {};

TEST_P(Opacity0, IsDrawnOpaqueAndSaid) {
  const auto& [file, text] = GetParam();
  for (const bool keep : {false, true}) {
    const Folder folder;
    const Loaded got = loaded(folder, file, text, keep);
    ASSERT_EQ(got.warnings.size(), 1u) << file;
    EXPECT_NE(got.warnings[0].find("opacity 0"), std::string::npos) << got.warnings[0];
    const Material& m = got.material();
    EXPECT_EQ(m.alpha_mode == Material::AlphaMode::opaque, !keep) << file << text;
    EXPECT_EQ(m.base_color.a, keep ? 0.0f : 1.0f);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Habits, Opacity0,
    testing::Values(std::pair{"a.mtl", mtl("Tr 1.000000")}, std::pair{"a.mtl", mtl("d 0")},
                    std::pair{"a.dae", collada("<transparency><float>0</float></transparency>")},
                    std::pair{"a.dae", collada("<transparent opaque=\"A_ONE\"><color>1 1 1 1</color></transparent>"
                                               "<transparency><float>0</float></transparency>")},
                    std::pair{"a.dae", collada("<transparent opaque=\"RGB_ZERO\"><color>1 1 1 1</color></transparent>"
                                               "<transparency><float>1</float></transparency>")},
                    std::pair{"a.glb", gltf({{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0}}}}})},
                    std::pair{"a.glb", gltf({{"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0}}}}})}));

TEST(Area, OfNoTriangleIsSaid) {
  const Folder folder;
  write_text(folder / "a.obj", "o line\nv 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\no triangle\nv 0 1 0\nf 1 2 4\n");
  const std::vector<std::string> warnings = load_path(folder / "a.obj").warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("mesh 'line' has no area"), std::string::npos) << warnings[0];
}

TEST(Opacity, ThatIsMeantStays) {
  for (const std::string& text : {mtl("d 0.25"), mtl("Tr 0.75")}) {
    const Folder folder;
    const Loaded got = loaded(folder, "a.mtl", text, false);
    EXPECT_TRUE(got.warnings.empty());
    EXPECT_EQ(got.material().base_color.a, 0.25f);
  }
}

}  // namespace
