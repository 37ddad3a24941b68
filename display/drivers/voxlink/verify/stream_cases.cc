// §5.1: the stream of packets, split anywhere, and damaged.
#include <algorithm>

#include "display/crc/crc32c.h"
#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Probe;

// Returns the bytes of a packet written by `write`, to be damaged.
std::vector<std::byte> PacketOf(
    Session& session, const std::function<void(PacketWriter&, std::vector<std::byte>&)>& write) {
  std::vector<std::byte> bytes;
  write(session.writer(), bytes);
  return bytes;
}

// Changes the header, and corrects its CRC.
void Change(std::vector<std::byte>& packet, const std::function<void(PacketHeader&)>& change) {
  auto header = Load<PacketHeader>(packet);
  change(header);
  header.header_crc = Crc32c(std::as_bytes(std::span(&header, 1)).first(kHeaderCrcOffset));
  const auto bytes = std::as_bytes(std::span(&header, 1));
  std::copy(bytes.begin(), bytes.end(), packet.begin());
}

void CheckReceived(Session& session) {
  session.SetKeepalive(false);
  session.Settle();
  const Status status = session.GetStatus();
  if (session.ok()) {
    session.check().Equal("bytes_received", session.sent(), status.bytes_received);
  }
}

void SingleBytes(Probe& probe) {
  Session session(probe);
  session.Start();
  session.SetSplit([] { return size_t{1}; });
  for (int i = 0; i < 3; ++i) session.Plain(PacketType::kKeepalive, 0);
  session.Begin(1);
  session.Plain(PacketType::kAbort, 1);
  session.ExpectAborted(1, Reason::kByHost);
  session.ExpectNoErrors();
  CheckReceived(session);
}

