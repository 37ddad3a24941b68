// Tests a session's memories: which are accepted, which are found, and how much they count.
#include "daemon/local/local_memory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "tests/daemon/local/local_client.h"

namespace voxeld::daemon::local {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr uint64_t kMost = std::numeric_limits<uint64_t>::max();

struct HeldMemory {
  explicit HeldMemory(const LocalLimits& limits = {}, std::shared_ptr<Budget> budget = nullptr)
      : memory(limits, mapped, std::move(budget)) {}

  absl::Status Hold(uint64_t id, std::string_view bytes) {
    return memory.Hold(id, bytes.size(), MakeMemfd(bytes).get());
  }

  std::shared_ptr<std::atomic<uint32_t>> mapped = std::make_shared<std::atomic<uint32_t>>(0);
  LocalMemory memory;
};

TEST(LocalMemory, FindsWhatWasSealed) {
  HeldMemory held;
  std::string bytes(10'000, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 7 + i / 256);
  ASSERT_TRUE(held.Hold(7, bytes).ok());
  EXPECT_EQ(held.memory.memories(), 1u);
  EXPECT_EQ(held.memory.bytes(), 10'000u);
  for (const auto& [offset, size] : std::vector<std::pair<uint64_t, uint64_t>>{
           {0, 10'000}, {0, 0}, {4096, 4096}, {9'996, 4}, {10'000, 0}, {4'092, 8}}) {
    const auto found = held.memory.Find(7, offset, size);
    ASSERT_TRUE(found.ok()) << found.status();
    EXPECT_EQ(found->bytes, std::string_view(bytes).substr(offset, size)) << offset;
  }
}

TEST(LocalMemory, EveryMissingSealIsNamed) {
  struct Seal {
    int flag;
    const char* name;
  };
  const Seal seals[] = {{F_SEAL_SHRINK, "F_SEAL_SHRINK"},
                        {F_SEAL_GROW, "F_SEAL_GROW"},
                        {F_SEAL_WRITE, "F_SEAL_WRITE"}};
  for (int set = 0; set < 8; ++set) {
    int flags = 0;
    for (int i = 0; i < 3; ++i) flags |= (set >> i & 1) != 0 ? seals[i].flag : 0;
    HeldMemory held;
    const absl::Status status = held.memory.Hold(1, 4, MakeMemfd("four", flags).get());
    if (set == 7) {
      EXPECT_TRUE(status.ok()) << status;
      continue;
    }
    ASSERT_TRUE(absl::IsInvalidArgument(status)) << set << ": " << status;
    const std::string message(status.message());
    const std::string missing = message.substr(0, message.find(';'));
    for (int i = 0; i < 3; ++i) {
      if ((set >> i & 1) != 0) {
        EXPECT_THAT(missing, Not(HasSubstr(seals[i].name))) << set;
      } else {
        EXPECT_THAT(missing, HasSubstr(seals[i].name)) << set;
      }
    }
    EXPECT_EQ(held.memory.memories(), 0u);
    EXPECT_EQ(*held.mapped, 0u);
  }
  // Sealed only against later writes: an existing writable mapping can still write.
  HeldMemory held;
  const int future = F_SEAL_SHRINK | F_SEAL_GROW | 0x10;  // F_SEAL_FUTURE_WRITE
  const absl::Status status = held.memory.Hold(1, 4, MakeMemfd("four", future).get());
  EXPECT_THAT(std::string(status.message()), HasSubstr("not sealed with F_SEAL_WRITE;"));
}

TEST(LocalMemory, IsMemoryAndNothingElse) {
  HeldMemory held;
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const Descriptor in(ends[0]), out(ends[1]), null(open("/dev/null", O_RDWR)),
      program(open("/proc/self/exe", O_RDONLY)), folder(open("/", O_RDONLY | O_DIRECTORY)),
      path(open("/proc/self/exe", O_PATH)), plain(memfd_create("plain", 0));
  for (const int fd :
       {in.get(), out.get(), null.get(), program.get(), folder.get(), path.get(), -1}) {
    const absl::Status status = held.memory.Hold(1, 4, fd);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << fd << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("is no memfd"));
  }
  // Memory that cannot be sealed is recognised by the lack of all seals.
  EXPECT_THAT(std::string(held.memory.Hold(1, 4, plain.get()).message()),
              HasSubstr("not sealed with F_SEAL_SHRINK, F_SEAL_GROW, F_SEAL_WRITE;"));
}

TEST(LocalMemory, HasTheSizeThatIsSaid) {
  HeldMemory held;
  const Descriptor four = MakeMemfd("four"), none = MakeMemfd("");
  for (const uint64_t size : {uint64_t{3}, uint64_t{5}, uint64_t{4096}, kMost, kMost / 2 + 1}) {
    const absl::Status status = held.memory.Hold(9, size, four.get());
    ASSERT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("memory 9 is said to have " + std::to_string(size) + " bytes and has 4"));
  }
  EXPECT_THAT(std::string(held.memory.Hold(9, 0, four.get()).message()),
              HasSubstr("is said to have 0 bytes; give the memfd's own size, 4"));
  EXPECT_THAT(std::string(held.memory.Hold(9, 0, none.get()).message()), HasSubstr("at least 1"));
  EXPECT_TRUE(absl::IsInvalidArgument(held.memory.Hold(9, 1, none.get())));
  EXPECT_TRUE(held.memory.Hold(9, 4, four.get()).ok());
}

TEST(LocalMemory, RangesLieWithin) {
  HeldMemory held;
  ASSERT_TRUE(held.Hold(3, "0123456789ab").ok());
  for (const auto& [offset, size] :
       std::vector<std::pair<uint64_t, uint64_t>>{{0, 13},
                                                  {12, 1},
                                                  {13, 0},
                                                  {4, 9},
                                                  {kMost, 1},
                                                  {kMost, kMost},
                                                  {4, kMost},
                                                  {4, kMost - 3},
                                                  {kMost - 3, 8},
                                                  {uint64_t{1} << 63, uint64_t{1} << 63},
                                                  {0, kMost}}) {
    const auto found = held.memory.Find(3, offset, size);
    ASSERT_TRUE(absl::IsOutOfRange(found.status())) << offset << " " << size;
    EXPECT_THAT(std::string(found.status().message()), HasSubstr("memory 3 has 12 bytes"));
  }
  const auto unknown = held.memory.Find(4, 0, 4);
  EXPECT_TRUE(absl::IsNotFound(unknown.status()));
  EXPECT_THAT(std::string(unknown.status().message()), HasSubstr("is 4, which"));
}

TEST(LocalMemory, StaysWhileItIsInUse) {
  HeldMemory held;
  ASSERT_TRUE(held.Hold(1, "first bytes of all").ok());
  auto found = held.memory.Find(1, 0, 18);
  ASSERT_TRUE(found.ok());
  EXPECT_TRUE(held.memory.Release(1).ok());
  EXPECT_EQ(held.memory.bytes(), 0u);
  EXPECT_TRUE(absl::IsNotFound(held.memory.Find(1, 0, 4).status()));
  EXPECT_TRUE(absl::IsNotFound(held.memory.Release(1)));
  EXPECT_EQ(found->bytes, "first bytes of all");
  EXPECT_EQ(*held.mapped, 1u);
  // The id is free for other memory in the meantime.
  ASSERT_TRUE(held.Hold(1, "second").ok());
  EXPECT_EQ(held.memory.Find(1, 0, 6)->bytes, "second");
  EXPECT_EQ(found->bytes, "first bytes of all");
  held.memory.End();
  EXPECT_EQ(found->bytes, "first bytes of all");
  found = absl::CancelledError();
  EXPECT_EQ(*held.mapped, 0u);
}

TEST(LocalMemory, CountsAndBytesAreLimited) {
  HeldMemory held({.max_memories = 3, .max_bytes = 100});
  ASSERT_TRUE(held.Hold(1, std::string(60, 'a')).ok());
  EXPECT_TRUE(absl::IsAlreadyExists(held.Hold(1, "again")));
  absl::Status status = held.Hold(2, std::string(41, 'b'));
  EXPECT_TRUE(absl::IsResourceExhausted(status));
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("memory 2 has 41 bytes, and 60 are held; max_local_bytes allows 100"));
  EXPECT_TRUE(held.Hold(2, std::string(39, 'b')).ok());
  EXPECT_TRUE(held.Hold(3, "c").ok());
  EXPECT_EQ(held.memory.bytes(), 100u);
  EXPECT_TRUE(held.memory.Release(1).ok());
  EXPECT_TRUE(held.Hold(4, "d").ok());
  status = held.Hold(5, "e");
  EXPECT_TRUE(absl::IsResourceExhausted(status));
  EXPECT_THAT(std::string(status.message()), HasSubstr("max_local_memories allows 3"));
  held.memory.ReleaseAll();
  EXPECT_EQ(held.memory.bytes(), 0u);
  EXPECT_TRUE(held.Hold(5, std::string(100, 'e')).ok());
}

