#pragma once

#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "ethercat/esc/fmmu.hpp"
#include "ethercat/frame/datagram.hpp"
#include "tools/sniff/pdo_mapping.hpp"
#include "tools/sniff/sdo_conversation.hpp"

namespace servodrome::master {

// Decodes EtherCAT frames to text, one entry for each datagram. A pure state machine without input or output: Ethernet
// frames in (type 88A4h, or UDP to port 88A4h), text out. It tracks the master's configuration: station addresses, sync
// managers, FMMUs, PDO mappings. So the caller must pass the frames in order. Process data have names only if the
// frames include this configuration.
//
// A capture contains each frame twice: as the master sent it, and as it returned (the first slave sets bit 1 of the
// source address). The text describes returned frames; `lost` counts those that did not return.
class EthercatDecoder {
 public:
  EthercatDecoder();
  // Sets the device model of a slave, for names and default mappings. `position`: 1 is the first slave; 0: all slaves
  // without a model of their own.
  void set_model(unsigned position, DeviceModel model);
  // Passes configuration that the master wrote before the decoding started: a slave's registers from `offset` on
  // (station address, sync managers, FMMUs).
  void preset(unsigned position, std::uint16_t station, std::uint16_t offset, std::span<const std::uint8_t> registers);
  // True: decode() also describes the frames that the master sends.
  void show_sent(bool show) { show_sent_ = show; }

  // One entry for each datagram; none for a frame from the master, unless show_sent(true).
  std::vector<Decoded> decode(std::span<const std::uint8_t> ethernet_frame, Time time);
  // After the end of a capture: number of frames that were sent and did not return.
  std::uint64_t lost() const { return lost_ + sent_.size(); }
  std::uint64_t sent_frames() const { return sent_frames_; }
  std::uint64_t returned_frames() const { return returned_frames_; }

 private:
  struct Area {
    std::uint16_t start = 0;
    std::uint16_t length = 0;
  };
  struct Slave {
    unsigned position = 0;  // position on the segment, 1: the first; 0: unknown
    std::shared_ptr<const DeviceModel> model;
    PdoObjects pdos;
    SdoConversation sdo;
    std::map<unsigned, Area> sync_managers;
    std::map<unsigned, ethercat::Fmmu> fmmus;
  };
  // Identifies a frame, so that the returned frame can be matched with it.
  struct Sent {
    std::vector<std::uint32_t> datagrams;  // command, index, length
    std::vector<std::uint16_t> positions;  // ADP as sent by the master
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
  std::map<std::uint64_t, std::uint16_t> best_working_counter_;  // highest counter of logical datagrams so far, by
                                                                 // command and address
  bool show_sent_ = false;
  std::uint64_t lost_ = 0;
  std::uint64_t sent_frames_ = 0;
  std::uint64_t returned_frames_ = 0;
};

}  // namespace servodrome::master
