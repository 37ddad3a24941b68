#include "tools/voxelctl/playlist/playlist.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/toml/parse_toml.h"

namespace voxeld::voxelctl {
namespace {

constexpr std::string_view kDays[] = {"mon", "tue", "wed", "thu", "fri", "sat", "sun"};
constexpr double kMostSeconds = 1e7;  // about a hundred days

// Converts "22:00" to minutes; "24:00" is the end of the day.
std::optional<int> ParseTime(const std::string& text) {
  int hours = 0, minutes = 0, length = 0;
  if (std::sscanf(text.c_str(), "%2d:%2d%n", &hours, &minutes, &length) != 2) return {};
  const int total = hours * 60 + minutes;
  const bool right = static_cast<size_t>(length) == text.size() && hours >= 0 && minutes >= 0 &&
                     minutes < 60 && total <= kDayMinutes;
  return right ? std::optional(total) : std::nullopt;
}

class Reader {
 public:
  Reader(const toml::table& root, const std::string& path) : path_(path) {
    out_.cross_fade_s = Number(root, "cross_fade", 0, 60).value_or(out_.cross_fade_s);
    out_.loop = Flag(root, "loop").value_or(out_.loop);
    const toml::node* const items = root.get("item");
    const toml::array* const list = items == nullptr ? nullptr : items->as_array();
    if (items == nullptr) {
      Wrong(root, "there is no item; begin each with [[item]]");
    } else if (list == nullptr || list->empty() || !list->is_homogeneous<toml::table>()) {
      Wrong(*items, "item is no list of tables; write [[item]] before each");
    } else {
      for (const toml::node& item : *list) Item(*item.as_table());
    }
    Known(root, {"cross_fade", "loop", "item"});
  }

  absl::StatusOr<Playlist> Take() {
    if (!errors_.empty()) return absl::InvalidArgumentError(absl::StrJoin(errors_, "\n"));
    return std::move(out_);
  }

 private:
  void Wrong(const toml::node& node, std::string_view what) {
    const toml::source_position& at = node.source().begin;
    errors_.push_back(absl::StrCat(path_, ":", at.line, ":", at.column, ": ",
                                   absl::string_view(what.data(), what.size())));
  }

  static std::string Shown(const toml::node& node) {
    std::ostringstream out;
    node.visit([&out](const auto& value) {
      if constexpr (toml::is_value<std::decay_t<decltype(value)>>)
        out << toml::toml_formatter{value};
      else
        out << "no single value";
    });
    return out.str();
  }

  std::optional<double> Number(const toml::table& table, const char* key, double least,
                               double most) {
    const toml::node* const node = table.get(key);
    if (node == nullptr) return {};
    const std::optional<double> value = node->is_number() ? node->value<double>() : std::nullopt;
    if (value.has_value() && *value >= least && *value <= most) return value;
    Wrong(*node,
          absl::StrCat(key, " is ", Shown(*node), "; give a number from ", least, " to ", most));
    return {};
  }
  std::optional<bool> Flag(const toml::table& table, const char* key) {
    const toml::node* const node = table.get(key);
    if (node == nullptr) return {};
    const std::optional<bool> value = node->value_exact<bool>();
    if (!value.has_value())
      Wrong(*node, absl::StrCat(key, " is ", Shown(*node), "; give true or false"));
    return value;
  }
  std::optional<int> Time(const toml::table& table, const char* key) {
    const toml::node* const node = table.get(key);
    if (node == nullptr) return {};
    const std::optional<std::string> text = node->value_exact<std::string>();
    const std::optional<int> time = text.has_value() ? ParseTime(*text) : std::nullopt;
    if (!time.has_value()) {
      Wrong(*node, absl::StrCat(key, " is ", Shown(*node),
                                "; give a time of day in quotes, from \"00:00\" to \"24:00\""));
    }
    return time;
  }

