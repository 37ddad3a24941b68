#include "tests/refused_calls.h"

#include <dlfcn.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/random.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>

namespace voxeld {

thread_local std::array<RefusedCalls*, 8> refused_calls{};

RefusedCalls::RefusedCalls(SystemCall call, int error, int times)
    : call_(call), error_(error), left_(times) {
  refused_calls[static_cast<size_t>(call)] = this;
}

RefusedCalls::~RefusedCalls() { refused_calls[static_cast<size_t>(call_)] = nullptr; }

struct RefusedPlan {
  // Returns the error with which this call fails; 0: it is passed on.
  static int Error(SystemCall call) {
    RefusedCalls* const plan = refused_calls[static_cast<size_t>(call)];
    if (plan == nullptr) return 0;
    ++plan->made_;
    if (plan->left_ == 0) return 0;
    --plan->left_;
    return plan->error_;
  }

  // For calls that report errors by errno.
  static bool Refuses(SystemCall call) {
    const int error = Error(call);
    if (error != 0) errno = error;
    return error != 0;
  }

  template <typename Function>
  static Function* Next(Function*, const char* name) {
    return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
  }
};

}  // namespace voxeld

using voxeld::RefusedPlan;
using voxeld::SystemCall;

#pragma GCC visibility push(default)
extern "C" {

int epoll_ctl(int epoll, int operation, int descriptor, epoll_event* event) noexcept {
  static auto* const next = RefusedPlan::Next(&epoll_ctl, "epoll_ctl");
  if (RefusedPlan::Refuses(SystemCall::kEpollControl)) return -1;
  return next(epoll, operation, descriptor, event);
}

int epoll_create1(int flags) noexcept {
  static auto* const next = RefusedPlan::Next(&epoll_create1, "epoll_create1");
  if (RefusedPlan::Refuses(SystemCall::kEpollCreate)) return -1;
  return next(flags);
}

int eventfd(unsigned int count, int flags) noexcept {
  static auto* const next = RefusedPlan::Next(&eventfd, "eventfd");
  if (RefusedPlan::Refuses(SystemCall::kEventfd)) return -1;
  return next(count, flags);
}

ssize_t getrandom(void* buffer, size_t size, unsigned int flags) {
  static auto* const next = RefusedPlan::Next(&getrandom, "getrandom");
  if (RefusedPlan::Refuses(SystemCall::kGetrandom)) return -1;
  return next(buffer, size, flags);
}

int memfd_create(const char* name, unsigned int flags) noexcept {
  static auto* const next = RefusedPlan::Next(&memfd_create, "memfd_create");
  if (RefusedPlan::Refuses(SystemCall::kMemfdCreate)) return -1;
  return next(name, flags);
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*),
                   void* argument) noexcept {
  static auto* const next = RefusedPlan::Next(&pthread_create, "pthread_create");
  const int error = RefusedPlan::Error(SystemCall::kPthreadCreate);
  return error != 0 ? error : next(thread, attributes, start, argument);
}

ssize_t sendmsg(int socket, const msghdr* message, int flags) {
  static auto* const next = RefusedPlan::Next(&sendmsg, "sendmsg");
  if (RefusedPlan::Refuses(SystemCall::kSendmsg)) return -1;
  return next(socket, message, flags);
}

int socketpair(int domain, int type, int protocol, int sockets[2]) noexcept {
  static auto* const next = RefusedPlan::Next(&socketpair, "socketpair");
  if (RefusedPlan::Refuses(SystemCall::kSocketpair)) return -1;
  return next(domain, type, protocol, sockets);
}

}  // extern "C"
#pragma GCC visibility pop
