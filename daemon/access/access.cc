#include "daemon/access/access.h"

#include <unistd.h>

#include <charconv>
#include <chrono>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace voxeld::daemon::access {
namespace {

Caller Named(Caller::By by, std::string key, const char* kind, const Grant& grant) {
  return {by == Caller::By::kUser ? "" : grant.name, absl::StrCat(kind, " ", grant.name),
          grant.scopes, by, std::move(key)};
}

}  // namespace

std::set<uint32_t> AccessOptions::TrustedUsers() { return {0, geteuid()}; }

Access::WallClock Access::SystemWallClock() {
  return [] {
    return std::chrono::duration_cast<std::chrono::seconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
  };
}

Access::Access(AccessOptions options, WallClock now, Logger* log)
    : options_(std::move(options)), now_(std::move(now)), log_(log) {}

void Access::SetOnChange(std::function<void()> on_change) {
  sync::MutexLock lock(mutex_);
  on_change_ = std::move(on_change);
}

absl::Status Access::Look(bool again) {
  const int64_t now = now_();
  std::function<void()> tell;
  absl::Status status;
  {
    sync::MutexLock lock(mutex_);
    if (options_.grants.empty()) return absl::OkStatus();
    const std::optional<FileStamp> stamp = StampOf(options_.grants);
    const bool read = !looked_ || again || stamp != stamp_;
    if (read) {
      const bool first = !std::exchange(looked_, true);
      stamp_ = stamp;
      absl::StatusOr<Grants> grants = ReadGrants(options_.grants);
      const std::string before = trouble_;
      trouble_ = grants.ok() ? "" : std::string(grants.status().message());
      if (grants.ok()) grants_ = *std::move(grants);
      if (log_ != nullptr && trouble_.empty() && !(first || before.empty())) {
        log_->Info("the grants file is right again", {{"file", options_.grants}});
      } else if (log_ != nullptr && trouble_.empty()) {
        log_->Info(first ? "grants" : "the grants file was read again",
                   {{"file", options_.grants},
                    {"tokens", absl::StrCat(grants_.tokens.size())},
                    {"certificates", absl::StrCat(grants_.certificates.size())},
                    {"users", absl::StrCat(grants_.users.size())}});
      } else if (log_ != nullptr && trouble_ != before) {
        log_->Error("the grants file is wrong: nobody new is let in by it", {{"why", trouble_}});
      }
    }
    bool changed = read;
    for (const auto& [hash, grant] : grants_.tokens) {
      // When the clock is set back, expired tokens become valid again. This takes nothing from
      // anybody, so it is not a change.
      changed = changed || (grant.expires_s.has_value() && *grant.expires_s > looked_s_ &&
                            *grant.expires_s <= now);
    }
    looked_s_ = now;
    if (changed) tell = on_change_;
    if (!trouble_.empty()) status = absl::FailedPreconditionError(trouble_);
  }
  if (tell) tell();
  return status;
}

absl::Status Access::Change(AccessOptions options) {
  Grants grants;
  std::optional<FileStamp> stamp;
  if (!options.grants.empty()) {
    stamp = StampOf(options.grants);
    absl::StatusOr<Grants> read = ReadGrants(options.grants);
    if (!read.ok()) return read.status();
    grants = *std::move(read);
  }
  std::function<void()> tell;
  {
    sync::MutexLock lock(mutex_);
    options_ = std::move(options);
    grants_ = std::move(grants);
    stamp_ = stamp;
    looked_ = true;
    trouble_.clear();
    looked_s_ = now_();
    tell = on_change_;
  }
  if (tell) tell();
  return absl::OkStatus();
}

absl::StatusOr<Caller> Access::Find(Caller::By by, const std::string& key) const {
  switch (by) {
    case Caller::By::kAnonymous:
      return Caller{"", "anonymous", options_.anonymous, by, ""};
    case Caller::By::kToken: {
      const auto at = grants_.tokens.find(key);
      if (at == grants_.tokens.end()) {
        return absl::UnauthenticatedError(
            options_.grants.empty()
                ? "a token was sent, and this daemon has no grants file that knows any"
                : "the token is not known: it is wrong, or it was revoked");
      }
      if (at->second.expires_s.has_value() && *at->second.expires_s <= now_()) {
        return absl::UnauthenticatedError(
            absl::StrCat("the token of ", at->second.name, " has expired"));
      }
      return Named(by, key, "token", at->second);
    }
    case Caller::By::kCertificate: {
      const auto at = grants_.certificates.find(key);
      if (at != grants_.certificates.end()) return Named(by, key, "certificate", at->second);
      return Caller{key, absl::StrCat("certificate ", absl::CHexEscape(key)), options_.certificate,
                    by, key};
    }
    case Caller::By::kUser: {
      uint32_t user = 0;
      std::from_chars(key.data(), key.data() + key.size(), user);
      const std::string who = absl::StrCat("user ", user);
      if (options_.trusted.contains(user)) return Caller{"", who, Scopes::All(), by, key};
      const auto at = grants_.users.find(user);
      if (at != grants_.users.end()) return Named(by, key, "user", at->second);
      return Caller{"", who, options_.unix_users, by, key};
    }
  }
  return absl::InternalError("a caller of no kind");
}

absl::StatusOr<Caller> Access::Identify(const Credentials& credentials) const {
  Caller::By by = Caller::By::kAnonymous;
  std::string key;
  if (credentials.token.has_value()) {
    by = Caller::By::kToken;
    key = HashOf(*credentials.token);
  } else if (credentials.certificate.has_value()) {
    by = Caller::By::kCertificate;
    key = *credentials.certificate;
  } else if (credentials.user.has_value()) {
    by = Caller::By::kUser;
    key = absl::StrCat(*credentials.user);
  }
  sync::MutexLock lock(mutex_);
  const bool trusted = by == Caller::By::kUser && options_.trusted.contains(*credentials.user);
  if (!trouble_.empty() && by != Caller::By::kAnonymous && !trusted) {
    return absl::UnavailableError(
        "who may do what is not known at present: the daemon's grants file is wrong, its log says "
        "how; try again later");
  }
  return Find(by, key);
}

absl::Status Access::Recheck(const Caller& caller) const {
  sync::MutexLock lock(mutex_);
  if (!trouble_.empty()) return absl::OkStatus();
  const absl::StatusOr<Caller> now = Find(caller.by, caller.key);
  if (!now.ok()) return now.status();
  if (now->principal != caller.principal) {
    return absl::UnauthenticatedError(absl::StrCat(caller.who, " is ", now->who, " now"));
  }
  if (!now->scopes.Hold(caller.scopes)) {
    return absl::PermissionDeniedError(
        absl::StrCat(caller.who, " has the scopes ", now->scopes.Sentence(), " now, and had ",
                     caller.scopes.Sentence(), "; begin again with what is left"));
  }
  return absl::OkStatus();
}

std::string Access::trouble() const {
  sync::MutexLock lock(mutex_);
  return trouble_;
}

}  // namespace voxeld::daemon::access
