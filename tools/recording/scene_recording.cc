#include "tools/recording/scene_recording.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "scene_update.pb.h"
#include "tools/recording/foxglove_scene.h"

namespace voxeld::recording {
namespace {

using google::protobuf::FileDescriptor;

void AddFile(const FileDescriptor& file, std::set<std::string>* known,
             google::protobuf::FileDescriptorSet* out) {
  if (!known->insert(file.name()).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) AddFile(*file.dependency(i), known, out);
  file.CopyTo(out->add_file());
}

McapSchema SchemaOf(const google::protobuf::Descriptor& message) {
  google::protobuf::FileDescriptorSet files;
  std::set<std::string> known;
  AddFile(*message.file(), &known, &files);
  return {message.full_name(), "protobuf", files.SerializeAsString()};
}

}  // namespace

absl::StatusOr<std::unique_ptr<SceneRecorder>> SceneRecorder::Create(const std::string& path,
                                                                     const std::string& version) {
  absl::StatusOr<std::unique_ptr<McapWriter>> writer =
      McapWriter::Create(path, absl::StrCat("voxelctl ", version));
  if (!writer.ok()) return writer.status();
  return std::unique_ptr<SceneRecorder>(new SceneRecorder(*std::move(writer)));
}

SceneRecorder::SceneRecorder(std::unique_ptr<McapWriter> writer) : writer_(std::move(writer)) {
  const uint16_t scene = writer_->AddSchema(SchemaOf(*v1::WatchSceneResponse::descriptor()));
  const uint16_t update = writer_->AddSchema(SchemaOf(*foxglove::SceneUpdate::descriptor()));
  scene_ = writer_->AddChannel({.schema = scene, .topic = kSceneTopic, .encoding = "protobuf"});
  viewers_ =
      writer_->AddChannel({.schema = update, .topic = kViewersTopic, .encoding = "protobuf"});
}

absl::Status SceneRecorder::Write(uint16_t channel, std::string_view data, uint64_t time_ns) {
  if (since_ == 0) since_ = time_ns;
  return writer_->Write({.channel = channel,
                         .sequence = sequence_++,
                         .log_time_ns = time_ns,
                         .publish_time_ns = time_ns,
                         .data = data});
}

absl::Status SceneRecorder::Add(const v1::WatchSceneResponse& message, uint64_t time_ns) {
  if (absl::Status status = Write(scene_, message.SerializeAsString(), time_ns); !status.ok()) {
    return status;
  }
  mirror_.Apply(message);
  if (message.in_sync() != 0) {
    ++change_sets_;
    foxglove::SceneUpdate update;
    MakeSceneUpdate(mirror_, time_ns, &update);
    if (update.entities_size() + update.deletions_size() > 0) {
      absl::Status status = Write(viewers_, update.SerializeAsString(), time_ns);
      if (!status.ok()) return status;
    }
  }
  return Tick(time_ns);
}

absl::Status SceneRecorder::Tick(uint64_t time_ns) {
  if (since_ == 0 || time_ns < since_ + kFlushNs) return absl::OkStatus();
  since_ = 0;
  return writer_->Flush();
}

absl::Status ReadScene(McapReader& reader, const std::function<bool(ChangeSet)>& each) {
  ChangeSet set;
  bool any = false;
  absl::Status wrong;
  const absl::Status status = reader.Read([&](const McapMessage& message) {
    const auto channel = reader.channels().find(message.channel);
    if (channel == reader.channels().end() || channel->second.topic != kSceneTopic) return true;
    v1::WatchSceneResponse part;
    if (!part.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
      wrong = absl::DataLossError("a message of the scene is no WatchSceneResponse");
      return false;
    }
    set.changes.MergeFrom(part);
    if (part.in_sync() == 0) return true;
    any = true;
    set.time_ns = message.log_time_ns;
    set.snapshot = part.in_sync();
    return each(std::exchange(set, {}));
  });
  if (!wrong.ok()) return wrong;
  if (!status.ok()) return status;
  if (!any) {
    return absl::InvalidArgumentError("the file has no scene: no change set on voxeld/scene");
  }
  return absl::OkStatus();
}

}  // namespace voxeld::recording
