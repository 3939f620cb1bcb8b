// What libraries print to standard error meanwhile. Qhull explains a mesh that it cannot wrap on fifty lines,
// before the one sentence that says so.
#pragma once

namespace fork1s::app {

class HeldErrors {
 public:
  /// Begins to hold what is printed; does nothing where there is no descriptor for it.
  HeldErrors();
  /// Lets go: prints what was held, unless dropped.
  ~HeldErrors();
  HeldErrors(const HeldErrors&) = delete;
  HeldErrors& operator=(const HeldErrors&) = delete;
  /// What was held is not printed: an error says the same.
  void Drop() { dropped_ = true; }

 private:
  int held_ = -1, before_ = -1;
  bool dropped_ = false;
};

}  // namespace fork1s::app
