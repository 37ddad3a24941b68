#include "common/memory/out_of_memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <new>
#include <thread>
#include <vector>

namespace voxeld {
namespace {

// Set when the handler was already installed while this program's global objects were constructed.
const bool kInstalledAtStart = std::get_new_handler() != nullptr;

constexpr char kLine[] = "^common_memory_test: out of memory, exiting; .*max_memory_bytes\n$";

// Allocates until the limit of the address space is reached.
void AllocateAll() {
  ExitWhenOutOfMemory();
  const rlimit limit{size_t{1} << 30, size_t{1} << 30};
  if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(98);
  std::vector<char*> blocks;
  for (;;) blocks.push_back(new char[size_t{1} << 20]);
}

TEST(OutOfMemoryDeathTest, AFailedAllocationExitsWithStatus1AndOneLine) {
  EXPECT_EXIT(AllocateAll(), ::testing::ExitedWithCode(1), kLine);
}

TEST(OutOfMemoryDeathTest, AlsoWhereAnExceptionWouldBeCaught) {
  EXPECT_EXIT(
      {
        try {
          AllocateAll();
        } catch (const std::bad_alloc&) {
          _exit(99);
        }
      },
      ::testing::ExitedWithCode(1), kLine);
}

TEST(OutOfMemoryDeathTest, AlsoInAnotherThread) {
  EXPECT_EXIT(std::thread(AllocateAll).join(), ::testing::ExitedWithCode(1), kLine);
}

TEST(OutOfMemory, IsInstalledBeforeGlobalObjectsAreConstructed) { EXPECT_TRUE(kInstalledAtStart); }

}  // namespace
}  // namespace voxeld
