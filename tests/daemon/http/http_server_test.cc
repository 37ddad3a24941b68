// Tests the server at the level of bytes.
#include "daemon/http/http_server.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"
#include "tests/daemon/http/connection.h"

namespace voxeld::daemon::http {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string Get(const std::string& path) {
  return absl::StrCat("GET ", path, " HTTP/1.1\r\nHost: x\r\n\r\n");
}

class HttpServer : public ::testing::Test {
 protected:
  void Start(ServerOptions options = {}) {
    if (!options.listen.unix_socket) options.listen = *ParseAddress("127.0.0.1:0");
    auto server = Server::Start(options, [this](const Request& request, Done done) {
      const std::string_view path = request.path;
      if (path == "/hello") done({.body = "hello\n"});
      if (path == "/later") {
        sync::MutexLock lock(mutex_);
        waiting_.push_back(std::move(done));
        changed_.NotifyAll();
      }
      return path == "/hello" || path == "/later";
    });
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }

  std::string Ask(const std::string& request) {
    Connection connection(server_->address());
    connection.Send(request);
    const std::string head = connection.ReadTo("\r\n\r\n");
    return absl::StrCat(head, connection.ReadTo("\n"));
  }

  Done TakeWaiting() {
    sync::MutexLock lock(mutex_);
    while (waiting_.empty()) changed_.Wait(mutex_);
    Done done = std::move(waiting_.back());
    waiting_.pop_back();
    return done;
  }

