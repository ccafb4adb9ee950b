#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "api/change_log.hpp"
#include "catalogue/product.hpp"
#include "studio/commissioning.hpp"

namespace servodrome::studio {

// Why a change cannot be undone at all; empty: it can be. Only parameters can be undone, so that an undo never commands
// a motion.
std::string reason_against_undo(const api::Change& change, const catalogue::Product& product);

// What an undo shall do.
struct UndoOrder {
  std::function<bool(const api::Change&)> is_selected{};
  bool is_preview = false;  // it reads the drive, and writes nothing
  std::optional<std::set<std::uint64_t>>
      only{};  // numbers of the values that it may write (UndoReport::Object::number)
};

// The result of an undo, or of its preview.
struct UndoReport {
  struct Object {
    std::uint64_t number;  // the newest of the undone changes of the object
    master::ObjectAddress object;
    std::string name;
    const dictionary::Entry* entry;
    api::KeptValue from;
    api::KeptValue to;
  };
  struct Kept {
    std::uint64_t number;
    master::ObjectAddress object;
    std::string name;
    std::string what;  // why the value stays
    std::string hint;
  };
  std::vector<Object> undone;
  std::vector<Kept> kept;
};

// Undoes the changes of an axis for which `is_selected` returns true. Writes to each object the value before the oldest
// of its selected changes, beginning with the object that changed last. A value stays, with its reason, if
// - a change that is not selected followed, or the value is not among `only`,
// - the drive no longer has the value that was written,
// - it cannot be undone at all (reason_against_undo), the axis has torque, or the drive refuses the write.
// The settings of the process data (1400h to 1BFFh, 1C12h, 1C13h) are undone write by write, since their order counts.
UndoReport undo(const api::ChangeLog& log, std::uint32_t axis, Subject& subject, const UndoOrder& order);

// The report for an axis whose drive cannot be accessed: each object with a selected change stays, for this reason.
UndoReport undo_nothing(const api::ChangeLog& log, std::uint32_t axis, const UndoOrder& order, const std::string& what,
                        const std::string& hint);

}  // namespace servodrome::studio
