// A WebSocket from its upgrade on: whatever the peer sends, whole text messages reach the service
// in order, or the connection ends, once.

#include <sys/socket.h>
#include <unistd.h>

#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "daemon/http/connection_stream.h"
#include "daemon/http/web_socket.h"
#include "daemon/http/web_socket_session.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = daemon::http;

// Sends back what it receives.
class Echo final : public http::WebSocketService {
 public:
  Echo(std::shared_ptr<http::WebSocketPeer> peer, std::string* heard)
      : peer_(std::move(peer)), heard_(heard) {}
  void OnText(std::string message) override {
    EXPECT_THAT_HOLDS(message.size() <= http::kGreatestMessage);
    *heard_ += message;
    if (message == "close") return peer_->Close(std::string(200, 'x'));
    if (message == "post") peer_->Post([] {});
    peer_->Send(std::move(message), false);
  }

 private:
  const std::shared_ptr<http::WebSocketPeer> peer_;
  std::string* const heard_;
};

// Returns a frame as clients send it, masked with zeros.
std::string Frame(uint8_t head, const std::string& payload) {
  std::string frame(1, static_cast<char>(head));
  if (payload.size() < 126) {
    frame += static_cast<char>(0x80 | payload.size());
  } else {
    frame += static_cast<char>(0x80 | 126);
    frame += static_cast<char>(payload.size() >> 8 & 0xFF);
    frame += static_cast<char>(payload.size() & 0xFF);
  }
  return frame + std::string(4, '\0') + payload;
}

class Session {
 public:
  explicit Session(Script& script) : script_(script) {
    EXPECT_THAT_HOLDS(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends_) ==
                      0);
  }
  ~Session() {
    if (session_ != nullptr && closed_ == 0) session_->Close();
    Poll();
    close(ends_[0]);
    EXPECT_THAT_HOLDS(session_ == nullptr || closed_ == 1, "it was closed ", closed_, " times");
  }

  void Run() {
    // As the server reads it.
    beast::http::request_parser<beast::http::string_body> parser;
    parser.header_limit(8192);
    parser.body_limit(0);
    parser.eager(false);
    const std::string head = script_.Text();
    beast::error_code error;
    parser.put(asio::buffer(head), error);
    if (error || !parser.is_header_done()) {
      CountExchange(ExchangeKind::kWebSocket, false);
      close(ends_[1]);
      return;
    }
    http::ConnectionStream stream(io_->get_executor());
    stream.socket().assign(http::Protocol(AF_UNIX, 0), ends_[1]);
    session_ = http::StartWebSocket(
        io_, std::move(stream), parser.release(), std::chrono::seconds(1000),
        [this](std::shared_ptr<http::WebSocketPeer> peer) {
          return std::make_unique<Echo>(std::move(peer), &heard_);
        },
        [this](http::WebSocketSession*) { ++closed_; });
    Poll();
    for (int step = 0; step < MostSteps(64) && !script_.done() && closed_ == 0; ++step) Step();
  }

 private:
  void Step() {
    switch (script_.Byte() % 6) {
      case 0: {  // a whole message
        const std::string text = script_.Text();
        const bool ascii = std::all_of(text.begin(), text.end(), [](char c) { return c > 0; });
        const size_t before = heard_.size();
        const bool clean = clean_ && ascii;
        Say(Frame(0x81, text));
        if (clean && accepted_) {
          EXPECT_THAT_HOLDS(heard_.substr(before) == text, "a message was not heard");
        }
        if (text == "close" || !ascii) clean_ = false;
        break;
      }
      case 1: {  // a frame of any kind
        const uint8_t first = script_.Byte();
        clean_ = false;
        Say(Frame(first, script_.Text()));
        break;
      }
      case 2:
        clean_ = false;
        Say(script_.Text());
        break;
      case 3:  // a long message
        clean_ = false;
        Say(Frame(0x81, std::string(script_.Below(20'000), 'a')));
        break;
      case 4:
        shutdown(ends_[0], SHUT_WR);
        clean_ = false;
        Poll();
        break;
      default:
        if (script_.Flag()) {
          session_->Close();
          clean_ = false;
        }
        Poll();
        break;
    }
  }

  void Say(const std::string& bytes) {
    [[maybe_unused]] const ssize_t sent = send(ends_[0], bytes.data(), bytes.size(), MSG_NOSIGNAL);
    Poll();
    CountExchange(ExchangeKind::kWebSocket, closed_ == 0);
  }

  void Poll() {
    char bytes[4096];
    do {
      io_->restart();
      io_->poll();
      const ssize_t got = recv(ends_[0], bytes, sizeof(bytes), 0);
      if (got <= 0) break;
      if (!answered_)
        accepted_ = std::string(bytes, static_cast<size_t>(got)).starts_with("HTTP/1.1 101");
      answered_ = true;
    } while (true);
    io_->restart();
    io_->poll();
  }

  Script& script_;
  int ends_[2] = {-1, -1};
  const std::shared_ptr<asio::io_context> io_ = std::make_shared<asio::io_context>(1);
  std::shared_ptr<http::WebSocketSession> session_;
  std::string heard_;
  int closed_ = 0;
  bool answered_ = false, accepted_ = false;
  bool clean_ = true;  // only whole messages so far
};

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Script script(data, size);
  voxeld::fuzz::Session(script).Run();
  return 0;
}