  void Item(const toml::table& table) {
    PlaylistItem item;
    const toml::node* const file = table.get("file");
    const std::optional<std::string> name =
        file == nullptr ? std::nullopt : file->value_exact<std::string>();
    if (!name.has_value() || name->empty()) {
      Wrong(table, "an item without file; give the name of a recording in quotes");
    } else {
      item.file = (std::filesystem::path(path_).parent_path() / *name).string();
    }
    if (table.contains("seconds")) item.seconds = Number(table, "seconds", 0.1, kMostSeconds);
    item.speed = Number(table, "speed", 0.001, 1000).value_or(1);
    item.hours.from = Time(table, "from").value_or(0);
    item.hours.to = Time(table, "to").value_or(kDayMinutes);
    if (const toml::node* const days = table.get("days")) item.hours.days = Days(*days);
    Known(table, {"file", "seconds", "speed", "from", "to", "days"});
    out_.items.push_back(std::move(item));
  }

  uint8_t Days(const toml::node& node) {
    uint8_t days = 0;
    const toml::array* const list = node.as_array();
    for (size_t i = 0; list != nullptr && i < list->size(); ++i) {
      const std::optional<std::string> day = (*list)[i].value_exact<std::string>();
      const auto at = std::find(std::begin(kDays), std::end(kDays), day.value_or(""));
      if (at == std::end(kDays)) {
        Wrong((*list)[i],
              absl::StrCat(
                  "days has ", Shown((*list)[i]),
                  "; a day is \"mon\", \"tue\", \"wed\", \"thu\", \"fri\", \"sat\" or \"sun\""));
      } else {
        days = static_cast<uint8_t>(days | 1 << (at - std::begin(kDays)));
      }
    }
    if (list == nullptr || list->empty()) {
      Wrong(node, "days is no list of days; write days = [\"sat\", \"sun\"], or leave it out");
    }
    return days;
  }

  void Known(const toml::table& table, std::initializer_list<std::string_view> keys) {
    for (const auto& [key, node] : table) {
      if (std::find(keys.begin(), keys.end(), key.str()) != keys.end()) continue;
      const toml::source_position& at = key.source().begin;
      errors_.push_back(absl::StrCat(
          path_, ":", at.line, ":", at.column, ": unknown key ", std::string(key.str()),
          "; there are ",
          absl::StrJoin(keys, ", ", [](std::string* out, std::string_view k) { out->append(k); })));
    }
  }

  const std::string& path_;
  Playlist out_;
  std::vector<std::string> errors_;
};

}  // namespace

bool IsWithin(const Hours& hours, WeekMinute now) {
  const int length =
      hours.to > hours.from ? hours.to - hours.from : hours.to - hours.from + kDayMinutes;
  for (int day = 0; day < 7; ++day) {
    if ((hours.days >> day & 1) == 0) continue;
    const int since = (now - (day * kDayMinutes + hours.from) + kWeekMinutes) % kWeekMinutes;
    if (since < length) return true;
  }
  return false;
}

absl::StatusOr<Playlist> ParsePlaylist(std::string_view text, const std::string& path) {
  const absl::StatusOr<toml::table> root = ParseToml(text, path);
  if (!root.ok()) return root.status();
  return Reader(*root, path).Take();
}

absl::StatusOr<Playlist> ReadPlaylist(const std::string& path) {
  std::ifstream in(path);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) {
    return absl::NotFoundError(absl::StrCat("there is no playlist ", path, " that can be read"));
  }
  return ParsePlaylist(text.str(), path);
}

std::optional<size_t> NextItem(const Playlist& playlist, std::optional<size_t> after,
                               WeekMinute now) {
  const size_t count = playlist.items.size();
  const size_t first = after.has_value() ? *after + 1 : 0;
  for (size_t n = 0; n < count; ++n) {
    const size_t at = first + n;
    if (at >= count && !playlist.loop) return {};
    if (IsWithin(playlist.items[at % count].hours, now)) return at % count;
  }
  return {};
}

}  // namespace voxeld::voxelctl
