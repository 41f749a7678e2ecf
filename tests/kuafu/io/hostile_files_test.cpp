// SPDX-License-Identifier: Apache-2.0
// Broken files, and files made to crash, hang, fill the memory or look elsewhere: each is one error or a load, and the host goes on.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <sstream>

#include "capi/device/expect_error.h"
#include "kuafu/io/loaded.h"

namespace {

using namespace kuafu;
using namespace scene_test;

const std::string obj_triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

Loaded load(const std::filesystem::path& path, const LoadOptions& options = {}) { return try_path(path, options); }
Loaded load(GltfWriter& writer, const LoadOptions& options = {}) { return try_glb(writer, options); }

std::string with_texture(const std::string& uri) {
  GltfWriter w;
  w.root["images"] = {{{"uri", uri}}};
  w.root["textures"] = {{{"source", 0}}};
  w.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  w.thing(0);
  return w.glb();
}

// --- A reader that crashes or never ends ---

TEST(HostileFile, ColladaThatMisleadsItsReaderIsAnErrorOrALoad) {
  const Folder folder;
  const std::string whole = collada_triangle();
  std::string deep;
  for (int i = 0; i < 20000; ++i) deep += "<node>";
  for (int i = 0; i < 20000; ++i) deep += "</node>";
  const std::string library = "<library_nodes><node id=\"l\"><instance_node url=\"#l\"/></node></library_nodes><library_visual_scenes>";
  const std::vector<std::pair<const char*, std::string>> files = {
      {"a node that shows itself", replaced(replaced(whole, "<library_visual_scenes>", library), "<instance_geometry url=\"#g\"/></node>\n",
                                            "<instance_node url=\"#l\"/></node>\n")},
      {"20 000 nodes in each other", replaced(whole, "<node id=\"m\" name=\"m\">", deep + "<node id=\"m\" name=\"m\">")},
      {"an accessor's count", replaced(whole, "count=\"3\" stride", "count=\"3000000\" stride")},
      {"an accessor's stride", replaced(whole, "stride=\"3\"", "stride=\"1000000\"")},
      {"text as an index", replaced(whole, "<p>0 1 2</p>", "<p><![CDATA[abc]]></p>")},
      {"a comment as an index", replaced(whole, "<p>0 1 2</p>", "<p><!-- x --></p>")},
      {"an array without a count", replaced(whole, "<float_array id=\"pa\" count=\"9\">", "<float_array id=\"pa\">")},
  };
  for (const auto& [what, text] : files) {
    write_text(folder / "a.dae", text);
    const Loaded outcome = load(folder / "a.dae", {.seconds = 1});
    EXPECT_TRUE(!outcome.error.empty() || !outcome.scene.meshes().empty()) << what;
  }
}

TEST(HostileFile, AColladaNodeShownABillionTimesEndsInTime) {
  const Folder folder;
  std::ostringstream text;
  text << "<library_nodes>";
  for (int i = 0; i < 9; ++i) {
    text << "<node id=\"b" << i << "\">";
    for (int k = 0; k < 10; ++k) text << "<instance_node url=\"#b" << i + 1 << "\"/>";
    text << "</node>";
  }
  text << "<node id=\"b9\"><instance_geometry url=\"#g\"/></node>";
  const std::string library = text.str();
  write_text(folder / "a.dae",
             replaced(replaced(collada_triangle(), "<library_visual_scenes>", library + "</library_nodes><library_visual_scenes>"),
                      "<instance_geometry url=\"#g\"/></node>\n", "<instance_node url=\"#b0\"/></node>\n"));
  const Loaded outcome = load(folder / "a.dae", {.memory_bytes = uint64_t{512} << 20, .seconds = 1});
  EXPECT_TRUE(has(outcome.error, "by KUAFU_LOAD_SECONDS") || has(outcome.error, "KUAFU_LOAD_MEMORY_MB allows")) << outcome.error;
}

TEST(HostileFile, APlyWithAHugeHeaderOrListIsAnErrorSoon) {
  const Folder folder;
  std::ostringstream header;
  header << "ply\nformat ascii 1.0\nelement vertex 1\n";
  for (int i = 0; i < 200000; ++i) header << "property float p" << i << "\n";
  header << "end_header\n0\n";
  write_text(folder / "wide.ply", header.str());
  EXPECT_TRUE(has(load(folder / "wide.ply").error, "more than 1000 lines"));
  std::string lists = "ply\nformat binary_little_endian 1.0\nelement vertex 100\nproperty list uint double x\nend_header\n";
  for (int i = 0; i < 40; ++i) lists += std::string("\x00\x00\x00\x10", 4);
  write_text(folder / "list.ply", lists);
  EXPECT_NE(load(folder / "list.ply", {.memory_bytes = uint64_t{512} << 20, .seconds = 3}).error, "");
}

// --- Memory ---

TEST(HostileFile, MemoryIsTiedToTheBytesOfTheFile) {
  const Folder folder;
  const std::string tga("\0\0\2\0\0\0\0\0\0\0\0\0\xff\x7f\xff\x7f \x08", 18);
  write_text(folder / "bomb.tga", tga);
  write_text(folder / "a.mtl", "newmtl a\nmap_Kd bomb.tga\n");
  write_text(folder / "a.obj", "mtllib a.mtl\nusemtl a\n" + obj_triangle);
  EXPECT_TRUE(warns(load(folder / "a.obj"), "too early"));

  GltfWriter w;  // accessors without bytes, and one of bytes used again and again
  w.root["accessors"] = {{{"componentType", type_float}, {"count", 999999}, {"type", "VEC3"}}};
  json primitives = json::array();
  for (int i = 0; i < 200; ++i) primitives.push_back({{"attributes", {{"POSITION", 0}}}});
  w.mesh(primitives);
  w.node({{"mesh", 0}});
  write_text(folder / "zeros.glb", w.glb());
  expect_error(load(folder / "zeros.glb", {.memory_bytes = 64 << 20}).error, "KUAFU_LOAD_MEMORY_MB");
  w.root["accessors"][0]["count"] = 16777215;
  write_text(folder / "zeros.glb", w.glb());
  EXPECT_TRUE(has(load(folder / "zeros.glb").error, "without a buffer view"));
}

TEST(HostileFile, TheLimitsCanBeSet) {
  GltfWriter w;
  std::vector<float> positions(3 * 300000, 0.0f);
  w.mesh({{{"attributes", {{"POSITION", w.accessor(positions, type_float, "VEC3", 3)}}}}});
  w.node({{"mesh", 0}});
  EXPECT_EQ(load(w).error, "");
  expect_error(load(w, {.memory_bytes = 1 << 20}).error, "KUAFU_LOAD_MEMORY_MB allows more");
  const LoadLimits small = load_limits({}, 1000), large = load_limits({}, 1 << 20);
  EXPECT_EQ(large.memory_bytes - small.memory_bytes, memory_per_file_byte * ((1 << 20) - 1000));
  EXPECT_EQ(load_limits({.memory_bytes = 5, .seconds = 7}, 1 << 20).memory_bytes, 5u);
  EXPECT_EQ(load_limits({.memory_bytes = 5, .seconds = 7}, 1 << 20).seconds, 7u);
  ASSERT_EQ(setenv("KUAFU_LOAD_SECONDS", "12", 1), 0);
  EXPECT_EQ(load_options_from_environment().seconds, 12u);
  ASSERT_EQ(setenv("KUAFU_LOAD_SECONDS", "soon", 1), 0);
  EXPECT_THROW(load_options_from_environment(), ks::Error);
  unsetenv("KUAFU_LOAD_SECONDS");
}

// --- Other files ---

TEST(HostileFile, AFifoIsNotWaitedFor) {
  const Folder folder;
  ASSERT_EQ(mkfifo((folder / "fifo").c_str(), 0600), 0);
  write_text(folder / "image.glb", with_texture("fifo"));
  EXPECT_TRUE(warns(load(folder / "image.glb"), "'fifo' is not a regular file"));
  GltfWriter w;
  w.thing();
  w.write_gltf(folder / "buffer.gltf", "fifo", "unused.bin");
  EXPECT_TRUE(has(load(folder / "buffer.gltf").error, "'fifo' is not a regular file"));
  write_text(folder / "lib.obj", "mtllib fifo\n" + obj_triangle);
  EXPECT_TRUE(warns(load(folder / "lib.obj"), "'fifo' is not a regular file"));
  write_text(folder / "a.mtl", "newmtl a\nmap_Kd fifo\n");
  write_text(folder / "map.obj", "mtllib a.mtl\nusemtl a\n" + obj_triangle);
  EXPECT_TRUE(warns(load(folder / "map.obj"), "'fifo' is not a regular file"));
  std::filesystem::create_directory(folder / "images");
  write_text(folder / "image.glb", with_texture("images"));
  EXPECT_TRUE(warns(load(folder / "image.glb"), "'images' is not a regular file"));
}

TEST(HostileFile, NothingOutsideTheFolderIsReadUnlessAllowed) {
  const Folder outer;
  write_text(outer / "out.png", png_pixel());
  std::filesystem::create_directories(outer / "scene/textures");
  write_text(outer / "scene/textures/in.png", png_pixel());
  std::filesystem::create_symlink(outer / "out.png", outer / "scene/link.png");
  std::filesystem::create_symlink("textures/in.png", outer / "scene/inside.png");
  const std::filesystem::path file = outer / "scene/a.glb";
  const LoadOptions anywhere{.outside_folder = true};
  for (const std::string& uri : {std::string("../out.png"), (outer / "out.png").string(), std::string("link.png"),
                                 std::string("textures/../../out.png"), std::string("%2e%2e/out.png")}) {
    write_text(file, with_texture(uri));
    EXPECT_TRUE(warns(load(file), "outside the scene file's folder")) << uri;
    EXPECT_TRUE(load(file, anywhere).warnings.empty()) << uri;
  }
  for (const char* uri : {"../none.png", "/none/none.png"}) {
    write_text(file, with_texture(uri));
    EXPECT_TRUE(warns(load(file), "outside the scene file's folder")) << "it must not tell whether " << uri << " is there";
  }
  for (const char* uri : {"textures/in.png", "inside.png", "textures/../textures/in.png"}) {
    write_text(file, with_texture(uri));
    EXPECT_TRUE(load(file).warnings.empty()) << uri;
  }
  write_text(outer / "scene/a.mtl", "newmtl a\nmap_Kd ../out.png\n");
  write_text(outer / "scene/a.obj", "mtllib a.mtl\nusemtl a\n" + obj_triangle);
  EXPECT_TRUE(warns(load(outer / "scene/a.obj"), "'../out.png' is outside"));
  write_text(outer / "lib.mtl", "newmtl a\nKd 1 0 0\n");
  std::filesystem::remove(outer / "scene/a.mtl");
  write_text(outer / "scene/a.obj", "mtllib ../lib.mtl\nusemtl a\n" + obj_triangle);
  EXPECT_TRUE(warns(load(outer / "scene/a.obj"), "outside"));
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(outer / "scene");
  write_text("a.glb", with_texture("inside.png"));
  Scene scene;
  EXPECT_NO_THROW(load_file(scene, "a.glb", glm::dmat4(1.0))) << "by a relative path";
  std::filesystem::current_path(before);
}

// --- Messages ---

TEST(HostileFile, NamesStayInTheirLineAndMessagesAreBounded) {
  GltfWriter w;
  for (int i = 0; i < 3000; ++i)
    w.root["materials"].push_back(
        {{"name", std::to_string(i)}, {"extensions", {{"KHR_materials_specular", {{"specularColorFactor", {1, 0.5, 1}}}}}}});
  w.root["materials"][0]["name"] = "evil\nERROR: all is lost\x1b[2J" + std::string(5000, 'x');
  w.triangle(0);
  w.node({{"mesh", 0}, {"name", "two\nlines"}});
  const Loaded outcome = load(w);
  ASSERT_EQ(outcome.error, "");
  EXPECT_LE(outcome.warnings.size(), 100u);
  for (const std::string& warning : outcome.warnings) {
    EXPECT_LE(warning.size(), 1200u);
    for (const char c : warning) EXPECT_GE(static_cast<unsigned char>(c), 0x20u) << warning;
  }
  EXPECT_TRUE(has(outcome.warnings.back(), "more such messages")) << outcome.warnings.back();
}

TEST(HostileFile, AMemberThatIsMisspeltIsSaidOnceWithTheNearestName) {
  GltfWriter w;
  w.triangle();
  w.triangle();
  w.root["materials"] = {{{"pbrMetallicRoughness", {{"rougnessFactor", 0.2}}}, {"name", "a"}}};
  for (json& mesh : w.root["meshes"]) mesh["primitives"][0]["indeces"] = 0;
  w.root["accessors"][1]["something\nelse"] = 1;
  w.root["accessors"][1]["extras"] = {{"anything", 1}};
  w.node({{"mesh", 0}});
  const Loaded outcome = load(w);
  ASSERT_EQ(outcome.error, "");
  EXPECT_EQ(outcome.warnings.size(), 3u);
  EXPECT_TRUE(warns(outcome, "meshes[0]/primitives[0]: member 'indeces' is unknown and ignored; is 'indices' meant?"));
  EXPECT_TRUE(warns(outcome, "materials[0]/pbrMetallicRoughness: member 'rougnessFactor' is unknown and ignored; is 'roughnessFactor'"));
  EXPECT_TRUE(warns(outcome, "accessors[1]: member 'something else' is unknown and ignored"));

  for (int i = 0; i < 3000; ++i) w.root["nodes"][0][std::to_string(i)] = i;
  EXPECT_EQ(load(w).warnings.size(), 11u);
}

TEST(HostileFile, BoundsThatAreNotThoseOfTheDataAreSaidWithBoth) {
  GltfWriter w;
  w.thing();
  w.root["accessors"][0]["min"] = {0, 0, 0};
  w.root["accessors"][0]["max"] = {1, 1, 0};
  EXPECT_TRUE(load(w).warnings.empty());
  w.root["accessors"][0]["max"] = {1, 3, 0};
  EXPECT_TRUE(warns(load(w), "POSITION: component 1 goes from 0 to 1, but the accessor's min and max say 0 to 3"));
}

TEST(HostileFile, MtlStatementsBeforeTheFirstMaterialAreLeftOutAndSaid) {
  const Folder folder;
  write_text(folder / "a.obj", "mtllib a.mtl\nusemtl m\n" + obj_triangle);
  for (const std::string word : {"map_Kd", "map_Ks", "map_d", "map_bump", "bump", "refl"}) {
    write_text(folder / "a.mtl", "# by hand\n" + word + " nowhere.png\nnewmtl m\nKd 0.5 0.5 0.5\n");
    const Loaded outcome = load(folder / "a.obj");
    EXPECT_EQ(outcome.error, "");
    EXPECT_TRUE(warns(outcome, "'a.mtl', line 2: '" + word + "' stands before any newmtl and is left out")) << word;
  }
}

TEST(HostileFile, ColladaAccessorsStayInsideOfTheirArrays) {
  const Folder folder;
  const std::string whole = collada_triangle(), accessor = "<accessor ";
  ASSERT_NE(whole.find(accessor), std::string::npos);
  for (const char* more : {"offset=\"1\" ", "offset=\"1000\" ", "offset=\"18446744073709551615\" "}) {
    std::string text = whole;
    text.insert(text.find(accessor) + accessor.size(), more);
    write_text(folder / "a.dae", text);
    expect_error(load(folder / "a.dae").error, "an accessor takes 3 times 3 values");
  }
}

TEST(HostileFile, IndicesThatDoNotFitAreNotWrapped) {
  GltfWriter w;
  w.thing();
  for (const char* field :
       {"/nodes/0/mesh", "/scenes/0/nodes/0", "/meshes/0/primitives/0/attributes/POSITION", "/accessors/0/bufferView"}) {
    GltfWriter changed = w;
    changed.root[json::json_pointer(field)] = uint64_t{1} << 32;
    EXPECT_NE(load(changed).error, "") << field << " 2^32 became 0";
  }
}

/// Loads bytes as a file of this name. Returns the error's text, empty when it was accepted.
std::string load_bytes(const Folder& folder, const std::string& name, const std::string& bytes) {
  write_text(folder / name, bytes);
  return load(folder / name).error;
}

std::string rich_glb() {
  GltfWriter w;
  w.texture();
  w.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"baseColorFactor", {1, 1, 1, 1}}}},
                          {"extensions", {{"KHR_materials_ior", {{"ior", 1.4}}}}},
                          {"extras", {{"ir_albedo", 0.5}}}}};
  w.camera();
  w.lights({{{"type", "point"}, {"color", {1.0, 0.5, 0.25}}}});
  const int positions = w.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, type_float, "VEC3", 3);
  const int normals = w.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, type_float, "VEC3", 3);
  const int indices = w.accessor<uint16_t>({0, 1, 2, 2, 1, 3}, type_u16, "SCALAR", 1);
  w.mesh({{{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}}, {"indices", indices}, {"material", 0}}});
  w.node({{"mesh", 0}, {"rotation", {0, 0, 0, 1}}, {"children", {1}}});
  w.root["nodes"].push_back({{"camera", 0}, {"extensions", light_0()}});
  return w.glb();
}

