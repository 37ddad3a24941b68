// voxlink 1.0 as constants and wire structs. Each names its section of docs/protocols/voxlink.md,
// which explains it.
//
// Everything on the wire is little-endian; these structs are copied to and from it unchanged.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "display/usb/transfer_bytes.h"

namespace voxeld::display::voxlink {

static_assert(std::endian::native == std::endian::little, "the wire structs are little-endian");

// §3.1 Interface
inline constexpr uint8_t kInterfaceClass = 0xFF;
inline constexpr uint8_t kInterfaceSubclass = 0x56;
inline constexpr uint8_t kInterfaceProtocol = 0x01;
inline constexpr uint8_t kBulkOut = 0x01;
inline constexpr uint8_t kInterruptIn = 0x82;
inline constexpr size_t kEventSize = 64;  // the most that one interrupt transfer carries

// §3.2 Vendor request of the Microsoft OS 2.0 descriptors
inline constexpr uint8_t kMsVendorCode = 0x20;
inline constexpr uint16_t kMsDescriptorIndex = 7;

// §2 Versions: major in the high byte. The major version is checked; minor versions only add.
inline constexpr uint16_t kVersion = 0x0100;

// §4 Requests (bRequest; vendor, interface recipient)
enum class Request : uint8_t {
  kGetCapabilities = 0x01,  // IN, wValue = page
  kGetStatus = 0x02,        // IN, Status
  kSetMode = 0x03,          // OUT, Mode
  kGetMode = 0x04,          // IN, Mode
  kStart = 0x05,
  kStop = 0x06,
  kSetBrightness = 0x07,  // wValue: 0 to 65535
  kSetPowerLimit = 0x08,  // OUT, u32 milliwatts, 0 = none
  kSetBlank = 0x09,       // wValue: 0 or 1
};
inline constexpr uint8_t kRequestOut = 0x41;
inline constexpr uint8_t kRequestIn = 0xC1;
inline constexpr size_t kCapabilitiesPage = 4096;
inline constexpr size_t kMaxCapabilities = size_t{1} << 20;

// §4.1 Capabilities: this struct, then the shape (§4.2)
struct Capabilities {
  uint32_t total_length;  // of the whole block, including this
  uint16_t version;
  uint8_t formats;  // bit n: PixelFormat n
  uint8_t max_sub_frames;
  uint32_t features;
  uint32_t receive_buffer;  // bytes
  uint32_t max_payload;     // bytes of one packet's payload
  uint32_t slices, width, height;
  uint32_t volume_buffers;
  uint32_t min_rate_mhz, max_rate_mhz, nominal_rate_mhz;  // sweeps per 1,000 s
  uint32_t max_power_mw;
  uint16_t keepalive_ms, watchdog_ms;
  uint32_t reserved[2];
};
static_assert(sizeof(Capabilities) == 64);

enum Feature : uint32_t {
  kFeatureWatchdog = 1u << 0,
  kFeatureBrightness = 1u << 1,
  kFeaturePowerLimit = 1u << 2,
  kFeatureTemperature = 1u << 3,
  kFeatureShowAhead = 1u << 4,
};

// §4.2 Shapes
struct PlanarShape {
  uint8_t kind;  // 1
  uint8_t normal;
  uint8_t mirror;      // bit 0: u, bit 1: v
  uint8_t strokes;     // 1 or 2; 0: 1
  uint32_t positions;  // f64 each, follow
  double pitch_u_mm, pitch_v_mm, thickness_mm;
};
static_assert(sizeof(PlanarShape) == 32);

struct RotorShape {
  uint8_t kind;       // 2
  uint8_t clockwise;  // 0 or 1
  uint8_t panels;     // RotorPanel each, follow
  uint8_t reserved;
  uint32_t slices_per_turn;
};
static_assert(sizeof(RotorShape) == 8);

struct RotorPanel {
  double pitch_u_mm, pitch_v_mm, eccentricity_mm, shift_u_mm, shift_v_mm, phase_turns;
  uint8_t mirror;  // bit 0: u, bit 1: v
  uint8_t reserved[3];
  float tilt_deg;
};
static_assert(sizeof(RotorPanel) == 56);

struct HelixShape {
  uint8_t kind;    // 3
  uint8_t flags;   // bit 0: clockwise, bit 1: left-handed
  uint8_t mirror;  // bit 0: u, bit 1: v
  uint8_t blades;
  uint32_t slices_per_turn;
  double pitch_u_mm, pitch_v_mm, span_turns, height_mm, hub_mm, radius_mm, phase_turns;
};
static_assert(sizeof(HelixShape) == 64);

struct LatticeShape {
  uint8_t kind;  // 4
  uint8_t reserved[3];
  uint32_t lights;  // f64 × 3 each, x, y and z, follow; NaN: no light
  double cell_mm[3];
};
static_assert(sizeof(LatticeShape) == 32);

inline constexpr uint8_t kShapePlanar = 1;
inline constexpr uint8_t kShapeRotor = 2;
inline constexpr uint8_t kShapeHelix = 3;
inline constexpr uint8_t kShapeLattice = 4;

// §4.3 Mode
struct Mode {
  uint8_t format;
  uint8_t sub_frames;
  uint8_t bits;  // per channel; 0: the format's default
  uint8_t reserved0;
  uint32_t rate_mhz;  // 0: nominal
  uint32_t reserved1[2];
};
static_assert(sizeof(Mode) == 16);

// §4.4 Status
struct Status {
  uint8_t running;  // 0 idle, 1 in a session
  uint8_t flags;
  uint16_t reserved0;
  uint32_t event_sequence;  // expected of the next event
  uint64_t time_ns;
  uint64_t bytes_received;
  uint64_t credit_limit;
  uint64_t filling;        // 0: none
  uint64_t last_complete;  // what a BEGIN may name as its base; 0: none
  uint64_t shown;          // 0: none
  uint64_t shown_sweep;
  uint64_t shown_start_ns;
  uint32_t underruns;
  int16_t temperature;  // 0.1 °C; INT16_MIN: unknown
  uint16_t reserved1;
};
static_assert(sizeof(Status) == 80);

enum StatusFlag : uint8_t { kStatusBlanked = 1u << 0, kStatusWatchdogDark = 1u << 1 };

// §5.1 Packets
inline constexpr uint32_t kMagic = 0x4B4C5856;  // "VXLK"

enum class PacketType : uint8_t {
  kBegin = 1,
  kSlice = 2,
  kEnd = 3,
  kAbort = 4,
  kShow = 5,
  kDrop = 6,
  kKeepalive = 7,
};

struct PacketHeader {
  uint32_t magic;
  uint8_t type;
  uint8_t flags;
  uint16_t sub_frame;
  uint64_t volume;
  uint32_t sequence;
  uint32_t slice;
  uint32_t offset;
  uint32_t length;
  uint32_t payload_crc;
  uint32_t header_crc;  // of the 36 bytes before it
};
static_assert(sizeof(PacketHeader) == 40);
inline constexpr size_t kHeaderCrcOffset = 36;

inline constexpr uint8_t kEndShow = 1u << 0;  // flags of END: show the volume, else hold it

// §5.2 VOLUME_BEGIN: this struct, then one bit per slice image, lowest first (none with base 0)
struct BeginPayload {
  uint64_t base;
  uint32_t pictures;  // of the mode
  uint32_t reserved;
};
static_assert(sizeof(BeginPayload) == 16);

// §5.5 SHOW
struct ShowPayload {
  uint64_t sweep;  // 0: the next
};
inline constexpr uint8_t kShowAhead =
    1u << 0;  // flags: accepted only ahead of time, and answered; the payload is then:
struct ShowAheadPayload {
  uint64_t sweep;
  uint32_t ahead;  // sweep − the last one begun must be at least this, or nothing changes
  uint32_t reserved;
};
static_assert(sizeof(ShowAheadPayload) == 16);
static_assert(sizeof(ShowPayload) == 8);

// §6 Events
enum class EventType : uint8_t {
  kReady = 1,
  kCredit = 2,
  kSweep = 3,
  kComplete = 4,
  kMissing = 5,
  kAborted = 6,
  kShown = 7,
  kDropped = 8,
  kUnderrun = 9,
  kHealth = 10,
  kError = 11,
  kLight = 12,
  kOrdered = 13,
};

struct EventHeader {
  uint8_t type;
  uint8_t flags;
  uint16_t length;  // of the whole event
  uint32_t sequence;
  uint64_t time_ns;       // device's clock
  uint64_t credit_limit;  // §7: bytes that the host may have sent since START
};
static_assert(sizeof(EventHeader) == 24);

struct ReadyEvent {
  uint16_t version;
  uint16_t reserved;
  uint32_t receive_buffer;
};
static_assert(sizeof(ReadyEvent) == 8);

struct SweepEvent {
  uint64_t sweep;
  uint64_t start_ns;
  uint64_t shown;  // volume, 0: none
  uint32_t period_ns;
  uint32_t underruns;
};
static_assert(sizeof(SweepEvent) == 32);

struct CompleteEvent {
  uint64_t volume;
};
static_assert(sizeof(CompleteEvent) == 8);

struct PictureRun {
  uint32_t first;
  uint32_t count;
  bool operator==(const PictureRun&) const = default;
};
static_assert(sizeof(PictureRun) == 8);

inline constexpr size_t kRunsPerEvent = 3;
inline constexpr size_t kMostMissingEvents = 16;  // a longer list is shortened by joining runs
inline constexpr uint8_t kMissingLast = 1u << 0;  // flags: the list ends here

struct MissingEvent {
  uint64_t volume;
  uint32_t runs;  // 1 to 3
  uint32_t reserved;
  PictureRun run[kRunsPerEvent];
};
static_assert(sizeof(MissingEvent) == 40);

enum class Reason : uint32_t {
  kByHost = 1,         // ABORT, or DROP
  kSuperseded = 2,     // another BEGIN, or a later volume was complete before this one was shown
  kBadBase = 3,        // BEGIN named a base that the device does not have
  kUnknownVolume = 4,  // END, SHOW or DROP of a volume that the device does not know
  kMalformed = 5,      // BEGIN does not fit the mode
};

struct VolumeEvent {  // ABORTED, DROPPED
  uint64_t volume;
  uint32_t reason;
  uint32_t reserved;
};
static_assert(sizeof(VolumeEvent) == 16);

inline constexpr uint8_t kShownDark = 1u << 0;  // flags of SHOWN: blanked or dark at that time

struct ShownEvent {
  uint64_t volume;
  uint64_t sweep;
  uint64_t start_ns;
};
static_assert(sizeof(ShownEvent) == 24);

struct UnderrunEvent {
  uint64_t sweep;
  uint32_t total;
  uint32_t reserved;
};
static_assert(sizeof(UnderrunEvent) == 16);

struct HealthEvent {
  int16_t temperature;
  uint16_t reserved;
  uint32_t power_mw;
};
static_assert(sizeof(HealthEvent) == 8);

enum class ErrorCode : uint32_t {
  kNone = 0,
  kBadHeader = 1,    // bytes were skipped up to the next sound header
  kBadPayload = 2,   // CRC
  kSequence = 3,     // packets are missing
  kNotFilling = 4,   // SLICE of a volume that is not being filled
  kNotInBitmap = 5,  // SLICE of an image that BEGIN did not announce
  kBadPicture = 6,   // slice, sub-frame, offset or length outside the mode
  kBadOrder = 7,     // fragments out of order, or a volume number that does not ascend
  kBadLength = 8,    // payload of the wrong size for the packet's type
  kUnknownType = 9,
  kBadBegin = 10,
  kCreditExceeded = 11,
};

struct ErrorEvent {
  uint32_t code;
  uint32_t sequence;  // of the packet
  uint64_t volume;
  uint32_t picture;
  uint32_t detail;
};
static_assert(sizeof(ErrorEvent) == 24);

struct LightEvent {
  uint32_t lit;     // 0 or 1
  uint32_t reason;  // 1 host silent, 2 blanked, 3 host is back, 4 unblanked
};
static_assert(sizeof(LightEvent) == 8);

inline constexpr uint8_t kOrderTaken = 1u << 0;  // flags of ORDERED

struct OrderedEvent {
  uint64_t volume;
  uint64_t sweep;
};
static_assert(sizeof(OrderedEvent) == 16);

// §8 Times
inline constexpr int64_t kKeepaliveNs = 100'000'000;  // the longest silence of the host
inline constexpr int64_t kWatchdogNs = 250'000'000;   // after that the device goes dark
inline constexpr int kMaxResends = 4;                 // rounds of re-sent slices in one volume

// Reads a wire struct from bytes. Requires: `bytes` are long enough.
template <typename T>
T Load(std::span<const std::byte> bytes) {
  T value;
  std::memcpy(&value, bytes.data(), sizeof(T));
  return value;
}

void AppendBytes(std::vector<std::byte>& out, std::span<const std::byte> bytes);
void AppendBytes(TransferBytes& out, std::span<const std::byte> bytes);

template <typename Bytes, typename T>
void Append(Bytes& out, const T& value) {
  AppendBytes(out, std::as_bytes(std::span(&value, 1)));
}

template <typename T>
std::vector<std::byte> BytesOf(const T& value) {
  const auto bytes = std::as_bytes(std::span(&value, 1));
  return {bytes.begin(), bytes.end()};
}

const char* PacketTypeName(uint8_t type);
const char* ErrorCodeName(ErrorCode code);
const char* ReasonName(uint32_t reason);

}  // namespace voxeld::display::voxlink
