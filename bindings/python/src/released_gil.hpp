// Work without the GIL that a signal can interrupt and that survives the exit of the interpreter.
#pragma once

#include <nanobind/nanobind.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>

namespace fork1s::python {

namespace nb = nanobind;

/// Releases the GIL for its lifetime; the calling thread must hold it. Inside, no Python object may be made,
/// changed or released.
///
/// The destructor takes the GIL again, except in a thread that is not the main thread once the interpreter
/// exits: that thread sleeps until the process ends. CPython before 3.14 ends such a thread by unwinding its
/// stack from within PyEval_RestoreThread, which aborts the process where the stack holds destructors.
class ReleasedGil {
 public:
  ReleasedGil();
  ~ReleasedGil();
  ReleasedGil(const ReleasedGil&) = delete;
  ReleasedGil& operator=(const ReleasedGil&) = delete;

  /// Whether the call should end early: a signal handler raised (KeyboardInterrupt), or the interpreter
  /// exits. May be called by any thread at any rate. Signal handlers run in the thread that made this object,
  /// every kSignalInterval at most, so a lock that handlers could wait for must not be held.
  bool IsInterrupted();
  /// Throws what the signal handler raised, if one did; does not return where the interpreter exits.
  void ThrowIfInterrupted();

  /// Called once by the module: lets threads that are without the GIL come to rest before the interpreter
  /// exits.
  static void RegisterExit();

 private:
  static constexpr std::chrono::milliseconds kSignalInterval{50};  // half of what a user notices, 0.1 s

  PyThreadState* state_ = nullptr;
  const std::thread::id thread_ = std::this_thread::get_id();
  std::chrono::steady_clock::time_point next_check_ = std::chrono::steady_clock::now() + kSignalInterval;
  std::atomic<bool> is_interrupted_ = false;
  std::exception_ptr raised_;  // by a signal handler
};

/// A mutex that is handed over in the order of arrival: a thread that locks it step by step leaves room for
/// others.
class FairMutex {
 public:
  void lock();
  void unlock();

 private:
  std::mutex mutex_;
  std::condition_variable served_;
  std::uint64_t next_ticket_ = 0, serving_ = 0;
};

}  // namespace fork1s::python
