// Error messages of a program for an unknown command, an unknown option, or a missing command.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "calib/files/nearest_word.h"
#include "calib/files/text_file.h"

namespace huetrack::files {

// The message for `word`, which is none of `options` (long names without dashes) of `command`, as in "huetrackd
// replay".
inline std::string unknown_option(const std::string& command, std::string_view word,
                                  const std::vector<std::string>& options) {
  word = word.substr(0, word.find('='));
  const auto bare = [](std::string_view name) {
    std::string out(name.substr(std::min(name.find_first_not_of('-'), name.size())));
    std::ranges::replace(out, '-', '_');  // as nearest_word() expects the parts of a name
    return out;
  };
  std::vector<std::string> names;
  for (const std::string& option : options) names.push_back(bare(option));
  std::string near;
  if (const auto name = nearest_word(bare(word), names)) {
    near = " (did you mean --" + options[std::ranges::find(names, *name) - names.begin()] + "?)";
  }
  return fmt::format("{0} has no option {1}{2}; {0} --help lists them\n", command, printable(word), near);
}

// App: a CLI::App; a template because the CLI11 header is heavy and fenced in. otherwise: the message for all other
// mistakes, CLI::FailureMessage::simple.
template <typename App, typename FailureMessage>
void name_unknown_words(App& app, const std::string& program, FailureMessage otherwise) {
  app.failure_message([program, otherwise](const App* failed, const auto& error) {
    const std::vector<std::string> words = failed->remaining();
    const bool is_of_program = failed->get_subcommands().empty();
    std::vector<std::string> commands;
    for (const App* command : failed->get_subcommands({})) commands.push_back(command->get_name());
    if (is_of_program && words.empty() && error.get_name() == "RequiredError") {
      return fmt::format("{0}: a command is missing: {1}; {0} --help explains them\n", program,
                         fmt::join(commands, ", "));
    }
    if (is_of_program && !words.empty() && !words.front().starts_with("-")) {
      const auto near = nearest_word(words.front(), commands);
      return program + ": there is no command " + printable(words.front()) +
             (near ? " (did you mean " + *near + "?)" : "") + "; " + program + " --help lists them\n";
    }
    std::vector<const App*> named{failed};
    for (const App* command : failed->get_subcommands()) named.push_back(command);
    for (const App* command : named) {
      for (const std::string& word : command->remaining()) {
        if (word.size() < 2 || word.front() != '-') continue;
        std::vector<std::string> options;
        for (const auto* option : command->get_options())
          for (const std::string& name : option->get_lnames()) options.push_back(name);
        return unknown_option(command == failed ? program : program + " " + command->get_name(), word, options);
      }
    }
    return otherwise(failed, error);
  });
}

}  // namespace huetrack::files
