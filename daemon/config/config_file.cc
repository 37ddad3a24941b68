// Reads the TOML file with line and column numbers, and prints it.
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <set>
#include <sstream>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "common/text/suggest.h"
#include "common/toml/parse_toml.h"
#include "daemon/config/config.h"
#include "daemon/config/fields.h"
#include "display/profiles/toml_options.h"

namespace voxeld::daemon {
namespace {

// Returns: a value as it appears in the file, for messages.
std::string Show(const toml::node& node) {
  if (node.is_table()) return "a table";
  if (node.is_array()) return "an array";
  std::ostringstream out;
  node.visit([&out](const auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if constexpr (toml::is_value<Value>) out << toml::toml_formatter{value};
  });
  return out.str();
}

std::string Plain(double value) {
  std::ostringstream out;
  out << toml::toml_formatter{toml::value<double>(value)};
  return out.str();
}

class FileReader {
 public:
  FileReader(const toml::table& root, const std::string& name, Config* config)
      : root_(root), name_(name) {
    VisitFields(*config, *this);
    EndSection();
    ReadDisplays(config);
    CheckKeys(root_, "", known_sections_);
  }

  absl::Status status() const {
    if (errors_.empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrJoin(errors_, "\n"));
  }

  // ---- the visitor of VisitFields

  void Section(const char* section) {
    EndSection();
    section_ = section;
    known_sections_.push_back(section);
    const toml::node* node = root_.get(section);
    if (node == nullptr) return;
    table_ = node->as_table();
    if (table_ == nullptr)
      Wrong(*node, section, absl::StrCat("is ", Show(*node), "; write [", section, "]"));
  }

  void Listen(const char* key, std::vector<Address>& out) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const toml::array* items = node->as_array();
    if (items == nullptr || items->empty()) {
      return Wrong(*node, key,
                   absl::StrCat("is ", Show(*node),
                                "; give an array of addresses, such as "
                                "[\"127.0.0.1:50551\"]"));
    }
    std::vector<Address> addresses;
    for (const toml::node& item : *items) {
      const auto text = item.value_exact<std::string>();
      if (!text.has_value()) {
        Wrong(item, key, absl::StrCat("has ", Show(item), "; give addresses as text"));
        continue;
      }
      absl::StatusOr<Address> address = ParseAddress(*text);
      if (!address.ok()) {
        Wrong(item, key, absl::StrCat("is refused: ", address.status().message()));
        continue;
      }
      addresses.push_back(*std::move(address));
    }
    out = std::move(addresses);
  }

  void Http(const char* key, std::optional<Address>& out, bool& asked) {
    const std::optional<std::string> text = QuotedText(key);
    if (!text.has_value()) return;
    absl::StatusOr<std::optional<Address>> address = ParseHttp(*text);
    if (!address.ok()) {
      return Wrong(*Find(key), key, absl::StrCat("is refused: ", address.status().message()));
    }
    out = *std::move(address);
    asked = true;
  }

  void LocalSocket(const char* key, std::string& out) {
    std::optional<std::string> text = QuotedText(key);
    if (!text.has_value()) return;
    if (absl::Status status = CheckLocalSocket(*text); !status.ok()) {
      return Wrong(*Find(key), key, absl::StrCat("is refused: ", status.message()));
    }
    out = *std::move(text);
  }

  void Program(const char* key, std::string& out) {
    std::optional<std::string> text = QuotedText(key);
    if (!text.has_value()) return;
    if (text->starts_with("unix:") && !text->starts_with("unix:/")) {
      return Wrong(
          *Find(key), key,
          absl::StrCat("is \"", EscapeQuoted(*text),
                       "\", which is no absolute path; give a program's file, or unix: and "
                       "a socket's absolute path"));
    }
    out = *std::move(text);
  }

  void Scopes(const char* key, std::string& out, bool auto_too) {
    std::optional<std::string> text = QuotedText(key);
    if (!text.has_value()) return;
    if (absl::Status status = CheckScopes(*text, auto_too); !status.ok()) {
      return Wrong(*Find(key), key, absl::StrCat("is refused: ", status.message()));
    }
    out = *std::move(text);
  }

