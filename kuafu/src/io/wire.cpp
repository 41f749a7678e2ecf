// SPDX-License-Identifier: Apache-2.0
#include "io/wire.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <type_traits>

#include "device/error.h"
#include "device/log_sink.h"
#include "io/wire_stream.h"
#include "scene/rig.h"

namespace kuafu {
namespace {

constexpr uint32_t last_word = 0x21646e65u;

// Each `transfer` lists the fields once, for both directions. The bindings name every field of the struct, so that one who adds a field
// meets this place when it does not compile.

template <class Stream, class T>
void transfer(Stream& s, T& t) requires std::is_same_v<std::remove_const_t<T>, Texture> {
  auto& [name, width, height, channels, format, srgb, texels, wrap_u, wrap_v, filter, uv_set, uv_transform, revision] = t;
  s.text(name), s.plain(width), s.plain(height), s.plain(channels), s.plain(format), s.flag(srgb), s.array(texels);
  s.plain(wrap_u), s.plain(wrap_v), s.plain(filter), s.plain(uv_set), s.plain(uv_transform);
  (void)revision;
}

template <class Stream, class T>
void transfer(Stream& s, T& t) requires std::is_same_v<std::remove_const_t<T>, Mesh> {
  auto& [name, positions, normals, uvs, uvs_1, colors, tangents, indices, slots, deformation, bounds] = t;
  s.text(name), s.array(positions), s.array(normals), s.array(uvs), s.array(uvs_1), s.array(colors), s.array(tangents);
  s.array(indices), s.array(slots);
  (void)deformation, (void)bounds;
}

template <class Stream, class T>
void transfer(Stream& s, T& t) requires std::is_same_v<std::remove_const_t<T>, Material> {
  for_each_field(t, [&](auto& field) {
    using Field = std::remove_cvref_t<decltype(field)>;
    if constexpr (std::is_same_v<Field, std::string>)
      s.text(field);
    else if constexpr (std::is_same_v<Field, bool>)
      s.flag(field);
    else
      s.plain(field);
  });
}

// Files can state a part of these structs alone.
template <class Stream, class T>
void transfer(Stream& s, T& t) requires std::is_same_v<std::remove_const_t<T>, Instance> {
  s.text(t.name), s.plain(t.mesh), s.array(t.materials), s.plain(t.local_to_world);
}

template <class Stream, class T>
void transfer(Stream& s, T& t) requires std::is_same_v<std::remove_const_t<T>, Light> {
  s.text(t.name), s.plain(t.kind), s.plain(t.intensity), s.plain(t.ir_intensity), s.plain(t.ir_share), s.plain(t.light_to_world),
      s.plain(t.inner_rad), s.plain(t.outer_rad);
  s.plain(t.range_m), s.plain(t.radius_m), s.plain(t.size_m);
}

template <class Stream, class T>
void transfer(Stream& s, T& t) requires std::is_same_v<std::remove_const_t<T>, Camera> {
  s.text(t.name), s.plain(t.k), s.plain(t.camera_to_world), s.plain(t.near_m), s.plain(t.far_m);
}

template <class Stream, class T>
void rig_node(Stream& s, T& t) {
  auto& [parent, matrix, rest] = t;
  auto& [translation, rotation, scale, weights] = rest;
  s.plain(parent), s.plain(matrix), s.plain(translation), s.plain(rotation), s.plain(scale), s.array(weights);
}

template <class Stream, class T>
void rig_channel(Stream& s, T& t) {
  auto& [node, property, keyframes] = t;
  auto& [interpolation, quaternion, width, times_s, values] = keyframes;
  s.plain(node), s.plain(property), s.plain(interpolation), s.flag(quaternion), s.plain(width), s.array(times_s), s.array(values);
}

template <class Stream, class T>
void rig_mesh(Stream& s, T& t) {
  auto& [mesh, node, skin, positions, normals, tangents, skin_weights, targets] = t;
  s.plain(mesh), s.plain(node), s.plain(skin), s.array(positions), s.array(normals), s.array(tangents);
  s.list(skin_weights, [&](auto& set) { s.array(set.joints), s.array(set.weights); });
  s.list(targets, [&](auto& target) { s.array(target.positions), s.array(target.normals), s.array(target.tangents); });
}

template <class Stream, class T>
void transfer(Stream& s, T& t) requires std::is_same_v<std::remove_const_t<T>, Rig> {
  auto& [root_to_world, nodes, animations, skins, meshes, members] = t;
  s.plain(root_to_world);
  s.list(nodes, [&](auto& n) { rig_node(s, n); });
  s.list(animations, [&](auto& animation) {
    s.text(animation.name);
    s.list(animation.channels, [&](auto& c) { rig_channel(s, c); });
  });
  s.list(skins, [&](auto& skin) { s.array(skin.joints), s.array(skin.inverse_binds); });
  s.list(meshes, [&](auto& m) { rig_mesh(s, m); });
  s.list(members, [&](auto& member) { s.plain(member.kind), s.plain(member.id), s.plain(member.node), s.plain(member.to_node); });
}

/// Counts the bytes of a record, with one element in each of its arrays and lists.
class Weight {
 public:
  template <class T>
  void plain(const T&) {
    bytes_ += sizeof(T);
  }
  template <class T>
  void array(const std::vector<T>&) {
    bytes_ += sizeof(T);
  }
  void text(const std::string&) {}
  void flag(bool) { ++bytes_; }
  template <class T, class Each>
  void list(const std::vector<T>&, Each&& each) {
    T one;
    each(one);
  }
  [[nodiscard]] uint32_t bytes() const { return bytes_; }

