// SPDX-License-Identifier: Apache-2.0
// The helper that reads scene files: its process, its answers, practice captures read by it.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <random>
#include <thread>

#include "capi/device/expect_error.h"
#include "io/wire.h"
#include "kuafu/io/loaded.h"
#include "support/heap.h"

namespace {

using namespace kuafu;
using namespace scene_test;

void write_glb(const std::filesystem::path& path) {
  GltfWriter w;
  w.thing();
  w.write_glb(path);
}

/// What load_file says when the helper is this shell script.
std::string error_with_helper(const std::string& script) {
  const Folder folder;
  write_glb(folder / "a.glb");
  write_text(folder / "kuafu-import-gltf", "#!/bin/sh\n" + script + "\n");
  chmod((folder / "kuafu-import-gltf").c_str(), 0700);
  return try_path(folder / "a.glb", {.seconds = 1, .helpers = folder / ""}).error;
}

TEST(ImportProcess, EveryEndOfTheHelperIsOneError) {
  EXPECT_TRUE(has(error_with_helper("exit 0"), "ended with status 0 before it was done"));
  EXPECT_TRUE(has(error_with_helper("exit 3"), "status 3"));
  EXPECT_TRUE(has(error_with_helper("kill -SEGV $$"), "signal 11"));
  EXPECT_TRUE(has(error_with_helper("exit 127"), "does not start"));
  EXPECT_TRUE(has(error_with_helper("echo hello there >&3"), "another version"));
  EXPECT_TRUE(has(error_with_helper("exec 3>&-; sleep 100"), "")) << "one that closes its pipe is not waited for";
}

TEST(ImportProcess, OneThatSleepsIsStopped) { EXPECT_TRUE(has(error_with_helper("exec sleep 100"), "stopped after 4 s")); }

TEST(ImportProcess, AMissingHelperIsNamed) {
  const Folder folder;
  write_glb(folder / "a.glb");
  expect_error(try_path(folder / "a.glb", {.helpers = folder / ""}).error, "kuafu-import-gltf");
}

TEST(ImportProcess, AHostThatIgnoresItsChildrenLoadsAllTheSame) {
  const Folder folder;
  write_glb(folder / "a.glb");
  const auto before = std::signal(SIGCHLD, SIG_IGN);
  Scene scene;
  EXPECT_NO_THROW(load_file(scene, folder / "a.glb", glm::dmat4(1.0)));
  std::signal(SIGCHLD, before);
}

TEST(ImportProcess, ThreadsLoadAtOnceAndLeaveNoChildAndNoFile) {
  const Folder folder;
  write_glb(folder / "a.glb");
  const size_t before = ks::test::open_files();
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t)
    threads.emplace_back([&] {
      for (int i = 0; i < 5; ++i) {
        Scene scene;
        load_file(scene, folder / "a.glb", glm::dmat4(1.0));
        EXPECT_EQ(scene.meshes().size(), 1u);
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(ks::test::open_files(), before);
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "a child was left";
}

TEST(ImportProcess, HostsFilesAreNotPassedOn) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);  // without O_CLOEXEC, as hosts have them
  EXPECT_TRUE(has(
      error_with_helper(
          "for f in /proc/self/fd/*; do case $(basename $f) in [4-9]|1[0-9]) readlink $f | grep -q pipe: && exit 9;; esac; done; exit 5"),
      "status 5"));
  close(ends[0]), close(ends[1]);
}

Scene small_scene() {
  Scene scene;
  Texture texture{.name = "t", .width = 2, .height = 1, .channels = 3, .format = Texture::Format::u16, .srgb = true};
  for (uint8_t i = 0; i < 12; ++i) texture.texels.push_back(i);
  scene.add_texture(texture);
  Material material;
  material.name = "m";
  material.base_color = {0.1f, 0.2f, 0.3f, 0.4f};
  material.ior = 1.7f;
  material.thin_walled = true;
  material.subsurface_radius_m = {1, 2, 3};
  material.ir_subsurface_radius_m = 4.0f;
  material.specular_texture = 0;
  material.ir_albedo = 0.25f;
  scene.add_material(material);
  scene.add_mesh({.name = "q",
                  .positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
                  .normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}},
                  .uvs = {{0, 0}, {1, 0}, {0, 1}},
                  .indices = {{0, 1, 2}},
                  .slots = {0}});
  Instance instance{.name = "i", .mesh = 0, .materials = {0, none}};
  instance.local_to_world[3] = {1, 2, 3, 1};
  scene.add_instance(instance);
  Light light{{.name = "l", .kind = Light::Kind::spot, .intensity = {1, 2, 3}}};
  light.inner_rad = 0.1, light.outer_rad = 0.2, light.ir_intensity = 0.5f, light.ir_share = 3.0;
  scene.add_light(light);
  Camera camera{.name = "c"};
  camera.near_m = 0.25;
  scene.add_camera(camera);
  return scene;
}

