// Tests the messages of one page, answered in an order that the test chooses: a page is sent
// nothing more about what has ended in the meantime.
#include "daemon/viewer/viewer_socket.h"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <deque>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "display/sync/mutex.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon::viewer {
namespace viewer_socket_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Json = nlohmann::json;

constexpr char kVolume = 1, kDark = 2;

// The peer: keeps the messages that are sent, and the work for the server's thread until the test
// does it.
class Peer final : public http::WebSocketPeer {
 public:
  void Send(std::string message, bool binary) override {
    (binary ? binaries : texts).push_back(std::move(message));
  }
  void Post(std::function<void()> what) override {
    sync::MutexLock lock(mutex_);
    posted_.push_back(std::move(what));
  }
  void Close(std::string) override {}

  std::deque<std::function<void()>> TakePosted() {
    sync::MutexLock lock(mutex_);
    return std::exchange(posted_, {});
  }
  static void Do(const std::deque<std::function<void()>>& posted) {
    for (const auto& what : posted) what();
  }

  std::vector<std::string> texts, binaries;

 private:
  sync::Mutex mutex_;
  std::deque<std::function<void()>> posted_ VOXELD_GUARDED_BY(mutex_);
};

struct Page {
  std::shared_ptr<Peer> peer = std::make_shared<Peer>();
  std::unique_ptr<http::WebSocketService> service;

  void Say(const Json& message) { service->OnText(message.dump()); }
  // Returns the messages with `key` since the last call.
  std::vector<Json> Heard(const std::string& key) {
    std::vector<Json> heard;
    for (const std::string& text : peer->texts) {
      const Json message = Json::parse(text);
      if (message.contains(key)) heard.push_back(message[key]);
    }
    peer->texts.clear();
    return heard;
  }
  // Returns the kinds of the binary messages since the last call.
  std::vector<char> Kinds() {
    std::vector<char> kinds;
    for (const std::string& binary : std::exchange(peer->binaries, {})) kinds.push_back(binary[0]);
    return kinds;
  }
};

class ViewerSocketTest : public ::testing::Test {
 protected:
  ViewerSocketTest() {
    folder_ = (std::filesystem::temp_directory_path() / "voxeld-socket-XXXXXX").string();
    EXPECT_NE(mkdtemp(folder_.data()), nullptr);
    audit_ = *access::Audit::Open({.path = folder_ + "/audit"}, nullptr);
    display::DisplayInfo lights = testing::SmallDisplay("lights");
    lights.geometry.shape =
        display::Lattice{.width_px = 1, .points_mm = {display::Vec3{}}, .cell_mm = {1, 1, 1}};
    lights.geometry.grid = {1, 1, 1, {1, 1, 1}, {-0.5, -0.5, -0.5}};
    lights.layout = {1, 1, 1, 1, display::PixelFormat::kRgb888};
    EXPECT_TRUE(
        sim_.core->AddDisplay(std::make_unique<testing::ScriptedDisplay>(lights, sim_.clock), {})
            .ok());
    sim_.Start();
    UseAudit(audit_.get());
    page_ = Open();
  }
  ~ViewerSocketTest() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  // Makes pages that are opened from now on record their actions in `audit`.
  void UseAudit(access::Audit* audit) {
    shared_ = std::make_shared<ViewerShared>(
        ViewerShared{*sim_.core,
                     sim_.clock,
                     {.version = "1.2", .audit = audit},
                     ViewerPlay::Make({.why_not = "nothing is played"}, audit),
                     {}});
  }

  Page Open(bool control = false) {
    Page page;
    page.service = NewViewerSocket(shared_, page.peer, control);
    return page;
  }

  // Does everything that the daemon has to do, and shows everything that displays have to show.
  void Step() {
    sim_.core->Step();
    for (const int display : {0, 1}) {
      while (sim_.Show(display)) {
      }
    }
  }
  // Answers until nothing is left to do.
  void Answer(Page& page) {
    for (;;) {
      Step();
      const auto posted = page.peer->TakePosted();
      if (posted.empty()) return;
      Peer::Do(posted);
    }
  }
  void Answer() { Answer(page_); }
  void Watch(uint16_t id, const std::string& display = "main") {
    page_.Say({{"watch", display}, {"id", id}});
  }
  // Makes the display show another volume.
  void ShowAnother() {
    if (!client_.has_value()) client_ = sim_.Open();
    ++shown_;
    sim_.Send(*client_, shown_, testing::Put("a", "x", static_cast<int>(shown_)));
    Step();
  }
  std::string AuditLines() const {
    std::ifstream in(folder_ + "/audit");
    return {std::istreambuf_iterator<char>(in), {}};
  }

