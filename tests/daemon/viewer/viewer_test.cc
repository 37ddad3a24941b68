// Tests the viewer over HTTP and WebSocket: who may view, who may control, and which messages a
// page receives.
#include "daemon/viewer/viewer.h"

#include <gmock/gmock.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "daemon/viewer/page_files.h"
#include "display/drivers/registry.h"

namespace voxeld::daemon::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using Json = nlohmann::json;

class ViewerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    core_ = std::make_unique<Core>(CoreOptions{.version = "1.2"}, clock_);
    for (const char* name : {"one", "two"}) {
      auto display = display::CreateDisplay(
          {.name = name, .driver = "simulated", .options = {{"size", "8x8x4"}, {"rate", "100"}}},
          {clock_, nullptr});
      ASSERT_TRUE(display.ok()) << display.status();
      ASSERT_TRUE(core_->AddDisplay(*std::move(display), {.kind = gpu::EngineKind::kCpu}).ok());
    }
    ASSERT_TRUE(core_->Start().ok());
    auto viewer = Viewer::Make(*core_, clock_, {.version = "1.2", .hosts = {"screen.example"}});
    ASSERT_TRUE(viewer.ok());
    viewer_ = *std::move(viewer);
    auto server = http::Server::Start(
        {.listen = *ParseAddress("127.0.0.1:0"), .message_limit_ns = sync::kSecond},
        viewer_->Handler([](const http::Request&, http::Done) { return false; }),
        viewer_->Upgrade());
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }
  void TearDown() override {
    server_.reset();
    EXPECT_TRUE(core_->Stop(10 * sync::kSecond).ok());
  }

  asio::ip::tcp::socket Connect() {
    asio::ip::tcp::socket socket(io_);
    socket.connect({asio::ip::make_address("127.0.0.1"), server_->address().port});
    return socket;
  }

  using Fields = std::vector<std::pair<std::string, std::string>>;
  beast::http::response<beast::http::string_body> Get(const std::string& path,
                                                      const Fields& fields = {}) {
    asio::ip::tcp::socket socket = Connect();
    beast::http::request<beast::http::empty_body> request(beast::http::verb::get, path, 11);
    request.set(beast::http::field::host, "localhost:8088");
    for (const auto& [name, value] : fields) request.set(name, value);
    beast::http::write(socket, request);
    beast::flat_buffer buffer;
    beast::http::response<beast::http::string_body> response;
    beast::http::read(socket, buffer, response);
    return response;
  }

  using Socket = beast::websocket::stream<asio::ip::tcp::socket>;
  std::unique_ptr<Socket> Open(const Fields& fields = {}, const std::string& path = "/volumes") {
    auto socket = std::make_unique<Socket>(Connect());
    socket->set_option(
        beast::websocket::stream_base::decorator([&](beast::websocket::request_type& request) {
          for (const auto& [name, value] : fields) request.set(name, value);
        }));
    socket->handshake("localhost:8088", path);
    return socket;
  }
  static void Say(Socket& socket, const Json& message) {
    socket.text(true);
    socket.write(asio::buffer(message.dump()));
  }
  static std::string Hear(Socket& socket) {
    beast::flat_buffer buffer;
    socket.read(buffer);
    return beast::buffers_to_string(buffer.data());
  }
  // Reads the next message that has `key`; skips binary ones.
  static Json HearOf(Socket& socket, const std::string& key) {
    while (true) {
      const Json message = Json::parse(Hear(socket), nullptr, false);
      if (message.is_object() && message.contains(key)) return message[key];
    }
  }

  std::string Cookie() {
    const std::string address = viewer_->ControlAddress(server_->address());
    const auto response = Get(address.substr(address.find("/control")));
    EXPECT_EQ(response.result_int(), 303u);
    const auto field = response["Set-Cookie"];
    const std::string cookie(field.data(), field.size());
    EXPECT_THAT(cookie, HasSubstr("HttpOnly"));
    EXPECT_THAT(cookie, HasSubstr("SameSite=Strict"));
    return cookie.substr(0, cookie.find(';'));
  }

  sync::SystemClock clock_;
  asio::io_context io_;
  std::unique_ptr<Core> core_;
  std::unique_ptr<Viewer> viewer_;
  std::unique_ptr<http::Server> server_;
};

