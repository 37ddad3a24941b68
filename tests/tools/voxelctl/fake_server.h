// A server with a minimal implementation of both services: it records what it is sent, and can be
// made to misbehave.
#pragma once

#include <grpcpp/server.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "display/sync/mutex.h"
#include "voxeld/v1/display.grpc.pb.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::voxelctl {

class FakeServer final {
 public:
  // Listens on a Unix socket at `path`.
  explicit FakeServer(const std::string& path);
  ~FakeServer();

  std::string address() const { return address_; }

  // Set before the calls to which they apply.
  struct Behaviour {
    std::string refuse_commits_with;  // if not empty, every commit is refused, with an issue
    bool note_commits = false;        // every commit has an issue that is not a refusal
    bool lose_entities = false;       // SetTransform is answered by an Issue NOT_FOUND
    bool no_outcomes = false;         // outcomes stay outstanding forever
    bool short_volume = false;        // CaptureVolume leaves out its last slice
    bool hold_streams = false;        // a stream is not ended when its client is done
    bool behind = false;              // no volume ever shows the newest snapshot
    bool no_watches = false;          // all scene watches are in use
    bool lattice = false;             // the display has two slices of three lights, one absent
  };
  void Set(const Behaviour& behaviour);

  struct Log {
    std::map<std::string, v1::Object> objects;
    std::map<std::string, v1::Entity> entities;  // the present entities, by id
    std::vector<v1::Open> opens;
    uint64_t commits = 0, transforms = 0, largest_message = 0, most_unanswered = 0;
    std::vector<v1::ClearLayerRequest> clears;
    std::vector<v1::UpdateDisplayRequest> updates;
    std::vector<v1::CaptureVolumeRequest> captures;
    bool deleted_all_mine = false;
  };
  Log log() const;

 private:
  class Scene;
  class Display;

  mutable sync::Mutex mutex_;
  Behaviour behaviour_ VOXELD_GUARDED_BY(mutex_);
  Log log_ VOXELD_GUARDED_BY(mutex_);
  sync::CondVar closing_changed_;
  bool closing_ VOXELD_GUARDED_BY(mutex_) = false;  // streams that are held end now
  std::string address_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<Display> display_;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace voxeld::voxelctl
