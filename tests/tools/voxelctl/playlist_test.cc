#include "tools/voxelctl/playlist/playlist.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>

namespace voxeld::voxelctl {
namespace {

using ::testing::HasSubstr;

enum Day { kMon, kTue, kWed, kThu, kFri, kSat, kSun };

WeekMinute At(Day day, int hour, int minute = 0) { return day * kDayMinutes + hour * 60 + minute; }

TEST(Playlist, SaysWhatIsPlayedAndWhen) {
  const auto playlist = ParsePlaylist(R"(
cross_fade = 2.5
loop = false
[[item]]
file = "day.mcap"
seconds = 30
speed = 2
from = "08:00"
to = "20:30"
[[item]]
file = "/srv/night.mcap"
days = ["fri", "sat"]
)",
                                      "shows/week.toml");
  ASSERT_TRUE(playlist.ok()) << playlist.status();
  EXPECT_EQ(playlist->cross_fade_s, 2.5);
  EXPECT_FALSE(playlist->loop);
  ASSERT_EQ(playlist->items.size(), 2u);
  EXPECT_EQ(playlist->items[0].file, "shows/day.mcap");
  EXPECT_EQ(playlist->items[0].seconds, 30);
  EXPECT_EQ(playlist->items[0].speed, 2);
  EXPECT_EQ(playlist->items[0].hours.from, 480);
  EXPECT_EQ(playlist->items[0].hours.to, 1230);
  EXPECT_EQ(playlist->items[0].hours.days, 0x7F);
  EXPECT_EQ(playlist->items[1].file, "/srv/night.mcap");
  EXPECT_EQ(playlist->items[1].seconds, std::nullopt);
  EXPECT_EQ(playlist->items[1].hours.days, 1 << kFri | 1 << kSat);
}

TEST(Playlist, EveryFaultIsToldWithItsPlace) {
  const auto playlist = ParsePlaylist(R"(cross_fade = -1
fade = 2
[[item]]
seconds = "long"
from = "25:00"
to = 7
days = ["friday"]
[[item]]
file = "a.mcap"
to = "12:60"
days = []
)",
                                      "w.toml");
  ASSERT_TRUE(absl::IsInvalidArgument(playlist.status()));
  const std::string text(playlist.status().message());
  for (const char* fault :
       {"w.toml:1:14: cross_fade is -1; give a number from 0 to 60", "w.toml:2:1: unknown key fade",
        "w.toml:3:1: an item without file", "w.toml:4:11: seconds is 'long'",
        "w.toml:5:8: from is '25:00'", "w.toml:6:6: to is 7", "w.toml:7:9: days has 'friday'",
        "w.toml:10:6: to is '12:60'", "w.toml:11:8: days is no list of days"}) {
    EXPECT_THAT(text, HasSubstr(fault));
  }
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 8) << text;
}

TEST(Playlist, IsOneOnlyWithItems) {
  EXPECT_THAT(ParsePlaylist("loop = true", "w.toml").status().message(), HasSubstr("[[item]]"));
  EXPECT_THAT(ParsePlaylist("item = 3", "w.toml").status().message(), HasSubstr("[[item]]"));
  EXPECT_THAT(ParsePlaylist("item = [", "w.toml").status().message(), HasSubstr("w.toml:1:"));
  EXPECT_TRUE(absl::IsNotFound(ReadPlaylist("/nowhere/w.toml").status()));
}

TEST(Playlist, TheExampleIsOne) {
  const absl::StatusOr<Playlist> example =
      ReadPlaylist(VOXELD_SOURCE_DIR "/packaging/playlist.toml");
  ASSERT_TRUE(example.ok()) << example.status();
  EXPECT_EQ(example->items.size(), 3u);
}

TEST(HoursOfItems, AreWithinTheirDay) {
  const Hours hours{.from = 8 * 60, .to = 20 * 60, .days = 1 << kTue};
  EXPECT_FALSE(IsWithin(hours, At(kTue, 7, 59)));
  EXPECT_TRUE(IsWithin(hours, At(kTue, 8)));
  EXPECT_TRUE(IsWithin(hours, At(kTue, 19, 59)));
  EXPECT_FALSE(IsWithin(hours, At(kTue, 20)));
  EXPECT_FALSE(IsWithin(hours, At(kWed, 12)));
}

TEST(HoursOfItems, GoOnIntoTheNextDay) {
  const Hours hours{.from = 22 * 60, .to = 6 * 60, .days = 1 << kSun};
  EXPECT_TRUE(IsWithin(hours, At(kSun, 23)));
  EXPECT_TRUE(IsWithin(hours, At(kMon, 5, 59))) << "Sunday's, though it is Monday";
  EXPECT_FALSE(IsWithin(hours, At(kMon, 6)));
  EXPECT_FALSE(IsWithin(hours, At(kMon, 22)));
  const Hours whole{.from = 9 * 60, .to = 9 * 60, .days = 1 << kMon};
  EXPECT_TRUE(IsWithin(whole, At(kTue, 8, 59))) << "from nine to nine is a day";
  EXPECT_FALSE(IsWithin(whole, At(kTue, 9)));
}

Playlist Three() {
  Playlist playlist;
  playlist.items = {{.file = "a"}, {.file = "b", .hours = {.from = 600, .to = 660}}, {.file = "c"}};
  return playlist;
}

TEST(NextItem, IsTheNextOfThoseWhoseHoursItIs) {
  const Playlist playlist = Three();
  EXPECT_EQ(NextItem(playlist, std::nullopt, At(kMon, 3)), 0u);
  EXPECT_EQ(NextItem(playlist, 0, At(kMon, 3)), 2u);
  EXPECT_EQ(NextItem(playlist, 0, At(kMon, 10, 30)), 1u);
  EXPECT_EQ(NextItem(playlist, 2, At(kMon, 3)), 0u) << "again from the beginning";
}

TEST(NextItem, IsNoneWhereNoneIsOnOrTheLastHasBeen) {
  Playlist playlist = Three();
  playlist.loop = false;
  EXPECT_EQ(NextItem(playlist, 2, At(kMon, 3)), std::nullopt);
  EXPECT_EQ(NextItem(playlist, 1, At(kMon, 3)), 2u);
  playlist.loop = true;
  playlist.items = {playlist.items[1]};
  EXPECT_EQ(NextItem(playlist, 0, At(kMon, 3)), std::nullopt);
  EXPECT_EQ(NextItem(playlist, 0, At(kMon, 10)), 0u) << "one alone comes after itself";
}

}  // namespace
}  // namespace voxeld::voxelctl
