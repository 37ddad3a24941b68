// Tests files that pages send over HTTP: who may send them, and which messages all pages receive.
// Scripts run in place of voxelctl.
#include "daemon/viewer/viewer_play.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <atomic>
#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "absl/strings/str_cat.h"
#include "daemon/viewer/viewer.h"
#include "tests/daemon/play/no_threads.h"

namespace voxeld::daemon::viewer {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kOrigin[] = "http://localhost:8088";

// Sets the folder of temporary files while it exists.
class TemporaryFiles {
 public:
  explicit TemporaryFiles(const std::string& path) {
    const char* const before = std::getenv("TMPDIR");
    if (before != nullptr) before_ = before;
    setenv("TMPDIR", path.c_str(), 1);
  }
  ~TemporaryFiles() {
    before_.has_value() ? setenv("TMPDIR", before_->c_str(), 1) : unsetenv("TMPDIR");
  }
  TemporaryFiles(const TemporaryFiles&) = delete;
  TemporaryFiles& operator=(const TemporaryFiles&) = delete;

 private:
  std::optional<std::string> before_;
};

class ViewerPlayTest : public ::testing::Test {
 protected:
  using Fields = std::vector<std::pair<std::string, std::string>>;
  using Page = boost::beast::websocket::stream<boost::asio::ip::tcp::socket>;

  void SetUp() override {
    absl::StatusOr<play::PrivateFolder> folder = play::PrivateFolder::Make();
    ASSERT_TRUE(folder.ok());
    folder_.emplace(*std::move(folder));
    auto audit = access::Audit::Open({.path = folder_->path() + "/audit"}, nullptr);
    ASSERT_TRUE(audit.ok());
    audit_ = *std::move(audit);
    core_ = std::make_unique<Core>(CoreOptions{.version = "1.2"}, clock_);
    ASSERT_TRUE(core_->Start().ok());
  }
  void TearDown() override {
    server_.reset();
    viewer_.reset();
    player_.reset();
    EXPECT_TRUE(core_->Stop(10 * sync::kSecond).ok());
  }

  void StartPlayer(const std::string& script) {
    const std::string program = folder_->path() + "/voxelctl";
    std::ofstream(program) << "#!/bin/sh\n" << script << "\n";
    chmod(program.c_str(), 0700);
    auto player = play::Player::Make({.program = program, .server = "unix:/nowhere"});
    ASSERT_TRUE(player.ok()) << player.status();
    player_ = *std::move(player);
  }

  // If `script` is empty, nothing can be played.
  void Start(const std::string& script, ViewerPlayOptions options = {},
             sync::TimeNs answer_limit = 60 * sync::kSecond) {
    if (script.empty()) {
      options.why_not = "there is no voxelctl";
    } else {
      ASSERT_NO_FATAL_FAILURE(StartPlayer(script));
      options.player = player_.get();
    }
    auto viewer =
        Viewer::Make(*core_, clock_, {.version = "1.2", .audit = audit_.get(), .play = options});
    ASSERT_TRUE(viewer.ok());
    viewer_ = *std::move(viewer);
    auto server = http::Server::Start(
        {.listen = *ParseAddress("127.0.0.1:0"), .answer_limit_ns = answer_limit},
        viewer_->Handler([](const http::Request&, const http::Done&) { return false; }),
        viewer_->Upgrade(), viewer_->Receive());
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    const std::string address = viewer_->ControlAddress(server_->address());
    const auto given =
        Ask(boost::beast::http::verb::get, address.substr(address.find("/control")), {}, "");
    const auto field = given["Set-Cookie"];
    cookie_ = std::string(field.data(), field.find(';'));
  }

  boost::asio::ip::tcp::socket Connect() {
    boost::asio::ip::tcp::socket socket(io_);
    socket.connect({boost::asio::ip::make_address("127.0.0.1"), server_->address().port});
    return socket;
  }

