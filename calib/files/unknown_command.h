// What a program says of a word that is none of its commands, and where no command is given.
#pragma once

#include <fmt/format.h>

#include <string>
#include <vector>

#include "calib/files/nearest_word.h"
#include "calib/files/text_file.h"

namespace huetrack::yaml {

// For a CLI::App, whose header this does without: it is heavy, and fenced in. otherwise: what is said of all other
// mistakes, CLI::FailureMessage::simple.
template <typename App, typename FailureMessage>
void name_unknown_commands(App& app, const std::string& program, FailureMessage otherwise) {
  app.failure_message([program, otherwise](const App* failed, const auto& error) {
    const std::vector<std::string> words = failed->remaining();
    const bool is_of_program = failed->get_parent() == nullptr && failed->get_subcommands().empty();
    std::vector<std::string> commands;
    for (const App* command : failed->get_subcommands({})) commands.push_back(command->get_name());
    if (is_of_program && words.empty() && error.get_name() == "RequiredError") {
      return fmt::format("{0}: a command is wanted: {1}; {0} --help says what they do\n", program,
                         fmt::join(commands, ", "));
    }
    if (!is_of_program || words.empty() || words.front().starts_with("-")) return otherwise(failed, error);
    const auto near = nearest_word(words.front(), commands);
    return program + ": there is no command " + printable(words.front()) +
           (near ? " (did you mean " + *near + "?)" : "") + "; " + program + " --help lists them\n";
  });
}

}  // namespace huetrack::yaml
