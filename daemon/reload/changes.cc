#include "daemon/reload/changes.h"

#include <algorithm>
#include <map>
#include <set>
#include <sstream>
#include <string_view>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/config/fields.h"

namespace voxeld::daemon::reload {
namespace {

constexpr std::string_view kFieldsAtOnce[] = {"log.level", "log.max_lines_per_second"};
constexpr std::string_view kAccess[] = {"security.grants", "security.anonymous_scopes",
                                        "security.certificate_scopes", "security.unix_scopes"};
// These keys decide who can connect. Changes of permissions are not applied before changes of
// these.
constexpr std::string_view kReach[] = {"server.listen", "security.tls_certificate",
                                       "security.tls_key", "security.tls_client_ca",
                                       "security.allow_plain_beyond_loopback"};
constexpr std::string_view kDisplayOptionsAtOnce[] = {"view", "view_box", "power_limit"};

template <size_t n>
bool IsIn(const std::string_view (&list)[n], std::string_view key) {
  return std::find(std::begin(list), std::end(list), key) != std::end(list);
}

// A visitor of VisitFields that records each field's value.
class Values {
 public:
  explicit Values(const Config& config) { VisitFields(config, *this); }
  const std::vector<std::pair<std::string, std::string>>& all() const { return values_; }

  void Section(const char* section) { section_ = section; }
  void Listen(const char* key, const std::vector<Address>& addresses) {
    std::string text;
    for (const Address& address : addresses) absl::StrAppend(&text, address.ToString(), " ");
    Add(key, text);
  }
  void Http(const char* key, const std::optional<Address>& address, bool) {
    Add(key, address.has_value() ? address->ToString() : "off");
  }
  void LocalSocket(const char* key, const std::string& value) { Add(key, value); }
  void Program(const char* key, const std::string& value) { Add(key, value); }
  void Choice(const char* key, const std::string& value, std::initializer_list<const char*>) {
    Add(key, value);
  }
  void Engine(const char* key, gpu::EngineKind kind) { Add(key, EngineKindText(kind)); }
  template <typename T>
  void Integer(const char* key, T value, int64_t, int64_t) {
    Add(key, absl::StrCat(value));
  }
  void Real(const char* key, double value, double, double) { Add(key, absl::StrCat(value)); }
  void Flag(const char* key, bool value) { Add(key, value ? "true" : "false"); }
  void Text(const char* key, const std::string& value) { Add(key, value); }
  void Scopes(const char* key, const std::string& value, bool) { Add(key, value); }

 private:
  void Add(const char* key, std::string value) {
    values_.emplace_back(absl::StrCat(section_, ".", key), std::move(value));
  }

  std::string section_;
  std::vector<std::pair<std::string, std::string>> values_;
};

std::map<std::string, const DisplayConfig*> ByName(const Config& config) {
  std::map<std::string, const DisplayConfig*> displays;
  for (const DisplayConfig& display : config.displays) displays.emplace(display.name, &display);
  return displays;
}

void CompareDisplays(const std::string& prefix, const DisplayConfig& in_force,
                     const DisplayConfig& wanted, Changes* changes) {
  if (in_force.driver != wanted.driver) changes->at_restart.push_back(prefix + ".driver");
  std::set<std::string> keys;
  for (const auto* options : {&in_force.options, &wanted.options}) {
    for (const auto& [key, value] : *options) keys.insert(key);
  }
  for (const std::string& key : keys) {
    const auto before = in_force.options.find(key), after = wanted.options.find(key);
    const bool same = before != in_force.options.end() && after != wanted.options.end() &&
                      before->second == after->second;
    if (same) continue;
    auto& list = IsIn(kDisplayOptionsAtOnce, key) ? changes->at_once : changes->at_restart;
    list.push_back(absl::StrCat(prefix, ".", key));
  }
}

}  // namespace

Changes Compare(const Config& in_force, const Config& wanted) {
  Changes changes;
  const Values before(in_force), after(wanted);
  std::vector<std::string> differ;
  for (size_t i = 0; i < before.all().size(); ++i) {
    const auto& [key, value] = before.all()[i];
    if (value != after.all()[i].second) differ.push_back(key);
  }
  const auto are = [&](const auto& list) {
    return std::any_of(differ.begin(), differ.end(),
                       [&](const std::string& key) { return IsIn(list, key); });
  };
  changes.access = are(kAccess) && !are(kReach);
  for (const std::string& key : differ) {
    const bool at_once = IsIn(kFieldsAtOnce, key) || (changes.access && IsIn(kAccess, key));
    (at_once ? changes.at_once : changes.at_restart).push_back(key);
  }
  const auto displays = ByName(in_force), wanted_displays = ByName(wanted);
  std::set<std::string> names;
  for (const auto* some : {&displays, &wanted_displays}) {
    for (const auto& [name, display] : *some) names.insert(name);
  }
  for (const std::string& name : names) {
    const auto one = displays.find(name), other = wanted_displays.find(name);
    const std::string prefix = "display." + name;
    if (one == displays.end() || other == wanted_displays.end()) {
      changes.at_restart.push_back(prefix);
    } else {
      CompareDisplays(prefix, *one->second, *other->second, &changes);
    }
  }
  return changes;
}

Config Taken(const Config& in_force, const Config& wanted) {
  Config taken = in_force;
  taken.log.level = wanted.log.level;
  taken.log.max_lines_per_second = wanted.log.max_lines_per_second;
  if (Compare(in_force, wanted).access) {
    taken.security.grants = wanted.security.grants;
    taken.security.anonymous_scopes = wanted.security.anonymous_scopes;
    taken.security.certificate_scopes = wanted.security.certificate_scopes;
    taken.security.unix_scopes = wanted.security.unix_scopes;
  }
  const auto displays = ByName(wanted);
  for (DisplayConfig& display : taken.displays) {
    const auto at = displays.find(display.name);
    if (at == displays.end()) continue;
    for (const std::string_view key : kDisplayOptionsAtOnce) {
      display.options.erase(std::string(key));
      const auto option = at->second->options.find(std::string(key));
      if (option != at->second->options.end()) display.options.insert(*option);
    }
  }
  return taken;
}

}  // namespace voxeld::daemon::reload