  std::string folder_;
  std::unique_ptr<access::Audit> audit_;
  testing::Simulation sim_{{}, 2};
  std::shared_ptr<ViewerShared> shared_;
  std::optional<testing::Simulation::Client> client_;
  uint64_t shown_ = 0;
  Page page_;
};

TEST_F(ViewerSocketTest, WhatIsAskedWhileItIsAnsweredIsPassedOver) {
  for (const char* what : {"hello", "stats", "layers"}) {
    for (int i = 0; i < 2; ++i) {
      page_.Say({{what, true}});
      page_.Say({{what, true}});
      Answer();
      EXPECT_EQ(page_.Heard(what).size(), 1u) << what << ", the " << i << "th time";
    }
  }
}

TEST_F(ViewerSocketTest, WhereEveryLightIsAPageIsNotTold) {
  page_.Say({{"hello", true}});
  Answer();
  const Json displays = page_.Heard("hello").at(0)["displays"];
  ASSERT_EQ(displays.size(), 3u);
  EXPECT_TRUE(displays[0]["geometry"].contains("planar_stack")) << displays[0];
  const Json& lattice = displays[2]["geometry"].at("lattice");
  EXPECT_EQ(lattice["width_px"], 1);
  for (const char* each : {"pixels", "x_mm", "y_mm", "z_mm"}) {
    EXPECT_THAT(lattice[each], IsEmpty()) << each;
  }
}

TEST_F(ViewerSocketTest, WhoIsGoneIsToldNothing) {
  page_.Say({{"hello", true}});
  Watch(1);
  page_.service.reset();
  EXPECT_EQ(shared_->watches, 0u);
  Answer();
  EXPECT_THAT(page_.peer->texts, IsEmpty());
}

TEST_F(ViewerSocketTest, WhoGoesBeforeItsVolumeIsToldNothing) {
  Watch(1);
  Step();
  Peer::Do(page_.peer->TakePosted());
  ASSERT_EQ(page_.Heard("watching").size(), 1u);
  Step();
  const auto ready = page_.peer->TakePosted();
  ASSERT_FALSE(ready.empty());
  page_.service.reset();
  Peer::Do(ready);
  EXPECT_THAT(page_.Kinds(), IsEmpty());
}

TEST_F(ViewerSocketTest, OfADaemonThatHasStoppedItIsSaidEachTime) {
  Page page = Open(true);
  ASSERT_TRUE(sim_.core->Stop(sync::kSecond).ok());
  const std::vector<Json> asked = {{{"hello", true}},
                                   {{"stats", true}},
                                   {{"layers", true}},
                                   {{"update", {{"name", "main"}, {"brightness", 0.5}}}},
                                   {{"clear", {{"layer", "x"}}}}};
  for (const Json& what : asked) {
    for (int i = 0; i < 2; ++i) {
      page.Say(what);
      Answer(page);
      EXPECT_THAT(page.Heard("error"), ElementsAre("the daemon has stopped")) << what;
    }
  }
  page.Say({{"watch", "main"}, {"id", 1}});
  Answer(page);
  EXPECT_THAT(page.Heard("ended"), ElementsAre(Json{{"id", 1}, {"why", "the daemon has stopped"}}));
  EXPECT_EQ(shared_->watches, 0u);
}

