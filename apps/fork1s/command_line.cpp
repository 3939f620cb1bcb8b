#include "command_line.hpp"
#include "base/near_names.hpp"

#include <fmt/format.h>

namespace fork1s::app {

std::string HelpFormatter::make_option_opts(const CLI::Option* option) const {
  if (option->get_type_size() == 0) return "";
  std::string type = option->get_type_name();
  type = type.substr(0, type.find_first_of(":{"));  // behind it stand the checks
  if (type == "INT" || type == "UINT") type = "N";
  if (type == "FLOAT") type = "X";
  if (type == "ENUM") type = "WORD";
  if (option->get_positional() && type == "TEXT") return option->get_required() ? "" : " (optional)";
  return " " + type;
}

std::string UnknownWord(const CLI::App& app, int argc, const char* const* argv) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  if (parsed.empty()) {
    for (int i = 1; i < argc; ++i) {
      const std::string word = argv[i];
      if (word.empty() || word[0] == '-') continue;
      std::vector<std::string> commands;
      for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
        commands.push_back(command->get_name());
      return fmt::format("'{}' is no command{}", word, Suggestion(word, commands));
    }
    return "";
  }
  const CLI::App& command = *parsed.front();
  for (const std::string& word : command.remaining()) {
    if (word.size() < 2 || word[0] != '-') continue;
    const std::string option = word.substr(0, word.find('='));
    std::vector<std::string> options;
    for (const CLI::Option* known : command.get_options())
      if (!known->get_group().empty())
        for (const std::string& name : known->get_lnames()) options.push_back("--" + name);
    return fmt::format("'{} {}' has no option '{}'{}", app.get_name(), command.get_name(), option,
                       Suggestion(option, options));
  }
  return "";
}

}  // namespace fork1s::app
