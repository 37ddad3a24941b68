// Tests the open calls, and which of them must end.
#include "daemon/services/active_calls.h"

#include <gmock/gmock.h>

#include "display/sync/fake_clock.h"

namespace voxeld::daemon::services {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

struct Call final : ActiveCall {
  explicit Call(std::string who = "") { SetCaller({.principal = std::move(who)}); }
  void End(const absl::Status& status) override { ends.push_back(status); }
  std::vector<absl::Status> ends;
};

class ActiveCallsTest : public ::testing::Test {
 protected:
  std::shared_ptr<Call> Added(std::string who = "") {
    auto call = std::make_shared<Call>(std::move(who));
    calls_.Add(call);
    return call;
  }
  size_t left() { return calls_.AwaitNone(clock_, clock_.Now()); }

  const absl::Status stops_ = absl::UnavailableError("the daemon stops");
  sync::FakeClock clock_;
  ActiveCalls calls_;
};

TEST_F(ActiveCallsTest, AllAreToldToEnd) {
  const auto one = Added(), two = Added(), gone = Added();
  calls_.Remove(gone.get());
  calls_.EndAll(stops_);
  EXPECT_THAT(one->ends, ElementsAre(stops_));
  EXPECT_THAT(two->ends, ElementsAre(stops_));
  EXPECT_THAT(gone->ends, IsEmpty());
  EXPECT_EQ(left(), 2u) << "until each has ended";
}

TEST_F(ActiveCallsTest, OneThatComesLaterIsToldAtOnce) {
  const auto before = Added();
  EXPECT_THAT(before->ends, IsEmpty());
  calls_.EndAll(stops_);
  const auto late = Added();
  EXPECT_THAT(late->ends, ElementsAre(stops_));
  EXPECT_THAT(before->ends, ElementsAre(stops_));
  EXPECT_EQ(left(), 2u);
}

TEST_F(ActiveCallsTest, OneIsKeptUntilItIsRemoved) {
  auto call = Added();
  const auto other = Added();
  const std::weak_ptr<Call> kept = call;
  const ActiveCall* const key = call.get();
  call.reset();
  ASSERT_FALSE(kept.expired());
  calls_.Remove(key);
  EXPECT_TRUE(kept.expired());
  calls_.Remove(key);
  EXPECT_EQ(left(), 1u) << "removing an unknown call removes no other";
}

TEST_F(ActiveCallsTest, ThoseWhoMayNotAnyMoreAreEnded) {
  const auto a = Added("a"), b = Added("b"), again = Added("a");
  const absl::Status revoked = absl::UnauthenticatedError("a may not any more");
  EXPECT_EQ(calls_.EndRevoked([&](const access::Caller& caller) {
    return caller.principal == "a" ? revoked : absl::OkStatus();
  }),
            2u);
  EXPECT_THAT(a->ends, ElementsAre(revoked));
  EXPECT_THAT(again->ends, ElementsAre(revoked));
  EXPECT_THAT(b->ends, IsEmpty());
}

}  // namespace
}  // namespace voxeld::daemon::services
