#include "daemon/reload/reloader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <future>
#include <memory>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "daemon/config/display_view.h"
#include "display/drivers/registry.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::reload {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kDisplay[] =
    "[[display]]\nname = \"cube\"\ndriver = \"simulated\"\nsize = \"8x8x8\"\npower_full = 40\n";

// A core with the configured displays, which run.
class ReloaderTest : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory(folder_); }
  void TearDown() override {
    if (core_ != nullptr) {
      EXPECT_TRUE(core_->Stop(10 * sync::kSecond).ok());
    }
    std::filesystem::remove_all(folder_);
  }

  void Put(const std::string& path, const std::string& text) {
    std::ofstream(path, std::ios::trunc) << text;
  }

  void Begin(const std::string& text, CommandLine command_line = {}) {
    Put(file_, text);
    if (names_file_) command_line.config = file_;
    absl::StatusOr<Config> config = LoadConfig(file_, nothing_);
    ASSERT_TRUE(config.ok()) << config.status();
    ASSERT_TRUE(ApplyCommandLine(command_line, &*config).ok());
    access_ = std::make_unique<access::Access>(
        *AccessOf(config->security), [] { return 1; }, nullptr);
    ASSERT_TRUE(access_->Look().ok());
    core_ = std::make_unique<Core>(CoreOptions{.version = "test"}, clock_);
    for (const DisplayConfig& wanted : config->displays) {
      const absl::StatusOr<DisplayOptions> options = SplitDisplayOptions(wanted);
      ASSERT_TRUE(options.ok()) << options.status();
      auto display = display::CreateDisplay(
          {.name = wanted.name, .driver = wanted.driver, .options = options->driver}, clock_);
      ASSERT_TRUE(display.ok()) << display.status();
      ASSERT_TRUE(core_
                      ->AddDisplay(*std::move(display),
                                   {.kind = gpu::EngineKind::kCpu, .inline_execution = true},
                                   options->setup)
                      .ok());
    }
    ASSERT_TRUE(core_->Start().ok());
    reloader_ = std::make_unique<Reloader>(
        *config, command_line, nothing_,
        Reloader::Parts{.access = *access_, .core = *core_, .log = log_});
  }

  absl::StatusOr<Changes> Reload(const std::string& text) {
    Put(file_, text);
    return reloader_->Reload();
  }

  DisplayDescription Cube() {
    std::promise<DisplayDescription> promise;
    core_->GetDisplay("cube", [&](auto answer) { promise.set_value(*answer); });
    return promise.get_future().get();
  }
  void Set(DisplayUpdate update) {
    std::promise<absl::Status> promise;
    core_->UpdateDisplay("cube", std::move(update),
                         [&](auto answer) { promise.set_value(answer.status()); });
    ASSERT_TRUE(promise.get_future().get().ok());
  }
  std::string AnonymousScopes() { return access_->Identify({})->scopes.ToString(); }

  bool names_file_ = true;  // named on the command line; otherwise it is found by itself
  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-reload-", getpid());
  const std::string file_ = folder_ + "/voxeld.toml", grants_ = folder_ + "/grants.toml";
  const Environment nothing_ = [](const char*) { return std::nullopt; };
  sync::SystemClock clock_;
  std::ostringstream lines_;
  Logger log_{Logger::Level::kInfo, Logger::Format::kText,
              std::make_shared<spdlog::sinks::ostream_sink_mt>(lines_)};
  std::unique_ptr<access::Access> access_;
  std::unique_ptr<Core> core_;
  std::unique_ptr<Reloader> reloader_;
};

