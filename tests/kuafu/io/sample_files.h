// SPDX-License-Identifier: Apache-2.0
// Small scene files: glTF as JSON with binary data by accessor(), a PNG, a Collada file. And a folder that goes away with the test.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace scene_test {

using nlohmann::json;

class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "kuafu_scene_XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

inline void write_text(const std::filesystem::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

/// The text with `by` wherever `what` stood.
inline std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size())) text.replace(at, what.size(), by);
  return text;
}

/// The smallest PNG: 1x1, 8-bit RGBA (10, 20, 30, 255).
inline std::string png_pixel() {
  static const unsigned char bytes[] = {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
                                        0x44, 0x52, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x06, 0x00, 0x00,
                                        0x00, 0x1f, 0x15, 0xc4, 0x89, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x44, 0x41, 0x54, 0x78,
                                        0x9c, 0x63, 0xe0, 0x12, 0x91, 0xfb, 0x0f, 0x00, 0x01, 0xa4, 0x01, 0x3c, 0x93, 0x8b,
                                        0x0e, 0xb7, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
  return {reinterpret_cast<const char*>(bytes), sizeof bytes};
}

/// Collada: one triangle in centimetres, z up, shown by two nodes, the first 2 m up.
inline std::string collada_triangle() {
  return R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 100 0 0 0 100 0</float_array><technique_common><accessor source="#pa" count="3" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n" name="n"><translate>0 0 200</translate><instance_geometry url="#g"/></node>
<node id="m" name="m"><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
}

/// collada_triangle() with a material whose effect has this profile; `images` stands before it.
inline std::string collada_with_material(const std::string& profile, const std::string& images = "") {
  const std::string material =
      "<library_materials><material id=\"k\" name=\"m\"><instance_effect url=\"#e\"/></material></library_materials>"
      "<library_effects><effect id=\"e\"><profile_COMMON>" +
      profile + "</profile_COMMON></effect></library_effects>";
  std::string text = replaced(collada_triangle(), "<library_geometries>", images + material + "<library_geometries>");
  text = replaced(text, "<triangles count=\"1\"", "<triangles count=\"1\" material=\"s\"");
  return replaced(text, "<instance_geometry url=\"#g\"/>",
                  "<instance_geometry url=\"#g\"><bind_material><technique_common><instance_material symbol=\"s\" target=\"#k\"/>"
                  "</technique_common></bind_material></instance_geometry>");
}

inline constexpr int type_byte = 5120, type_u8 = 5121, type_i16 = 5122, type_u16 = 5123, type_u32 = 5125, type_float = 5126;

class GltfWriter {
 public:
  json root = {{"asset", {{"version", "2.0"}}}, {"scene", 0}};
  json more_buffers = json::array();  // after the one that is written

  /// A packed view of these values; returns the accessor's index.
  template <class T>
  int accessor(const std::vector<T>& values, int component_type, const char* type, size_t components) {
    return accessor(view(values.data(), values.size() * sizeof(T)), values.size() / components, component_type, type);
  }
  int accessor(int view, size_t count, int component_type, const char* type) {
    root["accessors"].push_back({{"bufferView", view}, {"componentType", component_type}, {"count", count}, {"type", type}});
    return static_cast<int>(root["accessors"].size()) - 1;
  }
  int view(const void* data, size_t size) {
    bytes_.resize((bytes_.size() + 3) / 4 * 4);
    root["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", size}});
    bytes_.append(static_cast<const char*>(data), size);
    return static_cast<int>(root["bufferViews"].size()) - 1;
  }
  /// A mesh of one triangle (0,0,0) (1,0,0) (0,1,0); returns the mesh's index.
  int triangle(int material = -1) {
    const int positions = accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, type_float, "VEC3", 3);
    json primitive = {{"attributes", {{"POSITION", positions}}}};
    if (material >= 0) primitive["material"] = material;
    return mesh({primitive});
  }
  int mesh(json primitives) {
    root["meshes"].push_back({{"primitives", std::move(primitives)}});
    return static_cast<int>(root["meshes"].size()) - 1;
  }
  /// A root node.
  int node(json n) {
    root["nodes"].push_back(std::move(n));
    const int index = static_cast<int>(root["nodes"].size()) - 1;
    root["scenes"][0]["nodes"].push_back(index);
    return index;
  }
  /// One PNG as texture 0.
  void texture() {
    const std::string png = png_pixel();
    root["images"] = {{{"bufferView", view(png.data(), png.size())}, {"mimeType", "image/png"}}};
    root["textures"] = {{{"source", 0}}};
  }
  /// A perspective camera.
  void camera() { root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 0.1}}}}}; }
  void lights(json all) { root["extensions"]["KHR_lights_punctual"]["lights"] = std::move(all); }
  /// The triangle as a thing of its own.
  void thing(int material = -1) { node({{"mesh", triangle(material)}}); }

  /// scene.gltf beside its buffer, whose URI and file name are given.
  void write_gltf(const std::filesystem::path& path, const std::string& uri = "data.bin", const std::string& file = "data.bin") {
    if (!bytes_.empty()) root["buffers"] = {{{"byteLength", bytes_.size()}, {"uri", uri}}};
    write_text(path.parent_path() / file, bytes_);
    write_text(path, root.dump());
  }
  void write_glb(const std::filesystem::path& path) { write_text(path, glb()); }
  std::string glb() {
    std::string out = "glTF";
    const auto word = [&](size_t value) {
      const auto v = static_cast<uint32_t>(value);
      out.append(reinterpret_cast<const char*>(&v), 4);
    };
    std::string body = bytes_;
    body.resize((body.size() + 3) / 4 * 4);
    if (!body.empty()) root["buffers"] = {{{"byteLength", bytes_.size()}}};
    for (const json& buffer : more_buffers) root["buffers"].push_back(buffer);
    std::string text = root.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    word(2), word(20 + text.size() + (body.empty() ? 0 : 8 + body.size()));
    word(text.size()), word(0x4e4f534a);
    out += text;
    if (body.empty()) return out;
    word(body.size()), word(0x004e4942);
    return out + body;
  }

 private:
  std::string bytes_;
};

/// What a node has that shows light 0.
inline json light_0() { return {{"KHR_lights_punctual", {{"light", 0}}}}; }

/// A triangle of the first of these materials.
inline GltfWriter with_materials(json materials) {
  GltfWriter w;
  w.root["materials"] = std::move(materials);
  w.thing(0);
  return w;
}

}  // namespace scene_test