  using Answer = boost::beast::http::response<boost::beast::http::string_body>;
  Answer Ask(boost::beast::http::verb verb, const std::string& path, const Fields& fields,
             const std::string& body) {
    boost::asio::ip::tcp::socket socket = Connect();
    boost::beast::http::request<boost::beast::http::string_body> request(verb, path, 11);
    request.set(boost::beast::http::field::host, "localhost:8088");
    for (const auto& [name, value] : fields) request.set(name, value);
    request.body() = body;
    request.prepare_payload();
    boost::beast::http::write(socket, request);
    boost::beast::flat_buffer buffer;
    Answer response;
    boost::beast::http::read(socket, buffer, response);
    return response;
  }
  Answer Post(const std::string& path, const std::string& body = "v 0 0 0\n") {
    return Ask(boost::beast::http::verb::post, path, {{"Origin", kOrigin}, {"Cookie", cookie_}},
               body);
  }

  std::unique_ptr<Page> Open(bool control) {
    auto page = std::make_unique<Page>(Connect());
    page->set_option(boost::beast::websocket::stream_base::decorator(
        [&](boost::beast::websocket::request_type& request) {
          if (control) request.set("Cookie", cookie_);
        }));
    page->handshake("localhost:8088", "/volumes");
    Say(*page, {{"hello", true}});
    EXPECT_EQ(HearOf(*page, "hello")["control"], control);
    return page;
  }
  static void Say(Page& page, const nlohmann::json& message) {
    page.write(boost::asio::buffer(message.dump()));
  }
  // Reads the next message, which must have `key`.
  static nlohmann::json HearOf(Page& page, const std::string& key) {
    boost::beast::flat_buffer buffer;
    page.read(buffer);
    const auto message =
        nlohmann::json::parse(boost::beast::buffers_to_string(buffer.data()), nullptr, false);
    EXPECT_TRUE(message.contains(key)) << message;
    return message.value(key, nlohmann::json());
  }

