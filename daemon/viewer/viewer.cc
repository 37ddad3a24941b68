#include "daemon/viewer/viewer.h"

#include <arpa/inet.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "daemon/core/token.h"
#include "daemon/viewer/page_files.h"
#include "daemon/viewer/page_message.h"
#include "daemon/viewer/viewer_socket.h"

namespace voxeld::daemon::viewer {
namespace {

constexpr std::string_view kSocketPath = "/volumes";
constexpr std::string_view kControlPath = "/control";
constexpr std::string_view kPlayPath = "/play";
// Plus a part specific to the daemon, because cookies ignore ports.
constexpr char kCookie[] = "voxeld_control_";
// Allows only its own files and its own socket.
constexpr char kContentPolicy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

constexpr size_t kNameDigits = 8;

bool IsPort(std::string_view text) {
  int port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc() && end == text.data() + text.size() && port >= 0 && port <= 65535;
}

// Returns: the name or number in a Host header, in lower case, without its port and brackets; nothing if the header is not
// well-formed (RFC 9110, 7.2).
std::optional<std::string> HostName(std::string_view header) {
  std::string_view name, rest;
  if (header.starts_with('[')) {
    const size_t end = header.find(']');
    if (end == std::string_view::npos) return std::nullopt;
    name = header.substr(1, end - 1);
    rest = header.substr(end + 1);
  } else {
    const size_t colon = std::min(header.find(':'), header.size());
    name = header.substr(0, colon);
    rest = header.substr(colon);
  }
  if (!rest.empty() && (rest.front() != ':' || !IsPort(rest.substr(1)))) return std::nullopt;
  std::string lower(name);
  absl::AsciiStrToLower(&lower);
  return lower;
}

bool IsNumber(const std::string& host) {
  char address[sizeof(in6_addr)];
  return inet_pton(AF_INET, host.c_str(), address) == 1 ||
         inet_pton(AF_INET6, host.c_str(), address) == 1;
}

// Compares in constant time.
bool SameSecret(std::string_view a, std::string_view b) {
  if (a.size() != b.size() || a.empty()) return false;
  unsigned differs = 0;
  for (size_t i = 0; i < a.size(); ++i) differs |= static_cast<unsigned char>(a[i] ^ b[i]);
  return differs == 0;
}

http::Response Plain(unsigned status, std::string text) {
  return {status, "text/plain; charset=utf-8", std::move(text) + "\n", {}};
}

}  // namespace

class Viewer::Impl {
 public:
  Impl(Core& core, sync::Clock& clock, ViewerOptions options, std::string key, std::string session)
      : play_(ViewerPlay::Make(options.play, options.audit)),
        shared_(std::make_shared<ViewerShared>(
            ViewerShared{core, clock, std::move(options), play_, {}})),
        key_(std::move(key)),
        session_(session.substr(kNameDigits)),
        cookie_(absl::StrCat(kCookie, session.substr(0, kNameDigits), "=")) {}

  // Rejects foreign host names, which could be made to resolve to this machine; numbers cannot be
  // spoofed in this way.
  bool KnownHost(std::string_view header) const {
    const std::optional<std::string> host = HostName(header);
    const std::vector<std::string>& more = shared_->options.hosts;
    return host && (host == "localhost" || IsNumber(*host) ||
                    std::any_of(more.begin(), more.end(), [&](const std::string& name) {
                      return absl::EqualsIgnoreCase(name, *host);
                    }));
  }

  // Returns: nothing if the request may view.
  absl::Status Check(const http::Request& request) const {
    if (!KnownHost(request.host)) {
      return absl::PermissionDeniedError(absl::StrCat(
          "the request is for the host \"", absl::CHexEscape(std::string(request.host)),
          "\"; this one answers to localhost, to numbers, and to the names in server.http_hosts"));
    }
    const std::string host(request.host);
    if (!request.origin.empty() && request.origin != "http://" + host &&
        request.origin != "https://" + host) {
      return absl::PermissionDeniedError("pages of other origins may not");
    }
    return absl::OkStatus();
  }

  bool HasControl(const http::Request& request) const {
    for (const std::string& cookie :
         std::vector<std::string>(absl::StrSplit(std::string(request.cookie), "; "))) {
      if (cookie.starts_with(cookie_) &&
          SameSecret(std::string_view(cookie).substr(cookie_.size()), session_)) {
        return true;
      }
    }
    return false;
  }

  bool Serve(const http::Request& request, const http::Done& done) {
    const auto files = PageFiles();
    if (request.path == kPlayPath) {
      http::Response wrong = Plain(405, "files are sent by POST");
      wrong.headers = {{"Allow", "POST"}};
      done(std::move(wrong));
      return true;
    }
    const bool control = request.path == kControlPath;
    const auto file = std::find_if(files.begin(), files.end(),
                                   [&](const PageFile& f) { return f.path == request.path; });
    if (!control && file == files.end() && request.path != "/") return false;
    const absl::Status may = Check(request);
    if (!may.ok()) {
      done(Plain(403, std::string(may.message())));
    } else if (control) {
      done(TakeControl(request));
    } else if (file == files.end()) {
      done(Plain(404,
                 "this voxeld was built without its page: run tools/setup, which installs the "
                 "page's tools, configure with -DVOXELD_PAGE=ON and build again; /healthz and "
                 "/metrics are here"));
    } else {
      done(PageResponse(*file, request));
    }
    return true;
  }

