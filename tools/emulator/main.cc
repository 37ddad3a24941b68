// voxeld-emulator: plays a display's USB device to this machine's kernel, to another machine's, or
// to a virtual machine.

#include <malloc.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "daemon/usage/standard_output.h"
#include "daemon/usage/usage_error.h"
#include "display/emulator/carriers/usbip.h"
#include "display/emulator/carriers/usbredir.h"
#include "tools/emulator/control_socket.h"
#include "tools/emulator/emulated.h"

namespace voxeld::emulator {
namespace {

using display::emulator::UsbipSession;
using display::emulator::UsbredirSession;

struct Options {
  std::string device = "voxlink";
  bool attach = false;
  std::optional<uint16_t> usbip_port;
  std::string usbredir;
  std::string control;
};

absl::Status Errno(const std::string& what) {
  return absl::UnavailableError(absl::StrCat(what, ": ", std::generic_category().message(errno)));
}

// One connection at a time, over any of the carriers.
class Session {
 public:
  virtual ~Session() = default;
  virtual display::emulator::ByteStream& stream() = 0;
  virtual absl::Status Receive() = 0;
  // Continues after the model has done something.
  virtual void ReadOn() {}
  // Reports that the device was plugged or unplugged. Returns false if the connection itself is the
  // cable and has to end.
  virtual bool Plugged(bool plugged) = 0;
};

class UsbipCarrier final : public Session {
 public:
  UsbipCarrier(int fd, display::UsbDeviceModel& model) : session_(fd, model) {}
  display::emulator::ByteStream& stream() override { return session_.stream(); }
  absl::Status Receive() override { return session_.Receive(); }
  bool Plugged(bool plugged) override { return plugged; }

 private:
  UsbipSession session_;
};

class UsbredirCarrier final : public Session {
 public:
  UsbredirCarrier(int fd, display::UsbDeviceModel& model) : session_(fd, model) {}
  display::emulator::ByteStream& stream() override { return session_.stream(); }
  absl::Status Receive() override { return session_.Receive(); }
  void ReadOn() override { session_.ReadOn(); }
  bool Plugged(bool plugged) override {
    session_.SetPlugged(plugged);
    return true;
  }

 private:
  UsbredirSession session_;
};

constexpr int kHandshakeMs = 2000;
// The minimum time for which an unplugged device stays away from the kernel: its port has to become
// empty.
constexpr sync::TimeNs kReattach = 50 * sync::kMillisecond;

class Player {
 public:
  Player(Emulated device, sync::Clock& clock, const Options& options)
      : device_(std::move(device)), clock_(clock), options_(options) {}
  ~Player() {
    session_ = nullptr;
    if (listener_ < 0) return;
    close(listener_);
    if (!options_.usbredir.empty()) unlink(options_.usbredir.c_str());
  }

  absl::Status Open() {
    if (!options_.control.empty()) {
      absl::StatusOr<std::unique_ptr<ControlSocket>> control =
          ControlSocket::Listen(options_.control);
      if (!control.ok()) return control.status();
      control_ = *std::move(control);
    }
    if (options_.attach) return Attach();
    return options_.usbip_port.has_value() ? ListenTcp() : ListenUnix();
  }

  // Runs until a signal; `signals` is its descriptor.
  absl::Status Run(int signals) {
    while (true) {
      device_.model->Tick();
      if (absl::Status status = FollowCable(); !status.ok()) return status;
      if (session_ != nullptr) session_->ReadOn();
      std::vector<pollfd> fds = {{signals, POLLIN, 0}};
      if (listener_ >= 0 && session_ == nullptr) fds.push_back({listener_, POLLIN, 0});
      if (session_ != nullptr) {
        const auto send = static_cast<short>(session_->stream().wants_to_send() ? POLLOUT : 0);
        fds.push_back({session_->stream().fd(), static_cast<short>(POLLIN | send), 0});
      }
      if (control_ != nullptr) control_->AddTo(fds);
      poll(fds.data(), fds.size(), Timeout());
      if (fds[0].revents != 0) return absl::OkStatus();
      if (session_ == nullptr && listener_ >= 0) Accept();
      if (session_ != nullptr) Serve();
      if (control_ != nullptr) {
        control_->Serve([this](std::string_view line) { return Control(device_, line); });
      }
    }
  }