  std::string Audited() {
    std::ifstream file(folder_->path() + "/audit");
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

  sync::SystemClock clock_;
  boost::asio::io_context io_;
  std::optional<play::PrivateFolder> folder_;
  std::unique_ptr<access::Audit> audit_;
  std::unique_ptr<Core> core_;
  std::unique_ptr<play::Player> player_;
  std::unique_ptr<Viewer> viewer_;
  std::unique_ptr<http::Server> server_;
  std::string cookie_;
};

constexpr char kPlays[] = "exec tail -f /dev/null";

TEST_F(ViewerPlayTest, PagesWithControlAreToldWhatPlays) {
  Start(kPlays, {.max_bytes = 1000});
  const auto one = Open(true), two = Open(true);
  for (Page* page : {one.get(), two.get()}) {
    EXPECT_EQ(HearOf(*page, "play"), (nlohmann::json{{"max_bytes", 1000}}));
  }
  const Answer taken = Post("/play?name=t%C3%A9a%20pot.obj");
  EXPECT_EQ(taken.result_int(), 202u) << taken.body();
  for (Page* page : {one.get(), two.get()}) {
    EXPECT_EQ(HearOf(*page, "play"),
              (nlohmann::json{{"max_bytes", 1000}, {"playing", "téa pot.obj"}}));
  }
  const auto late = Open(true);
  EXPECT_EQ(HearOf(*late, "play")["playing"], "téa pot.obj");
  Say(*two, {{"stop", true}});
  for (Page* page : {one.get(), two.get(), late.get()}) {
    EXPECT_EQ(HearOf(*page, "play"), (nlohmann::json{{"max_bytes", 1000}}));
  }
  EXPECT_THAT(Audited(), HasSubstr("\"method\":\"Play\""));
  EXPECT_THAT(Audited(), HasSubstr("bytes=8"));
  EXPECT_THAT(Audited(), HasSubstr("\"method\":\"StopPlaying\""));
}

TEST_F(ViewerPlayTest, TheyAreToldWhyItDoesNotPlay) {
  Start("echo \"voxelctl: $7: is not a model\" >&2; exit 1");
  const auto page = Open(true);
  HearOf(*page, "play");
  EXPECT_EQ(Post("/play?name=bad.obj").result_int(), 202u);
  nlohmann::json failed;
  while (!failed.contains("failed"))
    failed = HearOf(*page, "play");  // a message that it plays may come first
  EXPECT_FALSE(failed.contains("playing"));
  EXPECT_EQ(failed["failed"], "bad.obj");
  EXPECT_EQ(failed["why"], "bad.obj: is not a model");
}

TEST_F(ViewerPlayTest, NothingIsPlayedWhileARequiredAuditLogCannotBeWritten) {
  audit_ = *access::Audit::Open({.path = "/dev/full", .required = true}, nullptr);
  audit_->Record("a", "", "First", "", absl::OkStatus());
  Start(kPlays);
  const Answer answer = Post("/play?name=a.obj");
  EXPECT_EQ(answer.result_int(), 503u);
  EXPECT_THAT(answer.body(), HasSubstr("No space left on device"));
  EXPECT_EQ(player_->state(), play::Playing());
  EXPECT_EQ(audit_->stats().pending, 2u) << "refused actions are recorded as well";
}

TEST_F(ViewerPlayTest, IsForPagesOfThisOriginWithControl) {
  Start(kPlays);
  using boost::beast::http::verb;
  const std::string path = "/play?name=a.obj";
  const auto refused = [&](const Fields& fields) {
    const Answer answer = Ask(verb::post, path, fields, "v 0 0 0\n");
    EXPECT_EQ(answer.result_int(), 403u) << answer.body();
    return answer.body();
  };
  EXPECT_THAT(refused({{"Origin", kOrigin}}), HasSubstr("may only look"));
  EXPECT_THAT(refused({{"Origin", kOrigin}, {"Cookie", cookie_ + "0"}}),
              HasSubstr("may only look"));
  EXPECT_THAT(refused({{"Cookie", cookie_}}), HasSubstr("where they are from"));
  EXPECT_THAT(refused({{"Cookie", cookie_}, {"Origin", "null"}}), HasSubstr("other origins"));
  EXPECT_THAT(refused({{"Cookie", cookie_}, {"Origin", "http://evil.example"}}),
              HasSubstr("other origins"));
  EXPECT_THAT(
      refused({{"Cookie", cookie_}, {"Origin", "http://evil.example"}, {"Host", "evil.example"}}),
      HasSubstr("evil.example"));
  EXPECT_EQ(player_->state(), play::Playing());

  const auto looking = Open(false);  // is not told
  EXPECT_EQ(Post(path).result_int(), 202u);
  Say(*looking, {{"stop", true}});
  EXPECT_THAT(HearOf(*looking, "error").get<std::string>(), HasSubstr("may only look"));
  EXPECT_EQ(player_->state().name, "a.obj");
  for (const verb other : {verb::get, verb::put, verb::delete_}) {
    EXPECT_EQ(Ask(other, path, {{"Origin", kOrigin}, {"Cookie", cookie_}}, "").result_int(), 405u);
  }
  EXPECT_THAT(std::string(Ask(verb::get, path, {}, "")["Allow"]), "POST");
}

TEST_F(ViewerPlayTest, WhatIsNoFileIsRefused) {
  Start(kPlays, {.max_bytes = 100});
  for (const char* path : {"/play", "/play?name=", "/play?name=a%2", "/play?name=a%zz.obj",
                           "/play?name=a%2z.obj", "/play?title=a.obj"}) {
    const Answer answer = Post(path);
    EXPECT_EQ(answer.result_int(), 400u) << path;
    EXPECT_THAT(answer.body(), HasSubstr("/play?name=teapot.obj")) << path;
  }
  EXPECT_EQ(Post("/play?name=" + std::string(5000, 'a')).result_int(), 400u);
  EXPECT_THAT(Post("/play?name=a.obj", "").body(), HasSubstr("the file is empty"));
  const Answer large = Post("/play?name=a.obj", std::string(101, 'v'));
  EXPECT_EQ(large.result_int(), 413u);
  EXPECT_THAT(large.body(), HasSubstr("100 bytes"));
  EXPECT_EQ(player_->state(), play::Playing());
  EXPECT_EQ(Post("/play?name=a.obj", std::string(100, 'v')).result_int(), 202u);
}

TEST_F(ViewerPlayTest, OneIsSentAtATime) {
  Start(kPlays);
  boost::asio::ip::tcp::socket first = Connect();
  const std::string begun = absl::StrCat(
      "POST /play?name=slow.obj HTTP/1.1\r\nHost: localhost:8088\r\nOrigin: ", kOrigin,
      "\r\nCookie: ", cookie_, "\r\nExpect: 100-continue\r\nContent-Length: 8\r\n\r\n");
  boost::asio::write(first, boost::asio::buffer(begun));
  char answer[25];
  boost::asio::read(first, boost::asio::buffer(answer));  // 100 Continue: the file is awaited
  const Answer second = Post("/play?name=b.obj");
  EXPECT_EQ(second.result_int(), 409u);
  EXPECT_THAT(second.body(), HasSubstr("another file is being sent"));
  first.close();
  // Until the daemon has noticed that the first has disconnected.
  while (Post("/play?name=b.obj").result_int() == 409u) {
  }
  EXPECT_EQ(player_->state().name, "b.obj");
}

TEST_F(ViewerPlayTest, ADiskThatIsFullIsSaidAndNothingStays) {
  Start(kPlays, {.write = [room = 3](int, const char*, size_t size) mutable -> ssize_t {
          if (size_t(room) >= size) return static_cast<ssize_t>(size);
          errno = ENOSPC;
          return -1;
        }});
  const Answer answer = Post("/play?name=a.obj");
  EXPECT_EQ(answer.result_int(), 507u);
  EXPECT_THAT(answer.body(), HasSubstr("No space left on device"));
  EXPECT_EQ(player_->state(), play::Playing());
  EXPECT_THAT(Audited(), Not(HasSubstr("Play")));
  EXPECT_EQ(Post("/play?name=a.obj", "abc").result_int(), 202u) << "the next one may fit";
}

TEST_F(ViewerPlayTest, ADiskThatHangsKeepsNobodyOut) {
  const auto temporary = play::PrivateFolder::Make();
  ASSERT_TRUE(temporary.ok());
  const TemporaryFiles there(temporary->path());
  sync::Mutex mutex;
  sync::CondVar changed;
  bool hangs = true;
  size_t written = 0;
  const auto write = [&](int, const char*, size_t size) -> ssize_t {
    const sync::MutexLock lock(mutex);
    ++written;
    while (hangs) changed.Wait(mutex);
    return static_cast<ssize_t>(size);
  };
  Start(kPlays, {.write = write}, 20 * sync::kMillisecond);
  for (const char* name : {"a.obj", "b.obj"}) {
    const Answer answer = Post(absl::StrCat("/play?name=", name));
    EXPECT_EQ(answer.result_int(), 503u);
    EXPECT_THAT(answer.body(), HasSubstr("did not answer in time")) << name;
  }
  // The number of waiting files is bounded.
  Answer answer = Post("/play?name=c.obj");
  for (int i = 0; i < 20 && answer.body().find("TMPDIR") == std::string::npos; ++i) {
    answer = Post("/play?name=c.obj");
  }
  EXPECT_EQ(answer.result_int(), 503u);
  EXPECT_THAT(answer.body(), HasSubstr("does not answer"));
  {
    const sync::MutexLock lock(mutex);
    EXPECT_LE(written, 1u) << "one at a time";
    hangs = false;
  }
  changed.NotifyAll();
  // A file that was given up is not played when the worker answers again.
  while (Post("/play?name=late.obj").result_int() == 503u) {
  }
  EXPECT_EQ(player_->state().name, "late.obj");
  for (const char* name : {"a.obj", "b.obj", "c.obj"}) {
    EXPECT_THAT(Audited(), Not(HasSubstr(name)));
  }
  // If it was sent twice, the files that it replaced are about to be removed.
  while (std::distance(std::filesystem::directory_iterator(temporary->path()), {}) > 1) {
  }
  server_.reset();
  viewer_.reset();
  player_.reset();
  EXPECT_TRUE(std::filesystem::is_empty(temporary->path()));
}

TEST_F(ViewerPlayTest, WhatIsLargeComesInPieces) {
  const std::string played = folder_->path() + "/played";
  Start(absl::StrCat("cp \"$7\" ", played, ".part; mv ", played, ".part ", played, "; ", kPlays));
  std::string body;
  for (int i = 0; body.size() < 1'000'000; ++i) absl::StrAppend(&body, "v ", i, " 0 0\n");
  EXPECT_EQ(Post("/play?name=a.obj", body).result_int(), 202u);
  EXPECT_THAT(Audited(), HasSubstr(absl::StrCat("bytes=", body.size())));
  while (!std::filesystem::exists(played)) std::this_thread::yield();
  std::ifstream file(played);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(file), {}), body);
}

