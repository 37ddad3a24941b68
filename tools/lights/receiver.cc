#include "tools/lights/receiver.h"

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/address/address.h"

namespace voxeld::lights {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using asio::ip::udp;
using boost::system::error_code;

constexpr size_t kReadBytes = size_t{64} << 10;
constexpr int kReceiveBuffer = 4 << 20;  // for datagrams that wait in the kernel
constexpr int kDatagramsATurn = 256;
constexpr int kHandlersATurn =
    64;  // a limit, so that a continuous sender does not keep pictures from being shown
constexpr auto kAcceptRetry = std::chrono::milliseconds(100);
constexpr int32_t kMostGroups = 256;

absl::Status Failed(const std::string& address, const error_code& error) {
  return absl::UnavailableError(absl::StrCat("cannot listen on ", address, ": ", error.message()));
}

}  // namespace

class Receiver::Impl {
 public:
  Impl(const ReceiverOptions& options, const IntakeOptions& lights, Intake& intake,
       sync::Clock& clock)
      : options_(options), lights_(lights), intake_(intake), clock_(clock) {}

  absl::Status Open() {
    const absl::StatusOr<daemon::Address> wanted = daemon::ParseAddress(options_.listen);
    if (!wanted.ok()) return wanted.status();
    error_code error;
    const asio::ip::address host = asio::ip::make_address(wanted->host, error);
    if (error || wanted->unix_socket || wanted->tls) {
      return absl::InvalidArgumentError(
          absl::StrCat("\"", options_.listen, "\" is no address in numbers and a port, such as ",
                       "127.0.0.1:", DefaultPort(), " or 0.0.0.0:", DefaultPort()));
    }
    return lights_.protocol == Protocol::kOpc ? Listen(tcp::endpoint(host, wanted->port))
                                              : Bind(udp::endpoint(host, wanted->port));
  }

  std::string address() const { return address_; }
  ReceiverTally tally() const {
    ReceiverTally tally = tally_;
    tally.open = peers_.size();
    return tally;
  }

  void Run(sync::TimeNs limit_ns) {
    io_.restart();
    int ran = 0;
    while (ran < kHandlersATurn && io_.poll_one() != 0) ++ran;
    if (ran != 0) return;
    io_.restart();
    io_.run_one_for(std::chrono::nanoseconds(limit_ns));
  }
  void Wake() {
    asio::post(io_, [] {});
  }

 private:
  struct Peer {
    explicit Peer(tcp::socket socket) : socket(std::move(socket)) {}
    tcp::socket socket;
    OpcReader reader;
    std::vector<uint8_t> bytes = std::vector<uint8_t>(kReadBytes);
  };

  uint16_t DefaultPort() const {
    switch (lights_.protocol) {
      case Protocol::kDdp:
        return display::network::ddp::kPort;
      case Protocol::kE131:
        return display::network::e131::kPort;
      case Protocol::kArtNet:
        return display::network::artnet::kPort;
      case Protocol::kOpc:
        break;
    }
    return display::network::opc::kPort;
  }

  // ------------------------------------------------------------------------------------- streams

