#include "display/emulator/carriers/usbip.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <sstream>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "display/emulator/carriers/limits.h"
#include "display/emulator/carriers/model_facts.h"

namespace voxeld::display::emulator {
namespace {

constexpr uint32_t kSubmit = 1, kUnlink = 2, kSubmitReply = 3, kUnlinkReply = 4;
constexpr uint32_t kZeroPacket = 0x40;  // URB_ZERO_PACKET
constexpr uint32_t kMostBytes = 64u << 20;
constexpr uint32_t kNotIsochronous = 0xFFFFFFFF;  // in `packets`; older kernels: 0
constexpr int kMostCommands = 256;                // per call, so that others get their turn
constexpr uint16_t kVersion = 0x0111;
constexpr uint16_t kDeviceListRequest = 0x8005, kDeviceListReply = 0x0005;
constexpr uint16_t kImportRequest = 0x8003, kImportReply = 0x0003;
constexpr const char* kBusId = "1-1";
constexpr const char* kController = "/sys/devices/platform/vhci_hcd.0";

// All fields are big-endian, except setup.
struct Header {
  uint32_t command, number, device, direction, endpoint;
  uint32_t flags;   // or the number to unlink; in replies the status
  uint32_t length;  // in replies the actual length
  uint32_t start_frame, packets, interval;
  uint8_t setup[8];
};
static_assert(sizeof(Header) == 48);

struct __attribute__((packed)) Operation {
  uint16_t version, code;
  uint32_t status;
};
struct __attribute__((packed)) DeviceRecord {
  char path[256];
  char bus_id[32];
  uint32_t bus, device, speed;
  uint16_t vendor, product, bcd;
  uint8_t device_class, subclass, protocol, configuration, configurations, interfaces;
};
static_assert(sizeof(DeviceRecord) == 312);

// Returns the kernel's enum usb_device_speed.
uint32_t KernelSpeed(UsbSpeed speed) {
  return speed == UsbSpeed::kFull ? 2 : speed == UsbSpeed::kHigh ? 3 : 5;
}

uint32_t KernelStatus(TransferStatus status) {
  switch (status) {
    case TransferStatus::kOk:
    case TransferStatus::kShort:
      return 0;
    case TransferStatus::kStall:
      return static_cast<uint32_t>(-EPIPE);
    case TransferStatus::kOverflow:
      return static_cast<uint32_t>(-EOVERFLOW);
    case TransferStatus::kCancelled:
      return static_cast<uint32_t>(-ENOENT);
    case TransferStatus::kDisconnected:  // not reported
    case TransferStatus::kTimedOut:
    case TransferStatus::kError:
      break;
  }
  return static_cast<uint32_t>(-EPROTO);
}

template <typename T>
std::span<const std::byte> BytesOf(const T& value) {
  return std::as_bytes(std::span(&value, 1));
}

absl::Status Errno(const std::string& what) {
  return absl::UnavailableError(absl::StrCat(what, ": ", std::generic_category().message(errno)));
}

}  // namespace

UsbipSession::UsbipSession(int fd, UsbDeviceModel& model)
    : stream_(fd), model_(model), head_(sizeof(Header)) {
  model_.SetComplete([this](uint64_t id, TransferStatus status, uint32_t actual,
                            std::span<const std::byte> in) { OnComplete(id, status, actual, in); });
}

UsbipSession::~UsbipSession() {
  for (const auto& [id, submitted] : submitted_) model_.Unlink(id);
  model_.SetComplete([](uint64_t, TransferStatus, uint32_t, std::span<const std::byte>) {});
}

absl::Status UsbipSession::Receive() {
  for (int i = 0; i < kMostCommands; ++i) {
    const absl::StatusOr<bool> one = ReceiveOne();
    if (!one.ok()) return one.status();
    if (!*one) break;
  }
  if (stream_.waiting() > kMostWaiting) {
    return absl::ResourceExhaustedError("the other side does not take its answers");
  }
  if (!stream_.open()) return absl::UnavailableError("the other side has gone");
  return absl::OkStatus();
}

absl::StatusOr<bool> UsbipSession::ReceiveOne() {
  while (have_ < sizeof(Header)) {
    const size_t got = stream_.Receive(std::span(head_).subspan(have_));
    if (got == 0) return false;
    have_ += got;
  }
  Header header;
  std::memcpy(&header, head_.data(), sizeof(header));
  const uint32_t command = ntohl(header.command), number = ntohl(header.number);
  const bool in = ntohl(header.direction) != 0;
  if (command == kUnlink) {
    have_ = 0;
    const auto victim = submitted_.find(ntohl(header.flags));
    const bool pending = victim != submitted_.end() && model_.Unlink(victim->first);
    if (pending) Forget(victim);
    Header reply{};
    reply.command = htonl(kUnlinkReply);
    reply.number = header.number;
    reply.flags = htonl(pending ? static_cast<uint32_t>(-ECONNRESET) : 0);
    stream_.Send(BytesOf(reply));
    return true;
  }
  const uint32_t length = ntohl(header.length), packets = ntohl(header.packets);
  if (command != kSubmit || length > kMostBytes || ntohl(header.endpoint) > 15) {
    return absl::InvalidArgumentError(absl::StrCat("USB/IP command ", command, " of ", length,
                                                   " bytes on endpoint ", ntohl(header.endpoint)));
  }
  if (packets != 0 && packets != kNotIsochronous) {
    return absl::UnimplementedError("an isochronous USB/IP transfer");
  }
  if (submitted_.contains(number)) {
    return absl::InvalidArgumentError(absl::StrCat("USB/IP number ", number, " is in use"));
  }
  if (submitted_.size() >= kMostPending || pending_bytes_ + length > kMostPendingBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat(submitted_.size(), " USB/IP transfers wait, of ", pending_bytes_, " bytes"));
  }
  const size_t follows = in ? 0 : length;
  if (have_ == sizeof(Header)) payload_.resize(follows);
  while (have_ < sizeof(Header) + follows) {
    const size_t got = stream_.Receive(std::span(payload_).subspan(have_ - sizeof(Header)));
    if (got == 0) return false;
    have_ += got;
  }
  have_ = 0;
  Submit(number, in);
  return true;
}

