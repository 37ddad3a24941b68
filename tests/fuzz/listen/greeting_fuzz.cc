// The beginning of a connection: however it is divided into pieces, the verdict is the same, and it
// always asks for more than it has.

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include "daemon/listen/greeting.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  using daemon::listen::Greeting;
  fuzz::Script script(data, size);
  const bool tls = script.Flag();
  const uint64_t most = script.Below(65536);
  const size_t step = 1 + script.Byte() % 64;
  const auto rest = script.Rest();
  const std::string received(rest.begin(), rest.end());
  const auto read = [&](Greeting& greeting, std::string_view bytes) {
    return tls ? greeting.ReadTls(bytes) : greeting.Read(bytes);
  };
  Greeting whole(most), pieces(most);
  const Greeting::Verdict verdict = read(whole, received);
  fuzz::CountExchange(fuzz::ExchangeKind::kGreeting, verdict != Greeting::Verdict::kWrong);
  Greeting::Verdict last = Greeting::Verdict::kMore;
  for (size_t at = 0; last == Greeting::Verdict::kMore; at += step) {
    const std::string_view some = std::string_view(received).substr(0, at);
    if (some.size() >= pieces.needed() || at == 0 || some.size() == received.size()) {
      last = read(pieces, some);
      if (last == Greeting::Verdict::kMore) {
        EXPECT_THAT_HOLDS(pieces.needed() > std::min(some.size(), Greeting::kMostBytes),
                          "it asks for ", pieces.needed(), " and has ", some.size());
      }
    }
    if (some.size() == received.size()) break;
  }
  EXPECT_THAT_HOLDS(last == verdict, static_cast<int>(last), " in pieces, ",
                    static_cast<int>(verdict), " at once: ", pieces.why(), "; ", whole.why());
  if (verdict == Greeting::Verdict::kWrong) {
    fuzz::ExpectSays(absl::InvalidArgumentError(whole.why()));
    EXPECT_THAT_HOLDS(!whole.why().empty());
  }
  EXPECT_THAT_HOLDS(received.size() < Greeting::kMostBytes || verdict != Greeting::Verdict::kMore);
  return 0;
}
