#include "tools/conform/departures.hpp"

#include <array>

namespace servodrome::master::conform {
namespace {

// Line numbers refer to the manuals' texts, as in the products' READMEs.
constexpr std::array rows{
    // ISMC application manual V1.6
    Departure{"ismc", "abort.value-range",
              "a homing method that it does not have is taken, and is fault 6289h when homing starts (ch. 5)", "6098h"},
    Departure{"ismc", "power.transition-16", "transition 16 is not supported (Table 3-2)", "6041h = 0617h"},
    // ProNet CANopen user's manual V1.04
    Departure{"pronet", "identity.supported-modes", "there is no 6502h (object dictionary in the appendix)", "6502h"},
    Departure{"pronet", "power.remote", "bits 8 and 9 of the statusword are not used (ch. 6.2.2)", "bit 9"},
    Departure{"pronet", "pdo.rpdo-mapping-while-valid", "a valid PDO may be mapped anew (ch. 3.3, 'PDO mapping case')"},
    Departure{"pronet", "pdo.tpdo-mapping-while-valid", "a valid PDO may be mapped anew (ch. 3.3, 'PDO mapping case')"},
    // iSMK manual; its EtherCAT variant is the same drive
    Departure{"ismk", "power.transition-11", "the statusword of quick stop active ends in 50h (Table 5-2)", "50h",
              "ismk-ea"},
    Departure{"ismk", "power.transition-12", "the statusword of quick stop active ends in 50h (Table 5-2)", "50h",
              "ismk-ea"},
    Departure{"ismk", "power.transition-16", "the statusword of quick stop active ends in 50h (Table 5-2)", "50h",
              "ismk-ea"},
    Departure{"ismk", "homing.attained", "bit 15 is homing attained, bit 12 is homing error (Table 5-5)", "bit 15",
              "ismk-ea"},
    Departure{"ismk", "homing.attained", "bit 10 stays 0 at the end of homing (ch. 8.3.2)", "bit 10", "ismk-ea"},
    Departure{"ismk", "homing.offset",
              "the axis travels by 607Ch and shows 0 there, unless 6099h sub 5 is 1 (Table 5-14, ch. 7.6)", "6064h",
              "ismk-ea"},
    Departure{"ismk", "ip.data-record", "the targets of mode 7 are in 607Ah (Table 9-27)", "60C1h", "ismk-ea"},
    Departure{"ismk", "nmt.heartbeat-consumer",
              "with 6007h = 0, its factory value, the loss of the master is ignored (Table 9-26)", "8130h"},
    Departure{"ismk", "pdo.reserved-type", "types 241 to 251 are taken (ch. 9.3.3.3)", "245", "ismk-ea"},
    Departure{"ismk", "modbus.no-address", "a refused read is answered with function 81h (ch. 8.3.1)", "81 02"},
    Departure{"ismk", "modbus.wrong-count", "a refused read is answered with function 81h (ch. 8.3.1)", "81 03"},
    // JMC EtherCAT manual
    Departure{"jmc_ec", "power.transition-11", "605Ah above 2 stops at once and ends in switch on disabled (Table 158)",
              "605Ah = 6"},
    Departure{"jmc_ec", "power.transition-12", "605Ah above 2 stops at once and ends in switch on disabled (Table 158)",
              "quick stop active"},
    Departure{"jmc_ec", "power.transition-16", "605Ah above 2 stops at once and ends in switch on disabled (Table 158)",
              "quick stop active"},
    Departure{"jmc_ec", "power.option-605A", "3 to 32767 are taken, and stop at once (Table 158)", "605Ah"},
    Departure{"jmc_ec", "power.option-605D", "3 to 32767 are taken, and stop at once (Table 161)", "605Dh"},
    Departure{"jmc_ec", "pv.zero-speed",
              "bit 12 of profile velocity is following the command, not speed zero (Table 156)", "bit 12"},
    Departure{"jmc_ec", "homing.offset",
              "607Ch is travelled, and not in method 35: the present point is 0 (Chart 42, HM 2.35)", "6064h"},
    Departure{"jmc_ec", "fault.error-code",
              "the error register is as printed with each fault, without the generic bit (Table 18)", "1001h"},
};

}  // namespace

std::span<const Departure> all_departures() { return rows; }

}  // namespace servodrome::master::conform
