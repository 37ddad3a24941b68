// Makes inputs for targets from known ones (fuzz/corpus of the build, unpacked from
// tests/fuzz/corpus): combined and damaged according to a seed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

namespace voxeld::fuzz {

using Input = std::vector<uint8_t>;

// Returns every file of `folder`, by name; empty if the folder does not exist.
std::vector<Input> ReadCorpus(const std::filesystem::path& folder);

// Returns up to `pieces` inputs of `corpus` (not empty) one after another, most of them damaged:
// bits, bytes and numbers are changed, and parts are removed, doubled, or replaced by parts of
// another.
Input Mutated(const std::vector<Input>& corpus, int pieces, std::mt19937_64& random);

// Returns `size` random bytes.
Input AnyBytes(size_t size, std::mt19937_64& random);

}  // namespace voxeld::fuzz
