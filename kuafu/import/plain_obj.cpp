// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdio>
#include <string>

#include "import/plain_mesh.h"
#include "import/plain_text.h"

namespace kuafu {
namespace {

using View = std::string_view;

/// Positions, texture coordinates and normals, in the order in which a corner names them.
enum Kind : size_t { position, texture, normal, kinds };
constexpr std::array<const char*, kinds> kind_names = {"vertex", "texture coordinate", "normal"};

class ObjReader {
 public:
  explicit ObjReader(View file)
      : rest_(file.starts_with("\xEF\xBB\xBF") ? file.substr(3) : file), most_index_(static_cast<long long>(file.size())) {
    text_.reserve(file.size() + file.size() / 8);
  }

  PlainObj read() {
    while (!rest_.empty()) statement(next_statement());
    for (size_t k = 0; k < kinds; ++k)
      if (most_[k].index > count_[k])
        ks::fail(KS_ERROR_FILE, "line %zu: a corner names %s %llu of %llu", most_[k].line, kind_names[k],
                 static_cast<unsigned long long>(most_[k].index), static_cast<unsigned long long>(count_[k]));
    for (size_t i = 0; i < positions_.size(); ++i)
      if (i < used_.size() && used_[i]) mesh_.use(positions_[i]);
    return {mesh_, {text_.begin(), text_.end()}};
  }

 private:
  /// A line with those that it goes on in after a backslash, and without a comment where it has numbers.
  View next_statement() {
    ++line_;
    View line = take_line(rest_);
    if (!line.ends_with('\\') || first_of(line) == '#') return line;
    joined_.clear();
    while (line.ends_with('\\')) {
      joined_.append(line.substr(0, line.size() - 1)).push_back(' ');
      if (rest_.empty()) return joined_;
      ++lines_joined_;
      line = take_line(rest_);
    }
    joined_.append(line);
    return joined_;
  }

  static char first_of(View line) {
    const size_t at = line.find_first_not_of(" \t\v\f");
    return at == View::npos ? '#' : line[at];
  }

  void statement(View line) {
    View words = line;
    const View name = take_word(words);
    if (name == "v" || name == "vt" || name == "vn" || name == "f") {
      words = words.substr(0, words.find('#'));
      if (name == "f")
        face(words);
      else
        vertex(name, words);
    } else if (!name.empty() && name[0] != '#') {
      text_.append(line).push_back('\n');
    }
    line_ += lines_joined_;
    lines_joined_ = 0;
  }

  void vertex(View name, View words) {
    std::array<double, 8> number{};
    size_t count = 0;
    for (View word = take_word(words); !word.empty(); word = take_word(words)) {
      if (count == number.size()) ks::fail(KS_ERROR_FILE, "line %zu: '%.*s' has more than 7 numbers", line_, int(name.size()), name.data());
      number[count++] = parse_real(word, line_);
    }
    if (name == "v")
      add_position(number, count);
    else
      add_direction(name == "vn" ? normal : texture, number, count);
  }

  /// x y z, x y z w, either with a colour behind it.
  void add_position(std::array<double, 8>& number, size_t count) {
    if (count != 3 && count != 4 && count != 6 && count != 7)
      ks::fail(KS_ERROR_FILE, "line %zu: 'v' has %zu numbers, must have 3 (or 4 with a weight, and 3 more with a colour)", line_, count);
    const bool has_weight = count % 3 == 1;
    const double weight = has_weight ? number[3] : 1.0;
    if (weight == 0.0) ks::fail(KS_ERROR_FILE, "line %zu: a vertex has the weight 0", line_);
    positions_.emplace_back(number[0] / weight, number[1] / weight, number[2] / weight);
    begin("v");
    for (size_t i = 0; i < 3; ++i) put(positions_.back()[static_cast<int>(i)]);
    for (size_t i = count - 3; count > 4 && i < count; ++i) put(number[i]);
    text_.push_back('\n');
    ++count_[position];
  }