TEST_F(ViewerPlayTest, WhereNoFileCanBeMadeItIsSaid) {
  Start(kPlays);
  {
    const TemporaryFiles nowhere(folder_->path() + "/nowhere");
    const Answer answer = Post("/play?name=a.obj");
    EXPECT_EQ(answer.result_int(), 500u);
    EXPECT_THAT(answer.body(), HasSubstr("no folder for files to be played can be made"));
  }
  EXPECT_EQ(player_->state(), play::Playing());
  EXPECT_EQ(Post("/play?name=a.obj").result_int(), 202u) << "now it can be created";
}

TEST_F(ViewerPlayTest, WhereThereIsNoThreadItIsSaid) {
  Start(kPlays);
  {
    const play::NoThreads none;
    const Answer answer = Post("/play?name=a.obj");
    EXPECT_EQ(answer.result_int(), 503u);
    EXPECT_THAT(answer.body(), HasSubstr("no thread"));
    EXPECT_EQ(player_->state(), play::Playing());
  }
  EXPECT_EQ(Post("/play?name=a.obj").result_int(), 202u) << "now there is one";
}

// A page that runs a function when it is notified.
class TellingPeer final : public http::WebSocketPeer {
 public:
  explicit TellingPeer(std::function<void()> told) : told_(std::move(told)) {}
  void Send(std::string, bool) override { told_(); }
  void Post(std::function<void()>) override {}
  void Close(std::string) override {}

