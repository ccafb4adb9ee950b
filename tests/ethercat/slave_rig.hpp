#pragma once

#include <climits>
#include <functional>
#include <string>

#include "esc_rig.hpp"
#include "ethercat/slave/communication_section.hpp"
#include "ethercat/slave/slave.hpp"

// A slave with CoE and its controller, and a master with a mailbox, in virtual time.
namespace servodrome::ethercat::test {

using dictionary::AbortCode;
using Communication = CommunicationObjects<4, 4, 12, 4>;

struct DeviceObjects {
  Communication communication;
  std::uint16_t controlword = 0;
  std::uint16_t statusword = 0;
  std::int32_t target_position = 0;
  std::int32_t position_actual = 0;
  std::int8_t mode = 0;
  std::int8_t mode_display = 0;
  std::uint32_t digital_inputs = 0;
  bool flag_out = false;
  bool flag_in = false;
  std::int16_t ranged = 0;
  std::uint64_t wide = 0;
  std::uint32_t secret = 0;
  std::uint16_t owned = 0;
  dictionary::Blob<40> name;
  dictionary::Blob<3000> big;
  std::array<std::uint16_t, 3> record16{};
  std::array<bool, 10> bits{};
  std::uint16_t after_bits = 0;
};

inline constexpr auto device_table = dictionary::make_table<[] {
  using namespace dictionary;
  using O = DeviceObjects;
  TableBuilder<300> t;
  t.append(communication_section<Communication>, offsetof(O, communication));
  t.add(text_constant(0x1008, "Manufacturer device name", "Servodrome EtherCAT test device"));
  t.set_default(0x1000, 0, 0x00020192);
  t.set_default(0x1018, 1, 0x66668888).set_default(0x1018, 2, 0x1234).set_default(0x1018, 3, 0x00010002);
  t.add(var(0x2001, "Name", SERVODROME_FIELD(O, name), Access::rw));
  t.add(var(0x2002, "Big", SERVODROME_FIELD(O, big), Access::rw));
  t.add(var(0x2003, "Wide", SERVODROME_FIELD(O, wide), Access::rw, Pdo::both, {.saved = true}));
  t.add(var(0x2005, "Secret", SERVODROME_FIELD(O, secret), Access::wo));
  t.add(var(0x2006, "Ranged", SERVODROME_FIELD(O, ranged), Access::rw, Pdo::both,
            {.default_value = 7, .minimum = -100, .maximum = 100, .unit = "rpm"}));
  t.add(var(0x2007, "Owned", SERVODROME_FIELD(O, owned), Access::rw, Pdo::both, {.owner = Owner::drive}));
  t.add(highest_sub(0x2010, ObjectCode::record, "Record", 3));
  for (std::uint8_t i = 0; i < 3; ++i) {
    t.add(element(0x2010, static_cast<std::uint8_t>(i + 1), ObjectCode::record, "Word",
                  field_at<std::uint16_t>(offsetof(O, record16) + i * 2U), Access::rw));
  }
  t.add(highest_sub(0x2011, ObjectCode::record, "Bits", 11));
  for (std::uint8_t i = 0; i < 10; ++i) {
    t.add(element(0x2011, static_cast<std::uint8_t>(i + 1), ObjectCode::record, "Bit",
                  field_at<bool>(offsetof(O, bits) + i), Access::rw));
  }
  t.add(element(0x2011, 11, ObjectCode::record, "After", SERVODROME_FIELD(O, after_bits), Access::rw));
  t.add(var(0x2020, "Flag out", SERVODROME_FIELD(O, flag_out), Access::rw, Pdo::rpdo));
  t.add(var(0x2021, "Flag in", SERVODROME_FIELD(O, flag_in), Access::ro, Pdo::tpdo));
  t.add(var(0x6040, "Controlword", SERVODROME_FIELD(O, controlword), Access::rw, Pdo::rpdo));
  t.add(var(0x6041, "Statusword", SERVODROME_FIELD(O, statusword), Access::ro, Pdo::tpdo));
  t.add(var(0x6060, "Modes of operation", SERVODROME_FIELD(O, mode), Access::rw, Pdo::rpdo));
  t.add(var(0x6061, "Modes of operation display", SERVODROME_FIELD(O, mode_display), Access::ro, Pdo::tpdo));
  t.add(var(0x6064, "Position actual value", SERVODROME_FIELD(O, position_actual), Access::ro, Pdo::tpdo));
  t.add(var(0x607A, "Target position", SERVODROME_FIELD(O, target_position), Access::rw, Pdo::rpdo));
  t.add(var(0x60FD, "Digital inputs", SERVODROME_FIELD(O, digital_inputs), Access::ro, Pdo::tpdo));
  t.set_default(0x1600, 0, 3).set_default(0x1600, 1, 0x60400010).set_default(0x1600, 2, 0x60600008);
  t.set_default(0x1600, 3, 0x607A0020);
  t.set_default(0x1A00, 0, 3).set_default(0x1A00, 1, 0x60410010).set_default(0x1A00, 2, 0x60610008);
  t.set_default(0x1A00, 3, 0x60640020);
  t.set_default(0x1C12, 0, 1).set_default(0x1C12, 1, 0x1600);
  t.set_default(0x1C13, 0, 1).set_default(0x1C13, 1, 0x1A00);
  return t;
}>();
static_assert(dictionary::is_valid_table(device_table));

struct Change {
  AlState from, to;
  AlStatusCode cause;
  bool operator==(const Change&) const = default;
};

struct DeviceEvents final : SlaveEvents, dictionary::Listener {
  explicit DeviceEvents(DeviceObjects& device) : objects(device) {}
  AlStatusCode may_change(AlState, AlState to) override {
    if (to != refused || refusals == 0) return AlStatusCode::none;
    --refusals;
    return refusal;
  }
  void state_changed(AlState from, AlState to, AlStatusCode cause, Time) override {
    changes.push_back({from, to, cause});
  }
  // A drive whose actual position is its target.
  void process_data(Time) override {
    ++cycles;
    objects.position_actual = objects.target_position + 1;
    objects.mode_display = objects.mode;
    objects.statusword = static_cast<std::uint16_t>(objects.controlword | 0x8000);
  }
  void sync0(Time now) override { sync_times.push_back(now); }
  AbortCode check(const dictionary::Entry&, std::span<const std::byte> value) override {
    return value[0] == std::byte{0xEE} ? AbortCode::value_invalid : AbortCode::none;
  }
  void written(const dictionary::Entry& entry) override {
    if (on_write) on_write();
    told.push_back(entry.index);
    position_when_told = objects.target_position;
  }

