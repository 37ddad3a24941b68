#include "common/memory/out_of_memory.h"

#include <errno.h>
#include <sys/uio.h>
#include <unistd.h>

#include <new>
#include <string_view>

namespace voxeld {
namespace {

// Allocates nothing and takes no locks.
[[noreturn]] void Exit() {
  constexpr std::string_view kReason =
      ": out of memory, exiting; give the process more (MemoryMax=, LimitAS=, ulimit -v) or lower "
      "max_memory_bytes\n";
  const std::string_view name = program_invocation_short_name;
  const iovec parts[] = {{const_cast<char*>(name.data()), name.size()},
                         {const_cast<char*>(kReason.data()), kReason.size()}};
  (void)!writev(STDERR_FILENO, parts, 2);  // at once, so that no other thread's line comes between
  _exit(1);
}

// The constructors of global objects and of generated messages allocate too. 101 is the first priority that programs may use.
[[gnu::constructor(101)]] void ExitFromTheStart() { ExitWhenOutOfMemory(); }

}  // namespace

void ExitWhenOutOfMemory() { std::set_new_handler(&Exit); }

}  // namespace voxeld