TEST_F(ViewerTest, ThePageIsServedForThisMachineAlone) {
  const auto page = Get("/", {{"Accept-Encoding", "gzip"}});
  if (!Viewer::HasPage()) {
    EXPECT_EQ(page.result_int(), 404u);
    EXPECT_THAT(page.body(), HasSubstr("built without its page"));
  } else {
    EXPECT_EQ(page.result_int(), 200u);
    EXPECT_EQ(page["Content-Encoding"], "gzip");
    const auto type = page["Content-Type"];
    EXPECT_THAT(std::string(type.data(), type.size()), StartsWith("text/html"));
    EXPECT_EQ(Unpack(page.body()), Get("/").body());
    EXPECT_THAT(Get("/").body(), StartsWith("<!doctype html>"));
    const auto policy = page["Content-Security-Policy"];
    EXPECT_THAT(std::string(policy.data(), policy.size()), StartsWith("default-src 'none'"));
  }
  for (const char* host : {"localhost", "LocalHost:9", "127.0.0.1:9", "[::1]:9",
                           "[::ffff:192.0.2.7]:9", "192.0.2.7", "Screen.Example:80"}) {
    EXPECT_NE(Get("/", {{"Host", host}}).result_int(), 403u) << host;
  }
  for (const char* host :
       {"evil.example", "localhost.evil.example", "1.2.3.4.evil.example:80", "",
        "[::1].evil.example", "[::1]evil.example:80", "[::1", "[::1]9", "[localhost].evil.example",
        "127.0.0.1:evil", "127.0.0.1:99999", "127.0.0.1:+80", "127.0.0.1:-1", "127.0.0.1:80:80",
        "127.0.0.1:8 0", "localhost:80.evil.example", "::1"}) {
    EXPECT_EQ(Get("/", {{"Host", host}}).result_int(), 403u) << host;
  }
  EXPECT_EQ(Get("/", {{"Origin", "http://evil.example"}}).result_int(), 403u);
  EXPECT_EQ(Get("/other").result_int(), 404u);
}

TEST_F(ViewerTest, SocketsAreForPagesOfThisOrigin) {
  EXPECT_THROW(Open({{"Origin", "http://evil.example"}}), boost::system::system_error);
  EXPECT_THROW(Open({{"Host", "evil.example"}}), boost::system::system_error);
  EXPECT_THROW(Open({}, "/other"), boost::system::system_error);
  EXPECT_NO_THROW(Open({{"Origin", "http://localhost:8088"}}));
  EXPECT_NO_THROW(Open());
}

