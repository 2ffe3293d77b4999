// The subcommands. Each returns the exit status: 0, or 1 after it has said why on stderr. SIGINT and SIGTERM end them.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "idl/dds_participant.h"
#include "sample_format.h"

namespace huetrack::client {

struct WatchOptions {
  idl::ParticipantOptions participant;
  Format format = Format::text;
  std::string target;                                    // empty: every target
  std::optional<std::string> camera;                     // poses of this camera instead ("all": of every one)
  std::optional<std::uint64_t> count;                    // end after so many lines
  std::optional<std::chrono::duration<double>> timeout;  // end with 1 when no line came for so long
  std::filesystem::path file;                            // empty: stdout
  bool overwrite = false;                                // an existing file
};

void end_on_signals();  // call once, before the others
bool has_ended();       // a signal came

int watch(const WatchOptions& options);  // `watch`, and `log` with a file
int status(const idl::ParticipantOptions& options);

}  // namespace huetrack::client
