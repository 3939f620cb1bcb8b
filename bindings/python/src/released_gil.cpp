#include "released_gil.hpp"

#include <pthread.h>

#include "errors.hpp"

namespace fork1s::python {
namespace {

// Which threads are without the GIL, and whether the interpreter exits or a fork waits. Never destroyed,
// since threads may sleep on it while the process ends.
struct Gate {
  std::mutex mutex;
  std::condition_variable changed;
  int threads_outside = 0;  // that hold no GIL and will take it again
  int threads_working = 0;  // for which a fork waits
  bool is_exiting = false;
  std::atomic<bool> is_forking = false;
  int generation = 0;  // above 0: threads of the parent left references behind that nobody releases
  std::thread::id exiting_thread;

  // Needs the mutex.
  bool KeepsOut() const { return is_exiting && std::this_thread::get_id() != exiting_thread; }
};

Gate* gate = nullptr;
thread_local int own_outside = 0;  // share of this thread in threads_outside

[[noreturn]] void SleepUntilProcessEnds(std::unique_lock<std::mutex> lock) {
  for (;;) gate->changed.wait(lock);
}

void AddOutside(int change) {
  own_outside += change;
  gate->threads_outside += change;
}

// Returns unless the interpreter exits and this is another thread than the main one.
void PassGate(bool is_outside) {
  std::unique_lock lock(gate->mutex);
  if (gate->KeepsOut()) {
    if (is_outside) AddOutside(-1);
    gate->changed.notify_all();
    SleepUntilProcessEnds(std::move(lock));
  }
  if (!is_outside) AddOutside(1);
}

void WaitForThreadsOutside() {
  const std::unique_ptr<PyThreadState, void (*)(PyThreadState*)> released(PyEval_SaveThread(),
                                                                          PyEval_RestoreThread);
  std::unique_lock lock(gate->mutex);
  gate->is_exiting = true;
  gate->exiting_thread = std::this_thread::get_id();
  gate->changed.wait(lock, [] { return gate->threads_outside == 0; });
}

// The last callback of the interpreter before it exits, in the main thread.
void PrepareExit() {
  WaitForThreadsOutside();
  // Whatever other threads hold is never released.
  if (gate->generation > 0) nb::set_leak_warnings(false);
  const PyThreadState* const own = PyThreadState_Get();
  for (PyThreadState* t = PyInterpreterState_ThreadHead(PyInterpreterState_Get()); t;
       t = PyThreadState_Next(t))
    if (t != own) nb::set_leak_warnings(false);
}

// In the thread that forks, which holds the GIL.
void WaitForWork() {
  std::unique_lock lock(gate->mutex);
  gate->is_forking = true;
  gate->changed.wait(lock, [] { return gate->threads_working == 0; });
}

void GoOnInParent() {
  const std::lock_guard lock(gate->mutex);
  gate->is_forking = false;
  gate->changed.notify_all();
}

// Other threads may have held the gate's mutex, or waited.
void GoOnInChild() {
  const int generation = gate->generation + 1;
  gate = new Gate;
  gate->generation = generation;
  gate->threads_outside = own_outside;
}

}  // namespace

void ForkSafeWork::Begin() {
  std::unique_lock lock(gate->mutex);
  gate->changed.wait(lock, [] { return !gate->is_forking; });
  ++gate->threads_working;
}

void ForkSafeWork::End() {
  const std::lock_guard lock(gate->mutex);
  --gate->threads_working;
  gate->changed.notify_all();
}

bool ForkSafeWork::IsForkWaiting() { return gate->is_forking; }

void ForkSafeWork::LetForkPass() {
  if (IsForkWaiting()) const Rest rest;
}

int ForkGeneration() { return gate->generation; }

ReleasedGil::ReleasedGil() {
  state_ = PyEval_SaveThread();
  PassGate(false);
  work_.emplace();
}

ReleasedGil::~ReleasedGil() {
  work_.reset();
  PassGate(true);
  PyEval_RestoreThread(state_);  // the exit waits for this thread until here
  const std::lock_guard lock(gate->mutex);
  AddOutside(-1);
  gate->changed.notify_all();
}

bool ReleasedGil::IsPauseDue() const {
  return is_interrupted_ || ForkSafeWork::IsForkWaiting() || std::chrono::steady_clock::now() >= next_pause_;
}

bool ReleasedGil::Pause() {
  if (is_interrupted_) return true;
  {
    const std::lock_guard lock(gate->mutex);
    if (gate->KeepsOut()) return is_interrupted_ = true;
  }
  {
    const ForkSafeWork::Rest rest;
    PyEval_RestoreThread(state_);
    if (PyErr_CheckSignals() != 0) {
      raised_ = std::make_exception_ptr(nb::python_error());
      is_interrupted_ = true;
    }
    state_ = PyEval_SaveThread();
  }
  next_pause_ = std::chrono::steady_clock::now() + kSignalInterval;
  return is_interrupted_;
}

void ReleasedGil::ThrowIfInterrupted() {
  if (raised_) std::rethrow_exception(raised_);
  if (!is_interrupted_) return;
  work_.reset();
  PassGate(true);
}

void ReleasedGil::RegisterExitAndFork() {
  if (gate) return;
  gate = new Gate;
  pthread_atfork(WaitForWork, GoOnInParent, GoOnInChild);
  nb::module_::import_("atexit").attr("register")(nb::cpp_function(PrepareExit));
}

void CallMutex::Lock(const char* what) {
  if (holder_ == std::this_thread::get_id() && generation_ == ForkGeneration())
    throw Refused{
        {ErrorCode::kUsage, what,
         "a signal handler cannot use it within a call of its own that the signal interrupts; use it "
         "after that call"}};
  {
    const std::lock_guard lock(gate->mutex);
    if (generation_ != gate->generation) {
      if (holder_.load() != std::thread::id())
        throw Refused{{ErrorCode::kUsage, what,
                       "another thread was using it as this process was forked; make it again here, or start "
                       "processes by 'spawn'"}};
      static_cast<void>(mutex_.release());  // a thread that the child does not have may hold it
      mutex_ = std::make_unique<std::mutex>();
      generation_ = gate->generation;
    }
  }
  {
    const ForkSafeWork::Rest rest;
    mutex_->lock();
  }
  holder_ = std::this_thread::get_id();
}

void CallMutex::Unlock() {
  holder_ = std::thread::id();
  mutex_->unlock();
}

void FairMutex::lock() {
  std::unique_lock lock(mutex_);
  const std::uint64_t ticket = next_ticket_++;
  served_.wait(lock, [&] { return ticket == serving_; });
}

void FairMutex::unlock() {
  {
    const std::lock_guard lock(mutex_);
    ++serving_;
  }
  served_.notify_all();
}

}  // namespace fork1s::python
