#include "tests/fuzz/exchanges/sessions.h"

#include <algorithm>
#include <random>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "tests/fuzz/script.h"

// The targets, each compiled under its own name (CMakeLists.txt).
extern "C" {
int FuzzVoxlinkHost(const uint8_t* data, size_t size);
int FuzzVoxlinkCapabilities(const uint8_t* data, size_t size);
int FuzzVoxlinkDecoder(const uint8_t* data, size_t size);
int FuzzVoxlinkDevice(const uint8_t* data, size_t size);
int FuzzVoxlinkFirmware(const uint8_t* data, size_t size);
int FuzzStore(const uint8_t* data, size_t size);
int FuzzKeptRows(const uint8_t* data, size_t size);
int FuzzLocalPackets(const uint8_t* data, size_t size);
int FuzzLightDatagrams(const uint8_t* data, size_t size);
int FuzzNetworkPackets(const uint8_t* data, size_t size);
int FuzzOpcStream(const uint8_t* data, size_t size);
int FuzzViewerMessages(const uint8_t* data, size_t size);
int FuzzWebSocket(const uint8_t* data, size_t size);
int FuzzGreeting(const uint8_t* data, size_t size);
}

namespace voxeld::fuzz {
namespace {

// The steps of a script in one session, as a multiple of those for a fuzzer: setting up costs more
// than many messages.
constexpr int kStepsTimes = 64;

uint64_t Mix(uint64_t a, uint64_t b) {
  uint64_t x = a + 0x9E3779B97F4A7C15 * (b + 1);
  x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9;
  x = (x ^ x >> 27) * 0x94D049BB133111EB;
  return x ^ x >> 31;
}

}  // namespace

absl::StatusOr<Sessions> Sessions::Make(const std::string& side, uint64_t seed,
                                        const std::filesystem::path& corpora) {
  Sessions sessions;
  sessions.seed_ = seed;
  if (side == "device") {
    sessions.attacks_ = {
        {.target = "voxlink_host",
         .run = FuzzVoxlinkHost,
         .weight = 80,
         .pieces = 8,
         .any_bytes = 24'000},
        {.target = "voxlink_capabilities",
         .run = FuzzVoxlinkCapabilities,
         .weight = 400,
         .pieces = 1},
        {.target = "voxlink_decoder", .run = FuzzVoxlinkDecoder, .weight = 20, .pieces = 8},
    };
  } else if (side == "peer") {
    sessions.attacks_ = {
        {.target = "store", .run = FuzzStore, .weight = 40, .pieces = 8},
        {.target = "kept_rows", .run = FuzzKeptRows, .weight = 100, .pieces = 1},
        {.target = "local_packets", .run = FuzzLocalPackets, .weight = 20, .pieces = 8},
        {.target = "light_datagrams", .run = FuzzLightDatagrams, .weight = 100, .pieces = 8},
        {.target = "network_packets", .run = FuzzNetworkPackets, .weight = 100, .pieces = 8},
        {.target = "opc_stream", .run = FuzzOpcStream, .weight = 100, .pieces = 8},
        {.target = "viewer_messages", .run = FuzzViewerMessages, .weight = 2, .pieces = 64},
        {.target = "web_socket", .run = FuzzWebSocket, .weight = 20, .pieces = 2},
        {.target = "greeting", .run = FuzzGreeting, .weight = 200, .pieces = 1},
        {.target = "voxlink_device", .run = FuzzVoxlinkDevice, .weight = 50, .pieces = 8},
        {.target = "voxlink_firmware", .run = FuzzVoxlinkFirmware, .weight = 50, .pieces = 8},
    };
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat("the side is \"", side, "\"; it is device or peer"));
  }
  for (Attack& attack : sessions.attacks_) {
    attack.corpus = ReadCorpus(corpora / attack.target);
    if (attack.corpus.empty()) {
      return absl::NotFoundError(
          absl::StrCat("there are no seeds in ", (corpora / attack.target).string()));
    }
    sessions.weights_ += attack.weight;
  }
  return sessions;
}

Sessions::Chosen Sessions::Choose(uint64_t session) const {
  std::mt19937_64 random(Mix(seed_, session));
  uint64_t at = random() % weights_;
  const Attack* attack = attacks_.data();
  while (at >= attack->weight) at -= attack++->weight;
  if (attack->any_bytes > 0 && random() % 4 != 0) {
    return {attack, AnyBytes(1 + random() % attack->any_bytes, random)};
  }
  return {attack, Mutated(attack->corpus, attack->pieces, random)};
}

Sessions::Known Sessions::InputOf(uint64_t session) const {
  Chosen chosen = Choose(session);
  return {chosen.attack->target, std::move(chosen.input)};
}

void Sessions::Run(uint64_t session) const {
  const Chosen chosen = Choose(session);
  // It has exactly that size, so that reading beyond it is detected.
  const Input exact(chosen.input.begin(), chosen.input.end());
  steps_times = kStepsTimes;
  chosen.attack->run(exact.data(), exact.size());
}

}  // namespace voxeld::fuzz