TEST(LocalMemory, AllSessionsTogetherAreLimited) {
  const LocalLimits limits{.max_memories_total = 3};
  const auto mapped = std::make_shared<std::atomic<uint32_t>>(0);
  LocalMemory one(limits, mapped, nullptr), other(limits, mapped, nullptr);
  const Descriptor fd = MakeMemfd("four");
  EXPECT_TRUE(one.Hold(1, 4, fd.get()).ok());
  EXPECT_TRUE(one.Hold(2, 4, fd.get()).ok());
  EXPECT_TRUE(other.Hold(1, 4, fd.get()).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(other.Hold(2, 4, fd.get())));
  one.End();
  EXPECT_TRUE(other.Hold(2, 4, fd.get()).ok());
}

TEST(LocalMemory, WhatIsMappedIsChargedToTheBudget) {
  constexpr Budget::Use kLocal = Budget::Use::kLocal;
  const auto budget = std::make_shared<Budget>(100);
  ASSERT_TRUE(budget->Charge(Budget::Use::kScene, 30));
  {
    HeldMemory one({}, budget), other({}, budget);
    ASSERT_TRUE(one.Hold(1, std::string(40, 'a')).ok());
    ASSERT_TRUE(other.Hold(1, std::string(20, 'b')).ok());
    EXPECT_EQ(budget->used_bytes(kLocal), 60u);
    const absl::Status status = other.Hold(2, std::string(11, 'c'));
    EXPECT_TRUE(absl::IsResourceExhausted(status));
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("memory 2 of 11 bytes would be held beside 90 of all clients; "
                          "max_memory_bytes allows 100"));
    EXPECT_EQ(budget->used_bytes(kLocal), 60u) << "a refused memory costs nothing";
    EXPECT_EQ(other.memory.memories(), 1u);
    EXPECT_TRUE(absl::IsAlreadyExists(other.Hold(1, "b")));
    EXPECT_TRUE(absl::IsInvalidArgument(other.memory.Hold(3, 4, MakeMemfd("four", 0).get())));
    EXPECT_EQ(budget->used_bytes(kLocal), 60u);

    auto found = one.memory.Find(1, 0, 4);
    ASSERT_TRUE(found.ok());
    ASSERT_TRUE(one.memory.Release(1).ok());
    EXPECT_EQ(budget->used_bytes(kLocal), 60u) << "it is still mapped";
    found = absl::CancelledError();
    EXPECT_EQ(budget->used_bytes(kLocal), 20u);
    EXPECT_TRUE(other.Hold(2, std::string(50, 'c')).ok());
    other.memory.ReleaseAll();
    EXPECT_EQ(budget->used_bytes(kLocal), 0u);
    ASSERT_TRUE(one.Hold(1, std::string(70, 'd')).ok());
    one.memory.End();
    EXPECT_EQ(budget->used_bytes(kLocal), 0u);
    ASSERT_TRUE(other.Hold(1, "e").ok());
  }
  EXPECT_EQ(budget->used_bytes(kLocal), 0u);
  EXPECT_EQ(budget->used_bytes(), 30u);
}

