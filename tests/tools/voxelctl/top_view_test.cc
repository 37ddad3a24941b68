// Tests the dashboard's lines, without a terminal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/top/top_view.h"

namespace voxeld::voxelctl {
namespace {

using testing::HasSubstr;
using testing::Not;

v1::Stats StatsAt(int seconds) {
  v1::Stats stats;
  stats.set_time_ns(int64_t{seconds} * 1'000'000'000);
  stats.set_version("9.9\x1b");
  stats.set_uptime_ns(int64_t{5} * 1'000'000'000);
  stats.set_commits_accepted(static_cast<uint64_t>(100 * seconds));
  stats.set_bytes_in(static_cast<uint64_t>(5000 * seconds));
  stats.set_entities(static_cast<uint64_t>(seconds));
  stats.mutable_memory()->set_limit_bytes(1000);
  stats.mutable_memory()->set_scene_bytes(500);
  stats.mutable_connections()->set_open(3);
  for (const char* name : {"one", "two", "three"}) {
    v1::DisplayStats* display = stats.add_displays();
    display->set_name(name);
    display->set_state(v1::DISPLAY_STATE_SHOWING);
    display->mutable_assemble()->set_p50_ns(2'000'000);
    display->set_commits_superseded(1234);
  }
  return stats;
}

v1::ListOwnersResponse Owners(int count) {
  v1::ListOwnersResponse owners;
  for (int i = 1; i <= count; ++i) {
    v1::OwnerInfo* owner = owners.add_owners();
    owner->set_owner(static_cast<uint64_t>(i));
    owner->add_client_names(absl::StrCat("client\x1b ", i));
  }
  return owners;
}

std::string Text(const TopView& view, int width = 120, int height = 60) {
  std::string text;
  for (const TopLine& line : view.Lines(width, height)) absl::StrAppend(&text, line.text, "\n");
  return text;
}

TopStyle StyleOf(const TopView& view, const std::string& words) {
  for (const TopLine& line : view.Lines(120, 60)) {
    if (line.text.find(words) != std::string::npos) return line.style;
  }
  ADD_FAILURE() << "no line has " << words;
  return TopStyle::kPlain;
}

TEST(TopView, SaysThatItWaits) {
  TopView view;
  EXPECT_THAT(Text(view), HasSubstr("waiting for the server …"));
  view.Lose("gone");
  EXPECT_THAT(Text(view), HasSubstr("nothing comes: gone"));
}

TEST(TopView, RatesAreOfWhatCameSinceTheLast) {
  TopView view;
  view.Take(StatsAt(10), Owners(1), "");
  EXPECT_THAT(Text(view), HasSubstr("commits 0.0/s of 1,000 accepted"));
  view.Take(StatsAt(12), Owners(1), "");
  EXPECT_THAT(Text(view), HasSubstr("commits 100.0/s of 1,200 accepted, 0 refused; 5.00 kB/s in"));
  view.Take(StatsAt(11), Owners(1), "");
  EXPECT_THAT(Text(view), HasSubstr("commits 0.0/s")) << "a server that was restarted";
}

TEST(TopView, WhatTheServerSaysIsMadeFitForATerminal) {
  TopView view;
  v1::Stats stats = StatsAt(1);
  stats.mutable_displays(0)->set_name("evil\x1b[2J");
  stats.mutable_displays(0)->set_engine_degraded("lost\x1b");
  stats.mutable_displays(0)->set_state(v1::DISPLAY_STATE_LOST);
  stats.mutable_displays(0)->set_state_reason("why\x1b");
  stats.mutable_connections()->set_access_trouble("grants\x1b");
  stats.mutable_process()->set_trouble("memory\x1b");
  stats.mutable_process()->set_time_trouble("it did not run");
  stats.mutable_connections()->set_accept_trouble("none could be accepted");
  stats.mutable_displays(1)->set_device_trouble("cable\x1b");
  view.Take(stats, Owners(1), "");
  EXPECT_THAT(Text(view), Not(HasSubstr("\x1b")));
  for (const char* words : {"evil\\u{1b}[2J", "lost\\u{1b}", "why\\u{1b}", "grants\\u{1b}",
                            "memory\\u{1b}", "client\\u{1b} 1", "9.9\\u{1b}"}) {
    EXPECT_THAT(Text(view), HasSubstr(words));
  }
  EXPECT_THAT(TopText(stats, Owners(1)), Not(HasSubstr("\x1b")));
  EXPECT_THAT(TopText(stats, Owners(1)),
              HasSubstr("none could be accepted\ngrants\\u{1b}\nmemory\\u{1b}\nit did not run\n"
                        "display two: cable\\u{1b}\n"));
}

TEST(TopView, DisplaysAreChosenRoundAndRound) {
  TopView view;
  view.Choose(1);  // nothing exists yet
  view.Take(StatsAt(1), Owners(1), "");
  EXPECT_THAT(Text(view), HasSubstr("LATENCY of one"));
  view.Choose(-1);
  EXPECT_THAT(Text(view), HasSubstr("LATENCY of three"));
  EXPECT_THAT(Text(view), HasSubstr(">three"));
  view.Choose(2);
  EXPECT_THAT(Text(view), HasSubstr("LATENCY of two"));
  v1::Stats fewer = StatsAt(2);
  fewer.mutable_displays()->DeleteSubrange(1, 1);
  view.Take(fewer, Owners(1), "");
  EXPECT_THAT(Text(view), HasSubstr("LATENCY of one")) << "the selected one is removed";
  view.Take(StatsAt(3), Owners(1), "");
  EXPECT_THAT(Text(view), HasSubstr("LATENCY of two")) << "and is back";
  view.Take(v1::Stats(), Owners(0), "");
  view.Choose(1);
  EXPECT_THAT(Text(view), HasSubstr("the server has no display"));
}

TEST(TopView, WhatIsPausedStays) {
  TopView view;
  view.Take(StatsAt(1), Owners(1), "");
  view.TogglePause();
  view.Take(StatsAt(7), Owners(1), "");
  EXPECT_THAT(Text(view), HasSubstr("1 entity"));
  EXPECT_THAT(Text(view), HasSubstr("PAUSED"));
  view.TogglePause();
  view.Take(StatsAt(8), Owners(1), "");
  EXPECT_THAT(Text(view), HasSubstr("8 entities"));
  EXPECT_THAT(Text(view), Not(HasSubstr("PAUSED")));
}

TEST(TopView, TroubleIsColoured) {
  TopView view;
  v1::Stats stats = StatsAt(1);
  stats.mutable_displays(1)->set_state(v1::DISPLAY_STATE_LOST);
  stats.mutable_displays(2)->set_engine_degraded("the CPU draws");
  stats.mutable_memory()->set_scene_bytes(950);
  view.Take(stats, Owners(0), "you may not");
  EXPECT_EQ(StyleOf(view, "one "), TopStyle::kChosen);
  EXPECT_EQ(StyleOf(view, "two "), TopStyle::kBad);
  EXPECT_EQ(StyleOf(view, "three "), TopStyle::kWarning);
  EXPECT_EQ(StyleOf(view, "MEMORY"), TopStyle::kBad);
  EXPECT_EQ(StyleOf(view, "owners are not told: you may not"), TopStyle::kWarning);
  EXPECT_EQ(StyleOf(view, "CONNECTIONS"), TopStyle::kPlain);
  stats.mutable_connections()->set_cut_for_time(2);
  view.Take(stats, Owners(0), "");
  EXPECT_EQ(StyleOf(view, "CONNECTIONS"), TopStyle::kWarning);
  view.Take(stats, Owners(0), "");
  EXPECT_EQ(StyleOf(view, "CONNECTIONS"), TopStyle::kPlain) << "it was before";
}

TEST(TopView, KeepsToTheRoomThatThereIs) {
  TopView view;
  view.Take(StatsAt(1), Owners(500), "");
  for (const auto& [width, height] : {std::pair(120, 60), {80, 24}, {20, 5}, {1, 1}, {0, 0}}) {
    const std::vector<TopLine> lines = view.Lines(width, height);
    EXPECT_EQ(lines.size(), static_cast<size_t>(height));
    for (const TopLine& line : lines) {
      const auto columns = std::count_if(line.text.begin(), line.text.end(),
                                         [](char c) { return (c & 0xc0) != 0x80; });
      EXPECT_LE(columns, width) << line.text;
    }
  }
  EXPECT_THAT(view.Lines(120, 24).back().text, HasSubstr("lines more on a higher terminal"));
  EXPECT_THAT(view.Lines(120, 600).back().text, Not(HasSubstr("more")));
}

TEST(TopText, IsTables) {
  const std::string text = TopText(StatsAt(1), Owners(2));
  EXPECT_THAT(text, HasSubstr("DISPLAY"));
  EXPECT_THAT(text, HasSubstr("1,234"));
  EXPECT_THAT(text, HasSubstr("client\\u{1b} 2"));
  EXPECT_THAT(text, HasSubstr("memory 500 B of 1.00 kB; connections 3 open"));
}

}  // namespace
}  // namespace voxeld::voxelctl