  DeviceObjects& objects;
  AlState refused{};
  unsigned refusals = UINT_MAX;  // number of requests that it still refuses
  AlStatusCode refusal = AlStatusCode::none;
  std::vector<Change> changes;
  unsigned cycles = 0;
  std::vector<Time> sync_times;
  std::vector<std::uint16_t> told;
  std::int32_t position_when_told = 0;
  std::function<void()> on_write;
};

class SlaveRig : public testing::Test {
 protected:
  static constexpr std::uint16_t mailbox_size = 128;

  explicit SlaveRig(const Profile& rules = {}) : profile(rules) {
    dictionary.set_listener(dictionary::Owner::drive, &events);
    dictionary.load_defaults(dictionary::Area::all, 0);
    slave.start(line.now);
  }

  // Advances time from deadline to deadline of the slave.
  void run(Time span) {
    const Time end = line.now + span;
    while (slave.next_deadline(line.now) <= end) {
      line.now = std::max(line.now, slave.next_deadline(line.now));
      slave.poll(line.now);
    }
    line.now = end;
  }
  Answer send(Command command, std::uint32_t address, const Bytes& data) {
    Answer answer = line.send(command, address, data);
    slave.poll(line.now);
    return answer;
  }
  Answer write(std::uint16_t offset, const Bytes& data) { return send(Command::apwr, address_of(0, offset), data); }
  Answer read(std::uint16_t offset, std::size_t length) {
    return send(Command::aprd, address_of(0, offset), Bytes(length));
  }

  void set_mailbox(std::uint16_t size = mailbox_size) {
    line.set_sync_manager(0, 0, 0x1000, size, 0x26);
    line.set_sync_manager(0, 1, 0x1100, size, 0x22);
  }
  void set_mailbox_anew(std::uint16_t size) {
    line.send(Command::bwr, address_of(0, reg::sync_manager), Bytes(16));
    set_mailbox(size);
    slave.poll(line.now);
  }
  void set_process_data(unsigned outputs, unsigned inputs) {
    if (outputs != 0) line.set_sync_manager(0, 2, 0x1200, outputs, 0x64);
    if (inputs != 0) line.set_sync_manager(0, 3, 0x1500, inputs, 0x20);
    line.set_fmmu(0, 0, 0x1000, outputs, 0x1200, 2);
    line.set_fmmu(0, 1, 0x1100, inputs, 0x1500, 1);
    slave.poll(line.now);
  }
  // AL status and AL status code after a request.
  std::pair<unsigned, AlStatusCode> request(unsigned control) {
    EXPECT_EQ(write(reg::al_control, {static_cast<std::uint8_t>(control), 0}).counter, 1U);
    return status();
  }
  std::pair<unsigned, AlStatusCode> status() {
    return {line.get<std::uint16_t>(0, reg::al_status),
            static_cast<AlStatusCode>(line.get<std::uint16_t>(0, reg::al_status_code))};
  }
  static std::pair<unsigned, AlStatusCode> good(unsigned state) { return {state, AlStatusCode::none}; }
  void to_pre_operational() {
    set_mailbox();
    ASSERT_EQ(request(2), good(2));
  }
  void to_safe_operational() {
    to_pre_operational();
    set_process_data(7, 7);
    ASSERT_EQ(request(4), good(4));
  }
  void to_operational() {
    to_safe_operational();
    cycle();
    ASSERT_EQ(request(8), good(8));
  }
  // Sends controlword 0Fh, mode 8 and a target; returns the inputs.
  Bytes cycle(std::int32_t target = 0, std::uint16_t controlword = 0x0F) {
    Bytes outputs(7);
    store_u16(outputs.data(), controlword);
    outputs[2] = 8;
    store(outputs.data() + 3, target);
    send(Command::lwr, 0x1000, outputs);
    return send(Command::lrd, 0x1100, Bytes(7)).data;
  }

