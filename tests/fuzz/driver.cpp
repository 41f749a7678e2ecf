// SPDX-License-Identifier: Apache-2.0
// main() of the fuzz programs where libFuzzer is not: fuzz_x [-runs=N] [-seconds=S] [-seed=N] [-keep=FOLDER] FILE_OR_FOLDER...
// It replays the given inputs, then changes them at random, under a seed. An input that reaches code which none before it reached joins
// those that are changed (and is written to the folder `keep`); code that is compiled with -fsanitize-coverage=trace-pc reports where it
// is. An input that breaks the program, or takes a minute, is left in the file fuzz_x_input.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);
extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*callback)());

namespace {

using Input = std::vector<uint8_t>;

constexpr size_t most_changed_bytes = 1 << 13;  // of one that is made
constexpr unsigned seconds_of_an_input = 60;

// ---- code that was reached ----

std::array<uint8_t, 1 << 18> reached;
size_t new_places = 0;

}  // namespace

/// Called at the beginning of every basic block. It is not to be instrumented itself.
extern "C" __attribute__((no_sanitize_coverage)) void __sanitizer_cov_trace_pc() {
  uint8_t& place = reached[(reinterpret_cast<uintptr_t>(__builtin_return_address(0)) >> 1) % reached.size()];
  new_places += 1 - place;
  place = 1;
}

// What libFuzzer is told besides, of code that both kinds of programs share.
extern "C" {
void __sanitizer_cov_trace_cmp1(uint8_t, uint8_t) {}
void __sanitizer_cov_trace_cmp2(uint16_t, uint16_t) {}
void __sanitizer_cov_trace_cmp4(uint32_t, uint32_t) {}
void __sanitizer_cov_trace_cmp8(uint64_t, uint64_t) {}
void __sanitizer_cov_trace_const_cmp1(uint8_t, uint8_t) {}
void __sanitizer_cov_trace_const_cmp2(uint16_t, uint16_t) {}
void __sanitizer_cov_trace_const_cmp4(uint32_t, uint32_t) {}
void __sanitizer_cov_trace_const_cmp8(uint64_t, uint64_t) {}
void __sanitizer_cov_trace_cmpf(float, float) {}
void __sanitizer_cov_trace_cmpd(double, double) {}
void __sanitizer_cov_trace_switch(uint64_t, uint64_t*) {}
}

namespace {

// ---- changes of an input ----

class Changes {
 public:
  explicit Changes(uint64_t seed) : random_(seed) {}
  size_t below(size_t count) { return count == 0 ? 0 : random_() % count; }

  /// To begin from where nothing is given.
  std::vector<Input> random_inputs() {
    std::vector<Input> inputs(64, Input(1024));
    for (Input& input : inputs)
      for (uint8_t& byte : input) byte = static_cast<uint8_t>(random_());
    return inputs;
  }

  /// Another input made of this one, with parts of `other`.
  Input change(Input input, const Input& other) {
    for (size_t n = size_t{1} << below(4); n > 0; --n) change_once(input, other);
    if (input.size() > most_changed_bytes) input.resize(most_changed_bytes);
    return input;
  }

 private:
  void change_once(Input& input, const Input& other) {
    static constexpr char likely[] = "0123456789-+.eE\"{}[]<>,:/# \n";
    static constexpr std::array<uint64_t, 10> odd{0,          1,          0x7f,       0x80,       0xffff,
                                                  0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000, 0x7ff0000000000000};
    const size_t at = below(input.size() + 1);
    const size_t left = input.size() - at;
    switch (below(9)) {
      case 0:
        if (left > 0) input[at] ^= static_cast<uint8_t>(1u << below(8));
        break;
      case 1:
        if (left > 0) input[at] = static_cast<uint8_t>(random_());
        break;
      case 2:
        if (left > 0) input[at] = static_cast<uint8_t>(likely[below(sizeof likely - 1)]);
        break;
      case 3:
        if (left > 0) input[at] = static_cast<uint8_t>(input[at] + below(9) - 4);
        break;
      case 4: {
        const uint64_t value = odd[below(odd.size())];
        std::memcpy(input.data() + at, &value, std::min<size_t>(left, size_t{1} << below(4)));
        break;
      }
      case 5:
        input.erase(input.begin() + at, input.begin() + at + below(std::min<size_t>(left, 64) + 1));
        break;
      case 6:
        input.insert(input.begin() + at, 1 + below(8), static_cast<uint8_t>(random_()));
        break;
      case 7: {
        const size_t from = below(input.size()), count = below(std::min<size_t>(input.size() - std::min(from, input.size()), 64) + 1);
        const Input part(input.begin() + from, input.begin() + from + count);
        input.insert(input.begin() + at, part.begin(), part.end());
        break;
      }
      default: {
        const size_t from = below(other.size()), count = below(other.size() - std::min(from, other.size()) + 1);
        input.resize(at);
        input.insert(input.end(), other.begin() + from, other.begin() + from + count);
      }
    }
  }

