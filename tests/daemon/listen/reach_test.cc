// Tests what the probe's attempt reports about a peer that does not accept, refuses, closes, or
// answers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <chrono>
#include <functional>
#include <string_view>
#include <thread>

#include "daemon/listen/probe.h"

namespace voxeld::daemon::listen {
namespace reach_test {

using ::testing::HasSubstr;

constexpr sync::TimeNs kShort = 50 * sync::kMillisecond, kLong = 30 * sync::kSecond;
constexpr std::string_view kSettings{"\0\0\0\4\0\0\0\0\0", 9};
constexpr std::string_view kAnswer{"\0\0\1\1\4\0\0\0\1\x88", 10};
constexpr std::string_view kGoAway{"\0\0\x8\7\0\0\0\0\0\0\0\0\0\0\0\0\0", 17};

class ReachTest : public ::testing::Test {
 protected:
  ReachTest() {
    sockaddr_in any = {};  // the wildcard address, on which a daemon may listen
    any.sin_family = AF_INET;
    listening_.Reset(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(bind(listening_.get(), reinterpret_cast<sockaddr*>(&any), sizeof(any)), 0);
    EXPECT_EQ(::listen(listening_.get(), 8), 0);
    target_.text = "it";
    EXPECT_EQ(getsockname(listening_.get(), target_.name.get(), &target_.name.length), 0);
  }

  // Returns the result of Reach while the peer accepts once, reads the request and sends `answer`.
  absl::Status With(std::string_view answer, sync::TimeNs limit) {
    std::thread other([&] {
      SocketName name;
      const Descriptor got(accept(listening_.get(), name.get(), &name.length));
      was_own_ = own_.Has(PeerOf(name.address, name.length).name);
      char buffer[4096];
      EXPECT_GT(recv(got.get(), buffer, sizeof(buffer), 0), 0);
      EXPECT_EQ(send(got.get(), answer.data(), answer.size(), MSG_NOSIGNAL),
                static_cast<ssize_t>(answer.size()));
      if (hold_) recv(got.get(), buffer, sizeof(buffer), 0);  // until it closes
    });
    const absl::Status status = Reach(target_, own_, limit);
    other.join();
    return status;
  }

  Descriptor listening_;
  ProbeTarget target_;
  OwnPeers own_;
  bool hold_ = true, was_own_ = false;
};

TEST_F(ReachTest, WhoAnswersTheCallIsReached) {
  EXPECT_TRUE(With(std::string(kSettings).append(kAnswer), kLong).ok());
  EXPECT_TRUE(was_own_) << "the listener must recognise it";
}

TEST_F(ReachTest, WhoNeverAcceptsIsDeaf) {
  const absl::Status status = Reach(target_, own_, kShort);
  EXPECT_TRUE(absl::IsDeadlineExceeded(status)) << status;
  EXPECT_EQ(status.message(), "no answer came in time");
}

TEST_F(ReachTest, WhoSaysNothingOfTheCallIsDeafAsWell) {
  EXPECT_TRUE(absl::IsDeadlineExceeded(With(kSettings, kShort)));
}

TEST_F(ReachTest, WhoGoesOrSendsAwayIsNotReached) {
  EXPECT_TRUE(absl::IsUnavailable(With(std::string(kSettings).append(kGoAway), kLong)));
  hold_ = false;
  EXPECT_THAT(std::string(With(kSettings, kLong).message()), HasSubstr("without an answer"));
}

TEST_F(ReachTest, WhereNobodyListensNobodyIsReached) {
  listening_.Reset(-1);
  const absl::Status status = Reach(target_, own_, kLong);
  EXPECT_FALSE(status.ok());
  EXPECT_THAT(std::string(status.message()), HasSubstr("connect"));
}

}  // namespace reach_test
}  // namespace voxeld::daemon::listen
