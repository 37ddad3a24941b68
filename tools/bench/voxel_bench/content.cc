#include "tools/bench/voxel_bench/content.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

namespace voxeld::bench {
namespace {

template <typename T>
std::string BytesOf(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

}  // namespace

v1::Entity EntityOf(const Lines& lines) {
  std::mt19937_64 random(lines.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<float> positions;
  positions.reserve(size_t{lines.count} * 6);
  for (uint32_t i = 0; i < lines.count; ++i) {
    double direction[3] = {normal(random), normal(random), normal(random)};
    const double norm = std::max(1e-9, std::hypot(direction[0], direction[1], direction[2]));
    double half[3], middle[3];
    for (int axis = 0; axis < 3; ++axis) {
      half[axis] = direction[axis] / norm * lines.length / 2;
      middle[axis] = uniform(random) * (1 - std::abs(half[axis]));
    }
    for (int axis = 0; axis < 3; ++axis) {
      positions.push_back(static_cast<float>(middle[axis] - half[axis]));
    }
    for (int axis = 0; axis < 3; ++axis) {
      positions.push_back(static_cast<float>(middle[axis] + half[axis]));
    }
  }

  v1::Entity entity;
  v1::Vertices* vertices = entity.mutable_primitive()->mutable_segments()->mutable_vertices();
  const uint32_t ends = lines.count * 2;
  vertices->set_count(ends);
  vertices->set_position_type(v1::ELEMENT_TYPE_F32);
  vertices->set_positions(BytesOf(positions));
  if (lines.form == LineForm::k28Bytes) {
    std::vector<uint16_t> indices(ends);
    for (uint32_t i = 0; i < ends; ++i) indices[i] = static_cast<uint16_t>(i);
    vertices->set_index_type(v1::ELEMENT_TYPE_U16);
    vertices->set_index_count(ends);
    vertices->set_indices(BytesOf(indices));
  }
  if (lines.form == LineForm::k30Bytes) {
    std::vector<uint8_t> colors(size_t{ends} * 3);
    for (uint8_t& channel : colors) channel = static_cast<uint8_t>(random());
    vertices->set_color_type(v1::ELEMENT_TYPE_RGB8);
    vertices->set_colors(BytesOf(colors));
  }
  return entity;
}

v1::StreamRequest UpsertOf(const std::string& layer, const std::string& id,
                           const v1::Entity& entity) {
  v1::StreamRequest request;
  request.mutable_upsert()->set_layer(layer);
  request.mutable_upsert()->set_id(id);
  *request.mutable_upsert()->mutable_entity() = entity;
  return request;
}

v1::StreamRequest BatchOf(const std::vector<Put>& puts) {
  v1::StreamRequest request;
  for (const Put& put : puts) {
    v1::Upsert* upsert = request.mutable_batch()->add_upserts();
    upsert->set_layer(put.layer);
    upsert->set_id(put.id);
    *upsert->mutable_entity() = EntityOf(put.lines);
  }
  return request;
}

v1::StreamRequest FrameBeginOf(const std::string& layer) {
  v1::StreamRequest request;
  request.mutable_frame_begin()->set_layer(layer);
  return request;
}

v1::StreamRequest FrameEndOf(const std::string& layer) {
  v1::StreamRequest request;
  request.mutable_frame_end()->set_layer(layer);
  return request;
}

}  // namespace voxeld::bench
