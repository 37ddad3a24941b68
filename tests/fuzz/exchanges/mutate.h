// Inputs of targets from those that are known (fuzz/corpus of the build, unpacked from tests/fuzz/corpus): put together and damaged, as a seed says.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

namespace voxeld::fuzz {

using Input = std::vector<uint8_t>;

// Every file of `folder`, by name; empty where there is none.
std::vector<Input> ReadCorpus(const std::filesystem::path& folder);

// Up to `pieces` of `corpus` (not empty) one after another, most of them damaged: bits, bytes, numbers, what is left out, said
// twice, or said by another.
Input Mutated(const std::vector<Input>& corpus, int pieces, std::mt19937_64& random);

// `size` bytes of which each may be anything.
Input AnyBytes(size_t size, std::mt19937_64& random);

}  // namespace voxeld::fuzz
