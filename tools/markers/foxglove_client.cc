#include "tools/markers/foxglove_client.h"

#include <sys/socket.h>

#include <algorithm>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/endian/conversion.hpp>
#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace voxeld::markers {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using Json = nlohmann::json;
using Stream = beast::websocket::stream<asio::ip::tcp::socket>;

// The same protocol by the name that it had, and by the one that newer servers want.
constexpr char kProtocol[] = "foxglove.websocket.v1", kNewProtocol[] = "foxglove.sdk.v1";
constexpr std::chrono::seconds kOpenTime(10);
constexpr char kSchema[] = "foxglove.SceneUpdate";
constexpr size_t kHeaderBytes = 13;  // kind, subscription, time
constexpr uint8_t kMessageData = 1;
constexpr size_t kMostPassedOver = 100, kMostChannels = 10'000, kMostNameBytes = 1024;

std::string TextOf(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : "";
}

std::optional<uint64_t> NumberOf(const Json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end() || !at->is_number_unsigned()) return {};
  return at->get<uint64_t>();
}

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
  explicit Impl(const FoxgloveOptions& options) : options_(options), stream_(io_) {}

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
      if (bytes.empty() || static_cast<uint8_t>(bytes[0]) != kMessageData)
        continue;  // times, answers
      if (bytes.size() < kHeaderBytes) {
        return absl::InvalidArgumentError(
            absl::StrCat("a message of ", bytes.size(), " bytes ends within its header"));
      }
      const auto channel = channels_.find(
          boost::endian::load_little_u32(reinterpret_cast<const unsigned char*>(bytes.data() + 1)));
      if (channel == channels_.end()) continue;  // on its way while it was unsubscribed
      return FoxgloveMessage{channel->second.topic, std::string(bytes.substr(kHeaderBytes)),
                             channel->second.encoding};
    }
  }

  // Only the socket: the stream is the reading thread's.
  void Interrupt() { ::shutdown(stream_.next_layer().native_handle(), SHUT_RDWR); }

  const std::vector<std::string>& passed_over() const { return passed_over_; }
  size_t subscribed() const { return channels_.size(); }

 private:
  // What was begun, or what became of it in time.
  void Finish(beast::error_code* error) {
    io_.restart();
    io_.run_for(kOpenTime);
    if (io_.stopped()) return;
    beast::error_code ignored;
    stream_.next_layer().close(ignored);
    io_.run();
    *error = asio::error::timed_out;
  }

  struct Channel {
    std::string topic;
    Encoding encoding = Encoding::kProtobuf;
  };

  absl::Status Told(std::string_view text) {
    const Json json = Json::parse(text, nullptr, false);
    if (!json.is_object()) return absl::InvalidArgumentError("the server's text is no JSON object");
    const std::string what = TextOf(json, "op");
    if (what == "advertise") return Advertised(json);
    if (what == "unadvertise") {
      const auto ids = json.find("channelIds");
      if (ids == json.end() || !ids->is_array()) return absl::OkStatus();
      for (const Json& id : *ids) {
        if (id.is_number_unsigned()) channels_.erase(static_cast<uint32_t>(id.get<uint64_t>()));
      }
    }
    return absl::OkStatus();  // serverInfo, status and what later versions say
  }

  absl::Status Advertised(const Json& json) {
    const auto channels = json.find("channels");
    if (channels == json.end() || !channels->is_array()) {
      return absl::InvalidArgumentError("the server advertises no list of channels");
    }
    Json wanted = Json::array();
    for (const Json& channel : *channels) {
      if (!channel.is_object()) continue;
      const std::optional<uint64_t> id = NumberOf(channel, "id");
      const std::string topic = TextOf(channel, "topic"), encoding = TextOf(channel, "encoding"),
                        schema = TextOf(channel, "schemaName");
      if (!id.has_value() || *id > UINT32_MAX || topic.size() > kMostNameBytes ||
          schema.size() > kMostNameBytes || encoding.size() > kMostNameBytes) {
        continue;
      }
      if (channels_.size() >= kMostChannels) {
        return absl::InvalidArgumentError(
            absl::StrCat("the server has more than ", kMostChannels, " channels; name the topics"));
      }
      const bool asked =
          options_.topics.empty() ||
          std::find(options_.topics.begin(), options_.topics.end(), topic) != options_.topics.end();
      const bool readable = schema == kSchema && (encoding == "protobuf" || encoding == "json");
      if (!asked || !readable) {
        if (asked && passed_over_.size() < kMostPassedOver) {
          passed_over_.push_back(absl::StrCat(topic, " (", schema, ", ", encoding, ")"));
        }
        continue;
      }
      // A subscription goes by its channel's own number.
      channels_[static_cast<uint32_t>(*id)] = {
          topic, encoding == "json" ? Encoding::kJson : Encoding::kProtobuf};
      wanted.push_back({{"id", *id}, {"channelId", *id}});
    }
    if (wanted.empty()) return absl::OkStatus();
    const std::string text = Json{{"op", "subscribe"}, {"subscriptions", std::move(wanted)}}.dump();
    beast::error_code error;
    stream_.text(true);
    stream_.write(asio::buffer(text), error);
    if (!error) return absl::OkStatus();
    return absl::UnavailableError(absl::StrCat("the Foxglove server has gone: ", error.message()));
  }

  const FoxgloveOptions options_;
  asio::io_context io_;
  Stream stream_;
  std::map<uint32_t, Channel> channels_;  // by subscription
  std::vector<std::string> passed_over_;
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
