#include "daemon/local/tokens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <algorithm>
#include <set>

namespace voxeld::daemon::local {
namespace {

bool Rung(const Doorbell& bell) {
  pollfd ready = {bell.descriptor(), POLLIN, 0};
  return poll(&ready, 1, 0) == 1;
}

TEST(Tokens, TellSessionsApart) {
  const auto bell = *Doorbell::Make();
  Tokens tokens({}, bell, nullptr);
  const auto one = tokens.Register(1), two = tokens.Register(2);
  ASSERT_TRUE(one.ok() && two.ok());
  EXPECT_EQ(one->token.size(), 16u);
  EXPECT_NE(one->token, two->token);
  EXPECT_EQ(tokens.Find(one->token).memory, one->memory);
  EXPECT_EQ(tokens.Find(one->token).session, 1u);
  EXPECT_EQ(tokens.Find(two->token).memory, two->memory);
  EXPECT_EQ(tokens.Find(two->token).session, 2u);
  EXPECT_FALSE(Rung(*bell));
  tokens.Unregister(one->token);
  EXPECT_TRUE(Rung(*bell));
  bell->Quiet();
  EXPECT_FALSE(Rung(*bell));
  EXPECT_TRUE(one->memory->ended());
  EXPECT_FALSE(two->memory->ended());
  EXPECT_EQ(tokens.Find(one->token).memory, nullptr);
  EXPECT_EQ(tokens.Find(two->token).session, 2u);
  tokens.Unregister(one->token);
  EXPECT_FALSE(Rung(*bell)) << "nothing ended";
}

TEST(Tokens, AStreamThatTakesASessionUpHasItsOwn) {
  Tokens tokens({}, *Doorbell::Make(), nullptr);
  const auto older = tokens.Register(1), newer = tokens.Register(1);
  ASSERT_TRUE(older.ok() && newer.ok());
  EXPECT_NE(older->token, newer->token);
  tokens.Unregister(older->token);
  EXPECT_TRUE(older->memory->ended());
  EXPECT_EQ(tokens.Find(older->token).memory, nullptr);
  EXPECT_FALSE(newer->memory->ended());
  EXPECT_EQ(tokens.Find(newer->token).memory, newer->memory);
  EXPECT_EQ(tokens.Find(newer->token).session, 1u);
}

TEST(Tokens, OnlyTheWholeTokenIsRight) {
  Tokens tokens({}, *Doorbell::Make(), nullptr);
  const std::string token = tokens.Register(1)->token;
  EXPECT_EQ(tokens.Find("").memory, nullptr);
  EXPECT_EQ(tokens.Find(std::string(16, '\0')).memory, nullptr);
  EXPECT_EQ(tokens.Find(token + '\0').memory, nullptr);
  EXPECT_EQ(tokens.Find(token + token).memory, nullptr);
  for (size_t size = 0; size < token.size(); ++size) {
    EXPECT_EQ(tokens.Find(token.substr(0, size)).memory, nullptr);
  }
  for (size_t bit = 0; bit < 128; ++bit) {
    std::string near = token;
    near[bit / 8] = static_cast<char>(near[bit / 8] ^ 1 << bit % 8);
    EXPECT_EQ(tokens.Find(near).memory, nullptr) << bit;
  }
  EXPECT_NE(tokens.Find(token).memory, nullptr);
}

TEST(Tokens, AreRandom) {
  Tokens tokens({}, *Doorbell::Make(), nullptr);
  std::set<std::string> seen;
  std::array<int, 128> ones = {};
  constexpr int kMany = 4000;
  for (SessionId session = 1; session <= kMany; ++session) {
    const std::string token = tokens.Register(session)->token;
    EXPECT_TRUE(seen.insert(token).second);
    for (size_t bit = 0; bit < 128; ++bit) ones[bit] += token[bit / 8] >> bit % 8 & 1;
  }
  // Each bit is set in half of them, by 8 standard deviations.
  for (const int count : ones) EXPECT_NEAR(count, kMany / 2, 253);
}

}  // namespace
}  // namespace voxeld::daemon::local
