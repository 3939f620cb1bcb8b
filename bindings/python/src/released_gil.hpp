// Work without the GIL that a signal can interrupt, and that survives the exit of the interpreter and forks.
#pragma once

#include <nanobind/nanobind.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

namespace fork1s::python {

namespace nb = nanobind;

/// Work of a thread that does not hold the GIL. A process is forked only while all such work rests, so that
/// no lock in the child is held by a thread that the child does not have. A fork waits for work with the GIL
/// in its hands: the work takes the GIL at rest only.
class ForkSafeWork {
 public:
  ForkSafeWork() { Begin(); }
  ~ForkSafeWork() { End(); }
  ForkSafeWork(const ForkSafeWork&) = delete;
  ForkSafeWork& operator=(const ForkSafeWork&) = delete;

  /// Waits until a fork that is under way is done. Neither this nor Rest may be used with a lock held that
  /// other work waits for, nor while threads work for this one.
  static void LetForkPass();
  static bool IsForkWaiting();

  /// Rests for its lifetime.
  class Rest {
   public:
    Rest() { End(); }
    ~Rest() { Begin(); }
    Rest(const Rest&) = delete;
    Rest& operator=(const Rest&) = delete;
  };

 private:
  static void Begin();
  static void End();
};

/// How often this process or its ancestors were forked since the module was loaded.
int ForkGeneration();

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

  /// Whether the call should come to a Pause: kSignalInterval after the last, or where a fork waits. May be
  /// called by any thread at any rate.
  bool IsPauseDue() const;
  /// Runs signal handlers and lets a process be forked, in the thread that made this object, under the
  /// conditions of ForkSafeWork::LetForkPass. Returns true if the call should end early: a handler raised
  /// (KeyboardInterrupt), or the interpreter exits.
  bool Pause();
  /// Throws what the signal handler raised, if one did; does not return where the interpreter exits.
  void ThrowIfInterrupted();

  /// Called once by the module: lets threads that are without the GIL come to rest before the interpreter
  /// exits, or the process is forked.
  static void RegisterExitAndFork();

 private:
  static constexpr std::chrono::milliseconds kSignalInterval{50};  // half of what a user notices, 0.1 s

  PyThreadState* state_ = nullptr;
  std::optional<ForkSafeWork> work_;
  std::chrono::steady_clock::time_point next_pause_ = std::chrono::steady_clock::now() + kSignalInterval;
  bool is_interrupted_ = false;
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

/// A mutex for calls that pause while they hold it: waiting for it is rest.
class CallMutex {
 public:
  /// what: whose mutex this is. Throws Refused in a signal handler that runs within a call of the same thread
  /// that holds it, and in a child process where another thread held it as the process was forked.
  void Lock(const char* what);
  void Unlock();

 private:
  std::unique_ptr<std::mutex> mutex_ = std::make_unique<std::mutex>();
  std::atomic<int> generation_ = ForkGeneration();  // that mutex_ is of
  std::atomic<std::thread::id> holder_;
};

/// Calls work() with the mutex held.
template <class Work>
void WithCallMutex(CallMutex& mutex, const char* what, const Work& work) {
  mutex.Lock(what);
  struct Unlock {
    CallMutex& mutex;
    ~Unlock() { mutex.Unlock(); }
  } const at_end{mutex};
  work();
}

}  // namespace fork1s::python