TEST_F(ViewerSocketTest, AllPagesTogetherHaveSoManyWatches) {
  std::vector<Page> pages;
  for (int p = 0; p < 4; ++p) {
    pages.push_back(Open());
    for (int id = 0; id < 16; ++id) pages.back().Say({{"watch", "main"}, {"id", id}});
    EXPECT_THAT(pages.back().Heard("error"), IsEmpty());
  }
  Watch(1);
  EXPECT_THAT(page_.Heard("error"), ElementsAre("all pages together have 64 watches"));
  pages[0].Say({{"unwatch", 3}});
  Watch(1);
  EXPECT_THAT(page_.Heard("error"), IsEmpty());
  Watch(2);
  EXPECT_EQ(page_.Heard("error").size(), 1u) << "room for one";
  pages.pop_back();
  for (uint16_t id = 2; id < 17; ++id) Watch(id);
  EXPECT_THAT(page_.Heard("error"), IsEmpty()) << "a page that leaves frees its room";
  EXPECT_EQ(shared_->watches, 63u);
}

TEST_F(ViewerSocketTest, AnIdIsOneWatchsAtATime) {
  Watch(1);
  Watch(1, "display1");
  EXPECT_THAT(page_.Heard("error"), ElementsAre("a page has 16 watches with different ids"));
  EXPECT_EQ(shared_->watches, 1u);
  Answer();
  const std::vector<Json> watching = page_.Heard("watching");
  ASSERT_EQ(watching.size(), 1u);
  EXPECT_EQ(watching[0]["display"]["name"], "main");
}

TEST_F(ViewerSocketTest, AWatchThatIsTakenBackBeforeItBeginsDoesNot) {
  Watch(1);
  page_.Say({{"unwatch", 1}});
  Answer();
  EXPECT_THAT(page_.Heard("watching"), IsEmpty());
  Watch(1);
  page_.Say({{"unwatch", 1}});
  Watch(1, "display1");
  Answer();
  const std::vector<Json> watching = page_.Heard("watching");
  ASSERT_EQ(watching.size(), 1u) << "the one that was requested last";
  EXPECT_EQ(watching[0]["display"]["name"], "display1");
}

TEST_F(ViewerSocketTest, BeforeAWatchBeginsThereIsNothingOfIt) {
  Watch(1);
  page_.Say({{"shown", 1}});
  page_.Say({{"dark", 1}});
  page_.Say({{"compare", 1}});
  for (const char* what : {"shown", "dark", "unwatch"}) page_.Say({{what, 2}});
  EXPECT_THAT(page_.Kinds(), IsEmpty());
  EXPECT_THAT(page_.Heard("compared"),
              ElementsAre(Json{{"id", 1}, {"why", "there is no such watch"}}));
  Answer();
  EXPECT_THAT(page_.Kinds(), ElementsAre(kVolume));
  page_.Say({{"dark", 1}});
  EXPECT_THAT(page_.Kinds(), ElementsAre(kDark));
}

TEST_F(ViewerSocketTest, AVolumeIsSentOnceThePageHasShownTheOneBefore) {
  Watch(1);
  Answer();
  EXPECT_THAT(page_.Kinds(), ElementsAre(kVolume));
  page_.Say({{"shown", 1}});
  ShowAnother();
  Answer();
  EXPECT_THAT(page_.Kinds(), ElementsAre(kVolume)) << "it was waited for";
  ShowAnother();
  Answer();
  EXPECT_THAT(page_.Kinds(), IsEmpty());
  page_.Say({{"shown", 1}});
  EXPECT_THAT(page_.Kinds(), ElementsAre(kVolume));
}

TEST_F(ViewerSocketTest, AVolumeIsReadyForNoLaterWatchOfTheSameId) {
  const auto ready = [this] {  // held back
    Step();
    Peer::Do(page_.peer->TakePosted());
    Step();
    return page_.peer->TakePosted();
  };
  Watch(1);
  const auto first = ready();
  ASSERT_EQ(first.size(), 1u);
  page_.Say({{"unwatch", 1}});
  Peer::Do(first);
  EXPECT_THAT(page_.Kinds(), IsEmpty());
  Watch(1);
  const auto second = ready();
  ASSERT_EQ(second.size(), 1u);
  Peer::Do(first);
  EXPECT_THAT(page_.Kinds(), IsEmpty());
  Peer::Do(second);
  EXPECT_THAT(page_.Kinds(), ElementsAre(kVolume));
}

