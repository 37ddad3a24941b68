// Tests how streams begin: Open, and other requests that are not operations or that qualify a
// commit.
#include <gmock/gmock.h>

#include <limits>
#include <variant>

#include "absl/strings/str_cat.h"
#include "daemon/wire/decode.h"
#include "tests/daemon/wire/requests.h"

namespace voxeld::daemon::wire {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

struct OpenCase {
  const char* name;
  void (*spoil)(v1::Open&);
  absl::StatusCode code;
  const char* text;
};

const OpenCase kOpenCases[] = {
    {"name", [](v1::Open& o) { o.set_client_name(std::string(129, 'x')); },
     absl::StatusCode::kInvalidArgument, "open.client_name has 129 bytes"},
    {"policy", [](v1::Open& o) { o.set_on_disconnect(static_cast<v1::DisconnectPolicy>(9)); },
     absl::StatusCode::kInvalidArgument, "open.on_disconnect has the unknown value 9"},
    {"linger_negative",
     [](v1::Open& o) {
       o.set_on_disconnect(v1::DISCONNECT_POLICY_LINGER);
       o.set_linger_ns(-1);
     },
     absl::StatusCode::kInvalidArgument, "open.linger_ns is -1"},
    {"linger_long",
     [](v1::Open& o) {
       o.set_on_disconnect(v1::DISCONNECT_POLICY_LINGER);
       o.set_linger_ns(3'600'000'000'001);
     },
     absl::StatusCode::kInvalidArgument, "open.linger_ns is 3600000000001"},
    {"linger_without", [](v1::Open& o) { o.set_linger_ns(1); }, absl::StatusCode::kInvalidArgument,
     "goes with on_disconnect"},
    {"token", [](v1::Open& o) { o.set_resume_token("t"); }, absl::StatusCode::kInvalidArgument,
     "open.resume_token has 1 bytes"},
    {"owner_token", [](v1::Open& o) { o.set_owner_token("to"); },
     absl::StatusCode::kInvalidArgument, "open.owner_token has 2 bytes"},
    {"both_tokens",
     [](v1::Open& o) {
       o.set_resume_token("0123456789abcdef");
       o.set_owner_token("0123456789abcdef");
     },
     absl::StatusCode::kInvalidArgument, "beside resume_token"},
    {"oldest", [](v1::Open& o) { o.set_flow(v1::FLOW_POLICY_DROP_OLDEST); },
     absl::StatusCode::kInvalidArgument, "open.drop_oldest_frames is 0"},
    {"oldest_many",
     [](v1::Open& o) {
       o.set_flow(v1::FLOW_POLICY_DROP_OLDEST);
       o.set_drop_oldest_frames(65);
     },
     absl::StatusCode::kInvalidArgument, "open.drop_oldest_frames is 65"},
    {"flow", [](v1::Open& o) { o.set_flow(static_cast<v1::FlowPolicy>(9)); },
     absl::StatusCode::kInvalidArgument, "open.flow has the unknown value 9"},
    {"frames", [](v1::Open& o) { o.set_drop_oldest_frames(2); }, absl::StatusCode::kInvalidArgument,
     "open.drop_oldest_frames is 2"},
};

class Opens : public ::testing::TestWithParam<OpenCase> {};

TEST_P(Opens, AreRefusedWithAStatus) {
  v1::StreamRequest request;
  GetParam().spoil(*request.mutable_open());
  const Decoded decoded = Decode(request);
  EXPECT_EQ(decoded.status.code(), GetParam().code);
  EXPECT_THAT(std::string(decoded.status.message()), HasSubstr(GetParam().text));
  EXPECT_FALSE(decoded.open.has_value());
}

INSTANTIATE_TEST_SUITE_P(Field, Opens, ::testing::ValuesIn(kOpenCases),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(Decode, OpenWithAPolicyAndTokens) {
  v1::StreamRequest request;
  request.mutable_open()->set_flow(v1::FLOW_POLICY_DROP_OLDEST);
  request.mutable_open()->set_drop_oldest_frames(64);
  request.mutable_open()->set_owner_token("0123456789abcdef");
  Decoded decoded = Decode(request);
  ASSERT_TRUE(decoded.open.has_value()) << decoded.status;
  EXPECT_EQ(decoded.open->flow, FlowPolicy::kDropOldest);
  EXPECT_EQ(decoded.open->drop_oldest_frames, 64u);
  EXPECT_EQ(decoded.open->owner_token, "0123456789abcdef");
  request.mutable_open()->Clear();
  request.mutable_open()->set_flow(v1::FLOW_POLICY_LATEST);
  request.mutable_open()->set_resume_token("0123456789abcdef");
  decoded = Decode(request);
  ASSERT_TRUE(decoded.open.has_value()) << decoded.status;
  EXPECT_EQ(decoded.open->flow, FlowPolicy::kLatest);
  EXPECT_EQ(decoded.open->resume_token, "0123456789abcdef");
}

TEST(Decode, APingIsNoOperationAndTakesNoNumber) {
  v1::StreamRequest request;
  request.mutable_ping()->set_client_time_ns(-5);
  const Decoded decoded = Decode(request, {}, 41);
  EXPECT_EQ(decoded.ping_client_time_ns, -5);
  EXPECT_THAT(decoded.operations, IsEmpty());
  EXPECT_THAT(decoded.refused.issues, IsEmpty());
  EXPECT_EQ(decoded.sequence, 41u);
}

TEST(Decode, ACommitWithItsTime) {
  v1::StreamRequest request;
  request.mutable_commit()->set_present_at_ns(77);
  request.mutable_commit()->set_must_show(true);
  request.mutable_commit()->set_send_time_ns(-3);
  const Decoded decoded = Decode(request);
  EXPECT_THAT(decoded.refused.issues, IsEmpty());
  const Commit& commit = std::get<Commit>(decoded.operations.at(0).op);
  EXPECT_EQ(commit.present_at_ns, 77);
  EXPECT_TRUE(commit.must_show);
  EXPECT_EQ(commit.send_time_ns, -3);
}

TEST(Decode, Open) {
  v1::StreamRequest request;
  v1::Open* open = request.mutable_open();
  open->set_client_name("me");
  open->set_on_disconnect(v1::DISCONNECT_POLICY_LINGER);
  open->set_linger_ns(3'600'000'000'000);
  open->set_strict(true);
  open->set_no_outcomes(true);
  open->set_flow(v1::FLOW_POLICY_RELIABLE);
  const Decoded decoded = Decode(request);
  ASSERT_TRUE(decoded.open.has_value()) << decoded.status;
  EXPECT_EQ(decoded.open->client_name, "me");
  EXPECT_EQ(decoded.open->on_disconnect, DisconnectPolicy::kLinger);
  EXPECT_EQ(decoded.open->linger_ns, 3'600'000'000'000);
  EXPECT_TRUE(decoded.open->strict);
  EXPECT_TRUE(decoded.open->no_outcomes);
  EXPECT_EQ(decoded.sequence, 1u);
}

}  // namespace
}  // namespace voxeld::daemon::wire
