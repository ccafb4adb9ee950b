/*
 * servodrome.h: a line of drives in the caller's process, in virtual time. C11; every language that can call C can use it.
 *
 * A line has axes (drives with motor and load) and buses, as a line file describes them. Its time advances only in the calls that
 * say so here. The same calls give the same results to the last bit.
 *
 * Handles. 0 is never a valid handle. A call with a handle that was closed, or that belongs to an object of another kind, returns
 * SERVODROME_CLOSED. Closing a line closes everything that was opened on it.
 *
 * Results. A function that returns `int` returns SERVODROME_OK (0), SERVODROME_NOTHING (1), or a negative value. After a negative
 * value nothing has changed (except as servodrome_ethercat_receive says), and servodrome_last_error() has the reason.
 *
 * Threads. Calls may come from any thread. Calls on the same line run one after the other; calls on different lines run at the same
 * time.
 *
 * After fork() the child may open lines of its own. The lines of its parent are not usable if another thread was in a call on them.
 *
 * Times are in nanoseconds of line time, 0 at the start of the line. A tick is 62500 ns.
 */
#ifndef SERVODROME_H
#define SERVODROME_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(_WIN32)
#define SERVODROME_API __declspec(dllexport)
#else
#define SERVODROME_API __attribute__((visibility("default")))
#endif

typedef uint64_t servodrome_handle;

enum {
  SERVODROME_OK = 0,
  SERVODROME_NOTHING = 1,       /* nothing came before the timeout */
  SERVODROME_CLOSED = -1,       /* the handle was closed, or is of another kind */
  SERVODROME_BAD_ARGUMENT = -2, /* a null pointer, a number out of range */
  SERVODROME_BAD_LINE = -3,     /* the text of the line file has errors */
  SERVODROME_UNKNOWN = -4,      /* there is no axis, bus, signal or object of this name */
  SERVODROME_REFUSED = -5,      /* not possible in the present state, for example a CAN port that is bus-off */
  SERVODROME_FAILED = -6        /* anything else: a store file that cannot be used, no memory, a defect */
};

#define SERVODROME_TICK_NS 62500

/* Version of the library, such as "0.1.0". */
SERVODROME_API const char* servodrome_version(void);

/* Changes when a function or a structure of this header changes its meaning: 1. */
SERVODROME_API int servodrome_interface(void);

/*
 * The reason of the last negative result in this thread, as a JSON object with "what", "where" and "hint"; for
 * SERVODROME_BAD_LINE also "diagnostics": [{"file", "line", "column", "what", "hint"}]. It is valid until the next call in this
 * thread. "{}" if there was none.
 */
SERVODROME_API const char* servodrome_last_error(void);

/* ---- Lines ---- */

/*
 * Makes a line from the text of a line file (docs/line-file.md). `name` is the name of the file in messages; relative paths in the
 * text start at its folder. `text` NULL: the built-in line with five drives. Links and clock of the file are not used: no socket is
 * opened. Fails with SERVODROME_BAD_LINE, SERVODROME_FAILED.
 */
SERVODROME_API int servodrome_line_open(const char* text, size_t size, const char* name, servodrome_handle* line);
SERVODROME_API int servodrome_line_close(servodrome_handle line);

/* Warnings about the line file, as a JSON array of diagnostics. Valid until the line is closed. */
SERVODROME_API int servodrome_line_warnings(servodrome_handle line, const char** json);

SERVODROME_API int servodrome_line_now(servodrome_handle line, int64_t* now_ns);

/* Runs the line up to `time_ns`, at most an hour of line time later. A time in the past is SERVODROME_BAD_ARGUMENT. */
SERVODROME_API int servodrome_line_run_until(servodrome_handle line, int64_t time_ns);
/* Advances by `span_ns`, 0 .. an hour. `now_ns` gets the time afterwards; it may be NULL. */
SERVODROME_API int servodrome_line_advance(servodrome_handle line, int64_t span_ns, int64_t* now_ns);
/* Advances to the end of a tick: `ticks` (0 .. 57600000) after the last tick that has ended. Between two ticks 0 does nothing. */
SERVODROME_API int servodrome_line_run_ticks(servodrome_handle line, int64_t ticks);

/*
 * Runs the line up to `time_ns`, or until one of `count` ports has received something, whichever comes first. `ready` gets the
 * index of the first port in the list that has something to read. Returns SERVODROME_NOTHING if the time came first. If
 * `time_ns` is in the past, the call only checks the ports.
 */
SERVODROME_API int servodrome_line_wait(servodrome_handle line, int64_t time_ns, const servodrome_handle* ports, size_t count,
                                        size_t* ready);

/*
 * A request of the bench API (docs/bench-api.md): `method` is "GET", "PUT", "POST" or "DELETE", `target` the path with its query.
 * SERVODROME_OK means that there is an answer; `status` of it may be a refusal (4xx), with its reason in the body. The answer is
 * valid until the next call of this function in this thread.
 */
