// Tests a system that has no random bytes for a token.
#include <gmock/gmock.h>

#include <cerrno>

#include "daemon/local/local_session.h"
#include "tests/daemon/local/socket_fixture.h"
#include "tests/refused_calls.h"

namespace voxeld::daemon::local {
namespace {

using ::testing::HasSubstr;

class NoRandomBytesTest : public LocalSocketTest {};

TEST_F(NoRandomBytesTest, ASessionIsOfferedNothing) {
  LocalSocket& socket = Start();
  {
    const RefusedCalls refused(SystemCall::kGetrandom, ENOSYS);
    LocalSession session(&socket, 7);
    EXPECT_EQ(refused.made(), 1);
    EXPECT_EQ(session.path(), "");
    EXPECT_EQ(session.token(), "");
    EXPECT_EQ(session.memory(), nullptr);
    session.Close();
  }
  LocalClient client(path());
  client.Send(HelloMessage(std::string(Tokens::kBytes, '\0')));
  std::optional<v1::LocalAnswer> answer = client.Read();
  ASSERT_TRUE(answer.has_value());
  EXPECT_FALSE(answer->has_welcome()) << "an unfilled token is not used";

  const LocalSession next(&socket, 7);
  EXPECT_EQ(next.path(), path());
  EXPECT_EQ(next.token().size(), Tokens::kBytes);
}

TEST_F(NoRandomBytesTest, NoTokenIsMade) {
  LocalSocket& socket = Start();
  const RefusedCalls refused(SystemCall::kGetrandom, ENOSYS);
  const absl::Status status = socket.tokens()->Register(1).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(status.message(), HasSubstr("no random bytes: Function not implemented"));
  EXPECT_EQ(refused.made(), 1) << "it is not requested again";
}

TEST_F(NoRandomBytesTest, WhoIsInterruptedAsksAgain) {
  LocalSocket& socket = Start();
  const RefusedCalls refused(SystemCall::kGetrandom, EINTR, 2);
  const auto registered = socket.tokens()->Register(1);
  ASSERT_TRUE(registered.ok()) << registered.status();
  EXPECT_EQ(refused.made(), 3);
  EXPECT_NE(registered->token, std::string(Tokens::kBytes, '\0'));
  EXPECT_EQ(socket.tokens()->Find(registered->token).session, 1u);
}

}  // namespace
}  // namespace voxeld::daemon::local
