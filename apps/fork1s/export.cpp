#include <fmt/format.h>
#include <algorithm>
#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fork1s/record/gltf.hpp>
#include <fork1s/record/recording.hpp>
#include <map>
#include <memory>

#include "checks.hpp"
#include "export_unit.hpp"
#include "model_arguments.hpp"
#include "output.hpp"
#include "page.hpp"
#include "print.hpp"
#include "record/output_file.hpp"
#include "server/wire.hpp"
#include "video.hpp"

namespace fork1s::app {
namespace {

struct ExportArguments {
  ModelArguments model;  // its path: of a recording too
  UnitArguments unit;
  std::string out, look_at;
  bool all_bodies = false, video = false;
  VideoOptions options;
  std::vector<double> from;   // degrees
  std::optional<double> fps;  // frames of a film or keys of a glTF animation, a second
  CLI::Option* color_by_option = nullptr;
  CLI::App* command = nullptr;
};

// The camera as the arguments want it.
Expected<VideoOptions> Camera(const Recording& recording, const ExportArguments& args) {
  VideoOptions options = args.options;
  if (args.fps && *args.fps > 0) options.fps = args.fps;
  if (!args.from.empty()) {
    options.azimuth = args.from[0];
    options.elevation = args.from[1];
  }
  if (args.look_at.empty()) return options;
  for (std::size_t i = 0; i < recording.bodies().size(); ++i)
    if (recording.bodies()[i].name == args.look_at) options.body = static_cast<int>(i);
  if (!options.body) {
    std::string known;
    for (const SceneBody& b : recording.bodies()) known += (known.empty() ? "" : ", ") + b.name;
    return Fail(ErrorCode::kUsage, "--look-at",
                fmt::format("the recording has no body '{}'; there are: {}", args.look_at, known));
  }
  return options;
}

int WriteTables(const ExportArguments& args) {
  CsvOptions options;
  options.all_bodies = args.all_bodies;
  auto recording = RecordingReader::Open(args.model.path);
  if (!recording) return Report(recording.error(), false);
  const auto steps = ExportCsv(*recording, args.out, options);
  if (!steps) return Report(steps.error(), false);
  const RecordingHeader& header = recording->header();
  if (!header.scene.sensors.empty() && header.sensor_names.empty())
    PrintText(stderr,
              "warning: {} was written by {}, which did not record what sensors measure: sensors.csv has the "
              "time alone; run the model again with --record\n",
              header.path, header.program);
  PrintText("wrote {} steps to {}/*.csv\n", *steps, args.out);
  return kDone;
}

int WritePage(const Recording& recording, const ExportArguments& args) {
  auto page = MakeReplayPage(recording);
  if (!page) return Report(page.error(), false);
  if (auto written = WriteFile(args.out, kHtmlFile, *page); !written) return Report(written.error(), false);
  PrintText("wrote {} ({:.2f} MB): open it in a browser, it needs no server\n", args.out,
            static_cast<double>(page->size()) * 1e-6);
  return kDone;
}

int WriteGltf(const Recording& recording, const ExportArguments& args) {
  GltfOptions options;
  if (args.fps) options.fps = *args.fps;
  if (auto written = ExportGltf(recording, args.out, options); !written)
    return Report(written.error(), false);
  std::error_code ignored;
  PrintText("wrote {} ({:.2f} MB): open it in Blender or any other program that reads glTF 2.0\n", args.out,
            static_cast<double>(std::filesystem::file_size(args.out, ignored)) * 1e-6);
  return kDone;
}

// The last moment is drawn where the asked one is beyond it.
void SayWhereItEnds(const Recording& recording, double at) {
  const std::vector<double>& times = recording.data().time;
  const double dt = recording.header().options.dt;
  const double end = times.empty() ? 0 : times.back() - times.front() + dt;
  if (at > end + 0.5 * dt)
    PrintText(stderr,
              "warning: --at {:g} s is after the end of the recording at {:.6g} s, whose last moment is "
              "drawn\n",
              at, end);
}

int WriteFilm(const Recording& recording, const ExportArguments& args) {
  auto camera = Camera(recording, args);
  if (!camera) return Report(camera.error(), false);
  if (args.options.at) SayWhereItEnds(recording, *args.options.at);
  auto page = MakeReplayPage(recording);
  if (!page) return Report(page.error(), false);
  auto frames = RenderVideo(*page, args.out, *camera);
  if (!frames) return Report(frames.error(), false);
  PrintText("wrote {} frames to {}\n", *frames, args.out);
  return kDone;
}

enum class Output { kOfRecording, kModel, kUnit };

// Each kind of output has options of its own.
Expected<void> RefuseForeignOptions(const ExportArguments& args, Output output) {
  for (const CLI::Option* option : args.command->get_options()) {
    if (option->count() == 0 || option->get_positional()) continue;
    const bool of_model = option->get_group() == kModelOptions || option->get_name() == "--json";
    const bool of_unit = option->get_group() == kUnitOptions;
    if (of_unit ? output == Output::kUnit : of_model == (output != Output::kOfRecording)) continue;
    return Fail(ErrorCode::kUsage, option->get_name(),
                of_unit ? "belongs to the export of a model to OUT.fmu"
                : of_model
                    ? "belongs to the export of a model to OUT.xml or OUT.fmu; a recording has its model as "
                      "it was simulated"
                    : "belongs to the export of a recording; OUT.xml and OUT.fmu are written of a model");
  }
  return {};
}

int ExportModel(const ExportArguments& args) {
  const auto refuse = [&](const Error& error) { return Report(error, args.model.json); };
  if (auto ok = RefuseForeignOptions(args, Output::kModel); !ok) return refuse(ok.error());
  // Writing needs the compiled model in this process: a child reads it first.
  if (const auto read = args.model.Load(); !read) return refuse(read.error());
  const auto written = args.model.WriteMjcf(args.out);
  if (!written) return refuse(written.error());
  if (args.model.json) {
    Json out;
    out["written"] = args.out;
    out["keyframe"] = written->start;
    out["notes"] = NotesJson(written->imported.report);
    PrintText("{}\n", ToText(out, 2));
    return kDone;
  }
  PrintNotes(written->imported.report);
  PrintText(
      "wrote {}{}{}\n", args.out,
      written->meshes.empty() ? "" : fmt::format(" and {} mesh files beside it", written->meshes.size()),
      written->start.empty() ? "" : fmt::format("; it starts at --keyframe {}", written->start));
  return kDone;
}

// What to write, by the extension of the name; without one it is a folder.
int Run(const ExportArguments& args) {
  const std::filesystem::path out(args.out);
  const std::string extension = out.extension().string();
  auto is = [&](std::initializer_list<const char*> names) {
    return std::find(names.begin(), names.end(), extension) != names.end();
  };
  if (auto ok = RefuseInputs(args.out, {args.model.path}); !ok) return Report(ok.error(), args.model.json);
  const bool model = is({".xml", ".mjcf"}), unit = is({".fmu"});
  if ((model || unit) && IsHdf5(args.model.path))
    return Report({ErrorCode::kUsage, args.model.path,
                   "is a recording, which has no model file to write; give the MJCF or URDF in its place"},
                  args.model.json);
  if (model) return ExportModel(args);
  if (unit) {
    if (auto ok = RefuseForeignOptions(args, Output::kUnit); !ok) return Report(ok.error(), args.model.json);
    return ExportUnit(args.model, args.unit, args.out);
  }
  if (auto ok = RefuseForeignOptions(args, Output::kOfRecording); !ok) return Report(ok.error(), false);
  const bool page = is({".html", ".htm"}), gltf = is({".glb", ".gltf"}), film = is({".mp4", ".png"});
  if (!page && !gltf && !film && !extension.empty() && !args.video && !std::filesystem::is_directory(out))
    return Report(
        {ErrorCode::kUsage, args.out,
         is({".mcap", ".rrd"})
             ? fmt::format("is a file of a log viewer, which the Python package writes: pip install "
                           "'fork1s[logs]', then python -m fork1s.logs {} {}",
                           args.model.path, args.out)
             : fmt::format(
                   "the extension '{0}' is not known; known are .html, .glb, .gltf, .mp4 and .png, "
                   ".xml and .fmu for a model, and a folder for CSV tables: write {1}/ if it is the name of one",
                   extension, args.out)},
        false);
  if (args.color_by_option->count() > 0 && !film && !args.video)
    return Report({ErrorCode::kUsage, "--color-by",
                   "belongs to films and pictures; other exports hold the file's colours, and the page has a "
                   "choice of its own"},
                  false);
  const bool frames = args.video || extension == ".mp4";
  if (args.fps && !gltf && !frames)
    return Report({ErrorCode::kUsage, "--fps", "belongs to a film, or to a FILE.glb or FILE.gltf"}, false);
  constexpr double kMaxFilmFps = 1000;
  if (args.fps && frames && *args.fps > kMaxFilmFps)
    return Report({ErrorCode::kUsage, "--fps", fmt::format("of a film is {:g} at most", kMaxFilmFps)}, false);
  if ((extension == ".png") != args.options.at.has_value())
    return Report({ErrorCode::kUsage, "--at", "belongs to a FILE.png, and a FILE.png needs it"}, false);
  if (!page && !gltf && !film && !args.video) return WriteTables(args);
  auto recording = Recording::Open(args.model.path);
  if (!recording) return Report(recording.error(), false);
  if (film || args.video) return WriteFilm(*recording, args);
  if (gltf) return WriteGltf(*recording, args);
  return WritePage(*recording, args);
}

}  // namespace

Expected<std::string> MakeReplayPage(const Recording& recording) {
  if (ViewerPage().empty()) return tl::unexpected(NoPage());
  auto stream = EncodeRecording(recording, recording.scene().name);
  if (!stream) return tl::unexpected(stream.error());
  return ReplayPage(ViewerPage(), *stream);
}

void AddExport(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand("export",
                                     "write a recording as CSV tables, a page that plays it, a glTF "
                                     "animation or a film; or a model as MJCF or as a functional "
                                     "mock-up unit (FMI)");
  auto args = std::make_shared<ExportArguments>();
  args->command = command;
  args->model.AddTo(*command);
  args->unit.AddTo(*command);
  command->get_option("model")->description(
      "HDF5 file of 'fork1s run --record'; for FILE.xml and FILE.fmu a model, MJCF or URDF");
  command
      ->add_option(
          "out", args->out,
          "a folder for poses.csv, contacts.csv, pairs.csv, controls.csv, energy.csv, sensors.csv; "
          "FILE.html: "
          "one page that "
          "plays from "
          "disk; FILE.glb, FILE.gltf: a moving scene for other programs; FILE.mp4: a film; "
          "FILE.png: the moment --at; with --video a folder for PNG frames; FILE.xml: the model with its "
          "options as MJCF for MuJoCo; FILE.fmu: the model with its options for co-simulation in programs that "
          "speak FMI")
      ->required();
  command->add_flag("--all-bodies", args->all_bodies,
                    "tables: poses of every body, not only of interface and free ones");
  command->add_flag("--video", args->video,
                    "draw frames in a headless Chromium: FILE.mp4 (needs ffmpeg) or a folder");
  command->add_option("--width", args->options.width, "of the film in pixels (default 1280)")
      ->check(CLI::Range(64, 3840));
  command->add_option("--height", args->options.height, "of the film in pixels (default 720)")
      ->check(CLI::Range(64, 2160));
  command
      ->add_option("--at", args->options.at, "seconds after the start: draw this moment alone, to FILE.png")
      ->transform(SecondsWithin(0, kMostSeconds));
  command->add_option("--from", args->from, "AZIMUTH,ELEVATION of the camera in degrees, 0,0: from +x")
      ->delimiter(',')
      ->expected(2)
      ->check(NumberWithin(-1e6, 1e6));
  command->add_option("--zoom", args->options.zoom, "how much nearer than to hold everything (default 1)")
      ->check(NumberWithin(0.1, 50));
  static const std::map<std::string, int> colourings = {
      {"file", 0}, {"interface", 1}, {"roles", 2}, {"gaps", 3}};
  args->color_by_option =
      command
          ->add_option("--color-by", args->options.colouring,
                       "of films and pictures: file (default), interface: bodies that may touch stand out, "
                       "roles: interface, interior and free bodies, gaps: how far joints open")
          ->transform(OneOf(colourings));
  command->add_flag("!--no-forces", args->options.forces, "draw no contact forces");
  command->add_option("--look-at", args->look_at, "a body for the middle of the picture");
  command
      ->add_option("--fps", args->fps,
                   "films: frames a second, so that they play in real time (default and 0: one every step, "
                   "60 a second); "
                   "glTF: keys a second at most (default 60; 0: one every step)")
      ->check(NumberWithin(0, 1e6));
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
