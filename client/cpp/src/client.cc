#include "voxeld/client.h"

#include <cstdlib>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"
#include "client/cpp/src/grpc_transport.h"
#include "client/cpp/src/session_core.h"
#include "voxeld/address.h"

namespace voxeld::client {

// Provides what the session's core needs: a clock, and a thread that runs it.
class RunningCore {
 public:
  RunningCore(Options options, std::unique_ptr<Transport> transport)
      : core_(std::move(options), std::move(transport), clock_), thread_([this] { core_.Run(); }) {}
  ~RunningCore() { Stop(); }

  void Stop() {
    if (!thread_.joinable()) return;
    core_.Stop();
    thread_.join();
  }
  SessionCore& core() { return core_; }

 private:
  sync::SystemClock clock_;
  SessionCore core_;
  std::thread thread_;
};

namespace {

absl::Status Gone() { return absl::FailedPreconditionError("the session is gone"); }

absl::Status Stage(const std::weak_ptr<SessionCore>& weak, Operation operation) {
  const std::shared_ptr<SessionCore> core = weak.lock();
  return core == nullptr ? Gone() : core->Stage(std::move(operation));
}

absl::Status Upsert(const std::weak_ptr<SessionCore>& weak, const std::string& layer,
                    const std::string& id, const Shape& shape, const Look& look) {
  const std::shared_ptr<SessionCore> core = weak.lock();
  return core == nullptr ? Gone() : core->StageUpsert(layer, id, shape, look);
}

absl::Status Check(const Options& options) {
  if (options.client_name.size() > 128) {
    return absl::InvalidArgumentError(absl::StrCat("client_name has ", options.client_name.size(),
                                                   " bytes; at most 128 is right"));
  }
  const std::pair<const char*, Duration> at_least_0[] = {{"linger", options.linger},
                                                         {"ping_interval", options.ping_interval}};
  for (const auto& [name, value] : at_least_0) {
    if (value.count() < 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " is ", value.count(), " ns; 0 or more is right"));
    }
  }
  const std::pair<const char*, Duration> above_0[] = {{"first_pause", options.first_pause},
                                                      {"longest_pause", options.longest_pause},
                                                      {"open_timeout", options.open_timeout}};
  for (const auto& [name, value] : above_0) {
    if (value.count() <= 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " is ", value.count(), " ns; more than 0 is right"));
    }
  }
  if (options.flow == Flow::kDropOldest && options.drop_oldest_frames == 0)
    return absl::InvalidArgumentError("drop_oldest_frames is 0; at least 1 is right");
  return absl::OkStatus();
}

}  // namespace

// ------------------------------------------------------------------------------------- handles

absl::Status Handle::SetTransform(const Affine& transform) const {
  return Stage(core_, TransformOperation{layer_, id_, transform});
}

absl::Status Handle::Set(Shape shape, Look look) const {
  return Upsert(core_, layer_, id_, shape, look);
}

absl::Status Handle::Remove() const {
  return Stage(core_, DeleteOperation{layer_, DeleteOperation::What::kId, id_});
}

// -------------------------------------------------------------------------------------- frames

Frame::Frame(std::weak_ptr<SessionCore> core, std::string layer)
    : core_(std::move(core)), layer_(std::move(layer)) {}
Frame::Frame(Frame&&) noexcept = default;
Frame& Frame::operator=(Frame&&) noexcept = default;
Frame::~Frame() = default;

Frame& Frame::Draw(Shape shape, Look look) {
  return Draw(absl::StrCat("#", drawn_), std::move(shape), std::move(look));
}

Frame& Frame::Draw(std::string id, Shape shape, Look look) {
  ++drawn_;
  if (!error_.ok()) return *this;
  absl::StatusOr<Rope> primitive = EncodePrimitive(shape, look.color, look.color_scale);
  if (id.empty()) primitive = absl::InvalidArgumentError("the entity has no id");
  if (!primitive.ok()) {
    error_ = absl::Status(
        primitive.status().code(),
        absl::StrCat("drawing ", drawn_, " (id \"", id, "\"): ", primitive.status().message()));
    return *this;
  }
  upserts_.push_back({.layer = layer_,
                      .id = std::move(id),
                      .primitive = *std::move(primitive),
                      .transform = look.transform,
                      .priority = look.priority,
                      .erase = look.erase,
                      .lifetime_ns = look.lifetime.count(),
                      .label = std::move(look.label)});
  return *this;
}

absl::StatusOr<uint64_t> Frame::Commit(const CommitOptions& options) {
  const std::shared_ptr<SessionCore> core = core_.lock();
  if (core == nullptr) return Gone();
  if (!error_.ok()) return error_;
  if (layer_.empty()) return absl::InvalidArgumentError("the layer has no name");
  FrameOperation frame{layer_, std::move(upserts_)};
  absl::StatusOr<uint64_t> number = core->Commit(&frame, options);
  upserts_.clear();
  if (!number.ok()) upserts_ = std::move(frame.upserts);
  return number;
}