TEST(LocalMemory, WhatIsReleasedIsNotMappedAnyMore) {
  const auto mapped = [] {
    std::ifstream maps("/proc/self/maps");
    size_t found = 0;
    for (std::string line; std::getline(maps, line);) {
      if (line.find("memfd:voxeld-test") != std::string::npos) ++found;
    }
    return found;
  };
  HeldMemory held;
  ASSERT_EQ(mapped(), 0u);
  ASSERT_TRUE(held.Hold(1, "one").ok());
  EXPECT_EQ(mapped(), 1u);
  ASSERT_TRUE(held.memory.Release(1).ok());
  EXPECT_EQ(mapped(), 0u);
}

// More than a process has addresses for: a memfd may claim such a size without any memory.
TEST(LocalMemory, ThatCannotBeMappedCostsNothing) {
  constexpr uint64_t kHuge = uint64_t{1} << 60;
  const Descriptor fd(memfd_create("huge", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  ASSERT_EQ(ftruncate(fd.get(), static_cast<off_t>(kHuge)), 0);
  ASSERT_EQ(fcntl(fd.get(), F_ADD_SEALS, kAllSeals), 0);
  const auto budget = std::make_shared<Budget>(kMost);
  for (const auto& charged : {budget, std::shared_ptr<Budget>()}) {
    HeldMemory held({.max_bytes = kMost}, charged);
    const absl::Status status = held.memory.Hold(4, kHuge, fd.get());
    EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("memory 4 of 1152921504606846976 bytes cannot be mapped: "));
    EXPECT_EQ(held.memory.memories(), 0u);
    EXPECT_EQ(held.memory.bytes(), 0u);
    EXPECT_EQ(*held.mapped, 0u);
    EXPECT_EQ(budget->used_bytes(), 0u);
    EXPECT_TRUE(held.Hold(4, "four").ok());
  }
}

TEST(LocalMemory, TakesNothingOnceEnded) {
  HeldMemory held;
  ASSERT_TRUE(held.Hold(1, "x").ok());
  EXPECT_FALSE(held.memory.ended());
  held.memory.End();
  EXPECT_TRUE(held.memory.ended());
  EXPECT_EQ(held.memory.memories(), 0u);
  EXPECT_TRUE(absl::IsFailedPrecondition(held.Hold(2, "y")));
  EXPECT_TRUE(absl::IsNotFound(held.memory.Find(1, 0, 1).status()));
}

TEST(LocalMemory, IsReadWhileItComesAndGoes) {
  HeldMemory held;
  const std::string bytes[] = {std::string(20'000, 'a'), std::string(20'000, 'b')};
  const Descriptor fds[] = {MakeMemfd(bytes[0]), MakeMemfd(bytes[1])};
  std::atomic<bool> done = false;
  std::atomic<uint64_t> seen = 0;
  std::thread reader([&] {
    while (!done || seen == 0) {
      const auto found = held.memory.Find(1, 4096, 12'000);
      if (!found.ok()) continue;
      ++seen;
      const char first = found->bytes.front();
      EXPECT_TRUE(first == 'a' || first == 'b');
      EXPECT_EQ(found->bytes.find_first_not_of(first), std::string_view::npos);
    }
  });
  for (int i = 0; i < 2000 || seen == 0; ++i) {
    EXPECT_TRUE(held.memory.Hold(1, 20'000, fds[i % 2].get()).ok());
    EXPECT_TRUE(held.memory.Release(1).ok());
  }
  done = true;
  ASSERT_TRUE(held.memory.Hold(1, 20'000, fds[0].get()).ok());
  reader.join();
  held.memory.End();
  EXPECT_EQ(*held.mapped, 0u);
}

}  // namespace
}  // namespace voxeld::daemon::local