void UsbipSession::Submit(uint32_t number, bool in) {
  Header header;
  std::memcpy(&header, head_.data(), sizeof(header));
  const uint32_t endpoint = ntohl(header.endpoint);
  Submitted& submitted = submitted_[number];
  submitted.in = in;
  submitted.length = ntohl(header.length);
  pending_bytes_ += submitted.length;
  submitted.out = std::move(payload_);
  payload_ = {};
  Urb urb;
  urb.id = number;
  urb.endpoint = static_cast<uint8_t>(endpoint == 0 ? 0 : endpoint | (in ? 0x80u : 0u));
  urb.out = submitted.out;
  urb.length = in ? submitted.length : 0;
  urb.zero_packet = (ntohl(header.flags) & kZeroPacket) != 0;
  if (endpoint == 0) urb.setup = ParseSetup(header.setup);
  model_.Submit(urb);
}

void UsbipSession::Forget(std::map<uint64_t, Submitted>::iterator which) {
  pending_bytes_ -= which->second.length;
  submitted_.erase(which);
}

void UsbipSession::OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                              std::span<const std::byte> in) {
  const auto it = submitted_.find(id);
  if (it == submitted_.end()) return;
  // An unplugged cable reports nothing. (Linux's virtual controller can lose a transfer that is
  // cancelled while the connection ends, and the canceller then waits for ever; so give it no
  // reason to cancel.)
  if (status == TransferStatus::kDisconnected) return Forget(it);
  const bool reads = it->second.in;
  in = in.first(std::min<size_t>(in.size(), it->second.length));
  Header reply{};
  reply.command = htonl(kSubmitReply);
  reply.number = htonl(static_cast<uint32_t>(id));
  reply.flags = htonl(KernelStatus(status));
  reply.length = htonl(reads ? static_cast<uint32_t>(in.size()) : actual);
  Forget(it);
  stream_.Send(BytesOf(reply));
  if (reads) stream_.Send(in);
}

