// Transfer of data between a datagram and the controller's memory (ETG.1000.4 clauses 5.4, 6.5, 6.6).
#include <algorithm>

#include "ethercat/esc/esc.hpp"

namespace servodrome::ethercat {

namespace {

struct Overlap {
  std::uint32_t in_frame;  // first byte of the datagram's data
  std::uint32_t in_area;   // first byte of the area
  std::uint32_t length;    // 0: none
};

// Of `length` bytes at `address` and `area_length` bytes at `area`; neither range goes beyond the last address.
inline Overlap overlap(std::uint32_t address, std::uint32_t length, std::uint32_t area, std::uint32_t area_length) {
  const std::uint32_t ahead = area - address;
  if (ahead < length) return {ahead, 0, std::min(length - ahead, area_length)};
  const std::uint32_t behind = address - area;
  if (behind < area_length) return {0, behind, std::min(area_length - behind, length)};
  return {0, 0, 0};
}

// The logical address space does not wrap around.
constexpr std::uint32_t clipped(std::uint32_t address, std::uint32_t length) {
  return address + length < address ? 0U - address : length;
}

}  // namespace

unsigned Esc::sync_manager_at(std::uint32_t address) const {
  for (unsigned n = 0; n < sync_managers; ++n) {
    if (sync_managers_[n].contains(address)) return n;
  }
  return no_sync_manager;
}

// End of the memory without a sync manager that begins at `address`; at most `end`.
std::uint32_t Esc::plain_until(std::uint32_t address, std::uint32_t end) const {
  for (const SyncManager& channel : sync_managers_) {
    if (channel.guards && channel.start > address) end = std::min<std::uint32_t>(end, channel.start);
  }
  return end;
}

// Passes each accessible part of the range to `put(offset, bytes, count)`. Returns true if there is any.
template <typename Put>
bool Esc::read_memory(std::uint32_t address, std::uint32_t length, Put put) {
  if (address + length <= reg::process_memory) {
    refresh(address, length);
    put(std::uint32_t{0}, &memory_[address], length);
    if (ecat_events_ != 0) registers_read(address, length);
    return true;
  }
  bool any = false;
  for (std::uint32_t at = address, end = std::min<std::uint32_t>(address + length, memory_size); at < end;) {
    const std::uint32_t offset = at - address;
    if (at < reg::process_memory) {
      const std::uint32_t count = reg::process_memory - at;
      refresh(at, count);
      put(offset, &memory_[at], count);
      registers_read(at, count);
      any = true;
      at += count;
      continue;
    }
    const unsigned n = sync_manager_at(at);
    if (n == no_sync_manager) {
      const std::uint32_t count = plain_until(at, end) - at;
      put(offset, &memory_[at], count);
      any = true;
      at += count;
      continue;
    }
    SyncManager& channel = sync_managers_[n];
    const std::uint32_t within = at - channel.start;
    const std::int32_t place = channel.master_writes ? -1 : channel.reading_at(within);
    if (place < 0) {
      ++at;
      continue;
    }
    const std::uint32_t count = std::min(end - at, channel.length - within);
    put(offset, &memory_[static_cast<std::size_t>(place)], count);
    if (channel.read(within, count)) read_by_master(n);
    any = true;
    at += count;
  }
  return any;
}

// Counterpart of read_memory: `get(offset, bytes, count)` changes the bytes.
template <typename Get>
bool Esc::write_memory(std::uint32_t address, std::uint32_t length, Get get) {
  const bool locked = (memory_[reg::write_protection] & 1) != 0 && !memory_unlocked_;
  bool any = false;
  for (std::uint32_t at = address, end = std::min<std::uint32_t>(address + length, memory_size); at < end;) {
    const std::uint32_t offset = at - address;
    if (at < reg::process_memory) {
      const std::uint32_t count = std::min<std::uint32_t>(end, reg::process_memory) - at;
      // A register is written as a whole; bits that an FMMU does not map keep their values.
      std::array<std::uint8_t, max_payload + 1> bytes;
      std::memcpy(bytes.data(), &memory_[at], count);
      get(offset, bytes.data(), count);
      any |= take_register_bytes(at, std::span(bytes).first(count));
      at += count;
      continue;
    }
    if (locked) break;
    const unsigned n = sync_manager_at(at);
    if (n == no_sync_manager) {
      const std::uint32_t count = plain_until(at, end) - at;
      get(offset, &memory_[at], count);
      any = true;
      at += count;
      continue;
    }
    SyncManager& channel = sync_managers_[n];
    const std::uint32_t within = at - channel.start;
    const std::int32_t place = channel.active && channel.master_writes ? channel.writing_at(within) : -1;
    if (place < 0) {
      ++at;
      continue;
    }
    const std::uint32_t count = std::min(end - at, channel.length - within);
    get(offset, &memory_[static_cast<std::size_t>(place)], count);
    if (channel.wrote(within, count)) written_by_master(n);
    any = true;
    at += count;
  }
  return any;
}

void Esc::exchange(Datagram& datagram, bool reads, bool writes, bool combines) {
  const std::uint32_t address = datagram.offset();
  const std::uint32_t length = datagram.length;
  std::uint8_t* data = datagram.data();
  if (length == 0) return;
  std::array<std::uint8_t, max_payload> original;  // data to write, for a command that reads and writes
  if (reads && writes) std::memcpy(original.data(), data, length);
  const std::uint8_t* source = reads ? original.data() : data;
  bool read = false;
  if (reads) {
    read = read_memory(address, length,
                       [data, combines](std::uint32_t offset, const std::uint8_t* bytes, std::uint32_t count) {
                         if (!combines) {
                           std::memcpy(data + offset, bytes, count);
                           return;
                         }
                         for (std::uint32_t i = 0; i < count; ++i) data[offset + i] |= bytes[i];
                       });
  }
  bool written = false;
  if (writes) {
    const std::uint32_t target = reads ? address + load_u16(&memory_[reg::physical_offset]) : address;
    latches_ports_ = datagram.command == Command::bwr || datagram.command == Command::fpwr;
    written = write_memory(target, length, [source](std::uint32_t offset, std::uint8_t* bytes, std::uint32_t count) {
      std::memcpy(bytes, source + offset, count);
    });
    latches_ports_ = false;
  }
  datagram.count(gain(read, written, reads && writes));
}

bool Esc::read_mapped(const Mapping& mapping, const Datagram& datagram, std::uint32_t logical, std::uint32_t length) {
  const Overlap part = overlap(logical, length, mapping.logical, mapping.length);
  if (part.length == 0) return false;
  std::uint8_t* data = datagram.data() + part.in_frame;
  const std::uint32_t address = mapping.physical + part.in_area;
  if (mapping.sync_manager == no_sync_manager) {
    return read_memory(address, part.length,
                       [data](std::uint32_t offset, const std::uint8_t* bytes, std::uint32_t count) {
                         std::memcpy(data + offset, bytes, count);
                       });
  }
  SyncManager& channel = sync_managers_[mapping.sync_manager];
  const std::uint32_t within = address - channel.start;
  const std::int32_t place = channel.master_writes ? -1 : channel.reading_at(within);
  if (place < 0) return false;
  std::memcpy(data, &memory_[static_cast<std::size_t>(place)], part.length);
  if (channel.read(within, part.length)) read_by_master(mapping.sync_manager);
  return true;
}

bool Esc::write_mapped(const Mapping& mapping, const Datagram& datagram, std::uint32_t logical, std::uint32_t length) {
  const Overlap part = overlap(logical, length, mapping.logical, mapping.length);
  if (part.length == 0) return false;
  const std::uint8_t* data = datagram.data() + part.in_frame;
  const std::uint32_t address = mapping.physical + part.in_area;
  if (mapping.sync_manager == no_sync_manager) {
    return write_memory(address, part.length, [data](std::uint32_t offset, std::uint8_t* bytes, std::uint32_t count) {
      std::memcpy(bytes, data + offset, count);
    });
  }
  SyncManager& channel = sync_managers_[mapping.sync_manager];
  const std::uint32_t within = address - channel.start;
  const std::int32_t place = channel.master_writes ? channel.writing_at(within) : -1;
  if (place < 0) return false;
  std::memcpy(&memory_[static_cast<std::size_t>(place)], data, part.length);
  if (channel.wrote(within, part.length)) written_by_master(mapping.sync_manager);
  return true;
}

void Esc::exchange_logical(Datagram& datagram, bool reads, bool writes) {
  if (!whole_bytes_) {
    exchange_bits(datagram, reads, writes);
    return;
  }
  // The data to write are those that came in the frame, so writing comes before reading. No FMMU that reads shares
  // memory with one that writes.
  const std::uint32_t logical = datagram.logical();
  const std::uint32_t length = clipped(logical, datagram.length);
  bool written = false;
  bool read = false;
  if (writes) {
    for (unsigned i = 0; i < writing_count_; ++i) written |= write_mapped(writing_[i], datagram, logical, length);
  }
  if (reads) {
    for (unsigned i = 0; i < reading_count_; ++i) read |= read_mapped(reading_[i], datagram, logical, length);
  }
  datagram.count(gain(read, written, reads && writes));
}

// Exchange bit by bit: for FMMUs that begin or end within a byte, shift bits, or map the same memory in both
// directions.
void Esc::exchange_bits(Datagram& datagram, bool reads, bool writes) {
  std::array<std::uint8_t, max_payload> original;
  std::array<std::uint8_t, max_payload + 1> bytes;
  std::array<std::uint8_t, max_payload + 1> mask;
  std::memcpy(original.data(), datagram.data(), datagram.length);
  const std::uint64_t frame_bit = std::uint64_t{datagram.logical()} * 8;

  // Calls `with` with the first bit in the frame, the first bit in the memory, and the number of bits.
  const auto part_of = [&](const Fmmu& fmmu, auto&& with) {
    const std::uint64_t begin = std::max(frame_bit, fmmu.logical_bit());
    const std::uint64_t end =
        std::min(frame_bit + datagram.length * 8U, fmmu.logical_bit() + static_cast<std::uint64_t>(fmmu.bits()));
    if (begin >= end) return false;
    return with(static_cast<std::uint32_t>(begin - frame_bit),
                fmmu.physical_first_bit() + static_cast<std::uint32_t>(begin - fmmu.logical_bit()),
                static_cast<std::uint32_t>(end - begin));
  };

  bool read = false;
  bool written = false;
  // If two FMMUs read the same bit, the one with the lowest number is executed last and determines the value.
  for (unsigned n = fmmus; reads && n-- > 0;) {
    if (!fmmus_[n].active || !fmmus_[n].reads) continue;
    read |= part_of(fmmus_[n], [&](std::uint32_t in_frame, std::uint32_t in_memory, std::uint32_t bits) {
      const std::uint32_t first = in_memory / 8;
      const std::uint32_t count = (in_memory + bits - 1) / 8 - first + 1;
      std::fill_n(mask.begin(), count, std::uint8_t{0});
      const bool any =
          read_memory(first, count, [&](std::uint32_t offset, const std::uint8_t* from, std::uint32_t some) {
            std::memcpy(&bytes[offset], from, some);
            std::fill_n(mask.begin() + offset, some, std::uint8_t{1});
          });
      for (std::uint32_t i = 0; any && i < bits; ++i) {
        const std::uint32_t from = in_memory + i - first * 8;
        if (mask[from / 8] == 0) continue;
        const std::uint32_t to = in_frame + i;
        std::uint8_t& byte = datagram.data()[to / 8];
        byte = static_cast<std::uint8_t>((byte & ~(1U << to % 8)) | (bytes[from / 8] >> from % 8 & 1U) << to % 8);
      }
      return any;
    });
  }
  for (unsigned n = fmmus; writes && n-- > 0;) {
    if (!fmmus_[n].active || !fmmus_[n].writes) continue;
    written |= part_of(fmmus_[n], [&](std::uint32_t in_frame, std::uint32_t in_memory, std::uint32_t bits) {
      const std::uint32_t first = in_memory / 8;
      const std::uint32_t count = (in_memory + bits - 1) / 8 - first + 1;
      std::fill_n(mask.begin(), count, std::uint8_t{0});
      std::fill_n(bytes.begin(), count, std::uint8_t{0});
      for (std::uint32_t i = 0; i < bits; ++i) {
        const std::uint32_t from = in_frame + i;
        const std::uint32_t to = in_memory + i - first * 8;
        const unsigned bit = original[from / 8] >> from % 8 & 1U;
        bytes[to / 8] = static_cast<std::uint8_t>(bytes[to / 8] | bit << to % 8);
        mask[to / 8] = static_cast<std::uint8_t>(mask[to / 8] | 1U << to % 8);
      }
      return write_memory(first, count, [&](std::uint32_t offset, std::uint8_t* to, std::uint32_t some) {
        for (std::uint32_t i = 0; i < some; ++i) {
          to[i] = static_cast<std::uint8_t>((to[i] & ~mask[offset + i]) | bytes[offset + i]);
        }
      });
    });
  }
  datagram.count(gain(read, written, reads && writes));
}

void Esc::configure_mappings() {
  reading_count_ = writing_count_ = 0;
  whole_bytes_ = (memory_[reg::write_protection] & 1) == 0;
  // Highest number first: if two FMMUs read the same byte, the one with the lowest number is executed last and
  // determines the value.
  for (unsigned n = fmmus; n-- > 0;) {
    const Fmmu& fmmu = fmmus_[n];
    if (!fmmu.active || without_process_data_) continue;
    whole_bytes_ = whole_bytes_ && fmmu.whole_bytes();
    Mapping mapping{fmmu.logical, clipped(fmmu.logical, fmmu.length), fmmu.physical, no_sync_manager};
    for (unsigned channel = 0; channel < sync_managers; ++channel) {
      if (!sync_managers_[channel].contains_user_area(fmmu.physical, fmmu.length)) continue;
      mapping.sync_manager = static_cast<std::uint8_t>(channel);
      break;
    }
    if (fmmu.reads) reading_[reading_count_++] = mapping;
    if (fmmu.writes) writing_[writing_count_++] = mapping;
  }
  for (unsigned r = 0; r < reading_count_; ++r) {
    for (unsigned w = 0; w < writing_count_; ++w) {
      const Mapping& reading = reading_[r];
      const Mapping& writing = writing_[w];
      if (overlap(reading.physical, reading.length, writing.physical, writing.length).length != 0) whole_bytes_ = false;
    }
  }
  const auto is_buffer = [this](const Mapping& mapping, bool master_writes) {
    if (mapping.sync_manager == no_sync_manager || mapping.length > most_few_bytes) return false;
    const SyncManager& channel = sync_managers_[mapping.sync_manager];
    return channel.mode == SyncManager::Mode::buffered && channel.master_writes == master_writes &&
           channel.start == mapping.physical && channel.length == mapping.length;
  };
  one_buffer_each_ = whole_bytes_ && writing_count_ == 1 && reading_count_ == 1 && is_buffer(writing_[0], true) &&
                     is_buffer(reading_[0], false);
  fit_ = {};
  reach_ = {};
  if (!one_buffer_each_) return;
  const auto end = [](const Mapping& mapping) { return std::uint64_t{mapping.logical} + mapping.length; };
  reach_.begin = std::min(writing_[0].logical, reading_[0].logical);
  reach_.end = std::max(end(writing_[0]), end(reading_[0]));
}

// Returns true if the datagram contains both buffers completely. Then it caches their positions in `fit_`.
bool Esc::fit(const Datagram& datagram) {
  if (!one_buffer_each_) return false;
  const std::uint32_t logical = datagram.logical();
  const std::uint32_t length = clipped(logical, datagram.length);
  const Mapping& writing = writing_[0];
  const Mapping& reading = reading_[0];
  const Overlap outputs = overlap(logical, length, writing.logical, writing.length);
  const Overlap inputs = overlap(logical, length, reading.logical, reading.length);
  if (outputs.length != writing.length || inputs.length != reading.length) return false;
  fit_.logical = logical;
  fit_.length = datagram.length;
  fit_.outputs = outputs.in_frame;
  fit_.inputs = inputs.in_frame;
  fit_.writing = &sync_managers_[writing.sync_manager];
  fit_.reading = &sync_managers_[reading.sync_manager];
  fit_.events = reg::al_event::sync_manager0 << writing.sync_manager | reg::al_event::sync_manager0
                                                                           << reading.sync_manager;
  return true;
}

}  // namespace servodrome::ethercat
