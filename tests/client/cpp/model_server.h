// A server that applies what an outbox sends it, and transactions to send.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"
#include "client/cpp/src/outbox.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {

// The server's end of successive streams: it decodes with protobuf, and applies whole commits.
class ModelServer {
 public:
  void Lose() {
    staged_.clear();
    frame_.reset();
  }

  // Returns the commit id if it was a Commit.
  std::optional<uint64_t> Take(const Rope& message) {
    v1::StreamRequest request;
    EXPECT_TRUE(request.ParseFromString(message.Flat()));
    EXPECT_GT(request.sequence(), last_sequence);
    last_sequence = request.sequence();
    if (request.has_commit()) {
      EXPECT_FALSE(frame_.has_value()) << "a commit within a frame";
      for (const auto& apply : staged_) apply();
      staged_.clear();
      client_drops += request.commit().client_drops();
      commits.push_back(request.commit().frame_id());
      last_commit = request.sequence();
      return commits.back();
    }
    if (request.has_frame_begin()) {
      EXPECT_FALSE(frame_.has_value());
      frame_.emplace(request.frame_begin().layer(), std::set<std::string>());
    } else if (request.has_frame_end()) {
      EXPECT_TRUE(frame_.has_value());
      staged_.push_back([this, frame = *frame_] {
        layers[frame.first] = frame.second;
        ++frames_applied;
      });
      frame_.reset();
    } else if (request.has_batch()) {
      for (const v1::Upsert& upsert : request.batch().upserts()) {
        if (frame_.has_value()) {
          EXPECT_EQ(upsert.layer(), frame_->first);
          frame_->second.insert(upsert.id());
        } else {
          staged_.push_back([this, upsert] { retained.push_back(upsert.id()); });
        }
      }
    } else {
      ADD_FAILURE() << request.DebugString();
    }
    return std::nullopt;
  }

  uint64_t last_sequence = 0, last_commit = 0, client_drops = 0, frames_applied = 0;
  std::vector<uint64_t> commits;
  std::vector<std::string> retained;  // in the order of application
  std::map<std::string, std::set<std::string>> layers;

 private:
  std::vector<std::function<void()>> staged_;
  std::optional<std::pair<std::string, std::set<std::string>>> frame_;
};

inline UpsertOperation UpsertOf(const std::string& layer, const std::string& id, size_t vertices) {
  return {.layer = layer,
          .id = id,
          .primitive = *EncodePrimitive(
              Points{.vertices = {.positions = std::vector<float>(vertices * 3)}}, {}),
          .label = {}};
}

inline std::shared_ptr<Transaction> Retained(uint64_t frame, const std::string& id,
                                             size_t vertices = 1) {
  auto transaction = MakeTransaction({UpsertOf("kept", id, vertices)}, {});
  transaction->frame_id = frame;
  return transaction;
}

inline std::shared_ptr<Transaction> FrameOf(uint64_t frame, const std::string& layer,
                                            size_t vertices = 1) {
  auto transaction = MakeTransaction(
      {FrameOperation{layer, {UpsertOf(layer, absl::StrCat("f", frame), vertices)}}}, {});
  transaction->frame_id = frame;
  return transaction;
}

inline std::vector<uint64_t> Drain(Outbox* outbox, ModelServer* server) {
  std::vector<uint64_t> committed;
  while (auto next = outbox->Next(0)) {
    if (const auto frame = server->Take(next->message)) committed.push_back(*frame);
  }
  return committed;
}

}  // namespace voxeld::client
