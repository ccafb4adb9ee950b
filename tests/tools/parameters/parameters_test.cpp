// Parameters of every product: saved, changed, and loaded into a drive with factory settings; interrupted loads;
// invalid files. In virtual time, over CAN, EtherCAT and Modbus.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sstream>

#include "axis/axis402.hpp"
#include "catalogue/product.hpp"
#include "describe/description.hpp"
#include "dictionary/dictionary.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/canopen/pre_operational.hpp"
#include "master/canopen/sdo_client.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "master/modbus/objects.hpp"
#include "master/problem_of.hpp"
#include "tools/parameters/loader.hpp"

namespace servodrome::master {
namespace parameters_test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr std::uint8_t node = 5;

std::string line_of(const line::Product& product, bool modbus) {
  const bool can = product.fieldbus == line::Fieldbus::can;
  std::string text = fmt::format("clock = \"virtual\"\n[[bus]]\nname = \"b\"\n{}", can ? "" : "type = \"ethercat\"\n");
  if (modbus) text += "[[bus]]\nname = \"rs\"\ntype = \"rs485\"\n";
  text += fmt::format("[[axis]]\nname = \"x\"\nproduct = \"{}\"\nbus = \"b\"\n", product.name);
  if (can) text += fmt::format("node = {}\n", node);
  if (modbus) text += "serial = \"rs\"\nserial_protocol = \"modbus\"\n";
  return text;
}

// A drive of one product on its bus, and a master.
struct Bench {
  explicit Bench(std::string_view name, bool modbus = false)
      : product(*line::find_product(line::all_products(), name)),
        line(line::test::settings_of(line_of(product, modbus))) {
    line.run_until(200ms);
    if (modbus) {
      auto& rs485 = *line.find_serial_bus("rs");
      const ModbusOptions options{.format = {.bit_rate = 115200, .parity = modbus::Parity::none}, .timeout = 20ms};
      modbus_client = std::make_unique<ModbusClient>(std::make_unique<links::MemoryByteClient>(rs485.line, line),
                                                     ModbusClient::Framing::rtu, "mem:", options);
      const RegisterList registers{product.serial->registers, product.describe().service_table,
                                   product.serial->profile->word_order};
      objects = std::make_unique<ModbusObjects>(*modbus_client, std::uint8_t{node}, registers);
    } else if (product.fieldbus == line::Fieldbus::can) {
      bus = std::make_unique<Bus>(std::make_unique<links::MemoryCanClient>(line.buses()[0]->bus, line), "mem:", &line);
      objects = std::make_unique<SdoClient>(*bus, node, SdoOptions{.timeout = 50ms});
      node_id = node;
    } else {
      master = std::make_unique<EthercatMaster>(
          std::make_unique<links::MemoryEthercatClient>(line.ethercat_buses()[0]->bus, line));
      slave = std::make_unique<EthercatSlave>(*master, scan_slaves(*master).front(), 100ms);
      slave->to_pre_operational();
      objects = std::make_unique<CoeObjects>(*slave);
    }
    const auto description = product.describe();
    list = ParameterList::of_dictionary(modbus ? description.service_table : description.table,
                                        catalogue::product_of(name).rules);
  }

