// Allocations that fail when they are told to: a library that comes before the C library (LD_PRELOAD, or linked), for tests
// alone. It counts what asks the C library's allocator, by malloc and its like or, where the program has its own of those
// (daemon/process/allocations.cc), below it; so that what such a program does about a failure is seen too.
//
// Preloaded, it does what the environment says:
//   FAIL_MALLOC_SITE=HEX  the first allocation from there fails; a site is the four calls that led to it
//   FAIL_MALLOC_SKIP=N    not the first, but the one after so many from there (0)
//   FAIL_MALLOC_N=N       the n-th one of the process fails
//   FAIL_MALLOC_TIMES=T   and whatever that thread asks for next, T attempts in all (1); 0: from then on all of all threads
//   FAIL_MALLOC_LIST=FILE at the process's end every site is in FILE: "HEX COUNT OBJECT+OFFSET …", innermost first
//   FAIL_MALLOC_TOLD=FILE that of the one that failed, once it has
// It begins when its own constructor runs, ahead of most others.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// From now on allocations count, of all threads, and the n-th fails, with the next times - 1 attempts of its thread; n = 0:
// none.
void fail_malloc_begin(uint64_t n, uint64_t times);
// The same, and each k-th one, from the first-th on, fails at its first attempt.
void fail_malloc_begin_each(uint64_t first, uint64_t k);
// Only what is asked for while `when` answers true in that thread counts; null: all.
void fail_malloc_only(bool (*when)(void));
// Blocks that are held now, of all threads, less those that were held when the library began.
int64_t fail_malloc_held(void);
// How many there were; nothing fails any more.
uint64_t fail_malloc_end(void);

#ifdef __cplusplus
}
#endif