  sync::Mutex mutex_;
  sync::CondVar changed_;
  std::vector<Done> waiting_ VOXELD_GUARDED_BY(mutex_);
  std::unique_ptr<Server> server_;
};

TEST_F(HttpServer, AnswersWhatItKnows) {
  Start();
  const std::string answer = Ask(Get("/hello?x=1"));
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_THAT(answer, HasSubstr("Content-Length: 6\r\n"));
  EXPECT_THAT(answer, EndsWith("\r\n\r\nhello\n"));
  EXPECT_THAT(Ask(Get("/nothing")), StartsWith("HTTP/1.1 404 "));
  const std::string refused = Ask("POST /hello HTTP/1.1\r\nHost: x\r\nContent-Length: 2\r\n\r\nab");
  EXPECT_THAT(refused, StartsWith("HTTP/1.1 405 "));
  EXPECT_THAT(refused, HasSubstr("Allow: GET, HEAD\r\n"));
}

TEST_F(HttpServer, SeveralHostHeadersAreRefused) {
  Start();
  for (const char* method : {"GET", "POST", "PUT"}) {
    for (const char* second : {"x", "y", ""}) {
      EXPECT_THAT(
          Ask(absl::StrCat(method, " /hello HTTP/1.1\r\nHost: x\r\nhost: ", second, "\r\n\r\n")),
          StartsWith("HTTP/1.1 400 "))
          << method << second;
    }
  }
}

TEST_F(HttpServer, HeadHasNoBodyAndTheConnectionGoesOn) {
  Start();
  Connection connection(server_->address());
  connection.Send("HEAD /hello HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(connection.ReadTo("\r\n\r\n"), HasSubstr("Content-Length: 6\r\n"));
  connection.Send(Get("/hello"));
  EXPECT_THAT(connection.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 200 "));
  EXPECT_EQ(connection.ReadTo("\n"), "hello\n");
  connection.Send("GET /hello HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(connection.ReadAll(), EndsWith("hello\n"));
}

TEST_F(HttpServer, RefusesWhatIsNoRequest) {
  Start();
  Connection garbage(server_->address());
  garbage.Send("\x16\x03\x01 this is not HTTP\r\n\r\n");
  const std::string answer = garbage.ReadAll();
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(answer, HasSubstr("\r\n\r\nbad request: "));
  Connection large(server_->address());
  large.Send(absl::StrCat("GET /hello HTTP/1.1\r\nX: ", std::string(20'000, 'x'), "\r\n\r\n"));
  EXPECT_THAT(large.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 431 "));
  Connection body(server_->address());
  body.Send("POST /hello HTTP/1.1\r\nHost: x\r\nContent-Length: 1000000\r\n\r\n");
  EXPECT_THAT(body.ReadAll(), StartsWith("HTTP/1.1 413 ")) << "and the connection ends";
  EXPECT_THAT(Ask(Get("/hello")), StartsWith("HTTP/1.1 200 ")) << "the others are served";
}

TEST_F(HttpServer, HowMuchOfAHeaderIsReadIsAnOption) {
  Start({.max_header_bytes = 300});
  const auto ask = [&](size_t padding) {
    Connection connection(server_->address());
    connection.Send(absl::StrCat("GET /hello HTTP/1.1\r\nHost: x\r\nConnection: close\r\nX: ",
                                 std::string(padding, 'x'), "\r\n\r\n"));
    return connection.ReadAll();
  };
  EXPECT_THAT(ask(200), StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(ask(300), StartsWith("HTTP/1.1 431 ")) << "and the connection ends";
}

std::string AskForAWebSocket(const std::string& path) {
  return absl::StrCat(
      "GET ", path,
      " HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
      "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dm94ZWxzIGFyZSBsaXQhIQ==\r\n\r\n");
}

TEST_F(HttpServer, AWebSocketThatIsRefusedIsToldWhy) {
  const auto server = Server::Start(
      {.listen = *ParseAddress("127.0.0.1:0")}, [](const Request&, const Done&) { return false; },
      [](const Request& request) -> absl::StatusOr<ServeWebSocket> {
        if (request.path == "/none") return absl::NotFoundError("there is none");
        if (request.path == "/full") return absl::ResourceExhaustedError("all are taken");
        return absl::PermissionDeniedError("not you");
      });
  ASSERT_TRUE(server.ok()) << server.status();
  for (const auto& [path, code, why] : {std::tuple{"/none", "404", "there is none"},
                                        {"/full", "503", "all are taken"},
                                        {"/secret", "403", "not you"}}) {
    Connection connection((*server)->address());
    connection.Send(AskForAWebSocket(path));
    const std::string answer = connection.ReadAll();
    EXPECT_THAT(answer, StartsWith(absl::StrCat("HTTP/1.1 ", code, " ")));
    EXPECT_THAT(answer, HasSubstr(why));
  }
}

TEST_F(HttpServer, WhereThereAreNoWebSocketsThatIsARequestLikeOthers) {
  Start();
  EXPECT_THAT(Ask(AskForAWebSocket("/hello")), EndsWith("hello\n"));
}

// While this lives, the process can open only about that many more descriptors.
class FewDescriptors {
 public:
  explicit FewDescriptors(rlim_t more) {
    const int next = open("/dev/null", O_RDONLY | O_CLOEXEC);
    EXPECT_GE(next, 0);
    close(next);
    EXPECT_EQ(getrlimit(RLIMIT_NOFILE, &before_), 0);
    const rlimit few = {.rlim_cur = static_cast<rlim_t>(next) + more, .rlim_max = before_.rlim_max};
    EXPECT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
  }
  ~FewDescriptors() { EXPECT_EQ(setrlimit(RLIMIT_NOFILE, &before_), 0); }

 private:
  rlimit before_ = {};
};

TEST_F(HttpServer, WithoutDescriptorsItsStartIsAnError) {
  const auto start = [] {
    return Server::Start({.listen = *ParseAddress("127.0.0.1:0")},
                         [](const Request&, const Done&) { return false; })
        .status();
  };
  ASSERT_TRUE(start().ok()) << "and what is created once exists";
  bool waits = true, listens = true;  // in every try, each of these got a descriptor
  absl::Status status;
  for (rlim_t more = 0; more < 10; ++more) {
    {
      const FewDescriptors few(more);
      status = start();
    }
    if (status.ok()) break;
    EXPECT_THAT(std::string(status.message()), HasSubstr("Too many open files"));
    if (absl::StrContains(status.message(), "no descriptor or thread for http")) waits = false;
    if (absl::StrContains(status.message(), "127.0.0.1:0 cannot be listened on")) listens = false;
  }
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_FALSE(waits);
  EXPECT_FALSE(listens);
}

TEST_F(HttpServer, WhoCannotBeAcceptedIsToldAndAcceptedLater) {
  sync::Mutex mutex;
  std::vector<std::string> told;
  Start({.accept_failed = [&](const std::string& why) {
    sync::MutexLock lock(mutex);
    told.push_back(why);
  }});
  const auto times = [&] {
    sync::MutexLock lock(mutex);
    return told.size();
  };
  for (size_t i = 1; i <= 2; ++i) {
    Connection connection;  // whose socket already exists
    {
      const FewDescriptors none(0);
      connection.Connect(server_->address());
      while (times() < i) std::this_thread::yield();
    }
    connection.Send(Get("/hello"));
    EXPECT_THAT(connection.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 200 "));
  }
  sync::MutexLock lock(mutex);
  // Once until one has been accepted; the server may have tried to accept the next before the first
  // was answered.
  EXPECT_LE(told.size(), 3u);
  for (const std::string& why : told) EXPECT_EQ(why, "Too many open files");
}

TEST_F(HttpServer, WhatEndsInItsMidstIsNotAnswered) {
  Start();
  for (const char* part :
       {"", "GET /hel", "POST /hello HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nabc"}) {
    Connection connection(server_->address());
    connection.Send(part);
    connection.FinishSending();
    EXPECT_EQ(connection.ReadAll(), "") << part;
  }
}

TEST_F(HttpServer, ABodyThatIsThrownAwayHasALimit) {
  Start();
  const auto post = [&](size_t size) {
    return Ask(absl::StrCat("POST /hello HTTP/1.1\r\nHost: x\r\nContent-Length: ", size, "\r\n\r\n",
                            std::string(size, 'b')));
  };
  EXPECT_THAT(post(4096), StartsWith("HTTP/1.1 405 "));
  EXPECT_THAT(Ask("POST /hello HTTP/1.1\r\nHost: x\r\nContent-Length: 4097\r\n\r\n"),
              StartsWith("HTTP/1.1 413 "));
  // The length of the body is not specified.
  Connection chunks(server_->address());
  chunks.Send("POST /hello HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n2000\r\n");
  EXPECT_THAT(chunks.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 413 "));
}

TEST_F(HttpServer, TheConnectionEndsWhereTheRequestSaysSo) {
  Start();
  Connection old(server_->address());
  old.Send("GET /hello HTTP/1.0\r\n\r\n");
  EXPECT_THAT(old.ReadAll(), EndsWith("hello\n"));
  Connection kept(server_->address());
  kept.Send("GET /hello HTTP/1.0\r\nConnection: keep-alive\r\n\r\n");
  EXPECT_THAT(kept.ReadTo("hello\n"), StartsWith("HTTP/1."));
  kept.Send("GET /hello HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(kept.ReadAll(), EndsWith("hello\n"));
}

TEST_F(HttpServer, WhatIsAskedIsTakenApart) {
  std::vector<std::string> asked;
  auto server = Server::Start(
      {.listen = *ParseAddress("127.0.0.1:0")}, [&](const Request& request, const Done& done) {
        asked = {std::string(request.path),   std::string(request.query),
                 std::string(request.host),   std::string(request.origin),
                 std::string(request.cookie), std::string(request.accept_encoding)};
        done({.body = "yes\n"});
        return true;
      });
  ASSERT_TRUE(server.ok()) << server.status();
  Connection connection((*server)->address());
  const auto ask = [&](const std::string& request) {
    connection.Send(request);
    EXPECT_THAT(connection.ReadTo("yes\n"), StartsWith("HTTP/1.1 200 "));
    return asked;
  };
  using Parts = std::vector<std::string>;
  EXPECT_EQ(ask("GET /a?b=c?d HTTP/1.1\r\nHost: h:1\r\nOrigin: http://o\r\nCookie: k=v; "
                "l=w\r\nAccept-Encoding: gzip\r\n\r\n"),
            (Parts{"/a", "b=c?d", "h:1", "http://o", "k=v; l=w", "gzip"}));
  EXPECT_EQ(ask("GET /a? HTTP/1.1\r\nHost: h\r\n\r\n"), (Parts{"/a", "", "h", "", "", ""}));
  EXPECT_EQ(ask("GET ?x HTTP/1.1\r\n\r\n"), (Parts{"", "x", "", "", "", ""}));
}

TEST_F(HttpServer, AnswersMayComeLaterFromAnotherThread) {
  Start();
  Connection connection(server_->address());
  connection.Send(Get("/later"));
  std::thread thread([this] { TakeWaiting()({.status = 503, .body = "late\n"}); });
  EXPECT_THAT(connection.ReadTo("late\n"), StartsWith("HTTP/1.1 503 "));
  thread.join();
}

TEST_F(HttpServer, DoesNotWaitForAnAnswerForEver) {
  Start({.answer_limit_ns = 20 * sync::kMillisecond});
  Connection connection(server_->address());
  connection.Send(Get("/later"));
  EXPECT_THAT(connection.ReadTo("in time\n"), StartsWith("HTTP/1.1 503 "));
  TakeWaiting()({.body = "too late\n"});  // is dropped
  connection.Send(Get("/hello"));
  EXPECT_THAT(connection.ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServer, WhoWaitsForAnAnswerIsNotIdle) {
  Start({.idle_limit_ns = 20 * sync::kMillisecond, .answer_limit_ns = 80 * sync::kMillisecond});
  Connection connection(server_->address());
  connection.Send(Get("/later"));
  EXPECT_THAT(connection.ReadTo("in time\n"), StartsWith("HTTP/1.1 503 "));
}

bool StartsWithOk(const std::string& answer) { return absl::StartsWith(answer, "HTTP/1.1 200 "); }

TEST_F(HttpServer, WhoDoesNotReadAnAnswerMakesRoomForOthers) {
  const std::string body(64 << 20, 'b');  // more than fits into the buffers of sockets
  const auto server = Server::Start({.listen = *ParseAddress("127.0.0.1:0"),
                                     .max_connections = 1,
                                     .idle_limit_ns = 20 * sync::kMillisecond},
                                    [&](const Request& request, const Done& done) {
                                      done({.body = request.path == "/long" ? body : "short\n"});
                                      return true;
                                    });
  ASSERT_TRUE(server.ok()) << server.status();
  Connection reads_nothing((*server)->address());
  reads_nothing.Send(Get("/long"));
  std::string answer;
  while (!StartsWithOk(answer)) {
    Connection next((*server)->address());
    next.Send(Get("/short"));
    answer = next.ReadTo("\r\n\r\n");
    ASSERT_TRUE(StartsWithOk(answer) || absl::StartsWith(answer, "HTTP/1.1 503 ")) << answer;
  }
}

TEST_F(HttpServer, ClosesIdleConnections) {
  Start({.idle_limit_ns = 20 * sync::kMillisecond});
  Connection connection(server_->address());
  connection.Send("GET /hel");
  EXPECT_EQ(connection.ReadAll(), "");
}

TEST_F(HttpServer, ConnectionsThatSayNothingKeepNobodyAway) {
  Start({.max_connections = 2});
  std::vector<std::unique_ptr<Connection>> silent;
  for (int i = 0; i < 40; ++i) {
    silent.push_back(std::make_unique<Connection>(server_->address()));
    if (i % 2 == 0) silent.back()->Send("GET /hel");  // nor do those that never finish a request
  }
  EXPECT_THAT(Ask(Get("/hello")), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServer, MoreThanMayWaitAreClosedOldestFirst) {
  Start();
  std::vector<std::unique_ptr<Connection>> silent;
  for (size_t i = 0; i < Server::kMostWaiting + 20; ++i) {
    silent.push_back(std::make_unique<Connection>(server_->address()));
  }
  EXPECT_THAT(Ask(Get("/hello")), StartsWith("HTTP/1.1 200 "));
  EXPECT_EQ(silent.front()->ReadAll(), "") << "it was closed";
  EXPECT_FALSE(silent.back()->Readable());
}

TEST_F(HttpServer, TheConnectionThatIsIdleLongestGivesUpItsPlace) {
  Start({.max_connections = 2});
  std::vector<std::unique_ptr<Connection>> kept;
  for (int i = 0; i < 3; ++i) {
    kept.push_back(std::make_unique<Connection>(server_->address()));
    kept.back()->Send(Get("/hello"));
    EXPECT_THAT(kept.back()->ReadTo("hello\n"), StartsWith("HTTP/1.1 200 ")) << i;
  }
  EXPECT_EQ(kept[0]->ReadAll(), "") << "it was closed";
  kept[1]->Send(Get("/hello"));
  EXPECT_THAT(kept[1]->ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServer, WhereAllAreAtWorkARequestIsRefusedButForReservedPaths) {
  Start({.max_connections = 2, .reserved_paths = {"/hello"}});
  Connection first(server_->address()), second(server_->address());
  first.Send(Get("/later"));
  second.Send(Get("/later"));
  std::vector<Done> work = {TakeWaiting(), TakeWaiting()};
  const std::string refused = Ask(Get("/later"));
  EXPECT_THAT(refused, StartsWith("HTTP/1.1 503 "));
  EXPECT_THAT(refused, HasSubstr("2 requests and WebSockets are being served, which is "
                                 "max_http_connections"));
  for (int i = 0; i < 20; ++i) {
    EXPECT_THAT(Ask(Get("/hello")), StartsWith("HTTP/1.1 200 ")) << i;
  }
  // A connection that is kept open after such a request yields its place to no other, and may not
  // send another request itself.
  Connection kept(server_->address());
  kept.Send(Get("/hello"));
  EXPECT_THAT(kept.ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(Ask(Get("/later")), StartsWith("HTTP/1.1 503 "));
  Connection again(server_->address());
  again.Send(Get("/hello"));
  EXPECT_THAT(again.ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
  again.Send(Get("/later"));
  EXPECT_THAT(again.ReadTo("\r\n\r\n"), StartsWith("HTTP/1.1 503 "));
  for (Done& done : work) done({.body = "done\n"});
  EXPECT_THAT(first.ReadTo("done\n"), StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(second.ReadTo("done\n"), StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(Ask(Get("/nothing")), StartsWith("HTTP/1.1 404 ")) << "there are places again";
}

TEST_F(HttpServer, OneAddressDoesNotGetAllPlaces) {
  Start({.max_connections = 8, .reserved_paths = {"/hello"}});
  std::vector<std::unique_ptr<Connection>> greedy;
  std::vector<Done> work;
  for (int i = 0; i < 7; ++i) {
    greedy.push_back(std::make_unique<Connection>(server_->address(), "127.0.0.2"));
    greedy.back()->Send(Get("/later"));
    work.push_back(TakeWaiting());
  }
  Connection eighth(server_->address(), "127.0.0.2");
  eighth.Send(Get("/later"));
  const std::string refused = absl::StrCat(eighth.ReadTo("\r\n\r\n"), eighth.ReadTo("\n"));
  EXPECT_THAT(refused, StartsWith("HTTP/1.1 503 "));
  EXPECT_THAT(refused, HasSubstr("7 requests and WebSockets from 127.0.0.2 are being served"));
  // Health is still answered, and other clients are served.
  Connection health(server_->address(), "127.0.0.2");
  health.Send(Get("/hello"));
  EXPECT_THAT(health.ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
  Connection other(server_->address(), "127.0.0.3");
  other.Send(Get("/later"));
  work.push_back(TakeWaiting());
  for (Done& done : work) done({.body = "done\n"});
  EXPECT_THAT(other.ReadTo("done\n"), StartsWith("HTTP/1.1 200 "));
  // An idle connection from the same address yields its place.
  EXPECT_THAT(greedy[0]->ReadTo("done\n"), StartsWith("HTTP/1.1 200 "));
  Connection next(server_->address(), "127.0.0.2");
  next.Send(Get("/later"));
  TakeWaiting()({.body = "done\n"});
  EXPECT_THAT(next.ReadTo("done\n"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServer, TheAddressWithMostIdleConnectionsGivesUpAPlace) {
  Start({.max_connections = 4});
  const auto served = [this](const char* from) {
    auto connection = std::make_unique<Connection>(server_->address(), from);
    connection->Send(Get("/hello"));
    EXPECT_THAT(connection->ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
    return connection;
  };
  const auto modest = served("127.0.0.2");  // idle longest, but alone
  const auto first = served("127.0.0.3");
  std::vector<std::unique_ptr<Connection>> many;
  for (int i = 0; i < 2; ++i) many.push_back(served("127.0.0.3"));
  const auto fifth = served("127.0.0.4");
  EXPECT_EQ(first->ReadAll(), "") << "it was closed";
  modest->Send(Get("/hello"));
  EXPECT_THAT(modest->ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServer, ThePortIsThereForTheNextAtOnce) {
  Start();
  Connection open(
      server_->address());  // which the server closes, and its system remembers for a minute
  open.Send(Get("/hello"));
  EXPECT_THAT(open.ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
  const Address address = server_->address();
  server_.reset();
  const auto next =
      Server::Start({.listen = address}, [](const Request&, const Done&) { return false; });
  EXPECT_TRUE(next.ok()) << next.status();
}

TEST_F(HttpServer, MayGoBeforeItsAnswers) {
  Start();
  Connection connection(server_->address());
  connection.Send(Get("/later"));
  const Done done = TakeWaiting();
  server_.reset();
  done({.body = "nobody hears\n"});
  EXPECT_EQ(connection.ReadAll(), "");
}

TEST_F(HttpServer, MayGoWhenAllItsConnectionsAreTaken) {
  Start({.max_connections = 1});
  Connection only(server_->address());
  only.Send(Get("/hello"));
  EXPECT_THAT(only.ReadTo("hello\n"), StartsWith("HTTP/1.1 200 "));
  server_.reset();
  EXPECT_EQ(only.ReadAll(), "");
}

TEST_F(HttpServer, ServesAUnixSocketAndRemovesIt) {
  const std::string path = absl::StrCat(::testing::TempDir(), "/voxeld-http-", getpid(), ".sock");
  Start({.listen = *ParseAddress(absl::StrCat("unix:", path))});
  EXPECT_THAT(Ask(Get("/hello")), StartsWith("HTTP/1.1 200 "));
  struct stat file;
  ASSERT_EQ(stat(path.c_str(), &file), 0);
  EXPECT_EQ(file.st_mode & 07777, mode_t{0660});
  server_.reset();
  EXPECT_NE(access(path.c_str(), F_OK), 0);
}

TEST_F(HttpServer, ABusyPortIsAnError) {
  Start();
  const auto second =
      Server::Start({.listen = server_->address()}, [](const Request&, Done) { return false; });
  EXPECT_TRUE(absl::IsAlreadyExists(second.status())) << second.status();
}

TEST_F(HttpServer, AnAddressThatCannotBeListenedOnIsNamed) {
  const auto why = [](const std::string& address) {
    ServerOptions options{.listen = *ParseAddress("127.0.0.1:0")};
    if (address.starts_with("unix:")) {
      options.listen = *ParseAddress(address);
    } else {
      options.listen.host = address;
    }
    return Server::Start(options, [](const Request&, const Done&) { return false; }).status();
  };
  // Reserved for documentation (RFC 5737): no machine has it.
  EXPECT_THAT(std::string(why("192.0.2.1").message()),
              HasSubstr("192.0.2.1:0 cannot be listened on"));
  // A name with a part that is too long is invalid (RFC 1035).
  const absl::Status unknown = why(std::string(64, 'x') + ".invalid");
  EXPECT_TRUE(absl::IsInvalidArgument(unknown)) << unknown;
  EXPECT_THAT(std::string(unknown.message()), HasSubstr("is not known"));
  EXPECT_FALSE(why(absl::StrCat("unix:", ::testing::TempDir(), "/no/such/folder/socket")).ok());
}

}  // namespace
}  // namespace voxeld::daemon::http
