#pragma once

#include "host/error.hpp"

namespace servodrome::host {

// Something on an EtherCAT segment did not work.
class EthercatError : public HostError {
 public:
  enum class Kind {
    no_answer,        // frames do not come back
    working_counter,  // they come back, but not every slave that should took part
    refused,          // a slave says no: AL status code, error of a mailbox service
    malformed,        // an answer that does not belong to the request
    unsupported,      // the slave or this master does not have it
  };

  EthercatError(Kind kind, std::string happened, std::string where, std::string remedy)
      : HostError(std::move(happened), std::move(where), std::move(remedy)), kind_(kind) {}

  Kind kind() const { return kind_; }

 private:
  Kind kind_;
};

}  // namespace servodrome::host
