#include "daemon/http/body_session.h"

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http/read.hpp>
#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "daemon/http/response_message.h"

namespace voxeld::daemon::http {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace wire = boost::beast::http;
using boost::system::error_code;
using std::chrono::steady_clock;

constexpr size_t kPieceBytes = 64 << 10;
constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";

class TakenBody final : public BodySession, public std::enable_shared_from_this<TakenBody> {
 public:
  TakenBody(std::shared_ptr<asio::io_context> io, ConnectionStream stream,
            beast::flat_buffer buffer, std::unique_ptr<BodyParser> parser, Reception reception,
            const ServerOptions& options, std::function<void(BodySession*)> closed)
      : io_(std::move(io)),
        stream_(std::move(stream)),
        timer_(io_->get_executor()),
        options_(options),
        buffer_(std::move(buffer)),
        parser_(std::move(parser)),
        receiver_(std::move(reception.receiver)),
        max_bytes_(reception.max_bytes),
        began_(steady_clock::now()),
        closed_(std::move(closed)) {}

  void Start(Response refusal) {
    if (receiver_ == nullptr) return Answer(std::move(refusal));
    const auto length = parser_->content_length();
    if (length.has_value() && *length > max_bytes_) return TooLarge();
    parser_->body_limit(max_bytes_);
    const auto expect = parser_->get()[wire::field::expect];
    if (!absl::EqualsIgnoreCase(absl::string_view(expect.data(), expect.size()), "100-continue")) {
      return ReadPiece();
    }
    stream_.expires_after(std::chrono::nanoseconds(options_.idle_limit_ns));
    WriteAll(stream_, kContinue, {}, [self = shared_from_this()](error_code error) {
      if (error) return self->Close();
      self->ReadPiece();
    });
  }

  void Close() override {
    auto closed = std::exchange(closed_, nullptr);
    if (!closed) return;
    error_code ignored;
    timer_.cancel();
    stream_.socket().shutdown(ConnectionStream::socket_type::shutdown_both, ignored);
    stream_.close();
    receiver_ = nullptr;
    closed(this);
  }

 private:
  // The next piece must arrive within the idle limit, and the whole body at the minimum average
  // rate.
  steady_clock::time_point Deadline() const {
    const std::chrono::nanoseconds idle(options_.idle_limit_ns);
    const std::chrono::seconds whole(received_ / std::max<uint64_t>(1, options_.body_bytes_per_s));
    return std::min(steady_clock::now() + idle, began_ + idle + whole);
  }

  void ReadPiece() {
    if (!closed_) return;
    if (parser_->is_done()) return Whole();
    auto& body = parser_->get().body();
    body.data = piece_.data();
    body.size = piece_.size();
    body.more = true;
    stream_.expires_at(Deadline());
    wire::async_read_some(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](error_code error, size_t) { self->OnPiece(error); });
  }

  void OnPiece(const error_code& error) {
    if (!closed_) return;
    if (error && error != wire::error::need_buffer) {
      if (error == wire::error::body_limit) return TooLarge();
      const bool gone = error == wire::error::end_of_stream ||
                        error == wire::error::partial_message ||
                        error.category() != make_error_code(wire::error::bad_method).category();
      if (gone) return Close();
      return Answer(PlainResponse(400, absl::StrCat("bad request: ", error.message())));
    }
    const size_t size = piece_.size() - parser_->get().body().size;
    if (size == 0) return ReadPiece();
    received_ += size;
    const uint64_t number = Await();
    receiver_->Take(std::string(piece_.data(), size),
                    [io = io_, weak = weak_from_this(), number](std::optional<Response> refused) {
                      asio::post(*io, [weak, number, refused = std::move(refused)]() mutable {
                        const auto self = weak.lock();
                        if (self == nullptr || !self->Awaits(number)) return;
                        if (refused.has_value()) return self->Answer(*std::move(refused));
                        self->timer_.cancel();
                        ++self->awaited_;
                        self->ReadPiece();
                      });
                    });
  }

  void Whole() {
    const uint64_t number = Await();
    receiver_->Whole([io = io_, weak = weak_from_this(), number](Response answer) {
      asio::post(*io, [weak, number, answer = std::move(answer)]() mutable {
        const auto self = weak.lock();
        if (self != nullptr && self->Awaits(number)) self->Answer(std::move(answer));
      });
    });
  }

  // Starts waiting for the receiver's answer; reading is suspended meanwhile. Returns: the number
  // of this wait.
  uint64_t Await() {
    stream_.expires_never();
    const uint64_t number = ++awaited_;
    timer_.expires_after(std::chrono::nanoseconds(options_.answer_limit_ns));
    timer_.async_wait([self = shared_from_this(), number](error_code error) {
      // The handler may already have been queued when the timer was cancelled.
      if (error || !self->Awaits(number)) return;
      self->Answer(PlainResponse(503, "the daemon did not answer in time"));
    });
    return number;
  }
  bool Awaits(uint64_t number) const {
    return closed_ && !response_.has_value() && number == awaited_;
  }

  void TooLarge() {
    Answer(PlainResponse(
        413, absl::StrCat("the body is too large: ", max_bytes_, " bytes are taken at the most")));
  }

  // Sends the response. Only the first one counts.
  void Answer(Response answer) {
    if (!closed_ || response_.has_value()) return;
    timer_.cancel();
    receiver_ = nullptr;
    response_.emplace(ToMessage(std::move(answer), true, false));
    stream_.expires_after(std::chrono::nanoseconds(options_.idle_limit_ns));
    WriteAll(stream_, response_->head, response_->body,
             [self = shared_from_this()](error_code error) {
               if (error || self->parser_->is_done()) return self->Close();
               self->stream_.socket().shutdown(ConnectionStream::socket_type::shutdown_send, error);
               self->stream_.expires_after(std::chrono::nanoseconds(self->options_.idle_limit_ns));
               self->Linger();
             });
  }

  // Keeps reading after the response. If the connection were closed while data arrives, the
  // client's system would discard the response.
  void Linger() {
    if (!closed_) return;
    stream_.async_read_some(asio::buffer(piece_),
                            [self = shared_from_this()](error_code error, size_t) {
                              if (error) return self->Close();
                              self->Linger();
                            });
  }

  const std::shared_ptr<asio::io_context> io_;
  ConnectionStream stream_;
  asio::steady_timer timer_;
  const ServerOptions& options_;
  beast::flat_buffer buffer_;
  const std::unique_ptr<BodyParser> parser_;
  std::unique_ptr<BodyReceiver> receiver_;  // null after the response
  const uint64_t max_bytes_;
  const steady_clock::time_point began_;
  uint64_t received_ = 0;
  uint64_t awaited_ = 0;  // number of the wait for the receiver
  std::array<char, kPieceBytes> piece_;
  std::optional<ResponseMessage> response_;
  std::function<void(BodySession*)> closed_;  // empty once closed
};

}  // namespace

std::shared_ptr<BodySession> StartBody(std::shared_ptr<asio::io_context> io,
                                       ConnectionStream stream, beast::flat_buffer buffer,
                                       std::unique_ptr<BodyParser> parser, Reception reception,
                                       const ServerOptions& options,
                                       std::function<void(BodySession*)> closed) {
  Response refusal = std::move(reception.refusal);
  const auto session = std::make_shared<TakenBody>(
      std::move(io), std::move(stream), std::move(buffer), std::move(parser), std::move(reception),
      options, std::move(closed));
  session->Start(std::move(refusal));
  return session;
}

}  // namespace voxeld::daemon::http
