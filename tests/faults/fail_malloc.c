// Makes allocations fail, for tests: a library that is preloaded (LD_PRELOAD) and wraps the C
// library's allocator.
// The environment selects the allocation that fails:
//   FAIL_MALLOC_SITE=HEX  the first one from this site; a site is the four calls that led to the allocation
//   FAIL_MALLOC_SKIP=N    not the first one from the site, but the one after N others (0)
//   FAIL_MALLOC_N=N       the N-th one of the process
//   FAIL_MALLOC_TIMES=T   how many attempts of that thread fail in a row (1); 0: from then on, all
//     allocations of all threads
//   FAIL_MALLOC_LIST=FILE at exit, writes every site to FILE: "HEX COUNT OBJECT+OFFSET …", innermost first
//   FAIL_MALLOC_TOLD=FILE writes the site of the allocation that failed
// It becomes active when its constructor runs, before most others.
#define _GNU_SOURCE

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <link.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <unwind.h>

#define kFrames 4
#define kSites (1u << 16)

typedef struct {
  atomic_uint_fast64_t key;  // hash of the addresses; 0: the entry is free
  atomic_uint_fast64_t count;
  atomic_uint_fast64_t id;  // the same in each run; 0: not known yet
  uintptr_t frames[kFrames];
} Site;

static Site sites[kSites];
static atomic_bool counts;    // whether allocations are counted
static atomic_bool by_sites;  // whether call sites are determined
static atomic_uint_fast64_t counted, fails_at, times;
static uint64_t site_wanted, site_skip;
static atomic_bool all_fail, has_failed;
static const char *list_path, *told_path;
static _Thread_local __attribute__((tls_model("initial-exec"))) bool inside;
static _Thread_local __attribute__((tls_model("initial-exec"))) uint64_t to_fail;

// ---- call sites

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
    // Frames that every allocation has in common say nothing.
    if (++stack->skipped > 24) return _URC_END_OF_STACK;
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

// Returns null if there are more sites than the table holds.
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

// ---- deciding whether an allocation fails

static bool Fails(void) {
  if (!atomic_load_explicit(&counts, memory_order_relaxed) || inside) return false;
  if (to_fail > 0) {
    --to_fail;
    return true;
  }
  if (atomic_load_explicit(&all_fail, memory_order_relaxed)) return true;
  inside = true;
  const int before = errno;
  const uint64_t n = atomic_fetch_add(&counted, 1) + 1;
  bool fails = n == atomic_load_explicit(&fails_at, memory_order_relaxed);
  Site* site = NULL;
  if (atomic_load_explicit(&by_sites, memory_order_relaxed)) {
    site = Here();
    if (site != NULL) {
      const uint64_t from_here = atomic_fetch_add(&site->count, 1);
      if (site_wanted != 0 && site->id == site_wanted && from_here == site_skip) fails = true;
    }
  }
  if (fails) {
    if (atomic_exchange(&has_failed, true)) {
      fails = false;  // only once
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
  inside = false;
  errno = fails ? ENOMEM : before;
  return fails;
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
  atomic_store(&by_sites, list_path != NULL || site_wanted != 0);
  atomic_store(&fails_at, n);
  atomic_store(&times, Number("FAIL_MALLOC_TIMES", 10, 1));
  atomic_store(&counts, true);
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

// ---- replacements for the C library's functions

// NOLINTBEGIN(bugprone-reserved-identifier): the C library's own names.
void* __libc_malloc(size_t bytes);
void* __libc_calloc(size_t count, size_t bytes);
void* __libc_realloc(void* memory, size_t bytes);
void* __libc_memalign(size_t alignment, size_t bytes);
// NOLINTEND(bugprone-reserved-identifier)

void* malloc(size_t bytes) { return Fails() ? NULL : __libc_malloc(bytes); }
void* calloc(size_t count, size_t bytes) { return Fails() ? NULL : __libc_calloc(count, bytes); }
void* realloc(void* memory, size_t bytes) {
  const bool frees = memory != NULL && bytes == 0;
  return !frees && Fails() ? NULL : __libc_realloc(memory, bytes);
}
void* memalign(size_t alignment, size_t bytes) {
  return Fails() ? NULL : __libc_memalign(alignment, bytes);
}
void* aligned_alloc(size_t alignment, size_t bytes) { return memalign(alignment, bytes); }
int posix_memalign(void** memory, size_t alignment, size_t bytes) {
  if (alignment % sizeof(void*) != 0 || (alignment & (alignment - 1)) != 0) return EINVAL;
  void* const found = memalign(alignment, bytes);
  if (found == NULL) return ENOMEM;
  *memory = found;
  return 0;
}
