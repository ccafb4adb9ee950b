/* A drive on a CAN bus is enabled and moved from C: SDO requests through a port, a signal, and the time. */
#include <math.h>
#include <servodrome.h>
#include <stdio.h>
#include <string.h>

static servodrome_handle line;
static servodrome_handle can;

static int failed(const char* what) {
  fprintf(stderr, "%s: %s\n", what, servodrome_last_error());
  return 1;
}

/* An expedited SDO download to node 1. Returns 0 if the drive confirms it. */
static int write_object(unsigned index, unsigned sub, unsigned size, uint32_t value) {
  servodrome_can_frame frame = {.id = 0x601, .length = 8};
  frame.data[0] = (uint8_t)(0x23 | (4 - size) << 2);
  frame.data[1] = (uint8_t)index;
  frame.data[2] = (uint8_t)(index >> 8);
  frame.data[3] = (uint8_t)sub;
  for (unsigned i = 0; i < 4; ++i) frame.data[4 + i] = (uint8_t)(value >> 8 * i);
  if (servodrome_can_send(can, &frame) != SERVODROME_OK) return 1;
  for (;;) {
    const int result = servodrome_can_receive(can, 100000000, &frame);
    if (result != SERVODROME_OK) return 1;
    if (frame.id == 0x581) return frame.data[0] != 0x60;
  }
}

int main(void) {
  const char* text =
      "[[bus]]\nname = \"can0\"\n"
      "[[axis]]\nname = \"x\"\nproduct = \"generic402\"\nbus = \"can0\"\nnode = 1\n";
  if (servodrome_line_open(text, strlen(text), "c.toml", &line) != SERVODROME_OK) return failed("open");
  if (servodrome_can_open(line, "can0", &can) != SERVODROME_OK) return failed("can");
  if (write_object(0x6060, 0, 1, 1) != 0) return failed("6060h");
  for (unsigned word = 0x06; word <= 0x0F; word = word == 0x06 ? 0x07 : word == 0x07 ? 0x0F : 0x10) {
    if (write_object(0x6040, 0, 2, word) != 0) return failed("6040h");
    if (servodrome_line_run_ticks(line, 8000) != SERVODROME_OK) return failed("run");
  }
  if (write_object(0x607A, 0, 4, 131072) != 0) return failed("607Ah");
  if (write_object(0x6040, 0, 2, 0x1F) != 0) return failed("set-point");
  if (servodrome_line_run_ticks(line, 16000 * 10) != SERVODROME_OK) return failed("run");
  uint32_t channel = 0;
  double position = NAN;
  if (servodrome_channel(line, "x", "position_counts", &channel) != SERVODROME_OK) return failed("channel");
  if (servodrome_read(line, &channel, 1, &position) != SERVODROME_OK) return failed("read");
  if (servodrome_line_close(line) != SERVODROME_OK) return failed("close");
  printf("version %s, position %.0f counts\n", servodrome_version(), position);
  return fabs(position - 131072) > 3 || servodrome_can_receive(can, 0, &(servodrome_can_frame){0}) != SERVODROME_CLOSED;
}
