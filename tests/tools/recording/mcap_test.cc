// Tests files as they are written and read; tests/e2e/check_mcap.js tests that other
// implementations can read them.
#include "tools/recording/mcap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>

#include "absl/strings/str_cat.h"
#include "tests/small_stack.h"
#include "tools/recording/mcap_bytes.h"

namespace voxeld::recording {
namespace {

using ::testing::HasSubstr;

struct Got {
  uint16_t channel;
  uint64_t time;
  std::string data;
  bool operator==(const Got&) const = default;
};

class McapTest : public ::testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }

  std::unique_ptr<McapWriter> Create() {
    auto writer = McapWriter::Create(path_, "test");
    EXPECT_TRUE(writer.ok()) << writer.status();
    const uint16_t schema = (*writer)->AddSchema({"Name", "protobuf", std::string("\0\xff", 2)});
    EXPECT_EQ((*writer)->AddChannel({schema, "a", "protobuf", {{"key", "value"}}}), 1);
    EXPECT_EQ((*writer)->AddChannel({0, "b", "json", {}}), 2);
    return *std::move(writer);
  }
  // Some of them compress well, some not at all.
  std::vector<Got> Fill(McapWriter& writer, int count, uint32_t seed = 1) {
    std::mt19937 random(seed);
    std::vector<Got> all;
    for (int i = 0; i < count; ++i) {
      std::string data(random() % 20'000, 'x');
      if (random() % 2 == 0) {
        for (char& c : data) c = static_cast<char>(random());
      }
      all.push_back(
          {static_cast<uint16_t>(1 + random() % 2), 1'000'000u + static_cast<uint64_t>(i), data});
      EXPECT_TRUE(writer
                      .Write({.channel = all.back().channel,
                              .sequence = static_cast<uint32_t>(i),
                              .log_time_ns = all.back().time,
                              .publish_time_ns = 7,
                              .data = all.back().data})
                      .ok());
    }
    return all;
  }
  absl::StatusOr<std::vector<Got>> ReadAll() {
    auto reader = McapReader::Open(path_);
    if (!reader.ok()) return reader.status();
    std::vector<Got> all;
    const absl::Status status = (*reader)->Read([&](const McapMessage& message) {
      all.push_back({message.channel, message.log_time_ns, std::string(message.data)});
      return true;
    });
    if (!status.ok()) return status;
    return all;
  }

  const std::string path_ = absl::StrCat(::testing::TempDir(), "/voxeld-", getpid(), ".mcap");
};

TEST_F(McapTest, HasAllThatWasWrittenInItsOrder) {
  auto writer = Create();
  const std::vector<Got> wrote = Fill(*writer, 500);
  ASSERT_TRUE(writer->Close().ok());
  EXPECT_EQ(writer->bytes(), std::filesystem::file_size(path_));
  const auto read = ReadAll();
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(*read, wrote);
  auto reader = McapReader::Open(path_);
  const auto summary = (*reader)->Summarise();
  ASSERT_TRUE(summary.ok());
  EXPECT_TRUE(summary->whole);
  EXPECT_EQ(summary->messages, 500u);
  EXPECT_GT(summary->chunks, 3u);
  EXPECT_EQ(summary->start_ns, 1'000'000u);
  EXPECT_EQ(summary->end_ns, 1'000'499u);
  EXPECT_EQ(summary->schemas.at(1).data, std::string("\0\xff", 2));
  EXPECT_EQ(summary->channels.at(1).metadata.at("key"), "value");
  EXPECT_EQ(summary->channels.at(2).topic, "b");
}

TEST_F(McapTest, WithoutMessagesIsAFileAsWell) {
  auto writer = Create();
  ASSERT_TRUE(writer->Close().ok());
  EXPECT_TRUE(ReadAll()->empty());
}

TEST_F(McapTest, WrittenBytesAreTheFormatsOwn) {
  auto writer = McapWriter::Create(path_, "me");
  ASSERT_TRUE(writer.ok());
  ASSERT_TRUE((*writer)->Close().ok());
  std::ifstream file(path_, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  // Magic; Header of an empty profile and a library.
  EXPECT_EQ(bytes.substr(0, 8), "\x89MCAP0\r\n");
  EXPECT_EQ(bytes.substr(8, 19), std::string("\x01\x0a\0\0\0\0\0\0\0\0\0\0\0\x02\0\0\0me", 19));
  EXPECT_EQ(bytes.substr(27, 9), std::string("\x0f\x04\0\0\0\0\0\0\0", 9));
  EXPECT_EQ(bytes.substr(bytes.size() - 8), "\x89MCAP0\r\n");
}

TEST_F(McapTest, CutOffAnywhereItHasItsWholeChunks) {
  auto writer = Create();
  std::vector<Got> wrote = Fill(*writer, 120);
  ASSERT_TRUE(writer->Flush().ok());
  const uint64_t flushed = writer->bytes();
  ASSERT_TRUE(writer->Close().ok());
  const uint64_t size = std::filesystem::file_size(path_);
  size_t before = wrote.size();
  for (uint64_t cut = size; cut > 8; cut -= std::min<uint64_t>(cut - 8, 4999)) {
    std::filesystem::resize_file(path_, cut);
    const auto read = ReadAll();
    ASSERT_TRUE(read.ok()) << cut << ": " << read.status();
    ASSERT_LE(read->size(), before);
    EXPECT_TRUE(std::equal(read->begin(), read->end(), wrote.begin()));
    if (cut >= flushed) {
      EXPECT_EQ(read->size(), wrote.size());
    }
    before = read->size();
  }
  EXPECT_EQ(before, 0u);
}

TEST_F(McapTest, DamageIsFoundAndSaysWhere) {
  auto writer = Create();
  Fill(*writer, 100);
  ASSERT_TRUE(writer->Close().ok());
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(5000).put('!');
  file.close();
  const auto read = ReadAll();
  EXPECT_TRUE(absl::IsDataLoss(read.status())) << read.status();
  EXPECT_THAT(std::string(read.status().message()), HasSubstr("is damaged at byte"));
}

// A stated size is trusted only as far as data exists.
TEST_F(McapTest, AChunkTakesNoMemoryForWhatIsNotThere) {
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  for (const uint64_t size : {uint64_t{1}, uint64_t{3} << 30}) {
    McapBytes chunk;
    // An empty zstd frame, which states that there are `size` bytes.
    chunk.Number(uint64_t{0}).Number(uint64_t{0}).Number(size).Number(uint32_t{0}).Text("zstd");
    const std::string frame("\x28\xb5\x2f\xfd\x20\x00\x01\x00\x00", 9);
    chunk.Number(uint64_t{frame.size()}).Raw(frame);
    std::ofstream(path_, std::ios::binary) << kMcapMagic << chunk.Record(kChunk);
    auto reader = McapReader::Open(path_);
    ASSERT_TRUE(reader.ok()) << reader.status();
#ifndef VOXELD_SANITIZED
    rlimit small = before;  // gigabytes of memory are not available
    small.rlim_cur = rlim_t{2} << 30;
    ASSERT_EQ(setrlimit(RLIMIT_AS, &small), 0);
#endif
    const absl::Status status = (*reader)->Summarise().status();
    ASSERT_EQ(setrlimit(RLIMIT_AS, &before), 0);
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("cannot be unpacked"));
  }
}

TEST_F(McapTest, AChunkPackedOtherwiseSaysHowInPrintableText) {
  McapBytes chunk;
  chunk.Number(uint64_t{0}).Number(uint64_t{0}).Number(uint64_t{0}).Number(uint32_t{0});
  chunk.Text("l\x1bz").Number(uint64_t{0});
  std::ofstream(path_, std::ios::binary) << kMcapMagic << chunk.Record(kChunk);
  auto reader = McapReader::Open(path_);
  ASSERT_TRUE(reader.ok()) << reader.status();
  const absl::Status status = (*reader)->Summarise().status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(status.message()), HasSubstr("packed by \"l\\x1bz\"; zstd and none"));
}