  void add_direction(Kind kind, const std::array<double, 8>& number, size_t count) {
    const size_t least = kind == normal ? 3 : 1, written = kind == normal ? 3 : 2;
    if (count < least)
      ks::fail(KS_ERROR_FILE, "line %zu: '%s' has %zu numbers, must have %zu", line_, kind == normal ? "vn" : "vt", count, written);
    begin(kind == normal ? "vn" : "vt");
    for (size_t i = 0; i < written; ++i) put(number[i]);
    text_.push_back('\n');
    ++count_[kind];
  }

  void face(View words) {
    const size_t start = text_.size();
    begin("f");
    uint64_t corners = 0;
    for (View word = take_word(words); !word.empty(); word = take_word(words), ++corners) corner(word);
    if (corners < 3) {  // no polygon: assimp would take it for points or a line
      text_.resize(start);
      return;
    }
    text_.push_back('\n');
    ++mesh_.faces;
    mesh_.corners += corners;
  }

  /// "7", "7/3", "7//2", "7/3/2", and with nothing behind a stroke.
  void corner(View word) {
    text_.push_back(' ');
    View rest = word;
    std::array<uint64_t, kinds> index{};
    for (size_t k = 0; k < kinds && !rest.empty(); ++k) {
      const size_t stroke = std::min(rest.find('/'), rest.size());
      if (stroke > 0) index[k] = absolute(static_cast<Kind>(k), rest.substr(0, stroke), word);
      rest.remove_prefix(std::min(stroke + 1, rest.size()));
    }
    if (index[position] == 0 || !rest.empty())
      ks::fail(KS_ERROR_FILE, "line %zu: '%.*s' is no corner", line_, static_cast<int>(std::min<size_t>(word.size(), 40)), word.data());
    text_ += std::to_string(index[position]);
    if (index[texture] != 0 || index[normal] != 0) text_.push_back('/');
    if (index[texture] != 0) text_ += std::to_string(index[texture]);
    if (index[normal] != 0) text_.append("/").append(std::to_string(index[normal]));
    if (used_.size() < index[position]) used_.resize(std::max<size_t>(index[position], positions_.size()));
    used_[index[position] - 1] = true;
  }

  /// From 1 on; a negative index counts back from what the file has had so far.
  uint64_t absolute(Kind kind, View digits, View word) {
    long long value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    const uint64_t had = count_[kind];
    if (error != std::errc() || end != digits.data() + digits.size() || value == 0 || value > most_index_ ||
        (value < 0 && static_cast<uint64_t>(-(value + 1)) >= had))
      ks::fail(KS_ERROR_FILE, "line %zu: corner '%.*s' names no %s: there are %llu so far", line_,
               static_cast<int>(std::min<size_t>(word.size(), 40)), word.data(), kind_names[kind], static_cast<unsigned long long>(had));
    const uint64_t index = value > 0 ? static_cast<uint64_t>(value) : had + 1 - static_cast<uint64_t>(-value);
    if (index > most_[kind].index) most_[kind] = {index, line_};
    return index;
  }

  void begin(const char* name) { text_.append(name); }

  void put(double value) {
    std::array<char, 32> word;
    text_.push_back(' ');
    text_.append(word.data(), static_cast<size_t>(std::snprintf(word.data(), word.size(), "%.9g", value)));
  }

  struct Most {
    uint64_t index = 0;
    size_t line = 0;
  };

  View rest_;
  long long most_index_;  // no file has more vertices than bytes
  std::string joined_, text_;
  size_t line_ = 0, lines_joined_ = 0;
  std::array<uint64_t, kinds> count_{};
  std::array<Most, kinds> most_{};
  std::vector<glm::dvec3> positions_;
  std::vector<bool> used_;
  PlainMesh mesh_;
};

}  // namespace

PlainObj plain_obj(std::string_view file) { return ObjReader(file).read(); }

}  // namespace kuafu