void OddSizes(Probe& probe) {
  Session session(probe);
  session.Start();
  static constexpr uint32_t kSizes[] = {1, 3, 39, 40, 41, 63, 64, 65, 511, 512, 513, 1023, 1025};
  // Short transfers where the packets begin, longer ones through the pixels.
  const auto most =
      static_cast<uint32_t>(std::clamp<size_t>(session.layout().bytes() / 16, 64, 30'000));
  session.SetSplit([&]() -> size_t {
    const uint32_t choice = probe.Random(32);
    return choice < std::size(kSizes) ? kSizes[choice] : 1 + probe.Random(most);
  });
  session.Whole(1);
  session.ExpectComplete(1);
  session.ExpectShown(1);
  session.ExpectNoErrors();
  CheckReceived(session);
}

// Sends transfers of whole USB packets, with and without an empty packet after them, and empty
// transfers.
void ZeroLengthPackets(Probe& probe) {
  Session session(probe);
  session.Start();
  session.SetZeroPackets(true);
  session.SetSplit([] { return size_t{1024}; });
  for (int i = 0; i < 128; ++i) session.Plain(PacketType::kKeepalive, 0);
  session.Flush();
  session.SetZeroPackets(false);
  bool empty = false;
  session.SetSplit([&] { return (empty = !empty) ? size_t{0} : size_t{512}; });
  for (int i = 0; i < 64; ++i) session.Plain(PacketType::kKeepalive, 0);
  session.Flush();
  session.SetSplit(nullptr);
  session.ExpectNoErrors();
  CheckReceived(session);
}

void Noise(Probe& probe) {
  Session session(probe);
  session.Start();
  size_t all = 0;
  for (const size_t size : {size_t{1}, size_t{39}, size_t{40}, size_t{41}, size_t{1000}}) {
    session.Mark();
    std::vector<std::byte> noise(size);
    // Never contains the magic's last byte, so no header is found in it.
    for (std::byte& byte : noise) byte = static_cast<std::byte>(0x4C + probe.Random(170));
    all += size;
    session.Raw(noise);
    session.RoundTrip();
    session.Settle();
    size_t skipped = 0;
    for (const Event& event : session.log()) {
      if (event.type() == EventType::kError && event.As<ErrorEvent>().code == 1) {
        skipped += event.As<ErrorEvent>().detail;
      }
    }
    if (session.ok()) probe.check().Equal("bytes told as skipped, by ERROR 1:", all, skipped);
  }
  CheckReceived(session);
}

void BadHeaderCrc(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Begin(1);
  session.Settle();
  session.Mark();
  std::vector<std::byte> packet = PacketOf(
      session, [](PacketWriter& writer, auto& out) { writer.Plain(out, PacketType::kAbort, 1); });
  packet[16] ^= std::byte{0x01};
  session.Raw(packet);
  const ErrorEvent error = session.ExpectError(ErrorCode::kBadHeader);
  if (session.ok()) probe.check().Equal("bytes told as skipped", 40u, error.detail);
  // It was not treated as an ABORT; the packets after it are accepted.
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("filling", uint64_t{1}, status.filling);
  session.RoundTrip();
}

void TooLong(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Mark();
  std::vector<std::byte> packet = PacketOf(session, [](PacketWriter& writer, auto& out) {
    writer.Plain(out, PacketType::kKeepalive, 0);
  });
  const uint32_t most = session.capabilities().fixed.max_payload;
  Change(packet, [&](PacketHeader& header) { header.length = most + 1; });
  session.Raw(packet);
  session.RoundTrip();
  session.ExpectError(ErrorCode::kBadHeader);
}

void BadPayloadCrc(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Begin(1);
  const uint32_t last = session.pictures() - 1;
  for (uint32_t picture = 0; session.ok() && picture < last; ++picture) {
    session.Picture(1, picture);
  }
  const std::vector<std::byte> whole = session.PictureBytes(1, last);
  const size_t most = std::min<size_t>(whole.size(), session.capabilities().fixed.max_payload);
  std::vector<std::byte> packet = PacketOf(session, [&](PacketWriter& writer, auto& out) {
    const auto subs = static_cast<uint32_t>(session.layout().sub_frames);
    writer.Slice(out, 1, last / subs, static_cast<uint16_t>(last % subs), 0,
                 std::span(whole).first(most));
  });
  packet.back() ^= std::byte{0x80};
  session.Raw(packet);
  session.ExpectError(ErrorCode::kBadPayload);
  session.End(1);
  const std::vector<PictureRun> missing = session.ExpectMissing(1);
  if (session.ok()) {
    probe.check().Expect(missing == std::vector<PictureRun>{{last, 1}},
                         absl::StrCat("picture ", last, " is missing, and no other"),
                         absl::StrCat(missing.size(), " runs, the first from ", missing[0].first));
  }
  session.Picture(1, last);
  session.End(1);
  session.ExpectComplete(1);
  session.ExpectShown(1);
}

void SequenceGap(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Mark();
  for (int i = 0; i < 3; ++i) {
    PacketOf(session,
             [](PacketWriter& writer, auto& out) { writer.Plain(out, PacketType::kKeepalive, 0); });
  }
  session.RoundTrip();  // the packet itself is accepted
  const ErrorEvent error = session.ExpectError(ErrorCode::kSequence);
  if (session.ok()) probe.check().Equal("packets told as missing", 3u, error.detail);
  session.Mark();
  session.ExpectNoErrors();
}

void UnknownType(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Mark();
  std::vector<std::byte> packet = PacketOf(session, [](PacketWriter& writer, auto& out) {
    const std::vector<std::byte> pixels(100, std::byte{1});
    writer.Slice(out, 1, 0, 0, 0, pixels);
  });
  Change(packet, [](PacketHeader& header) { header.type = 0xEE; });
  session.Raw(packet);
  session.ExpectError(ErrorCode::kUnknownType);
  session.Mark();
  session.ExpectNoErrors();
}

void WrongPayloadLength(Probe& probe) {
  Session session(probe);
  session.Start();
  for (const PacketType type : {PacketType::kEnd, PacketType::kKeepalive, PacketType::kShow}) {
    session.Mark();
    std::vector<std::byte> packet = PacketOf(session, [](PacketWriter& writer, auto& out) {
      const std::vector<std::byte> pixels(5, std::byte{1});
      writer.Slice(out, 1, 0, 0, 0, pixels);
    });
    Change(packet, [&](PacketHeader& header) { header.type = static_cast<uint8_t>(type); });
    session.Raw(packet);
    session.ExpectError(ErrorCode::kBadLength);
  }
  session.RoundTrip();
}

}  // namespace

void AddStreamCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, auto run) {
    cases.push_back({id, title, "5.1", run});
  };
  add("stream.single_bytes", "transfers of one byte", &SingleBytes);
  add("stream.odd_sizes", "packets cut anywhere by transfers", &OddSizes);
  add("stream.zero_length", "empty packets and empty transfers mean nothing", &ZeroLengthPackets);
  add("damage.noise", "noise is skipped and its bytes told", &Noise);
  add("damage.header_crc", "a header with a wrong CRC is skipped", &BadHeaderCrc);
  add("damage.length", "a header with too long a payload is skipped", &TooLong);
  add("damage.payload_crc", "a wrong payload CRC: told, missing, sent again", &BadPayloadCrc);
  add("damage.sequence", "missing packets are told, the one after is taken", &SequenceGap);
  add("packets.unknown_type", "a packet of unknown type is told and passed over", &UnknownType);
  add("packets.payload_length", "a payload of the wrong length is told", &WrongPayloadLength);
}

}  // namespace voxeld::display::voxlink
