#include "connection.hpp"

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fmt/format.h>
#include <fstream>
#include <iterator>

#include "line/line_file.hpp"
#include "line/registry.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/error.hpp"

namespace examples {

using namespace servodrome;

namespace {

std::string text_of(std::string_view line_file) {
  std::ifstream file(std::string(SERVODROME_LINES) + "/" + std::string(line_file));
  return {std::istreambuf_iterator<char>(file), {}};
}

std::unique_ptr<line::Line> line_of(std::string_view text, const std::string& name) {
  const line::LineFile file = line::parse_line_file(text, name, line::all_products());
  if (!file.diagnostics.empty()) throw std::runtime_error(to_string(file.diagnostics.front()));
  return std::make_unique<line::Line>(file.settings);
}

std::atomic<bool> interrupt_seen{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // the signal handler writes it

}  // namespace

bool interrupted() { return interrupt_seen; }

// Throws only once, because the code that stops the axes afterwards also waits.
void throw_if_interrupted() {
  if (interrupt_seen.exchange(false)) throw std::runtime_error("interrupted");
}

QuickStopOnFailure::QuickStopOnFailure(master::ObjectClient& drive)
    : drive_(drive), exceptions_(std::uncaught_exceptions()) {}

QuickStopOnFailure::~QuickStopOnFailure() {
  if (std::uncaught_exceptions() == exceptions_) return;
  constexpr std::uint16_t quick_stop = 0x0002;
  constexpr int most_attempts = 2;
  for (int attempt = 0; attempt < most_attempts; ++attempt) {
    try {
      drive_.write<std::uint16_t>(0x6040, 0, quick_stop);
      return;
    } catch (const master::MasterError&) {
      return;  // the drive does not answer; the program reports the first error
    } catch (...) {
      // Ctrl-C came again during the write: the write is repeated once.
    }
  }
}

Can::Can(std::string_view link, std::string_view line_file) {
  if (!link.empty()) {
    bus_ = master::Bus::open(link);
    watching_ = bus_->every(std::chrono::milliseconds(20), throw_if_interrupted);
    return;
  }
  line_ = line_of(text_of(line_file), std::string(line_file));
  auto client = std::make_unique<links::MemoryCanClient>(line_->buses().front()->bus, *line_);
  bus_ = std::make_unique<master::Bus>(std::move(client), "mem:", line_.get());
  bus_->run_for(std::chrono::milliseconds(500));  // time for the drives to boot
}

void Ethercat::open(std::string_view link, std::string_view text, const std::string& name) {
  if (!link.empty()) {
    master_ = master::EthercatMaster::open(link);
    return;
  }
  line_ = line_of(text, name);
  master_ = std::make_unique<master::EthercatMaster>(
      std::make_unique<links::MemoryEthercatClient>(line_->ethercat_buses().front()->bus, *line_));
}

Ethercat::Ethercat(std::string_view link, std::string_view line_file) {
  open(link, text_of(line_file), std::string(line_file));
}

Ethercat Ethercat::on_line(std::string_view link, std::string_view line_text) {
  Ethercat ethercat;
  ethercat.open(link, line_text, "the example's line");
  return ethercat;
}

void expect_near(const char* what, double is, double should_be, double tolerance) {
  fmt::print("{}: {:.7g}\n", what, is);
  if (std::abs(is - should_be) <= tolerance) return;
  throw std::runtime_error(
      fmt::format("{} is {:.6g} and should be {:.6g} within {:g}", what, is, should_be, tolerance));
}

int run(int argc, char** argv, const char* usage, const std::function<void(std::string_view)>& program) {
  if (argc > 1 && (std::strcmp(argv[1], "--help") == 0 || std::strcmp(argv[1], "-h") == 0)) {
    fmt::print("{}\n", usage);
    return 0;
  }
  if (argc > 2) {
    fmt::print(stderr, "{}\n", usage);
    return 2;
  }
  std::signal(SIGINT, [](int) { interrupt_seen = true; });
  try {
    program(argc > 1 ? argv[1] : "");
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}

}  // namespace examples