// A chunk holds schemas, channels and messages, never another chunk.
TEST_F(McapTest, NestedChunksAreRejectedWithoutStackOverflow) {
  for (const int depth : {1, 2, 3, 10, 100, 1'000}) {
    std::string inside;
    for (int i = 0; i < depth; ++i) {
      McapBytes chunk;
      chunk.Number(uint64_t{0}).Number(uint64_t{0}).Number(uint64_t{inside.size()});
      chunk.Number(uint32_t{0}).Text("").Number(uint64_t{inside.size()}).Raw(inside);
      inside = chunk.Record(kChunk);
    }
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << kMcapMagic << inside;
    absl::Status status;
    OnSmallStack([&] {
      auto reader = McapReader::Open(path_);
      status = reader.ok() ? (*reader)->Summarise().status() : reader.status();
    });
    EXPECT_EQ(status.code(), depth == 1 ? absl::StatusCode::kOk : absl::StatusCode::kDataLoss)
        << depth << ": " << status;
  }
}

TEST_F(McapTest, WhatIsNoneSaysSo) {
  EXPECT_TRUE(absl::IsNotFound(McapReader::Open(path_).status()));
  std::ofstream(path_) << "something else";
  EXPECT_THAT(std::string(McapReader::Open(path_).status().message()),
              HasSubstr("is no MCAP file"));
  EXPECT_TRUE(absl::IsAlreadyExists(McapWriter::Create(path_, "").status()))
      << "nothing is overwritten";
}

TEST_F(McapTest, RandomBytesHurtNobody) {
  auto writer = Create();
  Fill(*writer, 30);
  ASSERT_TRUE(writer->Close().ok());
  std::ifstream file(path_, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  std::mt19937 random(3);
  for (int i = 0; i < 300; ++i) {
    std::string bad = good;
    for (int n = 0; n < 4; ++n) bad[8 + random() % (bad.size() - 8)] = static_cast<char>(random());
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bad;
    (void)ReadAll();  // an error or not
  }
}

TEST_F(McapTest, AFullDiskIsAnErrorAndWhatWasThereCanBeRead) {
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  auto writer = Create();
  const std::vector<Got> wrote = Fill(*writer, 50);
  ASSERT_TRUE(writer->Flush().ok());
  rlimit small = before;
  small.rlim_cur = writer->bytes() + 20;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  ASSERT_TRUE(writer->Write({.channel = 1, .log_time_ns = 5, .data = std::string(5000, 'y')}).ok());
  EXPECT_FALSE(writer->Flush().ok());
  EXPECT_FALSE(writer->Write({.channel = 1, .data = "more"}).ok());
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  const auto read = ReadAll();
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(*read, wrote);
}

}  // namespace
}  // namespace voxeld::recording
