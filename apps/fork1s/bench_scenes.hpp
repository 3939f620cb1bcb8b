// Which scenes and peers `bench` means, and what drives them.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <vector>

#include "study/bench.hpp"

namespace fork1s::app {

struct BenchModel {
  std::string name, path;
  std::string controls;  // a table beside it of the same name; empty: none
};

/// The folder of the scenes that come with this program; empty: there is none.
std::string OwnScenes();

/// A path to a model, or the name of one in scenes/ of the present folder or of OwnScenes(). Errors: kFile.
Expected<BenchModel> FindBenchModel(const std::string& scene);

/// All in scenes/ of the present folder, or of OwnScenes(). Errors: kFile where there are none.
Expected<std::vector<BenchModel>> AllBenchModels();

/// "drake", "dart" or "bullet", as tools/peers.sh installs them beside the scenes that come with this
/// program.
OutsidePeer FindPeer(const std::string& peer);

}  // namespace fork1s::app
