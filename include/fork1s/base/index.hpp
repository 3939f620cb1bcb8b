// Strong indices: a body index cannot be handed over where a joint index is meant.
#pragma once

#include <cstddef>
#include <functional>

namespace fork1s {

/// An index into one kind of table. Default-constructed indices are invalid.
template <class Tag>
class Index {
 public:
  constexpr Index() = default;
  constexpr explicit Index(int value) : value_(value) {}
  constexpr explicit Index(std::size_t value) : value_(static_cast<int>(value)) {}

  constexpr bool valid() const { return value_ >= 0; }
  constexpr int value() const { return value_; }
  constexpr std::size_t u() const { return static_cast<std::size_t>(value_); }

  friend constexpr bool operator==(Index a, Index b) { return a.value_ == b.value_; }
  friend constexpr bool operator!=(Index a, Index b) { return a.value_ != b.value_; }
  friend constexpr bool operator<(Index a, Index b) { return a.value_ < b.value_; }

 private:
  int value_ = -1;
};

using BodyIndex = Index<struct BodyTag>;    ///< a body of one mechanism; 0 is its base
using JointIndex = Index<struct JointTag>;  ///< a joint of one mechanism

}  // namespace fork1s

template <class Tag>
struct std::hash<fork1s::Index<Tag>> {
  std::size_t operator()(fork1s::Index<Tag> i) const noexcept { return std::hash<int>{}(i.value()); }
};
