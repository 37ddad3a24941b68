#include "tests/tools/voxelctl/fake_server.h"

#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>

#include <algorithm>
#include <utility>

namespace voxeld::voxelctl {
namespace {

constexpr int kSide = 16;
constexpr const char* kDisplay = "fake";
constexpr uint64_t kOwner = 42;

// A cube of 16 horizontal slices; 8 voxels a scene unit, with the scene's origin in its middle.
void FillGeometry(v1::Geometry* geometry) {
  v1::PlanarStack* stack = geometry->mutable_planar_stack();
  stack->set_width_px(kSide);
  stack->set_height_px(kSide);
  stack->set_pitch_u_mm(1);
  stack->set_pitch_v_mm(1);
  stack->set_thickness_mm(1);
  for (int i = 0; i < kSide; ++i) stack->add_positions_mm(i + 0.5 - kSide / 2.0);
  v1::VoxelGrid* grid = geometry->mutable_grid();
  grid->set_nx(kSide);
  grid->set_ny(kSide);
  grid->set_nz(kSide);
  for (const auto& [vector, value] : {std::pair(grid->mutable_pitch_mm(), 1.0),
                                      std::pair(grid->mutable_origin_mm(), -kSide / 2.0)}) {
    vector->set_x(value);
    vector->set_y(value);
    vector->set_z(value);
  }
}

// Two slices of three lights, of which one is missing, in a row along x.
void FillLattice(v1::Geometry* geometry) {
  v1::Lattice* lattice = geometry->mutable_lattice();
  lattice->set_width_px(3);
  lattice->set_slices(2);
  for (const uint32_t pixel : {0u, 1u, 3u, 4u, 5u}) {
    lattice->add_pixels(pixel);
    lattice->add_x_mm(pixel - kSide / 2.0 + 0.5);
    lattice->add_y_mm(0.5);
    lattice->add_z_mm(0.5);
  }
  *lattice->mutable_cell_mm() = geometry->grid().pitch_mm();
}

void FillDisplay(v1::TestPattern pattern, v1::DisplayDescription* display) {
  display->set_name(kDisplay);
  display->set_driver("none\x1b");
  display->set_state(v1::DISPLAY_STATE_SHOWING);
  display->set_test_pattern(pattern);
  FillGeometry(display->mutable_geometry());
  for (const double value : {8., 0., 0., 8., 0., 8., 0., 8., 0., 0., 8., 8.})
    display->mutable_scene_to_voxel()->add_m(value);
}

}  // namespace

class FakeServer::Scene final : public v1::SceneService::Service {
 public:
  explicit Scene(FakeServer& server) : server_(server) {}

