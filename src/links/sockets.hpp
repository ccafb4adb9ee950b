#pragma once

#ifdef _WIN32
#include <mswsock.h>
#include <ws2tcpip.h>
// mstcpip.h needs the two headers above.
#include <mstcpip.h>
#else
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#endif

#include "links/file_descriptor.hpp"

// What differs between the sockets of Linux and Windows. Errors are numbers of errno on both.
namespace servodrome::links {

// Must be called before the first socket is used, and may be called again.
void begin_sockets();
// A socket that does not block. Not open, with errno set, on failure.
FileDescriptor open_socket(const addrinfo& address);
// Returns 0 if the socket is connected, EINPROGRESS if it will become writable when the attempt ends, else the error.
int begin_connection(Descriptor socket, const addrinfo& address);
// Returns 0, or the error with which the attempt ended.
int connection_error(Descriptor socket);
void set_option(Descriptor socket, int level, int name, int value);
// Ends a connection whose data are not acknowledged for this time.
void limit_unacknowledged(Descriptor socket, int seconds);

}  // namespace servodrome::links
