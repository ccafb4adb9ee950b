#pragma once

#include "master/error.hpp"
#include "modbus/pdu.hpp"

namespace servodrome::master {

// A Modbus request failed.
class ModbusError : public MasterError {
 public:
  enum class Kind {
    no_answer,  // no answer in time
    refused,    // exception() has the reason
    malformed,  // an answer that does not fit the request
  };

  ModbusError(Kind kind, modbus::Exception exception, std::string happened, std::string where, std::string remedy)
      : MasterError(std::move(happened), std::move(where), std::move(remedy)), kind_(kind), exception_(exception) {}

  Kind kind() const { return kind_; }
  modbus::Exception exception() const { return exception_; }

 private:
  Kind kind_;
  modbus::Exception exception_;
};

}  // namespace servodrome::master
