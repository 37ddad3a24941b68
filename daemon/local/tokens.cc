#include "daemon/local/tokens.h"

#include <sys/random.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::local {
namespace {

// Compares in constant time. Requires: both have the same size.
bool Same(std::string_view a, std::string_view b) {
  unsigned difference = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  }
  return difference == 0;
}

}  // namespace

absl::StatusOr<Tokens::Registered> Tokens::Register(SessionId session) {
  Registered made{std::string(kBytes, '\0'),
                  std::make_shared<LocalMemory>(limits_, mapped_, budget_)};
  ssize_t got = 0;
  while ((got = getrandom(made.token.data(), kBytes, 0)) < 0 && errno == EINTR) {
  }
  if (got != static_cast<ssize_t>(kBytes)) {
    return absl::UnavailableError(
        absl::StrCat("no random bytes: ", std::generic_category().message(errno)));
  }
  sync::MutexLock lock(mutex_);
  by_token_.insert_or_assign(made.token, Found{session, made.memory});
  return made;
}

void Tokens::Unregister(const std::string& token) {
  std::shared_ptr<LocalMemory> memory;
  {
    sync::MutexLock lock(mutex_);
    const auto found = by_token_.find(token);
    if (found == by_token_.end()) return;
    memory = std::move(found->second.memory);
    by_token_.erase(found);
  }
  memory->End();
  ended_->Ring();
}

Tokens::Found Tokens::Find(std::string_view token) const {
  // A token of another size is invalid, but is compared all the same.
  std::string padded(token.substr(0, kBytes));
  padded.resize(kBytes, '\0');
  Found found;
  sync::MutexLock lock(mutex_);
  for (const auto& [right, registered] : by_token_) {
    if (Same(right, padded) && token.size() == kBytes) found = registered;
  }
  return found;
}

}  // namespace voxeld::daemon::local
