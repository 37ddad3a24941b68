#include "tools/bench/plain_link.h"

#include <libusb-1.0/libusb.h>

#include <array>
#include <chrono>
#include <cstring>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "display/crc/crc32c.h"
#include "display/drivers/voxlink/packet.h"
#include "display/drivers/voxlink/protocol.h"

namespace voxeld::bench {
namespace {

using display::voxlink::EventHeader;
using display::voxlink::EventType;
using display::voxlink::PacketHeader;
using display::voxlink::Request;
using std::chrono::steady_clock;

constexpr size_t kTransferBytes = size_t{256} << 10;
constexpr size_t kTransfers = 8;
constexpr size_t kEventReads = 8;
constexpr unsigned kTimeoutMs = 5000;
constexpr uint16_t kVendor = 0x1209, kProduct = 0x0001;

absl::Status Failed(const std::string& what, int result) {
  return absl::InternalError(absl::StrCat(what, ": ", libusb_error_name(result)));
}

// One whole volume as packets, and the positions of their headers. The volume number and the
// sequence are set for each volume that is sent.
class Packets {
 public:
  explicit Packets(const display::FrameLayout& layout) {
    std::mt19937_64 random(1);
    std::vector<std::byte> picture(layout.bytes_per_slice());
    display::voxlink::PacketWriter writer;
    bytes_.reserve(layout.bytes() + layout.bytes() / 100 + 4096);
    Note([&] { writer.Begin(bytes_, 1, 0, static_cast<uint32_t>(layout.pictures()), {}); });
    for (size_t p = 0; p < layout.pictures(); ++p) {
      for (std::byte& byte : picture) byte = static_cast<std::byte>(random());
      const auto sub = static_cast<size_t>(layout.sub_frames);
      for (size_t offset = 0; offset < picture.size(); offset += kFragment) {
        const size_t length = std::min(kFragment, picture.size() - offset);
        Note([&] {
          writer.Slice(bytes_, 1, static_cast<uint32_t>(p / sub), static_cast<uint16_t>(p % sub),
                       static_cast<uint32_t>(offset), std::span(picture).subspan(offset, length));
        });
      }
    }
    Note([&] { writer.End(bytes_, 1, true); });
  }

  const std::vector<std::byte>& bytes() const { return bytes_; }

  // Sets the headers of volume `number` that begin in [from, to), and numbers them from `sequence`
  // on.
  void Number(uint64_t number, uint32_t& sequence, size_t from, size_t to) {
    if (from == 0) next_ = 0;
    for (; next_ < headers_.size() && headers_[next_] < to; ++next_) {
      std::byte* const at = bytes_.data() + headers_[next_];
      PacketHeader header;
      std::memcpy(&header, at, sizeof(header));
      header.volume = number;
      header.sequence = sequence++;
      std::memcpy(at, &header, sizeof(header));
      const uint32_t crc = display::Crc32c(std::span(at, display::voxlink::kHeaderCrcOffset));
      std::memcpy(at + display::voxlink::kHeaderCrcOffset, &crc, sizeof(crc));
    }
  }

 private:
  static constexpr size_t kFragment = 65536;

  template <typename Write>
  void Note(Write write) {
    headers_.push_back(bytes_.size());
    write();
  }

  std::vector<std::byte> bytes_;
  std::vector<size_t> headers_;
  size_t next_ = 0;
};

class PlainLink {
 public:
  explicit PlainLink(const display::FrameLayout& layout) : layout_(layout) {
    // Two volumes, because a transfer's headers are written while the previous volume is still
    // being sent.
    for (size_t i = 0; i < 2; ++i) volumes_.push_back(std::make_unique<Packets>(layout));
  }
  ~PlainLink() {
    for (libusb_transfer* transfer : transfers_) libusb_free_transfer(transfer);
    if (handle_ != nullptr) libusb_close(handle_);
    if (context_ != nullptr) libusb_exit(context_);
  }
  PlainLink(const PlainLink&) = delete;
  PlainLink& operator=(const PlainLink&) = delete;

  absl::StatusOr<PlainResult> Run(double seconds) {
    if (absl::Status status = Begin(); !status.ok()) return status;
    const auto start = steady_clock::now();
    const auto end = start + std::chrono::nanoseconds(static_cast<int64_t>(seconds * 1e9));
    // A volume that has begun is sent completely.
    const auto more = [&] { return offset_ > 0 || !Over(end); };
    while (error_.empty() && (shown_ < sent_ || more())) {
      while (error_.empty() && !idle_.empty() && more()) SendNext();
      Handle();
    }
    const std::chrono::duration<double> took = steady_clock::now() - start;
    Finish();
    if (!error_.empty()) return absl::InternalError(error_);
    return PlainResult{shown_, shown_ * volumes_[0]->bytes().size(), took.count()};
  }

 private:
  static bool Over(steady_clock::time_point end) { return steady_clock::now() >= end; }

  absl::Status Ask(Request request, std::span<const std::byte> data) {
    std::vector<unsigned char> bytes(data.size());
    if (!data.empty()) std::memcpy(bytes.data(), data.data(), data.size());
    const int result = libusb_control_transfer(handle_, display::voxlink::kRequestOut,
                                               static_cast<uint8_t>(request), 0, 0, bytes.data(),
                                               static_cast<uint16_t>(bytes.size()), kTimeoutMs);
    return result < 0 ? Failed(absl::StrCat("request ", static_cast<int>(request)), result)
                      : absl::OkStatus();
  }

