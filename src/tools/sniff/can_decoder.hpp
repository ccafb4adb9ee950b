#pragma once

#include <array>
#include <map>
#include <memory>

#include "canopen/frame.hpp"
#include "tools/sniff/pdo_mapping.hpp"
#include "tools/sniff/sdo_conversation.hpp"

namespace servodrome::master {

// Decodes the frames of a CAN bus to text, by the predefined connection set (CiA 301 table 39) and by the COB-IDs and
// mappings that earlier frames configure. A pure state machine without input or output: frames in, text out. It tracks
// SDO transfers and PDO configurations, so frames must be passed in order.
class CanDecoder {
 public:
  CanDecoder();
  // Sets the device model of a node (1..127), or of all nodes without a model of their own (0).
  void set_model(std::uint8_t node_id, DeviceModel model);

  Decoded decode(const canopen::Frame& frame, Time time);

 private:
  struct Node {
    std::shared_ptr<const DeviceModel> model;
    PdoObjects pdos;
    SdoConversation sdo;
  };
  // The PDO that a CAN-ID belongs to.
  struct Place {
    std::uint8_t node_id = 0;  // 0: unknown
    bool transmit = false;     // true: TPDO
    std::uint16_t number = 0;  // 0: the first
  };

  Node& node(std::uint8_t node_id);
  Place place_of(std::uint32_t can_id);
  void rebuild_places();
  void decode_sdo(const canopen::Frame& frame, std::uint8_t node_id, bool from_client, Decoded& decoded);
  void decode_pdo(const canopen::Frame& frame, Place place, Decoded& decoded);
  bool decode_service(const canopen::Frame& frame, Decoded& decoded);

  std::shared_ptr<const DeviceModel> standard_;
  std::map<std::uint8_t, std::shared_ptr<const DeviceModel>> models_;
  std::map<std::uint8_t, Node> nodes_;
  std::map<std::uint32_t, Place> places_;  // CAN-IDs that were configured, or come from a model
};

// For example "585 [8] 4B 41 60 00 37 02 00 00" or "701 [1] remote".
std::string raw_text(const canopen::Frame& frame);

}  // namespace servodrome::master
