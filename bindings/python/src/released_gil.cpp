#include "released_gil.hpp"

#include <pthread.h>

namespace fork1s::python {
namespace {

// Which threads are without the GIL, and whether the interpreter exits. Never destroyed, since threads may
// sleep on it while the process ends.
struct ExitGate {
  std::mutex mutex;
  std::condition_variable changed;
  int threads_outside = 0;  // that hold no GIL and will take it again
  bool is_exiting = false;
  bool is_forked = false;  // threads of the parent left references behind that nobody releases
  std::thread::id exiting_thread;

  // Needs the mutex.
  bool KeepsOut() const { return is_exiting && std::this_thread::get_id() != exiting_thread; }
};

ExitGate* gate = nullptr;

[[noreturn]] void SleepUntilProcessEnds(std::unique_lock<std::mutex> lock) {
  for (;;) gate->changed.wait(lock);
}

// Returns unless the interpreter exits and this is another thread than the main one.
void PassGate(bool is_outside) {
  std::unique_lock lock(gate->mutex);
  if (gate->KeepsOut()) {
    gate->threads_outside -= is_outside;
    gate->changed.notify_all();
    SleepUntilProcessEnds(std::move(lock));
  }
  gate->threads_outside += !is_outside;
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
  if (gate->is_forked) nb::set_leak_warnings(false);
  const PyThreadState* const own = PyThreadState_Get();
  for (PyThreadState* t = PyInterpreterState_ThreadHead(PyInterpreterState_Get()); t;
       t = PyThreadState_Next(t))
    if (t != own) nb::set_leak_warnings(false);
}

}  // namespace

ReleasedGil::ReleasedGil() {
  state_ = PyEval_SaveThread();
  PassGate(false);
}

ReleasedGil::~ReleasedGil() {
  PassGate(true);
  PyEval_RestoreThread(state_);  // the exit waits for this thread until here
  const std::lock_guard lock(gate->mutex);
  --gate->threads_outside;
  gate->changed.notify_all();
}

bool ReleasedGil::IsInterrupted() {
  if (is_interrupted_ || std::this_thread::get_id() != thread_) return is_interrupted_;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_check_) return false;
  next_check_ = now + kSignalInterval;
  {
    const std::lock_guard lock(gate->mutex);
    if (gate->KeepsOut()) return is_interrupted_ = true;
  }
  PyEval_RestoreThread(state_);
  if (PyErr_CheckSignals() != 0) {
    raised_ = std::make_exception_ptr(nb::python_error());
    is_interrupted_ = true;
  }
  state_ = PyEval_SaveThread();
  return is_interrupted_;
}

void ReleasedGil::ThrowIfInterrupted() {
  if (raised_) std::rethrow_exception(raised_);
  if (is_interrupted_) PassGate(true);
}

void ReleasedGil::RegisterExit() {
  if (gate) return;
  gate = new ExitGate;
  // Of the threads that were outside, a child process has none.
  pthread_atfork(nullptr, nullptr, [] {
    gate = new ExitGate;
    gate->is_forked = true;
  });
  nb::module_::import_("atexit").attr("register")(nb::cpp_function(PrepareExit));
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
