// Open Pixel Control: a stream that is divided anywhere gives the same messages as the whole.

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/lights/tally.h"
#include "tests/fuzz/script.h"
#include "tools/lights/opc_reader.h"

namespace voxeld::fuzz {
namespace {

using Messages = std::vector<std::pair<uint16_t, std::vector<uint8_t>>>;

// A second implementation of the protocol's page: channel, command, length, data.
Messages Plainly(const std::vector<uint8_t>& stream, size_t* rest) {
  Messages messages;
  size_t at = 0;
  while (stream.size() - at >= 4) {
    const size_t length = size_t{stream[at + 2]} * 256 + stream[at + 3];
    if (stream.size() - at - 4 < length) break;
    const auto begin = stream.begin() + static_cast<ptrdiff_t>(at + 4);
    messages.emplace_back(stream[at] * 256 + stream[at + 1],
                          std::vector<uint8_t>(begin, begin + static_cast<ptrdiff_t>(length)));
    at += 4 + length;
  }
  *rest = stream.size() - at;
  return messages;
}

void Run(Script script) {
  lights::IntakeOptions options;
  options.lights = script.Below(300);
  options.a_channel = script.Byte() % 65;
  lights::Intake intake(options);
  lights::OpcReader reader;
  std::vector<uint8_t> stream;
  Messages messages;
  sync::TimeNs now = sync::kSecond;
  while (!script.done()) {
    const uint8_t what = script.Byte();
    if (what < 0x10) {
      now += script.Byte() * sync::kMillisecond;
      intake.Tick(now);
    } else if (what < 0x20) {
      TakePicture(intake, options.lights);
    } else {
      const std::string text = script.Text();
      const std::vector<uint8_t> bytes(text.begin(), text.end());
      stream.insert(stream.end(), bytes.begin(), bytes.end());
      reader.Add(bytes, [&](const lights::OpcReader::Message& message) {
        messages.emplace_back(message.channel * 256 + message.command,
                              std::vector<uint8_t>(message.data.begin(), message.data.end()));
        intake.AddMessage(message, now);
        CountExchange(ExchangeKind::kOpc, intake.malformed().ok());
      });
    }
    EXPECT_THAT_HOLDS(intake.tally().messages == messages.size());
    CheckTally(intake);
  }
  size_t rest = 0;
  EXPECT_THAT_HOLDS(messages == Plainly(stream, &rest), "cutting changes what a stream says");
  EXPECT_THAT_HOLDS(reader.amid() == (rest > 0));
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
