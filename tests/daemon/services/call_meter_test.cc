// Tests which calls of a connection count as cancelled, by gRPC's own statistics.
#include "daemon/services/call_meter.h"

#include <gtest/gtest.h>

namespace voxeld::daemon::services {
namespace {

constexpr char kSocket[] =
    R"({"socket":{"data":{"lastMessageSentTimestamp":"2026-01-31T12:00:00.5Z","messagesReceived":"21","messagesSent":"3",)"
    R"("streamsFailed":"7","streamsStarted":"18446744073709551615","streamsSucceeded":"12"},)"
    R"("ref":{"name":"chttp2 ipv4:127.0.0.1:40000","socketId":"5"}}})";

TEST(CallTotals, AreReadFromTheFiguresOfASocket) {
  const CallTotals totals = CallTotals::FromJson(kSocket);
  EXPECT_EQ(totals.started, UINT64_MAX);
  EXPECT_EQ(totals.succeeded, 12u);
  EXPECT_EQ(totals.failed, 7u);
  EXPECT_EQ(totals.messages, 21u);
}

TEST(CallTotals, WhatIsNotThereIsNone) {
  for (const char* json : {"", "{}", R"({"streamsStarted":"x"})", R"({"streamsStarted":")"}) {
    const CallTotals totals = CallTotals::FromJson(json);
    EXPECT_EQ(totals.started + totals.succeeded + totals.failed, 0u) << json;
  }
}

TEST(CallTotals, CancelledAreTheFailedAndThoseBeyondWhatAConnectionMayHave) {
  EXPECT_EQ((CallTotals{.started = 110, .succeeded = 5, .failed = 5}.Cancelled(100)), 5u);
  EXPECT_EQ((CallTotals{.started = 150, .succeeded = 5, .failed = 5}.Cancelled(100)), 45u);
  EXPECT_EQ((CallTotals{.started = 5, .succeeded = 5, .failed = 1}.Cancelled(100)), 1u)
      << "read while it changed";
}

}  // namespace
}  // namespace voxeld::daemon::services
