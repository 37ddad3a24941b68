// Blocks of one size in large pages: small pages cost tiles that are written and read in turns a look-up of the page each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "gpu/assemble/buffer.h"

namespace voxeld::gpu {

// Thread-bound but for Take.
class BlockPool {
 public:
  // Gives all back to the system. Blocks are of `block_bytes`, a multiple of 64, and `most` at once.
  void Reset(size_t block_bytes, size_t most);
  // From now on `count` blocks may be taken before the next call. Throws std::bad_alloc.
  void Provide(size_t count);
  // Several threads may take at once. At a cache line, with anything in it.
  void* Take();
  // Between Takes, before anything is given: what was taken is free no more.
  void Settle() { free_.resize(left_); }
  void Give(void* block) {
    free_.push_back(static_cast<std::byte*>(block));
    left_ = free_.size();
  }
  // Between Takes: what lies in pages without blocks in use goes back to the system, if more than `keep` are free.
  void Trim(size_t keep);
  // Returns: bytes of all its pages, with and without blocks in use.
  uint64_t memory_bytes() const { return slabs_.size() * slab_blocks_ * block_bytes_; }

 private:
  struct Slab {
    PageMemory memory;
    size_t free;  // counted by Trim
  };
  Slab& SlabOf(const std::byte* block);

  size_t block_bytes_ = 0, slab_blocks_ = 0;
  std::vector<Slab> slabs_;  // by address
  std::vector<std::byte*> free_;
  size_t left_ = 0;  // the first of them, while some are taken; reached by atomic_ref then
};

}  // namespace voxeld::gpu
