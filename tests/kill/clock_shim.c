// Preloaded into a program (LD_PRELOAD): the time of day jumps. Variables:
//   TSDFPP_CLOCK   "back": by an hour back at every 50th look; "forward": by a day on; "both": to a
//                  day ahead and a day behind by turns
// The monotonic clock stays as it is, as it does when somebody sets the time.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>
#include <time.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static const long kLooksAJump = 50;
static const long kHour_s = 3600;
static const long kDay_s = 86400;

static atomic_long looks = 0;

// Seconds by which the time of day is off now.
static long Offset(void) {
  const char* how = getenv("TSDFPP_CLOCK");
  const long jumps = 1 + atomic_fetch_add(&looks, 1) / kLooksAJump;
  if (how == NULL) return 0;
  if (strcmp(how, "back") == 0) return -jumps * kHour_s;
  if (strcmp(how, "forward") == 0) return jumps * kDay_s;
  return jumps % 2 == 0 ? kDay_s : -kDay_s;
}

int clock_gettime(clockid_t clock, struct timespec* now) {
  const int result = REAL(clock_gettime)(clock, now);
  if (result != 0) return result;
  if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) now->tv_sec += Offset();
  return result;
}

int gettimeofday(struct timeval* now, void* zone) {
  const int result = REAL(gettimeofday)(now, zone);
  if (result == 0) now->tv_sec += Offset();
  return result;
}

time_t time(time_t* place) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (place != NULL) *place = now.tv_sec;
  return now.tv_sec;
}
