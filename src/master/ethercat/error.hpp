#pragma once

#include "master/error.hpp"

namespace servodrome::master {

// An error on an EtherCAT segment.
class EthercatError : public MasterError {
 public:
  enum class Kind {
    no_answer,        // frames do not return
    working_counter,  // frames return, but not every addressed slave took part
    refused,          // a slave refuses: AL status code, error of a mailbox service
    malformed,        // an answer that does not fit the request
    unsupported,      // the slave or this master does not support it
  };

  EthercatError(Kind kind, std::string happened, std::string where, std::string remedy)
      : MasterError(std::move(happened), std::move(where), std::move(remedy)), kind_(kind) {}

  Kind kind() const { return kind_; }

 private:
  Kind kind_;
};

}  // namespace servodrome::master
