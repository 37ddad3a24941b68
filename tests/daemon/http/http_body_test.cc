// Tests request bodies that are passed to a receiver, at the level of bytes.
#include <gmock/gmock.h>

#include <algorithm>
#include <optional>

#include "absl/strings/str_cat.h"
#include "daemon/http/http_server.h"
#include "display/sync/mutex.h"
#include "tests/daemon/http/connection.h"

namespace voxeld::daemon::http {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

using Then = std::function<void(std::optional<Response>)>;

// Records what a receiver was given, for the test's thread.
struct Taken {
  sync::Mutex mutex;
  sync::CondVar changed;
  std::string bytes VOXELD_GUARDED_BY(mutex);
  size_t pieces VOXELD_GUARDED_BY(mutex) = 0, longest VOXELD_GUARDED_BY(mutex) = 0;
  bool whole VOXELD_GUARDED_BY(mutex) = false;
  int gone VOXELD_GUARDED_BY(mutex) = 0;              // receivers that were destroyed
  std::optional<Then> held VOXELD_GUARDED_BY(mutex);  // for the last piece, if the test answers
};

class Receiver final : public BodyReceiver {
 public:
  Receiver(Taken& taken, bool hold, std::optional<size_t> room)
      : taken_(taken), hold_(hold), room_(room) {}
  ~Receiver() override {
    sync::MutexLock lock(taken_.mutex);
    ++taken_.gone;
    taken_.changed.NotifyAll();
  }
  void Take(std::string piece, Then then) override {
    {
      sync::MutexLock lock(taken_.mutex);
      taken_.bytes += piece;
      ++taken_.pieces;
      taken_.longest = std::max(taken_.longest, piece.size());
      taken_.changed.NotifyAll();
      if (hold_) {
        EXPECT_FALSE(taken_.held.has_value()) << "one piece at a time";
        taken_.held = std::move(then);
        return;
      }
      if (room_.has_value() && taken_.bytes.size() > *room_) {
        return then(Response{.status = 507, .body = "there is no room\n"});
      }
    }
    then(std::nullopt);
  }
  void Whole(Done done) override {
    sync::MutexLock lock(taken_.mutex);
    taken_.whole = true;
    done({.status = 202, .body = "all\n"});
  }

 private:
  Taken& taken_;
  const bool hold_;
  const std::optional<size_t> room_;
};

class HttpBody : public ::testing::Test {
 protected:
  void Start(ServerOptions options = {}) {
    options.listen = *ParseAddress("127.0.0.1:0");
    auto server = Server::Start(
        options, [](const Request&, const Done&) { return false; }, nullptr,
        [this](const Request& request) -> std::optional<Reception> {
          if (request.path == "/refused") {
            return Reception{.refusal = {.status = 403, .body = "not you\n"}};
          }
          if (request.path != "/take") return std::nullopt;
          return Reception{.receiver = std::make_unique<Receiver>(taken_, hold_, room_),
                           .max_bytes = max_bytes_};
        });
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }
  static std::string Head(const std::string& path, size_t length) {
    return absl::StrCat("POST ", path, " HTTP/1.1\r\nHost: x\r\nContent-Length: ", length,
                        "\r\n\r\n");
  }
  void AwaitGone() {
    sync::MutexLock lock(taken_.mutex);
    while (taken_.gone == 0) taken_.changed.Wait(taken_.mutex);
    EXPECT_FALSE(taken_.whole);
  }

