// SPDX-License-Identifier: Apache-2.0
// What it costs to read a scene file in another process: times of loading each file again and again into a new scene. Without arguments the
// files are one triangle in each format that is read, so that nearly all is the helper program's start, its answer and its end. The
// processor time, of both processes, is what an idle machine would need at most.
// Usage: bench_load [FILE...]
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "render_bench.h"

namespace bench {
namespace {

constexpr size_t loads = 50;

struct Example {
  const char* name;
  const char* text;
};

// The triangle (0, 0, 0), (1, 0, 0), (0, 1, 0) in each format.
constexpr Example triangles[] = {
    {"triangle.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"},
    {"triangle.ply",
     "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
     "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"},
    {"triangle.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"},
    {"triangle.dae",
     R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
   <accessor source="#a" count="3" stride="3">
    <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
   </accessor>
  </technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
)"},
    {"triangle.gltf",
     R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
"bufferViews": [{"buffer": 0, "byteLength": 36}],
"buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}
)"}};

/// The triangles as files, as long as it lives.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "bench_load_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) std::exit(1);
    path_ = name;
    for (const Example& e : triangles) std::ofstream(path_ / e.name) << e.text;
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  [[nodiscard]] std::vector<std::string> files() const {
    std::vector<std::string> out;
    for (const Example& e : triangles) out.push_back(path_ / e.name);
    return out;
  }

 private:
  std::filesystem::path path_;
};

double load_ms(kuafu_device device, const std::string& path) {
  kuafu_scene scene = nullptr;
  ok(kuafu_scene_create(device, &scene));
  const double start = now_ms();
  ok(kuafu_scene_load(scene, path.c_str(), nullptr, nullptr));
  const double ms = now_ms() - start;
  kuafu_scene_release(scene);
  return ms;
}

void measure(kuafu_device device, const std::string& path) {
  const double first = load_ms(device, path);
  std::vector<double> ms(loads);
  const double before = cpu_ms();
  for (double& one : ms) one = load_ms(device, path);
  const double cpu = (cpu_ms() - before) / loads;
  std::sort(ms.begin(), ms.end());
  std::printf("             %6.1f  %6.1f  %13.1f  %9.1f  %s\n", first, ms[loads / 2], ms.back(), cpu, path.c_str());
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) {
  using namespace bench;
  const Folder folder;
  const kuafu_device device = open_device();
  std::printf("one load, ms: first  median  largest of %zu  processor\n", loads);
  for (const std::string& path : argc > 1 ? std::vector<std::string>(argv + 1, argv + argc) : folder.files()) measure(device, path);
  kuafu_device_release(device);
  return 0;
}
