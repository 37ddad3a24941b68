#include "tools/lights/opc_reader.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace voxeld::lights {
namespace {

using Bytes = std::vector<uint8_t>;

Bytes Opc(uint8_t channel, uint8_t command, const Bytes& data) {
  Bytes out = {channel, command, static_cast<uint8_t>(data.size() >> 8),
               static_cast<uint8_t>(data.size())};
  out.insert(out.end(), data.begin(), data.end());
  return out;
}

struct Kept {
  uint8_t channel, command;
  Bytes data;
  bool operator==(const Kept&) const = default;
};

TEST(OpcReader, FindsTheMessagesHoweverTheBytesCome) {
  std::mt19937 random(11);
  for (int round = 0; round < 200; ++round) {
    Bytes stream;
    std::vector<Kept> sent, read;
    for (int i = 0; i < 30; ++i) {
      Kept message = {static_cast<uint8_t>(random()), static_cast<uint8_t>(random() % 2 * 255),
                      Bytes(random() % 3 == 0 ? 0 : random() % 700)};
      for (uint8_t& byte : message.data) byte = static_cast<uint8_t>(random());
      const Bytes bytes = Opc(message.channel, message.command, message.data);
      stream.insert(stream.end(), bytes.begin(), bytes.end());
      sent.push_back(std::move(message));
    }
    OpcReader reader;
    for (size_t at = 0; at < stream.size();) {
      const size_t count =
          std::min<size_t>(stream.size() - at, 1 + random() % (round % 2 ? 7 : 3000));
      reader.Add(std::span(stream).subspan(at, count), [&](const OpcReader::Message& message) {
        read.push_back(
            {message.channel, message.command, {message.data.begin(), message.data.end()}});
      });
      at += count;
    }
    EXPECT_EQ(read, sent);
    EXPECT_FALSE(reader.amid());
  }
}

TEST(OpcReader, KnowsThatAMessageIsNotWhole) {
  OpcReader reader;
  const Bytes message = Opc(0, 0, {1, 2, 3});
  const auto none = [](const OpcReader::Message&) { ADD_FAILURE(); };
  reader.Add(std::span(message).first(2), none);
  EXPECT_TRUE(reader.amid());
  reader.Add(std::span(message).subspan(2, 4), none);
  EXPECT_TRUE(reader.amid());
  int whole = 0;
  reader.Add(std::span(message).last(1), [&whole](const OpcReader::Message&) { ++whole; });
  EXPECT_EQ(whole, 1);
  EXPECT_FALSE(reader.amid());
}

}  // namespace
}  // namespace voxeld::lights
