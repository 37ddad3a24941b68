#include "daemon/core/token.h"

#include <sys/random.h>

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {

absl::StatusOr<std::string> NewToken() {
  std::string token(kTokenBytes, '\0');
  ssize_t got = 0;
  do {
    got = getrandom(token.data(), token.size(), 0);
  } while (got < 0 && errno == EINTR);
  if (got == static_cast<ssize_t>(token.size())) return token;
  return absl::UnavailableError(
      absl::StrCat("the system gave no random bytes for a token: ", std::strerror(errno)));
}

}  // namespace voxeld::daemon
