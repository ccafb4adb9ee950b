// `sniff`: decodes a capture, or the traffic of a live bus, to text.
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/number_options.hpp"
#include "describe/device_file.hpp"
#include "line/registry.hpp"
#include "links/can/frame_length.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/ethercat/system_links.hpp"
#include "links/link_error.hpp"
#include "links/link_scheme.hpp"
#include "links/nearest_name.hpp"
#include "links/serial/client.hpp"
#include "links/serial/format_text.hpp"
#include "links/time.hpp"
#include "tools/sniff/can_decoder.hpp"
#include "tools/sniff/capture_file.hpp"
#include "tools/sniff/ethercat_decoder.hpp"
#include "tools/sniff/modbus_tcp_decoder.hpp"
#include "tools/sniff/serial_decoder.hpp"
#include "tools/sniff/summary.hpp"

namespace servodrome::app {
namespace sniff_command {

struct Options {
  std::string source;
  std::vector<std::string> filters;
  std::vector<std::string> eds;
  std::vector<std::string> products;
  double seconds = 0.0;  // 0: until Ctrl-C, or the end
  std::optional<unsigned> bit_rate{};
  std::string format = "8N1";
  std::vector<unsigned> modbus_ports{};
  bool sent = false;
  bool summary = false;
  bool quiet = false;
  bool json = false;
};

constexpr std::array live_buses{links::scheme::socketcand, links::scheme::socketcan, links::scheme::slcan,
                                links::scheme::raw,        links::scheme::serial,    links::scheme::pty,
                                links::scheme::tcp};
constexpr std::array live_can{links::scheme::socketcand, links::scheme::socketcan, links::scheme::slcan};
constexpr std::array live_ethercat{links::scheme::raw};
constexpr std::array live_serial{links::scheme::serial, links::scheme::pty, links::scheme::tcp};

std::string prefixes_of_live_buses() { return links::prefixes(live_buses, ", "); }

std::string help_of_live_ethercat() {
  const std::string form = links::client_forms(live_ethercat);
  return form.empty() ? form : form + " for EtherCAT, ";
}

constexpr unsigned can_bit_rate = 1'000'000;
constexpr unsigned serial_bit_rate = 115'200;
constexpr unsigned ethernet_bit_rate = 100'000'000;
constexpr unsigned ethernet_overhead_bytes = 24;  // preamble, FCS and the gap between frames
constexpr unsigned least_ethernet_bytes = 60;
constexpr unsigned error_frame_bits = 20;  // at most 12 bits of flags, 8 of delimiter (ISO 11898-1, 10.4.4)

// Prints the output of the decoders.
class Sniffer {
 public:
  explicit Sniffer(const Options& options) : options_(options) {
    master::ObjectCatalogue names = master::ObjectCatalogue::standard();
    for (const std::string& option : options.eds) add_eds(option, names);
    for (const std::string& option : options.products) add_product(option, names);
    for (const std::string& word : options.filters) {
      try {
        filter_.add(word, names);
      } catch (const master::MasterError& error) {
        throw Failure::wrong_use(error.what());
      }
    }
    ethercat_.show_sent(options.sent);
    for (const unsigned port : options.modbus_ports) modbus_tcp_.add_port(static_cast<std::uint16_t>(port));
    const auto format = links::parse_character_format(options.format, serial_bit_rate);
    if (!format)
      throw Failure::wrong_use(fmt::format("--format {}: write data bits, parity, stop bits: 8N1", options.format));
    character_bits_ = format->bits();
  }

  void take(const canopen::Frame& frame, master::Time time) {
    can_seen_ = true;
    summary_.count_frame(time, links::frame_length_bits(frame) + links::interframe_space_bits);
    show(can_.decode(frame, time));
  }
  void take(const master::CanErrorFrame& error, master::Time time) {
    can_seen_ = true;
    summary_.count_frame(time, error_frame_bits);
    master::Decoded decoded;
    decoded.time = time;
    decoded.kind = master::FrameKind::error;
    decoded.error = true;
    decoded.raw = "error frame";
    decoded.text = fmt::format("error on the wire, class {:08X}h", error.error_class);
    show(decoded);
  }
  void take(const master::EthernetBytes& bytes, master::Time time) { take(std::span<const std::uint8_t>(bytes), time); }
  void take(std::span<const std::uint8_t> frame, master::Time time) {
    const std::size_t bytes = std::max<std::size_t>(frame.size(), least_ethernet_bytes) + ethernet_overhead_bytes;
    summary_.count_frame(time, static_cast<unsigned>(bytes) * 8);
    if (modbus_tcp_.takes(frame)) {
      for (const master::Decoded& decoded : modbus_tcp_.decode(frame, time)) show(decoded);
      return;
    }
    for (const master::Decoded& decoded : ethercat_.decode(frame, time)) show(decoded);
  }