  std::mt19937_64 random_;
};

// ---- the input under test ----

const Input* under_test = nullptr;
std::string input_file;

/// Called when the program is about to end by what the input did. Uses nothing that could be broken by then.
void keep_input() {
  const int fd = open(input_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (fd < 0 || under_test == nullptr) return;
  const ssize_t written = write(fd, under_test->data(), under_test->size());
  close(fd);
  std::fprintf(stderr, "the input, %zd bytes, is in %s\n", written, input_file.c_str());
}

void keep_input_and_end(int signal) {
  keep_input();
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

/// The sanitizers have handlers of their own for what they report.
void keep_inputs_that_break() {
  std::signal(SIGABRT, keep_input_and_end);
  std::signal(SIGALRM, keep_input_and_end);
  if (__sanitizer_set_death_callback != nullptr) return __sanitizer_set_death_callback(keep_input);
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP}) std::signal(signal, keep_input_and_end);
}

/// Runs one input. Returns whether it reached new code.
bool run(const Input& input) {
  under_test = &input;
  new_places = 0;
  alarm(seconds_of_an_input);
  (void)LLVMFuzzerTestOneInput(input.data(), input.size());
  alarm(0);
  return new_places > 0;
}

std::vector<Input> read_inputs(const std::vector<std::string>& places) {
  std::vector<std::filesystem::path> files;
  for (const std::string& place : places) {
    if (!std::filesystem::is_directory(place)) {
      files.emplace_back(place);
      continue;
    }
    for (const auto& entry : std::filesystem::directory_iterator(place)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<Input> inputs;
  for (const auto& file : files) {
    std::ifstream in(file, std::ios::binary);
    if (!in) std::printf("%s: cannot be read\n", file.c_str()), std::exit(2);
    inputs.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return inputs;
}

}  // namespace

int main(int argc, char** argv) {
  uint64_t runs = 0, seed = 1;
  double seconds = 1e9;
  std::string keep;
  std::vector<std::string> places;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::string value = argument.substr(argument.find('=') + 1);
    if (argument.starts_with("-runs="))
      runs = std::stoull(value);
    else if (argument.starts_with("-seconds="))
      seconds = std::stod(value), runs = UINT64_MAX;
    else if (argument.starts_with("-seed="))
      seed = std::stoull(value);
    else if (argument.starts_with("-keep="))
      keep = value;
    else
      places.push_back(argument);
  }
  std::vector<Input> inputs = read_inputs(places);
  const size_t given = inputs.size();
  input_file = std::filesystem::path(argv[0]).filename().string() + "_input";
  keep_inputs_that_break();
  for (const Input& input : inputs) run(input);
  Changes changes(seed);
  if (inputs.empty()) inputs = changes.random_inputs();
  const auto begin = std::chrono::steady_clock::now();
  uint64_t done = 0;
  size_t reached_new = 0;
  for (; done < runs; ++done) {
    if (done % 16 == 0 && std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() > seconds) break;
    Input input = changes.change(inputs[changes.below(inputs.size())], inputs[changes.below(inputs.size())]);
    if (!run(input)) continue;
    ++reached_new;
    if (!keep.empty())
      std::ofstream(keep + "/" + std::to_string(seed) + "_" + std::to_string(done), std::ios::binary)
          .write(reinterpret_cast<const char*>(input.data()), static_cast<std::streamsize>(input.size()));
    inputs.push_back(std::move(input));
  }
  std::printf("%zu inputs replayed, %llu made of them (seed %llu), %zu reached new code, %zu places in all\n", given,
              static_cast<unsigned long long>(done), static_cast<unsigned long long>(seed), reached_new,
              static_cast<size_t>(std::count(reached.begin(), reached.end(), 1)));
  return given == 0 && !places.empty() ? 2 : 0;
}
