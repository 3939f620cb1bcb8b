#include "server/full_ghost.hpp"

#ifdef __linux__
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include <fmt/format.h>

namespace fork1s {
namespace {

// Where processors are few the live simulation goes first.
void StepBack() {
#ifdef __linux__
  constexpr int kNice = 10;
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), kNice);
#endif
}

// A full simulation and where its driven bases count from.
class Twin {
 public:
  static Expected<Twin> Create(GhostStart start) {
    const auto key = static_cast<std::size_t>(start.options.initial_keyframe);
    std::vector<RigidTransform> own;
    for (const auto& m : start.scene.keyframes.at(key).mechanisms) own.push_back(m.X_WR);
    auto made = FullSimulation::Create(std::move(start.scene), start.options);
    if (!made) return tl::unexpected(made.error());
    return Twin(std::move(*made), std::move(start.base_start), std::move(own));
  }

  FullStepReport Step(const GhostStep& step) {
    simulation_.SetGravity(step.gravity_W);
    simulation_.SetControls(FromHere(step.controls));
    for (const GhostStep::Load& load : step.loads)
      simulation_.ApplyWrench(load.body, load.force_W, load.moment_W,
                              simulation_.Pose(load.body) * load.point_B);
    return simulation_.Step();
  }

  void Measure(const std::vector<Vector3>& p_WB, GhostView& view) const {
    view.X_WB.clear();
    view.distance = 0;
    for (std::size_t b = 0; b < p_WB.size(); ++b) {
      view.X_WB.push_back(simulation_.Pose(static_cast<int>(b)));
      const double distance = (view.X_WB.back().translation() - p_WB[b]).norm();
      if (distance < view.distance) continue;
      view.distance = distance;
      view.body = static_cast<int>(b);
    }
  }

 private:
  Twin(FullSimulation simulation, std::vector<RigidTransform> theirs, std::vector<RigidTransform> own)
      : simulation_(std::move(simulation)), theirs_(std::move(theirs)), own_(std::move(own)) {}

  // Controls of driven bases count from the base's pose at each simulation's own start.
  VectorX FromHere(VectorX controls) const {
    Eigen::Index at = controls.size();
    for (int i = simulation_.num_mechanisms(); i-- > 0;) {
      if (simulation_.mechanism(i).base() != BaseKind::kDriven) continue;
      at -= 6;
      const RigidTransform &from = theirs_[static_cast<std::size_t>(i)],
                           &to = own_[static_cast<std::size_t>(i)];
      const Matrix3 R = ExpRotation(controls.segment<3>(at + 3)) * from.rotation();
      controls.segment<3>(at) += from.translation() - to.translation();
      controls.segment<3>(at + 3) = LogRotation(R * to.rotation().transpose());
    }
    return controls;
  }

  FullSimulation simulation_;
  std::vector<RigidTransform> theirs_, own_;
};

}  // namespace

struct FullGhost::Detail {
  explicit Detail(double most) : most_behind(most), thread([this] { Work(); }) {}
  ~Detail() {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      stop = true;
    }
    wake.notify_one();
    thread.join();
  }

  void Work();
  void Finish(const std::string& sentence);  // under the lock

  const double most_behind;
  mutable std::mutex mutex;
  std::condition_variable wake;
  // All guarded. A session is what one Begin started.
  bool stop = false, on = false;
  int session = 0;
  std::optional<GhostStart> start;  // of a session that has not been built yet
  std::deque<GhostStep> steps;      // to be done
  std::int64_t pushed = 0;
  double dt = 0, start_time = 0;
  std::optional<GhostView> newest;
  std::optional<std::string> fault;

  std::thread thread;  // last, so that it finds everything else in place
};

void FullGhost::Detail::Finish(const std::string& sentence) {
  on = false;
  start.reset();
  steps.clear();
  newest.reset();
  fault = sentence;
}

void FullGhost::Detail::Work() {
  StepBack();
  std::optional<Twin> twin;
  int mine = 0;  // session that `twin` belongs to
  std::unique_lock<std::mutex> lock(mutex);
  while (true) {
    wake.wait(lock, [&] { return stop || (on && (start || !steps.empty())) || (!on && twin); });
    if (stop) return;
    if (!on) {
      twin.reset();
    } else if (start) {
      GhostStart begin = std::move(*start);
      start.reset();
      mine = session;
      twin.reset();
      lock.unlock();
      GhostView view;
      view.time = begin.time;
      const std::vector<Vector3> p_WB = std::move(begin.p_WB);
      auto made = Twin::Create(std::move(begin));
      if (made) made->Measure(p_WB, view);
      lock.lock();
      if (mine != session || !on) continue;
      if (made) {
        twin = std::move(*made);
        newest = std::move(view);
      } else {
        Finish(made.error().Text());
      }
    } else {
      const GhostStep step = std::move(steps.front());
      steps.pop_front();
      GhostView view;
      view.steps = newest->steps + 1;
      lock.unlock();
      const FullStepReport report = twin->Step(step);
      if (report.finite) twin->Measure(step.p_WB, view);
      lock.lock();
      if (mine != session || !on) continue;
      view.time = start_time + static_cast<double>(view.steps) * dt;
      if (report.finite)
        newest = std::move(view);
      else
        Finish(fmt::format(
            "it gave numbers that are not finite at {:.2f} s; take a smaller dt and switch it on again",
            view.time));
    }
  }
}

FullGhost::FullGhost(double most_behind) : detail_(std::make_unique<Detail>(most_behind)) {}
FullGhost::~FullGhost() = default;

void FullGhost::Begin(GhostStart start) {
  Detail& d = *detail_;
  const std::lock_guard<std::mutex> lock(d.mutex);
  d.on = true;
  ++d.session;
  d.dt = start.options.dt;
  d.start_time = start.time;
  d.start = std::move(start);
  d.steps.clear();
  d.pushed = 0;
  d.newest.reset();
  d.fault.reset();
  d.wake.notify_one();
}

void FullGhost::End() {
  Detail& d = *detail_;
  const std::lock_guard<std::mutex> lock(d.mutex);
  d.on = false;
  ++d.session;
  d.start.reset();
  d.steps.clear();
  d.newest.reset();
  d.wake.notify_one();
}

bool FullGhost::on() const {
  const std::lock_guard<std::mutex> lock(detail_->mutex);
  return detail_->on;
}

void FullGhost::Push(GhostStep step) {
  Detail& d = *detail_;
  const std::lock_guard<std::mutex> lock(d.mutex);
  if (!d.on) return;
  d.steps.push_back(std::move(step));
  ++d.pushed;
  if (static_cast<double>(d.steps.size()) * d.dt > d.most_behind)
    d.Finish(
        fmt::format("it is more than {:g} s behind; take fewer bodies or a larger dt and switch it on again",
                    d.most_behind));
  d.wake.notify_one();
}

std::optional<GhostView> FullGhost::Newest() const {
  const Detail& d = *detail_;
  const std::lock_guard<std::mutex> lock(d.mutex);
  std::optional<GhostView> view = d.newest;
  if (view) view->behind = static_cast<double>(d.pushed - view->steps) * d.dt;
  return view;
}

std::optional<std::string> FullGhost::PopFault() {
  const std::lock_guard<std::mutex> lock(detail_->mutex);
  std::optional<std::string> fault;
  fault.swap(detail_->fault);
  return fault;
}

}  // namespace fork1s