  grpc::Status Stream(
      grpc::ServerContext*,
      grpc::ServerReaderWriter<v1::StreamResponse, v1::StreamRequest>* stream) override {
    v1::StreamRequest request;
    std::map<std::string, v1::Object> objects;
    std::map<std::string, v1::Entity> entities;
    bool replace = false;
    while (stream->Read(&request)) {
      v1::StreamResponse response;
      sync::MutexLock lock(server_.mutex_);
      Log& log = server_.log_;
      log.largest_message = std::max<uint64_t>(log.largest_message, request.ByteSizeLong());
      switch (request.op_case()) {
        case v1::StreamRequest::kOpen:
          log.opens.push_back(request.open());
          response.mutable_opened()->set_owner(kOwner);
          response.mutable_opened()->add_displays(kDisplay);
          response.mutable_opened()->mutable_limits()->set_max_message_bytes(256 << 10);
          response.mutable_opened()->mutable_limits()->set_max_uncommitted_bytes(1 << 20);
          stream->Write(response);
          break;
        case v1::StreamRequest::kDefineObject:
          objects[request.define_object().object()] = request.define_object().definition();
          break;
        case v1::StreamRequest::kFrameBegin:
          replace = true;
          break;
        case v1::StreamRequest::kUpsert:
          entities[request.upsert().id()] = request.upsert().entity();
          break;
        case v1::StreamRequest::kBatch:
          for (const v1::Upsert& upsert : request.batch().upserts())
            entities[upsert.id()] = upsert.entity();
          break;
        case v1::StreamRequest::kSetTransform:
          ++log.transforms;
          if (server_.behaviour_.lose_entities) {
            v1::Issue* issue = response.add_issues();
            issue->set_reason(v1::REASON_NOT_FOUND);
            issue->set_id(request.set_transform().id());
            stream->Write(response);
          }
          break;
        case v1::StreamRequest::kDelete:
          log.deleted_all_mine = log.deleted_all_mine || request.delete_().all_mine();
          log.entities.clear();
          break;
        case v1::StreamRequest::kCommit:
          ++log.commits;
          if (server_.behaviour_.refuse_commits_with.empty()) {
            for (const auto& [name, object] : objects) log.objects[name] = object;
            if (replace) log.entities.clear();
            log.entities.insert(entities.begin(), entities.end());
            if (server_.behaviour_.note_commits) {
              v1::Issue* issue = response.add_issues();
              issue->set_id("1");
              issue->set_message("drawn otherwise");
              issue->set_applied(true);
              stream->Write(response);
            }
            Accept(request.commit(), server_.behaviour_.no_outcomes, stream);
            log.most_unanswered = std::max(log.most_unanswered, owed_);
          } else {
            Refuse(request.commit(), server_.behaviour_.refuse_commits_with, stream);
          }
          replace = false;
          break;
        default:
          break;
      }
    }
    sync::MutexLock lock(server_.mutex_);
    while (server_.behaviour_.hold_streams && !server_.closing_) {
      server_.closing_changed_.Wait(server_.mutex_);
    }
    return grpc::Status::OK;
  }

  // Three change sets, the first in two messages; then the call fails.
  grpc::Status WatchScene(grpc::ServerContext*, const v1::WatchSceneRequest* request,
                          grpc::ServerWriter<v1::WatchSceneResponse>* writer) override {
    {
      sync::MutexLock lock(server_.mutex_);
      if (server_.behaviour_.no_watches) {
        return {grpc::StatusCode::RESOURCE_EXHAUSTED,
                "8 watch the scene, which is max_scene_watches"};
      }
    }
    const auto key = [](const char* id) {
      v1::EntityKey k;
      k.set_owner(7);
      k.set_layer("voxelctl");
      k.set_id(id);
      return k;
    };
    v1::WatchSceneResponse message;
    v1::LayerInfo* layer = message.add_layers();
    layer->set_owner(7);
    layer->set_layer("voxelctl");
    layer->set_visible(true);
    layer->set_client_name(
        "some\x1b"
        "one");
    writer->Write(message);
    message.Clear();
    *message.add_entities()->mutable_info()->mutable_key() = key("a");
    message.mutable_entities(0)->mutable_info()->set_kind("sphere");
    message.set_in_sync(4);
    writer->Write(message);
    *message.add_entities()->mutable_info()->mutable_key() = key("b");
    message.mutable_entities(1)->mutable_info()->set_kind("mesh");
    message.set_in_sync(5);
    writer->Write(message);
    message.Clear();
    *message.add_removed_entities() = key("b");
    *message.add_layers() = [] {
      v1::LayerInfo hidden;
      hidden.set_owner(7);
      hidden.set_layer("voxelctl");
      return hidden;
    }();
    v1::LayerKey* gone = message.add_removed_layers();
    gone->set_owner(8);
    gone->set_layer(request->layer());
    message.set_in_sync(7);
    writer->Write(message);
    return {grpc::StatusCode::UNAVAILABLE, "shutting down"};
  }

  grpc::Status ListEntities(grpc::ServerContext*, const v1::ListEntitiesRequest* request,
                            v1::ListEntitiesResponse* response) override {
    sync::MutexLock lock(server_.mutex_);
    // Two pages: the layers and the first entity, then the second.
    if (request->page_token().empty()) {
      v1::LayerInfo* layer = response->add_layers();
      layer->set_owner(7);
      layer->set_layer("voxelctl");
      layer->set_visible(true);
      layer->set_opacity(255);
      response->set_next_page_token("second");
    }
    v1::EntityInfo* entity = response->add_entities();
    entity->mutable_key()->set_owner(7);
    entity->mutable_key()->set_layer("voxelctl");
    entity->mutable_key()->set_id(request->page_token().empty() ? "one" : "two\x1b[2J");
    entity->set_kind("instance");
    response->set_total(2);
    return grpc::Status::OK;
  }

