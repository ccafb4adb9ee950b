#include "axis/plcopen/error_id.hpp"

namespace servodrome::master::plcopen {

const char* text_of(ErrorId error) {
  switch (error) {
    case ErrorId::none: return "no error";
    case ErrorId::state_does_not_permit: return "the axis's state does not permit it; see MC_ReadStatus";
    case ErrorId::parameter_invalid: return "an input is not a number, or not above zero; give all dynamics";
    case ErrorId::above_limit: return "an input is above the axis's limit; see MC_ReadParameter 9, 13, 15 and 17";
    case ErrorId::beyond_software_limit: return "the target is beyond a software limit; see MC_ReadParameter 2 and 3";
    case ErrorId::queue_full: return "too many commands are buffered; wait for Active of one";
    case ErrorId::not_mapped: return "the process data lack a required object; map it";
    case ErrorId::no_such_parameter: return "the axis does not have this parameter";
    case ErrorId::parameter_is_read_only: return "the parameter cannot be written";
    case ErrorId::master_invalid: return "the master is the axis itself or follows it, or a ratio is 0";
    case ErrorId::not_on_the_cam:
      return "the slave axis is not at the start of the cam; move it there, or start relative";
    case ErrorId::probe_in_use: return "another MC_TouchProbe is active on this input; MC_AbortTrigger ends it";
    case ErrorId::drive_fault: return "the drive has a fault; MC_ReadAxisError has its code, MC_Reset resets it";
    case ErrorId::left_operation: return "the drive left operation enabled; check supply, enable and safety inputs";
    case ErrorId::communication_lost: return "process data were not received; check cables and power";
    case ErrorId::following_error: return "the position lag is too large; check load and brake, or reduce the dynamics";
    case ErrorId::mode_refused: return "the drive does not accept the mode of operation; see 6502h";
    case ErrorId::homing_failed: return "homing failed; check switches, 6098h and 6099h";
    case ErrorId::software_limit_reached: return "the axis was stopped before a software limit; reset, and move back";
    case ErrorId::reset_failed: return "the fault cannot be reset; remove its cause";
    case ErrorId::not_following:
      return "the drive ignores its target position; see whether a limit switch or an input stops it, and move it away";
    case ErrorId::quick_stop: return "the axis was stopped by a quick stop; reset it";
  }
  return "unknown error";
}

ErrorId error_of(AxisFault fault) {
  switch (fault) {
    case AxisFault::none: return ErrorId::none;
    case AxisFault::drive_fault: return ErrorId::drive_fault;
    case AxisFault::left_operation: return ErrorId::left_operation;
    case AxisFault::communication_lost: return ErrorId::communication_lost;
    case AxisFault::following_error: return ErrorId::following_error;
    case AxisFault::mode_refused: return ErrorId::mode_refused;
    case AxisFault::homing_failed: return ErrorId::homing_failed;
    case AxisFault::not_following: return ErrorId::not_following;
    case AxisFault::quick_stop: return ErrorId::quick_stop;
  }
  return ErrorId::drive_fault;
}

}  // namespace servodrome::master::plcopen
