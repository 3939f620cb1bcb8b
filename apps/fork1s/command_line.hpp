// Help and messages of the command line.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace fork1s::app {

/// Options by value: a word in place of types, ranges and lists of allowed values, which the descriptions
/// have.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override;
};

/// What is wrong with the command or option that the program does not have, with near names. Empty: each is
/// known.
std::string UnknownWord(const CLI::App& app, int argc, const char* const* argv);

}  // namespace fork1s::app
