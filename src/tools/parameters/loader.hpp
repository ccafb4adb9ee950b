#pragma once

#include <map>

#include "catalogue/product.hpp"
#include "tools/parameters/values.hpp"

namespace servodrome::master {

struct LoadOptions {
  NodeId node_id{};
  bool force = false;        // load also into another product
  bool skip_absent = false;  // skip objects that the drive does not have on this bus, instead of rejecting the file
  ParameterProgress progress{};
  // Called before the first write to an object of the communication area (1000h to 1FFFh), which by CiA 301 needs
  // pre-operational.
  std::function<void()> before_communication{};
};

struct LoadReport {
  std::size_t compared = 0;                    // values of the file that the drive has
  std::vector<ObjectAddress> written{};        // values of the file that differed and were written
  std::vector<ObjectAddress> skipped{};        // absent in the drive, with skip_absent
  std::vector<ObjectAddress> after_restart{};  // written ones that take effect at the next power-on
  std::vector<ObjectAddress> volatile_ones{};  // written ones that the drive cannot store
};

// A load that failed after its first write.
class LoadError : public MasterError {
 public:
  enum class Outcome {
    rolled_back,  // all values are as before
    partly,       // some could not be restored: not_restored()
    bus_lost,     // nothing could be restored: the drive has the values written()
  };
  LoadError(const MasterError& cause, const std::string& remedy, Outcome outcome, std::vector<ObjectAddress> written,
            std::vector<ObjectAddress> not_restored);

  Outcome outcome() const { return outcome_; }
  const std::vector<ObjectAddress>& written() const { return written_; }
  const std::vector<ObjectAddress>& not_restored() const { return not_restored_; }

 private:
  Outcome outcome_;
  std::vector<ObjectAddress> written_;
  std::vector<ObjectAddress> not_restored_;
};

// Loads the values of a file into a drive and verifies them.
//
// Checks before the first write: the file is for this product; each value has the parameter's type and is within its
// limits; the drive has the objects; its motor is not enabled. Then it writes the values that differ; a PDO is switched
// off while it is changed (CiA 301 7.5.2.35 to 38, ETG.1000.6 for 1C12h and 1C13h). Values that the drive refuses are
// tried again after the others, since limits may depend on one another. Finally it reads all values back, and writes
// again those that another write has changed. If some values still differ after several passes, it restores the
// previous values.
//
// Throws MasterError if nothing was written, otherwise LoadError.
LoadReport load_parameters(ObjectClient& objects, const ParameterFile& file, const std::string& file_name,
                           const ParameterList& list, const DriveIdentity& drive, const LoadOptions& options);

// Sends the drive's commands for storing the parameters; false if it has none. Throws MasterError.
bool store_parameters(ObjectClient& objects, const catalogue::ParameterRules& rules);

// For example "6081:00, 6083:00 and 12 more".
std::string text_of(std::span<const ObjectAddress> objects, std::size_t at_most = 8);

}  // namespace servodrome::master
