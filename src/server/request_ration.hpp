// Time for requests, so that whoever sends many cannot take it from the others.
#pragma once

#include <algorithm>

namespace fork1s {

/// Grants requests at most a share of the time that passes: a dear one is answered when its turn comes, and
/// then the next waits until as much time has passed as its cost is worth.
class RequestRation {
 public:
  RequestRation(double share, double frame) : share_(share), most_(share * frame) {}
  /// Time [s] has passed since the last call.
  void Pass(double seconds) { credit_ = std::min(most_, credit_ + share_ * seconds); }
  bool Allows() const { return credit_ > 0; }
  void Spend(double seconds) { credit_ -= seconds; }

 private:
  double share_, most_, credit_ = 0;
};

}  // namespace fork1s