TEST_F(ViewerTest, APageIsToldDisplaysAndVolumesAndPacesThem) {
  const auto socket = Open();
  Say(*socket, {{"hello", true}});
  const Json hello = HearOf(*socket, "hello");
  EXPECT_EQ(hello["version"], "1.2");
  EXPECT_EQ(hello["control"], false);
  ASSERT_EQ(hello["displays"].size(), 2u);
  EXPECT_EQ(hello["displays"][1]["name"], "two");
  Say(*socket, {{"watch", "two"}, {"id", 7}});
  const Json watching = HearOf(*socket, "watching");
  EXPECT_EQ(watching["id"], 7);
  EXPECT_EQ(watching["display"]["layout"]["slices"], 4);
  const std::string first = Hear(*socket);
  EXPECT_EQ(first[0], 1);
  EXPECT_EQ(first[1], 1) << "whole";
  EXPECT_EQ(first[2], 7);
  // No second one before the first is shown, even if the display shows others: the next message is
  // the requested answer.
  DisplayUpdate update;
  update.pattern = TestPattern::kWhite;
  core_->UpdateDisplay("two", update, [](absl::StatusOr<DisplayDescription>) {});
  Say(*socket, {{"dark", 7}});
  EXPECT_EQ(Hear(*socket)[0], 2);
  Say(*socket, {{"shown", 7}});
  std::string next = Hear(*socket);
  while (next.size() < 24 + 4 * 8 + 4 * 64 * 9) {  // until all of them are lit
    ASSERT_EQ(next[0], 1);
    Say(*socket, {{"shown", 7}});
    next = Hear(*socket);
  }
  Say(*socket, {{"stats", true}});
  EXPECT_EQ(HearOf(*socket, "stats")["displays"].size(), 2u);
  Say(*socket, {{"layers", true}});
  EXPECT_TRUE(HearOf(*socket, "layers").is_object());
}

TEST_F(ViewerTest, WhatIsShownIsHeldAgainstWhatWasSent) {
  const auto socket = Open();
  Say(*socket, {{"update", {{"name", "one"}}}});  // a page may not ask for it, and it does no harm
  Say(*socket, {{"compare", 7}});
  EXPECT_THAT(HearOf(*socket, "compared")["why"].get<std::string>(), HasSubstr("no such watch"));
  Say(*socket, {{"watch", "one"}, {"id", 7}});
  EXPECT_EQ(HearOf(*socket, "watching")["id"], 7);
  EXPECT_EQ(Hear(*socket)[0], 1) << "the first volume";
  Say(*socket, {{"compare", 7}, {"without", Json::array({{{"owner", "1"}, {"layer", "a"}}})}});
  const Json compared = HearOf(*socket, "compared");
  EXPECT_EQ(compared["id"], 7);
  EXPECT_EQ(compared["voxels"], 0);
  EXPECT_EQ(compared["pixels"], 0);
  EXPECT_EQ(compared["low_mm"].size(), 3u);
  const std::string sent = Hear(*socket), difference = Hear(*socket);
  EXPECT_EQ(sent[0], 3);
  EXPECT_EQ(difference[0], 4);
  EXPECT_EQ(sent.size(), 24u + 8);
  for (const Json& wrong : {Json{{"compare", "7"}}, Json{{"compare", 7}, {"without", 1}},
                            Json{{"compare", 7}, {"without", {{{"owner", 1}, {"layer", "a"}}}}}}) {
    Say(*socket, wrong);
    EXPECT_TRUE(HearOf(*socket, "error").is_string()) << wrong;
  }
}

TEST_F(ViewerTest, WhatIsWrongIsSaidAndTheSocketGoesOn) {
  const auto socket = Open();
  for (const char* wrong : {"nonsense", "[]", "{\"what\":1}", "{\"watch\":5,\"id\":1}",
                            "{\"watch\":\"one\",\"id\":-1}", "{\"watch\":\"one\",\"id\":70000}"}) {
    socket->write(asio::buffer(std::string(wrong)));
    EXPECT_TRUE(HearOf(*socket, "error").is_string()) << wrong;
  }
  Say(*socket, {{"watch", "none"}, {"id", 1}});
  EXPECT_THAT(HearOf(*socket, "ended")["why"].get<std::string>(), HasSubstr("there are"));
  for (int id = 2; id < 18; ++id) Say(*socket, {{"watch", "one"}, {"id", id}});
  Say(*socket, {{"watch", "one"}, {"id", 18}});
  EXPECT_THAT(HearOf(*socket, "error").get<std::string>(), HasSubstr("16 watches"));
  // A message that is too long ends the connection, and nothing else.
  socket->write(asio::buffer(std::string(http::kGreatestMessage + 1, 'x')));
  EXPECT_THROW(while (true) Hear(*socket), boost::system::system_error);
  EXPECT_NO_THROW(Open());
}