  // ---- Mailbox ----

  void post(unsigned type, const Bytes& content, int counter = -1) {
    Bytes mail(load_u16(line.escs[0]->registers(0x0802)));
    store_u16(mail.data(), static_cast<unsigned>(content.size()));
    if (counter < 0) mail_counter = mail_counter % 7 + 1;
    mail[5] = static_cast<std::uint8_t>(type | (counter < 0 ? mail_counter : static_cast<unsigned>(counter)) << 4);
    std::copy(content.begin(), content.end(), mail.begin() + 6);
    ASSERT_EQ(write(0x1000, mail).counter, 1U);
  }
  // The next mail, with the header cut to its length; empty if there is none.
  Bytes fetch() {
    const Answer answer = read(0x1100, load_u16(line.escs[0]->registers(0x080A)));
    if (answer.counter == 0) return {};
    Bytes mail = answer.data;
    mail.resize(6U + load_u16(mail.data()));
    return mail;
  }
  Bytes coe(unsigned service, const Bytes& content) {
    Bytes message = words({service << 12});
    message.insert(message.end(), content.begin(), content.end());
    post(3, message);
    const Bytes mail = fetch();
    if (mail.size() < 8) return {};
    EXPECT_EQ(mail[5] & 0x0F, 3);
    answered_service = load_u16(&mail[6]) >> 12;
    return {mail.begin() + 8, mail.end()};
  }
  Bytes sdo(const Bytes& content) { return coe(2, content); }
  static Bytes join(std::initializer_list<Bytes> parts) {
    Bytes all;
    for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
  }
  static Bytes head(unsigned command, std::uint16_t index, unsigned sub) {
    return {static_cast<std::uint8_t>(command), static_cast<std::uint8_t>(index), static_cast<std::uint8_t>(index >> 8),
            static_cast<std::uint8_t>(sub)};
  }
  AbortCode download(std::uint16_t index, unsigned sub, std::uint32_t value, unsigned bytes) {
    return code_of(sdo(join({head(0x23 | (4 - bytes) << 2, index, sub), bytes_of(value)})));
  }
  static AbortCode code_of(const Bytes& answer) {
    if (answer.size() == 8 && answer[0] == 0x80) return static_cast<AbortCode>(load_u32(&answer[4]));
    return AbortCode::none;
  }
  // A complete upload, in segments if necessary.
  Bytes upload(std::uint16_t index, unsigned sub, bool complete = false, AbortCode* code = nullptr) {
    Bytes answer = sdo(join({head(complete ? 0x50 : 0x40, index, sub), bytes_of(std::uint32_t{0})}));
    if (code != nullptr) *code = code_of(answer);
    if (answer.size() < 8 || answer[0] == 0x80) return {};
    if ((answer[0] & 2) != 0) return {answer.begin() + 4, answer.begin() + 8 - (answer[0] >> 2 & 3)};
    const std::uint32_t size = load_u32(&answer[4]);
    Bytes all(answer.begin() + 8, answer.end());
    segments = 0;
    for (unsigned toggle = 0; all.size() < size; toggle ^= 0x10U) {
      answer = sdo({static_cast<std::uint8_t>(0x60 | toggle), 0, 0, 0, 0, 0, 0, 0});
      ++segments;
      if (answer.size() < 8 || (answer[0] & 0xF0) != toggle) return {};
      const std::size_t count = answer.size() - 1 - (answer[0] >> 1 & 7);
      all.insert(all.end(), answer.begin() + 1, answer.begin() + 1 + static_cast<std::ptrdiff_t>(count));
      EXPECT_EQ((answer[0] & 1) != 0, all.size() == size);
    }
    return all;
  }

  Profile profile;
  Line line{1, Time{0}};
  DeviceObjects objects;
  dictionary::Dictionary dictionary{device_table, std::as_writable_bytes(std::span(&objects, 1))};
  DeviceEvents events{objects};
  SlaveStorage<64, 256, 4096> storage;
  Slave slave{*line.escs[0], dictionary, profile, events, storage.memory()};
  unsigned mail_counter = 0;
  unsigned answered_service = 0;
  unsigned segments = 0;
};

}  // namespace servodrome::ethercat::test
