// A replacement for NCCL, for tests without a GPU: it does what a single rank would see, counts its
// calls, and fails on request.
//
//   VOXELD_FAKE_NCCL_FAILS=name   that function returns ncclSystemError
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

constexpr int kSuccess = 0, kSystemError = 2;

struct UniqueId {
  char internal[128];
};

struct Comm {
  int rank, ranks;
};

std::string& Log() {
  static std::string log;
  return log;
}

int Called(const char* name, const std::string& with = "") {
  Log() += std::string(name) + "(" + with + ") ";
  const char* const fails = std::getenv("VOXELD_FAKE_NCCL_FAILS");
  return fails != nullptr && std::strcmp(fails, name) == 0 ? kSystemError : kSuccess;
}

}  // namespace

extern "C" {

// Returns the calls since the last query.
const char* FakeNcclLog() {
  static std::string told;
  told = std::move(Log());
  Log().clear();
  return told.c_str();
}

int ncclGetVersion(int* version) {
  *version = 22809;
  return Called("ncclGetVersion");
}

const char* ncclGetErrorString(int result) {
  return result == kSystemError ? "a system error that was asked for" : "no error";
}

int ncclGetUniqueId(UniqueId* id) {
  for (int i = 0; i < 128; ++i) id->internal[i] = static_cast<char>(i);
  return Called("ncclGetUniqueId");
}

int ncclCommInitRank(Comm** comm, int ranks, UniqueId id, int rank) {
  bool same = true;
  for (int i = 0; i < 128; ++i) same = same && id.internal[i] == static_cast<char>(i);
  const int result =
      Called("ncclCommInitRank",
             std::to_string(rank) + " of " + std::to_string(ranks) + (same ? "" : ", another id"));
  if (result == kSuccess) *comm = new Comm{rank, ranks};
  return result;
}

int ncclCommAbort(Comm* comm) {
  delete comm;
  return Called("ncclCommAbort");
}

// A failure is reported as an error of the work under way.
int ncclCommGetAsyncError(Comm*, int* error) {
  *error = Called("ncclCommGetAsyncError");
  return kSuccess;
}

int ncclBroadcast(const void* from, void* to, size_t count, int type, int root, Comm*, void*) {
  return Called("ncclBroadcast", std::to_string(count) + " of type " + std::to_string(type) +
                                     " from " + std::to_string(root) +
                                     (from == to ? ", in place" : ""));
}

int ncclAllReduce(const void* from, void* to, size_t count, int type, int operation, Comm*, void*) {
  return Called("ncclAllReduce", std::to_string(count) + " of type " + std::to_string(type) +
                                     " by " + std::to_string(operation) +
                                     (from == to ? ", in place" : ""));
}

}  // extern "C"
