// Seeded changes of inputs, for where there is no libFuzzer.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace fork1s::fuzz {

/// The same seed draws the same changes with every standard library.
class Mutator {
 public:
  explicit Mutator(unsigned seed) : engine_(seed) {}
  /// One of the inputs with one to five changes: bytes flipped, put in, taken out, copied, taken from another
  /// input; numbers in text replaced.
  std::string Change(const std::vector<std::string>& inputs);

 private:
  std::size_t Below(std::size_t count) { return engine_() % count; }
  /// Where one of the stretches of `text` lies that begin and end so; empty without any.
  std::string_view Piece(std::string_view text, std::string_view begin, std::string_view end);
  bool ChangeXml(std::string& input, const std::vector<std::string>& inputs);
  void ChangeNumber(std::string& input, std::size_t at);
  void ChangeOnce(std::string& input, const std::vector<std::string>& inputs);
  std::mt19937 engine_;
};

}  // namespace fork1s::fuzz