// Unread answers wait in bounded room: nothing more is read from the page that requested them, and
// others continue.
TEST_F(ViewerTest, WhoDoesNotReadIsNotReadEither) {
  const auto socket = Open();
  Say(*socket, {{"watch", "one"}, {"id", 1}});
  HearOf(*socket, "watching");
  const std::string ask = Json{{"dark", 1}, {"more", std::string(8000, 'x')}}.dump();
  boost::system::error_code error;
  int taken = 0;
  while (!error && ++taken < 20'000) socket->write(asio::buffer(ask), error);
  EXPECT_TRUE(error) << "160 MB of requests were read, and their answers kept";  // it was closed
  const auto other = Open();
  Say(*other, {{"hello", true}});
  EXPECT_EQ(HearOf(*other, "hello")["version"], "1.2");
}

TEST_F(ViewerTest, SocketsLeaveRoomForOthers) {
  std::vector<std::unique_ptr<Socket>> sockets;
  for (int i = 0; i < 48; ++i) sockets.push_back(Open());
  EXPECT_THROW(Open(), boost::system::system_error);
  EXPECT_NE(Get("/").result_int(), 503u);
}

TEST_F(ViewerTest, ControlIsForTheAddressThatServesOnce) {
  const auto looking = Open();
  Say(*looking, {{"update", {{"name", "one"}, {"brightness", 0.5}}}});
  EXPECT_THAT(HearOf(*looking, "error").get<std::string>(), HasSubstr("may only look"));
  Say(*looking, {{"clear", {{"layer", "x"}}}});
  EXPECT_THAT(HearOf(*looking, "error").get<std::string>(), HasSubstr("may only look"));

  EXPECT_EQ(Get("/control?key=00000000000000000000000000000000").result_int(), 403u);
  EXPECT_EQ(Get("/control").result_int(), 403u);
  const std::string used = viewer_->ControlAddress(server_->address());
  unsigned status = 0;
  const http::Handler handler =
      viewer_->Handler([](const http::Request&, const http::Done&) { return false; });
  EXPECT_TRUE(handler({.path = "/control",
                       .query = std::string_view(used).substr(used.find("key=")),
                       .host = "localhost",
                       .head = true},
                      [&](const http::Response& answer) { status = answer.status; }));
  EXPECT_EQ(status, 405u) << "HEAD does not use up the address";
  const std::string cookie = Cookie();
  EXPECT_EQ(viewer_->ControlAddress(server_->address()), "");
  EXPECT_EQ(Get(used.substr(used.find("/control"))).result_int(), 403u) << "it has been used";

  const auto controlling = Open({{"Cookie", "other=1; " + cookie}});
  Say(*controlling, {{"hello", true}});
  EXPECT_EQ(HearOf(*controlling, "hello")["control"], true);
  Say(*controlling, {{"update", {{"name", "one"}, {"brightness", 0.5}}}});
  EXPECT_EQ(HearOf(*controlling, "display")["brightness"], 0.5);
  Say(*controlling, {{"update", {{"name", "one"}, {"brightness", 7}}}});
  EXPECT_THAT(HearOf(*controlling, "error").get<std::string>(), HasSubstr("brightness is 7"));
  Say(*controlling, {{"update", {{"no_such_field", 7}}}});
  EXPECT_TRUE(HearOf(*controlling, "error").is_string());
  EXPECT_NO_THROW(Open({{"Cookie", "voxeld_control=wrong"}}));
}

TEST_F(ViewerTest, NothingButTheCookieThatWasGivenControls) {
  const std::string cookie = Cookie();
  const auto controls = [&](const std::string& cookies) {
    const auto socket = Open({{"Cookie", cookies}});
    Say(*socket, {{"hello", true}});
    return HearOf(*socket, "hello")["control"].get<bool>();
  };
  std::string other = cookie;
  other.back() = other.back() == '0' ? '1' : '0';
  const std::string name = cookie.substr(0, cookie.find('=') + 1);
  std::string first = cookie;
  first[name.size()] = first[name.size()] == '0' ? '1' : '0';
  for (const std::string& wrong :
       {other, first, name, cookie + "0", cookie.substr(0, cookie.size() - 1), "x" + cookie,
        name + "; " + cookie.substr(name.size())}) {
    EXPECT_FALSE(controls(wrong)) << wrong;
  }
  EXPECT_TRUE(controls(other + "; " + cookie));
}

TEST_F(ViewerTest, OriginsAreOfBothKindsAndWhole) {
  for (const char* origin : {"http://localhost:8088", "https://localhost:8088"}) {
    EXPECT_NE(Get("/", {{"Origin", origin}}).result_int(), 403u) << origin;
  }
  for (const char* origin : {"http://localhost", "ftp://localhost:8088", "http://localhost:80880",
                             "localhost:8088", "null"}) {
    EXPECT_EQ(Get("/", {{"Origin", origin}}).result_int(), 403u) << origin;
  }
}

TEST_F(ViewerTest, FilesAreTakenFromPagesThatControlAlone) {
  const std::string cookie = Cookie();
  const http::Receive receive = viewer_->Receive();
  const auto refusal = [&](const http::Request& request) {
    const std::optional<http::Reception> reception = receive(request);
    return reception.has_value() ? reception->refusal.body : "not its own";
  };
  http::Request request{.path = "/play",
                        .query = "name=a.obj",
                        .host = "localhost:8088",
                        .origin = "http://localhost:8088",
                        .cookie = cookie};
  EXPECT_THAT(refusal(request), Not(HasSubstr("page"))) << "unless a file is played";
  request.path = "/other";
  EXPECT_EQ(refusal(request), "not its own");
  request.path = "/play";
  request.cookie = "";
  EXPECT_THAT(refusal(request), HasSubstr("may only look"));
  request.origin = "";
  EXPECT_THAT(refusal(request), HasSubstr("files are taken from pages"));
  request.host = "evil.example";
  EXPECT_THAT(refusal(request), HasSubstr("evil.example"));
  EXPECT_EQ(Get("/play").result_int(), 405u);
}

TEST_F(ViewerTest, ThereIsNoKeyWhereNobodyIsToControl) {
  auto viewer = Viewer::Make(*core_, clock_, {.version = "1.2", .control = false});
  ASSERT_TRUE(viewer.ok());
  EXPECT_EQ((*viewer)->ControlAddress(server_->address()), "");
  // Nor does the empty key give access.
  std::optional<http::Response> response;
  const http::Handler handler =
      (*viewer)->Handler([](const http::Request&, const http::Done&) { return false; });
  EXPECT_TRUE(handler({.path = "/control", .query = "key=", .host = "localhost"},
                      [&](http::Response answer) { response = std::move(answer); }));
  ASSERT_TRUE(response.has_value());
  EXPECT_EQ(response->status, 403u);
  const Address local = *ParseAddress("unix:/run/voxeld/http");
  EXPECT_EQ(viewer_->ControlAddress(local), "");
  EXPECT_EQ(Viewer::PageAddress(local), "");
  EXPECT_EQ(Viewer::PageAddress(*ParseAddress("127.0.0.1:8088")), "http://127.0.0.1:8088/");
}

TEST_F(ViewerTest, WhatIsNotItsOwnGoesToOthers) {
  std::string path;
  const http::Handler handler =
      viewer_->Handler([&](const http::Request& request, const http::Done&) {
        path = request.path;
        return true;
      });
  EXPECT_TRUE(handler({.path = "/healthz", .host = "evil.example"}, [](const http::Response&) {}));
  EXPECT_EQ(path, "/healthz");
}

}  // namespace
}  // namespace voxeld::daemon::viewer