TEST_F(ReloaderTest, WhatARunningDaemonTakesIsInForceAtOnce) {
  Begin(kDisplay);
  ASSERT_EQ(Cube().view.mode, ViewOptions::Mode::kFit);
  const auto changes =
      Reload(absl::StrCat("[log]\nlevel = \"debug\"\n[security]\nanonymous_scopes = \"view\"\n",
                          kDisplay, "view = \"voxels\"\npower_limit = 12.5\n"));
  ASSERT_TRUE(changes.ok()) << changes.status();
  EXPECT_THAT(changes->at_once, ElementsAre("log.level", "security.anonymous_scopes",
                                            "display.cube.power_limit", "display.cube.view"));
  EXPECT_THAT(changes->at_restart, IsEmpty());
  EXPECT_EQ(Cube().view.mode, ViewOptions::Mode::kVoxels);
  EXPECT_EQ(Cube().power_limit_w, 12.5);
  EXPECT_EQ(AnonymousScopes(), "view");
  log_.Log(Logger::Level::kDebug, "finer than before");
  EXPECT_THAT(lines_.str(), HasSubstr("finer than before"));
  EXPECT_EQ(reloader_->trouble(), "");

  // And back: options that the file does not set have their defaults.
  const auto back = Reload(kDisplay);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->at_once, changes->at_once);
  EXPECT_EQ(Cube().view.mode, ViewOptions::Mode::kFit);
  EXPECT_EQ(Cube().power_limit_w, 0);
  EXPECT_EQ(AnonymousScopes(), "view draw control");
}

TEST_F(ReloaderTest, AWrongFileChangesNothingAndEveryFaultIsTold) {
  Begin(kDisplay);
  const auto changes = Reload(absl::StrCat("[log]\nlevel = \"loud\"\n[engine]\nthread = 2\n",
                                           "[security]\nanonymous_scopes = \"none\"\n", kDisplay,
                                           "view = \"voxels\"\n"));
  ASSERT_FALSE(changes.ok());
  EXPECT_THAT(changes.status().message(), HasSubstr("voxeld.toml:2:"));
  EXPECT_THAT(changes.status().message(), HasSubstr("unknown key engine.thread"));
  EXPECT_THAT(reloader_->trouble(), HasSubstr("unknown key engine.thread"));
  EXPECT_EQ(reloader_->trouble().find('\n'), std::string::npos);
  EXPECT_EQ(Cube().view.mode, ViewOptions::Mode::kFit);
  EXPECT_EQ(AnonymousScopes(), "view draw control");

  ASSERT_TRUE(Reload(kDisplay).ok());
  EXPECT_EQ(reloader_->trouble(), "");
}

TEST_F(ReloaderTest, WhatIsRefusedLastTakesBackWhatCameBefore) {
  Begin(kDisplay);
  Put(grants_, "[[token]]\nname = \"left\"\n");  // without its hash
  const auto changes =
      Reload(absl::StrCat("[log]\nlevel = \"error\"\n[security]\ngrants = \"", grants_, "\"\n",
                          kDisplay, "view = \"voxels\"\npower_limit = 5\n"));
  ASSERT_FALSE(changes.ok());
  EXPECT_THAT(reloader_->trouble(), HasSubstr("grants.toml"));
  EXPECT_EQ(Cube().view.mode, ViewOptions::Mode::kFit);
  EXPECT_EQ(Cube().power_limit_w, 0);
  EXPECT_EQ(AnonymousScopes(), "view draw control");
  log_.Info("still heard");
  EXPECT_THAT(lines_.str(), HasSubstr("still heard"));
}

TEST_F(ReloaderTest, WhatADisplayRefusesIsRefusedWhole) {
  Begin(kDisplay);
  const auto changes = Reload(absl::StrCat("[security]\nanonymous_scopes = \"none\"\n", kDisplay,
                                           "view_box = \"0;0;0;0;1;1\"\n"));
  ASSERT_FALSE(changes.ok());
  EXPECT_THAT(changes.status().message(), HasSubstr("cube"));
  EXPECT_EQ(AnonymousScopes(), "view draw control");
}