  void take(const master::SerialBytes& piece, master::Time time) {
    if (piece.is_tcp) {
      summary_.count_frame(time, 0);
      show(modbus_tcp_.decode_message(piece.bytes, time, piece.sender == links::SerialSender::master, 0));
      return;
    }
    serial_seen_ = true;
    summary_.count_frame(time, static_cast<unsigned>(piece.bytes.size()) * character_bits_);
    --summary_.frames;  // a piece may be part of a frame, or several frames
    for (const master::Decoded& decoded : serial_.decode(piece.bytes, time, piece.sender)) take_serial(decoded);
  }
  // No more bytes follow: decodes unfinished frames as they are.
  void end_of_bytes() {
    for (const master::Decoded& decoded : serial_.finish()) take_serial(decoded);
  }

  void finish() const {
    if (options_.summary || options_.quiet) options_.json ? print_json_summary() : print_summary();
  }

 private:
  // "FILE", or "2=FILE" for one node or slave.
  static std::pair<unsigned, std::string> of_node(const std::string& option) {
    const std::size_t equals = option.find('=');
    if (equals == std::string::npos || equals == 0 || equals > 3) return {0, option};
    if (option.find_first_not_of("0123456789") != equals) return {0, option};
    const unsigned node = static_cast<unsigned>(std::stoul(option.substr(0, equals)));
    if (node > 247)
      throw Failure::wrong_use(fmt::format("{}: node-IDs and positions are 1..127, stations 1..247", option));
    return {node, option.substr(equals + 1)};
  }

  void take_serial(const master::Decoded& decoded) {
    ++summary_.frames;
    show(decoded);
  }

  void add_serial_model(unsigned station, const master::SerialModel& model) {
    serial_.set_model(station, model);
    modbus_tcp_.set_model(station, model);
  }

  void add_model(unsigned node, const master::DeviceModel& model) {
    if (node <= 127) can_.set_model(static_cast<std::uint8_t>(node), model);
    ethercat_.set_model(node, model);
  }

  void add_eds(const std::string& option, master::ObjectCatalogue& names) {
    const auto [node, path] = of_node(option);
    std::ifstream file(path);
    if (!file) throw Failure::wrong_use(fmt::format("--eds {}: cannot be read; check the path", path));
    try {
      const describe::DeviceFile device = describe::read_eds(file, path);
      add_model(node, master::DeviceModel::of(device));
      names = master::ObjectCatalogue::of(device);
      add_serial_model(node, {.catalogue = names});
    } catch (const describe::DeviceFileError& error) {
      throw Failure::wrong_use(fmt::format("--eds {}", error.what()));
    }
  }

  void add_product(const std::string& option, master::ObjectCatalogue& names) {
    const auto [node, name] = of_node(option);
    const line::Product* product = line::find_product(line::all_products(), name);
    if (product == nullptr) {
      std::vector<std::string_view> known;
      for (const line::Product& one : line::all_products()) known.push_back(one.name);
      throw Failure::wrong_use(
          fmt::format("--product {}: there is no such product; {}", name, links::suggestion(name, known)));
    }
    const auto table = product->describe().table;
    add_model(node, master::DeviceModel::of(table, name));
    names = master::ObjectCatalogue::of(table, name);
    const line::SerialInterface* serial = product->serial;
    add_serial_model(node, serial != nullptr ? master::SerialModel::of(table, serial->registers, serial->profile, name)
                                             : master::SerialModel::of(table, {}, nullptr, name));
  }

  void show(const master::Decoded& decoded) {
    summary_.count(decoded);
    if (options_.quiet || !filter_.passes(decoded)) return;
    const double at = links::to_seconds(decoded.time - *summary_.first);
    if (options_.json) {
      print_json(decoded, at);
    } else {
      fmt::print("{:12.6f}  {:<34} {:<10} {}{}\n", at, decoded.raw, decoded.source, decoded.text,
                 decoded.error ? "  !" : "");
    }
    std::fflush(stdout);
  }

