// Valid requests for tests to change, and functions that pass them through the decoder.
#pragma once

#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/wire/decode.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {

template <typename T>
std::string Packed(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

inline v1::Vertices Triangle() {
  v1::Vertices vertices;
  vertices.set_count(3);
  vertices.set_positions(Packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  return vertices;
}

inline v1::StreamRequest UpsertRequest(std::string layer = "layer", std::string id = "id") {
  v1::StreamRequest request;
  request.set_sequence(7);
  request.mutable_upsert()->set_layer(std::move(layer));
  request.mutable_upsert()->set_id(std::move(id));
  return request;
}

inline v1::StreamRequest MeshRequest() {
  v1::StreamRequest request = UpsertRequest();
  *request.mutable_upsert()
       ->mutable_entity()
       ->mutable_primitive()
       ->mutable_mesh()
       ->mutable_vertices() = Triangle();
  return request;
}

inline v1::StreamRequest PointsRequest() {
  v1::StreamRequest request = UpsertRequest();
  *request.mutable_upsert()
       ->mutable_entity()
       ->mutable_primitive()
       ->mutable_points()
       ->mutable_vertices() = Triangle();
  return request;
}

inline v1::StreamRequest SegmentsRequest() {
  v1::StreamRequest request = UpsertRequest();
  v1::Segments* segments =
      request.mutable_upsert()->mutable_entity()->mutable_primitive()->mutable_segments();
  *segments->mutable_vertices() = Triangle();
  segments->set_topology(v1::Segments::STRIP);
  return request;
}

inline v1::Primitive* PrimitiveOf(v1::StreamRequest& request) {
  return request.mutable_upsert()->mutable_entity()->mutable_primitive();
}

inline Decoded DecodeBytes(std::string_view bytes, const Limits& limits = {},
                           uint64_t previous = 0) {
  return DecodeStreamRequest(std::span(&bytes, 1), limits, previous);
}

inline Decoded Decode(const v1::StreamRequest& request, const Limits& limits = {},
                      uint64_t previous = 0) {
  return DecodeBytes(request.SerializeAsString(), limits, previous);
}

}  // namespace voxeld::daemon::wire