  absl::Status Listen(const tcp::endpoint& at) {
    error_code error;
    acceptor_.open(at.protocol(), error);
    if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
    if (!error) acceptor_.bind(at, error);
    if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error) return Failed(options_.listen, error);
    address_ = Text(acceptor_.local_endpoint(error));
    Accept();
    return absl::OkStatus();
  }

  void Accept() {
    acceptor_.async_accept([this](const error_code& error, tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (error) {  // no descriptors or no memory: this may be temporary
        retry_.expires_after(kAcceptRetry);
        retry_.async_wait([this](const error_code& stopped) {
          if (!stopped) Accept();
        });
        return;
      }
      ++tally_.connections;
      if (peers_.size() < options_.most_connections) {
        Read(*peers_.insert(std::make_unique<Peer>(std::move(socket))).first->get());
      } else {
        ++tally_.refused;
      }
      Accept();
    });
  }

  void Read(Peer& peer) {
    peer.socket.async_read_some(
        asio::buffer(peer.bytes), [this, &peer](const error_code& error, size_t count) {
          if (error == asio::error::operation_aborted) return;
          if (error) {
            if (peer.reader.amid()) ++tally_.cut_off;
            peers_.erase(std::find_if(peers_.begin(), peers_.end(),
                                      [&peer](const auto& other) { return other.get() == &peer; }));
            return;
          }
          const sync::TimeNs now = clock_.Now();
          peer.reader.Add(
              std::span(peer.bytes).first(count),
              [this, now](const OpcReader::Message& message) { intake_.AddMessage(message, now); });
          Read(peer);
        });
  }

  // ----------------------------------------------------------------------------------- datagrams

  absl::Status Bind(const udp::endpoint& at) {
    error_code error;
    socket_.open(at.protocol(), error);
    // Several processes on this machine may join the same groups, and answers to polls go to one
    // port.
    if (!error && (options_.multicast || at.address().is_multicast())) {
      socket_.set_option(udp::socket::reuse_address(true), error);
    }
    if (!error) socket_.bind(at, error);
    if (error) return Failed(options_.listen, error);
    socket_.set_option(udp::socket::receive_buffer_size(kReceiveBuffer), error);
    socket_.non_blocking(true, error);
    if (error) return Failed(options_.listen, error);
    local_ = socket_.local_endpoint(error);
    address_ = Text(local_);
    if (lights_.protocol == Protocol::kE131 && options_.multicast) JoinGroups();
    datagram_.resize(kMostDatagram);
    Wait();
    return absl::OkStatus();
  }

  void JoinGroups() {
    for (int32_t i = 0; i < std::min(UniversesOf(lights_), kMostGroups); ++i) {
      const auto universe = static_cast<uint32_t>(lights_.first_universe + i);
      error_code error;
      socket_.set_option(
          asio::ip::multicast::join_group(asio::ip::address_v4(0xEFFF0000U | (universe & 0xFFFF))),
          error);
      if (!error) ++tally_.groups;
    }
  }

  void Wait() {
    socket_.async_wait(udp::socket::wait_read, [this](const error_code& error) {
      if (error == asio::error::operation_aborted) return;
      for (int i = 0; i < kDatagramsATurn && TakeDatagram(); ++i) {
      }
      Wait();
    });
  }

  bool TakeDatagram() {
    udp::endpoint from;
    error_code error;
    const size_t count = socket_.receive_from(asio::buffer(datagram_), from, 0, error);
    if (error) return false;
    const absl::StatusOr<Datagram> read =
        intake_.AddDatagram(std::span<const uint8_t>(datagram_).first(count), clock_.Now());
    if (read.ok() && read->kind == Datagram::Kind::kAsk) Answer(from);
    return true;
  }

  void Answer(const udp::endpoint& to) {
    std::array<uint8_t, 4> ip{};
    if (local_.address().is_v4()) ip = local_.address().to_v4().to_bytes();
    const auto reply =
        ArtPollReply(ip, local_.port(), lights_.first_universe, UniversesOf(lights_));
    error_code error;
    socket_.send_to(asio::buffer(reply), to, 0, error);  // the peer will ask again
  }

  template <typename Endpoint>
  static std::string Text(const Endpoint& at) {
    const std::string host = at.address().to_string();
    return absl::StrCat(at.address().is_v6() ? absl::StrCat("[", host, "]") : host, ":", at.port());
  }

  const ReceiverOptions options_;
  const IntakeOptions lights_;
  Intake& intake_;
  sync::Clock& clock_;
  ReceiverTally tally_;
  std::string address_;
  udp::endpoint local_;
  std::vector<uint8_t> datagram_;
  asio::io_context io_{1};
  tcp::acceptor acceptor_{io_};
  asio::steady_timer retry_{io_};
  udp::socket socket_{io_};
  std::set<std::unique_ptr<Peer>> peers_;
};

Receiver::Receiver(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Receiver::~Receiver() = default;

absl::StatusOr<std::unique_ptr<Receiver>> Receiver::Open(const ReceiverOptions& options,
                                                         const IntakeOptions& lights,
                                                         Intake& intake, sync::Clock& clock) {
  auto impl = std::make_unique<Impl>(options, lights, intake, clock);
  if (absl::Status opened = impl->Open(); !opened.ok()) return opened;
  return std::unique_ptr<Receiver>(new Receiver(std::move(impl)));
}

std::string Receiver::address() const { return impl_->address(); }
ReceiverTally Receiver::tally() const { return impl_->tally(); }
void Receiver::Run(sync::TimeNs limit_ns) { impl_->Run(limit_ns); }
void Receiver::Wake() { impl_->Wake(); }

}  // namespace voxeld::lights
