#include "gpu/assemble/buffer.h"

#include <sys/mman.h>

#include <cstdlib>
#include <new>

namespace voxeld::gpu {
namespace {

constexpr size_t kLine = 64, kLargePage = size_t{2} << 20;

}  // namespace

void PageFree::operator()(void* memory) const { std::free(memory); }

PageMemory AllocatePages(size_t bytes) {
  const size_t align = bytes >= kLargePage ? kLargePage : kLine;
  bytes = (bytes + align - 1) / align * align;
  PageMemory memory(std::aligned_alloc(align, bytes));
  if (memory == nullptr) throw std::bad_alloc();
  // What it asks for makes no difference but to time, so neither does a refusal.
  if (align == kLargePage) (void)madvise(memory.get(), bytes, MADV_HUGEPAGE);
  return memory;
}

}  // namespace voxeld::gpu
