#include "tests/fuzz/exchanges/mutate.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>

namespace voxeld::fuzz {
namespace {

constexpr std::array<uint64_t, 12> kNumbers = {0,
                                               1,
                                               0x7F,
                                               0x80,
                                               0xFF,
                                               0x7FFF,
                                               0xFFFF,
                                               0x7FFFFFFF,
                                               0x80000000,
                                               0xFFFFFFFF,
                                               0x7FFFFFFFFFFFFFFF,
                                               0xFFFFFFFFFFFFFFFF};
constexpr size_t kMostInput = 256 << 10;

size_t Below(std::mt19937_64& random, size_t end) { return random() % end; }

// Returns some bytes of `from`.
Input Piece(const Input& from, std::mt19937_64& random) {
  if (from.empty()) return {};
  const size_t begin = Below(random, from.size());
  const size_t size = 1 + Below(random, std::min<size_t>(from.size() - begin, 64));
  const auto first = from.begin() + static_cast<ptrdiff_t>(begin);
  return {first, first + static_cast<ptrdiff_t>(size)};
}

void Damage(Input& input, const std::vector<Input>& corpus, std::mt19937_64& random) {
  if (input.empty()) return;
  const size_t at = Below(random, input.size());
  const auto place = input.begin() + static_cast<ptrdiff_t>(at);
  switch (Below(random, 8)) {
    case 0:
    case 1:
      *place ^= static_cast<uint8_t>(1 << Below(random, 8));
      break;
    case 2:
      *place = static_cast<uint8_t>(random());
      break;
    case 3: {
      const uint64_t number = kNumbers[Below(random, kNumbers.size())] + Below(random, 3) - 1;
      const size_t bytes = size_t{1} << Below(random, 4);
      for (size_t i = 0; i < bytes && at + i < input.size(); ++i) {
        input[at + i] = static_cast<uint8_t>(number >> 8 * i);
      }
      break;
    }
    case 4: {
      const size_t size = std::min(input.size() - at, 1 + Below(random, 32));
      input.erase(place, place + static_cast<ptrdiff_t>(size));
      break;
    }
    case 5: {
      const Input twice = Piece(input, random);
      input.insert(input.begin() + static_cast<ptrdiff_t>(at), twice.begin(), twice.end());
      break;
    }
    case 6: {
      const Input other = Piece(corpus[Below(random, corpus.size())], random);
      input.insert(input.begin() + static_cast<ptrdiff_t>(at), other.begin(), other.end());
      break;
    }
    default: {
      const Input other = Piece(corpus[Below(random, corpus.size())], random);
      std::copy_n(other.begin(), std::min(other.size(), input.size() - at), place);
      break;
    }
  }
}

}  // namespace

std::vector<Input> ReadCorpus(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<Input> corpus;
  for (const auto& path : files) {
    std::ifstream in(path, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return corpus;
}

Input Mutated(const std::vector<Input>& corpus, int pieces, std::mt19937_64& random) {
  Input all;
  for (size_t left = 1 + Below(random, static_cast<size_t>(pieces)); left > 0; --left) {
    Input input = corpus[Below(random, corpus.size())];
    // One in four stays unchanged; in the others, few changes are more frequent than many.
    if (Below(random, 4) != 0) {
      for (size_t times = size_t{1} << Below(random, 5); times > 0; --times) {
        Damage(input, corpus, random);
      }
    }
    if (all.size() + input.size() > kMostInput) break;
    all.insert(all.end(), input.begin(), input.end());
    // So that a truncated text does not include what follows it (tests/fuzz/script.h).
    if (left > 1) all.insert(all.end(), {'\\', 'a'});
  }
  return all;
}

Input AnyBytes(size_t size, std::mt19937_64& random) {
  Input bytes(size);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
  return bytes;
}

}  // namespace voxeld::fuzz
