// Preloaded into a program (LD_PRELOAD), ends it, or has the disk refuse, at its k-th change of
// what lies below a folder. Variables:
//   TSDFPP_SHIM_BELOW  the folder, an absolute path; without it nothing is counted
//   TSDFPP_SHIM_AT     k, from 1; nothing happens where it is absent
//   TSDFPP_SHIM_HOW    "kill" (SIGKILL, in place of the change), or the name of an error, with
//   which
//                      this change and all later ones fail: ENOSPC, EIO, EROFS
//   TSDFPP_SHIM_COUNT  a file that gets a line for each change that was counted
// Each process counts for itself. What the C library does inside itself (fwrite to a full buffer)
// is not seen.
#define _GNU_SOURCE
#undef _FORTIFY_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static atomic_long counted = 0;

static int ErrorOf(const char* how) {
  if (strcmp(how, "ENOSPC") == 0) return ENOSPC;
  if (strcmp(how, "EIO") == 0) return EIO;
  if (strcmp(how, "EROFS") == 0) return EROFS;
  return 0;
}

static int IsBelow(const char* path) {
  const char* below = getenv("TSDFPP_SHIM_BELOW");
  if (below == NULL || path == NULL) return 0;
  const size_t length = strlen(below);
  return strncmp(path, below, length) == 0 && (path[length] == '/' || path[length] == 0);
}

// Writes a line past the functions below.
static void Note(long number, const char* what, const char* path) {
  const char* file = getenv("TSDFPP_SHIM_COUNT");
  if (file == NULL) return;
  char line[1200];
  const int length = snprintf(line, sizeof line, "%ld %s %s\n", number, what, path);
  const long descriptor =
      syscall(SYS_openat, AT_FDCWD, file, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  if (descriptor < 0) return;
  syscall(SYS_write, descriptor, line, (size_t)length);
  syscall(SYS_close, descriptor);
}

// The error with which a change of `path` is to fail; 0 where it may go on.
static int Refusal(const char* what, const char* path) {
  if (!IsBelow(path)) return 0;
  const long number = atomic_fetch_add(&counted, 1) + 1;
  Note(number, what, path);
  const char* at = getenv("TSDFPP_SHIM_AT");
  const char* how = getenv("TSDFPP_SHIM_HOW");
  if (at == NULL || how == NULL || number < atol(at)) return 0;
  if (strcmp(how, "kill") == 0) {
    kill(getpid(), SIGKILL);
    pause();
  }
  return ErrorOf(how);
}

// The path that a name means, seen from a folder that is open; in `buffer` of 4096 bytes.
static const char* PathAt(int folder, const char* name, char* buffer) {
  if (name == NULL || name[0] == '/') return name;
  char link[64];
  char base[2048];
  ssize_t length;
  if (folder == AT_FDCWD) {
    length = readlink("/proc/self/cwd", base, sizeof base - 1);
  } else {
    snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
    length = readlink(link, base, sizeof base - 1);
  }
  if (length < 0) return name;
  base[length] = 0;
  snprintf(buffer, 4096, "%s/%.2000s", base, name);
  return buffer;
}

static const char* PathOfOpen(int descriptor, char* buffer) {
  char link[64];
  snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(link, buffer, 4095);
  if (length < 0) return NULL;
  buffer[length] = 0;
  return buffer;
}

#define REFUSE(what, folder, name)                                              \
  do {                                                                          \
    char refuse_buffer[4096];                                                   \
    const int refusal = Refusal(what, PathAt((folder), (name), refuse_buffer)); \
    if (refusal != 0) {                                                         \
      errno = refusal;                                                          \
      return -1;                                                                \
    }                                                                           \
  } while (0)

#define REFUSE_OPEN(what, descriptor)                                           \
  do {                                                                          \
    const int saved = errno;                                                    \
    char refuse_buffer[4096];                                                   \
    const int refusal = Refusal(what, PathOfOpen((descriptor), refuse_buffer)); \
    errno = refusal != 0 ? refusal : saved;                                     \
    if (refusal != 0) return -1;                                                \
  } while (0)

static mode_t ModeOf(int flags, va_list more) {
  return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0;
}

// Opening counts where it makes or empties a file.
#define OPEN(name)                                                          \
  int name(const char* path, int flags, ...) {                              \
    va_list more;                                                           \
    va_start(more, flags);                                                  \
    const mode_t mode = ModeOf(flags, more);                                \
    va_end(more);                                                           \
    if ((flags & (O_CREAT | O_TRUNC)) != 0) REFUSE("open", AT_FDCWD, path); \
    return REAL(name)(path, flags, mode);                                   \
  }
#define OPENAT(name)                                                      \
  int name(int folder, const char* path, int flags, ...) {                \
    va_list more;                                                         \
    va_start(more, flags);                                                \
    const mode_t mode = ModeOf(flags, more);                              \
    va_end(more);                                                         \
    if ((flags & (O_CREAT | O_TRUNC)) != 0) REFUSE("open", folder, path); \
    return REAL(name)(folder, path, flags, mode);                         \
  }
OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)