  ParameterFile save() {
    return {DriveIdentity::read(*objects, product.name), "", read_parameters(*objects, *list, node_id).values};
  }
  LoadReport load(const ParameterFile& file, LoadOptions options = {}) {
    options.node_id = node_id;
    options.before_communication = [this] {
      if (bus) PreOperational(*bus, node, *objects);
    };
    return load_parameters(*objects, file, "drive.par", *list, DriveIdentity::read(*objects, product.name), options);
  }
  std::string differences(const ParameterFile& file) {
    const auto now = read_parameters(*objects, *list, node_id).values;
    std::string text;
    for (const ParameterDifference& one : compare(file.values, now, node_id)) {
      text += fmt::format("{} {} / {}\n", text_of(one.address), one.left ? text_of(*one.left) : "-",
                          one.right ? text_of(*one.right) : "-");
    }
    return text;
  }
  // Changes every parameter that accepts another value; returns the number of changes.
  std::size_t change_all() {
    std::size_t changed = 0;
    for (const Parameter& parameter : list->all()) {
      // A different function or level of an iSMK input could enable the motor.
      const bool is_input = parameter.address.index == 0x2010 && product.name.starts_with("ismk");
      if (parameter.address.index < 0x2000 || is_input || dictionary::size_of(parameter.type) == 0) continue;
      const auto now = read_parameter(*objects, parameter.address, parameter.type);
      if (!now || parameter.type == dictionary::Type::real32) continue;
      const std::int64_t number = dictionary::decode_number(parameter.type, *now);
      const std::int64_t other =
          number == parameter.maximum.value_or(dictionary::maximum_of(parameter.type)) ? number - 1 : number + 1;
      const auto bytes = dictionary::encode_number(other);
      try {
        objects->download(parameter.address, std::span(bytes).first(dictionary::size_of(parameter.type)));
        ++changed;
      } catch (const ObjectError& error) {
        EXPECT_TRUE(error.answered()) << error.what();
      }
    }
    return changed;
  }
  // Gives the third TPDO another mapping, type and identifier.
  void remap() {
    if (!bus) return;
    objects->write<std::uint32_t>(0x1802, 1, 0x80000480U + node);
    objects->write<std::uint8_t>(0x1A02, 0, 0);
    objects->write<std::uint32_t>(0x1A02, 1, 0x60410010);
    objects->write<std::uint8_t>(0x1A02, 0, 1);
    objects->write<std::uint8_t>(0x1802, 2, 1);
    objects->write<std::uint32_t>(0x1803, 1, 0x80000380U + node);
    objects->write<std::uint32_t>(0x1802, 1, 0x480U + node);
  }

