// SPDX-License-Identifier: Apache-2.0
// Compiled pipelines between processes: what is kept, where, and what a spoilt file or folder does.
#include "device/cache_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <thread>

#include "capi/device/devices.h"
#include "device/compute.h"
#include "device/pipeline_cache.h"
#include "spirv/multiply.h"

namespace ks {
namespace {

namespace fs = std::filesystem;

class CacheFile : public testing::Test {
 protected:
  void SetUp() override {
    char name[] = "/tmp/ks_cache_XXXXXX";
    ASSERT_NE(mkdtemp(name), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    fs::permissions(folder_, fs::perms::owner_all);
    fs::remove_all(folder_);
  }
  [[nodiscard]] std::vector<fs::path> files() const {
    std::vector<fs::path> found;
    for (const auto& entry : fs::recursive_directory_iterator(folder_))
      if (entry.is_regular_file()) found.push_back(entry.path());
    return found;
  }
  fs::path folder_;
};

std::vector<std::byte> some_bytes(size_t count, uint8_t first) {
  std::vector<std::byte> bytes(count);
  for (size_t i = 0; i < count; ++i) bytes[i] = std::byte(uint8_t(first + 7 * i));
  return bytes;
}

TEST_F(CacheFile, what_was_written_is_read_and_a_new_one_replaces_it) {
  const fs::path file = folder_ / "a" / "b" / "file";
  EXPECT_FALSE(read_cache_file(file));
  for (const size_t size : {size_t(0), size_t(1), size_t(100000)}) {
    ASSERT_TRUE(write_cache_file(file, some_bytes(size, 3)));
    EXPECT_EQ(read_cache_file(file), some_bytes(size, 3));
  }
  EXPECT_EQ(files().size(), 1u) << "nothing is left beside it";
}

TEST_F(CacheFile, a_file_cut_short_lengthened_or_altered_anywhere_reads_as_nothing) {
  const fs::path file = folder_ / "file";
  ASSERT_TRUE(write_cache_file(file, some_bytes(50, 1)));
  std::ifstream in(file, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), {});
  const auto spoilt = [&](const std::string& text) {
    std::ofstream(file, std::ios::binary | std::ios::trunc) << text;
    return !read_cache_file(file);
  };
  EXPECT_FALSE(spoilt(whole));
  for (size_t i = 0; i < whole.size(); ++i) {
    std::string changed = whole;
    changed[i] ^= 0x10;
    EXPECT_TRUE(spoilt(changed)) << "byte " << i;
    EXPECT_TRUE(spoilt(whole.substr(0, i))) << i << " bytes";
  }
  EXPECT_TRUE(spoilt(whole + "x"));
  std::string huge = whole;
  huge[15] = 0x7f;  // the length's highest byte
  EXPECT_TRUE(spoilt(huge));
}

TEST_F(CacheFile, what_is_no_file_reads_as_nothing_and_cannot_be_written) {
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_FALSE(read_cache_file(folder_ / "pipe"));
  EXPECT_FALSE(read_cache_file(folder_));
  EXPECT_FALSE(write_cache_file(folder_, some_bytes(3, 0)));
  EXPECT_FALSE(write_cache_file(folder_ / "pipe" / "below", some_bytes(3, 0)));
}

/// While it lives, no file of this process grows beyond so many bytes: a write to a full disk ends as short.
class FullDisk {
 public:
  explicit FullDisk(rlim_t most_bytes) : ignored_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit full{std::min(most_bytes, before_.rlim_max), before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &full);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, ignored_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  void (*ignored_)(int);
  rlimit before_{};
};

TEST_F(CacheFile, on_a_full_disk_what_was_there_stays_and_nothing_is_left_beside_it) {
  const fs::path file = folder_ / "file";
  ASSERT_TRUE(write_cache_file(file, some_bytes(50, 1)));
  for (const rlim_t room : {rlim_t{0}, rlim_t{10}, rlim_t{5000}}) {  // none, a part of the header, a part of the bytes
    bool replaced = true, made = true;
    {
      const FullDisk full(room);
      replaced = write_cache_file(file, some_bytes(100000, 2));
      made = write_cache_file(folder_ / "new", some_bytes(100000, 3));
    }
    EXPECT_FALSE(replaced || made) << room;
    EXPECT_EQ(read_cache_file(file), some_bytes(50, 1)) << room;
    EXPECT_EQ(files().size(), 1u) << room;
  }
}

TEST_F(CacheFile, many_writers_leave_one_whole_file) {
  const fs::path file = folder_ / "file";
  std::vector<std::thread> writers;
  for (uint8_t t = 0; t < 4; ++t)
    writers.emplace_back([&, t] {
      for (int i = 0; i < 20; ++i) {
        EXPECT_TRUE(write_cache_file(file, some_bytes(5000, t)));
        const auto read = read_cache_file(file);
        ASSERT_TRUE(read);
        EXPECT_EQ(*read, some_bytes(5000, uint8_t(read->front())));
      }
    });
  for (std::thread& t : writers) t.join();
  EXPECT_EQ(files().size(), 1u);
}

/// A process' device that builds one pipeline and runs it.
void build_one(const std::string& folder, const char* library = "test-1") {
  ks_device_desc desc = ks_device_desc_init();
  desc.worker_count = 1;
  desc.cache_directory = folder.c_str();
  const auto device = Device::create(desc, library);
  struct Push {
    uint64_t from, to;
    uint32_t count, multiplier;
  };
  const uint32_t factor[] = {3};
  const ComputePipeline pipeline(*device, multiply_spirv, sizeof(Push), factor);
  const uint32_t five = 5;
  uint32_t result = 0;
  const auto buffer = Buffer::create(device, 4, KS_BUFFER_HOST_VISIBLE);
  buffer->write(0, &five, 4);
  Commands commands(device);
  commands.dispatch(pipeline, Push{buffer->address(), buffer->address(), 1, 2}, 1);
  commands.flush();
  buffer->read(0, &result, 4);
  EXPECT_EQ(result, 30u);
}

TEST_F(CacheFile, a_device_keeps_its_pipelines_in_a_file_that_the_next_one_takes) {
  build_one(folder_ / "new");
  ASSERT_EQ(files().size(), 1u);
  const fs::path file = files()[0];
  EXPECT_EQ(file.filename().string().rfind("test-1-", 0), 0u) << file;
  const auto kept = read_cache_file(file);
  ASSERT_TRUE(kept && !kept->empty());
  const auto written = fs::last_write_time(file);
  build_one(folder_ / "new");
  EXPECT_EQ(fs::last_write_time(file), written) << "nothing was new, so nothing is written";
  EXPECT_EQ(files().size(), 1u);
}

TEST_F(CacheFile, spoilt_or_foreign_data_is_built_over) {
  build_one(folder_);
  const fs::path file = files().at(0);
  const auto kept = read_cache_file(file);
  std::ofstream(file, std::ios::binary | std::ios::trunc) << "not a cache";
  build_one(folder_);
  EXPECT_EQ(read_cache_file(file), kept);
  for (const size_t size : {size_t(0), size_t(7), kept->size() + 1}) {  // sound files of which the driver can make nothing
    ASSERT_TRUE(write_cache_file(file, some_bytes(size, 9)));
    build_one(folder_);
    EXPECT_EQ(read_cache_file(file), kept) << size;
  }
}

TEST_F(CacheFile, without_a_folder_or_with_one_that_cannot_be_made_a_device_works_the_same) {
  const fs::path before = fs::current_path();
  fs::current_path(folder_);
  build_one("");
  build_one("kept", nullptr);
  build_one("/proc/none/of/this");
  std::ofstream(folder_ / "a_file") << "in the way";
  build_one(folder_ / "a_file" / "below");
  fs::current_path(before);
  EXPECT_EQ(files().size(), 1u) << "only the file in the way";
}

TEST_F(CacheFile, on_a_full_disk_a_device_works_the_same) {
  {
    const FullDisk full(10);
    build_one(folder_);
  }
  EXPECT_TRUE(files().empty());
}

TEST(CacheFolder, follows_the_asked_one_then_XDG_then_home) {
  const std::string old_cache = getenv("XDG_CACHE_HOME") ? getenv("XDG_CACHE_HOME") : "", old_home = getenv("HOME") ? getenv("HOME") : "";
  setenv("HOME", "/home/me", 1);
  setenv("XDG_CACHE_HOME", "/cache", 1);
  EXPECT_EQ(cache_folder("mine"), "mine");
  EXPECT_EQ(cache_folder(""), "");
  EXPECT_EQ(cache_folder(nullptr), "/cache/activestereo");
  setenv("XDG_CACHE_HOME", "relative", 1);
  EXPECT_EQ(cache_folder(nullptr), "/home/me/.cache/activestereo");
  unsetenv("XDG_CACHE_HOME");
  unsetenv("HOME");
  EXPECT_EQ(cache_folder(nullptr), "");
  if (!old_home.empty()) setenv("HOME", old_home.c_str(), 1);
  if (!old_cache.empty()) setenv("XDG_CACHE_HOME", old_cache.c_str(), 1);
}

TEST(PipelineFileName, tells_libraries_versions_devices_and_drivers_apart) {
  VkPhysicalDeviceProperties device{};
  const std::string first = pipeline_file_name("kuafu-1.0", device);
  EXPECT_NE(first, pipeline_file_name("simsense-1.0", device));
  EXPECT_NE(first, pipeline_file_name("kuafu-1.1", device));
  device.driverVersion = 1;
  EXPECT_NE(first, pipeline_file_name("kuafu-1.0", device));
  device.driverVersion = 0;
  device.pipelineCacheUUID[15] = 1;
  EXPECT_NE(first, pipeline_file_name("kuafu-1.0", device));
}

}  // namespace
}  // namespace ks
