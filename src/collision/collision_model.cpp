#include "collision_model.hpp"

#include <cstring>
#include <map>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include "base/compiler_lock.hpp"
#include "pair_routines.hpp"

namespace fork1s::internal {
namespace {

[[noreturn]] void ThrowMujocoError(const char* message) {
  if (std::string_view(message).find("allocate memory") != std::string_view::npos) throw std::bad_alloc();
  throw std::runtime_error(message);
}

/// Files in memory for MuJoCo's compiler, which takes ownership of what it is given until the end.
class MemoryFiles {
 public:
  MemoryFiles() : vfs_(std::make_unique<mjVFS>()) { mj_defaultVFS(vfs_.get()); }
  ~MemoryFiles() { mj_deleteVFS(vfs_.get()); }
  MemoryFiles(const MemoryFiles&) = delete;
  MemoryFiles& operator=(const MemoryFiles&) = delete;

  bool Add(const std::string& name, const std::string& content) {
    return mj_addBufferVFS(vfs_.get(), name.c_str(), content.data(), static_cast<int>(content.size())) == 0;
  }
  const mjVFS* get() const { return vfs_.get(); }

 private:
  std::unique_ptr<mjVFS> vfs_;
};

/// The geometry that a compiler message speaks of ("... name = m3 ...").
std::string PlaceOf(const std::string& message, const ModelText& text,
                    const std::vector<CollisionBodyDef>& bodies) {
  const std::size_t at = message.find("name = ");
  if (at == std::string::npos || at + 8 >= message.size()) return "collision model";
  const char kind = message[at + 7];
  const int index = std::atoi(message.c_str() + at + 8);
  for (std::size_t k = 0; k < text.geoms.size(); ++k) {
    const CollisionGeom& geom = text.geoms[k];
    if ((kind == 'g' && static_cast<int>(k) == index) || (kind == 'm' && geom.mesh == index) ||
        (kind == 'h' && geom.grid == index)) {
      return Place(bodies[static_cast<std::size_t>(geom.body)], geom.geometry);
    }
  }
  return "collision model";
}

/// What went wrong, without MuJoCo's own names for the parts.
std::string FirstLine(const std::string& message) {
  std::string line = message.substr(0, message.find('\n'));
  constexpr const char* kPrefix = "Error: ";
  if (line.rfind(kPrefix, 0) == 0) line.erase(0, std::strlen(kPrefix));
  return line;
}

ModelPointer TryCompile(const ModelText& text, bool with_triangles, std::string& message) {
  MemoryFiles files;
  bool added = files.Add("model.xml", text.xml);
  for (std::size_t k = 0; k < text.meshes.size() && added; ++k) {
    added = files.Add(Text("m", k, ".msh"), WriteMsh(*text.meshes[k], with_triangles));
  }
  if (!added) {
    message = "too many meshes, or too large ones";
    return nullptr;
  }
  char error[1000] = "";
  try {
    ModelPointer model(mj_loadXML("model.xml", files.get(), error, sizeof error));
    message = error;
    // The text is written here and well-formed: what MuJoCo's parser lacks is memory, which it does not say.
    if (!model && message.find("XML parse error") != std::string::npos) throw std::bad_alloc();
    return model;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& failure) {
    message = failure.what();
    return nullptr;
  }
}

/// What a compiled model depends on.
struct SharedKey {
  std::string xml;
  std::vector<std::shared_ptr<const TriangleMesh>> meshes;
  std::vector<std::shared_ptr<const HeightGrid>> grids;
  bool multi_point = true;

  bool operator<(const SharedKey& o) const {
    return std::tie(xml, meshes, grids, multi_point) < std::tie(o.xml, o.meshes, o.grids, o.multi_point);
  }
};

/// Models in use. A key holds its meshes, so that no other mesh comes to lie where one of them does.
class SharedModels {
 public:
  std::shared_ptr<const mjModel> Find(const SharedKey& key) {
    const std::lock_guard lock(mutex_);
    const auto at = models_.find(key);
    return at == models_.end() ? nullptr : at->second.lock();
  }
  std::shared_ptr<const mjModel> Add(SharedKey key, ModelPointer model) {
    // Before the lock and released after it: the deleter takes it too, also where there is no memory for the
    // pointer.
    const std::shared_ptr<const mjModel> shared(model.release(), [this](mjModel* unused) {
      mj_deleteModel(unused);
      const std::lock_guard deleting(mutex_);
      std::erase_if(models_, [](const auto& entry) { return entry.second.expired(); });
    });
    const std::lock_guard lock(mutex_);
    const auto at = models_.try_emplace(std::move(key)).first;
    // Another thread may have compiled the same meanwhile.
    if (std::shared_ptr<const mjModel> there = at->second.lock()) return there;
    at->second = shared;
    return shared;
  }

 private:
  std::mutex mutex_;
  std::map<SharedKey, std::weak_ptr<const mjModel>> models_;
};

}  // namespace

Expected<std::shared_ptr<const mjModel>> CompileShared(const ModelText& text,
                                                       const std::vector<CollisionBodyDef>& bodies,
                                                       bool multi_point) {
  static SharedModels& models = *new SharedModels;  // for worlds that outlive static objects
  SharedKey key{text.xml, text.meshes, text.grids, multi_point};
  if (auto found = models.Find(key)) return found;
  Expected<ModelPointer> compiled = CompileModel(text, bodies);
  if (!compiled) return tl::make_unexpected(compiled.error());
  SetPairOptions(**compiled, multi_point);
  return models.Add(std::move(key), std::move(*compiled));
}

void CatchMujocoErrors() {
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  if (mju_user_error == nullptr) mju_user_error = &ThrowMujocoError;
}

Expected<ModelPointer> CompileModel(const ModelText& text, const std::vector<CollisionBodyDef>& bodies) {
  const std::lock_guard<std::mutex> lock(CompilerLock());
  CatchMujocoErrors();
  InstallPairRoutines();
  std::string message;
  ModelPointer model = TryCompile(text, true, message);
  if (!model && !text.meshes.empty()) {
    // Contact needs only the hull, so badly oriented or open triangles are no reason to refuse a mesh.
    std::string hull_message;
    model = TryCompile(text, false, hull_message);
  }
  if (!model) return Fail(ErrorCode::kModel, PlaceOf(message, text, bodies), FirstLine(message));
  for (std::size_t k = 0; k < text.grids.size(); ++k) {
    const HeightGrid& grid = *text.grids[k];
    float* target = model->hfield_data + model->hfield_adr[k];
    for (std::size_t i = 0; i < grid.values.size(); ++i) target[i] = grid.max_height > 0 ? grid.values[i] : 0;
  }
  return model;
}

}  // namespace fork1s::internal
