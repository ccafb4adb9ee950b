#pragma once

#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "ethercat/esc/fmmu.hpp"
#include "ethercat/frame/datagram.hpp"
#include "host/sniff/pdo_mapping.hpp"
#include "host/sniff/sdo_conversation.hpp"

namespace servodrome::host {

// EtherCAT frames in words, a line for each datagram. Sans-IO: Ethernet frames in (type 88A4h or UDP to port 88A4h),
// words out. Remembers what the master sets up: station addresses, sync managers, FMMUs, PDO mappings, so frames come
// in order and from the beginning if process data shall have names.
//
// A capture has each frame twice, as the master sent it and as it came back (bit 1 of the source address set by the
// first slave). Words are about those that came back; how many did not, `lost` tells.
class EthercatDecoder {
 public:
  EthercatDecoder();
  // What the slaves are, for names and default mappings; `position` from 1 on, 0: all others.
  void set_model(unsigned position, DeviceModel model);
  // What the master set up before frames were decoded: registers of a slave, from `offset` on (station address, sync
  // managers, FMMUs).
  void preset(unsigned position, std::uint16_t station, std::uint16_t offset, std::span<const std::uint8_t> registers);
  // Frames of the master are described as well.
  void show_sent(bool show) { show_sent_ = show; }

  // One for each datagram; none for a frame of the master, unless shown.
  std::vector<Decoded> decode(std::span<const std::uint8_t> ethernet_frame, Time time);
  // At the end of a capture: frames that were sent and did not come back.
  std::uint64_t lost() const { return lost_ + sent_.size(); }
  std::uint64_t sent_frames() const { return sent_frames_; }
  std::uint64_t returned_frames() const { return returned_frames_; }

 private:
  struct Area {
    std::uint16_t start = 0;
    std::uint16_t length = 0;
  };
  struct Slave {
    unsigned position = 0;  // behind the master, from 1 on; 0: not known
    std::shared_ptr<const DeviceModel> model;
    PdoObjects pdos;
    SdoConversation sdo;
    std::map<unsigned, Area> sync_managers;
    std::map<unsigned, ethercat::Fmmu> fmmus;
  };
  // What of a frame tells that another is the same one, back again.
  struct Sent {
    std::vector<std::uint32_t> datagrams;  // command, index, length
    std::vector<std::uint16_t> positions;  // ADP as the master had it
  };

  Decoded decode_datagram(const ethercat::Datagram& datagram, const Sent* sent, std::size_t number, Time time,
                          bool returned);
  bool match(const Sent& frame, Sent& found);
  Slave& slave(std::uint16_t station);
  std::shared_ptr<const DeviceModel> model_of(unsigned position) const;
  void learn(Slave& slave, std::uint16_t offset, std::span<const std::uint8_t> data);
  void describe_memory(Slave& slave, std::uint16_t offset, std::span<const std::uint8_t> data, bool write,
                       Decoded& decoded);
  void describe_mailbox(Slave& slave, std::span<const std::uint8_t> data, bool from_master, Decoded& decoded);
  void describe_coe(Slave& slave, std::span<const std::uint8_t> coe, bool from_master, Decoded& decoded);
  void describe_logical(const ethercat::Datagram& datagram, Decoded& decoded);

  std::shared_ptr<const DeviceModel> standard_;
  std::map<unsigned, std::shared_ptr<const DeviceModel>> models_;
  std::map<std::uint16_t, Slave> slaves_;  // by station address
  std::deque<Sent> sent_;
  std::map<std::uint64_t, std::uint16_t> best_working_counter_;  // of logical datagrams, by command and address
  bool show_sent_ = false;
  std::uint64_t lost_ = 0;
  std::uint64_t sent_frames_ = 0;
  std::uint64_t returned_frames_ = 0;
};

}  // namespace servodrome::host
