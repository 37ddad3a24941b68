#include <assimp/anim.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "tools/import/assimp_scene.h"
#include "tools/import/mesh_beginning.h"
#include "tools/voxelctl/import/contained.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kTicks = 25;           // ticks per second if a file gives no rate
constexpr unsigned kMostShapes = 4096;  // per mesh

// The two keys around `time`, and the position between the first and the second.
template <typename Key>
struct Between {
  const Key* from;
  const Key* to;
  double share;
};

template <typename Key>
Between<Key> Find(const Key* keys, unsigned count, double time) {
  const Key* after = std::upper_bound(keys, keys + count, time,
                                      [](double t, const Key& key) { return t < key.mTime; });
  if (after == keys) return {keys, keys, 0};
  if (after == keys + count) return {after - 1, after - 1, 0};
  const double length = after->mTime - (after - 1)->mTime;
  const double share = length > 0 ? (time - (after - 1)->mTime) / length : 0;
  return {after - 1, after, std::clamp(share, 0.0, 1.0)};
}

aiVector3D VectorAt(const aiVectorKey* keys, unsigned count, double time,
                    const aiVector3D& otherwise) {
  if (count == 0 || keys == nullptr) return otherwise;
  const auto [from, to, share] = Find(keys, count, time);
  return from->mValue + (to->mValue - from->mValue) * static_cast<ai_real>(share);
}

aiQuaternion TurnAt(const aiQuatKey* keys, unsigned count, double time,
                    const aiQuaternion& otherwise) {
  if (count == 0 || keys == nullptr) return otherwise;
  const auto [from, to, share] = Find(keys, count, time);
  aiQuaternion turn;
  aiQuaternion::Interpolate(turn, from->mValue, to->mValue, static_cast<ai_real>(share));
  return turn.Normalize();
}

NodeMatrix MapOf(const aiVector3D& scale, const aiQuaternion& turn, const aiVector3D& move) {
  const aiMatrix3x3 r = turn.GetMatrix();
  return {r.a1 * scale.x, r.a2 * scale.y, r.a3 * scale.z, move.x,
          r.b1 * scale.x, r.b2 * scale.y, r.b3 * scale.z, move.y,
          r.c1 * scale.x, r.c2 * scale.y, r.c3 * scale.z, move.z};
}

void AddWeights(const aiMeshMorphKey& key, double share, std::vector<double>* weights) {
  if (key.mValues == nullptr || key.mWeights == nullptr) return;
  for (unsigned i = 0; i < key.mNumValuesAndWeights; ++i) {
    const unsigned shape = key.mValues[i];
    if (shape >= kMostShapes) continue;
    if (shape >= weights->size()) weights->resize(shape + 1);
    (*weights)[shape] += share * key.mWeights[i];
  }
}

Pose PoseAt(const aiScene& scene, const aiAnimation& animation, double time) {
  Pose pose;
  for (unsigned c = 0; c < animation.mNumChannels; ++c) {
    const aiNodeAnim& channel = *animation.mChannels[c];
    const aiNode* node = scene.mRootNode->FindNode(channel.mNodeName);
    if (node == nullptr) continue;
    // A channel without keys keeps the node's own value.
    aiVector3D scale(1, 1, 1), move;
    aiQuaternion turn;
    node->mTransformation.Decompose(scale, turn, move);
    pose.nodes[channel.mNodeName.C_Str()] =
        MapOf(VectorAt(channel.mScalingKeys, channel.mNumScalingKeys, time, scale),
              TurnAt(channel.mRotationKeys, channel.mNumRotationKeys, time, turn),
              VectorAt(channel.mPositionKeys, channel.mNumPositionKeys, time, move));
  }
  for (unsigned c = 0; c < animation.mNumMorphMeshChannels; ++c) {
    const aiMeshMorphAnim& channel = *animation.mMorphMeshChannels[c];
    if (channel.mNumKeys == 0 || channel.mKeys == nullptr) continue;
    const auto [from, to, share] = Find(channel.mKeys, channel.mNumKeys, time);
    std::vector<double>& weights = pose.shapes[channel.mName.C_Str()];
    AddWeights(*from, 1 - share, &weights);
    AddWeights(*to, share, &weights);
  }
  return pose;
}

class AnimationFrames final : public FrameSource {
 public:
  static absl::StatusOr<std::unique_ptr<FrameSource>> Open(SourceFile file, size_t number,
                                                           double fps) {
    auto frames = std::make_unique<AnimationFrames>();
    frames->file_ = std::move(file);
    const absl::Status status = frames->Load(number, fps);
    if (!status.ok()) return status;
    return frames;
  }

  int64_t count() const override { return count_; }

  absl::StatusOr<Model> Read(int64_t frame) override {
    const double time = static_cast<double>(frame) * ticks_a_frame_;
    const Pose pose = PoseAt(*scene_, *animation_, time);
    return ModelOf(file_, *scene_, &pose);
  }

 private:
  absl::Status Load(size_t number, double fps) {
    const absl::StatusOr<const aiScene*> scene = LoadScene(file_, &importer_);
    if (!scene.ok()) return scene.status();
    scene_ = *scene;
    if (number < 1 || number > scene_->mNumAnimations) {
      std::vector<std::string> names;
      for (unsigned a = 0; a < scene_->mNumAnimations; ++a) {
        const std::string name = scene_->mAnimations[a]->mName.C_Str();
        names.push_back(absl::StrCat(a + 1, name.empty() ? "" : " ", EscapeForTerminal(name)));
      }
      return FileError(file_, absl::StrCat("has no animation ", number),
                       names.empty() ? "it has none at all"
                                     : absl::StrCat("it has ", absl::StrJoin(names, ", ")));
    }
    animation_ = scene_->mAnimations[number - 1];
    const double ticks = animation_->mTicksPerSecond > 0 ? animation_->mTicksPerSecond : kTicks;
    // In BVH every frame lasts one tick, including the last; the library's duration ends where the
    // last frame begins.
    const bool has_last = file_.extension == "bvh" && animation_->mDuration > 0;
    const double seconds = (animation_->mDuration + (has_last ? 1 : 0)) / ticks;
    if (!(seconds >= 0) || !(seconds * fps <= static_cast<double>(kMaxFrames))) {
      return FileError(
          file_, absl::StrCat("has an animation of ", seconds, " s"),
          absl::StrCat("at most ", static_cast<double>(kMaxFrames) / fps, " are played"));
    }
    ticks_a_frame_ = ticks / fps;
    count_ = std::max<int64_t>(1, std::llround(seconds * fps));
    return absl::OkStatus();
  }

  SourceFile file_;
  Assimp::Importer importer_;
  const aiScene* scene_ = nullptr;
  const aiAnimation* animation_ = nullptr;
  double ticks_a_frame_ = 1;
  int64_t count_ = 1;
};

}  // namespace

absl::StatusOr<std::unique_ptr<FrameSource>> OpenAssimpAnimation(SourceFile file, size_t number,
                                                                 double fps) {
  if (absl::Status status = CheckMeshBeginning(file); !status.ok()) return status;
  return AnimationFrames::Open(std::move(file), number, fps);
}

}  // namespace voxeld::voxelctl
