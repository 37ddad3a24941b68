// Tests assembling a volume from packets directly: what the decoder checks first is checked here as
// well.
#include "display/drivers/voxlink/assembler.h"

#include <cstring>
#include <memory>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace voxeld::display::voxlink {
namespace {

using Bytes = std::vector<std::byte>;

// Six pictures of 24 bytes.
constexpr FrameLayout kSixPictures{.slices = 3, .width = 4, .height = 2, .sub_frames = 2};

PacketHeader Header(uint64_t volume, uint32_t slice = 0, uint16_t sub_frame = 0,
                    uint32_t offset = 0) {
  PacketHeader header{};
  header.volume = volume;
  header.slice = slice;
  header.sub_frame = sub_frame;
  header.offset = offset;
  return header;
}

Bytes BeginOf(uint64_t base, uint32_t pictures, const Bytes& bitmap = {}) {
  const BeginPayload begin{.base = base, .pictures = pictures, .reserved = 0};
  Bytes out(sizeof(begin));
  std::memcpy(out.data(), &begin, sizeof(begin));
  out.insert(out.end(), bitmap.begin(), bitmap.end());
  return out;
}

VolumePtr Base(uint64_t number) {
  auto volume = std::make_shared<Volume>();
  volume->number = number;
  for (int p = 0; p < 6; ++p)
    volume->pictures.push_back(std::make_shared<const Bytes>(24, static_cast<std::byte>(p)));
  return volume;
}

std::vector<std::pair<uint32_t, uint32_t>> Missing(const VolumeAssembler& assembler) {
  std::vector<std::pair<uint32_t, uint32_t>> out;
  for (const PictureRun& run : assembler.Missing()) out.emplace_back(run.first, run.count);
  return out;
}

using Runs = std::vector<std::pair<uint32_t, uint32_t>>;

TEST(Assembler, BeginsWithWhatFits) {
  VolumeAssembler assembler(kSixPictures);
  const Bytes whole = BeginOf(0, 6);
  const auto refused = [&](ErrorCode code, const PacketHeader& header, const Bytes& payload,
                           VolumePtr base) {
    ASSERT_EQ(assembler.Begin(Header(1), whole, nullptr), ErrorCode::kNone);
    EXPECT_TRUE(assembler.filling());
    EXPECT_EQ(assembler.Begin(header, payload, std::move(base)), code);
    EXPECT_FALSE(assembler.filling()) << "the volume being filled is dropped";
  };
  refused(ErrorCode::kBadLength, Header(1), Bytes(whole.begin(), whole.end() - 1), nullptr);
  refused(ErrorCode::kBadBegin, Header(0), whole, nullptr);
  refused(ErrorCode::kBadBegin, Header(1), BeginOf(0, 5), nullptr);
  refused(ErrorCode::kBadBegin, Header(1), BeginOf(3, 6), nullptr);
  refused(ErrorCode::kBadBegin, Header(5), BeginOf(3, 6, Bytes(1)), Base(4));
  refused(ErrorCode::kBadLength, Header(1), BeginOf(0, 6, Bytes(1)), nullptr);
  refused(ErrorCode::kBadLength, Header(5), BeginOf(4, 6), Base(4));
  refused(ErrorCode::kBadLength, Header(5), BeginOf(4, 6, Bytes(2)), Base(4));
  refused(ErrorCode::kBadBegin, Header(5), BeginOf(4, 6, Bytes(1, std::byte{0x80})), Base(4));
  refused(ErrorCode::kBadBegin, Header(5), BeginOf(4, 6, Bytes(1, std::byte{0x40})), Base(4));
  EXPECT_EQ(assembler.Begin(Header(5), BeginOf(4, 6, Bytes(1, std::byte{0x3F})), Base(4)),
            ErrorCode::kNone);
  EXPECT_EQ(assembler.number(), 5u);
}

TEST(Assembler, TellsWhatIsMissingInRuns) {
  VolumeAssembler assembler(kSixPictures);
  EXPECT_EQ(Missing(assembler), Runs{});
  EXPECT_EQ(assembler.Finish(), nullptr) << "nothing is being filled";
  ASSERT_EQ(assembler.Begin(Header(7), BeginOf(0, 6), nullptr), ErrorCode::kNone);
  EXPECT_EQ(Missing(assembler), (Runs{{0, 6}}));
  const Bytes all(24), half(12);
  EXPECT_EQ(assembler.Slice(Header(7, 1, 0), all), ErrorCode::kNone);
  EXPECT_EQ(Missing(assembler), (Runs{{0, 2}, {3, 3}}));
  EXPECT_EQ(assembler.Slice(Header(7, 2, 1), half), ErrorCode::kNone);
  EXPECT_EQ(Missing(assembler), (Runs{{0, 2}, {3, 3}})) << "half of one does not count";
  EXPECT_EQ(assembler.Slice(Header(7, 2, 1, 12), half), ErrorCode::kNone);
  EXPECT_EQ(Missing(assembler), (Runs{{0, 2}, {3, 2}}));
  EXPECT_EQ(assembler.Finish(), nullptr);
  for (const auto& [slice, sub] : {std::pair{0u, 0u}, {0u, 1u}, {1u, 1u}, {2u, 0u}})
    EXPECT_EQ(assembler.Slice(Header(7, slice, static_cast<uint16_t>(sub)), all), ErrorCode::kNone);
  EXPECT_EQ(Missing(assembler), Runs{});
  const VolumePtr volume = assembler.Finish();
  ASSERT_NE(volume, nullptr);
  EXPECT_EQ(volume->number, 7u);
  EXPECT_EQ(volume->pictures.size(), 6u);
  assembler.Clear();
  EXPECT_FALSE(assembler.filling());
  EXPECT_EQ(assembler.Slice(Header(7), all), ErrorCode::kNotFilling);
}

TEST(Assembler, TakesTheOthersFromItsBase) {
  VolumeAssembler assembler(kSixPictures);
  const VolumePtr base = Base(4);
  ASSERT_EQ(assembler.Begin(Header(5), BeginOf(4, 6, Bytes(1, std::byte{0b000101})), base),
            ErrorCode::kNone);
  EXPECT_EQ(Missing(assembler), (Runs{{0, 1}, {2, 1}}))
      << "two runs, though nothing is wanted between them";
  EXPECT_EQ(assembler.Slice(Header(5, 0, 1), Bytes(24)), ErrorCode::kNotInBitmap);
  EXPECT_EQ(assembler.Slice(Header(5, 0, 0), Bytes(24, std::byte{9})), ErrorCode::kNone);
  EXPECT_EQ(assembler.Slice(Header(5, 1, 0), Bytes(24, std::byte{8})), ErrorCode::kNone);
  const VolumePtr volume = assembler.Finish();
  ASSERT_NE(volume, nullptr);
  EXPECT_EQ(volume->pictures[0]->front(), std::byte{9});
  EXPECT_EQ(volume->pictures[2]->front(), std::byte{8});
  for (const size_t kept : {1u, 3u, 4u, 5u})
    EXPECT_EQ(volume->pictures[kept], base->pictures[kept]);
}

TEST(Assembler, FragmentsStayInTheirPicture) {
  VolumeAssembler assembler(kSixPictures);
  ASSERT_EQ(assembler.Begin(Header(1), BeginOf(0, 6), nullptr), ErrorCode::kNone);
  EXPECT_EQ(assembler.Slice(Header(2), Bytes(24)), ErrorCode::kNotFilling) << "of another volume";
  EXPECT_EQ(assembler.Slice(Header(1, 3), Bytes(24)), ErrorCode::kBadPicture);
  EXPECT_EQ(assembler.Slice(Header(1, 0, 2), Bytes(24)), ErrorCode::kBadPicture);
  EXPECT_EQ(assembler.Slice(Header(1), {}), ErrorCode::kBadPicture);
  EXPECT_EQ(assembler.Slice(Header(1, 0, 0, 24), Bytes(1)), ErrorCode::kBadPicture) << "at its end";
  EXPECT_EQ(assembler.Slice(Header(1, 0, 0, 0xFFFFFFFF), Bytes(1)), ErrorCode::kBadPicture);
  EXPECT_EQ(assembler.Slice(Header(1), Bytes(25)), ErrorCode::kBadPicture);
  EXPECT_EQ(assembler.Slice(Header(1, 0, 0, 12), Bytes(12)), ErrorCode::kBadOrder)
      << "nothing before it";
  EXPECT_EQ(assembler.Slice(Header(1), Bytes(10)), ErrorCode::kNone);
  EXPECT_EQ(assembler.Slice(Header(1, 0, 0, 12), Bytes(12)), ErrorCode::kBadOrder)
      << "two bytes between";
  EXPECT_EQ(assembler.Slice(Header(1, 0, 0, 10), Bytes(14)), ErrorCode::kBadOrder)
      << "it has to begin again";
  EXPECT_EQ(assembler.Slice(Header(1), Bytes(10)), ErrorCode::kNone);
  EXPECT_EQ(assembler.Slice(Header(1, 0, 0, 10), Bytes(14)), ErrorCode::kNone);
  EXPECT_EQ(Missing(assembler), (Runs{{1, 5}}));
}

}  // namespace
}  // namespace voxeld::display::voxlink
