#pragma once

#include <map>

#include "tools/parameters/values.hpp"

namespace servodrome::master {

// A value in the format of the bus.
struct WantedValue {
  dictionary::Type type = dictionary::Type::unsigned32;
  std::vector<std::byte> bytes{};
};
using WantedValues = std::map<ObjectAddress, WantedValue>;

// Brings objects of one drive to wanted values, in an order that drives accept, and stores the previous values.
class ParameterWriter {
 public:
  ParameterWriter(ObjectClient& objects, std::function<void()> before_communication, ParameterProgress progress)
      : objects_(objects), before_communication_(std::move(before_communication)), progress_(std::move(progress)) {}

  // Returns when all values are as wanted. Throws MasterError if the bus is lost, or if the drive keeps refusing or
  // changing a value.
  void bring_to(const WantedValues& wanted);

  // The values before the first write, including auxiliary objects such as a PDO's identifier.
  const WantedValues& before() const { return before_; }
  // The objects whose value may have changed.
  std::vector<ObjectAddress> written() const;
  void set_progress(ParameterProgress progress) { progress_ = std::move(progress); }

 private:
  void write(ObjectAddress address, dictionary::Type type, std::vector<std::byte> bytes);
  void try_to_write(ObjectAddress address, dictionary::Type type, std::vector<std::byte> bytes);
  std::int64_t number(ObjectAddress address, dictionary::Type type);
  void switch_off(std::uint16_t communication);
  void write_plainly(const WantedValues& changes);
  void write_pdos(const WantedValues& changes, const WantedValues& wanted);
  void write_assignments(const WantedValues& changes, const WantedValues& wanted);
  void write_counted(std::uint16_t index, const WantedValues& changes, const WantedValues& wanted);

  ObjectClient& objects_;
  std::function<void()> before_communication_;
  ParameterProgress progress_;
  WantedValues before_{};
  std::map<ObjectAddress, std::string> refused_{};  // refused in this pass, with the drive's reason
  bool communication_begun_ = false;
  std::size_t done_ = 0;
  std::size_t of_ = 0;
};

}  // namespace servodrome::master
