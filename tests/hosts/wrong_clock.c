// Shows a program a clock that is off and runs fast, as that of another machine: for LD_PRELOAD.
//   WRONG_CLOCK="START_S OFF_S PPM"
// By the machine's CLOCK_MONOTONIC, it drifts from START on; the wall clock is OFF ahead. Both clocks drift alike, as a
// quartz makes them. Waiting takes as long as it takes.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static double start_s, off_s, rate;
static int is_read;

static void read_once(void) {
  if (is_read) return;
  const char* const text = getenv("WRONG_CLOCK");
  double ppm = 0;
  if (text != NULL && sscanf(text, "%lf %lf %lf", &start_s, &off_s, &ppm) == 3) rate = 1e-6 * ppm;
  is_read = 1;
}

static long long added_ns(clockid_t id) {
  read_once();
  struct timespec now;
  syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
  return (long long)(1e9 * (rate * ((double)now.tv_sec + 1e-9 * (double)now.tv_nsec - start_s) +
                            (id == CLOCK_REALTIME ? off_s : 0)));
}

static struct timespec later(const struct timespec* at, long long ns) {
  const long long all = (long long)at->tv_sec * 1000000000LL + at->tv_nsec + ns;
  return (struct timespec){.tv_sec = (time_t)(all / 1000000000LL), .tv_nsec = (long)(all % 1000000000LL)};
}

int clock_gettime(clockid_t id, struct timespec* out) {
  const long result = syscall(SYS_clock_gettime, id, out);
  if (result == 0 && (id == CLOCK_REALTIME || id == CLOCK_MONOTONIC)) *out = later(out, added_ns(id));
  return (int)result;
}

// Who waits until a time says it by the clock that was shown.
int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const struct timespec* until) {
  static int (*real)(pthread_cond_t*, pthread_mutex_t*, const struct timespec*);
  if (real == NULL) real = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  const struct timespec true_until = later(until, -added_ns(CLOCK_REALTIME));
  return real(condition, mutex, &true_until);
}

int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t id,
                           const struct timespec* until) {
  static int (*real)(pthread_cond_t*, pthread_mutex_t*, clockid_t, const struct timespec*);
  if (real == NULL) real = dlsym(RTLD_NEXT, "pthread_cond_clockwait");
  const struct timespec true_until = later(until, -added_ns(id));
  return real(condition, mutex, id, &true_until);
}