  absl::StatusOr<http::ServeWebSocket> Upgrade(const http::Request& request) const {
    if (request.path != kSocketPath) {
      return absl::NotFoundError(absl::StrCat("WebSockets are served at ", kSocketPath.data()));
    }
    if (absl::Status may = Check(request); !may.ok()) return may;
    return [shared = shared_,
            control = HasControl(request)](std::shared_ptr<http::WebSocketPeer> peer) {
      return NewViewerSocket(shared, std::move(peer), control);
    };
  }

  // Requests that other pages cause a browser to send are rejected by their origin, which browsers
  // always send here.
  std::optional<http::Reception> Receive(const http::Request& request) const {
    if (request.path != kPlayPath) return std::nullopt;
    http::Reception refused;
    if (absl::Status may = Check(request); !may.ok()) {
      refused.refusal = Plain(403, std::string(may.message()));
    } else if (request.origin.empty()) {
      refused.refusal = Plain(403, "files are taken from pages, which say where they are from");
    } else if (!HasControl(request)) {
      refused.refusal = Plain(403, page::kOnlyLook);
    } else {
      return play_->Receive(request.query);
    }
    return refused;
  }

  const std::string& key() const { return key_; }

 private:
  http::Response TakeControl(const http::Request& request) {
    if (request.head) {  // from link previews, which must not use up the address
      http::Response wrong = Plain(405, "the address for control requires GET");
      wrong.headers = {{"Allow", "GET"}};
      return wrong;
    }
    std::string_view key = request.query;
    if (!key.starts_with("key=") || !SameSecret(key.substr(4), key_)) {
      return Plain(403,
                   "this address has been used, or was never one: an address for control serves "
                   "once, and another is "
                   "printed when voxeld starts");
    }
    key_.clear();
    http::Response response = Plain(303, "control");
    response.headers = {
        {"Location", "/"},
        {"Referrer-Policy", "no-referrer"},
        {"Set-Cookie", absl::StrCat(cookie_, session_, "; Path=/; HttpOnly; SameSite=Strict")}};
    return response;
  }

  static http::Response PageResponse(const PageFile& file, const http::Request& request) {
    http::Response response;
    response.content_type = std::string(file.content_type);
    response.headers = {{"Content-Security-Policy", kContentPolicy},
                        {"X-Content-Type-Options", "nosniff"},
                        {"Referrer-Policy", "no-referrer"},
                        {"Cross-Origin-Opener-Policy", "same-origin"},
                        {"Cross-Origin-Resource-Policy", "same-origin"},
                        {"Vary", "Accept-Encoding"}};
    if (request.accept_encoding.find("gzip") != std::string_view::npos) {
      response.headers.emplace_back("Content-Encoding", "gzip");
      response.body = std::string(file.gzipped);
    } else {
      response.body = Unpack(file.gzipped);
    }
    return response;
  }

  const std::shared_ptr<ViewerPlay> play_;
  const std::shared_ptr<ViewerShared> shared_;
  std::string key_;  // empty: none, or already used
  const std::string session_, cookie_;
};

absl::StatusOr<std::unique_ptr<Viewer>> Viewer::Make(Core& core, sync::Clock& clock,
                                                     ViewerOptions options) {
  std::string secrets[2];
  for (std::string& secret : secrets) {
    const absl::StatusOr<std::string> token = NewToken();
    if (!token.ok()) return token.status();
    secret = absl::BytesToHexString(*token);
  }
  if (!options.control) secrets[0].clear();
  return std::unique_ptr<Viewer>(new Viewer(std::make_shared<Impl>(
      core, clock, std::move(options), std::move(secrets[0]), std::move(secrets[1]))));
}

Viewer::Viewer(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
Viewer::~Viewer() = default;

bool Viewer::HasPage() { return !PageFiles().empty(); }

http::Handler Viewer::Handler(http::Handler others) {
  return [impl = impl_, others = std::move(others)](const http::Request& request, http::Done done) {
    return impl->Serve(request, done) || others(request, std::move(done));
  };
}

http::Upgrade Viewer::Upgrade() {
  return [impl = impl_](const http::Request& request) { return impl->Upgrade(request); };
}

http::Receive Viewer::Receive() {
  return [impl = impl_](const http::Request& request) { return impl->Receive(request); };
}

std::string Viewer::PageAddress(const Address& http) {
  return http.unix_socket ? "" : absl::StrCat("http://", http.ToString(), "/");
}

std::string Viewer::ControlAddress(const Address& http) const {
  if (impl_->key().empty() || http.unix_socket) return "";
  return absl::StrCat("http://", http.ToString(), std::string(kControlPath), "?key=", impl_->key());
}

}  // namespace voxeld::daemon::viewer
