#pragma once

#include <array>
#include <deque>
#include <numeric>

#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/segment.hpp"
#include "products/ethercat_device.hpp"
#include "rig.hpp"

// The rig of an EtherCAT drive: one slave on a cable, and a master that sends one datagram per frame. Frames take no
// time; the drive's ticks and the frames use the same virtual clock.
namespace servodrome::test {

using Bytes = std::vector<std::uint8_t>;

template <typename... Values>
Bytes little_endian(Values... values) {
  Bytes bytes;
  const auto append = [&bytes](auto value) {
    for (std::size_t i = 0; i < sizeof value; ++i) {
      bytes.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> 8 * i));
    }
  };
  (append(values), ...);
  return bytes;
}

template <typename DeviceType>
class EthercatRig : public Rig<DeviceType> {
 public:
  using Rig<DeviceType>::device;
  using Rig<DeviceType>::now;
  using Rig<DeviceType>::run_ms;
  using Rig<DeviceType>::tick;

  static constexpr std::uint16_t mailbox_bytes = 128;
  static constexpr std::uint32_t outputs_address = 0x10000;
  static constexpr std::uint32_t inputs_address = 0x20000;

  using Rig<DeviceType>::Rig;

  struct Answer {
    Bytes data;
    unsigned counter = 0;
  };

  // ---- Frames ----

  Answer send(ethercat::Command command, std::uint32_t address, const Bytes& data) {
    std::array<std::uint8_t, ethercat::max_frame> memory{};
    ethercat::FrameWriter writer = ethercat::FrameWriter::ethernet(memory);
    const std::span<std::uint8_t> place = writer.add(command, 0x55, address, data.size());
    std::copy(data.begin(), data.end(), place.begin());
    EXPECT_EQ(segment.process(writer.bytes(), now()).exit, ethercat::Segment::Exit::primary);
    ethercat::Frame frame;
    ethercat::parse_ethernet(writer.bytes(), frame);
    const ethercat::Datagram& datagram = frame.datagrams()[0];
    Answer answer{Bytes(datagram.data(), datagram.data() + datagram.length), datagram.working_counter()};
    if (device.slave().wants_poll(now())) device.poll(now());
    return answer;
  }
  unsigned write(std::uint16_t offset, const Bytes& data) {
    return send(ethercat::Command::apwr, ethercat::address_of(0, offset), data).counter;
  }
  Bytes read(std::uint16_t offset, std::size_t length) {
    return send(ethercat::Command::aprd, ethercat::address_of(0, offset), Bytes(length)).data;
  }
  std::uint16_t read_u16(std::uint16_t offset) { return ethercat::load_u16(read(offset, 2).data()); }

  // ---- States ----

  // AL status after a request and one cycle of the drive; code: 0134h.
  struct AlStatus {
    unsigned state = 0;  // with the error bit 10h
    ethercat::AlStatusCode code{};
    bool operator==(const AlStatus&) const = default;
  };
  AlStatus al_status() {
    return {read_u16(ethercat::reg::al_status),
            static_cast<ethercat::AlStatusCode>(read_u16(ethercat::reg::al_status_code))};
  }
  AlStatus request(unsigned control) {
    EXPECT_EQ(write(ethercat::reg::al_control, little_endian(static_cast<std::uint16_t>(control))), 1U);
    return al_status();
  }
  static AlStatus good(unsigned state) { return {state, ethercat::AlStatusCode::none}; }

  void set_sync_manager(unsigned number, unsigned start, unsigned length, unsigned control) {
    EXPECT_EQ(write(static_cast<std::uint16_t>(ethercat::reg::sync_manager + 8 * number),
                    little_endian(static_cast<std::uint16_t>(start), static_cast<std::uint16_t>(length),
                                  static_cast<std::uint16_t>(control), std::uint16_t{length != 0})),
              1U);
  }
  void set_fmmu(unsigned number, std::uint32_t logical, unsigned length, unsigned physical, unsigned type) {
    EXPECT_EQ(
        write(static_cast<std::uint16_t>(ethercat::reg::fmmu + 16 * number),
              little_endian(logical, static_cast<std::uint16_t>(length), std::uint8_t{0}, std::uint8_t{7},
                            static_cast<std::uint16_t>(physical), std::uint8_t{0}, static_cast<std::uint8_t>(type),
                            std::uint8_t{length != 0}, std::uint8_t{0}, std::uint16_t{0})),
        1U);
  }
  void to_pre_operational() {
    set_sync_manager(0, DeviceType::ethercat_profile.mailbox_out.start, mailbox_bytes, 0x26);
    set_sync_manager(1, DeviceType::ethercat_profile.mailbox_in.start, mailbox_bytes, 0x22);
    ASSERT_EQ(request(2), good(2));
  }
  // Bytes of the PDOs that 1C12h and 1C13h assign now.
  std::size_t assigned_bytes(std::uint16_t assignment) {
    std::size_t bits = 0;
    for (int pdo = 1; pdo <= this->get(assignment); ++pdo) {
      const auto mapping = static_cast<std::uint16_t>(this->get(assignment, static_cast<std::uint8_t>(pdo)));
      for (int entry = 1; entry <= this->get(mapping); ++entry) {
        bits += static_cast<std::size_t>(this->get(mapping, static_cast<std::uint8_t>(entry)) & 0xFF);
      }
    }
    return (bits + 7) / 8;
  }
  void set_process_data() {
    outputs.assign(assigned_bytes(0x1C12), 0);
    inputs.assign(assigned_bytes(0x1C13), 0);
    const ethercat::Profile& profile = DeviceType::ethercat_profile;
    set_sync_manager(2, profile.outputs_start, static_cast<unsigned>(outputs.size()), 0x64);
    set_sync_manager(3, profile.inputs_start, static_cast<unsigned>(inputs.size()), 0x20);
    set_fmmu(0, outputs_address, static_cast<unsigned>(outputs.size()), profile.outputs_start, 2);
    set_fmmu(1, inputs_address, static_cast<unsigned>(inputs.size()), profile.inputs_start, 1);
  }
  void to_safe_operational() {
    set_process_data();
    ASSERT_EQ(request(4), good(4));
  }
  // From power-on, with the default PDOs.
  void to_operational() {
    to_pre_operational();
    to_safe_operational();
    exchange();
    ASSERT_EQ(request(8), good(8));
  }
  // Starts SYNC0 at the next whole period; in Pre-Operational.
  void start_sync0(std::uint32_t cycle_ns) {
    write(ethercat::reg::sync0_cycle, little_endian(cycle_ns));
    const std::uint64_t time = ethercat::load<std::uint64_t>(read(ethercat::reg::system_time, 8).data());
    write(ethercat::reg::sync_start_time, little_endian((time / cycle_ns + 10) * cycle_ns));
    write(ethercat::reg::sync_activation, little_endian(std::uint8_t{0x03}));
  }