  absl::Status Begin() {
    if (const int result = libusb_init(&context_); result != 0) return Failed("libusb", result);
    handle_ = libusb_open_device_with_vid_pid(context_, kVendor, kProduct);
    if (handle_ == nullptr) return absl::NotFoundError("no voxlink device is attached");
    if (const int result = libusb_claim_interface(handle_, 0); result != 0) {
      return Failed("the interface cannot be claimed", result);
    }
    if (absl::Status status = Ask(Request::kStop, {}); !status.ok()) return status;
    display::voxlink::Mode mode{};
    mode.format = static_cast<uint8_t>(layout_.format);
    mode.sub_frames = static_cast<uint8_t>(layout_.sub_frames);
    if (absl::Status status = Ask(Request::kSetMode, std::as_bytes(std::span(&mode, 1)));
        !status.ok()) {
      return status;
    }
    for (std::array<unsigned char, display::voxlink::kEventSize>& event : events_) {
      libusb_transfer* const transfer = Make();
      libusb_fill_interrupt_transfer(transfer, handle_, display::voxlink::kInterruptIn,
                                     event.data(), static_cast<int>(event.size()), &OnEvent, this,
                                     0);
      Submit(transfer);
    }
    for (size_t i = 0; i < kTransfers; ++i) idle_.push_back(Make());
    if (absl::Status status = Ask(Request::kStart, {}); !status.ok()) return status;
    while (!ready_ && error_.empty()) Handle();
    return error_.empty() ? absl::OkStatus() : absl::InternalError(error_);
  }

  libusb_transfer* Make() {
    transfers_.push_back(libusb_alloc_transfer(0));
    return transfers_.back();
  }

  void Submit(libusb_transfer* transfer) {
    if (const int result = libusb_submit_transfer(transfer); result != 0) {
      error_ = absl::StrCat("submitting: ", libusb_error_name(result));
      return;
    }
    ++in_flight_;
  }

  void SendNext() {
    Packets& packets = *volumes_[sent_ % volumes_.size()];
    const size_t end = std::min(offset_ + kTransferBytes, packets.bytes().size());
    packets.Number(sent_ + 1, sequence_, offset_, end);
    libusb_transfer* const transfer = idle_.back();
    idle_.pop_back();
    auto* const bytes = const_cast<std::byte*>(packets.bytes().data());
    libusb_fill_bulk_transfer(transfer, handle_, display::voxlink::kBulkOut,
                              reinterpret_cast<unsigned char*>(bytes + offset_),
                              static_cast<int>(end - offset_), &OnSent, this, kTimeoutMs);
    Submit(transfer);
    offset_ = end;
    if (offset_ < packets.bytes().size()) return;
    offset_ = 0;
    ++sent_;
  }

  void Handle() {
    if (const int result = libusb_handle_events(context_); result != 0) {
      error_ = absl::StrCat("events: ", libusb_error_name(result));
    }
  }

  static void OnSent(libusb_transfer* transfer) {
    auto& self = *static_cast<PlainLink*>(transfer->user_data);
    --self.in_flight_;
    self.idle_.push_back(transfer);
    if (self.ending_) return;
    if (transfer->status != LIBUSB_TRANSFER_COMPLETED ||
        transfer->actual_length != transfer->length) {
      self.error_ = absl::StrCat("a transfer ended with status ", transfer->status);
    }
  }

  static void OnEvent(libusb_transfer* transfer) {
    auto& self = *static_cast<PlainLink*>(transfer->user_data);
    --self.in_flight_;
    if (self.ending_) return;
    EventHeader header{};
    if (transfer->status == LIBUSB_TRANSFER_COMPLETED &&
        transfer->actual_length >= static_cast<int>(sizeof(header))) {
      std::memcpy(&header, transfer->buffer, sizeof(header));
    }
    if (header.type == 0) {
      self.error_ = absl::StrCat("an event ended with status ", transfer->status);
      return;
    }
    switch (static_cast<EventType>(header.type)) {
      case EventType::kReady:
        self.ready_ = true;
        break;
      case EventType::kShown:
        ++self.shown_;
        break;
      case EventType::kMissing:
      case EventType::kAborted:
      case EventType::kDropped:
      case EventType::kError:
        self.error_ = absl::StrCat("the device sent an event of type ", header.type, " in volume ",
                                   self.sent_ + 1, " at ", self.offset_, ": ",
                                   absl::BytesToHexString(absl::string_view(
                                       reinterpret_cast<const char*>(transfer->buffer),
                                       static_cast<size_t>(transfer->actual_length))));
        return;
      default:
        break;
    }
    self.Submit(transfer);
  }

  void Finish() {
    ending_ = true;
    for (libusb_transfer* transfer : transfers_) libusb_cancel_transfer(transfer);
    while (in_flight_ > 0) {
      if (libusb_handle_events(context_) != 0) return;
    }
    (void)Ask(Request::kStop, {});
  }

  const display::FrameLayout layout_;
  std::vector<std::unique_ptr<Packets>> volumes_;
  libusb_context* context_ = nullptr;
  libusb_device_handle* handle_ = nullptr;
  std::array<std::array<unsigned char, display::voxlink::kEventSize>, kEventReads> events_;
  std::vector<libusb_transfer*> transfers_, idle_;
  int in_flight_ = 0;
  bool ready_ = false, ending_ = false;
  uint64_t sent_ = 0, shown_ = 0;
  size_t offset_ = 0;  // in volume sent_ + 1
  uint32_t sequence_ = 0;
  std::string error_;
};

}  // namespace

absl::StatusOr<PlainResult> StreamPlainly(const display::FrameLayout& layout, double seconds) {
  return PlainLink(layout).Run(seconds);
}

}  // namespace voxeld::bench