#define FOPEN(name)                                                                           \
  FILE* name(const char* path, const char* mode) {                                            \
    char buffer[4096];                                                                        \
    const int refusal = mode[0] == 'r' ? 0 : Refusal("open", PathAt(AT_FDCWD, path, buffer)); \
    if (refusal != 0) {                                                                       \
      errno = refusal;                                                                        \
      return NULL;                                                                            \
    }                                                                                         \
    return REAL(name)(path, mode);                                                            \
  }
FOPEN(fopen)
FOPEN(fopen64)

ssize_t write(int descriptor, const void* bytes, size_t count) {
  REFUSE_OPEN("write", descriptor);
  return REAL(write)(descriptor, bytes, count);
}
ssize_t writev(int descriptor, const struct iovec* parts, int count) {
  REFUSE_OPEN("write", descriptor);
  return REAL(writev)(descriptor, parts, count);
}
ssize_t pwrite(int descriptor, const void* bytes, size_t count, off_t at) {
  REFUSE_OPEN("write", descriptor);
  return REAL(pwrite)(descriptor, bytes, count, at);
}

int rename(const char* from, const char* to) {
  REFUSE("rename", AT_FDCWD, to);
  return REAL(rename)(from, to);
}
int renameat(int from_folder, const char* from, int to_folder, const char* to) {
  REFUSE("rename", to_folder, to);
  return REAL(renameat)(from_folder, from, to_folder, to);
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  REFUSE("rename", to_folder, to);
  return REAL(renameat2)(from_folder, from, to_folder, to, flags);
}
int unlink(const char* path) {
  REFUSE("unlink", AT_FDCWD, path);
  return REAL(unlink)(path);
}
int unlinkat(int folder, const char* path, int flags) {
  REFUSE("unlink", folder, path);
  return REAL(unlinkat)(folder, path, flags);
}
int remove(const char* path) {
  REFUSE("unlink", AT_FDCWD, path);
  return REAL(remove)(path);
}
int rmdir(const char* path) {
  REFUSE("rmdir", AT_FDCWD, path);
  return REAL(rmdir)(path);
}
int mkdir(const char* path, mode_t mode) {
  REFUSE("mkdir", AT_FDCWD, path);
  return REAL(mkdir)(path, mode);
}
int mkdirat(int folder, const char* path, mode_t mode) {
  REFUSE("mkdir", folder, path);
  return REAL(mkdirat)(folder, path, mode);
}
int symlink(const char* to, const char* path) {
  REFUSE("symlink", AT_FDCWD, path);
  return REAL(symlink)(to, path);
}
int ftruncate(int descriptor, off_t length) {
  REFUSE_OPEN("truncate", descriptor);
  return REAL(ftruncate)(descriptor, length);
}