absl::Status Frame::End() {
  if (!error_.ok()) return error_;
  if (layer_.empty()) return absl::InvalidArgumentError("the layer has no name");
  return Stage(core_, FrameOperation{layer_, std::exchange(upserts_, {})});
}

// -------------------------------------------------------------------------------------- layers

absl::StatusOr<Handle> Layer::Put(std::string id, Shape shape, Look look) const {
  absl::Status status = Upsert(core_, name_, id, shape, look);
  if (!status.ok()) return status;
  return Handle(core_, name_, std::move(id));
}

absl::Status Layer::SetTransform(const std::string& id, const Affine& transform) const {
  return Stage(core_, TransformOperation{name_, id, transform});
}

absl::Status Layer::Remove(const std::string& id) const {
  return Stage(core_, DeleteOperation{name_, DeleteOperation::What::kId, id});
}

absl::Status Layer::RemovePrefix(const std::string& prefix) const {
  return Stage(core_, DeleteOperation{name_, DeleteOperation::What::kPrefix, prefix});
}

absl::Status Layer::Clear() const {
  return Stage(core_, DeleteOperation{name_, DeleteOperation::What::kLayer, ""});
}

absl::Status Layer::Set(const LayerLook& look) const {
  if (name_.empty()) return absl::InvalidArgumentError("the layer has no name");
  return Stage(core_, LayerOperation{name_, look});
}

// ------------------------------------------------------------------------------------- session

absl::StatusOr<std::unique_ptr<Session>> Session::Open(Options options) {
  if (options.address.empty()) options.address = DefaultAddress();
  const absl::Status checked = Check(options);
  if (!checked.ok()) return checked;
  absl::StatusOr<std::unique_ptr<Transport>> transport =
      MakeGrpcTransport(options.address, options.credentials.value_or(DefaultCredentials()));
  if (!transport.ok()) return transport.status();
  auto running = std::make_shared<RunningCore>(std::move(options), *std::move(transport));
  return std::unique_ptr<Session>(new Session(std::move(running)));
}

Session::Session(std::shared_ptr<RunningCore> running)
    : running_(std::move(running)), core_(&running_->core()) {}
Session::~Session() { running_->Stop(); }

Layer Session::GetLayer(std::string name) const {
  return Layer(std::shared_ptr<SessionCore>(running_, core_), std::move(name));
}

absl::Status Session::DefineObject(std::string name, std::vector<Part> parts) {
  if (name.empty()) return absl::InvalidArgumentError("the object has no name");
  absl::StatusOr<DefineOperation> define = EncodeDefinition(std::move(name), parts);
  return define.ok() ? core_->Stage(*std::move(define)) : define.status();
}

absl::Status Session::RemoveObject(const std::string& name, bool cascade) {
  return core_->Stage(RemoveObjectOperation{name, cascade});
}

absl::Status Session::RemoveAll() {
  return core_->Stage(DeleteOperation{"", DeleteOperation::What::kAllMine, ""});
}

absl::StatusOr<uint64_t> Session::Commit(const CommitOptions& options) {
  return core_->Commit(nullptr, options);
}

size_t Session::staged_bytes() const { return core_->staged_bytes(); }
bool Session::HasRoom() const { return core_->HasRoom(); }
absl::Status Session::WaitOpened(Duration timeout) const { return core_->WaitOpened(timeout); }
absl::Status Session::WaitForRoom(Duration timeout) const { return core_->WaitForRoom(timeout); }
absl::StatusOr<Receipt> Session::WaitAccepted(uint64_t frame, Duration timeout) const {
  return core_->WaitAccepted(frame, timeout);
}
absl::StatusOr<Receipt> Session::WaitShown(uint64_t frame, Duration timeout) const {
  return core_->WaitShown(frame, timeout);
}

absl::StatusOr<Receipt> Session::WaitDurable(uint64_t frame, Duration timeout) const {
  return core_->WaitDurable(frame, timeout);
}
absl::Status Session::WaitSettled(Duration timeout) const { return core_->WaitSettled(timeout); }
void Session::Interrupt() { core_->Interrupt(); }
std::optional<Receipt> Session::FindReceipt(uint64_t frame) const {
  return core_->FindReceipt(frame);
}
Tally Session::GetTally() const { return core_->GetTally(); }
std::vector<int64_t> Session::latencies_ns() const { return core_->latencies_ns(); }
std::optional<ServerInfo> Session::server() const { return core_->server(); }
std::optional<ClockEstimate> Session::clock() const { return core_->clock_estimate(); }
std::optional<int64_t> Session::ServerNow() const { return core_->ServerNow(); }
absl::Status Session::Close(Duration timeout) { return core_->Close(timeout); }

}  // namespace voxeld::client