 private:
  const std::function<void()> told_;
};

TEST_F(ViewerPlayTest, PagesThatAreGoneAreNotTold) {
  ASSERT_NO_FATAL_FAILURE(StartPlayer(kPlays));
  int told = 0, gone_told = 0;
  const auto page = std::make_shared<TellingPeer>([&] { ++told; });
  auto gone = std::make_shared<TellingPeer>([&] { ++gone_told; });
  const std::shared_ptr<ViewerPlay> play = ViewerPlay::Make({.player = player_.get()}, nullptr);
  play->Join(gone);
  gone.reset();
  play->Join(page);
  play->Join(page);  // again: it is notified only once
  EXPECT_EQ(told, 2);
  gone = std::make_shared<TellingPeer>([&] { ++gone_told; });
  play->Join(gone);
  gone.reset();
  player_->Play(*play::PlayFile::Make("a.obj"));
  EXPECT_EQ(told, 3);
  EXPECT_EQ(gone_told, 2);
}

// Its sender disconnects when the file is complete, before the worker has handled it.
TEST_F(ViewerPlayTest, WhatIsGivenUpIsNotPlayed) {
  ASSERT_NO_FATAL_FAILURE(StartPlayer(kPlays));
  const auto temporary = play::PrivateFolder::Make();
  ASSERT_TRUE(temporary.ok());
  const TemporaryFiles there(temporary->path());
  std::shared_ptr<ViewerPlay> play = ViewerPlay::Make({.player = player_.get()}, audit_.get());
  std::promise<void> taken, given_up;
  http::Reception first = play->Receive("name=a.obj");
  ASSERT_NE(first.receiver, nullptr);
  first.receiver->Take("v 0 0 0\n", [&](std::optional<http::Response>) {
    taken.set_value();
    given_up.get_future().wait();
  });
  taken.get_future().wait();
  bool answered = false;
  first.receiver->Whole([&](const http::Response&) { answered = true; });
  first.receiver.reset();
  given_up.set_value();
  http::Reception second = play->Receive("name=b.obj");
  ASSERT_NE(second.receiver, nullptr);
  std::promise<void> behind;
  second.receiver->Take("v", [&](std::optional<http::Response>) { behind.set_value(); });
  behind.get_future().wait();
  EXPECT_FALSE(answered);
  EXPECT_EQ(player_->state(), play::Playing());
  EXPECT_EQ(Audited(), "");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(temporary->path()), {}), 1)
      << "only that of the second";
  second.receiver.reset();
  play.reset();
  EXPECT_TRUE(std::filesystem::is_empty(temporary->path()));
}