TEST_F(ReloaderTest, WhatOnlyARestartChangesIsToldEachTime) {
  Begin(kDisplay);
  const std::string wanted =
      absl::StrCat("[engine]\nthreads = 3\n[limits]\nmax_sessions = 9\n",
                   "[[display]]\nname = \"cube\"\ndriver = \"simulated\"\n"
                   "size = \"4x4x4\"\npower_full = 40\n"
                   "[[display]]\nname = \"other\"\ndriver = \"simulated\"\n");
  for (int time = 0; time < 2; ++time) {
    const auto changes = Reload(wanted);
    ASSERT_TRUE(changes.ok()) << changes.status();
    EXPECT_THAT(changes->at_once, IsEmpty());
    EXPECT_THAT(changes->at_restart, ElementsAre("engine.threads", "limits.max_sessions",
                                                 "display.cube.size", "display.other"));
  }
  EXPECT_THAT(lines_.str(), HasSubstr("changes_with_a_restart=\"engine.threads"));
}

TEST_F(ReloaderTest, WhatClientsHaveSetStaysWhereTheFileDoesNotChangeIt) {
  Begin(kDisplay);
  Set({.brightness = 0.25, .power_limit_w = 7});
  const auto changes = Reload(absl::StrCat(kDisplay, "view = \"voxels\"\n"));
  ASSERT_TRUE(changes.ok()) << changes.status();
  EXPECT_EQ(Cube().brightness, 0.25);
  EXPECT_EQ(Cube().power_limit_w, 7);
  EXPECT_EQ(Cube().view.mode, ViewOptions::Mode::kVoxels);
}

TEST_F(ReloaderTest, TheCommandLineGoesOverTheFileAsAtTheStart) {
  CommandLine command_line;
  command_line.log_level = "warn";
  Begin(kDisplay, command_line);
  const auto changes = Reload(absl::StrCat("[log]\nlevel = \"trace\"\n", kDisplay));
  ASSERT_TRUE(changes.ok()) << changes.status();
  EXPECT_THAT(changes->at_once, IsEmpty());
}

TEST_F(ReloaderTest, AFileThatIsGoneChangesNothingHoweverItWasFound) {
  for (const bool named : {true, false}) {
    names_file_ = named;
    Begin(
        absl::StrCat("[security]\nanonymous_scopes = \"none\"\n", kDisplay, "view = \"voxels\"\n"));
    std::filesystem::remove(file_);
    EXPECT_FALSE(reloader_->Reload().ok());
    EXPECT_THAT(reloader_->trouble(), HasSubstr("voxeld.toml"));
    EXPECT_EQ(Cube().view.mode, ViewOptions::Mode::kVoxels);
    EXPECT_NE(AnonymousScopes(), "view draw control");
    ASSERT_TRUE(core_->Stop(10 * sync::kSecond).ok());
    core_ = nullptr;
  }
}

TEST_F(ReloaderTest, WhoMayDoWhatWaitsWithWhoCanCome) {
  Begin(absl::StrCat("[security]\nanonymous_scopes = \"view\"\n", kDisplay));
  const auto changes = Reload(absl::StrCat(
      "[server]\nlisten = [\"unix:/run/elsewhere.sock\"]\n[security]\nanonymous_scopes = \"all\"\n",
      kDisplay));
  ASSERT_TRUE(changes.ok()) << changes.status();
  EXPECT_THAT(changes->at_once, IsEmpty());
  EXPECT_THAT(changes->at_restart, ElementsAre("server.listen", "security.anonymous_scopes"));
  EXPECT_EQ(AnonymousScopes(), "view") << "the old address is still open";
}

TEST_F(ReloaderTest, DisplaysThatAreToComeAreLookedAtToo) {
  Begin(kDisplay);
  const auto changes = Reload(absl::StrCat(
      kDisplay, "[[display]]\nname = \"new\"\ndriver = \"simulated\"\nview = \"sideways\"\n"));
  ASSERT_FALSE(changes.ok());
  EXPECT_THAT(changes.status().message(), HasSubstr("sideways"));
}

TEST_F(ReloaderTest, AGrantsFileAloneIsItsOwnReaders) {
  Put(grants_, "");
  Begin(absl::StrCat("[security]\ngrants = \"", grants_, "\"\n", kDisplay));
  Put(grants_, "[[token]]\nname = \"left\"\n");  // wrong
  ASSERT_TRUE(reloader_->Reload().ok());
  EXPECT_EQ(reloader_->trouble(), "");
}

}  // namespace
}  // namespace voxeld::daemon::reload
