#include "daemon/http/web_socket_session.h"

#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <deque>
#include <string>
#include <utility>

namespace voxeld::daemon::http {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

constexpr auto kHandshakeLimit = std::chrono::seconds(10);
constexpr auto kSilenceLimit = std::chrono::seconds(60);  // a ping is sent after half of it
constexpr size_t kMostReason = 123;
// Limits on the send queue. Beyond them reading is suspended, because further messages could ask
// for more.
constexpr size_t kMostWaitingBytes = 1 << 20, kMostWaiting = 64;

class Session final : public WebSocketSession, public std::enable_shared_from_this<Session> {
 public:
  Session(std::shared_ptr<asio::io_context> io, ConnectionStream stream,
          std::chrono::nanoseconds message_limit, std::function<void(WebSocketSession*)> closed)
      : io_(std::move(io)),
        socket_(std::move(stream)),
        message_limit_(message_limit),
        write_timer_(io_->get_executor()),
        closed_(std::move(closed)) {}

  void Start(const RequestMessage& request,
             const std::function<std::unique_ptr<WebSocketService>(std::shared_ptr<WebSocketPeer>)>&
                 serve) {
    service_ = serve(std::make_shared<Peer>(io_, weak_from_this()));
    beast::get_lowest_layer(socket_).expires_never();
    socket_.set_option(websocket::stream_base::timeout{kHandshakeLimit, kSilenceLimit, true});
    socket_.read_message_max(kGreatestMessage);
    socket_.auto_fragment(false);
    socket_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (error) return self->End();
      self->accepted_ = true;
      self->Write();
      self->Read();
    });
  }

  void Close() override {
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().shutdown(ConnectionStream::socket_type::shutdown_both,
                                                       ignored);
    beast::get_lowest_layer(socket_).close();
    End();
  }

 private:
  struct Outgoing {
    std::string bytes;
    bool binary = false, close = false;
  };

  class Peer final : public WebSocketPeer {
   public:
    Peer(std::shared_ptr<asio::io_context> io, std::weak_ptr<Session> session)
        : io_(std::move(io)), session_(std::move(session)) {}
    void Send(std::string message, bool binary) override {
      Pass({std::move(message), binary, false});
    }
    void Post(std::function<void()> what) override {
      asio::post(*io_, [session = session_, what = std::move(what)] {
        const auto self = session.lock();
        if (self != nullptr && self->closed_) what();
      });
    }
    void Close(std::string why) override {
      why.resize(std::min(why.size(), kMostReason));
      Pass({std::move(why), false, true});
    }

   private:
    void Pass(Outgoing message) {
      asio::post(*io_, [session = session_, message = std::move(message)]() mutable {
        if (const auto self = session.lock()) self->Enqueue(std::move(message));
      });
    }

    const std::shared_ptr<asio::io_context> io_;
    const std::weak_ptr<Session> session_;
  };

  void Enqueue(Outgoing message) {
    if (!closed_) return;
    waiting_bytes_ += message.bytes.size();
    waiting_.push_back(std::move(message));
    Write();
  }

  void Write() {
    if (!accepted_ || writing_ || waiting_.empty()) return;
    writing_ = true;
    Outgoing& next = waiting_.front();
    if (next.close) {
      return socket_.async_close({websocket::close_code::policy_error, next.bytes},
                                 [self = shared_from_this()](error_code) { self->End(); });
    }
    socket_.binary(next.binary);
    write_timer_.expires_after(message_limit_);
    write_timer_.async_wait([self = shared_from_this()](error_code error) {
      if (!error) self->Close();  // the client does not read
    });
    socket_.async_write(asio::buffer(next.bytes),
                        [self = shared_from_this()](error_code error, size_t) {
                          self->writing_ = false;
                          self->write_timer_.cancel();
                          if (error) return self->End();
                          self->waiting_bytes_ -= self->waiting_.front().bytes.size();
                          self->waiting_.pop_front();
                          self->Write();
                          if (self->held_ && !self->Full()) self->Read();
                        });
  }

  bool Full() const { return waiting_bytes_ > kMostWaitingBytes || waiting_.size() > kMostWaiting; }

  void Read() {
    held_ = false;
    socket_.async_read(buffer_, [self = shared_from_this()](error_code error, size_t) {
      if (error) return self->End();
      const bool text = self->socket_.got_text();
      std::string message = beast::buffers_to_string(self->buffer_.data());
      self->buffer_.consume(self->buffer_.size());
      if (!self->closed_) return;
      if (text) {
        self->service_->OnText(std::move(message));
      } else {
        return self->Enqueue({"text is expected", false, true});
      }
      self->held_ = self->Full();
      if (!self->held_) self->Read();
    });
  }

  void End() {
    auto closed = std::exchange(closed_, nullptr);
    if (!closed) return;
    service_ = nullptr;
    write_timer_.cancel();
    closed(this);
  }

  const std::shared_ptr<asio::io_context> io_;
  websocket::stream<ConnectionStream, false> socket_;
  const std::chrono::nanoseconds message_limit_;
  asio::steady_timer write_timer_;
  std::function<void(WebSocketSession*)> closed_;  // empty once closed
  std::unique_ptr<WebSocketService> service_;
  beast::flat_buffer buffer_;
  std::deque<Outgoing> waiting_;  // the first one is being written
  size_t waiting_bytes_ = 0;
  bool accepted_ = false, writing_ = false;
  bool held_ = false;  // reading is suspended because the send queue is full
};

}  // namespace

std::shared_ptr<WebSocketSession> StartWebSocket(
    std::shared_ptr<asio::io_context> io, ConnectionStream stream, const RequestMessage& request,
    std::chrono::nanoseconds message_limit,
    const std::function<std::unique_ptr<WebSocketService>(std::shared_ptr<WebSocketPeer>)>& serve,
    std::function<void(WebSocketSession*)> closed) {
  const auto session =
      std::make_shared<Session>(std::move(io), std::move(stream), message_limit, std::move(closed));
  session->Start(request, serve);
  return session;
}

}  // namespace voxeld::daemon::http
