// Tests which bytes are the beginning of a call. Frames are written out by hand here.
#include "daemon/listen/greeting.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <string_view>

namespace voxeld::daemon::listen {
namespace {

using ::testing::HasSubstr;
using Verdict = Greeting::Verdict;

constexpr uint64_t kMostMessage = 48u << 10;
const std::string kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

std::string Frame(int type, int flags, uint32_t stream, const std::string& payload) {
  const auto byte = [](size_t value) { return static_cast<char>(value & 0xff); };
  std::string out = {byte(payload.size() >> 16), byte(payload.size() >> 8), byte(payload.size()),
                     byte(static_cast<size_t>(type)), byte(static_cast<size_t>(flags))};
  for (const int shift : {24, 16, 8, 0}) out.push_back(byte(stream >> shift));
  return out + payload;
}

std::string Message(uint32_t size) {
  std::string out(1, '\0');
  for (const int shift : {24, 16, 8, 0}) out.push_back(static_cast<char>(size >> shift));
  return out + std::string(size, 'm');
}

const std::string kSettings = Frame(4, 0, 0, ""), kAck = Frame(4, 1, 0, "");
const std::string kHeaders = Frame(1, 4, 1, std::string(200, 'h'));
const std::string kBegin = kPreface + kSettings;

struct Read {
  Verdict verdict = Verdict::kMore;
  size_t decided_at = 0;  // the number of bytes at the decision
  std::string why;
};

// Passes the bytes `step` at a time, and asks only when it says that it wants to be asked.
Read Drip(const std::string& bytes, size_t step) {
  Greeting greeting(kMostMessage);
  Read out;
  for (size_t n = step; out.verdict == Verdict::kMore; n += step) {
    n = std::min(n, bytes.size());
    if (n >= greeting.needed()) {
      out.verdict = greeting.Read(std::string_view(bytes).substr(0, n));
      out.decided_at = n;
    }
    if (n == bytes.size()) break;
  }
  out.why = greeting.why();
  return out;
}

TEST(Greeting, IsACallAsSoonAsTheLengthOfItsMessageIsThereHoweverItComes) {
  const std::string head = kBegin + Frame(8, 0, 0, "\1\1\1\1") + kAck + Frame(6, 0, 0, "12345678") +
                           kHeaders + Frame(0xbe, 0, 0, "grease");
  const std::string whole = head + Frame(0, 1, 1, Message(1000));
  for (size_t step = 1; step < 40; ++step) {
    const Read read = Drip(whole, step);
    EXPECT_EQ(read.verdict, Verdict::kCall) << read.why;
    EXPECT_GE(read.decided_at, head.size() + 9 + 5);
    EXPECT_LT(read.decided_at, head.size() + 9 + 5 + step);
  }
  EXPECT_EQ(Drip(whole, whole.size()).verdict, Verdict::kCall);
}

TEST(Greeting, MayHaveItsMessageInManyFramesAndWithPadding) {
  std::string bytes = kBegin + kHeaders;
  for (const char one : Message(0)) bytes += Frame(0, 0, 1, std::string(1, one));
  EXPECT_EQ(Drip(bytes, 1).verdict, Verdict::kCall);
  const std::string padded = kBegin + kHeaders +
                             Frame(0, 8, 1, "\x02" + Message(3).substr(0, 3) + "pp") +
                             Frame(0, 9, 1, "\x03" + Message(3).substr(3) + "ppp");
  EXPECT_EQ(Drip(padded, 1).verdict, Verdict::kCall);
}

TEST(Greeting, WithoutAMessageIsGrpcsToRefuse) {
  EXPECT_EQ(Drip(kBegin + Frame(1, 5, 1, "hh"), 1).verdict, Verdict::kCall);
  EXPECT_EQ(Drip(kBegin + kHeaders + Frame(0, 1, 1, "abc"), 1).verdict, Verdict::kCall);
}

TEST(Greeting, WaitsForWhatIsYetToCome) {
  const std::string whole = kBegin + kHeaders + Frame(0, 0, 1, Message(10));
  for (size_t n = 0; n < kBegin.size() + kHeaders.size() + 9 + 5; ++n) {
    Greeting greeting(kMostMessage);
    ASSERT_EQ(greeting.Read(std::string_view(whole).substr(0, n)), Verdict::kMore) << n;
    EXPECT_GT(greeting.needed(), n) << "otherwise it would be asked again for nothing";
    EXPECT_EQ(greeting.speaks_http2(), n >= kPreface.size());
  }
}

TEST(Greeting, ThatIsNoneIsSeenAtTheFirstWrongByte) {
  const Read http1 = Drip("GET / HTTP/1.1\r\n", 1);
  EXPECT_EQ(http1.verdict, Verdict::kWrong);
  EXPECT_EQ(http1.decided_at, 1u);
  EXPECT_THAT(http1.why, HasSubstr("begins with \"G\""));
  EXPECT_EQ(Drip("\x16\x03\x01", 1).verdict, Verdict::kWrong);
  for (const std::string& first : {kAck, kHeaders, Frame(0, 0, 1, ""), Frame(9, 0, 1, "")}) {
    EXPECT_EQ(Drip(kPreface + first, 1).verdict, Verdict::kWrong);
  }
}

TEST(Greeting, WhoseHeadersDoNotEndIsWrong) {
  const Read read = Drip(kBegin + Frame(1, 0, 1, "hh"), 1);
  EXPECT_EQ(read.verdict, Verdict::kWrong);
  EXPECT_THAT(read.why, HasSubstr("in one"));
  EXPECT_EQ(Drip(kBegin + Frame(9, 4, 1, "hh"), 1).verdict, Verdict::kWrong);
}

TEST(Greeting, WhoseHeadersAreHugeIsWrongBeforeTheyCome) {
  const std::string begin = kBegin + Frame(1, 4, 1, std::string(Greeting::kMostBytes, 'h'));
  const Read read = Drip(begin, 1);
  EXPECT_EQ(read.verdict, Verdict::kWrong);
  EXPECT_EQ(read.decided_at, kBegin.size() + 9);
}

TEST(Greeting, WhoseFirstMessageIsTooGreatIsWrongBeforeItComes) {
  const std::string begin = kBegin + kHeaders;
  const Read most = Drip(begin + Frame(0, 0, 1, Message(kMostMessage).substr(0, 100)), 1);
  EXPECT_EQ(most.verdict, Verdict::kCall);
  const Read read = Drip(begin + Frame(0, 0, 1, Message(kMostMessage + 1).substr(0, 100)), 1);
  EXPECT_EQ(read.verdict, Verdict::kWrong);
  EXPECT_EQ(read.decided_at, begin.size() + 9 + 5);
  EXPECT_THAT(read.why, HasSubstr("49153 bytes"));
  EXPECT_THAT(read.why, HasSubstr("first call is at most 48 KiB"));
}

TEST(Greeting, WithoutEndIsWrong) {
  std::string resets = kBegin, acks = kBegin, settings = kBegin;
  for (uint32_t stream = 1; resets.size() < 64u << 10; stream += 2) {
    resets += Frame(1, 4, stream, "hh") + Frame(3, 0, stream, "\0\0\0\x08");
    acks += kAck;
    settings += kSettings;
  }
  for (const std::string* bytes : {&resets, &acks, &settings}) {
    const Read read = Drip(*bytes, 7);
    EXPECT_EQ(read.verdict, Verdict::kWrong);
    EXPECT_LE(read.decided_at, Greeting::kMostBytes + 7);
  }
}

TEST(Greeting, DataOfACallThatIsNoneIsWrong) {
  EXPECT_EQ(Drip(kBegin + Frame(0, 0, 1, "x"), 1).verdict, Verdict::kWrong);
  EXPECT_EQ(Drip(kBegin + kHeaders + Frame(3, 0, 1, "\0\0\0\x08") + Frame(0, 0, 1, "x"), 1).verdict,
            Verdict::kWrong);
  EXPECT_EQ(Drip(kBegin + kHeaders + Frame(0, 8, 1, "\x05x"), 1).verdict, Verdict::kWrong);
}

// For random bytes: it decides within its limit, and asks for more than it has.
TEST(Greeting, OfGarbageComesToAnEnd) {
  std::mt19937 random(7);
  for (int round = 0; round < 2'000; ++round) {
    std::string bytes = kBegin;
    while (bytes.size() < Greeting::kMostBytes + 100) {
      const auto frame =
          Frame(static_cast<int>(random() % 12), static_cast<int>(random() % 16), random() % 4,
                std::string(random() % 30, static_cast<char>(random())));
      bytes += random() % 64 == 0 ? frame.substr(random() % frame.size()) : frame;
    }
    Greeting greeting(kMostMessage);
    size_t n = 0;
    Verdict verdict = Verdict::kMore;
    while (verdict == Verdict::kMore) {
      ASSERT_GT(greeting.needed(), n);
      n = greeting.needed();
      ASSERT_LE(n, Greeting::kMostBytes);
      verdict = greeting.Read(std::string_view(bytes).substr(0, n));
    }
    ASSERT_EQ(verdict == Verdict::kWrong, !greeting.why().empty());
  }
}

// Returns a ClientHello of `size` bytes in one record (RFC 8446, 4.1.2 and 5.1), with arbitrary
// content.
std::string Hello(size_t size) {
  const auto byte = [](size_t value) { return static_cast<char>(value & 0xff); };
  return std::string("\x16\x03\x01") + byte((size + 4) >> 8) + byte(size + 4) + "\x01" +
         byte(size >> 16) + byte(size >> 8) + byte(size) + std::string(size, 'x');
}

Read DripTls(const std::string& bytes, size_t step) {
  Greeting greeting(kMostMessage);
  Read out;
  for (size_t n = step; out.verdict == Verdict::kMore; n += step) {
    n = std::min(n, bytes.size());
    if (n >= greeting.needed())
      out.verdict = greeting.ReadTls(std::string_view(bytes).substr(0, n));
    out.decided_at = n;
    if (n == bytes.size()) break;
  }
  out.why = greeting.why();
  return out;
}

TEST(TlsGreeting, IsOneWholeClientHello) {
  for (const size_t size : {40u, 517u, 1500u, 11000u}) {
    const std::string hello = Hello(size);
    for (const size_t step : {size_t{1}, size_t{7}, hello.size()}) {
      const Read read = DripTls(hello, step);
      EXPECT_EQ(read.verdict, Verdict::kCall) << size << " " << step << read.why;
      EXPECT_EQ(read.decided_at, hello.size());
    }
    EXPECT_EQ(DripTls(hello.substr(0, hello.size() - 1), 1).verdict, Verdict::kMore);
  }
}

TEST(TlsGreeting, AnythingElseIsWrongAsSoonAsItIs) {
  EXPECT_THAT(DripTls(kBegin, 1).why, HasSubstr("speaks TLS"));
  EXPECT_EQ(DripTls(kBegin, 1).decided_at, 1u);
  EXPECT_THAT(DripTls("GET / HTTP/1.1\r\n", 4).why, HasSubstr("GET"));
  std::string server = Hello(100);
  server[5] = 2;
  EXPECT_EQ(DripTls(server, 1).verdict, Verdict::kWrong);
  std::string cut = Hello(100);
  cut[8] = 101;  // it continues in another record
  EXPECT_EQ(DripTls(cut, 1).verdict, Verdict::kWrong);
  EXPECT_THAT(Drip(Hello(100), 1).why, HasSubstr("without TLS"));
}

TEST(TlsGreeting, OneThatNeverEndsIsNotWaitedFor) {
  Greeting greeting(kMostMessage);
  const std::string hello = Hello(16000);
  EXPECT_NE(greeting.ReadTls(hello), Verdict::kCall);
}

}  // namespace
}  // namespace voxeld::daemon::listen
