#include "master/canopen/second_answer.hpp"

#include <algorithm>

#include "canopen/301/sdo_wire.hpp"

namespace servodrome::master {

namespace sdo = canopen::sdo;

namespace {

// True for the frames that name their object: answers to the initiation of an upload or download, and aborts.
bool names_object(const canopen::Frame& answer) {
  constexpr unsigned initiate_upload = 2;
  constexpr unsigned initiate_download = 3;
  const unsigned specifier = sdo::specifier(answer.data[0]);
  return answer.length == 8 &&
         (specifier == initiate_upload || specifier == initiate_download || answer.data[0] == sdo::abort_transfer);
}

bool is_of_object(const canopen::Frame& answer, ObjectAddress object) {
  return sdo::multiplexer_index(answer) == object.index && answer.data[3] == object.sub;
}

}  // namespace

void SecondAnswer::begin(ObjectAddress object, bool block) {
  // The segments of a block may look like any other answer.
  if (block || (answer_ && is_of_object(*answer_, object))) answer_.reset();
}

void SecondAnswer::end(const canopen::Frame& answer, canopen::Time now, std::uint64_t others_sent) {
  answer_.reset();
  // An answer that equals a recent one may be a late copy of it, which the transfer has taken for its own answer.
  const bool is_doubled = is_recent(answer);
  recent_[next_++ % recent_.size()] = answer;
  if (is_doubled || now < certain_from_ || !names_object(answer)) return;
  answer_ = answer;
  others_sent_ = others_sent;
}

bool SecondAnswer::is_recent(const canopen::Frame& answer) const {
  return std::any_of(recent_.begin(), recent_.end(),
                     [&](const canopen::Frame& known) { return known.data == answer.data; });
}

void SecondAnswer::doubt_until(canopen::Time time) {
  certain_from_ = std::max(certain_from_, time);
  answer_.reset();
}

void SecondAnswer::see(const canopen::Frame& answer, std::uint64_t others_sent) {
  if (!answer_ || others_sent != others_sent_ || !names_object(answer)) return;
  const ObjectAddress object{sdo::multiplexer_index(*answer_), answer_->data[3]};
  seen_ = seen_ || (is_of_object(answer, object) && !is_recent(answer));
}

}  // namespace servodrome::master
