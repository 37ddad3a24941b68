#include "daemon/listen/peer.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/un.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace voxeld::daemon::listen {
namespace {

constexpr size_t kSubscriberPrefixBytes = 8;  // a subscriber usually has a /64
constexpr size_t kMappedBytes = 12;

std::string Number(int family, const void* bytes) {
  char text[INET6_ADDRSTRLEN] = {};
  return inet_ntop(family, bytes, text, sizeof(text)) == nullptr ? "" : text;
}

Peer Ipv4(const void* bytes, in_port_t port) {
  const std::string number = Number(AF_INET, bytes);
  return {absl::StrCat("ipv4:", number, ":", ntohs(port)), number, false};
}

Peer Ipv6(const sockaddr_in6& address) {
  const uint8_t* bytes = address.sin6_addr.s6_addr;
  if (IN6_IS_ADDR_V4MAPPED(&address.sin6_addr)) {
    return Ipv4(bytes + kMappedBytes, address.sin6_port);
  }
  in6_addr prefix = address.sin6_addr;
  std::fill(prefix.s6_addr + kSubscriberPrefixBytes, prefix.s6_addr + sizeof(prefix.s6_addr),
            uint8_t{0});
  const bool loopback = IN6_IS_ADDR_LOOPBACK(&address.sin6_addr);
  return {absl::StrCat("ipv6:[", Number(AF_INET6, bytes), "]:", ntohs(address.sin6_port)),
          loopback ? "::1" : absl::StrCat(Number(AF_INET6, &prefix), "/64"), false};
}

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

}  // namespace

Peer PeerOf(const sockaddr_storage& address, socklen_t length) {
  if (address.ss_family == AF_INET) {
    sockaddr_in v4;
    std::memcpy(&v4, &address, sizeof(v4));
    return Ipv4(&v4.sin_addr, v4.sin_port);
  }
  if (address.ss_family == AF_INET6) {
    sockaddr_in6 v6;
    std::memcpy(&v6, &address, sizeof(v6));
    return Ipv6(v6);
  }
  std::string name;
  if (length > offsetof(sockaddr_un, sun_path)) {
    const char* begin = reinterpret_cast<const char*>(&address) + offsetof(sockaddr_un, sun_path);
    name = absl::CHexEscape({begin, length - offsetof(sockaddr_un, sun_path)});
  }
  return {absl::StrCat("unix:", name), "", true};
}

std::string PeerName(std::string_view grpc_peer) {
  std::string out;
  for (size_t i = 0; i < grpc_peer.size(); ++i) {
    if (grpc_peer[i] == '%' && i + 2 < grpc_peer.size()) {
      const int high = HexDigit(grpc_peer[i + 1]), low = HexDigit(grpc_peer[i + 2]);
      if (high >= 0 && low >= 0) {
        out.push_back(static_cast<char>(high * 16 + low));
        i += 2;
        continue;
      }
    }
    out.push_back(grpc_peer[i]);
  }
  return out;
}

}  // namespace voxeld::daemon::listen
