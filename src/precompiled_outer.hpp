// What rooms that no step runs through, programs and tests include besides, compiled once at their level of
// optimisation. Loading it costs a file the same however much is in here.
#pragma once

#include "base/eigen_expressions.hpp"
#include "precompiled.hpp"

#if __has_include(<nlohmann/json.hpp>)
#include <nlohmann/json.hpp>
static_assert(sizeof(nlohmann::json) > 0);  // completes the class
#endif
#if __has_include(<gtest/gtest.h>)
#include <gtest/gtest.h>
#endif