  Taken taken_;
  bool hold_ = false;
  std::optional<size_t> room_;
  uint64_t max_bytes_ = 64 << 20;
  std::unique_ptr<Server> server_;
};

std::string Counting(size_t bytes) {
  std::string text(bytes, 0);
  for (size_t i = 0; i < bytes; ++i) text[i] = static_cast<char>(i * 7 + i / 251);
  return text;
}

TEST_F(HttpBody, IsTakenWholeAndAnswered) {
  Start();
  const std::string body = Counting(1 << 20);
  Connection connection(server_->address());
  connection.Send(Head("/take", body.size()) + body);
  const std::string answer = connection.ReadAll();
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 202 "));
  EXPECT_THAT(answer, HasSubstr("Connection: close\r\n"));
  EXPECT_THAT(answer, HasSubstr("\r\n\r\nall\n"));
  sync::MutexLock lock(taken_.mutex);
  EXPECT_TRUE(taken_.bytes == body);
  EXPECT_LE(taken_.longest, 64u << 10);
}

TEST_F(HttpBody, ItsConnectionMakesRoomForTheNext) {
  Start({.max_connections = 1});
  for (int i = 0; i < 3; ++i) {
    Connection connection(server_->address());
    connection.Send(Head("/take", 2) + "ab");
    EXPECT_THAT(connection.ReadAll(), StartsWith("HTTP/1.1 202 ")) << i;
  }
}

TEST_F(HttpBody, ComesInChunksToo) {
  Start();
  Connection connection(server_->address());
  connection.Send(
      "POST /take HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"
      "5\r\nhello\r\n7\r\n, world\r\n0\r\n\r\n");
  EXPECT_THAT(connection.ReadAll(), StartsWith("HTTP/1.1 202 "));
  sync::MutexLock lock(taken_.mutex);
  EXPECT_EQ(taken_.bytes, "hello, world");
}

TEST_F(HttpBody, IsSentWhenItIsWanted) {
  Start();
  Connection connection(server_->address());
  connection.Send(
      "POST /take HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\nContent-Length: 2\r\n\r\n");
  EXPECT_EQ(connection.ReadTo("\r\n\r\n"), "HTTP/1.1 100 Continue\r\n\r\n");
  connection.Send("ab");
  EXPECT_THAT(connection.ReadAll(), StartsWith("HTTP/1.1 202 "));
}

// The server holds at most one piece while the receiver is busy.
TEST_F(HttpBody, WaitsForWhoeverTakesIt) {
  hold_ = true;
  Start({.answer_limit_ns = 60 * sync::kSecond});
  const std::string body = Counting(300'000);
  Connection connection(server_->address());
  connection.Send(Head("/take", body.size()) + body);
  for (bool more = true; more;) {
    std::optional<Then> then;
    {
      sync::MutexLock lock(taken_.mutex);
      while (!taken_.held.has_value()) taken_.changed.Wait(taken_.mutex);
      then = std::exchange(taken_.held, std::nullopt);
      more = taken_.bytes.size() < body.size();
    }
    (*then)(std::nullopt);
  }
  EXPECT_THAT(connection.ReadAll(), StartsWith("HTTP/1.1 202 "));
  sync::MutexLock lock(taken_.mutex);
  EXPECT_GE(taken_.pieces, 5u);
  EXPECT_TRUE(taken_.bytes == body);
}

TEST_F(HttpBody, TooMuchIsRefused) {
  max_bytes_ = 1000;
  Start();
  Connection told(server_->address());
  told.Send(Head("/take", 1001));
  EXPECT_THAT(told.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 413 "));
  EXPECT_THAT(told.ReadTo("\n"), HasSubstr("1000 bytes"));
  Connection chunks(server_->address());
  chunks.Send(absl::StrCat("POST /take HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n",
                           "3e8\r\n", std::string(1000, 'x'), "\r\n1\r\nx\r\n0\r\n\r\n"));
  EXPECT_THAT(chunks.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 413 "));
  AwaitGone();
}

// A client that is still sending gets the answer all the same.
TEST_F(HttpBody, MayBeRefusedAtOnceAndHalfWay) {
  room_ = 100'000;
  Start();
  for (const char* path : {"/refused", "/take"}) {
    Connection connection(server_->address());
    connection.Send(Head(path, 8 << 20) + std::string(8 << 20, 'x'));
    const std::string answer = connection.ReadAll();
    EXPECT_THAT(answer,
                StartsWith(path == std::string("/take") ? "HTTP/1.1 507 " : "HTTP/1.1 403 "));
    EXPECT_THAT(answer, HasSubstr(path == std::string("/take") ? "no room" : "not you"));
  }
  AwaitGone();
  sync::MutexLock lock(taken_.mutex);
  EXPECT_LT(taken_.bytes.size(), 200'000u);
}

TEST_F(HttpBody, EndsWithItsSender) {
  Start();
  auto connection = std::make_unique<Connection>(server_->address());
  connection->Send(Head("/take", 1000) + "half");
  connection.reset();
  AwaitGone();
}

TEST_F(HttpBody, EndsWithTheServer) {
  hold_ = true;
  Start({.answer_limit_ns = 60 * sync::kSecond});
  Connection connection(server_->address());
  connection.Send(Head("/take", 1000) + "half");
  Then then;
  {
    sync::MutexLock lock(taken_.mutex);
    while (!taken_.held.has_value()) taken_.changed.Wait(taken_.mutex);
    then = *std::exchange(taken_.held, std::nullopt);
  }
  server_.reset();
  AwaitGone();
  then(std::nullopt);  // is dropped
}

TEST_F(HttpBody, EndsWhereNothingComes) {
  Start({.idle_limit_ns = 20 * sync::kMillisecond});
  Connection connection(server_->address());
  connection.Send(Head("/take", 1000) + "half");
  EXPECT_EQ(connection.ReadAll(), "");
  AwaitGone();
}

// When the receiver does not answer, for example because a disk hangs. Its later answer is ignored.
TEST_F(HttpBody, EndsWhereItIsNotTaken) {
  hold_ = true;
  Start({.answer_limit_ns = 20 * sync::kMillisecond});
  Connection connection(server_->address());
  connection.Send(Head("/take", 1000) + "half");
  EXPECT_THAT(connection.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 503 "));
  EXPECT_THAT(connection.ReadTo("\n"), HasSubstr("did not answer in time"));
  AwaitGone();
  Then then;
  {
    sync::MutexLock lock(taken_.mutex);
    then = *std::exchange(taken_.held, std::nullopt);
  }
  connection.Send("more");
  then(std::nullopt);
  then(Response{.status = 507});
  Connection other(server_->address());  // answered after all that
  other.Send("GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(other.ReadAll(), StartsWith("HTTP/1.1 404 "));
  sync::MutexLock lock(taken_.mutex);
  EXPECT_EQ(taken_.bytes, "half");
}

// Bytes keep arriving, but too few.
TEST_F(HttpBody, EndsWhereTooLittleComes) {
  max_bytes_ = uint64_t{1} << 50;
  Start({.idle_limit_ns = 20 * sync::kMillisecond, .body_bytes_per_s = uint64_t{1} << 40});
  Connection connection(server_->address());
  connection.Send(Head("/take", size_t{1} << 45));
  EXPECT_LT(connection.SendUntilClosed("x"), size_t{1} << 40);
  AwaitGone();
}

TEST_F(HttpBody, IsTakenByPostAlone) {
  Start();
  for (const char* begin : {"PUT /take", "POST /other"}) {
    Connection connection(server_->address());
    connection.Send(absl::StrCat(begin, " HTTP/1.1\r\nHost: x\r\nContent-Length: 2\r\n\r\nab"));
    EXPECT_THAT(connection.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 405 ")) << begin;
  }
}

TEST_F(HttpBody, ThatIsNoneIsRefused) {
  Start();
  Connection connection(server_->address());
  connection.Send(
      "POST /take HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nthese are no "
      "chunks\r\n");
  EXPECT_THAT(connection.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 400 "));
  AwaitGone();
}

}  // namespace
}  // namespace voxeld::daemon::http
