#include "daemon/access/grants.h"

#include <openssl/evp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <fstream>
#include <new>
#include <set>
#include <sstream>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/suggest.h"
#include "common/toml/parse_toml.h"

namespace voxeld::daemon::access {
namespace {

constexpr size_t kHashDigits = 64;
constexpr size_t kMostFaults = 20;

// Requires: `when` has an offset.
int64_t UnixSeconds(const toml::date_time& when) {
  using std::chrono::day;
  using std::chrono::month;
  using std::chrono::year;
  const std::chrono::sys_days date =
      year(when.date.year) / month(when.date.month) / day(when.date.day);
  int64_t seconds =
      std::chrono::duration_cast<std::chrono::seconds>(date.time_since_epoch()).count();
  seconds += when.time.hour * 3600 + when.time.minute * 60 + when.time.second;
  return seconds - when.offset->minutes * 60;
}

std::optional<uint32_t> UserNumber(const std::string& name) {
  uint32_t number = 0;
  const auto parsed = std::from_chars(name.data(), name.data() + name.size(), number);
  if (parsed.ec == std::errc() && parsed.ptr == name.data() + name.size()) return number;
  std::vector<char> buffer(16384);
  passwd entry = {};
  passwd* found = nullptr;
  if (getpwnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found) != 0 ||
      found == nullptr) {
    return {};
  }
  return entry.pw_uid;
}

class Reader {
 public:
  Reader(const toml::table& root, const std::string& name) : name_(name) {
    for (const auto& [key, node] : root) {
      const std::string section(key.str());
      if (section != "token" && section != "certificate" && section != "user") {
        Fault(node, absl::StrCat("\"", absl::CHexEscape(section), "\"",
                                 Suggestion(section, {"token", "certificate", "user"})));
        continue;
      }
      const toml::array* entries = node.as_array();
      if (entries == nullptr) {
        Fault(node, absl::StrCat("write [[", section, "]], once for each"));
        continue;
      }
      for (const toml::node& entry : *entries) ReadEntry(section, entry);
    }
  }

  absl::StatusOr<Grants> Take() {
    if (!faults_.empty()) return absl::InvalidArgumentError(absl::StrJoin(faults_, "\n"));
    return std::move(grants_);
  }

 private:
  void Fault(const toml::node& node, const std::string& what) {
    if (faults_.size() < kMostFaults) {
      faults_.push_back(absl::StrCat(name_, ":", node.source().begin.line, ": ", what));
    }
  }

  void ReadEntry(const std::string& section, const toml::node& node) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return Fault(node, absl::StrCat("write [[", section, "]]"));
    std::vector<std::string> known = {"name", "scopes"};
    if (section == "token") known.insert(known.end(), {"sha256", "expires"});
    if (section == "certificate") known.emplace_back("subject");
    for (const auto& [key, value] : *table) {
      const std::string text(key.str());
      if (std::find(known.begin(), known.end(), text) == known.end()) {
        Fault(value, absl::StrCat("\"", absl::CHexEscape(text), "\"", Suggestion(text, known)));
        return;
      }
    }
    Grant grant;
    const std::optional<std::string> name = ReadText(node, *table, "name");
    if (!name.has_value()) return;
    if (!Plain(*name)) {
      return Fault(node, absl::StrCat("name is \"", absl::CHexEscape(*name), "\"; give 1 to ",
                                      kLongestName, " letters, digits, '-', '_', '.' or '@'"));
    }
    grant.name = *name;
    if (!ReadScopes(node, *table, &grant.scopes)) return;
    if (section == "token") return ReadToken(node, *table, std::move(grant));
    if (section == "certificate") {
      const std::optional<std::string> subject = ReadText(node, *table, "subject");
      if (!subject.has_value()) return;
      if (!grants_.certificates.emplace(*subject, std::move(grant)).second) {
        Fault(node, absl::StrCat("subject \"", absl::CHexEscape(*subject), "\" is there twice"));
      }
      return;
    }
    const std::optional<uint32_t> number = UserNumber(grant.name);
    if (!number.has_value()) {
      return Fault(node, absl::StrCat("this machine knows no user \"", grant.name, "\""));
    }
    if (!grants_.users.emplace(*number, std::move(grant)).second) {
      Fault(node, absl::StrCat("user ", *number, " is there twice"));
    }
  }

