// Tests texts for terminals, tables, JSON.
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"
#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {
namespace {

TEST(Table, AlignsAndEscapes) {
  Table table({{"NAME"}, {"COUNT", Table::Align::kRight}});
  table.Add({"ä", "1"});
  table.Add({"long name", "12345"});
  table.Add({"e\x1b", ""});
  EXPECT_EQ(table.Text(), "NAME       COUNT\nä              1\nlong name  12345\ne\\u{1b}\n");
}

TEST(Figures, ForPeople) {
  EXPECT_EQ(Grouped(0), "0");
  EXPECT_EQ(Counted(0, "volume"), "0 volumes");
  EXPECT_EQ(Counted(1, "volume"), "1 volume");
  EXPECT_EQ(Counted(1234, "volume"), "1,234 volumes");
  EXPECT_EQ(Counted(1, "entity", "entities"), "1 entity");
  EXPECT_EQ(Counted(2, "entity", "entities"), "2 entities");
  EXPECT_EQ(Grouped(999), "999");
  EXPECT_EQ(Grouped(1234567), "1,234,567");
  EXPECT_EQ(Grouped(UINT64_MAX), "18,446,744,073,709,551,615");
  EXPECT_EQ(Bytes(999), "999 B");
  EXPECT_EQ(Bytes(1500), "1.50 kB");
  EXPECT_EQ(Bytes(12'340'000), "12.3 MB");
  EXPECT_EQ(Bytes(999'600'000), "1.00 GB");
  EXPECT_EQ(Bytes(UINT64_MAX), "18.4 EB");
  EXPECT_EQ(Duration(0), "–");
  EXPECT_EQ(Duration(1500), "2 µs");
  EXPECT_EQ(Duration(12'340'000), "12.34 ms");
  EXPECT_EQ(Duration(61'000'000'000), "1 min 01 s");
  EXPECT_EQ(Duration(3'720'000'000'000), "1 h 02 min");
}

TEST(ToJson, NamesAndTypesOfTheProto) {
  v1::Stats stats;
  stats.set_bytes_in(18'000'000'000'000'000'000u);
  stats.set_version("1\xff");
  v1::DisplayStats* display = stats.add_displays();
  display->set_name("d\"0");
  display->set_state(v1::DISPLAY_STATE_SHOWING);
  display->set_volumes_per_second(std::numeric_limits<double>::quiet_NaN());
  display->mutable_commit_to_last_byte()->set_p99_ns(-5);
  const nlohmann::json json = nlohmann::json::parse(JsonText(ToJson(stats), false));
  EXPECT_EQ(json["bytes_in"], 18'000'000'000'000'000'000u);
  EXPECT_EQ(json["entities"], 0);
  EXPECT_EQ(json["displays"][0]["name"], "d\"0");
  EXPECT_EQ(json["displays"][0]["state"], "DISPLAY_STATE_SHOWING");
  EXPECT_TRUE(json["displays"][0]["volumes_per_second"].is_null());
  EXPECT_EQ(json["displays"][0]["commit_to_last_byte"]["p99_ns"], -5);
  EXPECT_FALSE(json["displays"][0].contains("assemble"));
}

TEST(ToJson, OneofsBytesAndRepeatedNumbers) {
  v1::StreamResponse response;
  response.mutable_opened()->set_resume_token(std::string("\0\1\2", 3));
  response.mutable_opened()->add_displays(std::string("a"));
  const nlohmann::json json = nlohmann::json::parse(JsonText(ToJson(response), true));
  EXPECT_EQ(json["opened"]["resume_token"], "AAEC");
  EXPECT_EQ(json["opened"]["displays"], nlohmann::json::array({"a"}));
  EXPECT_FALSE(json.contains("receipt"));
  v1::Affine affine;
  affine.add_m(0.5);
  EXPECT_EQ(JsonText(ToJson(affine), true), "{\"m\":[0.5]}\n");
}

}  // namespace
}  // namespace voxeld::voxelctl