TEST_F(ViewerSocketTest, ADisplayThatEndsEndsItsWatches) {
  Watch(1);
  Answer();
  page_.Say({{"shown", 1}});
  ASSERT_TRUE(sim_.core->Stop(sync::kSecond).ok());
  Answer();
  const std::vector<Json> ended = page_.Heard("ended");
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0]["id"], 1);
  EXPECT_NE(ended[0]["why"], "");
  EXPECT_EQ(shared_->watches, 0u);
}

TEST_F(ViewerSocketTest, BeforeSomethingIsShownNothingIsCompared) {
  Watch(1);
  sim_.core->Step();
  Peer::Do(page_.peer->TakePosted());
  for (int i = 0; i < 2; ++i) {
    page_.Say({{"compare", 1}});
    sim_.core->Step();
    Peer::Do(page_.peer->TakePosted());
    EXPECT_THAT(page_.Heard("compared"),
                ElementsAre(Json{{"id", 1}, {"why", "nothing has been shown yet"}}));
  }
}

TEST_F(ViewerSocketTest, OneIsComparedAtATimeAndEachThatAsksIsAnswered) {
  Watch(1);
  Watch(2);
  Answer();
  page_.Say({{"compare", 1}});
  page_.Say({{"compare", 2}});
  EXPECT_THAT(page_.Heard("compared"),
              ElementsAre(Json{{"id", 2}, {"why", "another is compared for this page"}}));
  page_.Say({{"unwatch", 1}});
  Answer();
  EXPECT_THAT(page_.Heard("compared"),
              ElementsAre(Json{{"id", 1}, {"why", "there is no such watch"}}));

  page_.Say({{"compare", 2}});
  page_.Say({{"unwatch", 2}});
  Watch(2, "display1");
  Answer();
  EXPECT_THAT(page_.Heard("compared"),
              ElementsAre(Json{{"id", 2}, {"why", "there is no such watch"}}))
      << "the watch of that id is another";
}

TEST_F(ViewerSocketTest, WhatIsChangedIsInTheAuditLogThoughThePageIsGone) {
  Page page = Open(true);
  page.Say({{"update", {{"name", "main"}, {"brightness", 0.5}}}});
  page.Say({{"clear", {{"owner", 7}, {"layer", "none"}}}});
  page.service.reset();
  EXPECT_EQ(AuditLines(), "");
  Answer(page);
  EXPECT_THAT(page.peer->texts, IsEmpty());
  EXPECT_THAT(AuditLines(), HasSubstr("\"method\":\"UpdateDisplay\""));
  EXPECT_THAT(AuditLines(), HasSubstr("\"method\":\"ClearLayer\""));
  EXPECT_THAT(AuditLines(), HasSubstr("brightness"));
}

TEST_F(ViewerSocketTest, ControlIsRefusedWhileARequiredAuditLogCannotBeWritten) {
  const auto audit = *access::Audit::Open({.path = "/dev/full", .required = true}, nullptr);
  audit->Record("a", "", "First", "", absl::OkStatus());
  UseAudit(audit.get());
  Page page = Open(true);
  for (const Json& action :
       {Json{{"update", {{"name", "main"}, {"brightness", 0.5}}}},
        Json{{"clear", {{"owner", 7}, {"layer", "none"}}}}, Json{{"stop", true}}}) {
    page.Say(action);
    Answer(page);
    const std::vector<Json> errors = page.Heard("error");
    ASSERT_EQ(errors.size(), 1u) << action;
    EXPECT_THAT(errors[0].get<std::string>(), HasSubstr("No space left on device")) << action;
  }
  EXPECT_EQ(audit->stats().pending, 4u) << "refused actions are recorded as well";
}

TEST_F(ViewerSocketTest, AClearedLayerIsFollowedByThoseThatAreLeft) {
  Page page = Open(true);
  ShowAnother();
  page.Say({{"layers", true}});
  Answer(page);
  EXPECT_EQ(page.Heard("layers").at(0)["total"], "1");
  page.Say({{"clear", {{"owner", client_->info.owner}, {"layer", "a"}}}});
  Answer(page);
  const std::vector<Json> layers = page.Heard("layers");
  ASSERT_EQ(layers.size(), 1u);
  EXPECT_EQ(layers[0]["total"], "0");
}

}  // namespace viewer_socket_test
}  // namespace voxeld::daemon::viewer
