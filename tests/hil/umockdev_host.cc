// A fake kernel for one emulated device: runs a program that sees a USB device in /sys and /dev and
// talks to it through usbfs; the device is in fact a model in this process. Run it under
// umockdev-wrapper.
//
//   umockdev_host DEVICE CONTROL PROGRAM [ARGUMENT…]     DEVICE as for voxeld-emulator
//
// Exits with the program's exit status.

#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <umockdev.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "display/emulator/carriers/model_facts.h"
#include "display/sync/clock.h"
#include "tools/emulator/control_socket.h"
#include "tools/emulator/emulated.h"

namespace voxeld::hil {
namespace {

using display::TransferStatus;
using display::emulator::ModelFacts;
using display::emulator::ParseSetup;

constexpr const char* kFolder = "/devices/pci0000:00/usb1/1-1";
// Like the kernel's usbfs_memory_mb.
constexpr size_t kMostInFlight = size_t{16} << 20;
// The node is always writable, so libusb polls all the time: an answer of "nothing yet" is delayed
// by this much.
constexpr sync::TimeNs kPark = 2 * sync::kMillisecond;

int KernelStatus(TransferStatus status) {
  switch (status) {
    case TransferStatus::kOk:
    case TransferStatus::kShort:
      return 0;
    case TransferStatus::kStall:
      return -EPIPE;
    case TransferStatus::kOverflow:
      return -EOVERFLOW;
    case TransferStatus::kCancelled:
      return -ENOENT;
    case TransferStatus::kDisconnected:
      return -ESHUTDOWN;
    default:
      return -EPROTO;
  }
}

class Host {
 public:
  Host(emulator::Emulated device, const std::string& control, sync::Clock& clock)
      : device_(std::move(device)),
        clock_(clock),
        testbed_(umockdev_testbed_new()),
        handler_(umockdev_ioctl_base_new()) {
    Enumerate();
    g_signal_connect(
        handler_, "handle-ioctl",
        G_CALLBACK(+[](UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer host) {
          return static_cast<Host*>(host)->OnIoctl(client);
        }),
        this);
    absl::StatusOr<std::unique_ptr<emulator::ControlSocket>> made =
        emulator::ControlSocket::Listen(control);
    if (!made.ok()) Die(std::string(made.status().message()));
    control_ = *std::move(made);
    AddDevice();
  }
  ~Host() {
    g_object_unref(handler_);
    g_object_unref(testbed_);
  }

