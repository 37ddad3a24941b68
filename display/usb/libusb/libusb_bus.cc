#include "display/usb/libusb/libusb_bus.h"

#include <libusb-1.0/libusb.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/usb/libusb/libusb_transport.h"

namespace voxeld::display {
namespace {

// Limits in Close: for requests to be sent, and for all cancelled transfers to end. A device that
// takes longer ends without its owner.
constexpr sync::TimeNs kPatience = 100 * sync::kMillisecond;
constexpr sync::TimeNs kCloseLimit = 500 * sync::kMillisecond;
constexpr int kGraveIntervalMs = 20;
enum PollIndex : size_t { kPoke, kNews, kTheirs };
constexpr sync::TimeNs kGraveLimit = 5 * sync::kSecond;  // in the bus's destructor

}  // namespace

absl::StatusOr<std::unique_ptr<LibusbBus>> LibusbBus::Make(sync::Clock& clock) {
  absl::StatusOr<std::shared_ptr<LibusbContext>> context = LibusbContext::Make();
  if (!context.ok()) return context.status();
  absl::StatusOr<std::unique_ptr<DeviceList>> list = DeviceList::Make();
  if (!list.ok()) return list.status();
  // Without a watch devices are still found, only later: by the next scan.
  absl::StatusOr<std::unique_ptr<DeviceWatch>> watch = DeviceWatch::Make();
  const int poke = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (poke < 0) {
    return absl::UnavailableError(
        absl::StrCat("no event for USB: ", std::generic_category().message(errno)));
  }
  return std::unique_ptr<LibusbBus>(new LibusbBus(*std::move(context), *std::move(list),
                                                  watch.ok() ? *std::move(watch) : nullptr, poke,
                                                  clock));
}

LibusbBus::LibusbBus(std::shared_ptr<LibusbContext> context, std::unique_ptr<DeviceList> list,
                     std::unique_ptr<DeviceWatch> watch, int poke, sync::Clock& clock)
    : context_(std::move(context)),
      watch_(std::move(watch)),
      poke_(poke),
      clock_(clock),
      budget_(ReadUsbfsLimit(), [this] { WakeAll(false); }),
      list_(std::move(list)) {
  // Opening and closing devices changes the descriptors to poll.
  libusb_set_pollfd_notifiers(
      context_->get(), [](int, short, void* bus) { static_cast<LibusbBus*>(bus)->FdsChanged(); },
      [](int, void* bus) { static_cast<LibusbBus*>(bus)->FdsChanged(); }, this);
  thread_ = std::thread([this] { Run(); });
}

LibusbBus::~LibusbBus() {
  {
    sync::MutexLock lock(graves_mutex_);
    stop_ = true;
  }
  Poke();
  thread_.join();
  libusb_set_pollfd_notifiers(context_->get(), nullptr, nullptr, nullptr);
  close(poke_);
}

std::unique_ptr<UsbTransport> LibusbBus::MakeTransport(UsbMatch match) {
  auto transport = std::make_unique<LibusbTransport>(*this, std::move(match));
  sync::MutexLock lock(transports_mutex_);
  transports_.insert(transport.get());
  return transport;
}

void LibusbBus::Forget(LibusbTransport* transport) {
  sync::MutexLock lock(transports_mutex_);
  transports_.erase(transport);
}

absl::StatusOr<UsbDeviceEntry> LibusbBus::Reserve(const UsbMatch& match,
                                                  const std::set<std::string>& tried) {
  sync::MutexLock lock(list_mutex_);
  absl::StatusOr<std::vector<UsbDeviceEntry>> devices = list_->Devices();
  if (!devices.ok()) return devices.status();
  const std::string group = match.member.has_value() ? match.member->group : "";
  const auto taken = [&](const UsbDeviceEntry& entry) VOXELD_REQUIRES(list_mutex_) {
    const auto it = open_nodes_.find(entry.node);
    return it != open_nodes_.end() && (group.empty() || it->second != group);
  };
  const absl::StatusOr<std::vector<UsbDeviceEntry>> all = Matching(match, *devices);
  std::erase_if(*devices, taken);
  const absl::StatusOr<std::vector<UsbDeviceEntry>> left = Matching(match, *std::move(devices));
  if (!left.ok() && all.ok()) {
    return absl::NotFoundError(
        absl::StrCat(left.status().message(), ", but for what belongs to other displays"));
  }
  if (!left.ok()) return left.status();
  for (const UsbDeviceEntry& entry : *left) {
    if (open_nodes_.contains(entry.node) || tried.contains(entry.node)) continue;
    open_nodes_.emplace(entry.node, group);
    return entry;
  }
  return absl::NotFoundError(absl::StrCat("no other ", match.ToString(), " is attached"));
}

absl::StatusOr<std::unique_ptr<OpenDevice>> LibusbBus::Open(const UsbMatch& match,
                                                            TransferId first_id,
                                                            std::function<void(bool)> wake) {
  std::set<std::string> tried;
  absl::Status last;
  while (true) {
    const absl::StatusOr<UsbDeviceEntry> entry = Reserve(match, tried);
    if (!entry.ok()) return last.ok() ? entry.status() : last;
    // A device may take a long time to answer: nobody else waits for it.
    absl::StatusOr<std::unique_ptr<OpenDevice>> device =
        OpenDevice::Open(context_, *entry, *ChooseInterface(entry->interfaces, match.interface),
                         budget_, clock_, first_id, wake);
    Poke();  // libusb may have handled others' events in here
    if (device.ok()) return device;
    last = device.status();
    tried.insert(entry->node);
    sync::MutexLock lock(list_mutex_);
    open_nodes_.erase(entry->node);
  }
}

void LibusbBus::Close(std::unique_ptr<OpenDevice> device) {
  const std::string node = device->entry().node;
  const bool ended = device->End(kPatience, kCloseLimit);
  {
    sync::MutexLock lock(list_mutex_);
    open_nodes_.erase(node);
  }
  if (ended) {
    device = nullptr;
  } else {
    sync::MutexLock lock(graves_mutex_);
    graves_.push_back(std::move(device));
  }
  Poke();
}

void LibusbBus::Poke() const {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(poke_, &one, sizeof(one));
}

void LibusbBus::FdsChanged() {
  fds_changed_ = true;
  Poke();
}

void LibusbBus::WakeAll(bool arrival) {
  sync::MutexLock lock(transports_mutex_);
  for (LibusbTransport* transport : transports_) transport->Wake(arrival);
}

void LibusbBus::WakeDue() {
  sync::MutexLock lock(transports_mutex_);
  for (LibusbTransport* transport : transports_) transport->WakeIfDue();
}

bool LibusbBus::Bury() {
  std::vector<std::unique_ptr<OpenDevice>> ended;
  sync::MutexLock lock(graves_mutex_);
  for (std::unique_ptr<OpenDevice>& device : graves_) {
    if (device->Ended()) ended.push_back(std::move(device));
  }
  std::erase(graves_, nullptr);
  return !graves_.empty();
}

std::vector<pollfd> LibusbBus::PollFds() const {
  std::vector<pollfd> fds = {{poke_, POLLIN, 0},
                             {watch_ != nullptr ? watch_->fd() : -1, POLLIN, 0}};
  if (const libusb_pollfd** theirs = libusb_get_pollfds(context_->get())) {
    for (const libusb_pollfd** fd = theirs; *fd != nullptr; ++fd) {
      fds.push_back({(*fd)->fd, (*fd)->events, 0});
    }
    libusb_free_pollfds(theirs);
  }
  return fds;
}

void LibusbBus::Run() {
  sync::TimeNs give_up = 0;
  std::vector<pollfd> fds;
  while (true) {
    const bool graves = Bury();
    {
      sync::MutexLock lock(graves_mutex_);
      if (stop_ && !graves) return;
      if (stop_ && give_up == 0) give_up = clock_.Now() + kGraveLimit;
      if (stop_ && clock_.Now() >= give_up) {
        // The kernel does not return them. They and their memory are leaked.
        for (std::unique_ptr<OpenDevice>& device : graves_) (void)device.release();
        graves_.clear();
        return;
      }
    }
    if (fds_changed_.exchange(false)) fds = PollFds();
    if (poll(fds.data(), fds.size(), graves ? kGraveIntervalMs : -1) < 0) {
      for (pollfd& fd : fds) fd.revents = 0;
    }
    if (fds[kPoke].revents != 0) {
      uint64_t pokes = 0;
      [[maybe_unused]] const ssize_t got = read(poke_, &pokes, sizeof(pokes));
    }
    if (fds[kNews].revents != 0 && watch_->TakeArrivals()) WakeAll(true);
    if (std::any_of(fds.begin() + kTheirs, fds.end(),
                    [](const pollfd& fd) { return fd.revents != 0; })) {
      timeval none{0, 0};
      libusb_handle_events_timeout_completed(context_->get(), &none, nullptr);
    }
    WakeDue();
  }
}

}  // namespace voxeld::display
