#pragma once

#include "canopen/301/heartbeat_consumer.hpp"
#include "canopen/301/rpdo.hpp"
#include "canopen/301/tpdo.hpp"

namespace servodrome::canopen {

// The memory that a node uses; the device chooses its size.
struct NodeMemory {
  std::span<WaitingFrame> transmit_ring;  // a power of two
  std::span<Rpdo> rpdos;
  std::span<MappedObject> rpdo_objects;  // mapping entries per PDO times PDOs
  std::span<std::uint16_t> rpdo_pending;
  std::span<Tpdo> tpdos;
  std::span<MappedObject> tpdo_objects;
  std::span<std::uint16_t> tpdo_synchronous;
  std::span<std::uint16_t> tpdo_event_driven;
  std::span<HeartbeatConsumer> heartbeat_consumers;
  std::span<std::byte> sdo_buffer;  // must hold the largest object that is downloaded in segments or blocks
};

// At least 16 frames and twice the number of TPDOs, so that one SYNC cannot overflow it.
constexpr std::size_t transmit_ring_size(std::size_t tpdos) { return std::bit_ceil(std::size_t{16} + 2 * tpdos); }

// Storage for a device whose 1000h..1FFFh objects are a CommunicationObjects<Rpdos, Tpdos, MappingEntries, ...>.
template <std::size_t Rpdos, std::size_t Tpdos, std::size_t MappingEntries = 8, std::size_t HeartbeatConsumers = 1,
          std::size_t SdoBufferBytes = 64, std::size_t TransmitFrames = transmit_ring_size(Tpdos)>
class NodeStorage {
 public:
  static_assert(std::has_single_bit(TransmitFrames));
  static_assert(Rpdos <= 512 && Tpdos <= 512 && MappingEntries <= 64);

  NodeMemory memory() {
    return {transmit_ring_,
            rpdos_,
            rpdo_objects_,
            rpdo_pending_,
            tpdos_,
            tpdo_objects_,
            tpdo_synchronous_,
            tpdo_event_driven_,
            heartbeat_consumers_,
            sdo_buffer_};
  }

 private:
  std::array<WaitingFrame, TransmitFrames> transmit_ring_{};
  std::array<Rpdo, Rpdos> rpdos_{};
  std::array<MappedObject, Rpdos * MappingEntries> rpdo_objects_{};
  std::array<std::uint16_t, Rpdos> rpdo_pending_{};
  std::array<Tpdo, Tpdos> tpdos_{};
  std::array<MappedObject, Tpdos * MappingEntries> tpdo_objects_{};
  std::array<std::uint16_t, Tpdos> tpdo_synchronous_{};
  std::array<std::uint16_t, Tpdos> tpdo_event_driven_{};
  std::array<HeartbeatConsumer, HeartbeatConsumers> heartbeat_consumers_{};
  std::array<std::byte, SdoBufferBytes> sdo_buffer_{};
};

// The same for a given CommunicationObjects<...>.
template <typename Objects, std::size_t SdoBufferBytes = 64>
using NodeStorageFor = NodeStorage<Objects::rpdo_count, Objects::tpdo_count, Objects::mapping_entries,
                                   Objects::heartbeat_consumer_count, SdoBufferBytes>;

}  // namespace servodrome::canopen
