#include "tests/display/drivers/network/heard.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <utility>

#include "display/drivers/network/link.h"
#include "display/drivers/network/network.h"

namespace voxeld::display::network {
namespace {

// A link, and the socket at its other end. The kernel drops packets that are not read.
class HeardLink final : public Link {
 public:
  HeardLink() : fd_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address));
    socklen_t size = sizeof(address);
    getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    link_ = MakeUdpLink({"127.0.0.1", ntohs(address.sin_port)});
  }
  ~HeardLink() override { close(fd_); }
  HeardLink(const HeardLink&) = delete;
  HeardLink& operator=(const HeardLink&) = delete;

  absl::Status Open() override { return link_->Open(); }
  void Close() override { link_->Close(); }
  absl::StatusOr<State> Poll() override { return link_->Poll(); }
  absl::StatusOr<size_t> Send(std::span<const std::byte> bytes) override {
    return link_->Send(bytes);
  }
  void SetWake(std::function<void()> wake) override { link_->SetWake(std::move(wake)); }

 private:
  int fd_;
  std::unique_ptr<Link> link_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> CreateHeard(const DisplayOptions& options,
                                                     sync::Clock& clock) {
  return CreateOver(options, clock, [](Protocol, const Endpoint&) -> std::unique_ptr<Link> {
    return std::make_unique<HeardLink>();
  });
}

}  // namespace voxeld::display::network
