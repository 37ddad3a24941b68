// Tests names of peers: gRPC's form, and the group with which a peer is counted.
#include "daemon/listen/peer.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/un.h>

#include <cctype>
#include <cstddef>
#include <cstring>
#include <string>

namespace voxeld::daemon::listen {
namespace {

Peer V4(const char* number, uint16_t port) {
  sockaddr_storage storage = {};
  auto* v4 = reinterpret_cast<sockaddr_in*>(&storage);
  v4->sin_family = AF_INET;
  v4->sin_port = htons(port);
  EXPECT_EQ(inet_pton(AF_INET, number, &v4->sin_addr), 1);
  return PeerOf(storage, sizeof(sockaddr_in));
}

Peer V6(const char* number, uint16_t port) {
  sockaddr_storage storage = {};
  auto* v6 = reinterpret_cast<sockaddr_in6*>(&storage);
  v6->sin6_family = AF_INET6;
  v6->sin6_port = htons(port);
  EXPECT_EQ(inet_pton(AF_INET6, number, &v6->sin6_addr), 1);
  return PeerOf(storage, sizeof(sockaddr_in6));
}

TEST(Peer, IsNamedAsGrpcNamesIt) {
  EXPECT_EQ(V4("192.0.2.7", 40000).name, PeerName("ipv4:192.0.2.7:40000"));
  EXPECT_EQ(V6("2001:db8::7", 40000).name, PeerName("ipv6:%5B2001:db8::7%5D:40000"));
  EXPECT_EQ(V6("::ffff:192.0.2.7", 40000).name, PeerName("ipv4:192.0.2.7:40000"));
}

TEST(Peer, AreCountedByNumberOrByAnIpv6Subscriber) {
  EXPECT_EQ(V4("192.0.2.7", 1).address, V4("192.0.2.7", 2).address);
  EXPECT_NE(V4("192.0.2.7", 1).address, V4("192.0.2.8", 1).address);
  EXPECT_EQ(V6("2001:db8:1:2::7", 1).address, V6("2001:db8:1:2:ffff::1", 2).address);
  EXPECT_NE(V6("2001:db8:1:2::7", 1).address, V6("2001:db8:1:3::7", 1).address);
  EXPECT_EQ(V6("::ffff:192.0.2.7", 1).address, V4("192.0.2.7", 1).address);
}

TEST(Peer, OfAUnixSocketHasTheNameThatItsClientGaveIt) {
  sockaddr_storage storage = {};
  auto* local = reinterpret_cast<sockaddr_un*>(&storage);
  local->sun_family = AF_UNIX;
  EXPECT_EQ(PeerOf(storage, sizeof(sa_family_t)).name, "unix:");
  std::memcpy(local->sun_path, "\0xy\n", 4);
  const Peer named = PeerOf(storage, offsetof(sockaddr_un, sun_path) + 4);
  EXPECT_EQ(named.name, "unix:\\x00xy\\n");
  EXPECT_TRUE(named.unix_socket);
}

TEST(Peer, TheMachineItselfIsCountedByItself) {
  EXPECT_EQ(V6("::1", 1).address, "::1");
  EXPECT_EQ(V6("::2", 1).address, "::/64");
  EXPECT_FALSE(V6("::1", 1).unix_socket);
  EXPECT_FALSE(V4("127.0.0.1", 1).unix_socket);
}

// RFC 3986, 2.1: two hexadecimal digits of either case.
TEST(Peer, EveryEncodedByteIsDecodedAndNothingElse) {
  for (int a = 1; a < 256; ++a) {
    for (int b = 1; b < 256; ++b) {
      const std::string text{'%', static_cast<char>(a), static_cast<char>(b)};
      if (std::isxdigit(a) != 0 && std::isxdigit(b) != 0) {
        const int byte = std::stoi(text.substr(1), nullptr, 16);
        EXPECT_EQ(PeerName(text + "x"), std::string(1, static_cast<char>(byte)) + "x") << text;
      } else {
        EXPECT_EQ(PeerName(text), text);
      }
    }
  }
}

TEST(Peer, NothingIsReadBehindTheName) {
  const std::string text = "%41%41";
  EXPECT_EQ(PeerName(std::string_view(text).substr(0, 1)), "%");
  EXPECT_EQ(PeerName(std::string_view(text).substr(0, 2)), "%4");
  EXPECT_EQ(PeerName(std::string_view(text).substr(0, 5)), "A%4");
  EXPECT_EQ(PeerName(text), "AA") << "the whole text";
}

TEST(Peer, NamesThatAreNoneStayAsTheyAre) {
  for (const char* text : {"", "%", "%5", "%zz", "ipv6:%5"}) EXPECT_EQ(PeerName(text), text);
}

}  // namespace
}  // namespace voxeld::daemon::listen
