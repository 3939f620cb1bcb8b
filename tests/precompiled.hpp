// What nearly every test includes, compiled once. Tests still include what they use.
#pragma once

#include "../src/precompiled.hpp"

#include <gtest/gtest.h>