  grpc::Status ExplainEntity(grpc::ServerContext*, const v1::ExplainEntityRequest* request,
                             v1::ExplainEntityResponse* response) override {
    *response->mutable_info()->mutable_key() = request->key();
    response->mutable_info()->set_kind("box");
    response->set_display(kDisplay);
    response->set_visibility(v1::VISIBILITY_BLACK);
    response->set_text("it is \x1b[2Jblack");
    response->set_covered_voxels(1234);
    return grpc::Status::OK;
  }

  grpc::Status ClearLayer(grpc::ServerContext*, const v1::ClearLayerRequest* request,
                          v1::ClearLayerResponse* response) override {
    sync::MutexLock lock(server_.mutex_);
    // The fake server never has a mask layer.
    if (request->layer() == "voxelctl mask") return {grpc::StatusCode::NOT_FOUND, "no such layer"};
    server_.log_.clears.push_back(*request);
    if (request->layer() == "absent") return {grpc::StatusCode::NOT_FOUND, "no layer absent"};
    response->set_entities(2);
    response->set_layers(1);
    return grpc::Status::OK;
  }

 private:
  void Accept(const v1::Commit& commit, bool no_outcomes,
              grpc::ServerReaderWriter<v1::StreamResponse, v1::StreamRequest>* stream) {
    v1::StreamResponse response;
    v1::Receipt* receipt = response.add_receipts();
    receipt->set_frame_id(commit.frame_id());
    receipt->mutable_accepted()->add_displays(kDisplay);
    stream->Write(response);
    if (no_outcomes) {
      ++owed_;
      return;
    }
    receipt->mutable_outcome()->set_display(kDisplay);
    receipt->mutable_outcome()->mutable_presented()->set_volume(commit.frame_id());
    stream->Write(response);
  }

  static void Refuse(const v1::Commit& commit, const std::string& why,
                     grpc::ServerReaderWriter<v1::StreamResponse, v1::StreamRequest>* stream) {
    v1::StreamResponse response;
    v1::Issue* issue = response.add_issues();
    issue->set_field("define_object.definition");
    issue->set_message("of no use");
    v1::Receipt* receipt = response.add_receipts();
    receipt->set_frame_id(commit.frame_id());
    receipt->mutable_refused()->set_message(why);
    stream->Write(response);
  }

  FakeServer& server_;
  uint64_t owed_ = 0;  // guarded by server_.mutex_
};

class FakeServer::Display final : public v1::DisplayService::Service {
 public:
  explicit Display(FakeServer& server) : server_(server) {}

  grpc::Status ListDisplays(grpc::ServerContext*, const v1::ListDisplaysRequest*,
                            v1::ListDisplaysResponse* response) override {
    sync::MutexLock lock(server_.mutex_);
    FillDisplay(pattern_, response->add_displays());
    if (server_.behaviour_.lattice) {
      FillLattice(response->mutable_displays(0)->mutable_geometry());
    }
    return grpc::Status::OK;
  }

  grpc::Status UpdateDisplay(grpc::ServerContext*, const v1::UpdateDisplayRequest* request,
                             v1::DisplayDescription* response) override {
    sync::MutexLock lock(server_.mutex_);
    if (request->name() != kDisplay)
      return {grpc::StatusCode::NOT_FOUND, "no display \"" + request->name() + "\"; there is fake"};
    server_.log_.updates.push_back(*request);
    pattern_ = request->test_pattern();
    FillDisplay(pattern_, response);
    return grpc::Status::OK;
  }

