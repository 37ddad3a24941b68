#define _GNU_SOURCE
#include "tests/faults/fail_malloc.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <link.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <unwind.h>

#define kFrames 4
#define kSites (1u << 16)
#define kNames 6

typedef struct {
  atomic_uint_fast64_t key;  // of the addresses; 0: free
  atomic_uint_fast64_t count;
  atomic_uint_fast64_t id;  // the same in each run; 0: not there yet
  uintptr_t frames[kFrames];
} Site;

static Site sites[kSites];
static atomic_bool counts;    // whether anything is counted
static atomic_bool by_sites;  // whether it is known where they come from
static atomic_uint_fast64_t counted, fails_at, fails_each, each_from, times;
static uint64_t site_wanted, site_skip;
static atomic_bool all_fail, has_failed;
static bool (*only_when)(void);
static atomic_int_fast64_t held;
static const char *list_path, *told_path;
static const void* ours[kNames];  // the program's own malloc and its like, which lead to every site
static _Thread_local __attribute__((tls_model("initial-exec"))) bool inside, last_failed;
static _Thread_local __attribute__((tls_model("initial-exec"))) uint64_t to_fail;

// ---- where it comes from

typedef struct {
  uintptr_t frames[kFrames];
  int count, skipped;
} Stack;

static struct link_map* ObjectOf(uintptr_t at) {
  struct dl_find_object found;
  return _dl_find_object((void*)at, &found) == 0 ? found.dlfo_link_map : NULL;
}

static bool IsNamed(const struct link_map* object, const char* name) {
  return object != NULL && object->l_name != NULL && strstr(object->l_name, name) != NULL;
}

static _Unwind_Reason_Code OnFrame(struct _Unwind_Context* context, void* to) {
  Stack* stack = to;
  const uintptr_t at = _Unwind_GetIP(context);
  if (stack->count == 0) {
    // What every allocation has in common says nothing.
    if (++stack->skipped > 24) return _URC_END_OF_STACK;
    const void* const function = (const void*)_Unwind_GetRegionStart(context);
    for (int i = 0; i < kNames; ++i) {
      if (function == ours[i]) return _URC_NO_REASON;
    }
    const struct link_map* object = ObjectOf(at);
    if (IsNamed(object, "fail_malloc") || IsNamed(object, "libstdc++")) return _URC_NO_REASON;
  }
  stack->frames[stack->count++] = at;
  return stack->count == kFrames ? _URC_END_OF_STACK : _URC_NO_REASON;
}

static uint64_t Mix(uint64_t hash, uint64_t with) {
  hash = (hash ^ with) * 0x9e3779b97f4a7c15u;
  return hash ^ (hash >> 29);
}

static const char* NameOf(const struct link_map* object) {
  if (object == NULL) return "?";
  if (object->l_name == NULL || object->l_name[0] == '\0') return "program";
  const char* slash = strrchr(object->l_name, '/');
  return slash == NULL ? object->l_name : slash + 1;
}

static uint64_t IdOf(const uintptr_t* frames) {
  uint64_t id = 1;
  for (int i = 0; i < kFrames; ++i) {
    if (frames[i] == 0) continue;
    const struct link_map* object = ObjectOf(frames[i]);
    for (const char* c = NameOf(object); *c != '\0'; ++c) id = Mix(id, (unsigned char)*c);
    id = Mix(id, object == NULL ? 0 : frames[i] - object->l_addr);
  }
  return id | 1;
}

// Null: there are more sites than it knows.
static Site* Here(void) {
  Stack stack = {0};
  _Unwind_Backtrace(&OnFrame, &stack);
  uint64_t key = 1;
  for (int i = 0; i < kFrames; ++i) key = Mix(key, stack.frames[i]);
  key |= 1;
  for (unsigned probe = 0; probe < 64; ++probe) {
    Site* site = &sites[(key + probe) % kSites];
    uint_fast64_t free = 0;
    if (atomic_compare_exchange_strong(&site->key, &free, key)) {
      memcpy(site->frames, stack.frames, sizeof(stack.frames));
      atomic_store(&site->id, IdOf(stack.frames));
      return site;
    }
    if (free == key) return site;
  }
  return NULL;
}

