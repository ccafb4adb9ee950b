#include "axis/plcopen/administrative_blocks.hpp"

#include <array>
#include <cmath>

namespace servodrome::master::plcopen {

namespace {

// Parameters that are numbers. The master has one set of limits, so a "System" parameter reads the value of the "Appl"
// parameter.
struct NumberParameter {
  Parameter number;
  double AxisConfiguration::*field;
  bool is_writable;
};
constexpr std::array numbers{
    NumberParameter{Parameter::SWLimitPos, &AxisConfiguration::positive_limit, true},
    NumberParameter{Parameter::SWLimitNeg, &AxisConfiguration::negative_limit, true},
    NumberParameter{Parameter::MaxPositionLag, &AxisConfiguration::max_position_lag, true},
    NumberParameter{Parameter::MaxVelocitySystem, &AxisConfiguration::max_velocity, false},
    NumberParameter{Parameter::MaxVelocityAppl, &AxisConfiguration::max_velocity, true},
    NumberParameter{Parameter::MaxAccelerationSystem, &AxisConfiguration::max_acceleration, false},
    NumberParameter{Parameter::MaxAccelerationAppl, &AxisConfiguration::max_acceleration, true},
    NumberParameter{Parameter::MaxDecelerationSystem, &AxisConfiguration::max_deceleration, false},
    NumberParameter{Parameter::MaxDecelerationAppl, &AxisConfiguration::max_deceleration, true},
    NumberParameter{Parameter::MaxJerkSystem, &AxisConfiguration::max_jerk, false},
    NumberParameter{Parameter::MaxJerkAppl, &AxisConfiguration::max_jerk, true},
};

struct BoolParameter {
  Parameter number;
  bool AxisConfiguration::*field;
};
constexpr std::array bools{
    BoolParameter{Parameter::EnableLimitPos, &AxisConfiguration::enable_positive_limit},
    BoolParameter{Parameter::EnableLimitNeg, &AxisConfiguration::enable_negative_limit},
    BoolParameter{Parameter::EnablePosLagMonitoring, &AxisConfiguration::enable_lag_monitoring},
};

// True for dynamic limits: maximum lag, velocity, acceleration, deceleration and jerk.
bool is_a_limit(Parameter number) { return number != Parameter::SWLimitPos && number != Parameter::SWLimitNeg; }

bool is_measured(Parameter number) {
  return number == Parameter::CommandedPosition || number == Parameter::ActualVelocity ||
         number == Parameter::CommandedVelocity;
}

}  // namespace

ErrorId read_parameter(Axis& axis, Parameter number, double& value) {
  switch (number) {
    case Parameter::CommandedPosition: return value = axis.commanded_position(), ErrorId::none;
    case Parameter::ActualVelocity: return value = axis.actual_velocity(), ErrorId::none;
    case Parameter::CommandedVelocity: return value = axis.commanded_velocity(), ErrorId::none;
    default: break;
  }
  for (const NumberParameter& one : numbers) {
    if (one.number == number) return value = axis.configuration().*one.field, ErrorId::none;
  }
  return ErrorId::no_such_parameter;
}

ErrorId read_parameter(Axis& axis, Parameter number, bool& value) {
  for (const BoolParameter& one : bools) {
    if (one.number == number) return value = axis.configuration().*one.field, ErrorId::none;
  }
  return ErrorId::no_such_parameter;
}

ErrorId write_parameter(Axis& axis, Parameter number, double value) {
  if (is_measured(number)) return ErrorId::parameter_is_read_only;
  for (const NumberParameter& one : numbers) {
    if (one.number != number) continue;
    if (!one.is_writable) return ErrorId::parameter_is_read_only;
    if (!std::isfinite(value) || (is_a_limit(number) && !(value > 0.0))) return ErrorId::parameter_invalid;
    axis.configuration().*one.field = value;
    return ErrorId::none;
  }
  return ErrorId::no_such_parameter;
}

ErrorId write_parameter(Axis& axis, Parameter number, bool value) {
  for (const BoolParameter& one : bools) {
    if (one.number != number) continue;
    axis.configuration().*one.field = value;
    return ErrorId::none;
  }
  return ErrorId::no_such_parameter;
}

void MC_Reset::operator()(Axis& axis) {
  if (rises()) {
    result_ = axis.reset();
    runs_ = true;
    has_result_ = false;
    waited_s_ = 0.0;
    begin();
  }
  if (runs_) {
    waited_s_ += axis.motion().generator().period_s();
    if (axis.state() != AxisState::ErrorStop) {
      runs_ = false;
      has_result_ = true;
    } else if (waited_s_ > patience_s) {
      runs_ = false;
      has_result_ = true;
      result_ = ErrorId::reset_failed;
      axis.cancel_reset();
    }
  }
  if (has_result_ && is_to_be_cleared()) has_result_ = false;
  Done = has_result_ && result_ == ErrorId::none;
  set(runs_, false, has_result_ ? result_ : ErrorId::none);
}

void MC_ReadStatus::operator()(Axis& axis) {
  run([] { return ErrorId::none; });
  struct Flag {
    AxisState state;
    bool MC_ReadStatus::*output;
  };
  static constexpr std::array flags{Flag{AxisState::ErrorStop, &MC_ReadStatus::ErrorStop},
                                    Flag{AxisState::Disabled, &MC_ReadStatus::Disabled},
                                    Flag{AxisState::Stopping, &MC_ReadStatus::Stopping},
                                    Flag{AxisState::Homing, &MC_ReadStatus::Homing},
                                    Flag{AxisState::Standstill, &MC_ReadStatus::Standstill},
                                    Flag{AxisState::DiscreteMotion, &MC_ReadStatus::DiscreteMotion},
                                    Flag{AxisState::ContinuousMotion, &MC_ReadStatus::ContinuousMotion},
                                    Flag{AxisState::SynchronizedMotion, &MC_ReadStatus::SynchronizedMotion}};
  for (const Flag& flag : flags) this->*flag.output = Valid && axis.state() == flag.state;
}

void MC_TouchProbe::operator()(Axis& axis) {
  using Status = ProbeRequest::Status;
  if (rises()) {
    request_ = std::make_shared<ProbeRequest>(ProbeRequest{.probe = TriggerInput.probe,
                                                           .rising = TriggerInput.rising,
                                                           .window_only = WindowOnly,
                                                           .first_position = FirstPosition,
                                                           .last_position = LastPosition});
    error_ = TriggerInput.probe >= 1 && TriggerInput.probe <= 2 ? axis.arm(request_) : ErrorId::parameter_invalid;
    begin();
  }
  Done = false;
  set(false, false, ErrorId::none);
  if (!request_) return;
  const bool waits =
      error_ == ErrorId::none && (request_->status == Status::clearing || request_->status == Status::waiting);
  if (!waits && is_to_be_cleared()) {
    request_.reset();
    return;
  }
  Done = error_ == ErrorId::none && request_->status == Status::done;
  if (Done) RecordedPosition = request_->recorded_position;
  set(waits, error_ == ErrorId::none && request_->status == Status::aborted, error_);
}

}  // namespace servodrome::master::plcopen
