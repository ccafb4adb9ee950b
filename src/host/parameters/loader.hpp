#pragma once

#include <map>

#include "host/parameters/values.hpp"

namespace servodrome::host {

struct LoadOptions {
  NodeId node_id{};
  bool force = false;        // also into another product
  bool skip_absent = false;  // leave out what the drive does not have on this bus, instead of refusing the file
  ParameterProgress progress{};
  // Called before the first write to an object of the communication area (1000h to 1FFFh), which CiA 301 wants in
  // pre-operational.
  std::function<void()> before_communication{};
};

struct LoadReport {
  std::size_t compared = 0;                    // values of the file the drive has
  std::vector<ObjectAddress> written{};        // those of the file that were another value
  std::vector<ObjectAddress> skipped{};        // not there, with skip_absent
  std::vector<ObjectAddress> after_restart{};  // of the written ones, those that act after the next power-on
  std::vector<ObjectAddress> volatile_ones{};  // ... and those the drive cannot keep over power-off
};

// A load that failed after its first write.
class LoadError : public HostError {
 public:
  enum class Outcome {
    rolled_back,  // the drive has the values it had before
    partly,       // some could not be taken back: not_restored()
    bus_lost,     // nothing could be taken back: written() are in the drive
  };
  LoadError(const HostError& cause, const std::string& remedy, Outcome outcome, std::vector<ObjectAddress> written,
            std::vector<ObjectAddress> not_restored);

  Outcome outcome() const { return outcome_; }
  const std::vector<ObjectAddress>& written() const { return written_; }
  const std::vector<ObjectAddress>& not_restored() const { return not_restored_; }

 private:
  Outcome outcome_;
  std::vector<ObjectAddress> written_;
  std::vector<ObjectAddress> not_restored_;
};

// Writes the values of a file into a drive and proves that they are there.
//
// Before anything is written: the file is of this product, each value is of the parameter's type and within its limits,
// the drive has the objects, and its motor is not enabled. Then those values are written that the drive does not have
// already, PDOs being switched off while they are changed (CiA 301 7.5.2.35 to 38, ETG.1000.6 for 1C12h and 1C13h).
// What a drive refuses is tried again after the others, since limits may depend on one another; then everything is read
// back, and what another write changed is written again. If that comes to no end, what was written is taken back.
//
// Throws HostError if nothing was written, LoadError after that.
LoadReport load_parameters(ObjectClient& objects, const ParameterFile& file, const std::string& file_name,
                           const ParameterList& list, const DriveIdentity& drive, const LoadOptions& options);

// Stores the parameters where the drive has a command for it; false if it has none. Throws HostError.
bool store_parameters(ObjectClient& objects, const ParameterRules& rules);

// "6081:00, 6083:00 and 12 more"
std::string text_of(std::span<const ObjectAddress> objects, std::size_t at_most = 8);

}  // namespace servodrome::host