  void Choice(const char* key, std::string& out, std::initializer_list<const char*> values) {
    const std::optional<std::string> text = QuotedText(key);
    if (!text.has_value()) return;
    const std::vector<std::string> known(values.begin(), values.end());
    if (std::find(known.begin(), known.end(), *text) == known.end()) {
      return Wrong(*Find(key), key, absl::StrCat("is \"", *text, "\"", Suggestion(*text, known)));
    }
    out = *text;
  }

  void Engine(const char* key, gpu::EngineKind& out) {
    const std::optional<std::string> text = QuotedText(key);
    if (!text.has_value()) return;
    const absl::StatusOr<gpu::EngineKind> kind = ParseEngineKind(*text);
    if (!kind.ok()) return Wrong(*Find(key), key, std::string(kind.status().message()));
    out = *kind;
  }

  template <typename T>
  void Integer(const char* key, T& out, int64_t least, int64_t greatest) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<int64_t>();
    if (!value.has_value() || *value < least || *value > greatest) {
      return Wrong(
          *node, key,
          absl::StrCat("is ", Show(*node), "; give an integer from ", least, " to ", greatest));
    }
    out = static_cast<T>(*value);
  }

  void Real(const char* key, double& out, double least, double greatest) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const auto value = node->is_number() ? node->value<double>() : std::nullopt;
    if (!value.has_value() || !(*value >= least && *value <= greatest)) {
      return Wrong(*node, key,
                   absl::StrCat("is ", Show(*node), "; give a number from ", least, " to ",
                                Plain(greatest)));
    }
    out = *value;
  }

  void Flag(const char* key, bool& out) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<bool>();
    if (!value.has_value()) {
      return Wrong(*node, key, absl::StrCat("is ", Show(*node), "; give true or false"));
    }
    out = *value;
  }

  void Text(const char* key, std::string& out) {
    if (std::optional<std::string> text = QuotedText(key)) out = *std::move(text);
  }

 private:
  const toml::node* Find(const char* key) {
    if (std::find(known_keys_.begin(), known_keys_.end(), key) == known_keys_.end()) {
      known_keys_.push_back(key);
    }
    return table_ == nullptr ? nullptr : table_->get(key);
  }

  std::optional<std::string> QuotedText(const char* key) {
    const toml::node* node = Find(key);
    if (node == nullptr) return {};
    auto text = node->value_exact<std::string>();
    if (!text.has_value())
      Wrong(*node, key, absl::StrCat("is ", Show(*node), "; give text in quotes"));
    return text;
  }

  void EndSection() {
    if (table_ != nullptr) CheckKeys(*table_, section_, known_keys_);
    table_ = nullptr;
    known_keys_.clear();
  }

  void CheckKeys(const toml::table& table, const std::string& section,
                 const std::vector<std::string>& known) {
    for (const auto& [key, node] : table) {
      const std::string text(key.str());
      if (std::find(known.begin(), known.end(), text) != known.end()) continue;
      Error(key.source(), absl::StrCat("unknown key ", section.empty() ? "" : section + ".", text,
                                       Suggestion(text, known)));
    }
  }

  void ReadDisplays(Config* config) {
    known_sections_.push_back("display");
    const toml::node* node = root_.get("display");
    if (node == nullptr) return;
    section_ = "display";
    const toml::array* tables = node->as_array();
    if (tables == nullptr || (!tables->empty() && !tables->is_homogeneous<toml::table>())) {
      return Error(node->source(),
                   "display is no list of tables; write [[display]] for each, or display = [] for "
                   "none");
    }
    config->displays.clear();
    std::set<std::string> names;
    for (const toml::node& item : *tables) {
      DisplayConfig display = ReadDisplay(*item.as_table());
      if (!display.name.empty() && !names.insert(display.name).second) {
        Error(item.source(), absl::StrCat("there are two displays named \"", display.name,
                                          "\"; give each its own name"));
      }
      config->displays.push_back(std::move(display));
    }
  }

  DisplayConfig ReadDisplay(const toml::table& table) {
    DisplayConfig config;
    config.source = Where(table.source());
    for (const auto& [key, node] : table) {
      const std::string text(key.str());
      const std::optional<std::string> value = display::OptionText(node);
      if (!value.has_value()) {
        Wrong(node, text, "is no text, number, boolean, or array of these");
      } else if (text == "name") {
        if (absl::Status status = CheckDisplayName(*value); !status.ok()) {
          Wrong(node, text, absl::StrCat("is refused: ", status.message()));
        }
        config.name = *value;
      } else if (text == "driver") {
        config.driver = *value;
      } else {
        config.options.emplace(text, *value);
      }
    }
    for (const auto& [key, value] : {std::pair("name", &config.name), {"driver", &config.driver}}) {
      if (value->empty()) {
        Error(table.source(), absl::StrCat("a display without ", key, "; give name and driver"));
      }
    }
    return config;
  }

  std::string Where(const toml::source_region& source) const {
    return absl::StrCat(name_, ":", source.begin.line, ":", source.begin.column);
  }

  // Adds a fault as one line of printable text, whatever keys and values contain.
  void Error(const toml::source_region& source, const std::string& text) {
    errors_.push_back(absl::StrCat(Where(source), ": ", EscapeControls(text)));
  }

  void Wrong(const toml::node& node, const std::string& key, const std::string& text) {
    const bool inside = key != section_;
    Error(node.source(), absl::StrCat(inside ? section_ + "." : "", key, " ", text));
  }

  const toml::table& root_;
  const std::string& name_;
  std::string section_;
  const toml::table* table_ = nullptr;  // of the section; null if it does not exist
  std::vector<std::string> known_sections_, known_keys_;
  std::vector<std::string> errors_;
};

