// SPDX-License-Identifier: Apache-2.0
#include "io/wire_rig.h"

namespace kuafu {
namespace {

// The bindings name every field, as those of io/wire.cpp do.

template <class Stream, class T>
void node(Stream& s, T& t) {
  auto& [parent, matrix, rest] = t;
  auto& [translation, rotation, scale, weights] = rest;
  s.plain(parent), s.plain(matrix), s.plain(translation), s.plain(rotation), s.plain(scale), s.array(weights);
}

template <class Stream, class T>
void channel(Stream& s, T& t) {
  auto& [node, property, keyframes] = t;
  auto& [interpolation, quaternion, width, times_s, values] = keyframes;
  s.plain(node), s.plain(property), s.plain(interpolation), s.flag(quaternion), s.plain(width), s.array(times_s), s.array(values);
}

template <class Stream, class T>
void mesh(Stream& s, T& t) {
  auto& [mesh, node, skin, positions, normals, tangents, skin_weights, targets] = t;
  s.plain(mesh), s.plain(node), s.plain(skin), s.array(positions), s.array(normals), s.array(tangents);
  s.list(skin_weights, [&](auto& set) { s.array(set.joints), s.array(set.weights); });
  s.list(targets, [&](auto& target) { s.array(target.positions), s.array(target.normals), s.array(target.tangents); });
}

template <class Stream, class T>
void rig(Stream& s, T& t) {
  auto& [root_to_world, nodes, animations, skins, meshes, members] = t;
  s.plain(root_to_world);
  s.list(nodes, [&](auto& n) { node(s, n); });
  s.list(animations, [&](auto& animation) {
    s.text(animation.name);
    s.list(animation.channels, [&](auto& c) { channel(s, c); });
  });
  s.list(skins, [&](auto& skin) { s.array(skin.joints), s.array(skin.inverse_binds); });
  s.list(meshes, [&](auto& m) { mesh(s, m); });
  s.list(members, [&](auto& member) { s.plain(member.kind), s.plain(member.id), s.plain(member.node), s.plain(member.to_node); });
}

}  // namespace

void transfer(Writer& to, const Rig& r) { rig(to, r); }
void transfer(Reader& from, Rig& r) { rig(from, r); }

}  // namespace kuafu
