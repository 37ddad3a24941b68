#include "display/usb/libusb/descriptors.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

std::vector<std::byte> Bytes(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

// A device of one configuration: a HID interface 0 with an endpoint, and interface 3 of class
// FF:56:01 with two alternate settings.
std::vector<std::byte> Composite() {
  return Bytes({18, 1, 0,    2, 0, 0,    0,    64,   9,  0x12, 1, 0, 0, 1, 1, 2, 3, 1,  // device
                9,  2, 52,   0, 2, 1,    0,    0x80, 50,  // configuration
                9,  4, 0,    0, 1, 3,    1,    2,    0,   // interface 0
                7,  5, 0x81, 3, 8, 0,    10,              // its endpoint
                9,  4, 3,    0, 0, 0xFF, 0x56, 1,    0,   // interface 3
                9,  4, 3,    1, 1, 0xFF, 0x56, 1,    0,   // the same, alternate 1
                7,  5, 0x01, 2, 0, 2,    0});
}

// No bytes follow that could be read by mistake: ASan detects a read past the last one.
std::vector<UsbInterface> Find(const std::vector<std::byte>& bytes) {
  const std::unique_ptr<std::byte[]> exact(new std::byte[bytes.size()]);
  std::copy(bytes.begin(), bytes.end(), exact.get());
  return FindInterfaces(std::span(exact.get(), bytes.size()));
}

TEST(Descriptors, FindsEveryInterface) {
  const std::vector<UsbInterface> found = Find(Composite());
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0].number, 0);
  EXPECT_EQ(found[0].triple, (std::array<uint8_t, 3>{3, 1, 2}));
  EXPECT_EQ(found[1].number, 3);
  EXPECT_EQ(found[1].alternate, 0);
  EXPECT_EQ(found[1].triple, (std::array<uint8_t, 3>{0xFF, 0x56, 1}));
  EXPECT_EQ(found[2].alternate, 1);
}

TEST(Descriptors, ChoosesByTriple) {
  const std::vector<UsbInterface> found = Find(Composite());
  EXPECT_EQ(ChooseInterface(found, {{0xFF, 0x56, 1}}), 3);
  EXPECT_EQ(ChooseInterface(found, {{0xFF, 0x56, 2}}), std::nullopt);
  EXPECT_EQ(ChooseInterface(found, std::nullopt), 0);
  EXPECT_EQ(ChooseInterface({}, std::nullopt), std::nullopt);
}

TEST(Descriptors, EndWhereTheyMakeNoSense) {
  EXPECT_TRUE(Find({}).empty());
  EXPECT_TRUE(Find(Bytes({9})).empty());
  EXPECT_TRUE(Find(Bytes({9, 4, 0})).empty());                    // truncated
  EXPECT_TRUE(Find(Bytes({0, 4, 0, 0, 0, 0, 0, 0, 0})).empty());  // would never end
  EXPECT_TRUE(Find(Bytes({1, 4, 0, 0, 0, 0, 0, 0, 0})).empty());
  EXPECT_TRUE(Find(Bytes({8, 4, 0, 0, 0, 0, 0, 0})).empty());  // an interface too short
  // Interfaces before the error count.
  std::vector<std::byte> bytes = Composite();
  bytes[18 + 9 + 9] = std::byte{0};  // the endpoint's length
  EXPECT_EQ(Find(bytes).size(), 1u);
}

TEST(Descriptors, TenThousandMutations) {
  std::mt19937 random(7);
  size_t most = 0, unlike = 0;
  for (int i = 0; i < 10'000; ++i) {
    std::vector<std::byte> bytes = Composite();
    for (int changes = 1 + static_cast<int>(random() % 6); changes > 0; --changes) {
      switch (random() % 4) {
        case 0:
          bytes[random() % bytes.size()] = static_cast<std::byte>(random());
          break;
        case 1:
          bytes.resize(1 + random() % bytes.size());
          break;
        case 2:
          bytes.insert(bytes.begin() + static_cast<ptrdiff_t>(random() % bytes.size()),
                       static_cast<std::byte>(random()));
          break;
        default:
          bytes.insert(bytes.end(), bytes.begin(),
                       bytes.begin() + static_cast<ptrdiff_t>(random() % bytes.size()));
          break;
      }
    }
    const std::vector<UsbInterface> found = Find(bytes);
    // Each takes nine bytes of its own.
    ASSERT_LE(found.size() * 9, bytes.size());
    most = std::max(most, found.size());
    if (found.size() != 3) ++unlike;
  }
  EXPECT_GT(most, 3u);
  EXPECT_GT(unlike, 1000u);
}

}  // namespace
}  // namespace voxeld::display
