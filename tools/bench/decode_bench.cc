// From a message's bytes, in pieces as gRPC hands them over, to arrays that an engine reads: what one
// thread decodes a second.
//
//   voxel-decode-bench --benchmark_repetitions=5
//
// Batches of segments. `direct`: payloads are copied once, from the pieces into bulk memory. `parsed`:
// protobuf's parser first, into its strings, then into ordinary memory. `memcpy`: the same bytes,
// piece by piece, into memory that is used again and again.
#include <benchmark/benchmark.h>
#include <google/protobuf/arena.h>

#include <cstring>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/wire/decode.h"
#include "daemon/wire/slice_stream.h"
#include "gpu/bulk/bulk_pool.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::bench {
namespace {

constexpr size_t kPiece = 16 << 10;  // what gRPC reads at once

std::string Message(int64_t entities, int64_t lines) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> any(-1, 1);
  v1::StreamRequest request;
  for (int64_t i = 0; i < entities; ++i) {
    v1::Upsert* upsert = request.mutable_batch()->add_upserts();
    upsert->set_layer("layer");
    upsert->set_id(std::to_string(i));
    v1::Vertices* vertices =
        upsert->mutable_entity()->mutable_primitive()->mutable_segments()->mutable_vertices();
    std::vector<float> positions(static_cast<size_t>(lines) * 6);
    for (float& value : positions) value = any(random);
    vertices->set_count(static_cast<uint32_t>(lines * 2));
    vertices->set_positions(reinterpret_cast<const char*>(positions.data()), positions.size() * 4);
  }
  return request.SerializeAsString();
}

std::vector<std::string_view> Pieces(std::string_view bytes) {
  std::vector<std::string_view> pieces;
  for (size_t at = 0; at < bytes.size(); at += kPiece) pieces.push_back(bytes.substr(at, kPiece));
  return pieces;
}

void Finish(benchmark::State& state, size_t bytes) {
  state.SetBytesProcessed(static_cast<int64_t>(state.iterations()) * static_cast<int64_t>(bytes));
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations()) * state.range(0) *
                          state.range(1));  // lines
}

void BM_DecodeDirect(benchmark::State& state) {
  const std::string bytes = Message(state.range(0), state.range(1));
  const std::vector<std::string_view> pieces = Pieces(bytes);
  const auto pool = gpu::BulkPool::Create();
  for (auto _ : state) {
    const daemon::wire::Decoded decoded =
        daemon::wire::DecodeStreamRequest(pieces, {}, 0, pool.get());
    if (static_cast<int64_t>(decoded.operations.size()) != state.range(0)) std::abort();
    benchmark::DoNotOptimize(&decoded);
  }
  Finish(state, bytes.size());
}

void BM_DecodeParsed(benchmark::State& state) {
  const std::string bytes = Message(state.range(0), state.range(1));
  const std::vector<std::string_view> pieces = Pieces(bytes);
  for (auto _ : state) {
    google::protobuf::Arena arena;
    auto* request = google::protobuf::Arena::CreateMessage<v1::StreamRequest>(&arena);
    daemon::wire::SliceStream stream(pieces);
    if (!request->ParseFromZeroCopyStream(&stream)) std::abort();
    const daemon::wire::Decoded decoded = daemon::wire::DecodeStreamRequest(*request, {}, 0);
    if (static_cast<int64_t>(decoded.operations.size()) != state.range(0)) std::abort();
    benchmark::DoNotOptimize(&decoded);
  }
  Finish(state, bytes.size());
}

void BM_Memcpy(benchmark::State& state) {
  const std::string bytes = Message(state.range(0), state.range(1));
  const std::vector<std::string_view> pieces = Pieces(bytes);
  std::vector<char> to(bytes.size());
  for (auto _ : state) {
    size_t at = 0;
    for (const std::string_view piece : pieces) {
      std::memcpy(to.data() + at, piece.data(), piece.size());
      at += piece.size();
    }
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  Finish(state, bytes.size());
}

// {entities, lines in each}: about 1 MiB, but for the last, whose entities are as small as they get.
#define VOXELD_SIZES \
  ArgNames({"entities", "lines"})->Args({10, 4096})->Args({64, 682})->Args({8192, 1})
BENCHMARK(BM_DecodeDirect)->VOXELD_SIZES;
BENCHMARK(BM_DecodeParsed)->VOXELD_SIZES;
BENCHMARK(BM_Memcpy)->VOXELD_SIZES;

}  // namespace
}  // namespace voxeld::bench

BENCHMARK_MAIN();
