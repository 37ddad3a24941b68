// What a program holds of its C library's allocator, told beside it: a library to be preloaded (LD_PRELOAD), for tests alone. Each second it
// writes the bytes that are allocated and those that the allocator keeps free, as "HELD FREE", into the file that HEAP_HELD_FILE names.
#include <malloc.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static void *tell(void *path) {
  for (;;) {
    const struct mallinfo2 heap = mallinfo2();
    FILE *file = fopen(path, "r+");  // which is there
    if (file != NULL) {
      fprintf(file, "%20zu %20zu\n", heap.uordblks + heap.hblkhd, heap.fordblks);
      fclose(file);
    }
    const struct timespec second = {1, 0};
    nanosleep(&second, NULL);
  }
  return NULL;
}

__attribute__((constructor)) static void begin(void) {
  char *path = getenv("HEAP_HELD_FILE");
  if (path == NULL) return;
  // The program's signals are for its own threads.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  pthread_t thread;
  if (pthread_create(&thread, NULL, tell, path) == 0) pthread_detach(thread);
  pthread_sigmask(SIG_SETMASK, &before, NULL);
}