static int Describe(char* line, size_t size, const Site* site) {
  int at =
      snprintf(line, size, "%016" PRIx64 " %" PRIu64, (uint64_t)site->id, (uint64_t)site->count);
  for (int i = 0; i < kFrames && site->frames[i] != 0; ++i) {
    const struct link_map* object = ObjectOf(site->frames[i]);
    at += snprintf(line + at, size - (size_t)at, " %s+0x%" PRIxPTR, NameOf(object),
                   object == NULL ? 0 : site->frames[i] - object->l_addr);
  }
  return at + snprintf(line + at, size - (size_t)at, "\n");
}

static void Tell(const Site* site) {
  if (told_path == NULL || site == NULL) return;
  char line[1024];
  const int length = Describe(line, sizeof(line), site);
  const int file = open(told_path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  if (file < 0) return;
  (void)!write(file, line, (size_t)length);
  close(file);
}

// ---- whether it fails

static bool Fails(void) {
  if (!atomic_load_explicit(&counts, memory_order_relaxed) || inside) return false;
  if (to_fail > 0) {
    --to_fail;
    return true;
  }
  if (atomic_load_explicit(&all_fail, memory_order_relaxed)) return true;
  if (only_when != NULL && !only_when()) return false;
  const uint64_t each = atomic_load_explicit(&fails_each, memory_order_relaxed);
  if (each > 0 && last_failed) {  // the second attempt of what has failed
    last_failed = false;
    return false;
  }
  inside = true;
  const int before = errno;
  const uint64_t n = atomic_fetch_add(&counted, 1) + 1;
  bool fails = n == atomic_load_explicit(&fails_at, memory_order_relaxed) ||
               (each > 0 && n >= each_from && (n - each_from) % each == 0);
  Site* site = NULL;
  if (atomic_load_explicit(&by_sites, memory_order_relaxed)) {
    site = Here();
    if (site != NULL) {
      const uint64_t from_here = atomic_fetch_add(&site->count, 1);
      if (site_wanted != 0 && site->id == site_wanted && from_here == site_skip) fails = true;
    }
  }
  if (fails && each == 0) {
    if (atomic_exchange(&has_failed, true)) {
      fails = false;  // it was once
    } else {
      Tell(site != NULL || told_path == NULL ? site : Here());
      const uint64_t wanted = atomic_load(&times);
      if (wanted == 0) {
        atomic_store(&all_fail, true);
      } else {
        to_fail = wanted - 1;
      }
    }
  }
  if (each > 0) last_failed = fails;
  inside = false;
  errno = fails ? ENOMEM : before;
  return fails;
}

void fail_malloc_begin(uint64_t n, uint64_t how_often) {
  atomic_store(&counted, 0);
  atomic_store(&fails_each, 0);
  atomic_store(&fails_at, n);
  atomic_store(&times, how_often);
  atomic_store(&has_failed, false);
  atomic_store(&all_fail, false);
  atomic_store(&counts, true);
}

void fail_malloc_begin_each(uint64_t first, uint64_t k) {
  fail_malloc_begin(0, 1);
  last_failed = false;
  atomic_store(&each_from, first);
  atomic_store(&fails_each, k);
}

void fail_malloc_only(bool (*when)(void)) { only_when = when; }

int64_t fail_malloc_held(void) { return atomic_load(&held); }

uint64_t fail_malloc_end(void) {
  atomic_store(&counts, false);
  atomic_store(&all_fail, false);
  to_fail = 0;
  return atomic_load(&counted);
}

static uint64_t Number(const char* name, int base, uint64_t otherwise) {
  const char* text = getenv(name);
  return text == NULL ? otherwise : strtoull(text, NULL, base);
}

__attribute__((constructor(101))) static void Begin(void) {
  list_path = getenv("FAIL_MALLOC_LIST");
  told_path = getenv("FAIL_MALLOC_TOLD");
  site_wanted = Number("FAIL_MALLOC_SITE", 16, 0);
  site_skip = Number("FAIL_MALLOC_SKIP", 10, 0);
  const uint64_t n = Number("FAIL_MALLOC_N", 10, 0);
  if (list_path == NULL && site_wanted == 0 && n == 0) return;
  static const char* const names[kNames] = {"malloc",   "calloc",        "realloc",
                                            "memalign", "aligned_alloc", "posix_memalign"};
  for (int i = 0; i < kNames; ++i) ours[i] = dlsym(RTLD_DEFAULT, names[i]);
  atomic_store(&by_sites, list_path != NULL || site_wanted != 0);
  fail_malloc_begin(n, Number("FAIL_MALLOC_TIMES", 10, 1));
}

__attribute__((destructor(101))) static void List(void) {
  atomic_store(&counts, false);
  if (list_path == NULL) return;
  const int file = open(list_path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) return;
  for (unsigned i = 0; i < kSites; ++i) {
    if (sites[i].id == 0) continue;
    char line[1024];
    const int length = Describe(line, sizeof(line), &sites[i]);
    (void)!write(file, line, (size_t)length);
  }
  close(file);
}

// ---- in the C library's place

static void* Next(const char* name, _Atomic(void*)* found) {
  void* function = atomic_load_explicit(found, memory_order_acquire);
  if (function == NULL) {
    function = dlsym(RTLD_NEXT, name);
    if (function == NULL) abort();
    atomic_store_explicit(found, function, memory_order_release);
  }
  return function;
}

static void* Held(void* memory) {
  if (memory != NULL) atomic_fetch_add_explicit(&held, 1, memory_order_relaxed);
  return memory;
}

void* __libc_malloc(size_t bytes) {
  static _Atomic(void*) next;
  void* (*const real)(size_t) = (void* (*)(size_t))Next("__libc_malloc", &next);
  return Fails() ? NULL : Held(real(bytes));
}

void* __libc_calloc(size_t count, size_t bytes) {
  static _Atomic(void*) next;
  void* (*const real)(size_t, size_t) = (void* (*)(size_t, size_t))Next("__libc_calloc", &next);
  return Fails() ? NULL : Held(real(count, bytes));
}

void* __libc_realloc(void* memory, size_t bytes) {
  static _Atomic(void*) next;
  void* (*const real)(void*, size_t) = (void* (*)(void*, size_t))Next("__libc_realloc", &next);
  if (memory == NULL) return Fails() ? NULL : Held(real(memory, bytes));
  if (bytes == 0) {  // it frees
    atomic_fetch_sub_explicit(&held, 1, memory_order_relaxed);
    return real(memory, 0);
  }
  return Fails() ? NULL : real(memory, bytes);
}

void* __libc_memalign(size_t alignment, size_t bytes) {
  static _Atomic(void*) next;
  void* (*const real)(size_t, size_t) = (void* (*)(size_t, size_t))Next("__libc_memalign", &next);
  return Fails() ? NULL : Held(real(alignment, bytes));
}

void free(void* memory) {
  static _Atomic(void*) next;
  void (*const real)(void*) = (void (*)(void*))Next("free", &next);
  if (memory != NULL) atomic_fetch_sub_explicit(&held, 1, memory_order_relaxed);
  real(memory);
}

// For programs that leave these to the C library.
void* malloc(size_t bytes) { return __libc_malloc(bytes); }
void* calloc(size_t count, size_t bytes) { return __libc_calloc(count, bytes); }
void* realloc(void* memory, size_t bytes) { return __libc_realloc(memory, bytes); }
void* memalign(size_t alignment, size_t bytes) { return __libc_memalign(alignment, bytes); }
void* aligned_alloc(size_t alignment, size_t bytes) { return __libc_memalign(alignment, bytes); }
int posix_memalign(void** memory, size_t alignment, size_t bytes) {
  if (alignment % sizeof(void*) != 0 || (alignment & (alignment - 1)) != 0) return EINVAL;
  void* const found = __libc_memalign(alignment, bytes);
  if (found == NULL) return ENOMEM;
  *memory = found;
  return 0;
}
