#pragma once

#include <memory>
#include <string>
#include <vector>

#include "api/change_log.hpp"
#include "line/line.hpp"

namespace servodrome::studio {

// Notes every write to the objects of a line's drives: by masters on the buses, by clients of the API and by jobs.
class LineChanges {
 public:
  using WallClock = std::chrono::nanoseconds (*)();

  // `line` must outlive this object.
  explicit LineChanges(line::Line& line, WallClock wall_clock = links::wall_now);
  ~LineChanges();
  LineChanges(const LineChanges&) = delete;
  LineChanges& operator=(const LineChanges&) = delete;

  api::ChangeLog& log() { return log_; }

 private:
  // One of the two dictionaries of a drive.
  class Tap final : public dictionary::Recorder {
   public:
    // `of_fieldbus`: the dictionary of the masters on the fieldbus, else that of the service port.
    Tap(LineChanges& changes, std::uint32_t axis, dictionary::Dictionary& dictionary, bool of_fieldbus);
    ~Tap();
    Tap(const Tap&) = delete;
    Tap& operator=(const Tap&) = delete;

    void before(const dictionary::Entry& entry, std::span<const std::byte> value) override;
    void written(const dictionary::Entry& entry, std::span<const std::byte> value) override;

   private:
    LineChanges& changes_;
    std::uint32_t axis_;
    dictionary::Dictionary& dictionary_;
    bool of_fieldbus_;
    api::KeptValue before_;
  };

  struct Master {
    std::string on_fieldbus;  // "SDO on can0"
    std::string file;         // "FoE on ecat0": a parameter file
    std::string modbus;       // "Modbus on rs485a"
    std::string serial10;     // "10-byte protocol on rs485a"
  };
  static Master master_of(const line::Line& line, const line::Axis& axis);
  std::string_view writer(std::uint32_t axis, bool of_fieldbus) const;

  line::Line& line_;
  WallClock wall_clock_;
  api::ChangeLog log_;
  std::vector<Master> masters_;
  std::vector<std::unique_ptr<Tap>> taps_;
};

}  // namespace servodrome::studio