absl::StatusOr<bool> AnswerUsbipHandshake(int fd, UsbDeviceModel& model, int limit_ms) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(limit_ms);
  const auto receive = [&](void* into, size_t size) {
    auto* at = static_cast<char*>(into);
    while (size > 0) {
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      pollfd ready{fd, POLLIN, 0};
      if (left.count() <= 0 || poll(&ready, 1, static_cast<int>(left.count())) <= 0) return false;
      const ssize_t n = recv(fd, at, size, 0);
      if (n <= 0) return false;
      at += n;
      size -= static_cast<size_t>(n);
    }
    return true;
  };
  const auto reply = [&](std::span<const std::byte> bytes) {
    return send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
  };
  Operation request{};
  if (!receive(&request, sizeof(request))) {
    return absl::UnavailableError("no whole USB/IP request came");
  }
  if (ntohs(request.version) != kVersion) {
    return absl::InvalidArgumentError(
        absl::StrFormat("USB/IP version 0x%04x; this is 0x%04x", ntohs(request.version), kVersion));
  }
  const ModelFacts facts = ReadFacts(model);
  DeviceRecord record{};
  std::snprintf(record.path, sizeof(record.path), "/sys/devices/emulated/%s", kBusId);
  std::snprintf(record.bus_id, sizeof(record.bus_id), "%s", kBusId);
  record.bus = htonl(1);
  record.device = htonl(2);
  record.speed = htonl(KernelSpeed(model.speed()));
  record.vendor = htons(facts.vendor_id);
  record.product = htons(facts.product_id);
  record.bcd = htons(facts.bcd_device);
  record.configuration = record.configurations = 1;
  record.interfaces = static_cast<uint8_t>(facts.interfaces.size());
  const uint16_t code = ntohs(request.code);
  if (code == kDeviceListRequest) {
    const bool plugged = model.plugged();
    const uint32_t count = htonl(plugged ? 1 : 0);
    bool sent = reply(BytesOf(Operation{htons(kVersion), htons(kDeviceListReply), 0})) &&
                reply(BytesOf(count)) && (!plugged || reply(BytesOf(record)));
    for (const std::array<uint8_t, 3>& triple : facts.interfaces) {
      const uint8_t interface[4] = {triple[0], triple[1], triple[2], 0};
      sent = sent && reply(BytesOf(interface));
    }
    if (!sent) return Errno("the USB/IP list");
    return false;
  }
  char bus_id[32];
  if (code != kImportRequest) {
    return absl::InvalidArgumentError(absl::StrFormat("USB/IP request 0x%04x", code));
  }
  if (!receive(bus_id, sizeof(bus_id))) {
    return absl::UnavailableError("no whole USB/IP request came");
  }
  const bool known = model.plugged() && strncmp(bus_id, kBusId, sizeof(bus_id)) == 0;
  const Operation answer{htons(kVersion), htons(kImportReply), htonl(known ? 0 : 1)};
  if (!reply(BytesOf(answer)) || (known && !reply(BytesOf(record)))) return Errno("USB/IP");
  if (!known) return absl::NotFoundError("another USB/IP device was asked for, or it is unplugged");
  return true;
}

absl::StatusOr<int> AttachToKernel(UsbSpeed speed) {
  std::ifstream file(absl::StrCat(kController, "/status"));
  if (!file) {
    return absl::FailedPreconditionError(absl::StrCat(
        kController, " is not there; the kernel's vhci_hcd is needed: `modprobe vhci-hcd`"));
  }
  // Lines read: hub port state …; state 4: free.
  const std::string hub = speed == UsbSpeed::kSuper ? "ss" : "hs";
  int port = -1;
  for (std::string line; port < 0 && std::getline(file, line);) {
    std::istringstream fields(line);
    std::string of;
    int number = 0, state = 0;
    if (fields >> of >> number >> state && of == hub && state == 4) port = number;
  }
  if (port < 0) return absl::ResourceExhaustedError(absl::StrCat(kController, " has no free port"));
  int sockets[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) != 0) return Errno("socketpair");
  // The kernel's end blocks; its buffers limit the bytes in flight.
  const int size = 8 << 20;
  setsockopt(sockets[0], SOL_SOCKET, SO_SNDBUFFORCE, &size, sizeof(size));
  setsockopt(sockets[0], SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof(size));
  const std::string line =
      absl::StrCat(port, " ", sockets[0], " ", 0x10002, " ", KernelSpeed(speed));
  const int attach = open(absl::StrCat(kController, "/attach").c_str(), O_WRONLY | O_CLOEXEC);
  const bool attached =
      attach >= 0 && write(attach, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  const absl::Status failed = Errno(absl::StrCat(kController, "/attach"));
  if (attach >= 0) close(attach);
  close(sockets[0]);
  if (attached) return sockets[1];
  close(sockets[1]);
  return failed;
}

}  // namespace voxeld::display::emulator