  grpc::Status WatchStats(grpc::ServerContext* context, const v1::WatchStatsRequest* request,
                          grpc::ServerWriter<v1::Stats>* writer) override {
    v1::Stats stats;
    stats.set_version("9.9\x1b");
    stats.set_sessions(1);
    stats.set_entities(3);
    stats.mutable_process()->set_trouble("no memory\x1b");
    v1::DisplayStats* display = stats.add_displays();
    display->set_name(kDisplay);
    display->set_state(v1::DISPLAY_STATE_SHOWING);
    display->set_engine("cpu");
    display->set_sweep_lock(v1::SWEEP_LOCK_LOCKED);
    display->set_sweep_drift_ppm(-0.2);
    display->set_lit_voxels(1234567);
    display->set_bytes_out(5000);
    display->mutable_commit_to_last_byte()->set_p50_ns(1'000'000);
    do {
      if (!writer->Write(stats)) break;
    } while (!request->once() && !context->IsCancelled());
    return grpc::Status::OK;
  }

  grpc::Status CaptureVolume(grpc::ServerContext*, const v1::CaptureVolumeRequest* request,
                             grpc::ServerWriter<v1::VolumeChunk>* writer) override {
    if (!request->name().empty() && request->name() != kDisplay)
      return {grpc::StatusCode::NOT_FOUND, "no display of that name; there is fake"};
    bool short_volume = false, lattice = false;
    {
      sync::MutexLock lock(server_.mutex_);
      server_.log_.captures.push_back(*request);
      if (server_.behaviour_.behind && request->at_least_snapshot() != 0)
        return {grpc::StatusCode::DEADLINE_EXCEEDED, "the newest has 3"};
      short_volume = server_.behaviour_.short_volume;
      lattice = server_.behaviour_.lattice;
    }
    v1::VolumeChunk chunk;
    v1::VolumeHeader* header = chunk.mutable_header();
    header->set_display(kDisplay);
    header->set_volume(5);
    header->set_source(v1::VolumeHeader::DECODED_FROM_SENT);
    FillGeometry(header->mutable_geometry());
    header->mutable_layout()->set_slices(kSide);
    header->mutable_layout()->set_width(kSide);
    header->mutable_layout()->set_height(kSide);
    if (lattice) {
      FillLattice(header->mutable_geometry());
      header->mutable_layout()->set_slices(2);
      header->mutable_layout()->set_width(3);
      header->mutable_layout()->set_height(1);
      writer->Write(chunk);
      chunk.mutable_slices()->set_rgb(std::string(2 * 3 * 3, '\x80'));
      writer->Write(chunk);
      return grpc::Status::OK;
    }
    writer->Write(chunk);
    for (int slice = 0; slice < kSide - (short_volume ? 1 : 0); slice += 1) {
      chunk.mutable_slices()->set_first_slice(slice);
      chunk.mutable_slices()->set_rgb(std::string(kSide * kSide * 3, slice == 8 ? '\x80' : '\0'));
      writer->Write(chunk);
    }
    return grpc::Status::OK;
  }

 private:
  FakeServer& server_;
  v1::TestPattern pattern_ = v1::TEST_PATTERN_NONE;  // guarded by server_.mutex_
};

FakeServer::FakeServer(const std::string& path)
    : address_("unix:" + path),
      scene_(std::make_unique<Scene>(*this)),
      display_(std::make_unique<Display>(*this)) {
  grpc::ServerBuilder builder;
  builder.AddListeningPort(address_, grpc::InsecureServerCredentials());
  builder.RegisterService(scene_.get());
  builder.RegisterService(display_.get());
  server_ = builder.BuildAndStart();
}

FakeServer::~FakeServer() {
  {
    sync::MutexLock lock(mutex_);
    closing_ = true;
    closing_changed_.NotifyAll();
  }
  server_->Shutdown(std::chrono::system_clock::now());
}

void FakeServer::Set(const Behaviour& behaviour) {
  sync::MutexLock lock(mutex_);
  behaviour_ = behaviour;
}

FakeServer::Log FakeServer::log() const {
  sync::MutexLock lock(mutex_);
  return log_;
}

}  // namespace voxeld::voxelctl
