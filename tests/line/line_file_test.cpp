#include "line/line_file.hpp"

#include <fmt/format.h>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sstream>

#include "line/model_plant.hpp"
#include "line/plant_keys.hpp"
#include "source_dir.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace line_file_test {
namespace {

using testing::HasSubstr;

std::string text_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

const std::string source_dir = SERVODROME_SOURCE_DIR;

TEST(LineFile, TheShippedLinesAreRight) {
  for (const char* name : {"default", "eight-axes", "ethercat", "gantry"}) {
    const LineFile file = load_line_file(source_dir + "/lines/" + name + ".toml", all_products());
    for (const Diagnostic& diagnostic : file.diagnostics) ADD_FAILURE() << to_string(diagnostic);
    for (const Diagnostic& warning : file.warnings) ADD_FAILURE() << to_string(warning);
  }
  const LineFile eight = load_line_file(source_dir + "/lines/eight-axes.toml", all_products());
  EXPECT_EQ(eight.settings.axes.size(), 8U);
  EXPECT_EQ(eight.settings.axes[7].bus, 1U);
}

// Values that the plant cannot represent, or that no machine has: the line accepts them with a warning. Each value is
// at its limit.
TEST(LineFile, WarnsOfWhatThePlantCannotShow) {
  struct Case {
    const char* group;
    const char* without;
    const char* with;
    const char* about;
  };
  for (const Case& one : {
           Case{"motor", "rated_torque_nm = 1.30", "rated_torque_nm = 1.32", "rated_torque_nm"},
           Case{"motor", "pole_pairs = 50\ntorque_constant_nm_per_a = 0.47\nrated_speed_rpm = 3000",
                "pole_pairs = 52\ntorque_constant_nm_per_a = 0.47\nrated_speed_rpm = 3000", "rated_speed_rpm"},
           Case{"supply", "volts = 126", "volts = 115", "torque_constant_nm_per_a"},
           Case{"load", "elastic = true\nstiffness_nm_per_rad = 3500", "elastic = true\nstiffness_nm_per_rad = 3700",
                "stiffness_nm_per_rad"},
           Case{"load", "stop_stiffness_nm_per_rad = 2.2e8", "stop_stiffness_nm_per_rad = 2.3e8",
                "stop_stiffness_nm_per_rad"},
       }) {
    const auto warnings_of = [&](const char* lines) {
      const std::string text = fmt::format(
          "[[bus]]\nname = \"can0\"\n[[axis]]\nname = \"x\"\nproduct = \"generic402\"\nnode = 1\n"
          "[axis.travel]\ncounts_per_unit = 131072\nhigh_stop = 10\n[axis.{}]\n{}\n",
          one.group, lines);
      const LineFile file = parse_line_file(text, "test.toml", all_products());
      for (const Diagnostic& diagnostic : file.diagnostics) ADD_FAILURE() << to_string(diagnostic);
      return file.warnings;
    };
    for (const Diagnostic& warning : warnings_of(one.without)) ADD_FAILURE() << to_string(warning);
    const std::vector<Diagnostic> warnings = warnings_of(one.with);
    ASSERT_EQ(warnings.size(), 1U) << one.with;
    EXPECT_THAT(warnings[0].what, HasSubstr(one.about));
  }
}

TEST(LineFile, TheBuiltInLineIsTheDefaultFile) {
  EXPECT_EQ(default_line_text(), text_of(source_dir + "/lines/default.toml"));
  const LineSettings line = test::settings_of(default_line_text());
  EXPECT_EQ(line.clock, ClockMode::real);
  EXPECT_EQ(line.api.address, "127.0.0.1");
  EXPECT_EQ(line.api.port, 8402);
  ASSERT_EQ(line.buses.size(), 1U);
  EXPECT_EQ(line.buses[0].links, std::vector<std::string>{"socketcand:127.0.0.1:29536/can0"});
  EXPECT_EQ(line.buses[0].bit_rate, 1'000'000U);
  ASSERT_EQ(line.serial_buses.size(), 1U);
  EXPECT_EQ(line.serial_buses[0].links, std::vector<std::string>{"tcp:127.0.0.1:1502"});
  ASSERT_EQ(line.ethercat_buses.size(), 1U);
  EXPECT_EQ(line.ethercat_buses[0].links, std::vector<std::string>{"udp:127.0.0.1:34980"});
  const std::vector<std::pair<std::string, std::string>> axes{
      {"ismc", "ismc"}, {"reference", "generic402"}, {"pronet", "pronet"}, {"ismk", "ismk"}, {"jmc", "jmc_ec"}};
  ASSERT_EQ(line.axes.size(), axes.size());
  for (std::size_t i = 0; i < axes.size(); ++i) {
    EXPECT_EQ(line.axes[i].name, axes[i].first);
    EXPECT_EQ(line.axes[i].product->name, axes[i].second);
    EXPECT_EQ(line.axes[i].node_id, i < 4 ? i + 1 : 0);
  }
}

TEST(LineFile, AModelBringsItsMotor) {
  const LineSettings line = test::settings_of(R"(
[[bus]]
name = "can0"
bit_rate = 500000
[[axis]]
name = "small"
product = "ismk"
model = "40-010"
node = 1
[[axis]]
name = "usual"
product = "ismk"
node = 2
motor.rotor_inertia_kgm2 = 0.5e-4
)");
  ASSERT_EQ(line.axes.size(), 2U);
  const AxisSettings& small = line.axes[0];
  EXPECT_EQ(small.model, "40-010");
  EXPECT_FLOAT_EQ(static_cast<float>(small.plant.motor.rated_torque_nm), 0.32F);
  EXPECT_EQ(small.plant.encoder.counts_per_revolution, 65536);
  EXPECT_EQ(small.motor_data.counts_per_revolution, 65536U);
  EXPECT_NEAR(static_cast<double>(small.motor_data.peak_current_a), 18.0, 1e-4);
  EXPECT_EQ(line.axes[1].model, "60-040");
  EXPECT_FLOAT_EQ(static_cast<float>(line.axes[1].plant.motor.rated_torque_nm), 1.27F);
  EXPECT_EQ(line.axes[1].plant.motor.rotor_inertia_kgm2, 0.5e-4);
  for (const Product& product : all_products()) {
    for (const products::Model& model : product.models) {
      plant::Parameters parameters;
      fit_model(model, parameters);
      EXPECT_TRUE(plant::validate(parameters).empty()) << product.name << " " << model.name;
    }
  }
}

TEST(LineFile, GeometryBecomesSwitches) {
  const LineSettings line = test::settings_of(R"(
[[bus]]
name = "can0"
[[axis]]
name = "x"
product = "ismc"
[axis.travel]
counts_per_unit = 1000
start = 1.5
low_stop = -20
high_stop = 20.25
negative_limit = { at = -10, hysteresis = 0.5, normally_closed = true, wire = 4 }
positive_limit = 10
home = { from = -1, to = 1 }
[[axis.travel.switch]]
wire = 5
from = 3
)");
  const plant::Parameters& plant = line.axes[0].plant;
  EXPECT_EQ(plant.encoder.start_position_counts, 1500);
  EXPECT_EQ(plant.load.low_stop_counts, -20000);
  EXPECT_EQ(plant.load.high_stop_counts, 20250);
  ASSERT_EQ(plant.switch_count, 4U);
  EXPECT_EQ(plant.switches[0].wire, 4);
  EXPECT_EQ(plant.switches[0].from_counts, plant::no_low_limit);
  EXPECT_EQ(plant.switches[0].to_counts, -10000);
  EXPECT_EQ(plant.switches[0].hysteresis_counts, 500);
  EXPECT_TRUE(plant.switches[0].normally_closed);
  EXPECT_EQ(plant.switches[1].wire, 1);
  EXPECT_EQ(plant.switches[1].from_counts, 10000);
  EXPECT_EQ(plant.switches[1].to_counts, plant::no_high_limit);
  EXPECT_EQ(plant.switches[2].wire, 2);
  EXPECT_EQ(plant.switches[2].from_counts, -1000);
  EXPECT_EQ(plant.switches[2].to_counts, 1000);
  EXPECT_EQ(plant.switches[3].wire, 5);
  EXPECT_EQ(plant.switches[3].from_counts, 3000);
}

TEST(LineFile, IntegersOfTheTravelStayExact) {
  const LineSettings line = test::settings_of(R"(
[[bus]]
name = "can0"
[[axis]]
name = "x"
product = "ismc"
[axis.travel]
start = 1152921504606846977
)");
  EXPECT_EQ(line.axes[0].plant.encoder.start_position_counts, 1152921504606846977);  // 2^60 + 1: not a double
}

TEST(LineFile, TheDriveIsToldTheTruthUnlessTheNameplateSaysElse) {
  const LineSettings line = test::settings_of(R"(
[[bus]]
name = "can0"
[[axis]]
name = "x"
product = "ismc"
[axis.motor]
pole_pairs = 7
rated_current_a = 2.0
[axis.nameplate]
resistance_ohm = 9.5
)");
  EXPECT_EQ(line.axes[0].motor_data.pole_pairs, 7);
  EXPECT_FLOAT_EQ(line.axes[0].motor_data.rated_current_a, 2.828427F);  // peak of 2 A rms
  EXPECT_FLOAT_EQ(line.axes[0].motor_data.resistance_ohm, 9.5F);
  EXPECT_DOUBLE_EQ(line.axes[0].plant.motor.resistance_ohm, 0.775);
}

TEST(LineFile, TheNameplateMayBeWrongButNotAbsurd) {
  for (const Range& range : nameplate_ranges) {
    for (const double wrong : {range.minimum - 1.0, range.maximum * 1.5 + 1.0}) {
      const bool whole = range.name == "counts_per_revolution" || range.name == "pole_pairs";
      const std::string value = fmt::format("{:.{}f}", wrong, whole ? 0 : 3);
      const LineFile file = parse_line_file(
          fmt::format("[[bus]]\nname='can0'\n[[axis]]\nname='x'\nproduct='ismc'\n[axis.nameplate]\n{}={}\n", range.name,
                      value),
          "line.toml", all_products());
      ASSERT_FALSE(file.diagnostics.empty()) << range.name << " = " << value;
      EXPECT_THAT(to_string(file.diagnostics[0]), HasSubstr("nameplate." + std::string(range.name)));
    }
  }
}

struct Mistake {
  const char* name;
  const char* text;
  std::uint32_t line;
  std::uint32_t column;
  const char* what;
  const char* hint;
};

void PrintTo(const Mistake& mistake, std::ostream* out) { *out << mistake.name; }

// A bus and an axis on lines 1 to 5, for errors that need them.
#define AXIS "[[bus]]\nname='can0'\n[[axis]]\nname='x'\nproduct='ismc'\n"

// An RS485 line and an axis on lines 1 to 7.
#define SERIAL_AXIS "[[bus]]\nname='rs'\ntype='rs485'\n[[axis]]\nname='x'\nproduct='generic402'\nserial='rs'\n"

// An EtherCAT segment and the head of an axis on lines 1 to 5.
#define ETHERCAT "[[bus]]\nname='ecat'\ntype='ethercat'\n[[axis]]\nname='x'\n"

// Two axes and the head of a coupling on lines 1 to 10.
#define COUPLING AXIS "[[axis]]\nname='y'\nproduct='ismc'\nnode=2\n[[coupling]]\n"

const std::vector<Mistake> mistakes{
    {"syntax", "clock = ", 1, 9, "", "TOML"},
    {"same_key_twice", "clock='real'\nclock='real'\n", 2, 7, "", "TOML"},
    {"no_bus", "", 1, 1, "no bus", "[[bus]]"},
    {"no_axis", "[[bus]]\nname='can0'\n", 1, 1, "no axis", "[[axis]]"},
    {"unknown_key", AXIS "noed=1\n", 6, 1, "unknown key `noed` in axis", "did you mean `node`?"},
    {"unknown_far_key", AXIS "zzzzzzzz=1\n", 6, 1, "unknown key `zzzzzzzz`", "known here: alias, bit_rate"},
    {"unknown_top_key", "clok='real'\n" AXIS, 1, 1, "unknown key `clok`", "did you mean `clock`?"},
    {"unknown_motor_key", AXIS "[axis.motor]\n  pole_pair=4\n", 7, 3, "unknown key `pole_pair` in axis.motor",
     "did you mean `pole_pairs`?"},
    {"unknown_switch_key", AXIS "[axis.travel]\nhome={from=1, tow=2}\n", 7, 15, "unknown key `tow` in axis.travel.home",
     "did you mean `to`?"},
    {"clock", "clock='imaginary'\n" AXIS, 1, 7, "clock: there is no clock \"imaginary\"", "\"virtual\""},
    {"wrong_type", AXIS "node='one'\n", 6, 6, "axis.node: is a string", "expected an integer"},
    {"fraction", AXIS "node=1.5\n", 6, 6, "axis.node: is a number with a fraction", "expected an integer"},
    {"node_0", AXIS "node=0\n", 6, 6, "axis.node: 0 is out of range", "expected 1 .. 127"},
    {"node_128", AXIS "node=128\n", 6, 6, "axis.node: 128 is out of range", "expected 1 .. 127"},
    {"serial_number", AXIS "serial_number=-1\n", 6, 15, "axis.serial_number: -1 is out of range", "4294967295"},
    {"same_node", AXIS "node=3\n[[axis]]\nname='y'\nproduct='ismc'\nnode=3\n", 10, 6,
     "axis.node: axis \"x\" is node 3 of this bus already", "node 1 is free"},
    {"same_factory_node", AXIS "[[axis]]\nname='y'\nproduct='ismc'\n", 6, 1,
     "axis.node: axis \"x\" is node 1 of this bus already", "node 2 is free"},
    {"same_name", AXIS "[[axis]]\nname='x'\nproduct='ismc'\nnode=2\n", 7, 6, "there is an axis \"x\" already",
     "a name of its own"},
    {"same_bus", "[[bus]]\nname='can0'\n" AXIS "bus='can0'", 4, 6, "there is a bus \"can0\" already",
     "a name of its own"},
    {"bad_name", "[[bus]]\nname='can 0'\n", 2, 6, "\"can 0\" cannot be a name", "letters"},
    {"no_name", AXIS "[[axis]]\nproduct='ismc'\nnode=2\n", 6, 1, "axis.name: is missing", "name the axis"},
    {"no_product", "[[bus]]\nname='can0'\n[[axis]]\nname='x'\n", 3, 1, "axis.product: is missing", "ismc"},
    {"product", "[[bus]]\nname='can0'\n[[axis]]\nname='x'\nproduct='imsc'\n", 5, 9, "there is no product \"imsc\"",
     "did you mean"},
    {"model", "[[bus]]\nname='can0'\n[[axis]]\nname='x'\nproduct='ismk'\nmodel='60-400'\n", 6, 7,
     "axis.model: ismk has no model \"60-400\"", "did you mean `60-040`?"},
    {"model_of_none", AXIS "model='60-040'\n", 6, 1, "unknown key `model`", ""},
    {"bus_of_axis", AXIS "bus='can1'\n", 6, 5, "axis.bus: there is no bus \"can1\"", "did you mean `can0`?"},
    {"bus_missing", "[[bus]]\nname='can1'\n" AXIS, 5, 1, "axis.bus: is missing", "known here: can1, can0"},
    {"bit_rate", "[[bus]]\nname='can0'\nbit_rate=2_000_000\n", 3, 10, "bus.bit_rate: 2000000 is out of range",
     "10000 .. 1000000"},
    {"link", "[[bus]]\nname='can0'\nlinks=['mem:', 'carrier-pigeon:x']\n", 3, 16, "bus.links:", "slcan:PATH"},
    {"link_twice", "[[bus]]\nname='can0'\nlinks=['slcan:/a','slcan:/a']\n", 3, 19, "\"slcan:/a\" is taken", ""},
    {"links_no_list", "[[bus]]\nname='can0'\nlinks='mem:'\n", 3, 7, "bus.links: is not a list", "links = ["},
    {"bus_type", "[[bus]]\nname='a'\ntype='rs422'\n" AXIS, 3, 6, "bus.type: there is no type of bus \"rs422\"",
     "\"rs485\""},
    {"serial_same_name", "[[bus]]\nname='can0'\ntype='rs485'\n" AXIS, 5, 6, "there is a bus \"can0\" already",
     "a name of its own"},
    {"serial_ideal", "[[bus]]\nname='rs'\ntype='rs485'\nideal=true\n" AXIS, 4, 1, "unknown key `ideal` in bus", ""},
    {"bit_rate_of_no_drive", "[[bus]]\nname='can0'\nbit_rate=100000\n[[axis]]\nname='x'\nproduct='ismc'\n", 4, 1,
     "axis.bus: a `ismc` cannot be set to 100000 bit/s", "20, 50, 125"},
    {"bit_rate_of_an_axis", AXIS "bit_rate=300000\n", 6, 10, "axis.bit_rate: a `ismc` cannot be set to 300000",
     "20, 50"},
    {"serial_bit_rate", "[[bus]]\nname='rs'\ntype='rs485'\nbit_rate=300\n" AXIS, 4, 10,
     "bus.bit_rate: 300 is out of range", "1200 .. 1000000"},
    {"serial_format", "[[bus]]\nname='rs'\ntype='rs485'\nformat='8n1'\n" AXIS, 4, 8,
     "bus.format: \"8n1\" is not a format", "\"8E1\""},
    {"serial_silence", "[[bus]]\nname='rs'\ntype='rs485'\nsilence_ms=-1\n" AXIS, 4, 12,
     "bus.silence_ms: -1 is out of range", "0 .. 1000"},
    {"serial_link", "[[bus]]\nname='rs'\ntype='rs485'\nlinks=['slcan:/a']\n" AXIS, 4, 8, "bus.links:", "pty:PATH"},
    {"serial_link_twice", "[[bus]]\nname='rs'\ntype='rs485'\nlinks=['tcp:::1']\n" AXIS, 4, 8, "bus.links:", "tcp:HOST"},
    {"serial_of_axis", AXIS "serial='rs'\n", 6, 8, "axis.serial: there is no RS485 line \"rs\"", "type = \"rs485\""},
    {"serial_misspelt", SERIAL_AXIS "[[axis]]\nname='y'\nproduct='generic402'\nserial='rt'", 11, 8,
     "there is no RS485 line \"rt\"", "did you mean `rs`?"},
    {"serial_as_bus", SERIAL_AXIS "[[axis]]\nname='y'\nproduct='generic402'\nbus='rs'", 11, 5,
     "axis.bus: \"rs\" is an RS485 line", "serial = \"rs\""},
    {"serial_missing", "[[bus]]\nname='rs'\ntype='rs485'\n[[axis]]\nname='x'\nproduct='generic402'\n", 4, 1,
     "axis.serial: is missing", "serial ="},
    {"serial_product", SERIAL_AXIS "[[axis]]\nname='y'\nproduct='ismc'\nserial='rs'", 11, 8,
     "a `ismc` has no RS485 port", "leave the key out"},
    {"serial_same_station", SERIAL_AXIS "[[axis]]\nname='y'\nproduct='generic402'\nserial='rs'\nstation=2\n", 12, 9,
     "axis.station: axis \"x\" is station 2 of this line already", "station = N"},
    {"serial_same_node", SERIAL_AXIS "[[axis]]\nname='y'\nproduct='generic402'\nserial='rs'\n", 11, 8,
     "axis.serial: axis \"x\" is station 2 of this line already", "station = N"},
    {"serial_station", SERIAL_AXIS "station=248\n", 8, 9, "axis.station: 248 is out of range", "1 .. 247"},
    {"station_alone", AXIS "station=4\n", 6, 9, "axis.station: is only for an axis on an RS485 line", "serial ="},
    {"serial_protocol", SERIAL_AXIS "serial_protocol='modbut'\n", 8, 17, "does not speak \"modbut\"",
     "did you mean `modbus`?"},
    {"ethercat_product", ETHERCAT "product='ismc'\nbus='ecat'\n", 7, 5,
     "axis.bus: a `ismc` is a drive for CAN, \"ecat\" is an EtherCAT segment", "servodrome products"},
    {"ethercat_no_such_product", ETHERCAT "product='toaster'\nbus='ecat'\nalias=3\n", 6, 9,
     "axis.product: there is no product \"toaster\"", "jmc_ec"},
    {"can_product", AXIS "[[axis]]\nname='y'\nproduct='generic402-ec'\nbus='can0'\n", 9, 5,
     "axis.bus: a `generic402-ec` is a drive for EtherCAT, \"can0\" is a CAN bus", "type = \"ethercat\""},
    {"ethercat_link", "[[bus]]\nname='e'\ntype='ethercat'\nlinks=['slcan:/a']\n" AXIS, 4, 8,
     "bus.links:", "raw:INTERFACE"},
    {"ethercat_bit_rate", "[[bus]]\nname='e'\ntype='ethercat'\nbit_rate=5\n" AXIS, 4, 1,
     "unknown key `bit_rate` in bus", ""},
    {"ethercat_node", ETHERCAT "product='generic402-ec'\nnode=4\n", 7, 6, "axis.node: is only for an axis on a CAN bus",
     "place in the file"},
    {"oscillator", ETHERCAT "product='generic402-ec'\noscillator_ppm=201\n", 7, 16,
     "axis.oscillator_ppm: 201 is out of range", "-200 .. 200"},
    {"alias", ETHERCAT "product='generic402-ec'\nalias=65536\n", 7, 7, "axis.alias: 65536 is out of range", "65535"},
    {"sync_error_limit", ETHERCAT "product='generic402-ec'\nsync_error_limit=65536\n", 7, 18,
     "axis.sync_error_limit: 65536 is out of range", "65535"},
    {"can_alias", AXIS "alias=1\n", 6, 7, "axis.alias: is only for an axis on an EtherCAT segment",
     "leave the key out"},
    {"bus_no_table", "bus = 3\n", 1, 7, "bus: is an integer", "[[bus]]"},
    {"api", "[api]\naddress='localhost'\n" AXIS, 2, 9, "api.address: \"localhost\" is not an ADDRESS:PORT", "8402"},
    {"api_port", "[api]\naddress='localhost:99999'\n" AXIS, 2, 9, "api.address: \"99999\" is not a port", "8402"},
    {"plant_range", AXIS "[axis.motor]\npole_pairs=0\n", 7, 12, "axis.motor.pole_pairs: 0 is not within 1 .. 100",
     "docs/line-file.md"},
    {"harmonic_range", AXIS "[[axis.motor.cogging]]\nperiods=6\n[[axis.motor.cogging]]\nperiods=0\n", 9, 9,
     "axis.motor.cogging[1].periods: 0 is not within 1 .. 1000", "docs/line-file.md"},
    {"harmonic_key", AXIS "[[axis.motor.cogging]]\nperiod=6\n", 7, 1, "unknown key `period` in axis.motor.cogging",
     "periods"},
    {"harmonics_shape", AXIS "[axis.motor]\ncogging=5\n", 7, 9, "axis.motor.cogging: is an integer", "[[cogging]]"},
    {"harmonics_many",
     AXIS "[axis.motor]\n[[axis.motor.cogging]]\n[[axis.motor.cogging]]\n[[axis.motor.cogging]]\n"
          "[[axis.motor.cogging]]\n[[axis.motor.cogging]]\n[[axis.motor.cogging]]\n[[axis.motor.cogging]]\n",
     13, 1, "axis.motor.cogging: one table too many", "at most 6"},
    {"brake_rise", AXIS "[axis.motor]\nbrake_engage_ms=20\nbrake_rise_ms=21\n", 8, 15,
     "axis.motor.brake_rise_ms: 21 is not within 0 .. 20", ""},
    {"mains", AXIS "[axis.supply]\nmains_phases=2\n", 7, 14, "axis.supply.mains_phases: must be 0, 1 or 3", ""},
    {"arm_swings", AXIS "[axis.load]\narm_torque_nm=1e5\n", 7, 15, "axis.load.arm_torque_nm: the arm would swing", ""},
    {"axis_ideal", AXIS "ideal=1\n", 6, 7, "axis.ideal: is an integer", "true or false"},
    {"plant_cross", AXIS "[axis.load]\nstatic_friction_nm=0\n", 7, 20, "axis.load.static_friction_nm", ""},
    {"not_finite", AXIS "[axis.load]\ninertia_kgm2=nan\n", 7, 14, "axis.load.inertia_kgm2: is not finite", ""},
    {"stops", AXIS "[axis.travel]\nstart=5\nlow_stop=5\nhigh_stop=5\n", 9, 11, "axis.travel.high_stop", ""},
    {"start", AXIS "[axis.travel]\nlow_stop=5\nstart=4\n", 8, 7, "axis.travel.start", ""},
    {"switch_order", AXIS "[axis.travel]\nhome={from=5,to=4}\n", 7, 12, "axis.travel.home.from: lies beyond `to`", ""},
    {"switch_shape", AXIS "[axis.travel]\nhome=5\n", 7, 6, "axis.travel.home: is neither", "home = { from"},
    {"switch_at", AXIS "[axis.travel]\npositive_limit={hysteresis=4}\n", 7, 16,
     "axis.travel.positive_limit.at: is missing", ""},
    {"switch_wire", AXIS "[axis.travel]\npositive_limit={at=4, wire=6}\n", 7, 28, "6 is not an input", "0 .. 5"},
    {"switch_no_wire", AXIS "[[axis.travel.switch]]\nfrom=4\n", 6, 1, "axis.travel.switch.wire: is missing", "0 .. 5"},
    {"wire_taken", AXIS "[axis.travel]\npositive_limit=4\nhome={from=1,to=2,wire=1}\n", 8, 6,
     "wire 1 is taken by `positive_limit`", "wire = N"},
    {"hysteresis", AXIS "[axis.travel]\npositive_limit={at=4, hysteresis=-1}\n", 7, 16,
     "axis.travel.positive_limit: -1 is not within", ""},
    {"unit", AXIS "[axis.travel]\ncounts_per_unit=0\n", 7, 17, "is not positive", ""},
    {"coupling_axes", COUPLING "ratio=1\n", 10, 1, "coupling.axes: is missing", "axes = ["},
    {"coupling_shape", COUPLING "axes=['x']\n", 11, 6, "coupling.axes: is not a list of two axes", "axes = ["},
    {"coupling_number", COUPLING "axes=['x', 2]\n", 11, 12, "coupling.axes: is not a string", "axes = ["},
    {"coupling_unknown", COUPLING "axes=['x', 'yy']\n", 11, 12, "coupling.axes: there is no axis \"yy\"",
     "did you mean `y`?"},
    {"coupling_itself", COUPLING "axes=['x', 'x']\n", 11, 6, "coupling.axes: couples \"x\" to itself", "two axes"},
    {"coupling_twice", COUPLING "axes=['x', 'y']\n[[coupling]]\naxes=['y', 'x']\n", 13, 7,
     "coupling.axes: \"y\" is coupled already", "one coupling"},
    {"coupling_segments",
     AXIS "[[bus]]\nname='e'\ntype='ethercat'\n[[axis]]\nname='y'\nproduct='jmc_ec'\n[[coupling]]\naxes=['x', 'y']\n",
     13, 6, "\"x\" and \"y\" are not on the same EtherCAT segment", "one segment"},
    {"coupling_key", COUPLING "axes=['x', 'y']\nstifness_nm_per_rad=1\n", 12, 1,
     "unknown key `stifness_nm_per_rad` in coupling", "did you mean `stiffness_nm_per_rad`?"},
    {"coupling_type", COUPLING "axes=['x', 'y']\nratio='1:2'\n", 12, 7, "coupling.ratio: is a string", "a number"},
    {"coupling_ratio", COUPLING "axes=['x', 'y']\nratio=0\n", 12, 7, "coupling.ratio: 0 is not within", "Coupled axes"},
    {"coupling_stiff", COUPLING "axes=['x', 'y']\nstiffness_nm_per_rad=1e5\n", 12, 22,
     "coupling.stiffness_nm_per_rad: 100000 is not within 0.001 .. 716", "Coupled axes"},
    {"coupling_undamped", COUPLING "axes=['x', 'y']\nbacklash_rad=0.1\ndamping_nms=0\n", 13, 13,
     "coupling.damping_nms: 0 is not within", "Coupled axes"},
    {"far", AXIS "[axis.travel]\nstart=9223372036854775807\n", 7, 7, "lies beyond 2^61 counts", ""},
};

class Mistakes : public testing::TestWithParam<Mistake> {};

TEST_P(Mistakes, AreFoundWhereTheyAre) {
  const Mistake& mistake = GetParam();
  const LineFile file = parse_line_file(mistake.text, "test.toml", all_products());
  ASSERT_FALSE(file.diagnostics.empty());
  const Diagnostic& found = file.diagnostics.front();
  EXPECT_EQ(found.line, mistake.line) << to_string(found);
  EXPECT_EQ(found.column, mistake.column) << to_string(found);
  EXPECT_THAT(found.what, HasSubstr(mistake.what));
  EXPECT_THAT(found.hint, HasSubstr(mistake.hint));
  EXPECT_FALSE(found.what.empty());
}

INSTANTIATE_TEST_SUITE_P(LineFile, Mistakes, testing::ValuesIn(mistakes),
                         [](const auto& one) { return std::string(one.param.name); });

TEST(LineFile, SaysAllThatIsWrongInTheOrderOfTheFile) {
  const LineFile file =
      parse_line_file("clock='x'\n[[bus]]\nname='can0'\nbit_rate=1\n[[axis]]\nname='?'\nnode=0\n", "f", all_products());
  std::vector<std::uint32_t> lines;
  for (const Diagnostic& diagnostic : file.diagnostics) lines.push_back(diagnostic.line);
  EXPECT_EQ(lines, (std::vector<std::uint32_t>{1, 4, 5, 6, 7}));
}

TEST(LineFile, AMissingFileIsAMistakeToo) {
  const LineFile file = load_line_file("/nonexistent/line.toml", all_products());
  ASSERT_EQ(file.diagnostics.size(), 1U);
  EXPECT_THAT(to_string(file.diagnostics[0]), HasSubstr("/nonexistent/line.toml: cannot be read: No such file"));
  EXPECT_THAT(to_string(load_line_file("/", all_products()).diagnostics.at(0)), HasSubstr("is a folder"));
}

TEST(LineFile, StoresLieBesideTheFile) {
  const LineFile file = parse_line_file(AXIS "store='drives/x.bin'\n", "/some/where/line.toml", all_products());
  ASSERT_TRUE(file.diagnostics.empty());
  EXPECT_EQ(file.settings.axes[0].store, "/some/where/drives/x.bin");
}

TEST(LineFile, AStageAndSensorsAreRealUnlessTheFileSaysIdeal) {
  const auto axis_of = [](const char* text) {
    const LineFile file = parse_line_file(text, "line.toml", all_products());
    EXPECT_TRUE(file.diagnostics.empty());
    return file.settings.axes.at(0);
  };
  EXPECT_FALSE(axis_of(AXIS).plant.stage.ideal);
  EXPECT_FALSE(axis_of(AXIS).plant.sensors.ideal);
  EXPECT_EQ(axis_of(AXIS).motor_data.voltage_delay_ticks, 1);
  const AxisSettings real = axis_of(AXIS "[axis.stage]\ndelay_ticks=2\n[axis.sensors]\n");
  EXPECT_FALSE(real.plant.stage.ideal);
  EXPECT_FALSE(real.plant.sensors.ideal);
  EXPECT_EQ(real.motor_data.voltage_delay_ticks, 2);
  const AxisSettings off = axis_of(AXIS "[axis.stage]\nideal=true\n[axis.sensors]\nideal=true\nseed=3\n");
  EXPECT_TRUE(off.plant.stage.ideal);
  EXPECT_TRUE(off.plant.sensors.ideal);
  EXPECT_EQ(off.motor_data.voltage_delay_ticks, 0);
}

TEST(LineFile, AnIdealAxisHasNoImperfection) {
  constexpr const char* imperfect =
      "[axis.stage]\n[axis.sensors]\n[axis.motor]\nquadrature_saturation_a=10\nmagnet_temperature_coefficient=0.001\n"
      "iron_hysteresis_nm=0.01\niron_eddy_nms=1e-5\ncogging_torque_nm=0.01\nbrake_rise_ms=5\nbrake_half_torque_j=1e5\n"
      "[[axis.motor.cogging]]\ntorque_nm=0.002\nperiods=60\nphase_turns=0.25\n[axis.load]\nstribeck_speed_rad_s=3\n"
      "belt_length_revolutions=20\narm_torque_nm=0.2\ncrank_inertia_kgm2=1e-5\n[axis.supply]\nmains_phases=3\n";
  const auto plant_of = [&](const std::string& begin) {
    const LineFile file = parse_line_file(begin + imperfect, "line.toml", all_products());
    EXPECT_TRUE(file.diagnostics.empty());
    return file.settings.axes.at(0).plant;
  };
  const plant::Parameters real = plant_of(AXIS);
  EXPECT_FALSE(real.stage.ideal);
  ASSERT_EQ(real.motor.cogging_count, 1U);
  EXPECT_EQ(real.motor.cogging[0].periods, 60);
  EXPECT_EQ(real.motor.cogging[0].phase_turns, 0.25);
  EXPECT_EQ(real.supply.mains_phases, 3);
  plant::Parameters ideal = plant_of(AXIS "ideal=true\n");
  EXPECT_TRUE(ideal.stage.ideal && ideal.sensors.ideal);
  for (const double value :
       {ideal.motor.quadrature_saturation_a, ideal.motor.magnet_temperature_coefficient, ideal.motor.iron_hysteresis_nm,
        ideal.motor.iron_eddy_nms, ideal.motor.cogging_torque_nm, ideal.motor.brake_rise_ms,
        ideal.motor.brake_half_torque_j, ideal.load.stribeck_speed_rad_s, ideal.load.belt_length_revolutions}) {
    EXPECT_EQ(value, 0.0);
  }
  EXPECT_EQ(ideal.motor.cogging_count, 0U);
  EXPECT_EQ(ideal.supply.mains_phases, 0);
  EXPECT_EQ(ideal.load.arm_torque_nm, 0.2);  // part of the machine
  EXPECT_EQ(ideal.load.crank_inertia_kgm2, 1.0e-5);
}

TEST(LineFile, TheReferenceHasEveryKey) {
  const std::string reference = text_of(source_dir + "/docs/line-file.md");
  const auto expect = [&reference](std::string_view key) {
    EXPECT_THAT(reference, HasSubstr("`" + std::string(key) + "`"));
  };
  for (const auto& key : motor_keys) expect(key.name);
  for (const auto& key : cogging_keys) expect(key.name);
  for (const auto& key : load_keys) expect(key.name);
  for (const auto& key : supply_keys) expect(key.name);
  for (const auto& key : encoder_keys) expect(key.name);
  for (const auto& key : thermal_keys) expect(key.name);
  for (const auto& key : stage_keys) expect(key.name);
  for (const auto& key : sensors_keys) expect(key.name);
  for (const auto& key : nameplate_keys) expect(key.name);
  for (const char* key : {"clock",
                          "address",
                          "enabled",
                          "name",
                          "product",
                          "bus",
                          "node",
                          "bit_rate",
                          "ideal",
                          "alias",
                          "oscillator_ppm",
                          "cable_ns",
                          "sync_error_limit",
                          "links",
                          "serial_number",
                          "store",
                          "counts_per_unit",
                          "start",
                          "low_stop",
                          "high_stop",
                          "negative_limit",
                          "positive_limit",
                          "home",
                          "switch",
                          "at",
                          "from",
                          "to",
                          "hysteresis",
                          "normally_closed",
                          "wire"}) {
    expect(key);
  }
}

}  // namespace
}  // namespace line_file_test
}  // namespace servodrome::line
