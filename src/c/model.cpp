#include "model.hpp"

#include <locale.h>

#include <utility>

#include "calls.hpp"
#include "options.hpp"
#include "record/child_reader.hpp"

namespace fork1s::c {
namespace {

// Numbers of files have decimal points, whatever language the program has set: this thread reads them so meanwhile.
class NumbersWithPoints {
 public:
  NumbersWithPoints() : ours_(newlocale(LC_NUMERIC_MASK, "C", static_cast<locale_t>(nullptr))) {
    if (ours_) before_ = uselocale(ours_);
  }
  ~NumbersWithPoints() {
    if (!ours_) return;
    uselocale(before_);
    freelocale(ours_);
  }
  NumbersWithPoints(const NumbersWithPoints&) = delete;
  NumbersWithPoints& operator=(const NumbersWithPoints&) = delete;

 private:
  locale_t ours_, before_{};
};

fork1s_model* MakeModel(Expected<ImportedScene> imported, std::string origin) {
  auto model = std::make_shared<Model>();
  model->imported = ValueOrThrow(std::move(imported), origin);
  model->joints = MovingJoints(model->imported.joints, model->imported.scene);
  for (const ImportNote& note : model->imported.report.notes) model->notes.push_back(note.Text());
  model->origin = std::move(origin);
  return new fork1s_model{std::move(model)};
}

Expected<ImportedScene> Load(const std::string& path, const LoadOptions& options) {
  if (options.reader.empty()) return LoadMechanism(path, options.import);
  return ReadInChild({options.reader, options.read_time, "option 'read_time'"}, path, options.import,
                     [] { return false; });
}

}  // namespace
}  // namespace fork1s::c

using namespace fork1s::c;

fork1s_status fork1s_model_load(const char* path, const char* options, fork1s_model** model) {
  return Guard(__func__, [&] {
    RequireGiven(path, "path");
    RequireGiven(model, "model");
    const NumbersWithPoints numbers;
    *model = MakeModel(Load(path, ReadLoadOptions(options)), path);
  });
}

fork1s_status fork1s_model_load_text(const char* mjcf, const char* name, const char* options,
                                     fork1s_model** model) {
  return Guard(__func__, [&] {
    RequireGiven(mjcf, "mjcf");
    RequireGiven(name, "name");
    RequireGiven(model, "model");
    const LoadOptions read = ReadLoadOptions(options);
    if (!read.reader.empty())
      Misuse("option 'reader': text is read in this process; write it to a file and use fork1s_model_load");
    const NumbersWithPoints numbers;
    *model = MakeModel(fork1s::LoadMechanismFromString(mjcf, name, read.import), name);
  });
}

void fork1s_model_free(fork1s_model* model) { delete model; }

fork1s_status fork1s_model_num_notes(const fork1s_model* model, int32_t* count) {
  return Guard(__func__, [&] {
    RequireGiven(model, "model");
    RequireGiven(count, "count");
    *count = static_cast<int32_t>(model->model->notes.size());
  });
}

fork1s_status fork1s_model_note(const fork1s_model* model, int32_t index, const char** text) {
  return Guard(__func__, [&] {
    RequireGiven(model, "model");
    RequireGiven(text, "text");
    const auto& notes = model->model->notes;
    *text = notes[RequireIndex("note", index, notes.size())].c_str();
  });
}
