#include "display/emulator/carriers/byte_stream.h"

#include <algorithm>
#include <vector>

#include "gtest/gtest.h"
#include "tests/display/emulator/carriers/peer.h"

namespace voxeld::display::emulator {
namespace {

TEST(ByteStream, WhatDoesNotFitWaitsAndArrivesInOrder) {
  Peer peer;
  ByteStream stream(peer.TakeDeviceEnd());
  Bytes sent(32u << 20);
  for (size_t i = 0; i < sent.size(); ++i) sent[i] = static_cast<std::byte>(i * 2654435761u >> 24);
  for (size_t at = 0; at < sent.size(); at += 1u << 20) {
    stream.Send(std::span(sent).subspan(at, 1u << 20));
  }
  EXPECT_TRUE(stream.wants_to_send());
  EXPECT_GT(stream.waiting(), 0u);
  Bytes received;
  while (received.size() < sent.size()) {
    const Bytes some = peer.Take();
    ASSERT_FALSE(some.empty());
    received.insert(received.end(), some.begin(), some.end());
    stream.SendWaiting();
  }
  EXPECT_TRUE(received == sent);
  EXPECT_FALSE(stream.wants_to_send());
  EXPECT_EQ(stream.waiting(), 0u);
}

// With a peer that is always a little behind, sent bytes do not pile up.
TEST(ByteStream, KeepsWhatWaitsAndNoMore) {
  Peer peer;
  ByteStream stream(peer.TakeDeviceEnd());
  const Bytes chunk(64u << 10, std::byte{7});
  while (!stream.wants_to_send()) stream.Send(chunk);
  const size_t waiting = stream.waiting();
  size_t taken = 0;
  for (int round = 0; round < 2000; ++round) {
    stream.Send(chunk);
    const size_t before = stream.waiting();
    while (stream.waiting() + chunk.size() > before && stream.wants_to_send()) {
      taken += peer.Take().size();
      stream.SendWaiting();
    }
  }
  EXPECT_LE(stream.waiting(), waiting + chunk.size());
  EXPECT_GT(taken, 0u);
}

TEST(ByteStream, ReceivesWhatIsThereAndSeesTheEnd) {
  Peer peer;
  ByteStream stream(peer.TakeDeviceEnd());
  Bytes into(16);
  EXPECT_EQ(stream.Receive(into), 0u);
  EXPECT_TRUE(stream.open());
  peer.Send(Hex("01 02 03"));
  EXPECT_EQ(stream.Receive(into), 3u);
  EXPECT_EQ(into[2], std::byte{3});
  peer.Close();
  EXPECT_EQ(stream.Receive(into), 0u);
  EXPECT_FALSE(stream.open());
}

TEST(ByteStream, SendingToAPeerThatHasGoneIsNoSignal) {
  Peer peer;
  ByteStream stream(peer.TakeDeviceEnd());
  peer.Close();
  stream.Send(Hex("01"));
  EXPECT_FALSE(stream.open());
  stream.Send(Hex("02"));
  EXPECT_EQ(stream.waiting(), 0u);
}

TEST(ByteStream, ShutDownNothingGoesOut) {
  Peer peer;
  ByteStream stream(peer.TakeDeviceEnd());
  stream.Shutdown();
  EXPECT_FALSE(stream.open());
  stream.Send(Hex("01 02"));
  EXPECT_TRUE(peer.Take().empty());
}

}  // namespace
}  // namespace voxeld::display::emulator