  void ReadToken(const toml::node& node, const toml::table& table, Grant grant) {
    std::optional<std::string> hash = ReadText(node, table, "sha256");
    if (!hash.has_value()) return;
    absl::AsciiStrToLower(&*hash);
    if (hash->size() != kHashDigits ||
        hash->find_first_not_of("0123456789abcdef") != std::string::npos) {
      return Fault(node, absl::StrCat("sha256 is \"", absl::CHexEscape(*hash),
                                      "\"; give the 64 digits that `voxelctl token` prints"));
    }
    if (const toml::node* expires = table.get("expires"); expires != nullptr) {
      const auto when = expires->value<toml::date_time>();
      if (!when.has_value() || !when->offset.has_value()) {
        return Fault(*expires,
                     "expires is no date and time with its offset; write it as "
                     "2027-01-31T00:00:00Z, without quotes");
      }
      grant.expires_s = UnixSeconds(*when);
    }
    if (!grants_.tokens.emplace(*hash, std::move(grant)).second) {
      Fault(node, absl::StrCat("the token with sha256 ", *hash, " is there twice"));
    }
  }

  std::optional<std::string> ReadText(const toml::node& node, const toml::table& table,
                                      const char* key) {
    const toml::node* value = table.get(key);
    const std::optional<std::string> text =
        value == nullptr ? std::nullopt : value->value_exact<std::string>();
    if (!text.has_value() || text->empty()) {
      Fault(value == nullptr ? node : *value, absl::StrCat(key, " is missing; give a text"));
      return {};
    }
    return text;
  }

  bool ReadScopes(const toml::node& node, const toml::table& table, Scopes* scopes) {
    const toml::node* value = table.get("scopes");
    std::vector<std::string> words;
    const toml::array* list = value == nullptr ? nullptr : value->as_array();
    if (list == nullptr) {
      Fault(node, "scopes is missing; give an array of view, draw, control");
      return false;
    }
    for (const toml::node& word : *list) words.push_back(word.value_or(std::string("?")));
    const absl::StatusOr<Scopes> parsed = ParseScopes(absl::StrJoin(words, " "));
    if (!parsed.ok()) {
      Fault(*value, std::string(parsed.status().message()));
      return false;
    }
    *scopes = *parsed;
    return true;
  }

  static bool Plain(const std::string& name) {
    return name.size() <= kLongestName && std::all_of(name.begin(), name.end(), [](char c) {
             return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' ||
                    c == '.' || c == '@';
           });
  }

  const std::string& name_;
  Grants grants_;
  std::vector<std::string> faults_;
};

}  // namespace

absl::StatusOr<Grants> ParseGrants(std::string_view text, const std::string& name) {
  const absl::StatusOr<toml::table> root = ParseToml(text, name);
  if (!root.ok()) return root.status();
  return Reader(*root, name).Take();
}

absl::StatusOr<Grants> ReadGrants(const std::string& path) {
  struct stat found;
  if (stat(path.c_str(), &found) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat("the grants file ", path));
  }
  if (!S_ISREG(found.st_mode)) {
    return absl::FailedPreconditionError(absl::StrCat("the grants file ", path, " is no file"));
  }
  if ((found.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("the grants file ", path, " may be written by others; chmod go-w ", path));
  }
  if (found.st_uid != 0 && found.st_uid != geteuid()) {
    return absl::FailedPreconditionError(absl::StrCat("the grants file ", path, " belongs to user ",
                                                      found.st_uid,
                                                      "; it must be root's or the daemon's own"));
  }
  if (static_cast<uintmax_t>(found.st_size) > kGreatestGrantsBytes) {
    return absl::InvalidArgumentError(absl::StrCat("the grants file ", path, " has ", found.st_size,
                                                   " bytes; ", kGreatestGrantsBytes,
                                                   " is the most"));
  }
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  file >> std::noskipws >> text.rdbuf();
  if (!file.eof()) {  // the file could not be opened, or reading failed
    return absl::UnavailableError(absl::StrCat("the grants file ", path, " cannot be read"));
  }
  return ParseGrants(text.str(), path);
}

std::string HashOf(std::string_view token) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
  unsigned length = 0;
  // EVP_Digest fails only if memory runs out.
  if (EVP_Digest(token.data(), token.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1) {
    throw std::bad_alloc();
  }
  return absl::BytesToHexString({reinterpret_cast<const char*>(digest.data()), length});
}

}  // namespace voxeld::daemon::access