 private:
  int Timeout() const {
    const sync::TimeNs next = std::min(device_.model->NextTimeout(), attach_at_);
    if (next == sync::kNever) return -1;
    const sync::TimeNs wait = next - clock_.Now();
    if (wait <= 0) return 0;
    return static_cast<int>(std::min<sync::TimeNs>(wait / sync::kMillisecond + 1, 60'000));
  }

  absl::Status Attach() {
    attach_at_ = sync::kNever;
    absl::StatusOr<int> fd = display::emulator::AttachToKernel(device_.model->speed());
    if (!fd.ok()) return fd.status();
    BeginSession(std::make_unique<UsbipCarrier>(*fd, *device_.model));
    return absl::OkStatus();
  }

  // Follows the cable, which may have been unplugged and plugged in again since the last check.
  absl::Status FollowCable() {
    const bool plugged = device_.model->plugged();
    const uint32_t plugs = device_.model->plugs();
    if (session_ != nullptr && (!plugged || plugs != session_plugs_)) {
      const bool was_there = std::exchange(session_plugs_, plugs) != 0;
      if (was_there && !session_->Plugged(false)) EndSession();
      if (session_ != nullptr && plugged) session_->Plugged(true);
      if (!plugged) session_plugs_ = 0;
    }
    if (plugged && session_ == nullptr && options_.attach && attach_at_ == sync::kNever) {
      attach_at_ = clock_.Now() + kReattach;
    }
    if (plugged && attach_at_ <= clock_.Now()) return Attach();
    return absl::OkStatus();
  }

  void BeginSession(std::unique_ptr<Session> session) {
    session_ = std::move(session);
    session_plugs_ = device_.model->plugged() ? device_.model->plugs() : 0;
  }

  void EndSession() {
    session_->stream().Shutdown();
    session_ = nullptr;
  }

  void Serve() {
    session_->stream().SendWaiting();
    const absl::Status status = session_->Receive();
    if (status.ok() && session_->stream().open()) return;
    std::fprintf(stderr, "connection ended: %s\n", std::string(status.message()).c_str());
    EndSession();
    // The other side released the device. To the device this is an unplugged cable.
    if (device_.model->plugged()) {
      device_.model->SetPlugged(false);
      device_.model->SetPlugged(true);
    }
  }

  absl::Status ListenTcp() {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(*options_.usbip_port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int one = 1;
    setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one));
    if (bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0 ||
        listen(listener_, 4) != 0) {
      return Errno(absl::StrCat("port ", *options_.usbip_port));
    }
    socklen_t size = sizeof(address);
    getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    std::printf("USB/IP on 127.0.0.1:%d\n", ntohs(address.sin_port));
    return absl::OkStatus();
  }

  absl::Status ListenUnix() {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (options_.usbredir.size() >= sizeof(address.sun_path)) {
      return absl::InvalidArgumentError("the path of the usbredir socket is too long");
    }
    std::memcpy(address.sun_path, options_.usbredir.data(), options_.usbredir.size());
    listener_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) {
      const absl::Status taken = Errno(options_.usbredir);
      close(std::exchange(listener_, -1));  // another process owns the path
      return taken;
    }
    if (listen(listener_, 4) != 0) return Errno(options_.usbredir);
    std::printf("usbredir on %s\n", options_.usbredir.c_str());
    return absl::OkStatus();
  }

  void Accept() {
    const int fd = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (fd < 0) return;
    const int one = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof(one));
    if (!options_.usbip_port.has_value()) {
      return BeginSession(std::make_unique<UsbredirCarrier>(fd, *device_.model));
    }
    const absl::StatusOr<bool> urbs =
        display::emulator::AnswerUsbipHandshake(fd, *device_.model, kHandshakeMs);
    if (urbs.ok() && *urbs) {
      BeginSession(std::make_unique<UsbipCarrier>(fd, *device_.model));
    } else {
      if (!urbs.ok()) std::fprintf(stderr, "%s\n", std::string(urbs.status().message()).c_str());
      close(fd);
    }
  }

  Emulated device_;
  sync::Clock& clock_;
  const Options options_;
  std::unique_ptr<ControlSocket> control_;
  int listener_ = -1;
  std::unique_ptr<Session> session_;
  uint32_t session_plugs_ = 0;  // the device's count when the other side was notified; 0: unplugged
  sync::TimeNs attach_at_ = sync::kNever;
};

// Slice images and transfers of hundreds of kilobytes are allocated and freed all the time. Their
// pages are kept, because faulting them in each time would take most of the time in a guest.
void KeepPages() {
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
}

int Main(int argc, char** argv) {
  KeepPages();
  CLI::App app(
      "Plays a display's USB device: to this machine's kernel, over USB/IP, or over usbredir.",
      "voxeld-emulator");
  Options options;
  app.add_option("device", options.device,
                 "voxlink[,key=value…]: the simulated driver's options, such as\n"
                 "voxlink,size=64x64x32,speed=high,pacing=link,serial=A1,faults=stall@t100; or\n"
                 "fadecandy[,serial=TEXT,refresh=TIMES_A_SECOND,faults=PLAN]: one board")
      ->required();
  auto* attach = app.add_flag("--attach", options.attach,
                              "to this kernel's vhci_hcd; needs root and `modprobe vhci-hcd`");
  auto* usbip = app.add_option("--usbip", options.usbip_port,
                               "listen on this loopback port for `usbip attach -r HOST -b 1-1`");
  auto* usbredir = app.add_option("--usbredir", options.usbredir,
                                  "listen on this unix socket, for QEMU's usb-redir");
  attach->excludes(usbip)->excludes(usbredir);
  usbip->excludes(usbredir);
  app.add_option(
      "--control", options.control,
      "unix socket for lines: fault WHAT@WHEN, clear, hostile SEED, unplug, plug, status");
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::printf("%s", app.help().c_str());
    return usage::CheckedExit("voxeld-emulator", 0);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "voxeld-emulator: %s\n", usage::ExplainError(error, {&app}).c_str());
    return 2;
  }
  const auto fail = [](int code, const absl::Status& status) {
    std::fprintf(stderr, "voxeld-emulator: %s\n", std::string(status.message()).c_str());
    return code;
  };
  if (!options.attach && !options.usbip_port.has_value() && options.usbredir.empty()) {
    return fail(2, absl::InvalidArgumentError("one of --attach, --usbip and --usbredir is needed"));
  }
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  sigprocmask(SIG_BLOCK, &ends, nullptr);
  const int signals = signalfd(-1, &ends, SFD_CLOEXEC);

  sync::SystemClock clock;
  absl::StatusOr<Emulated> device = MakeEmulated(options.device, clock);
  if (!device.ok()) return fail(2, device.status());
  Player player(*std::move(device), clock, options);
  if (absl::Status status = player.Open(); !status.ok()) return fail(1, status);
  std::printf("ready\n");
  if (absl::Status status = player.Run(signals); !status.ok()) return fail(1, status);
  return 0;
}

}  // namespace
}  // namespace voxeld::emulator

int main(int argc, char** argv) { return voxeld::emulator::Main(argc, argv); }
