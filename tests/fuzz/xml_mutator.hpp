// For targets that read XML: libFuzzer's own changes, and in turn those that leave it well-formed.
#pragma once

#ifdef FORK1S_LIBFUZZER
#include <cstdint>
#include <cstring>

#include "mutate.hpp"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  if (seed % 4 == 0) return LLVMFuzzerMutate(data, size, most);
  fork1s::fuzz::Mutator mutator(seed);
  const std::string changed = mutator.Change({std::string(reinterpret_cast<const char*>(data), size)});
  const std::size_t length = changed.size() < most ? changed.size() : most;
  std::memcpy(data, changed.data(), length);
  return length;
}
#endif
