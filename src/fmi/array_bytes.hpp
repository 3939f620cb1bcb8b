// Numbers, texts and arrays as bytes, as this machine has them: archives and states are for one kind of machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace fork1s::fmi {

class ArrayWriter {
 public:
  std::string bytes;

  void Count(std::size_t count) { Number(static_cast<std::uint64_t>(count)); }
  template <class T>
  void Number(T value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void Text(const std::string& text) {
    Count(text.size());
    bytes += text;
  }
  template <class T>
  void List(const std::vector<T>& list) {
    Count(list.size());
    if (!list.empty()) bytes.append(reinterpret_cast<const char*>(list.data()), list.size() * sizeof(T));
  }
};

class ArrayReader {
 public:
  explicit ArrayReader(const std::string& bytes) : bytes_(bytes) {}

  // `size`: of an element. Throws where there are fewer bytes.
  std::size_t Count(std::size_t size = 1) {
    const auto count = Number<std::uint64_t>();
    if (count > (bytes_.size() - at_) / size) throw std::runtime_error("it ends early");
    return static_cast<std::size_t>(count);
  }
  template <class T>
  T Number() {
    if (bytes_.size() - at_ < sizeof(T)) throw std::runtime_error("it ends early");
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string Text() {
    const std::size_t count = Count();
    std::string text = bytes_.substr(at_, count);
    at_ += count;
    return text;
  }
  template <class T>
  void List(std::vector<T>& list) {
    list.resize(Count(sizeof(T)));
    if (!list.empty())
      std::memcpy(static_cast<void*>(list.data()), bytes_.data() + at_, list.size() * sizeof(T));
    at_ += list.size() * sizeof(T);
  }

 private:
  const std::string& bytes_;
  std::size_t at_ = 0;
};

}  // namespace fork1s::fmi