  static void print_json(const master::Decoded& decoded, double at) {
    nlohmann::ordered_json json{{"seconds", at}, {"kind", master::name(decoded.kind)}, {"node", nullptr}};
    if (decoded.node) json["node"] = *decoded.node;
    json["source"] = decoded.source;
    json["raw"] = decoded.raw;
    json["text"] = decoded.text;
    json["error"] = decoded.error;
    json["values"] = nlohmann::ordered_json::array();
    for (const master::DecodedValue& value : decoded.values) {
      json["values"].push_back(
          {{"object", master::text_of(value.object)}, {"name", value.name}, {"value", value.text}});
    }
    fmt::print("{}\n", json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }

  std::uint32_t bit_rate() const {
    return options_.bit_rate.value_or(can_seen_ ? can_bit_rate : serial_seen_ ? serial_bit_rate : ethernet_bit_rate);
  }

  void print_summary() const {
    fmt::print("\n{} frames in {:.6f} s, {} errors\n", summary_.frames, summary_.seconds(), summary_.errors);
    for (std::size_t kind = 0; kind < master::frame_kinds; ++kind) {
      if (summary_.kinds[kind] == 0) continue;
      fmt::print("  {:<14}{:>10}\n", master::name(static_cast<master::FrameKind>(kind)), summary_.kinds[kind]);
    }
    for (const auto& [source, count] : summary_.sources) fmt::print("  {:<14}{:>10}\n", source, count);
    if (const auto load = summary_.bus_load(bit_rate())) {
      fmt::print("bus load {:.2f} % of {} kbit/s\n", *load, bit_rate() / 1000);
    }
    if (ethercat_.sent_frames() + ethercat_.returned_frames() > 0) {
      fmt::print("EtherCAT: {} frames sent, {} came back, {} lost\n", ethercat_.sent_frames(),
                 ethercat_.returned_frames(), ethercat_.lost());
    }
  }

  void print_json_summary() const {
    nlohmann::ordered_json json{{"event", "summary"},
                                {"frames", summary_.frames},
                                {"seconds", summary_.seconds()},
                                {"errors", summary_.errors}};
    json["kinds"] = nlohmann::ordered_json::object();
    for (std::size_t kind = 0; kind < master::frame_kinds; ++kind) {
      if (summary_.kinds[kind] != 0) {
        json["kinds"][std::string(master::name(static_cast<master::FrameKind>(kind)))] = summary_.kinds[kind];
      }
    }
    json["sources"] = summary_.sources;
    json["bus_load_percent"] = nullptr;
    if (const auto load = summary_.bus_load(bit_rate())) json["bus_load_percent"] = *load;
    json["bit_rate"] = bit_rate();
    json["ethercat"] = {
        {"sent", ethercat_.sent_frames()}, {"returned", ethercat_.returned_frames()}, {"lost", ethercat_.lost()}};
    fmt::print("{}\n", json.dump());
  }

  const Options& options_;
  master::CanDecoder can_;
  master::EthercatDecoder ethercat_;
  master::SerialDecoder serial_;
  master::ModbusTcpDecoder modbus_tcp_;
  master::SniffFilter filter_;
  master::SniffSummary summary_;
  bool can_seen_ = false;
  bool serial_seen_ = false;
  unsigned character_bits_ = 10;
};

bool is_over(const Options& options, master::Time start, master::Time now) {
  return InterruptGuard::interrupted() || (options.seconds > 0 && links::to_seconds(now - start) >= options.seconds);
}

// If a capture turns out to be damaged, the part decoded before is still shown, together with its summary.
void sniff_file(const Options& options, Sniffer& sniffer) {
  struct Close {
    void operator()(std::FILE* file) const {
      if (file != stdin) std::fclose(file);
    }
  };
  std::error_code ignored;
  if (std::filesystem::is_directory(options.source, ignored)) {
    throw Failure::wrong_use(fmt::format("{}: is a folder; give a capture file", options.source));
  }
  const std::unique_ptr<std::FILE, Close> file(options.source == "-" ? stdin
                                                                     : std::fopen(options.source.c_str(), "rb"));
  if (!file) {
    throw Failure::wrong_use(fmt::format("{}: {}; give a capture file, - for standard input, or a live bus ({})",
                                         options.source, std::strerror(errno), prefixes_of_live_buses()));
  }
  const InterruptGuard guard(InterruptGuard::Command::only_looks);
  try {
    master::CaptureFile capture(file.get(), options.source);
    std::optional<master::Time> start;
    while (const auto frame = capture.next()) {
      if (!start) start = frame->time;
      if (is_over(options, *start, frame->time)) break;
      std::visit([&](const auto& content) { sniffer.take(content, frame->time); }, frame->content);
    }
  } catch (const master::MasterError&) {
    sniffer.end_of_bytes();
    sniffer.finish();
    throw;
  }
  sniffer.end_of_bytes();
  sniffer.finish();
}

void sniff_can(const Options& options, Sniffer& sniffer) {
  BusOptions bus_options;
  bus_options.link = options.source;
  const auto bus = open_bus(bus_options);
  const auto listening = bus->listen([&](const master::Frame& frame) { sniffer.take(frame, bus->now()); });
  const InterruptGuard guard(InterruptGuard::Command::only_looks);
  const master::Time start = bus->now();
  while (!is_over(options, start, bus->now())) bus->run_for(std::chrono::milliseconds(50));
  sniffer.finish();
}

void sniff_ethercat(const Options& options, Sniffer& sniffer) {
  const auto link = links::parse_ethercat_link(options.source);
  const auto* raw = std::get_if<links::RawName>(&link);
  if (raw == nullptr) {
    throw Failure::wrong_use(fmt::format(
        "{}: a UDP connection cannot be monitored; capture it with tcpdump, or `servodrome up --log`", options.source));
  }
  const InterruptGuard guard(InterruptGuard::Command::only_looks);
  const master::Time start = links::steady_now();
  const int reason = links::monitor_interface(
      *raw, [&] { return is_over(options, start, links::steady_now()); },
      [&sniffer](std::span<const std::uint8_t> frame) { sniffer.take(frame, links::steady_now()); });
  if (reason != 0) throw Failure::did_not_work(fmt::format("{}: {}", options.source, std::strerror(reason)));
  sniffer.finish();
}

// Listens to the bytes of a serial line, from a tty or from a converter that sends them over TCP. Sends nothing.
void sniff_serial(const Options& options, Sniffer& sniffer) {
  constexpr auto look_time = std::chrono::milliseconds(20);
  const auto format = links::parse_character_format(options.format, options.bit_rate.value_or(serial_bit_rate));
  const InterruptGuard guard(InterruptGuard::Command::only_looks);
  const auto client = links::open_byte_client(links::parse_serial_link(options.source), *format);
  const master::Time start = client->now();
  master::Time heard = start;
  master::SerialBytes piece;
  const auto end = [&sniffer] {
    sniffer.end_of_bytes();
    sniffer.finish();
  };
  while (!is_over(options, start, client->now())) {
    piece.bytes.clear();
    bool any = false;
    try {
      any = client->receive(piece.bytes, look_time);
    } catch (const links::LinkError& error) {
      end();
      throw Failure::did_not_work(error.what());
    }
    if (any) {
      heard = client->now();
      sniffer.take(piece, heard);
    } else if (client->now() - heard > master::SerialDecoder::longest_gap) {
      sniffer.end_of_bytes();
    }
  }
  end();
}

void run(const Options& options) {
  Sniffer sniffer(options);
  if (links::is_any_of(links::can_schemes, options.source)) {
    sniff_can(options, sniffer);
  } else if (const bool is_ethercat = links::is_any_of(links::ethercat_schemes, options.source);
             is_ethercat || links::is_any_of(links::serial_schemes, options.source)) {
    try {
      is_ethercat ? sniff_ethercat(options, sniffer) : sniff_serial(options, sniffer);
    } catch (const links::LinkError& error) {
      throw Failure::wrong_use(error.what());
    }
  } else {
    sniff_file(options, sniffer);
  }
}

}  // namespace sniff_command

void add_sniff(CLI::App& app) {
  using namespace sniff_command;  // NOLINT(google-build-using-namespace)
  const auto [command, options] = add_command(
      app, "sniff", "Decode a capture or a live bus: services, objects by name with values, states, errors", run);
  command
      ->add_option(
          "SOURCE", options->source,
          fmt::format("Capture (candump or serial log, pcap or pcapng of CAN, EtherCAT, Modbus TCP or serial "
                      "lines; - is standard input), or a live bus: {}, {}{} (a converter that sends the bytes) "
                      "for RS485",
                      links::client_forms(live_can), help_of_live_ethercat(), links::client_forms(live_serial, " or ")))
      ->required();
  command
      ->add_option(
          "--filter", options->filters,
          "Show only node=N, kind=KIND or object=OBJECT; several values with commas, several options all apply")
      ->allow_extra_args(false);
  command->add_option("--eds", options->eds, "[NODE=]FILE: names, types and default PDOs from an EDS or DCF")
      ->allow_extra_args(false);
  command
      ->add_option("--product", options->products,
                   "[NODE=]PRODUCT: the same for a product of `servodrome products`, and its Modbus registers")
      ->allow_extra_args(false);
  add_seconds_option(*command, options->seconds,
                     "Duration in seconds; until Ctrl-C or the end of the capture if not given")
      ->check(number_within(0.001, 1e9));
  command
      ->add_option("--bit-rate", options->bit_rate,
                   "Bit rate in bit/s: of a CAN bus, for its load (1000000); of a serial line (115200)")
      ->check(CLI::Range(1200, 2'000'000).description(""));
  command->add_option("--format", options->format, "Format of a serial line: data bits, parity, stop bits")
      ->capture_default_str();
  command->add_option("--modbus-port", options->modbus_ports, "TCP port of Modbus servers, in addition to 502 and 1502")
      ->check(CLI::Range(1, 65535).description(""))
      ->allow_extra_args(false);
  command->add_flag("--sent", options->sent, "EtherCAT: also show frames as the master sent them");
  command->add_flag("--summary", options->summary,
                    "Print a summary at the end: frames by service and source, errors, bus load");
  command->add_flag("--quiet", options->quiet, "Print the summary only");
  command->add_flag("--json", options->json, "Print JSON, a line per frame");
}

}  // namespace servodrome::app
