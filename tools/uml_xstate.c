// Workaround for user-mode-linux on processors with AMX; with-socketcan loads it with LD_PRELOAD.
//
// The kernel of user-mode-linux stores the extended registers of a process in a buffer of fixed size. The host kernel
// accepts them only as a whole (ptrace, PTRACE_SETREGSET of NT_X86_XSTATE). With the tiles of AMX the whole is larger than
// that buffer, so ptrace fails with EFAULT and the kernel panics. This wrapper reads and writes only the beginning of the
// registers. The tiles behind it keep the values of the running process; no program here uses them.
#define _GNU_SOURCE
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static char whole[64 * 1024];  // static, because the stacks of that kernel are too small; there is one thread

static long raw(long request, long process, long address, void* data) {
  return syscall(SYS_ptrace, request, process, address, data);
}

long ptrace(enum __ptrace_request request, ...) {
  va_list arguments;
  va_start(arguments, request);
  const long process = va_arg(arguments, pid_t);
  void* const address = va_arg(arguments, void*);
  void* data = va_arg(arguments, void*);
  va_end(arguments);

  const int is_get = request == PTRACE_GETREGSET;
  if ((is_get || request == PTRACE_SETREGSET) && (long)address == NT_X86_XSTATE) {
    struct iovec* part = data;
    struct iovec all = {whole, sizeof whole};
    const long status = raw(PTRACE_GETREGSET, process, NT_X86_XSTATE, &all);
    if (status != 0) return status;
    const size_t size = part->iov_len < all.iov_len ? part->iov_len : all.iov_len;
    if (is_get) {
      memcpy(part->iov_base, whole, size);
      part->iov_len = size;
      return 0;
    }
    memcpy(whole, part->iov_base, size);
    return raw(PTRACE_SETREGSET, process, NT_X86_XSTATE, &all);
  }

  // As in the C library, the value that is read is the result (ptrace(2)).
  long peeked = 0;
  const int peeks = request >= PTRACE_PEEKTEXT && request <= PTRACE_PEEKUSER;
  const long status = raw(request, process, (long)address, peeks ? &peeked : data);
  return peeks && status == 0 ? peeked : status;
}
