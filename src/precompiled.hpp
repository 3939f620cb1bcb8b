// What nearly every file of the library and its programs includes, compiled once. Files still include what they
// use: this is not for them to lean on (FORK1S_PCH=OFF builds without it). It holds nothing that changes from day to
// day, and nothing that only some files use: what is in here costs every file its loading.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <tl/expected.hpp>

#include "base/eigen_kernels.hpp"