class Printer {
 public:
  explicit Printer(std::string* out) : out_(*out) {}

  void Section(const char* section) { absl::StrAppend(&out_, "\n[", section, "]\n"); }
  void Listen(const char* key, const std::vector<Address>& addresses) {
    absl::StrAppend(&out_, key, " = [",
                    absl::StrJoin(addresses, ", ",
                                  [](std::string* out, const Address& address) {
                                    absl::StrAppend(out, Quoted(address.ToString()));
                                  }),
                    "]\n");
  }
  void Http(const char* key, const std::optional<Address>& address, bool) {
    Line(key, Quoted(address.has_value() ? address->ToString() : "off"));
  }
  void LocalSocket(const char* key, const std::string& value) { Line(key, Quoted(value)); }
  void Program(const char* key, const std::string& value) { Line(key, Quoted(value)); }
  void Choice(const char* key, const std::string& value, std::initializer_list<const char*>) {
    Line(key, Quoted(value));
  }
  void Engine(const char* key, gpu::EngineKind kind) { Line(key, Quoted(EngineKindText(kind))); }
  template <typename T>
  void Integer(const char* key, T value, int64_t, int64_t) {
    Line(key, absl::StrCat(value));
  }
  void Real(const char* key, double value, double, double) { Line(key, Plain(value)); }
  void Flag(const char* key, bool value) { Line(key, value ? "true" : "false"); }
  void Text(const char* key, const std::string& value) { Line(key, Quoted(value)); }
  void Scopes(const char* key, const std::string& value, bool) { Line(key, Quoted(value)); }

  void Display(const DisplayConfig& display) {
    absl::StrAppend(&out_, "\n[[display]]\n");
    Line("name", Quoted(display.name));
    Line("driver", Quoted(display.driver));
    for (const auto& [key, value] : display.options) Line(BareOrQuoted(key), Quoted(value));
  }

 private:
  static std::string Quoted(const std::string& text) {
    std::ostringstream out;
    out << toml::toml_formatter{toml::value<std::string>(text)};
    return out.str();
  }
  static std::string BareOrQuoted(const std::string& key) {
    const bool bare = !key.empty() && std::all_of(key.begin(), key.end(), [](unsigned char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
             c == '_' || c == '-';
    });
    return bare ? key : Quoted(key);
  }
  void Line(const std::string& key, const std::string& value) {
    absl::StrAppend(&out_, key, " = ", value, "\n");
  }

  std::string& out_;
};

}  // namespace

absl::Status ReadConfigText(std::string_view text, const std::string& name, Config* config) {
  const absl::StatusOr<toml::table> root = ParseToml(text, name);
  if (!root.ok()) return root.status();
  absl::Status status = FileReader(*root, name, config).status();
  if (status.ok()) config->file = name;
  return status;
}

std::string ToToml(const Config& config) {
  std::string out = config.file.empty() ? "# voxeld: no file was read\n"
                                        : absl::StrCat("# voxeld: from ", config.file, "\n");
  if (config.displays.empty()) out += "display = []\n";
  Printer printer(&out);
  VisitFields(config, printer);
  for (const DisplayConfig& display : config.displays) printer.Display(display);
  return out;
}

}  // namespace voxeld::daemon
