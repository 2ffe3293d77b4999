// Error messages of a program for an unknown or a missing command.
#pragma once

#include <fmt/format.h>

#include <string>
#include <vector>

#include "calib/files/nearest_word.h"
#include "calib/files/text_file.h"

namespace huetrack::files {

// App: a CLI::App; a template because the CLI11 header is heavy and fenced in. otherwise: the message for all other
// mistakes, CLI::FailureMessage::simple.
template <typename App, typename FailureMessage>
void name_unknown_commands(App& app, const std::string& program, FailureMessage otherwise) {
  app.failure_message([program, otherwise](const App* failed, const auto& error) {
    const std::vector<std::string> words = failed->remaining();
    const bool is_of_program = failed->get_parent() == nullptr && failed->get_subcommands().empty();
    std::vector<std::string> commands;
    for (const App* command : failed->get_subcommands({})) commands.push_back(command->get_name());
    if (is_of_program && words.empty() && error.get_name() == "RequiredError") {
      return fmt::format("{0}: a command is missing: {1}; {0} --help explains them\n", program,
                         fmt::join(commands, ", "));
    }
    if (!is_of_program || words.empty() || words.front().starts_with("-")) return otherwise(failed, error);
    const auto near = nearest_word(words.front(), commands);
    return program + ": there is no command " + printable(words.front()) +
           (near ? " (did you mean " + *near + "?)" : "") + "; " + program + " --help lists them\n";
  });
}

}  // namespace huetrack::files