  int Run(char** program) {
    const pid_t child = fork();
    if (child == 0) {
      execv(program[0], program);
      _exit(127);
    }
    int status = 0;
    while (waitpid(child, &status, WNOHANG) == 0) {
      while (g_main_context_iteration(nullptr, FALSE)) {
      }
      std::vector<pollfd> fds;
      control_->AddTo(fds);
      poll(fds.data(), fds.size(), 1);
      FollowCable();
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  struct InFlight {
    std::string node;
    UMockdevIoctlData* urb = nullptr;
    UMockdevIoctlData* buffer = nullptr;
    size_t bytes = 0;
    std::vector<std::byte> out;
  };
  struct Parked {
    UMockdevIoctlClient* client;
    sync::TimeNs until;
  };

  [[noreturn]] static void Die(const std::string& what) {
    std::fprintf(stderr, "umockdev_host: %s\n", what.c_str());
    std::exit(125);
  }

  std::string Node() const { return absl::StrFormat("bus/usb/001/%03d", number_); }

  // Reads the device's descriptors.
  void Enumerate() {
    facts_ = display::emulator::ReadFacts(*device_.model);
    for (char& c : facts_.serial) {
      if (c < ' ' || c > '~' || c == '\\') c = '?';
    }
    device_.model->SetComplete(
        [this](uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte> in) {
          OnComplete(id, status, actual, in);
        });
  }

  void AddDevice() {
    // A kernel does not accept it otherwise.
    listed_ = facts_.device.size() >= 18 && facts_.configuration.size() >= 9;
    if (!listed_) return;
    const std::string path = "/dev/" + Node();
    GError* error = nullptr;
    if (!umockdev_testbed_attach_ioctl(testbed_, path.c_str(), handler_, &error)) {
      Die(error->message);
    }
    std::string hex;
    for (const auto* bytes : {&facts_.device, &facts_.configuration}) {
      for (const std::byte b : *bytes)
        absl::StrAppend(&hex, absl::StrFormat("%02X", std::to_integer<int>(b)));
    }
    const std::string text = absl::StrCat(
        "P: ", kFolder, "\nN: ", Node(), "=", hex, "\nE: SUBSYSTEM=usb\nE: DRIVER=usb\n",
        absl::StrFormat("E: BUSNUM=001\nE: DEVNUM=%03d\n", number_), "E: DEVNAME=", path,
        "\nE: DEVTYPE=usb_device\nE: MAJOR=189\nE: MINOR=", number_ - 1,
        "\nA: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=", number_,
        "\\n\nA: speed=480\\n\n",
        absl::StrFormat("A: idVendor=%04x\\n\nA: idProduct=%04x\\n\nA: bcdDevice=%04x\\n\n",
                        facts_.vendor_id, facts_.product_id, facts_.bcd_device),
        "A: serial=", facts_.serial, "\\n\nH: descriptors=", hex, "\n");
    if (!umockdev_testbed_add_from_string(testbed_, text.c_str(), &error)) Die(error->message);
    umockdev_testbed_uevent(testbed_, (std::string("/sys") + kFolder).c_str(), "add");
  }

  // The node stays, and reports to those who have it open that their device is gone.
  void RemoveDevice() {
    if (!listed_) return;
    const std::string folder = std::string("/sys") + kFolder;
    umockdev_testbed_uevent(testbed_, folder.c_str(), "remove");
    umockdev_testbed_remove_device(testbed_, folder.c_str());
  }

  void FollowCable() {
    std::unique_lock lock(mutex_);
    control_->Serve([this](std::string_view line) { return emulator::Control(device_, line); });
    device_.model->Tick();
    ReleaseParked();
    // It may have been unplugged and plugged in again since the last check.
    const uint32_t plugs = device_.model->plugged() ? device_.model->plugs() : 0;
    const uint32_t had = std::exchange(plugs_, plugs);
    if (plugs == had) return;
    if (plugs != 0) {
      ++number_;  // as the kernel does: an old handle stays invalid
      Enumerate();
    }
    lock.unlock();
    if (had != 0) RemoveDevice();
    if (plugs != 0) AddDevice();
  }

  void ReleaseParked() {
    for (auto it = parked_.begin(); it != parked_.end();) {
      if (clock_.Now() < it->until && DoneOf(it->client).empty()) {
        ++it;
        continue;
      }
      umockdev_ioctl_client_complete(it->client, -1, Stale(it->client) ? ENODEV : EAGAIN);
      g_object_unref(it->client);
      it = parked_.erase(it);
    }
  }

  std::deque<UMockdevIoctlData*>& DoneOf(UMockdevIoctlClient* client) {
    return done_[umockdev_ioctl_client_get_devnode(client)];
  }

  bool Stale(UMockdevIoctlClient* client) const {
    return !device_.model->plugged() ||
           "/dev/" + Node() != umockdev_ioctl_client_get_devnode(client);
  }

  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in) {
    const auto it = in_flight_.find(id);
    if (it == in_flight_.end()) return;
    auto* const urb = reinterpret_cast<usbdevfs_urb*>(it->second.urb->data);
    urb->status = KernelStatus(status);
    urb->actual_length = static_cast<int>(in.empty() ? actual : in.size());
    if (!in.empty()) {
      const size_t head = urb->type == USBDEVFS_URB_TYPE_CONTROL ? 8 : 0;
      umockdev_ioctl_data_update(it->second.buffer, head,
                                 reinterpret_cast<guint8*>(const_cast<std::byte*>(in.data())),
                                 in.size());
    }
    bytes_in_flight_ -= it->second.bytes;
    done_[it->second.node].push_back(it->second.urb);
    in_flight_.erase(it);
  }

  gboolean Answer(UMockdevIoctlClient* client, int error) {
    umockdev_ioctl_client_complete(client, error == 0 ? 0 : -1, error);
    return TRUE;
  }

  // The data that a request points to, read from the client's memory. Reading waits for the client,
  // which may be stopped, so it is done without the lock, and queries about the device are still
  // answered. Owned by nobody, or by what is in flight.
  struct Memory {
    UMockdevIoctlData* first = nullptr;
    UMockdevIoctlData* second = nullptr;
  };
  static Memory Read(UMockdevIoctlClient* client) {
    UMockdevIoctlData* const argument = umockdev_ioctl_client_get_arg(client);
    const auto read = [](UMockdevIoctlData* from, size_t offset, size_t size) {
      return umockdev_ioctl_data_resolve(from, offset, size, nullptr);
    };
    Memory memory;
    switch (umockdev_ioctl_client_get_request(client)) {
      case USBDEVFS_GET_CAPABILITIES:
      case USBDEVFS_CLEAR_HALT:
        memory.first = read(argument, 0, sizeof(uint32_t));
        break;
      case USBDEVFS_CONNECTINFO:
        memory.first = read(argument, 0, sizeof(usbdevfs_connectinfo));
        break;
      case USBDEVFS_CONTROL: {
        memory.first = read(argument, 0, sizeof(usbdevfs_ctrltransfer));
        const auto& asked = *reinterpret_cast<usbdevfs_ctrltransfer*>(memory.first->data);
        if (asked.wLength > 0) {
          memory.second =
              read(memory.first, G_STRUCT_OFFSET(usbdevfs_ctrltransfer, data), asked.wLength);
        }
        break;
      }
      case USBDEVFS_SUBMITURB: {
        memory.first = read(argument, 0, sizeof(usbdevfs_urb));
        const auto length = reinterpret_cast<usbdevfs_urb*>(memory.first->data)->buffer_length;
        if (length > 0 && static_cast<size_t>(length) <= kMostInFlight) {
          memory.second = read(memory.first, G_STRUCT_OFFSET(usbdevfs_urb, buffer),
                               static_cast<size_t>(length));
        }
        break;
      }
      default:
        break;
    }
    return memory;
  }

  gboolean OnIoctl(UMockdevIoctlClient* client) {
    const Memory memory = Read(client);
    std::unique_lock lock(mutex_);
    device_.model->Tick();
    UMockdevIoctlData* const argument = umockdev_ioctl_client_get_arg(client);
    const bool stale = Stale(client);
    switch (umockdev_ioctl_client_get_request(client)) {
      case USBDEVFS_GET_CAPABILITIES: {
        uint32_t capabilities = USBDEVFS_CAP_BULK_SCATTER_GATHER | USBDEVFS_CAP_BULK_CONTINUATION |
                                USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
                                USBDEVFS_CAP_REAP_AFTER_DISCONNECT | USBDEVFS_CAP_ZERO_PACKET;
        return Give(client, memory.first, capabilities);
      }
      case USBDEVFS_CONNECTINFO: {
        usbdevfs_connectinfo info{};
        info.devnum = static_cast<unsigned>(number_);
        return Give(client, memory.first, info);
      }
      case USBDEVFS_CONTROL:
        return stale ? Answer(client, ENODEV) : SynchronousControl(client, memory);
      case USBDEVFS_CLAIMINTERFACE:
      case USBDEVFS_RELEASEINTERFACE:
      case USBDEVFS_SETINTERFACE:
      case USBDEVFS_SETCONFIGURATION:
        return Answer(client, stale ? ENODEV : 0);
      case USBDEVFS_RESET:
        if (!stale) device_.model->Reset();
        return Answer(client, stale ? ENODEV : 0);
      case USBDEVFS_CLEAR_HALT: {
        if (stale) return Answer(client, ENODEV);
        uint32_t endpoint = 0;
        std::memcpy(&endpoint, memory.first->data, sizeof(endpoint));
        display::Urb urb;
        urb.id = next_++;
        urb.setup = {.request_type = 2, .request = 1, .index = static_cast<uint16_t>(endpoint)};
        device_.model->Submit(urb);
        return Answer(client, 0);
      }
      case USBDEVFS_SUBMITURB:
        return stale ? Answer(client, ENODEV) : SubmitUrb(client, memory);
      case USBDEVFS_REAPURB:
      case USBDEVFS_REAPURBNDELAY: {
        std::deque<UMockdevIoctlData*>& done = DoneOf(client);
        if (done.empty()) {
          if (stale) return Answer(client, ENODEV);
          g_object_ref(client);
          parked_.push_back({client, clock_.Now() + kPark});
          return TRUE;
        }
        UMockdevIoctlData* const urb = done.front();
        done.pop_front();
        lock.unlock();
        g_autoptr(UMockdevIoctlData) data =
            umockdev_ioctl_data_resolve(argument, 0, sizeof(void*), nullptr);
        umockdev_ioctl_data_set_ptr(data, 0, urb);
        return Answer(client, 0);
      }
      case USBDEVFS_DISCARDURB: {
        const auto address = *reinterpret_cast<gulong*>(argument->data);
        for (const auto& [id, urb] : in_flight_) {
          if (urb.urb->client_addr != address) continue;
          const uint64_t victim = id;
          device_.model->Unlink(victim);
          OnComplete(victim, TransferStatus::kCancelled, 0, {});
          return Answer(client, 0);
        }
        return Answer(client, EINVAL);
      }
      case USBDEVFS_IOCTL:  // detaching a driver: the device has none
      case USBDEVFS_GETDRIVER:
        return Answer(client, ENODATA);
      default:
        return FALSE;
    }
  }

  template <typename T>
  gboolean Give(UMockdevIoctlClient* client, UMockdevIoctlData* data, T value) {
    umockdev_ioctl_data_update(data, 0, reinterpret_cast<guint8*>(&value), sizeof(value));
    return Answer(client, 0);
  }

  gboolean SynchronousControl(UMockdevIoctlClient* client, const Memory& memory) {
    usbdevfs_ctrltransfer control;
    std::memcpy(&control, memory.first->data, sizeof(control));
    // The only request that libusb sends in this way: GET_CONFIGURATION.
    if (control.bRequestType != 0x80 || control.bRequest != 8 || control.wLength < 1) {
      return Answer(client, EPIPE);
    }
    guint8 configuration = 1;
    umockdev_ioctl_data_update(memory.second, 0, &configuration, 1);
    umockdev_ioctl_client_complete(client, 1, 0);
    return TRUE;
  }

  gboolean SubmitUrb(UMockdevIoctlClient* client, const Memory& memory) {
    const auto& asked = *reinterpret_cast<usbdevfs_urb*>(memory.first->data);
    const auto length = static_cast<size_t>(asked.buffer_length);
    if (length > kMostInFlight - bytes_in_flight_) return Answer(client, ENOMEM);
    InFlight urb{.node = umockdev_ioctl_client_get_devnode(client),
                 .urb = memory.first,
                 .buffer = memory.second,
                 .bytes = length,
                 .out = {}};
    display::Urb out;
    out.id = next_++;
    const auto* bytes =
        urb.buffer == nullptr ? nullptr : reinterpret_cast<const std::byte*>(urb.buffer->data);
    size_t head = 0;
    bool in = (asked.endpoint & 0x80) != 0;
    if (asked.type == USBDEVFS_URB_TYPE_CONTROL) {
      if (length < 8) return Answer(client, EINVAL);
      uint8_t setup[8];
      std::memcpy(setup, bytes, sizeof(setup));
      out.setup = ParseSetup(setup);
      in = (out.setup.request_type & 0x80) != 0;
      head = 8;
    } else {
      out.endpoint = asked.endpoint;
    }
    if (in) {
      out.length = static_cast<uint32_t>(length - head);
    } else if (length > head) {
      urb.out.assign(bytes + head, bytes + length);
    }
    out.zero_packet = (asked.flags & USBDEVFS_URB_ZERO_PACKET) != 0;
    bytes_in_flight_ += length;
    InFlight& kept = in_flight_[out.id] = std::move(urb);
    out.out = kept.out;
    device_.model->Submit(out);
    return Answer(client, 0);
  }

  std::mutex mutex_;  // handlers may run in umockdev's thread
  emulator::Emulated device_;
  ModelFacts facts_;
  bool listed_ = false;  // the system has registered it
  sync::Clock& clock_;
  UMockdevTestbed* const testbed_;
  UMockdevIoctlBase* const handler_;
  std::unique_ptr<emulator::ControlSocket> control_;
  int number_ = 2;
  uint32_t plugs_ = 1;  // of the device as it is in the testbed; 0: it is not plugged in
  uint64_t next_ = 1;
  std::map<uint64_t, InFlight> in_flight_;
  size_t bytes_in_flight_ = 0;
  std::map<std::string, std::deque<UMockdevIoctlData*>> done_;  // answers by node
  std::list<Parked> parked_;
};

int Main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: umockdev_host DEVICE CONTROL PROGRAM [ARGUMENT…]\n");
    return 2;
  }
  sync::SystemClock clock;
  absl::StatusOr<emulator::Emulated> device = emulator::MakeEmulated(argv[1], clock);
  if (!device.ok()) {
    std::fprintf(stderr, "umockdev_host: %s\n", std::string(device.status().message()).c_str());
    return 2;
  }
  Host host(*std::move(device), argv[2], clock);
  setenv("VOXELD_EMULATOR_CONTROL", argv[2], 1);
  return host.Run(argv + 3);
}

}  // namespace
}  // namespace voxeld::hil

int main(int argc, char** argv) { return voxeld::hil::Main(argc, argv); }