template <class Write>
std::vector<char> written(const Write& write) {
  char* bytes = nullptr;
  size_t size = 0;
  std::FILE* file = open_memstream(&bytes, &size);
  write(file);
  std::fclose(file);
  std::vector<char> out(bytes, bytes + size);
  free(bytes);
  return out;
}

std::vector<char> sent(const Scene& scene, const std::vector<std::string>& warnings) {
  return written([&](std::FILE* file) { write_answer(file, scene, warnings); });
}

ImportAnswer received(const std::vector<char>& bytes, uint64_t most = 1 << 20) {
  size_t at = 0;
  return read_answer(
      [&](void* to, size_t size) {
        if (size > bytes.size() - at) ks::fail(KS_ERROR_FILE, "the end");
        if (size > 0) std::memcpy(to, bytes.data() + at, size);
        at += size;
      },
      most);
}

TEST(Wire, ASceneArrivesAsItWasSent) {
  const Scene before = small_scene();
  const ImportAnswer answer = received(sent(before, {"first", "second"}));
  EXPECT_EQ(answer.warnings, (std::vector<std::string>{"first", "second"}));
  EXPECT_EQ(sent(answer.scene, answer.warnings), sent(before, {"first", "second"})) << "sent again it is the same bytes";
  const Scene& scene = answer.scene;
  EXPECT_EQ(scene.textures()[0].texels, before.textures()[0].texels);
  EXPECT_TRUE(scene.textures()[0].srgb);
  const Material& material = scene.materials()[0];
  EXPECT_EQ(material.base_color, before.materials()[0].base_color);
  EXPECT_EQ(material.ir_subsurface_radius_m, 4.0f);
  EXPECT_EQ(material.specular_texture, 0u);
  EXPECT_TRUE(material.thin_walled);
  EXPECT_EQ(scene.meshes()[0].uvs, before.meshes()[0].uvs);
  EXPECT_EQ(scene.instances()[0].local_to_world, before.instances()[0].local_to_world);
  EXPECT_EQ(scene.instances()[0].materials, (std::vector<uint32_t>{0, none}));
  EXPECT_EQ(scene.lights()[0].outer_rad, 0.2);
  EXPECT_EQ(scene.lights()[0].ir_share, 3.0);
  EXPECT_EQ(scene.cameras()[0].near_m, 0.25);
}

// A library refuses a helper of another version by the first word alone: it holds the weight of one record of each kind.
TEST(Wire, AFormatThatGrowsHasANewFirstWord) {
  const Scene scene = small_scene();
  Scene more = small_scene();
  more.add_material(scene.materials()[0]);
  more.add_light(scene.lights()[0]);
  more.add_camera(scene.cameras()[0]);
  const std::vector<char> bytes = sent(scene, {});
  const size_t names = 3 * (sizeof(uint64_t) + 1), fields = sent(more, {}).size() - bytes.size() - names;
  uint16_t weight;
  std::memcpy(&weight, &bytes[2], sizeof weight);
  EXPECT_EQ(std::string(bytes.data(), 2), "IM");
  EXPECT_GT(weight, fields);
}

TEST(Wire, AnOldHelperIsTold) {
  std::vector<char> bytes = sent(small_scene(), {});
  bytes[3] = '3';
  EXPECT_ERROR(received(bytes), KS_ERROR_FILE, "another version than the library");
}

TEST(Wire, AFailureArrivesAsOneLine) {
  const std::string text = "not\nthis " + std::string(100000, 'x');
  try {
    received(written([&](std::FILE* file) { write_failure(file, KS_ERROR_UNSUPPORTED, text); }));
    ADD_FAILURE() << "accepted";
  } catch (const ks::Error& error) {
    EXPECT_EQ(error.status(), KS_ERROR_UNSUPPORTED);
    EXPECT_EQ(std::string(error.what()).find("not this x"), 0u);
    EXPECT_LE(std::strlen(error.what()), longest_text_bytes);
  }
}

TEST(Wire, TruncatedAndChangedAnswersAreErrorsOrScenesThatPassTheChecks) {
  const std::vector<char> whole = sent(small_scene(), {"w"});
  for (size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(received({whole.begin(), whole.begin() + static_cast<long>(size)}), ks::Error) << size;
  std::mt19937 random(1);
  int refused = 0;
  for (int round = 0; round < 3000; ++round) {
    std::vector<char> bytes = whole;
    for (unsigned n = 1 + random() % 3; n > 0; --n) bytes[random() % bytes.size()] = static_cast<char>(random());
    try {
      received(bytes);
    } catch (const ks::Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 300);
}

TEST(Wire, SizesBeyondTheBoundTakeNoMemory) {
  const std::vector<char> whole = sent(small_scene(), {});
  EXPECT_THROW(received(whole, 100), ks::Error);
}

}  // namespace