// Its destructor waits for the thread that writes, so that thread must not hold the last reference.
TEST_F(ViewerPlayTest, MayEndWhilePagesAreTold) {
  ASSERT_NO_FATAL_FAILURE(StartPlayer(kPlays));
  std::shared_ptr<ViewerPlay> play = ViewerPlay::Make({.player = player_.get()}, nullptr);
  const std::weak_ptr<ViewerPlay> known = play;
  std::atomic<bool> joined = false, telling = false, let_go = false;
  const auto page = std::make_shared<TellingPeer>([&] {
    if (!joined) return;
    telling = true;
    while (!known.expired() && !let_go) std::this_thread::yield();
  });
  play->Join(page);
  joined = true;
  http::Reception reception = play->Receive("name=a.obj");
  ASSERT_NE(reception.receiver, nullptr);
  std::promise<std::optional<http::Response>> taken;
  reception.receiver->Take("v 0 0 0\n", [&](std::optional<http::Response> refused) {
    taken.set_value(std::move(refused));
  });
  EXPECT_FALSE(taken.get_future().get().has_value());
  std::promise<unsigned> answered;
  reception.receiver->Whole(
      [&](const http::Response& answer) { answered.set_value(answer.status); });
  while (!telling) std::this_thread::yield();
  reception.receiver.reset();
  play.reset();
  let_go = true;
  EXPECT_EQ(answered.get_future().get(), 202u);
  EXPECT_TRUE(known.expired());
  EXPECT_EQ(player_->state().name, "a.obj");
}

TEST_F(ViewerPlayTest, WhereNothingPlaysItIsSaidWhy) {
  Start("");
  const auto page = Open(true);
  EXPECT_EQ(HearOf(*page, "play"), (nlohmann::json{{"why_not", "there is no voxelctl"}}));
  const Answer answer = Post("/play?name=a.obj");
  EXPECT_EQ(answer.result_int(), 503u);
  EXPECT_THAT(answer.body(), HasSubstr("there is no voxelctl"));
  Say(*page, {{"stop", true}});
  Say(*page, {{"what", 1}});
  EXPECT_TRUE(HearOf(*page, "error").is_string());
}

}  // namespace
}  // namespace voxeld::daemon::viewer