  // ---- Process data ----

  // Sends outputs and reads inputs, once.
  void exchange() {
    if (!outputs.empty()) output_counter = send(ethercat::Command::lwr, outputs_address, outputs).counter;
    if (!inputs.empty()) {
      const Answer answer = send(ethercat::Command::lrd, inputs_address, Bytes(inputs.size()));
      input_counter = answer.counter;
      inputs = answer.data;
    }
  }
  template <typename T>
  void put(std::size_t at, T value) {
    ethercat::store(outputs.data() + at, value);
  }
  template <typename T>
  T input(std::size_t at) const {
    return ethercat::load<T>(inputs.data() + at);
  }
  // Runs `cycles` of `period_ms`: `prepare` sets the outputs of each; `inputs` has the inputs of the previous cycle.
  void run_cycles(int cycles, double period_ms, const std::function<void(int)>& prepare = {}) {
    for (int i = 0; i < cycles; ++i) {
      if (prepare) prepare(i);
      exchange();
      run_ms(period_ms);
    }
  }

  // ---- Mailbox ----

  void post(unsigned type, const Bytes& content) {
    Bytes mail(mailbox_bytes);
    ethercat::store_u16(mail.data(), static_cast<unsigned>(content.size()));
    mail_counter_ = mail_counter_ % 7 + 1;
    mail[5] = static_cast<std::uint8_t>(type | mail_counter_ << 4);
    std::copy(content.begin(), content.end(), mail.begin() + 6);
    ASSERT_EQ(write(DeviceType::ethercat_profile.mailbox_out.start, mail), 1U);
  }
  // The next mail, cut to its length; emergencies are stored separately. Empty: there is none.
  Bytes fetch() {
    for (;;) {
      const Answer answer =
          send(ethercat::Command::aprd, ethercat::address_of(0, DeviceType::ethercat_profile.mailbox_in.start),
               Bytes(mailbox_bytes));
      if (answer.counter == 0) return {};
      Bytes mail = answer.data;
      mail.resize(6U + ethercat::load_u16(mail.data()));
      const bool emergency = (mail[5] & 0x0F) == 3 && ethercat::load_u16(&mail[6]) >> 12 == 1;
      if (!emergency) return mail;
      emergencies.emplace_back(mail.begin() + 8, mail.end());
    }
  }
  // The CoE SDO part of request and answer.
  Bytes sdo(const Bytes& content) {
    Bytes message = little_endian(std::uint16_t{2U << 12});
    message.insert(message.end(), content.begin(), content.end());
    fetch();  // an emergency may be waiting
    post(3, message);
    const Bytes mail = fetch();
    if (mail.size() < 8) return {};
    return {mail.begin() + 8, mail.end()};
  }
  dictionary::AbortCode download(std::uint16_t index, std::uint8_t sub, std::int64_t value, unsigned bytes) {
    Bytes request = little_endian(static_cast<std::uint8_t>(0x23U | (4U - bytes) << 2U), index, sub,
                                  static_cast<std::uint32_t>(value));
    const Bytes answer = sdo(request);
    if (answer.size() == 8 && answer[0] == 0x80) return dictionary::AbortCode{ethercat::load_u32(&answer[4])};
    EXPECT_EQ(answer.size(), 8U);
    EXPECT_EQ(answer.empty() ? 0 : answer[0], 0x60);
    return dictionary::AbortCode::none;
  }
  // A number of up to four bytes; the abort code in `abort`.
  std::uint32_t upload(std::uint16_t index, std::uint8_t sub, dictionary::AbortCode* abort = nullptr) {
    const Bytes answer = sdo(little_endian(std::uint8_t{0x40}, index, sub, std::uint32_t{0}));
    if (answer.size() < 8) return 0;
    const std::uint32_t value = ethercat::load_u32(&answer[4]);
    if (abort != nullptr) *abort = dictionary::AbortCode{answer[0] == 0x80 ? value : 0};
    return value;
  }

  Bytes outputs;
  Bytes inputs;
  unsigned output_counter = 0;
  unsigned input_counter = 0;
  std::vector<Bytes> emergencies;  // error code, register, data: 8 bytes each
  std::array<ethercat::Segment::Slave, 1> slaves{{{.esc = &device.esc()}}};
  ethercat::Segment segment{slaves};

 private:
  unsigned mail_counter_ = 0;
};

}  // namespace servodrome::test
