// For user-mode-linux on processors with AMX, loaded in front of it (LD_PRELOAD) by with-socketcan.
//
// Its kernel keeps the extended registers of a process in a buffer of its own size; a host kernel takes them only as a
// whole (ptrace, PTRACE_SETREGSET of NT_X86_XSTATE), and with AMX's tiles the whole is larger than that buffer: EFAULT,
// and the kernel panics. So what it gets is the beginning, and what it sets goes over the beginning of what is there.
// Tiles behind it stay with whatever runs; nothing here uses them.
#define _GNU_SOURCE
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static char whole[64 * 1024];  // one thread; the stacks of that kernel are too small for it

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

  // As the C library: what is peeked at is the result (ptrace(2)).
  long peeked = 0;
  const int peeks = request >= PTRACE_PEEKTEXT && request <= PTRACE_PEEKUSER;
  const long status = raw(request, process, (long)address, peeks ? &peeked : data);
  return peeks && status == 0 ? peeked : status;
}
