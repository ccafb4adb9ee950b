// Takes any bytes as a capture file, through the decoders of all buses, and as a data sheet. The sanitizers detect
// misuse of memory. A file is refused by one of the two exceptions that callers expect.
#include <cstdio>
#include <memory>
#include <sstream>

#include "describe/device_file.hpp"
#include "master/error.hpp"
#include "tools/sniff/can_decoder.hpp"
#include "tools/sniff/capture_file.hpp"
#include "tools/sniff/ethercat_decoder.hpp"
#include "tools/sniff/modbus_tcp_decoder.hpp"
#include "tools/sniff/serial_decoder.hpp"

using namespace servodrome;

namespace {

void decode_capture(const std::uint8_t* data, std::size_t size) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(::fmemopen(const_cast<std::uint8_t*>(data), size, "rb"),
                                                             &std::fclose);
  if (!file) return;
  master::CanDecoder can;
  master::EthercatDecoder ethercat;
  ethercat.show_sent(true);
  master::SerialDecoder serial;
  master::ModbusTcpDecoder modbus_tcp;
  try {
    master::CaptureFile capture(file.get(), "fuzz");
    while (const auto frame = capture.next()) {
      if (const auto* on_can = std::get_if<canopen::Frame>(&frame->content)) can.decode(*on_can, frame->time);
      if (const auto* bytes = std::get_if<master::EthernetBytes>(&frame->content)) {
        ethercat.decode(*bytes, frame->time);
        modbus_tcp.decode(*bytes, frame->time);
      }
      if (const auto* piece = std::get_if<master::SerialBytes>(&frame->content)) {
        serial.decode(piece->bytes, frame->time, piece->sender);
        modbus_tcp.decode_message(piece->bytes, frame->time, piece->sender == links::SerialSender::master, 0);
      }
    }
    serial.finish();
  } catch (const master::MasterError&) {
  }
}

void read_data_sheet(const std::uint8_t* data, std::size_t size) {
  std::istringstream text(std::string(reinterpret_cast<const char*>(data), size));
  try {
    master::DeviceModel::of(describe::read_eds(text, "fuzz"));
  } catch (const describe::DeviceFileError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  if (data[0] % 2 == 0) {
    decode_capture(data + 1, size - 1);
  } else {
    read_data_sheet(data + 1, size - 1);
  }
  return 0;
}
