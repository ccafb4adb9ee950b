#include "fibre.hpp"

#include <stdexcept>

namespace servodrome::chaos {

// makecontext passes only integers, so the address is passed in two halves.
Fibre::Fibre(std::function<void()> body) : body_(std::move(body)) {
  if (::getcontext(&own_) != 0) throw std::runtime_error("getcontext failed");
  own_.uc_stack.ss_sp = stack_.data();
  own_.uc_stack.ss_size = stack_.size();
  own_.uc_link = &owner_;
  const auto address = reinterpret_cast<std::uintptr_t>(this);
  ::makecontext(&own_, reinterpret_cast<void (*)()>(&Fibre::enter), 2, static_cast<unsigned>(address >> 32),
                static_cast<unsigned>(address));
}

void Fibre::enter(unsigned high, unsigned low) {
  auto* fibre = reinterpret_cast<Fibre*>(std::uintptr_t{high} << 32 | low);
  fibre->body_();
  fibre->over_ = true;
}

void Fibre::resume() {
  if (!over_) ::swapcontext(&owner_, &own_);
}

void Fibre::pause() { ::swapcontext(&own_, &owner_); }

}  // namespace servodrome::chaos
