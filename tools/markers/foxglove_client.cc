#include "tools/markers/foxglove_client.h"

#include <sys/socket.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <optional>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace voxeld::markers {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using Stream = beast::websocket::stream<asio::ip::tcp::socket>;

// The protocol's earlier name, and the one that newer servers require.
constexpr char kProtocol[] = "foxglove.websocket.v1", kNewProtocol[] = "foxglove.sdk.v1";
constexpr std::chrono::seconds kOpenTime(10);

}  // namespace

absl::StatusOr<FoxgloveUrl> ParseFoxgloveUrl(std::string_view text) {
  absl::string_view rest(text.data(), text.size());
  const auto wrong = [&] {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", absl::string_view(text.data(), text.size()),
                     "\" is no address of a Foxglove server, such as ws://localhost:8765"));
  };
  if (!absl::ConsumePrefix(&rest, "ws://")) return wrong();
  FoxgloveUrl url{.port = "8765", .path = "/"};
  const size_t slash = rest.find('/');
  if (slash != absl::string_view::npos) {
    url.path = std::string(rest.substr(slash));
    rest = rest.substr(0, slash);
  }
  size_t colon = rest.rfind(':');
  const size_t bracket = rest.rfind(']');  // of an IPv6 address
  if (bracket != absl::string_view::npos && colon != absl::string_view::npos && colon < bracket) {
    colon = absl::string_view::npos;
  }
  if (colon != absl::string_view::npos) {
    url.port = std::string(rest.substr(colon + 1));
    rest = rest.substr(0, colon);
    int port = 0;
    if (!absl::SimpleAtoi(url.port, &port) || port < 1 || port > 65535) return wrong();
  }
  if (absl::ConsumePrefix(&rest, "[") && !absl::ConsumeSuffix(&rest, "]")) return wrong();
  url.host = std::string(rest);
  if (url.host.empty()) return wrong();
  return url;
}

class FoxgloveClient::Impl {
 public:
  explicit Impl(const FoxgloveOptions& options)
      : options_(options), stream_(io_), channels_(options.topics) {}

  absl::Status Open() {
    const FoxgloveUrl& url = options_.url;
    const std::string where = absl::StrCat(url.host, ":", url.port);
    beast::error_code error;
    asio::ip::tcp::resolver resolver(io_);
    const auto found = resolver.resolve(url.host, url.port, error);
    if (!error) {
      asio::async_connect(stream_.next_layer(), found,
                          [&error](beast::error_code code, const auto&) { error = code; });
      Finish(&error);
    }
    if (error) {
      return absl::UnavailableError(
          absl::StrCat("no Foxglove server at ", where, ": ", error.message()));
    }
    stream_.read_message_max(options_.most_message_bytes);
    stream_.set_option(
        beast::websocket::stream_base::decorator([](beast::websocket::request_type& request) {
          request.set(beast::http::field::sec_websocket_protocol,
                      absl::StrCat(kNewProtocol, ", ", kProtocol));
        }));
    beast::websocket::response_type response;
    stream_.async_handshake(response, where, url.path,
                            [&error](beast::error_code code) { error = code; });
    Finish(&error);
    if (error) {
      return absl::FailedPreconditionError(
          absl::StrCat(where, " does not speak WebSocket: ", error.message()));
    }
    const auto spoken = response[beast::http::field::sec_websocket_protocol];
    if (spoken != kProtocol && spoken != kNewProtocol) {
      return absl::FailedPreconditionError(absl::StrCat(where, " speaks neither ", kProtocol,
                                                        " nor ", kNewProtocol,
                                                        ", as Foxglove's servers do"));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<FoxgloveMessage> Next() {
    for (;;) {
      beast::flat_buffer buffer;
      beast::error_code error;
      stream_.read(buffer, error);
      if (error == beast::websocket::error::message_too_big) {
        return absl::ResourceExhaustedError(
            absl::StrCat("the Foxglove server sent a message of more than ",
                         options_.most_message_bytes, " bytes"));
      }
      if (error) {
        return absl::UnavailableError(
            absl::StrCat("the Foxglove server has gone: ", error.message()));
      }
      const std::string_view bytes(static_cast<const char*>(buffer.data().data()), buffer.size());
      if (!stream_.got_binary()) {
        if (absl::Status status = Told(bytes); !status.ok()) return status;
        continue;
      }
      absl::StatusOr<std::optional<FoxgloveMessage>> message = channels_.Data(bytes);
      if (!message.ok()) return message.status();
      if (message->has_value()) return **std::move(message);
    }
  }

  // Shuts down only the socket: the stream belongs to the reading thread.
  void Interrupt() { ::shutdown(stream_.next_layer().native_handle(), SHUT_RDWR); }

  const std::vector<std::string>& passed_over() const { return channels_.passed_over(); }
  size_t subscribed() const { return channels_.subscribed(); }

 private:
  // Finishes the operation that was begun, or fails if it takes too long.
  void Finish(beast::error_code* error) {
    io_.restart();
    io_.run_for(kOpenTime);
    if (io_.stopped()) return;
    beast::error_code ignored;
    stream_.next_layer().close(ignored);
    io_.run();
    *error = asio::error::timed_out;
  }

  absl::Status Told(std::string_view text) {
    const absl::StatusOr<std::string> answer = channels_.Told(text);
    if (!answer.ok() || answer->empty()) return answer.status();
    beast::error_code error;
    stream_.text(true);
    stream_.write(asio::buffer(*answer), error);
    if (!error) return absl::OkStatus();
    return absl::UnavailableError(absl::StrCat("the Foxglove server has gone: ", error.message()));
  }

  const FoxgloveOptions options_;
  asio::io_context io_;
  Stream stream_;
  FoxgloveChannels channels_;
};

FoxgloveClient::FoxgloveClient(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FoxgloveClient::~FoxgloveClient() = default;

absl::StatusOr<std::unique_ptr<FoxgloveClient>> FoxgloveClient::Open(
    const FoxgloveOptions& options) {
  auto impl = std::make_unique<Impl>(options);
  if (absl::Status status = impl->Open(); !status.ok()) return status;
  return std::unique_ptr<FoxgloveClient>(new FoxgloveClient(std::move(impl)));
}

absl::StatusOr<FoxgloveMessage> FoxgloveClient::Next() { return impl_->Next(); }
const std::vector<std::string>& FoxgloveClient::passed_over() const { return impl_->passed_over(); }
size_t FoxgloveClient::subscribed() const { return impl_->subscribed(); }
void FoxgloveClient::Interrupt() { impl_->Interrupt(); }

}  // namespace voxeld::markers