typedef struct servodrome_answer {
  unsigned status; /* of HTTP */
  const char* content_type;
  const char* body; /* not terminated by 0; may be binary */
  size_t size;
} servodrome_answer;
SERVODROME_API int servodrome_line_request(servodrome_handle line, const char* method, const char* target, const char* body,
                                           size_t size, servodrome_answer* answer);

/* ---- Values of axes ---- */

/*
 * Finds a value of an axis that is a number: a signal (docs/bench-api.md, "Stream"), an input or output ("DI0", "DO1"), or an object
 * ("6064:00"). `channel` gets its number, for the calls below. The same value has the same number.
 */
SERVODROME_API int servodrome_channel(servodrome_handle line, const char* axis, const char* value, uint32_t* channel);
/* The present values of `count` channels. A value that does not exist at present (the axis has no power) is NaN. */
SERVODROME_API int servodrome_read(servodrome_handle line, const uint32_t* channels, size_t count, double* values);

/*
 * Records channels at every tick that is a multiple of `stride` (1 .. 16000), from the next one on, until the recorder
 * is closed. The rows are kept in memory.
 */
SERVODROME_API int servodrome_recorder_open(servodrome_handle line, const uint32_t* channels, size_t count, int64_t stride,
                                            servodrome_handle* recorder);
/* The number of rows so far, and the tick of the first one. */
SERVODROME_API int servodrome_recorder_rows(servodrome_handle recorder, uint64_t* rows, int64_t* first_tick);
/* Copies `rows` rows from row `first` on to `values`: row after row, each with `count` values. */
SERVODROME_API int servodrome_recorder_copy(servodrome_handle recorder, uint64_t first, uint64_t rows, double* values);
SERVODROME_API int servodrome_recorder_close(servodrome_handle recorder);

/* ---- Ports: a master in this process ---- */

/*
 * A port keeps what comes to it until it is read: CAN frames (at most 16384; further ones are lost), bytes, or Ethernet frames. The
 * receive functions advance the line until something is there, or by `timeout_ns` (0: they do not advance it; at most an hour).
 */
SERVODROME_API int servodrome_port_close(servodrome_handle port);

typedef struct servodrome_can_frame {
  int64_t time_ns; /* received frames: the end of the frame on the bus */
  uint32_t id;     /* 11 or 29 bits */
  uint8_t extended;
  uint8_t remote; /* RTR: no data; `length` is the requested one */
  uint8_t length; /* 0 .. 8 */
  uint8_t lost;   /* received frames: 1 if frames before this one were lost, because they were not read in time */
  uint8_t data[8];
} servodrome_can_frame;

SERVODROME_API int servodrome_can_open(servodrome_handle line, const char* bus, servodrome_handle* port);
/*
 * Puts a frame into the port's queue; it goes out as arbitration allows, in line time. SERVODROME_REFUSED: the queue is
 * full, or the port is bus-off.
 */
SERVODROME_API int servodrome_can_send(servodrome_handle port, const servodrome_can_frame* frame);
SERVODROME_API int servodrome_can_receive(servodrome_handle port, int64_t timeout_ns, servodrome_can_frame* frame);

/* The error state of the port's controller (ISO 11898-1 clause 12.1.4): 0 error active, 1 error passive, 2 bus-off. */
SERVODROME_API int servodrome_can_state(servodrome_handle port, unsigned* state);

SERVODROME_API int servodrome_serial_open(servodrome_handle line, const char* bus, servodrome_handle* port);
/*
 * Sets the format of the port's characters; at first it is that of the bus. `bit_rate` is in bit/s, `parity` is 'N',
 * 'E' or 'O'.
 */
SERVODROME_API int servodrome_serial_configure(servodrome_handle port, uint32_t bit_rate, unsigned data_bits, char parity,
                                               unsigned stop_bits);
SERVODROME_API int servodrome_serial_send(servodrome_handle port, const uint8_t* bytes, size_t size);
/* Copies at least one byte and at most `capacity`, as many as have come; `size` gets their number. */
SERVODROME_API int servodrome_serial_receive(servodrome_handle port, int64_t timeout_ns, uint8_t* bytes, size_t capacity,
                                             size_t* size);

/* `second` 0: the master's first port, at the first slave; 1: its second one, of a ring. */
SERVODROME_API int servodrome_ethercat_open(servodrome_handle line, const char* bus, int second, servodrome_handle* port);
/*
 * Sends an Ethernet frame without FCS, with its header, at most 1514 bytes (1518 with a VLAN tag). It passes the slaves
 * at this instant.
 */
SERVODROME_API int servodrome_ethercat_send(servodrome_handle port, const uint8_t* frame, size_t size);
/*
 * The next frame that comes back. `size` gets its number of bytes. More than `capacity` is SERVODROME_BAD_ARGUMENT; the
 * line has then advanced up to the frame, and the frame waits for the next call.
 */
SERVODROME_API int servodrome_ethercat_receive(servodrome_handle port, int64_t timeout_ns, uint8_t* frame, size_t capacity,
                                               size_t* size);

#ifdef __cplusplus
}
#endif

#endif
