#include "display/usb/recording_transport.h"

#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "display/usb/usbmon.h"

namespace voxeld::display {
namespace {

constexpr uint8_t kDirectionIn = 0x80;
constexpr uint8_t kMostAddress = 127;
constexpr uint8_t kNotData = 'E';  // flag_data of a refused submission

std::string Described(const UsbIdentity& identity) {
  return absl::StrFormat("opened %04x:%04x, revision %04x, serial \"%s\", path \"%s\"",
                         identity.vendor_id, identity.product_id, identity.bcd_device,
                         absl::CHexEscape(identity.serial), absl::CHexEscape(identity.path));
}

}  // namespace

RecordingTransport::RecordingTransport(std::unique_ptr<UsbTransport> inner,
                                       std::unique_ptr<PacketRecorder> recorder, sync::Clock& clock,
                                       Options options)
    : inner_(std::move(inner)), recorder_(std::move(recorder)), clock_(clock), options_(options) {}

RecordingTransport::RecordingTransport(std::unique_ptr<UsbTransport> inner, MakeRecorder make,
                                       sync::Clock& clock, Options options)
    : inner_(std::move(inner)), make_recorder_(std::move(make)), clock_(clock), options_(options) {}

RecordingTransport::~RecordingTransport() {
  Close();
  if (recorder_ != nullptr) recorder_->Finish();
}

absl::Status RecordingTransport::Open() {
  absl::Status status = inner_->Open();
  if (!status.ok()) return status;
  if (recorder_ == nullptr) {
    absl::StatusOr<std::unique_ptr<PacketRecorder>> recorder = make_recorder_();
    if (!recorder.ok()) {
      inner_->Close();
      return recorder.status();
    }
    recorder_ = *std::move(recorder);
    make_recorder_ = nullptr;
  }
  address_ = address_ == kMostAddress ? 1 : address_ + 1;
  opened_ = Described(inner_->identity());
  return status;
}

void RecordingTransport::Close() {
  inner_->Close();
  for (const auto& [id, recorded] : in_flight_) {
    UsbPacket packet = PacketOf(recorded, UsbmonHeader::kComplete);
    if ((recorded.epnum & kDirectionIn) == 0) packet.header.flag_data = kUsbmonDataOut;
    packet.header.status = UsbmonStatus(TransferStatus::kCancelled);
    packet.comment = "closed before its end was known";
    recorder_->Add(packet);
  }
  in_flight_.clear();
}

UsbPacket RecordingTransport::PacketOf(const Recorded& recorded, UsbmonHeader::Type type) const {
  UsbPacket packet;
  packet.time_ns = clock_.Now() + options_.wall_offset_ns;
  packet.header.id = recorded.id;
  packet.header.type = type;
  packet.header.xfer_type = recorded.xfer_type;
  packet.header.epnum = recorded.epnum;
  packet.header.devnum = address_;
  packet.header.busnum = options_.bus;
  packet.header.flag_setup = kUsbmonAbsent;
  return packet;
}

RecordingTransport::Recorded RecordingTransport::RecordSubmission(const Transfer& transfer,
                                                                  std::string comment) {
  const bool control = transfer.type == TransferType::kControl;
  const bool in = ((control ? transfer.setup.request_type : transfer.endpoint) & kDirectionIn) != 0;
  Recorded recorded;
  recorded.id = next_id_++;
  recorded.xfer_type = UsbmonXferType(transfer.type);
  recorded.epnum = control ? (in ? kDirectionIn : 0) : transfer.endpoint;
  UsbPacket packet = PacketOf(recorded, UsbmonHeader::kSubmit);
  packet.header.status = kUsbmonInProgress;
  packet.header.xfer_flags =
      (in ? kUrbDirIn : 0) | (transfer.zero_packet ? kUrbZeroPacket : uint32_t{0});
  if (control) {
    packet.header.flag_setup = 0;
    packet.header.setup = SetupBytes(transfer.setup);
  }
  if (in) {
    packet.header.flag_data = kUsbmonDataIn;
    packet.header.length = transfer.length;
  } else {
    packet.header.length = static_cast<uint32_t>(transfer.data.size());
    packet.data = transfer.data;
  }
  if (!opened_.empty()) {
    comment = comment.empty() ? std::move(opened_) : absl::StrCat(opened_, "; ", comment);
    opened_.clear();
  }
  packet.comment = comment;
  recorder_->Add(packet);
  return recorded;
}

absl::StatusOr<TransferId> RecordingTransport::Answered(const Recorded& recorded,
                                                        absl::StatusOr<TransferId> id) {
  if (id.ok()) {
    in_flight_.emplace(*id, recorded);
    return id;
  }
  const std::string reason(id.status().message());
  UsbPacket packet = PacketOf(recorded, UsbmonHeader::kError);
  packet.header.flag_data = kNotData;
  packet.header.status = UsbmonRefusal(id.status());
  const std::string comment = absl::CHexEscape(reason);
  packet.comment = comment;
  recorder_->Add(packet);
  return id;
}

absl::StatusOr<TransferId> RecordingTransport::Submit(Transfer&& transfer) {
  if (!inner_->is_open()) return inner_->Submit(std::move(transfer));
  // Record before submitting: afterwards we do not own the bytes.
  const Recorded recorded = RecordSubmission(transfer, "");
  return Answered(recorded, inner_->Submit(std::move(transfer)));
}

absl::StatusOr<TransferId> RecordingTransport::ClearHalt(uint8_t endpoint) {
  if (!inner_->is_open()) return inner_->ClearHalt(endpoint);
  Transfer request;
  request.type = TransferType::kControl;
  request.setup = ClearHaltSetup(endpoint);
  const Recorded recorded = RecordSubmission(request, "");
  return Answered(recorded, inner_->ClearHalt(endpoint));
}

absl::StatusOr<TransferId> RecordingTransport::Reset() {
  if (!inner_->is_open()) return inner_->Reset();
  Transfer request;
  request.type = TransferType::kControl;
  request.setup = kPortResetSetup;
  const Recorded recorded = RecordSubmission(request, "port reset, which its hub is asked for");
  return Answered(recorded, inner_->Reset());
}

void RecordingTransport::RecordCompletion(const TransferCompletion& completion) {
  const auto it = in_flight_.find(completion.id);
  if (it == in_flight_.end()) return;
  UsbPacket packet = PacketOf(it->second, UsbmonHeader::kComplete);
  packet.header.status = UsbmonStatus(completion.status);
  packet.header.length = completion.actual_length;
  if ((it->second.epnum & kDirectionIn) != 0) {
    packet.data = completion.data;
  } else {
    packet.header.flag_data = kUsbmonDataOut;
  }
  in_flight_.erase(it);
  recorder_->Add(packet);
}

size_t RecordingTransport::Drain(std::vector<TransferCompletion>& out) {
  const size_t first = out.size();
  const size_t count = inner_->Drain(out);
  for (size_t i = first; i < out.size(); ++i) RecordCompletion(out[i]);
  return count;
}

absl::StatusOr<std::unique_ptr<RecordingTransport>> RecordToFile(
    const std::string& path, std::unique_ptr<UsbTransport> inner, sync::Clock& clock,
    RecordingFileOptions options) {
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  if (access(folder.c_str(), W_OK) != 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the recording ", path, " cannot be written: ", std::generic_category().message(errno)));
  }
  options.limits.info = {.application = options.application, .interface_name = options.name};
  const auto make = [path,
                     limits = options.limits]() -> absl::StatusOr<std::unique_ptr<PacketRecorder>> {
    absl::StatusOr<std::unique_ptr<ByteSink>> sink = OpenFileSink(path);
    if (!sink.ok()) return sink.status();
    return std::make_unique<PacketRecorder>(*std::move(sink), limits);
  };
  return std::make_unique<RecordingTransport>(std::move(inner), make, clock, options.transport);
}

}  // namespace voxeld::display