TEST(GarbageFile, EveryTruncationOfAGlbIsAnError) {
  const Folder folder;
  const std::string whole = rich_glb();
  ASSERT_EQ(load_bytes(folder, "whole.glb", whole), "");
  for (size_t size = 0; size < whole.size(); size += size < 64 || size + 64 > whole.size() ? 1 : 17)
    EXPECT_NE(load_bytes(folder, "cut.glb", whole.substr(0, size)), "") << size << " of " << whole.size() << " bytes";
}

TEST(GarbageFile, MissingEmptyAndForeignFilesSayWhatTheyAre) {
  const Folder folder;
  Scene scene;
  const auto load = [&](const std::string& name) { return load_file(scene, folder / name, glm::dmat4(1.0)); };
  EXPECT_ERROR(load("none.gltf"), KS_ERROR_FILE, "none.gltf: there is no such file");
  EXPECT_ERROR(load("scene.fbx"), KS_ERROR_UNSUPPORTED, ".gltf .glb .obj .dae .stl .ply");
  std::filesystem::create_directory(folder / "folder.glb");
  EXPECT_ERROR(load("folder.glb"), KS_ERROR_FILE, "not a regular file");
  for (const auto& [text, said] : {std::pair<std::string, const char*>{"", "is empty"},
                                   {"{}", "asset.version is missing"},
                                   {R"({"asset":{"version":"1.0"}})", "only glTF 2.x"},
                                   {"{\"asset\":", "not JSON"},
                                   {std::string(1000000, '['), "nested deeper"},
                                   {R"({"asset":{"version":"2.0"},"nodes":[3]})", "nodes[0] is not an object"}})
    expect_error(load_bytes(folder, "a.gltf", text), said);
}

TEST(GarbageFile, AMissingOrShortBufferIsNamed) {
  GltfWriter w;
  w.thing();
  const Folder folder;
  w.write_gltf(folder / "scene.gltf", "gone.bin");
  Scene scene;
  EXPECT_ERROR(load_file(scene, folder / "scene.gltf", glm::dmat4(1.0)), KS_ERROR_FILE, "gone.bin");
  write_text(folder / "gone.bin", "short");
  EXPECT_THROW(load_file(scene, folder / "scene.gltf", glm::dmat4(1.0)), ks::Error);
  w.root["bufferViews"][0]["byteLength"] = 1000;
  w.write_gltf(folder / "scene.gltf");
  EXPECT_ERROR(load_file(scene, folder / "scene.gltf", glm::dmat4(1.0)), KS_ERROR_FILE, "bufferViews[0]");
}

}  // namespace
