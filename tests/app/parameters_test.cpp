// Parameters of every product: saved, changed, loaded into a drive as it leaves the factory; cut off in the middle;
// what a file may not hold. In virtual time, over CAN, EtherCAT and Modbus.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sstream>

#include "dictionary/dictionary.hpp"
#include "host/canopen/pre_operational.hpp"
#include "host/canopen/sdo_client.hpp"
#include "host/ethercat/coe_objects.hpp"
#include "host/modbus/objects.hpp"
#include "host/parameters/loader.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"

namespace servodrome::host {
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
    list =
        ParameterList::of_dictionary(modbus ? description.service_table : description.table, parameter_rules_of(name));
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
  // Every parameter that takes another value gets one; how many did.
  std::size_t change_all() {
    std::size_t changed = 0;
    for (const Parameter& parameter : list->all()) {
      if (parameter.address.index < 0x2000 || dictionary::size_of(parameter.type) == 0) continue;
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
  // The third TPDO gets another mapping, type and identifier.
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

template <typename Call>
std::string problem_of(Call call) {
  try {
    call();
  } catch (const HostError& error) {
    return error.what();
  }
  return "";
}

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
  for (const auto& one : compare(factory_parameters(*bench.list), now.values, bench.node_id, true)) {
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
  target.load(factory);
  EXPECT_EQ(target.differences(factory), "") << "and back";
}

// The supply goes away in the middle of the writing.
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
    EXPECT_THAT(error.what(), HasSubstr("were written (not stored): "));
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

// A value that no table forbids and the drive refuses: what was written before is taken back.
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
  // No drive has homing method 99 or quick stop 17.
  EXPECT_TRUE(change(GetParam().starts_with("jmc") ? ObjectAddress{0x6098, 0} : ObjectAddress{0x605D, 0}, 99));
  try {
    target.load(file);
    FAIL() << "the value cannot be";
  } catch (const LoadError& error) {
    EXPECT_EQ(error.outcome(), LoadError::Outcome::rolled_back) << error.what();
    EXPECT_THAT(error.what(), HasSubstr("was not taken: write refused"));
  } catch (const HostError& error) {
    EXPECT_THAT(error.what(), HasSubstr("nothing was written")) << "the table has the limit";
  }
  EXPECT_EQ(target.differences(before), "");
}

}  // namespace
}  // namespace servodrome::host
