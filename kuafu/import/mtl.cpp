// SPDX-License-Identifier: Apache-2.0
#include "import/phong_material.h"

#include <algorithm>
#include <optional>

#include "device/error.h"
#include "import/text.h"

namespace kuafu {
namespace {

using View = std::string_view;

struct MapName {
  const char* statement;
  PhongMap kind;
};
constexpr std::array map_names = {
    MapName{"map_kd", PhongMap::diffuse},  MapName{"map_ks", PhongMap::specular},  MapName{"map_ke", PhongMap::emission},
    MapName{"map_d", PhongMap::opacity},   MapName{"map_pr", PhongMap::roughness}, MapName{"map_emissive", PhongMap::emission},
    MapName{"map_pm", PhongMap::metallic}, MapName{"map_bump", PhongMap::height},  MapName{"bump", PhongMap::height},
    MapName{"norm", PhongMap::normal},     MapName{"map_kn", PhongMap::normal},
};

class MtlReader {
 public:
  MtlReader(Import& import, const std::string& name, std::map<std::string, PhongMaterial>& materials)
      : import_(import), name_(name), folder_(std::filesystem::path(name).parent_path().string()), materials_(materials) {}

  void read(View text) {
    while (!text.empty()) {
      ++line_;
      View words = take_line(text);
      const View word = take_word(words);
      const std::string statement = lower_case(word);
      if (statement.empty() || statement[0] == '#') continue;
      if (statement == "newmtl")
        begin(std::string(trimmed(words)));
      else if (material_ == nullptr)
        import_.warn(std::string("'") + name_ + "', line " + std::to_string(line_) + ": '" + std::string(word.substr(0, 40)) +
                     "' stands before any newmtl and is left out");
      else
        read_statement(statement, words);
    }
  }

 private:
  void begin(const std::string& material) {
    material_ = &materials_[material];
    *material_ = PhongMaterial{.name = material, .folder = folder_};
    has_d_ = false;
  }

  void read_statement(const std::string& statement, View words) {
    PhongMaterial& m = *material_;
    if (statement == "kd")
      color(m.diffuse, statement, words);
    else if (statement == "ks")
      color(m.specular, statement, words);
    else if (statement == "ke")
      color(m.emission, statement, words);
    else if (statement == "ns")
      m.shininess = number(words);
    else if (statement == "ni")
      m.ior = number(words);
    else if (statement == "illum")
      m.illum = static_cast<int>(std::clamp(number(words), 0.0f, 100.0f));
    else if (statement == "pr")
      m.roughness = number(words);
    else if (statement == "pm")
      m.metallic = number(words);
    else if (statement == "d")
      m.opacity = number(words), has_d_ = true;
    else if (statement == "tr")
      m.opacity = has_d_ ? m.opacity : 1.0f - number(words);
    else if (const auto* map = std::ranges::find(map_names, statement, &MapName::statement); map != map_names.end())
      m.map(map->kind) = image(statement, words);
    else if (statement != "ka" && statement != "tf")  // light from nowhere, and the colour that every exporter writes as 1 1 1
      left_out(std::string("'") + statement.substr(0, 40) + "' is not read");
  }

  /// After options such as "-halo".
  float number(View words) {
    View word = take_word(words);
    while (word.size() > 1 && word[0] == '-' && word[1] >= 'a') word = take_word(words);
    return static_cast<float>(parse_real(word, line_));
  }

  /// Red, green and blue; red alone is grey.
  void color(glm::vec3& to, const std::string& statement, View words) {
    const View first = take_word(words);
    if (first == "spectral" || first == "xyz") return left_out(std::string("'") + statement + " " + std::string(first) + "' is not read");
    to = glm::vec3(static_cast<float>(parse_real(first, line_)));
    for (int i = 1; i < 3; ++i)
      if (const View word = take_word(words); !word.empty()) to[i] = static_cast<float>(parse_real(word, line_));
  }

  /// The name behind the options, with its blanks: one at its end may be part of it.
  std::string image(const std::string& statement, View words) {
    for (View rest = words; trimmed(rest).starts_with('-'); words = rest) {
      const std::string option = lower_case(take_word(rest));
      const bool is_vector = option == "-o" || option == "-s" || option == "-t";
      bool changes = option == "-imfchan";
      for (size_t count = option == "-mm" ? 2 : is_vector ? 3 : 1; count > 0; --count) {
        View after = rest;
        const View value = take_word(after);
        double real = 0.0;
        const bool is_real = std::from_chars(value.data(), value.data() + value.size(), real).ptr == value.data() + value.size();
        if (is_vector && !is_real) break;
        changes |= option == "-clamp" && value != "off";
        changes |= (is_vector || option == "-mm") && real != (option == "-s" || (option == "-mm" && count == 1) ? 1.0 : 0.0);
        if (option == "-bm") material_->bump = static_cast<float>(parse_real(value, line_));
        rest = after;
      }
      if (changes) left_out(std::string("'") + option + "' of its " + statement + " is not read");
    }
    return std::string(words.substr(std::min(words.find_first_not_of(" \t"), words.size())));
  }

  void left_out(const std::string& what) { import_.warn("material '" + clean_name(material_->name) + "': " + what); }

  Import& import_;
  std::string name_, folder_;
  std::map<std::string, PhongMaterial>& materials_;
  PhongMaterial* material_ = nullptr;
  bool has_d_ = false;  // which says what Tr says the other way round, and means it more often
  size_t line_ = 0;
};

std::optional<std::string> read_library(Import& import, const std::string& name, std::map<std::string, PhongMaterial>& materials) {
  std::vector<uint8_t> bytes;
  try {
    bytes = import.folder.read(name);
  } catch (const ks::Error& error) {
    return error.what();
  }
  try {
    MtlReader(import, name, materials).read(without_mark({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
  } catch (const ks::Error& error) {
    ks::fail(error.status(), "'%s', %s", clean_name(name).c_str(), error.what());
  }
  return std::nullopt;
}

}  // namespace

void read_mtl(Import& import, const std::string& names, std::map<std::string, PhongMaterial>& materials) {
  if (names.empty()) return;
  std::optional<std::string> fault = read_library(import, names, materials);
  if (!fault) return;
  View rest = names;
  for (View word = take_word(rest); !word.empty(); word = take_word(rest)) {
    if (word.size() < names.size()) fault = read_library(import, std::string(word), materials);
    if (fault) import.warn("its materials are left out: " + *fault);
  }
}

}  // namespace kuafu