 private:
  uint32_t bytes_ = 0;
};

template <class... Records>
uint32_t weight_of() {
  Weight weight;
  const auto add = [&](auto record) { transfer(weight, record); };
  (add(Records()), ...);
  return weight.bytes();
}

/// "IM" and how many bytes one record of each kind takes: a format that grows has another first word.
uint32_t first_word() { return 0x4d49u | weight_of<Texture, Material, Mesh, Instance, Light, Camera, Rig>() << 16; }

template <class T>
const T& value_of(const T& entry) {
  return entry;
}
template <class T>
const T& value_of(const std::optional<T>& entry) {
  return *entry;  // a scene just read has removed nothing
}

template <class Table>
void write_table(Writer& w, const Table& table) {
  w.plain(uint64_t{table.size()});
  for (const auto& entry : table) transfer(w, value_of(entry));
}

template <class T, class Add>
void read_table(Reader& r, Add&& add) {
  for (size_t left = r.claim(sizeof(T)); left > 0; --left) {
    T entry;
    transfer(r, entry);
    add(std::move(entry));
  }
}

}  // namespace

void write_answer(std::FILE* to, const Scene& scene, const std::vector<std::string>& warnings) {
  Writer w(to);
  w.plain(first_word()), w.plain(int32_t{KS_OK}), w.plain(uint64_t{warnings.size()});
  for (const std::string& warning : warnings) w.text(warning);
  write_table(w, scene.textures());
  write_table(w, scene.materials());
  write_table(w, scene.meshes());
  write_table(w, scene.instances());
  write_table(w, scene.lights());
  write_table(w, scene.cameras());
  w.plain(uint64_t{scene.rigs().size()});
  for (const auto& rig : scene.rigs()) transfer(w, *rig);
  w.plain(last_word);
  if (std::fflush(to) != 0) ks::fail(KS_ERROR_FILE, "the answer cannot be written: %s", std::strerror(errno));
}

void write_failure(std::FILE* to, int status, const std::string& text) {
  Writer w(to);
  w.plain(first_word()), w.plain(int32_t{status}), w.text(text);
  std::fflush(to);
}

ImportAnswer read_answer(const std::function<void(void*, size_t)>& read, uint64_t most_bytes) {
  Reader r(read, most_bytes);
  uint32_t word = 0;
  int32_t status = KS_OK;
  r.plain(word);
  if (word != first_word()) ks::fail(KS_ERROR_FILE, "the program that reads it is of another version than the library: install both again");
  r.plain(status);
  if (status != KS_OK) {
    std::string text;
    r.text(text);
    const bool unsupported = status == KS_ERROR_UNSUPPORTED;
    ks::fail(unsupported ? KS_ERROR_UNSUPPORTED : KS_ERROR_FILE, "%s", ks::one_line(text, longest_text_bytes).c_str());
  }
  ImportAnswer answer;
  for (size_t left = r.claim(1); left > 0; --left) {
    std::string text;
    r.text(text);
    if (answer.warnings.size() < most_warnings) answer.warnings.push_back(ks::one_line(text, longest_text_bytes));
  }
  Scene& scene = answer.scene;
  read_table<Texture>(r, [&](Texture&& t) { scene.add_texture(std::move(t)); });
  read_table<Material>(r, [&](Material&& m) { scene.add_material(std::move(m)); });
  read_table<Mesh>(r, [&](Mesh&& m) { scene.add_mesh(std::move(m)); });
  read_table<Instance>(r, [&](Instance&& i) { scene.add_instance(std::move(i)); });
  read_table<Light>(r, [&](Light&& l) { scene.add_light(std::move(l)); });
  read_table<Camera>(r, [&](Camera&& c) { scene.add_camera(std::move(c)); });
  read_table<Rig>(r, [&](Rig&& rig) { scene.add_rig(std::move(rig)); });  // which checks it
  r.plain(word);
  if (word != last_word) ks::fail(KS_ERROR_FILE, "the program that reads it answered with something that is no scene");
  return answer;
}

}  // namespace kuafu
