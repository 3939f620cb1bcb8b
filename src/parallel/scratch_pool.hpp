// Scratch memory that belongs to the work at hand and not to each object that may do it.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace fork1s {

/// Objects of type T that are borrowed for a piece of work and given back after it. There come to be as many
/// as were out at one time, however many objects do such work: 1024 worlds stepped by two threads share two.
///
/// Not thread-local, since a thread that waits in a loop of ParallelFor may take up other work that borrows
/// as well. What is borrowed holds the leftovers of other work: results must not depend on them.
template <class T>
class ScratchPool {
 public:
  class Lease {
   public:
    Lease(ScratchPool& pool, std::unique_ptr<T> scratch) : pool_(&pool), scratch_(std::move(scratch)) {}
    Lease(Lease&&) noexcept = default;
    Lease& operator=(Lease&&) = delete;
    ~Lease() {
      if (scratch_) pool_->Return(std::move(scratch_));
    }
    T& operator*() const { return *scratch_; }
    T* operator->() const { return scratch_.get(); }

   private:
    ScratchPool* pool_;
    std::unique_ptr<T> scratch_;
  };

  /// Gives all of a list back at the end of a scope; the list keeps its memory.
  class ReturnAll {
   public:
    explicit ReturnAll(std::vector<Lease>& list) : list_(list) {}
    ~ReturnAll() { list_.clear(); }
    ReturnAll(const ReturnAll&) = delete;
    ReturnAll& operator=(const ReturnAll&) = delete;

   private:
    std::vector<Lease>& list_;
  };

  /// The one that was returned last, or a new one.
  Lease Borrow() {
    {
      const std::lock_guard lock(mutex_);
      if (!free_.empty()) {
        std::unique_ptr<T> last = std::move(free_.back());
        free_.pop_back();
        return {*this, std::move(last)};
      }
      free_.reserve(++count_);  // so that no return allocates
    }
    return {*this, std::make_unique<T>()};
  }

 private:
  void Return(std::unique_ptr<T> scratch) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(scratch));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> free_;
  std::size_t count_ = 0;  // free and out
};

}  // namespace fork1s