  const line::Product& product;
  line::Line line;
  std::unique_ptr<Bus> bus;
  std::unique_ptr<ModbusClient> modbus_client;
  std::unique_ptr<EthercatMaster> master;
  std::unique_ptr<EthercatSlave> slave;
  std::unique_ptr<ObjectClient> objects;
  std::optional<ParameterList> list;
  NodeId node_id{};
};

using test::problem_of;

ParameterFile read(const std::string& text) {
  std::istringstream in(text);
  return ParameterFile::read(in, "drive.par");
}

class EveryProduct : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Products, EveryProduct,
                         testing::Values("ismc", "pronet", "ismk", "jmc_ec", "generic402", "generic402-ec", "ismk-ea"),
                         [](const auto& one) {
                           std::string name = one.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST_P(EveryProduct, AFactoryDriveHasItsFactoryValues) {
  Bench bench(GetParam());
  const auto now = read_parameters(*bench.objects, *bench.list, bench.node_id);
  EXPECT_TRUE(now.absent.empty()) << text_of(now.absent);
  std::string text;
  const auto factory = factory_parameters(*bench.list);
  for (const auto& one : compare(factory, now.values, bench.node_id, true)) {
    text += fmt::format("{} {} {}\n", text_of(one.address), text_of(*one.left), text_of(*one.right));
  }
  EXPECT_EQ(text, "");
}

TEST_P(EveryProduct, SavesAndLoadsIntoAFactoryDrive) {
  Bench source(GetParam());
  const ParameterFile factory = source.save();
  const std::size_t changed = source.change_all();
  source.remap();
  const ParameterFile saved = source.save();
  EXPECT_GT(changed, 20U);
  EXPECT_FALSE(compare(factory.values, saved.values, source.node_id).empty());
  const std::string text = saved.text();
  const ParameterFile file = read(text);
  EXPECT_EQ(file.text(), text) << "what is read is what was written";

  Bench target(GetParam());
  EXPECT_NE(target.differences(file), "");
  const LoadReport report = target.load(file);
  EXPECT_EQ(report.compared, file.values.size());
  EXPECT_GT(report.written.size(), changed / 2);
  EXPECT_EQ(target.differences(file), "");
  EXPECT_EQ(target.load(file).written.size(), 0U) << "a second load has nothing to do";
  std::printf("%s: %zu parameters, %zu changed, %zu written\n", GetParam().c_str(), file.values.size(), changed,
              report.written.size());
  ParameterFile back = factory;
  // 605Dh of a ProNet is 0 by default, a value that cannot be written (its README, C21).
  std::erase_if(back.values, [&](const ParameterValue& value) {
    return GetParam() == "pronet" && value.address == ObjectAddress{0x605D, 0};
  });
  target.load(back);
  EXPECT_TRUE(compare(back.values, target.save().values, target.node_id, true).empty()) << target.differences(back);
}

// The supply fails in the middle of the load.
TEST_P(EveryProduct, ALoadThatIsCutSaysWhatWasWrittenAndASecondCompletes) {
  Bench source(GetParam());
  source.change_all();
  const ParameterFile file = source.save();
  Bench target(GetParam());
  bool cut = false;
  LoadOptions options{.progress = [&](const char* doing, std::size_t done, std::size_t) {
    if (std::string_view(doing) != "writing" || done != 10 || cut) return;
    cut = true;
    if (target.bus) {
      target.line.buses()[0]->bus.cut_bus(true);
    } else {
      target.line.axes()[0]->power_off(target.line.now());
    }
  }};
  try {
    target.load(file, options);
    FAIL() << "the drive was gone";
  } catch (const LoadError& error) {
    EXPECT_EQ(error.outcome(), LoadError::Outcome::bus_lost) << error.what();
    EXPECT_GE(error.written().size(), 10U);
    EXPECT_LE(error.written().size(), 11U) << "the one under way may have come through";
    EXPECT_THAT(error.what(), HasSubstr("were written: "));
    EXPECT_THAT(error.what(), HasSubstr(text_of(error.written().front())));
  }
  EXPECT_TRUE(cut);
  if (target.bus) {
    target.line.buses()[0]->bus.cut_bus(false);
  } else {
    target.line.axes()[0]->power_on(target.line.now());
  }
  target.line.run_until(target.line.now() + 1s);
  if (target.slave) {
    target.slave = std::make_unique<EthercatSlave>(*target.master, scan_slaves(*target.master).front(), 100ms);
    target.slave->to_pre_operational();
    target.objects = std::make_unique<CoeObjects>(*target.slave);
  }
  target.load(file);
  EXPECT_EQ(target.differences(file), "");
}

// A value that no table forbids but the drive refuses: the values written before must be restored.
TEST_P(EveryProduct, ARefusedValueTakesTheOthersBack) {
  Bench target(GetParam());
  target.remap();
  const ParameterFile before = target.save();
  ParameterFile file = before;
  const auto change = [&](ObjectAddress address, std::int64_t number) {
    for (ParameterValue& value : file.values) {
      if (!(value.address == address)) continue;
      const auto bytes = dictionary::encode_number(number);
      value.bytes.assign(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(value.bytes.size()));
      return true;
    }
    return false;
  };
  EXPECT_TRUE(change({0x6083, 0}, 4711));
  if (target.bus) {
    EXPECT_TRUE(change({0x1A02, 1}, 0x60640020));
  }
  EXPECT_TRUE(change({0x60C2, 2}, 63) || change({0x6084, 0}, 4712));
  // No drive has homing method 99 or quick stop option 99.
  EXPECT_TRUE(change(GetParam().starts_with("jmc") ? ObjectAddress{0x6098, 0} : ObjectAddress{0x605D, 0}, 99));
  try {
    target.load(file);
    FAIL() << "the value cannot be";
  } catch (const LoadError& error) {
    EXPECT_EQ(error.outcome(), LoadError::Outcome::rolled_back) << error.what();
    EXPECT_THAT(error.what(), HasSubstr("was not accepted: write refused"));
  } catch (const MasterError& error) {
    EXPECT_THAT(error.what(), HasSubstr("nothing was written")) << "the table has the limit";
  }
  EXPECT_EQ(target.differences(before), "");
}

// Over Modbus: only objects that have a register.
class OverModbus : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Products, OverModbus, testing::Values("generic402", "ismk"));

TEST_P(OverModbus, SavesAndLoads) {
  Bench source(GetParam(), true);
  source.change_all();
  const ParameterFile file = read(source.save().text());
  EXPECT_GT(file.values.size(), 50U);
  Bench target(GetParam(), true);
  EXPECT_GT(target.load(file).written.size(), 10U);
  EXPECT_EQ(target.differences(file), "");
  std::printf("%s over Modbus: %zu parameters\n", GetParam().c_str(), file.values.size());
}

TEST(Parameters, OfAProductAreNotLoadedIntoAnother) {
  const ParameterFile file = Bench("ismc").save();
  Bench target("generic402");
  EXPECT_THAT(problem_of([&] { target.load(file); }),
              HasSubstr("drive.par: the parameters are of another product, ismc"));
  EXPECT_THAT(problem_of([&] { target.load(file, {.force = true}); }), HasSubstr("nothing was written"));
  ParameterFile few = file;
  std::erase_if(few.values, [](const ParameterValue& value) { return value.address.index != 0x6083; });
  few.values[0].bytes = parse_value("777", dictionary::Type::unsigned32);
  EXPECT_EQ(target.load(few, {.force = true}).written.size(), 1U);
  EXPECT_EQ(target.objects->read<std::uint32_t>(0x6083), 777U);
}

TEST(Parameters, AnEnabledDriveTakesNone) {
  Bench bench("generic402");
  const ParameterFile file = bench.save();
  Axis402(*bench.objects).enable();
  EXPECT_THAT(problem_of([&] { bench.load(file); }), HasSubstr("state operation enabled; disable it"));
}

TEST(Parameters, AreCheckedBeforeTheFirstWrite) {
  Bench bench("generic402");
  const ParameterFile factory = bench.save();
  const auto with = [&](const std::string& lines) {
    return read("# servodrome parameters 1\nproduct: generic402\n" + lines + "end\n");
  };
  const std::string problem = problem_of([&] {
    bench.load(with("6083:00 u32 4711\n2011:01 u16 49\n2011:02 u16 501\n6098:00 u8 3\n6041:00 u16 1\n2F00:00 u8 3\n"));
  });
  EXPECT_THAT(problem, HasSubstr("5 of 6 values cannot be loaded"));
  EXPECT_THAT(problem, HasSubstr("drive.par:4:13: 2011:01: 49 is below the minimum, 50"));
  EXPECT_THAT(problem, HasSubstr("drive.par:5:13: 2011:02: 501 is above the maximum, 500"));
  EXPECT_THAT(problem, HasSubstr("drive.par:6:12: 6098:00: its type is i8, not u8"));
  EXPECT_THAT(problem, HasSubstr("drive.par:7:13: 6041:00: it is not a parameter of this drive"));
  EXPECT_THAT(problem, HasSubstr("2F00:00: it is a communication setting"));
  EXPECT_EQ(bench.differences(factory), "");
  EXPECT_EQ(bench.load(with("6083:00 u32 4711\n")).written.size(), 1U) << "a part of a file is a file";
}

// Stored parameters survive power-off, and the file of one node can be loaded into another.
TEST(Parameters, AreStoredAndRelativeToTheNode) {
  for (const char* product : {"generic402", "ismc", "ismk"}) {
    Bench bench(product);
    bench.load(read(fmt::format("# servodrome parameters 1\nproduct: {}\n6083:00 u32 4711\nend\n", product)));
    EXPECT_TRUE(store_parameters(*bench.objects, bench.list->rules()));
    bench.line.axes()[0]->power_off(bench.line.now());
    bench.line.run_until(bench.line.now() + 100ms);
    bench.line.axes()[0]->power_on(bench.line.now());
    bench.line.run_until(bench.line.now() + 1s);
    EXPECT_EQ(bench.objects->read<std::uint32_t>(0x6083), 4711U) << product;
    EXPECT_THAT(bench.save().text(), HasSubstr("1800:01  u32     $NODEID+180h"));
  }
  EXPECT_FALSE(store_parameters(*Bench("pronet").objects, catalogue::product_of("pronet").rules));
}

// A node whose heartbeat shows operational must be operational again afterwards.
TEST(Parameters, PdosAreChangedInPreOperationalAndTheNodeIsStartedAgain) {
  Bench bench("generic402");
  Master master(*bench.bus);
  bench.objects->write<std::uint16_t>(0x1017, 0, 20);
  master.command_and_wait(NmtCommand::start, node, 1s);
  bool was_pre_operational = false;
  const auto on_state = [&](std::uint8_t, NmtState state) {
    was_pre_operational = was_pre_operational || state == NmtState::pre_operational;
  };
  master.on_state(on_state);
  PreOperational state(*bench.bus, node, *bench.objects);
  EXPECT_FALSE(state.was_unknown());
  EXPECT_EQ(master.health(node).state, NmtState::pre_operational);
  state.leave();
  bench.bus->run_for(100ms);
  EXPECT_EQ(master.health(node).state, NmtState::operational);
  EXPECT_TRUE(was_pre_operational);
}

// With the drive's own description instead of this project's dictionary.
TEST(Parameters, AreFoundByAnEdsAndBySdoInformation) {
  Bench can("generic402");
  std::istringstream in(describe::eds(can.product.describe()));
  const ObjectCatalogue sheet = ObjectCatalogue::read_eds(in, "generic402.eds");
  const auto& rules = catalogue::product_of("generic402").rules;
  const ParameterList by_sheet = ParameterList::of_data_sheet(sheet, rules);
  Bench ring("generic402-ec");
  const ParameterList by_slave = ParameterList::of_slave(ring.slave->coe(), rules);
  for (const auto& [list, known] : {std::pair{&by_sheet, &*can.list}, std::pair{&by_slave, &*ring.list}}) {
    std::vector<std::string> addresses;
    std::vector<std::string> expected;
    for (const Parameter& one : list->all()) addresses.push_back(text_of(one.address));
    for (const Parameter& one : known->all()) expected.push_back(text_of(one.address));
    EXPECT_THAT(addresses, testing::ContainerEq(expected));
    ASSERT_NE(list->find({0x2011, 2}), nullptr);
    EXPECT_EQ(list->find({0x2011, 2})->maximum, 500);
    EXPECT_EQ(list->find({0x2011, 2})->factory, 100);
  }
  EXPECT_TRUE(by_sheet.find({0x1800, 1})->adds_node_id);
}

struct DamagedFile {
  std::string text;
  const char* problem;
};
class Damaged : public testing::TestWithParam<DamagedFile> {};
const std::string head = "# servodrome parameters 1\n";
INSTANTIATE_TEST_SUITE_P(
    Files, Damaged,
    testing::Values(
        DamagedFile{"", "drive.par:1:1: the file is empty"},
        DamagedFile{"6083:00 u32 1\nend\n", "drive.par:1:1: this is not a parameter file"},
        DamagedFile{head + "6083:00 u32 1\n", "drive.par:2:1: the file ends without its line \"end\""},
        DamagedFile{head + "6083 u32 1\nend\n", "drive.par:2:1: \"6083\" is not an object"},
        DamagedFile{head + "6083:0G u32 1\nend\n", "drive.par:2:1: \"6083:0G\" is not an object"},
        DamagedFile{head + "\n6083:00 u33 1\nend\n", "drive.par:3:9: \"u33\" is not a type"},
        DamagedFile{head + "6083:00 u32\nend\n", "drive.par:2:12: there is no value"},
        DamagedFile{head + "6083:00 u8 256\nend\n", "drive.par:2:12: \"256\" is not a value of type u8"},
        DamagedFile{head + "6083:00 i8 -129\nend\n", "drive.par:2:12: \"-129\" is not a value of type i8"},
        DamagedFile{head + "6083:00 u32 1.5\nend\n", "drive.par:2:13: \"1.5\" is not a value of type u32"},
        DamagedFile{head + "2000:00 f32 nan\nend\n", "drive.par:2:13: \"nan\" is not a finite number"},
        DamagedFile{head + "2000:00 f32 -inf\nend\n", "drive.par:2:13: \"-inf\" is not a finite number"},
        DamagedFile{head + "2000:00 f32 1e99\nend\n", "drive.par:2:13: \"1e99\" is not a value of type f32"},
        DamagedFile{head + "2000:00 string \"a\nend\n", "drive.par:2:16: the text has no closing quote"},
        DamagedFile{head + "2000:00 string \"\\q\"\nend\n", "drive.par:2:16: after \\ comes"},
        DamagedFile{head + "2000:00 string \"\\x4\"\nend\n", "drive.par:2:16: after \\ comes"},
        DamagedFile{head + "2000:00 bytes 123\nend\n", "drive.par:2:15: \"123\" is not a value of type bytes"},
        DamagedFile{head + "2000:00 f32 $NODEID+1\nend\n", "drive.par:2:13: only a whole number"},
        DamagedFile{head + "6083:00 u32 1\n 6083:00 u32 2\nend\n",
                    "drive.par:3:2: 6083:00 is there already, in line 2"},
        DamagedFile{head + "vendor: many\nend\n", "drive.par:2:9: \"many\" is not a value of type u32"},
        DamagedFile{head + "end\n6083:00 u32 1\n", "drive.par:3:1: something comes behind the line \"end\""},
        DamagedFile{head + std::string("60\0", 3) + "83:00 u32 1\nend\n", "holds a zero byte"}));

TEST_P(Damaged, FileSaysLineAndColumn) {
  EXPECT_THAT(problem_of([&] { read(GetParam().text); }), HasSubstr(GetParam().problem));
}

TEST(ParameterFiles, KeepEveryTypeAndComeBackWithWindowsLineEnds) {
  const std::string text =
      head +
      "product: generic402\r\nvendor: 53455256h\r\ndevice: \"a \\\"b\\\" \\\\ \\x01\"\r\n"
      "1800:01 u32 $NODEID+180h\r\n# a comment\r\n2000:01 i64 -9223372036854775808\r\n"
      "2000:02 u64 18446744073709551615\r\n2000:03 f32 0.1 [V/A] a [b] c\r\n2000:04 bool 1\r\n"
      "2000:05 string \"\"\r\n2000:06 bytes -\r\n2000:07 bytes 00FF\r\n2000:08 i16 8000h\r\nend\r\n";
  const ParameterFile file = read(text);
  EXPECT_EQ(file.identity.device_name, "a \"b\" \\ \x01");
  EXPECT_EQ(file.find({0x2000, 3})->unit, "V/A");
  EXPECT_EQ(file.find({0x2000, 3})->name, "a [b] c");
  EXPECT_EQ(text_of(*file.find({0x2000, 1})), "-9223372036854775808");
  EXPECT_EQ(text_of(*file.find({0x2000, 2})), "18446744073709551615");
  EXPECT_EQ(text_of(*file.find({0x2000, 3})), "0.1");
  EXPECT_EQ(text_of(*file.find({0x2000, 8})), "-32768");
  EXPECT_EQ(bytes_for(*file.find({0x1800, 1}), std::uint8_t{5}), parse_value("389", dictionary::Type::unsigned32));
  EXPECT_THAT(problem_of([&] { bytes_for(*file.find({0x1800, 1}), std::nullopt); }), HasSubstr("node-ID"));
  EXPECT_EQ(read(file.text()).text(), file.text());
}

}  // namespace
}  // namespace parameters_test
}  // namespace servodrome::master
