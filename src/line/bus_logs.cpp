#include "line/bus_logs.hpp"

#include <memory>
#include <utility>

#include "links/can/log.hpp"
#include "links/ethercat/log.hpp"
#include "links/serial/log.hpp"

namespace servodrome::line {
namespace {

constexpr auto flush_period = std::chrono::milliseconds(100);

std::string file_of(const std::string& path) { return path == "-" ? "/dev/stdout" : path; }

template <typename Logs, typename File, typename Bus>
void attach_log(Logs& logs, std::shared_ptr<File> file, Bus& bus, std::function<void()> on_failure) {
  bus.add_observer(*file);
  logs.push_back({[file](Time epoch) { file->set_epoch(epoch); }, [file] { file->flush(); },
                  [file] { return file->failed(); }, [file, &bus] { bus.remove_observer(*file); },
                  std::move(on_failure)});
}

}  // namespace

BusLogs::~BusLogs() {
  for (const Log& log : logs_) log.detach();
}

void BusLogs::add(NamedBus& bus, const std::string& path, Time epoch, std::function<void()> on_failure) {
  const auto format = path.ends_with(".pcap") ? links::CanLog::Format::pcap : links::CanLog::Format::candump;
  attach_log(logs_, std::make_shared<links::CanLog>(file_of(path), format, bus.settings.name, epoch), bus.bus,
             std::move(on_failure));
}

void BusLogs::add(NamedEthercatBus& bus, const std::string& path, Time epoch, std::function<void()> on_failure) {
  attach_log(logs_, std::make_shared<links::EthercatLog>(file_of(path), epoch), bus.bus, std::move(on_failure));
}

void BusLogs::add(NamedSerialBus& bus, const std::string& path, Time epoch, std::function<void()> on_failure) {
  const bool pcap = path.ends_with(".pcap") || path.ends_with(".pcapng");
  const auto file = std::make_shared<links::SerialLog>(
      file_of(path), pcap ? links::SerialLog::Format::pcapng : links::SerialLog::Format::text, bus.settings.name,
      bus.line, epoch);
  logs_.push_back({[file](Time its_epoch) { file->set_epoch(its_epoch); }, [file] { file->flush(); },
                   [file] { return file->failed(); }, [] {}, std::move(on_failure)});
}

void BusLogs::set_epoch(Time epoch) {
  for (const Log& log : logs_) log.set_epoch(epoch);
}

void BusLogs::flush() {
  for (Log& log : logs_) {
    log.flush();
    if (log.failed() && log.on_failure) std::exchange(log.on_failure, {})();
  }
}

void BusLogs::flush_in_time(std::chrono::steady_clock::time_point present) {
  if (present < next_flush_) return;
  next_flush_ = present + flush_period;
  flush();
}

}  // namespace servodrome::line
